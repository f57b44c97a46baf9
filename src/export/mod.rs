//! Writes the results of a run in formats of other tools: visited states, episodes and rounds as
//! CSV, Parquet or NumPy arrays, and curves for TensorBoard.

mod csv;
pub mod event_file;
pub mod live_curves;
mod npz;
mod parquet;
mod recording;
mod rounds;
mod states;
mod table;
pub mod tensorboard;

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use self::table::Table;
use crate::record::ReadError;
use crate::record::state_files::StateFiles;
use crate::record::table::TableError;
use crate::review::LoadedRun;
use crate::run::folder::RunFolder;
use crate::run::recorder::RecordError;
use crate::storage::files::{self, Replacement};
use crate::storage::incomplete::Incomplete;

/// What is exported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// One row per visited state, from the recording.
    States,
    /// `episodes.csv`: one row per episode.
    Episodes,
    /// `rounds.csv`: one row per update of an agent.
    Rounds,
}

/// Format of an exported file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Comma-separated values; missing values are empty, NaN is `NaN`.
    Csv,
    /// Apache Parquet; missing values are null, NaN is NaN.
    Parquet,
    /// One compressed NumPy array per column; missing values are NaN, too.
    Npz,
}

/// Why a run cannot be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The run has no table or recording with this content.
    #[error("{run} has no {missing}, from which {content} are exported")]
    Missing {
        /// The run.
        run: PathBuf,
        /// The missing file.
        missing: &'static str,
        /// What was to be exported.
        content: &'static str,
    },
    /// A table cannot be read.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] ReadError),
    /// Only visited states that another program recorded become a recording.
    #[error("{0} has a recording already; expected a run that another program recorded in states/")]
    IsRecorded(PathBuf),
    /// The recording cannot be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The file cannot be written.
    #[error("cannot write {path}: {error}")]
    Write {
        /// The file.
        path: PathBuf,
        /// Reason.
        error: io::Error,
    },
}

/// Writes a table batch by batch. All batches have the same columns.
trait TableWriter {
    fn write(&mut self, batch: Table) -> io::Result<()>;

    /// Completes the file.
    fn finish(self: Box<Self>) -> io::Result<()>;
}

impl Format {
    /// The format that the extension of a file names.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()? {
            "csv" => Some(Self::Csv),
            "parquet" => Some(Self::Parquet),
            "npz" => Some(Self::Npz),
            _ => None,
        }
    }

    fn writer(self, file: BufWriter<File>) -> Box<dyn TableWriter> {
        match self {
            Self::Csv => Box::new(csv::CsvTable::new(file)),
            Self::Parquet => Box::new(parquet::ParquetTable::new(file)),
            Self::Npz => Box::new(npz::NpzTable::new(file)),
        }
    }
}

/// Writes a part of a run to `path` and returns the number of rows. Calls `on_episode` for each
/// episode that is read. If it fails, an existing file at `path` is not changed.
///
/// # Errors
/// The run has no such content, or a file cannot be read or written.
pub fn export(
    run: &LoadedRun,
    content: Content,
    format: Format,
    path: &Path,
    on_episode: &mut dyn FnMut(),
) -> Result<u64, ExportError> {
    let write_error = |error| ExportError::Write {
        path: path.to_owned(),
        error,
    };
    files::remove_abandoned_of(path);
    let replacement = Replacement::begin_any(path).map_err(write_error)?;
    let file = replacement.file().map_err(write_error)?;
    let mut writer = format.writer(BufWriter::new(file));
    let mut rows = 0;
    let mut write = |batch: Table| {
        rows += batch.len() as u64;
        writer.write(batch).map_err(write_error)
    };
    write_content(run, content, &mut write, on_episode)?;
    writer.finish().map_err(write_error)?;
    replacement.commit().map_err(write_error)?;
    Ok(rows)
}

fn write_content(
    run: &LoadedRun,
    content: Content,
    write: &mut dyn FnMut(Table) -> Result<(), ExportError>,
    on_episode: &mut dyn FnMut(),
) -> Result<(), ExportError> {
    let missing = |missing, content| ExportError::Missing {
        run: run.path.clone(),
        missing,
        content,
    };
    let table_file = |index: usize| {
        let folder = run.folder.as_ref()?;
        Some(folder.table_files()[index].clone())
    };
    match (content, run.state_files()) {
        (Content::States, _) => {
            let recording = run.recording.as_ref();
            let recording = recording.ok_or_else(|| missing("recording", "states"))?;
            states::write(recording, write, on_episode)
        }
        (_, Some(files)) => write(table_of_rounds(files, content, on_episode)?),
        (Content::Episodes, None) => {
            let file = table_file(0).ok_or_else(|| missing(missing_table(run), "episodes"))?;
            write(table::read_csv(&file)?)
        }
        (Content::Rounds, None) => {
            let file = table_file(1).ok_or_else(|| missing(missing_table(run), "rounds"))?;
            write(table::read_csv(&file)?)
        }
    }
}

/// Name of the first table that a run lacks, without which the other is not read.
fn missing_table(run: &LoadedRun) -> &'static str {
    let [episodes, _] = RunFolder::new(&run.path).table_files();
    if episodes.is_file() {
        "rounds.csv"
    } else {
        "episodes.csv"
    }
}

/// The episodes or rounds of a run that another program recorded, with measures of the visited
/// states.
fn table_of_rounds(
    files: &StateFiles,
    content: Content,
    on_episode: &mut dyn FnMut(),
) -> Result<Table, ExportError> {
    let (mut episodes, mut updates) = (Vec::new(), Vec::new());
    rounds::for_each(files, &rounds::task_spec(files), |_, _, rows| {
        rows.episodes.iter().for_each(|_| on_episode());
        episodes.extend(rows.episodes);
        updates.extend(rows.updates);
        Ok(())
    })?;
    Ok(if content == Content::Episodes {
        Table::of_rows(&episodes)
    } else {
        Table::of_rows(&updates)
    })
}

/// Writes a recording, `run.rrd`, of a run that another program recorded, and returns the number of
/// states. Calls `on_episode` for each episode. If it fails, an existing file at `path` is not
/// changed.
///
/// # Errors
/// The run has a recording already, or a file cannot be read or written.
pub fn export_recording(
    run: &LoadedRun,
    path: &Path,
    on_episode: &mut dyn FnMut(),
) -> Result<u64, ExportError> {
    let files = run.state_files();
    let files: &StateFiles = files.ok_or_else(|| ExportError::IsRecorded(run.path.clone()))?;
    let _incomplete = Incomplete::recording(path);
    recording::write(&run.name(), files, path, on_episode)
}
