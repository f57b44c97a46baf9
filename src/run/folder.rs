//! The directory of a run: the paths of its files, what it contains, and a lock that lets only one
//! process write to it.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::file_lock::FileLock;
use super::{checkpoint, overview};
use crate::record::state_files::StateFiles;

/// The directory of one run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunFolder {
    path: PathBuf,
}

/// What a directory contains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contents {
    /// No files, or the directory does not exist.
    Nothing,
    /// A finished run.
    FinishedRun,
    /// A run that can be resumed from its checkpoint.
    UnfinishedRun,
    /// A run that ended before its first checkpoint.
    RunWithoutCheckpoint,
    /// Files that no run of seedbed wrote, such as the states that another program recorded.
    OtherFiles,
}

impl RunFolder {
    /// The directory at `path`, which need not exist.
    #[must_use]
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into() }
    }

    /// What the directory contains now.
    #[must_use]
    pub fn contents(&self) -> Contents {
        if self.has_state_files() {
            // No run of seedbed may take the place of what another program recorded.
            Contents::OtherFiles
        } else if self.summary_file().is_file() {
            Contents::FinishedRun
        } else if checkpoint::file(&self.path).is_file() {
            Contents::UnfinishedRun
        } else if self.lock_file().is_file() {
            Contents::RunWithoutCheckpoint
        } else if fs::read_dir(&self.path).is_ok_and(|mut entries| entries.next().is_some()) {
            Contents::OtherFiles
        } else {
            Contents::Nothing
        }
    }

    /// Whether the directory contains results of a run, finished or not.
    #[must_use]
    pub fn has_run(&self) -> bool {
        let [episodes, _] = self.table_files();
        let part = self.recording_file().with_added_extension("part");
        let results = [self.summary_file(), episodes, self.recording_file(), part];
        results.iter().any(|path| path.is_file())
            || checkpoint::file(&self.path).is_file()
            || self.has_state_files()
    }

    /// Whether the directory contains files of visited states, which another program recorded.
    #[must_use]
    pub fn has_state_files(&self) -> bool {
        !StateFiles::paths_in(&self.path).is_empty()
    }

    /// Locks the directory, and creates it if necessary. `None` if another process has locked it.
    ///
    /// # Errors
    /// The operating system reports an error.
    pub fn lock(&self) -> io::Result<Option<FileLock>> {
        fs::create_dir_all(&self.path)?;
        FileLock::acquire(&self.lock_file(), true)
    }

    /// Removes the files of a run, and no other files.
    ///
    /// # Errors
    /// If a file cannot be removed.
    pub fn clear(&self) -> io::Result<()> {
        let recording = self.recording_file();
        let unfinished = ["part", "resuming"].map(|suffix| recording.with_added_extension(suffix));
        let files = [
            self.summary_file(),
            recording,
            self.replay_file(),
            self.scenario_file(),
            self.policies_file(),
            self.regret_file(),
            self.visits_file(),
        ];
        for path in files
            .into_iter()
            .chain(unfinished)
            .chain(self.table_files())
        {
            ignore_not_found(fs::remove_file(path))?;
        }
        ignore_not_found(fs::remove_dir_all(self.tasks_folder()))?;
        ignore_not_found(fs::remove_dir_all(self.path.join("checkpoint")))
    }

    /// The path of the directory.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Path of the recording.
    #[must_use]
    pub fn recording_file(&self) -> PathBuf {
        self.path.join("run.rrd")
    }

    /// Path of the recording that `seedbed replay` writes.
    #[must_use]
    pub fn replay_file(&self) -> PathBuf {
        self.path.join("replay.rrd")
    }

    /// Paths of `episodes.csv` and `rounds.csv`.
    #[must_use]
    pub fn table_files(&self) -> [PathBuf; 2] {
        [self.path.join("episodes.csv"), self.path.join("rounds.csv")]
    }

    /// Path of the table with the regret of each episode of a tabular run.
    #[must_use]
    pub fn regret_file(&self) -> PathBuf {
        self.path.join("regret.csv")
    }

    /// Path of the table with the number of visits to each state of a tabular run.
    #[must_use]
    pub fn visits_file(&self) -> PathBuf {
        self.path.join("visits.csv")
    }

    /// Path of the scenario with all defaults, which refers to the copy of the task in this
    /// directory.
    #[must_use]
    pub fn scenario_file(&self) -> PathBuf {
        self.path.join("scenario.ron")
    }

    /// Path of the copy of the task `name`.
    #[must_use]
    pub fn task_file(&self, name: &str) -> PathBuf {
        self.tasks_folder().join(format!("{name}.ron"))
    }

    /// Path of the summary. If the file exists, the run is finished.
    #[must_use]
    pub fn summary_file(&self) -> PathBuf {
        self.path.join("summary.json")
    }

    /// Path of the weights of all networks.
    #[must_use]
    pub fn policies_file(&self) -> PathBuf {
        self.path.join("policies.safetensors")
    }

    fn tasks_folder(&self) -> PathBuf {
        self.path.join("envs")
    }

    fn lock_file(&self) -> PathBuf {
        self.path.join(".lock")
    }
}

/// The directory of the run at `path`: a run directory, a file in it, or a directory with a single
/// run in its subdirectories. If it has none or several, `path` itself.
#[must_use]
pub fn run_folder(path: &Path) -> RunFolder {
    if path.is_file() {
        return RunFolder::new(path.parent().unwrap_or(path));
    }
    let folder = RunFolder::new(path);
    if folder.has_run() {
        return folder;
    }
    match overview::run_folders(path).as_slice() {
        [only] => RunFolder::new(only),
        _ => folder,
    }
}

/// Success if the file or directory to remove did not exist.
fn ignore_not_found(result: io::Result<()>) -> io::Result<()> {
    match result {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}
