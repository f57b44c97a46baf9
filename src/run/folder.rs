//! A run's folder: what lies where, and whether a run may write there.

use std::fs;
use std::path::{Path, PathBuf};

use super::checkpoint;

/// Where one run leaves everything.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunFolder {
    path: PathBuf,
}

/// What a folder holds already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contents {
    /// Nothing, or no folder.
    Nothing,
    /// A run that reached its end.
    FinishedRun,
    /// A run that can go on from its checkpoint.
    UnfinishedRun,
    /// Files that no run left there, or a run that ended before its first checkpoint.
    Other,
}

impl RunFolder {
    /// The folder at `path`, which need not exist.
    #[must_use]
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into() }
    }

    /// What the folder holds now.
    #[must_use]
    pub fn contents(&self) -> Contents {
        if self.summary().is_file() {
            Contents::FinishedRun
        } else if checkpoint::file(&self.path).is_file() {
            Contents::UnfinishedRun
        } else if fs::read_dir(&self.path).is_ok_and(|mut entries| entries.next().is_some()) {
            Contents::Other
        } else {
            Contents::Nothing
        }
    }

    /// Removes what a run left here, and nothing else.
    ///
    /// # Errors
    /// A file cannot be removed.
    pub fn clear(&self) -> std::io::Result<()> {
        let recording_part = self.path.join("run.rrd.part");
        let files = [self.summary(), self.recording(), recording_part, self.scenario(), self.environment(), self.policies()];
        for path in files.into_iter().chain(self.tables()) {
            remove(fs::remove_file(path))?;
        }
        remove(fs::remove_dir_all(self.path.join("checkpoint")))
    }

    /// The folder itself.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The recording.
    #[must_use]
    pub fn recording(&self) -> PathBuf {
        self.path.join("run.rrd")
    }

    /// `episodes.csv` and `rounds.csv`.
    #[must_use]
    pub fn tables(&self) -> [PathBuf; 2] {
        [self.path.join("episodes.csv"), self.path.join("rounds.csv")]
    }

    /// The scenario with every default spelled out.
    #[must_use]
    pub fn scenario(&self) -> PathBuf {
        self.path.join("scenario.ron")
    }

    /// The task file as it was.
    #[must_use]
    pub fn environment(&self) -> PathBuf {
        self.path.join("environment.ron")
    }

    /// What came of the run; its presence says that the run is finished.
    #[must_use]
    pub fn summary(&self) -> PathBuf {
        self.path.join("summary.json")
    }

    /// The weights of all networks.
    #[must_use]
    pub fn policies(&self) -> PathBuf {
        self.path.join("policies.safetensors")
    }
}

fn remove(result: std::io::Result<()>) -> std::io::Result<()> {
    match result {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}
