//! The tables `episodes.csv` and `rounds.csv`. [`TableRecorder`] writes them, [`read`] reads them.

use std::io;
use std::path::{Path, PathBuf};

use seedbed_input::limits::{MAX_TABLE_BYTES, read_text};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::run::recorder::{Attempt, RecordError, Recorder, RecorderFactory, RoundRecord, RunInfo};
use crate::scenario::recording::RecordingSettings;
use crate::storage::written::{HashedFile, Written, WrittenFile};

/// The tables that a run will write.
#[derive(Debug)]
pub struct TableFiles {
    /// The folder that will contain both files.
    pub folder: PathBuf,
}

impl RecorderFactory for TableFiles {
    fn create(
        self: Box<Self>,
        _: &RunInfo<'_>,
        _: &RecordingSettings,
    ) -> Result<Box<dyn Recorder>, RecordError> {
        Ok(Box::new(TableRecorder::create(&self.folder)?))
    }

    fn resume(
        self: Box<Self>,
        _: &RunInfo<'_>,
        _: &RecordingSettings,
        checkpoint: &[u8],
    ) -> Result<Box<dyn Recorder>, RecordError> {
        Ok(Box::new(TableRecorder::resume(&self.folder, checkpoint)?))
    }
}

/// Writes `episodes.csv` and `rounds.csv` of a run.
pub struct TableRecorder {
    episodes: Table,
    rounds: Table,
}

impl TableRecorder {
    /// Starts empty tables in `folder`.
    ///
    /// # Errors
    /// If a file cannot be created.
    pub fn create(folder: &Path) -> Result<Self, RecordError> {
        Self::open(folder, [Written::default(); 2])
    }

    /// Resumes the tables in `folder` from a [`checkpoint`](Recorder::checkpoint). Rows that were
    /// written after the checkpoint are removed.
    ///
    /// # Errors
    /// If a file is missing, or if it does not begin with what it contained at the checkpoint.
    pub fn resume(folder: &Path, checkpoint: &[u8]) -> Result<Self, RecordError> {
        let written = postcard::from_bytes(checkpoint).map_err(|error| RecordError {
            path: folder.to_owned(),
            attempt: Attempt::Resume,
            reason: format!("unreadable checkpoint: {error}"),
        })?;
        Self::open(folder, written)
    }

    fn open(folder: &Path, [episodes, rounds]: [Written; 2]) -> Result<Self, RecordError> {
        Ok(Self {
            episodes: Table::open(folder.join("episodes.csv"), episodes)?,
            rounds: Table::open(folder.join("rounds.csv"), rounds)?,
        })
    }
}

impl Recorder for TableRecorder {
    fn record_round(&mut self, round: &RoundRecord<'_>) -> Result<(), RecordError> {
        self.episodes.append(round.episode_rows)?;
        self.rounds.append(round.round_rows)
    }

    fn checkpoint(&mut self) -> Result<Vec<u8>, RecordError> {
        let written = [self.episodes.sync()?, self.rounds.sync()?];
        Ok(postcard::to_stdvec(&written).expect("numbers can always be serialized"))
    }

    fn written_files(&self) -> Vec<WrittenFile> {
        let tables = [&self.episodes, &self.rounds];
        tables.map(Table::written_file).into()
    }

    fn finish(&mut self) -> Result<(), RecordError> {
        self.episodes.sync()?;
        self.rounds.sync().map(|_| ())
    }
}

/// Error: a table cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("cannot read {path}: {reason}")]
pub struct TableError {
    /// The file.
    pub path: PathBuf,
    /// Reason, with the line of the file if it is known.
    pub reason: String,
}

/// Reads the rows of a table: [`EpisodeRow`](crate::run::facts::EpisodeRow) of `episodes.csv`,
/// [`RoundRow`](crate::run::facts::RoundRow) of `rounds.csv`. Columns are found by name. An incomplete last
/// row, as a killed run may leave it, is ignored.
///
/// # Errors
/// If the file cannot be read, if a column is missing, or if a row is invalid.
pub fn read<R: DeserializeOwned>(path: &Path) -> Result<Vec<R>, TableError> {
    let error_with_path = |reason: String| TableError {
        path: path.to_owned(),
        reason,
    };
    let complete_rows = read_complete_rows(path)?;
    let rows: Result<Vec<R>, csv::Error> = csv::Reader::from_reader(complete_rows.as_bytes())
        .into_deserialize()
        .collect();
    rows.map_err(|error| error_with_path(error.to_string()))
}

/// Reads the text of a table without an incomplete last row.
///
/// # Errors
/// If the file cannot be read.
pub fn read_complete_rows(path: &Path) -> Result<String, TableError> {
    let text = read_text(path, MAX_TABLE_BYTES).map_err(|error| TableError {
        path: path.to_owned(),
        reason: error.to_string(),
    });
    let mut text = text?;
    text.truncate(text.rfind('\n').map_or(0, |end| end + 1));
    Ok(text)
}

struct Table {
    path: PathBuf,
    writer: csv::Writer<HashedFile>,
}

impl Table {
    /// Opens the file and removes what follows after `written`. If nothing was written, the first row
    /// is preceded by a header.
    fn open(path: PathBuf, written: Written) -> Result<Self, RecordError> {
        match HashedFile::open(&path, written) {
            Ok(file) => Ok(Self {
                writer: csv::WriterBuilder::new()
                    .has_headers(written.length == 0)
                    .from_writer(file),
                path,
            }),
            Err(error) => {
                let attempt = if written.length > 0 {
                    Attempt::Resume
                } else {
                    Attempt::Write
                };
                Err(RecordError {
                    path,
                    attempt,
                    reason: error.to_string(),
                })
            }
        }
    }

    fn append<R: Serialize>(&mut self, rows: &[R]) -> Result<(), RecordError> {
        rows.iter()
            .try_for_each(|row| self.writer.serialize(row))
            .map_err(|error| self.error_with_path(error))
    }

    /// Writes all rows to the disk.
    fn sync(&mut self) -> Result<Written, RecordError> {
        let written = self.flush();
        written.map_err(|error| self.error_with_path(error))
    }

    fn flush(&mut self) -> io::Result<Written> {
        self.writer.flush()?;
        self.writer.get_ref().sync()
    }

    /// What has been written of the file.
    fn written_file(&self) -> WrittenFile {
        WrittenFile {
            path: self.path.clone(),
            written: self.writer.get_ref().written(),
        }
    }

    fn error_with_path(&self, error: impl std::fmt::Display) -> RecordError {
        RecordError {
            path: self.path.clone(),
            attempt: Attempt::Write,
            reason: error.to_string(),
        }
    }
}
