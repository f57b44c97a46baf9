//! The tables `episodes.csv` and `rounds.csv`: what reports and other tools read. [`read`] takes
//! them up again.

use std::fs::{File, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{
    Attempt, RecordError, Recorder, RecorderFactory, RecordingSettings, RoundRecord, RunInfo,
};

/// The tables that a run will write.
#[derive(Debug)]
pub struct TableFiles {
    /// The folder that will hold both.
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

/// Writes both tables of a run.
pub struct TableRecorder {
    episodes: Table,
    rounds: Table,
}

impl TableRecorder {
    /// Starts empty tables in `folder`.
    ///
    /// # Errors
    /// A file cannot be created.
    pub fn create(folder: &Path) -> Result<Self, RecordError> {
        Self::open(folder, [0, 0])
    }

    /// Goes on with the tables in `folder` where [`checkpoint`](Recorder::checkpoint) left them;
    /// later rows are cut off.
    ///
    /// # Errors
    /// A file is missing or shorter than it was.
    pub fn resume(folder: &Path, checkpoint: &[u8]) -> Result<Self, RecordError> {
        let lengths = postcard::from_bytes(checkpoint).map_err(|error| RecordError {
            path: folder.to_owned(),
            attempt: Attempt::Resume,
            reason: format!("unreadable checkpoint: {error}"),
        })?;
        Self::open(folder, lengths)
    }

    fn open(folder: &Path, [episodes, rounds]: [u64; 2]) -> Result<Self, RecordError> {
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
        let lengths = [self.episodes.sync()?, self.rounds.sync()?];
        Ok(postcard::to_stdvec(&lengths).expect("two numbers always serialise"))
    }

    fn finish(&mut self) -> Result<(), RecordError> {
        self.episodes.sync()?;
        self.rounds.sync().map(|_| ())
    }
}

/// A table that cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("cannot read {path}: {reason}")]
pub struct TableError {
    /// The file.
    pub path: PathBuf,
    /// What is the matter, and in which line.
    pub reason: String,
}

/// Reads the rows of a table: of `episodes.csv` as [`EpisodeRow`](super::EpisodeRow), of
/// `rounds.csv` as [`RoundRow`](super::RoundRow). Columns are found by their names. A last row that
/// is torn, as a killed run may leave it, is left out.
///
/// # Errors
/// The file cannot be read, lacks a column, or has a row that is no row of this table.
pub fn read<R: DeserializeOwned>(path: &Path) -> Result<Vec<R>, TableError> {
    let fault = |reason: String| TableError {
        path: path.to_owned(),
        reason,
    };
    let text = std::fs::read_to_string(path).map_err(|error| fault(error.to_string()))?;
    let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
    let rows: Result<Vec<R>, csv::Error> = csv::Reader::from_reader(whole.as_bytes())
        .into_deserialize()
        .collect();
    rows.map_err(|error| fault(error.to_string()))
}

struct Table {
    path: PathBuf,
    writer: csv::Writer<File>,
}

impl Table {
    /// Opens the file and cuts it to `length` bytes; an empty one will open with a header.
    fn open(path: PathBuf, length: u64) -> Result<Self, RecordError> {
        let cut = || -> std::io::Result<File> {
            let mut file = OpenOptions::new()
                .create(true)
                .truncate(false)
                .write(true)
                .open(&path)?;
            if file.metadata()?.len() < length {
                return Err(std::io::Error::other(format!(
                    "shorter than the {length} bytes of its checkpoint"
                )));
            }
            file.set_len(length)?;
            file.seek(SeekFrom::End(0))?;
            Ok(file)
        };
        match cut() {
            Ok(file) => Ok(Self {
                writer: csv::WriterBuilder::new()
                    .has_headers(length == 0)
                    .from_writer(file),
                path,
            }),
            Err(error) => {
                let attempt = if length > 0 {
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
            .map_err(|error| self.fault(error))
    }

    /// Brings all rows to disk and returns the file's length in bytes.
    fn sync(&mut self) -> Result<u64, RecordError> {
        let length = self.flush();
        length.map_err(|error| self.fault(error))
    }

    fn flush(&mut self) -> std::io::Result<u64> {
        self.writer.flush()?;
        let mut file = self.writer.get_ref();
        file.flush()?;
        file.sync_data()?;
        Ok(file.metadata()?.len())
    }

    fn fault(&self, error: impl std::fmt::Display) -> RecordError {
        RecordError {
            path: self.path.clone(),
            attempt: Attempt::Write,
            reason: error.to_string(),
        }
    }
}
