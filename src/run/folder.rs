//! A run's folder: what lies where, whether a run may write there, and that only one does at a
//! time.

use std::fs::{self, File, TryLockError};
use std::io;
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
    /// A run that ended before its first checkpoint.
    BrokenOffRun,
    /// Files that no run left there.
    Other,
}

/// The right to write into a folder. Given back when dropped, or when the process ends however it
/// ends.
#[derive(Debug)]
pub struct Claim {
    lock: File,
    path: PathBuf,
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
        } else if self.lock().is_file() {
            Contents::BrokenOffRun
        } else if fs::read_dir(&self.path).is_ok_and(|mut entries| entries.next().is_some()) {
            Contents::Other
        } else {
            Contents::Nothing
        }
    }

    /// Claims the folder, creating it where there is none. `None` where another process holds it.
    ///
    /// # Errors
    /// The system refuses.
    pub fn claim(&self) -> io::Result<Option<Claim>> {
        fs::create_dir_all(&self.path)?;
        let path = self.lock();
        let lock = File::options()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&path)?;
        match lock.try_lock() {
            Ok(()) => Ok(Some(Claim { lock, path })),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(error)) => Err(error),
        }
    }

    /// Removes what a run left here, and nothing else.
    ///
    /// # Errors
    /// A file cannot be removed.
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

    /// The recording of its policies at play, where `seedbed replay` made one.
    #[must_use]
    pub fn replay(&self) -> PathBuf {
        self.path.join("replay.rrd")
    }

    /// `episodes.csv` and `rounds.csv`.
    #[must_use]
    pub fn tables(&self) -> [PathBuf; 2] {
        [self.path.join("episodes.csv"), self.path.join("rounds.csv")]
    }

    /// The regret of each episode, where the task is a finite one.
    #[must_use]
    pub fn regret(&self) -> PathBuf {
        self.path.join("regret.csv")
    }

    /// Who was in which state, where the task is a finite one.
    #[must_use]
    pub fn visits(&self) -> PathBuf {
        self.path.join("visits.csv")
    }

    /// The scenario with every default spelled out. It finds the run's own copy of the task.
    #[must_use]
    pub fn scenario(&self) -> PathBuf {
        self.path.join("scenario.ron")
    }

    /// The file of the task `name` as it was.
    #[must_use]
    pub fn task(&self, name: &str) -> PathBuf {
        self.tasks().join(format!("{name}.ron"))
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

    fn tasks(&self) -> PathBuf {
        self.path.join("envs")
    }

    fn lock(&self) -> PathBuf {
        self.path.join(".lock")
    }
}

impl Claim {
    /// Gives the folder back after a finished run, which needs no mark of having begun.
    ///
    /// # Errors
    /// The mark cannot be removed.
    pub fn release(self) -> io::Result<()> {
        fs::remove_file(&self.path)?;
        self.lock.unlock()
    }
}

fn remove(result: io::Result<()>) -> io::Result<()> {
    match result {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}
