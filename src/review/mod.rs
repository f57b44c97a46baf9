//! Reads the results of a run back: its tables, its summary and its recording, as far as they
//! exist.
//!
//! [`LoadedRun::open`] finds them, [`recording_stats`] computes statistics of all recorded states,
//! [`selection`] selects states of some agents and episodes for a figure. Nothing is trained or
//! drawn here.

pub mod condition;
pub mod distribution;
pub mod overview;
pub mod recording_stats;
pub mod selection;

use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use crate::record::state_files::{Learners, StateFiles};
use crate::record::table::{self, TableError};
use crate::record::{ReadError, RecordedStates};
use crate::run::facts::returns::{means_of_learners, team_returns};
use crate::run::facts::{EpisodeRow, RoundRow, Summary};
use crate::run::folder::checksums::{Checksums, DamagedFile};
use crate::run::folder::{RunFolder, run_folder, run_folders};

/// A run read back from disk.
#[derive(Clone, Debug)]
pub struct LoadedRun {
    /// Path that the user named: a run directory or a recording.
    pub path: PathBuf,
    /// Run directory, if it contains tables or files of visited states.
    pub folder: Option<RunFolder>,
    /// Whether the run is finished.
    pub is_finished: bool,
    /// Summary, if the run is finished.
    pub summary: Option<Summary>,
    /// Visited states, if they are recorded.
    pub recording: Option<RecordedStates>,
    /// Rows of `episodes.csv` in (round, agent) order; empty if there is only a recording. Of files
    /// of visited states, their episodes.
    pub episodes: Vec<EpisodeRow>,
    /// Rows of `rounds.csv` in the order of updates; empty if there is only a recording.
    pub rounds: Vec<RoundRow>,
    /// What is incomplete in the files or cannot be verified, for people.
    pub warnings: Vec<String>,
}

/// Why a run cannot be read back.
#[derive(Debug, thiserror::Error)]
pub enum LoadRunError {
    /// The directory contains no run.
    #[error("{0} contains no run: expected episodes.csv, run.rrd or states/*.states in it")]
    NoRun(PathBuf),
    /// The subdirectories contain several runs.
    #[error(
        "{folder} contains {count} runs: name one of them, for example {example}, or list them with \
         `seedbed runs {folder}`"
    )]
    SeveralRuns {
        /// The directory.
        folder: PathBuf,
        /// Number of runs.
        count: usize,
        /// One of them.
        example: PathBuf,
    },
    /// There is no such file or directory.
    #[error("no such file or directory: {0}")]
    Missing(PathBuf),
    /// A file of another kind.
    #[error("{} is no recording; expected a run directory, or a file that ends in .rrd{help}", path.display())]
    NoRecording {
        /// The file.
        path: PathBuf,
        /// What to do with it; empty if that is not known.
        help: &'static str,
    },
    /// A file is damaged, or was changed after it was written.
    #[error(transparent)]
    Damaged(#[from] DamagedFile),
    /// A table is not in seedbed's format.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] ReadError),
}

impl LoadedRun {
    /// Opens the run at `path`, which is a run directory, the recording in it, or a recording
    /// elsewhere. A run that is in progress or was killed is read as far as it was written.
    ///
    /// # Errors
    /// There is no run, or its files cannot be read.
    pub fn open(path: &Path) -> Result<Self, LoadRunError> {
        Self::open_as_far_as(path, true)
    }

    /// Like [`open`](Self::open), but the recording in a run directory is not read, so that its tables
    /// can be read whatever has become of it.
    ///
    /// # Errors
    /// See [`open`](Self::open).
    pub fn open_tables(path: &Path) -> Result<Self, LoadRunError> {
        Self::open_as_far_as(path, false)
    }

    fn open_as_far_as(path: &Path, with_recording: bool) -> Result<Self, LoadRunError> {
        if !path.exists() {
            return Err(LoadRunError::Missing(path.to_owned()));
        }
        check_is_recording(path)?;
        let folder = run_folder(path);
        if !path.is_file() && folder.has_state_files() {
            return Self::of_state_files(folder);
        }
        if !path.is_file() && !folder.has_run() {
            return Err(no_run(path));
        }
        let [episodes, rounds] = folder.table_files();
        let recording = if path.is_file() {
            Some(path.to_owned())
        } else if with_recording || !episodes.is_file() {
            recording_in(&folder)
        } else {
            None
        };
        let checksums = Checksums::read(&folder)?;
        if !path.is_file() {
            let files = [&episodes, &rounds, &folder.summary_file()];
            files
                .into_iter()
                .try_for_each(|file| checksums.check_presence(file))?;
        }
        let unlisted = recording
            .as_ref()
            .and_then(|path| checksums.unlisted_warning(path));
        let recording = recording
            .map(|path| {
                checksums.verify(&path)?;
                Ok::<_, LoadRunError>(RecordedStates::open(&path)?)
            })
            .transpose()?;
        if !episodes.is_file() && recording.is_none() {
            return Err(no_run(path));
        }
        // A recording has the episodes as well.
        let has_tables = episodes.is_file() && (rounds.is_file() || recording.is_none());
        let summary = if has_tables {
            Summary::read(&folder)?
        } else {
            None
        };
        let mut warnings = warnings(recording.as_ref(), &checksums);
        warnings.extend(unlisted);
        warnings.extend(
            summary
                .as_ref()
                .and_then(|summary| summary.physics_warning.clone()),
        );
        Ok(Self {
            path: if path.is_file() {
                path.to_owned()
            } else {
                folder.path().to_owned()
            },
            is_finished: summary.is_some(),
            summary,
            episodes: read_table(&checksums, &episodes, has_tables)?,
            rounds: read_table(&checksums, &rounds, has_tables && rounds.is_file())?,
            folder: has_tables.then_some(folder),
            warnings,
            recording,
        })
    }

