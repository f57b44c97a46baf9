//! Run directories: paths of their files, what they contain, and a lock so that one process at a time
//! writes there.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use super::checkpoint;

/// Directory with all results of one run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunFolder {
    path: PathBuf,
}

/// What a directory contains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contents {
    /// Nothing, or there is no directory.
    Nothing,
    /// A finished run.
    FinishedRun,
    /// A run that can be resumed from its checkpoint.
    UnfinishedRun,
    /// A run that was stopped before its first checkpoint.
    BrokenOffRun,
    /// Files of something else than a run.
    Other,
}

/// Exclusive lock on a run directory, released when dropped and when the process ends.
#[derive(Debug)]
pub struct RunLock {
    file: File,
    path: PathBuf,
}

impl RunFolder {
    /// The run directory at `path`, which need not exist.
    #[must_use]
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into() }
    }

    /// What the directory contains now.
    #[must_use]
    pub fn contents(&self) -> Contents {
        if self.summary().is_file() {
            Contents::FinishedRun
        } else if checkpoint::file(&self.path).is_file() {
            Contents::UnfinishedRun
        } else if self.lock_path().is_file() {
            Contents::BrokenOffRun
        } else if fs::read_dir(&self.path).is_ok_and(|mut entries| entries.next().is_some()) {
            Contents::Other
        } else {
            Contents::Nothing
        }
    }

    /// Creates the directory if there is none, and locks it. `None` if another process has locked it.
    ///
    /// # Errors
    /// If the directory or the lock file cannot be created.
    pub fn lock(&self) -> io::Result<Option<RunLock>> {
        fs::create_dir_all(&self.path)?;
        let path = self.lock_path();
        let file = File::options()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&path)?;
        match file.try_lock() {
            Ok(()) => Ok(Some(RunLock { file, path })),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(error)) => Err(error),
        }
    }

    /// Removes all files of a run, and no others.
    ///
    /// # Errors
    /// If a file cannot be removed.
    pub fn clear(&self) -> io::Result<()> {
        let recording = self.recording();
        let unfinished = ["part", "resuming"].map(|suffix| recording.with_added_extension(suffix));
        let files = [
            self.summary(),
            recording,
            self.replay(),
            self.scenario(),
            self.policies(),
            self.regret(),
            self.visits(),
        ];
        for path in files.into_iter().chain(unfinished).chain(self.tables()) {
            remove(fs::remove_file(path))?;
        }
        remove(fs::remove_dir_all(self.tasks()))?;
        remove(fs::remove_dir_all(self.path.join("checkpoint")))
    }

    /// Path of the directory.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The recording.
    #[must_use]
    pub fn recording(&self) -> PathBuf {
        self.path.join("run.rrd")
    }

    /// The recording that `seedbed replay` writes.
    #[must_use]
    pub fn replay(&self) -> PathBuf {
        self.path.join("replay.rrd")
    }

    /// `episodes.csv` and `rounds.csv`.
    #[must_use]
    pub fn tables(&self) -> [PathBuf; 2] {
        [self.path.join("episodes.csv"), self.path.join("rounds.csv")]
    }

    /// Regret of each episode of a tabular run.
    #[must_use]
    pub fn regret(&self) -> PathBuf {
        self.path.join("regret.csv")
    }

    /// Visited states of a tabular run.
    #[must_use]
    pub fn visits(&self) -> PathBuf {
        self.path.join("visits.csv")
    }

    /// The resolved scenario. Its task is looked up in the run directory's own `envs/`.
    #[must_use]
    pub fn scenario(&self) -> PathBuf {
        self.path.join("scenario.ron")
    }

    /// Copy of the task file `name` from the start of the run.
    #[must_use]
    pub fn task(&self, name: &str) -> PathBuf {
        self.tasks().join(format!("{name}.ron"))
    }

    /// Summary of the results, which marks a run as finished.
    #[must_use]
    pub fn summary(&self) -> PathBuf {
        self.path.join("summary.json")
    }

    /// The weights of all networks.
    #[must_use]
    pub fn policies(&self) -> PathBuf {
        self.path.join("policies.safetensors")
    }

    fn tasks(&self) -> PathBuf {
        self.path.join("envs")
    }

    fn lock_path(&self) -> PathBuf {
        self.path.join(".lock")
    }
}

impl RunLock {
    /// Releases the lock after a finished run and removes the lock file, which would mark a run that
    /// was broken off.
    ///
    /// # Errors
    /// If the file cannot be removed.
    pub fn release(self) -> io::Result<()> {
        fs::remove_file(&self.path)?;
        self.file.unlock()
    }
}

fn remove(result: io::Result<()>) -> io::Result<()> {
    match result {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}
