//! What a run left, read back: its tables, its summary and its recording, whichever of them there are.
//!
//! [`Review::open`] finds them, [`survey`] goes through all recorded states once and counts, [`selection`] picks those of some agents and
//! episodes for a picture. Nothing is trained here, and nothing is drawn.

pub mod selection;
pub mod survey;

use std::fs;
use std::path::{Path, PathBuf};

use super::evaluate::run_folder;
use super::folder::RunFolder;
use super::summary::{FINAL_WINDOW, Summary};
use crate::record::rerun::read::{ReadError, Recording};
use crate::record::table::{self, TableError};
use crate::record::{EpisodeRow, RoundRow};

/// A run that was opened.
#[derive(Clone, Debug)]
pub struct Review {
    /// What the user named: a folder or a recording.
    pub path: PathBuf,
    /// Its folder, if that holds tables.
    pub folder: Option<RunFolder>,
    /// What came of it, if it is finished.
    pub summary: Option<Summary>,
    /// Its recording, if there is one.
    pub recording: Option<Recording>,
    /// In (round, agent) order; none where only a recording is left.
    pub episodes: Vec<EpisodeRow>,
    /// In the order in which agents learned; none where only a recording is left.
    pub rounds: Vec<RoundRow>,
}

/// A run that cannot be read back.
#[derive(Debug, thiserror::Error)]
pub enum ReviewError {
    /// There is none.
    #[error("{0} holds no run: neither episodes.csv nor run.rrd is there")]
    Nothing(PathBuf),
    /// There is no such file or folder.
    #[error("there is no file or folder {0}")]
    Missing(PathBuf),
    /// A table is not as seedbed writes it.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] ReadError),
}

impl Review {
    /// Opens the run at `path`: its folder, the recording in it, or a recording alone. Of a run that goes on or was killed, what is there
    /// so far.
    ///
    /// # Errors
    /// There is no run, or what is there cannot be read.
    pub fn open(path: &Path) -> Result<Self, ReviewError> {
        if !path.exists() {
            return Err(ReviewError::Missing(path.to_owned()));
        }
        let folder = run_folder(path);
        let recording = if path.is_file() {
            Some(path.to_owned())
        } else {
            recording_in(&folder)
        };
        let recording = recording.map(|path| Recording::open(&path)).transpose()?;
        let [episodes, rounds] = folder.tables();
        if !episodes.is_file() && recording.is_none() {
            return Err(ReviewError::Nothing(path.to_owned()));
        }
        let has_tables = episodes.is_file() && rounds.is_file();
        let summary = fs::read_to_string(folder.summary())
            .ok()
            .filter(|_| has_tables);
        Ok(Self {
            path: path.to_owned(),
            summary: summary.and_then(|text| serde_json::from_str(&text).ok()),
            recording,
            episodes: if has_tables {
                table::read(&episodes)?
            } else {
                Vec::new()
            },
            rounds: if has_tables {
                table::read(&rounds)?
            } else {
                Vec::new()
            },
            folder: has_tables.then_some(folder),
        })
    }

    /// The run's name, such as `cartpole, seed 0`.
    #[must_use]
    pub fn name(&self) -> String {
        if let Some(summary) = &self.summary {
            return format!("{}, seed {}", summary.scenario, summary.seed);
        }
        let recorded = self
            .recording
            .as_ref()
            .and_then(|recording| recording.properties().get("RecordingInfo:name"));
        let named = recorded.map(|name| name.replacen("-seed-", ", seed ", 1));
        named.unwrap_or_else(|| {
            self.path
                .file_name()
                .unwrap_or(self.path.as_os_str())
                .to_string_lossy()
                .into_owned()
        })
    }

    /// K: one more than the largest number of an agent in the tables, or as the recording says.
    #[must_use]
    pub fn agents(&self) -> usize {
        let counted = self.episodes.iter().map(|row| row.agent as usize + 1).max();
        let told = || {
            self.recording
                .as_ref()
                .and_then(|recording| recording.properties().get("agents")?.parse().ok())
        };
        counted.or_else(told).unwrap_or(0)
    }

    /// The returns of one agent, in the order of its episodes.
    pub fn returns(&self, agent: u32) -> impl Iterator<Item = f64> {
        self.episodes
            .iter()
            .filter(move |row| row.agent == agent)
            .map(|row| row.r#return)
    }

    /// Entry n is the mean over agents of their n-th return, as far as all agents have one.
    #[must_use]
    pub fn team_returns(&self) -> Vec<f64> {
        let mut sums: Vec<(f64, usize)> = Vec::new();
        for row in &self.episodes {
            let index = row.episode as usize;
            if sums.len() <= index {
                sums.resize(index + 1, (0.0, 0));
            }
            sums[index] = (sums[index].0 + row.r#return, sums[index].1 + 1);
        }
        let agents = self.agents();
        sums.into_iter()
            .take_while(|(_, count)| *count == agents)
            .map(|(sum, count)| sum / count as f64)
            .collect()
    }
}

/// The mean of the last [`FINAL_WINDOW`] values, or of all where there are fewer.
#[must_use]
pub fn final_mean(values: &[f64]) -> Option<f64> {
    let last = &values[values.len().saturating_sub(FINAL_WINDOW)..];
    (!last.is_empty()).then(|| last.iter().sum::<f64>() / last.len() as f64)
}

/// The recording in a folder, complete or not.
fn recording_in(folder: &RunFolder) -> Option<PathBuf> {
    let done = folder.recording();
    let part = done.with_added_extension("part");
    [done, part].into_iter().find(|path| path.is_file())
}