    /// The run that other programs recorded in a directory. Its episodes are those in the files, so
    /// that they agree with the states while the run is in progress and after a crash.
    fn of_state_files(folder: RunFolder) -> Result<Self, LoadRunError> {
        let files = StateFiles::open_folder(folder.path())?;
        let [_, rounds] = folder.table_files();
        Ok(Self {
            path: folder.path().to_owned(),
            is_finished: folder.summary_file().is_file(),
            // It is for other tools, and everything in it is in the files.
            summary: None,
            episodes: files.episode_rows().to_vec(),
            rounds: if rounds.is_file() {
                table::read(&rounds)?
            } else {
                Vec::new()
            },
            warnings: files.warnings().to_vec(),
            recording: Some(RecordedStates::StateFiles(files)),
            folder: Some(folder),
        })
    }

    /// The files of visited states, if another program recorded the run.
    #[must_use]
    pub fn state_files(&self) -> Option<&StateFiles> {
        self.recording.as_ref()?.state_files()
    }

    /// Name of the run, e.g. `cartpole, run seed 0`.
    #[must_use]
    pub fn name(&self) -> String {
        if let Some(summary) = &self.summary {
            let seed = summary.seed.map(|seed| format!(", run seed {seed}"));
            return format!("{}{}", summary.scenario, seed.unwrap_or_default());
        }
        let recorded_name = self
            .recording
            .as_ref()
            .and_then(|recording| recording.properties().get("RecordingInfo:name"));
        let name = recorded_name.map(|name| name.replacen("-seed-", ", run seed ", 1));
        name.unwrap_or_else(|| {
            self.path
                .file_name()
                .unwrap_or(self.path.as_os_str())
                .to_string_lossy()
                .into_owned()
        })
    }

    /// The name, for pictures. It says if agents are copies of the environment in which fewer learners act.
    #[must_use]
    pub fn title(&self) -> String {
        let name = self.name();
        match self.learners().filter(|learners| learners.have_copies()) {
            Some(learners) => {
                let (copies, count) = (learners.agents(), learners.count());
                let noun = if count == 1 { "learner" } else { "learners" };
                format!("{name} ({copies} copies of the environment, {count} {noun})")
            }
            None => name,
        }
    }

    /// Number of agents K, from the tables or else from the properties of the recording.
    #[must_use]
    pub fn agent_count(&self) -> usize {
        let from_tables = self.episodes.iter().map(|row| row.agent as usize + 1).max();
        let from_recording = || {
            self.recording
                .as_ref()
                .and_then(|recording| recording.properties().get("agents")?.parse().ok())
        };
        from_tables.or_else(from_recording).unwrap_or(0)
    }

    /// Returns of one agent, in the order of its episodes.
    pub fn returns(&self, agent: u32) -> impl Iterator<Item = f64> {
        self.episodes
            .iter()
            .filter(move |row| row.agent == agent)
            .map(|row| row.r#return)
    }

    /// Mean over agents of the return of their n-th episode, for each n that all agents have
    /// finished.
    /// Copies of an environment in which one learner acts count as one agent.
    #[must_use]
    pub fn team_returns(&self) -> Vec<f64> {
        match self.learners().filter(|learners| learners.have_copies()) {
            Some(learners) => means_of_learners(&learners.returns(&self.episodes)),
            None => team_returns(&self.episodes, self.agent_count()),
        }
    }

    /// The learners of a run that another program recorded.
    #[must_use]
    pub fn learners(&self) -> Option<&Learners> {
        self.state_files().map(StateFiles::learners)
    }
}

/// Refuses a file with the name of another kind of file.
fn check_is_recording(path: &Path) -> Result<(), LoadRunError> {
    let extension = path.extension().and_then(|extension| extension.to_str());
    let help = match extension {
        Some("ron") => "; `seedbed run FILE` trains agents in a scenario",
        Some("csv" | "json" | "safetensors") => "; give the directory of this file",
        Some("png" | "svg" | "pdf" | "html" | "gif" | "py" | "md" | "txt") => "",
        _ => return Ok(()),
    };
    if !path.is_file() {
        return Ok(());
    }
    Err(LoadRunError::NoRecording {
        path: path.to_owned(),
        help,
    })
}

/// The rows of a table; none if the run has no tables.
fn read_table<R: DeserializeOwned>(
    checksums: &Checksums,
    path: &Path,
    has_tables: bool,
) -> Result<Vec<R>, LoadRunError> {
    if !has_tables {
        return Ok(Vec::new());
    }
    checksums.verify(path)?;
    Ok(table::read(path)?)
}

fn warnings(recording: Option<&RecordedStates>, checksums: &Checksums) -> Vec<String> {
    let incomplete = recording.map_or(&[][..], RecordedStates::warnings);
    let unverified = checksums.warning().map(str::to_owned);
    incomplete.iter().cloned().chain(unverified).collect()
}

/// The error that a directory contains no run, or several in its subdirectories.
fn no_run(path: &Path) -> LoadRunError {
    let runs = run_folders(path);
    match runs.first() {
        Some(example) if runs.len() > 1 => LoadRunError::SeveralRuns {
            folder: path.to_owned(),
            count: runs.len(),
            example: example.clone(),
        },
        _ => LoadRunError::NoRun(path.to_owned()),
    }
}

/// The recording in a run directory, complete or not.
fn recording_in(folder: &RunFolder) -> Option<PathBuf> {
    let complete = folder.recording_file();
    let part = complete.with_added_extension("part");
    [complete, part].into_iter().find(|path| path.is_file())
}
