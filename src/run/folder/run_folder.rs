//! The directory of a run: the paths of its files, what it contains, and a lock that lets only one
//! process write to it.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::storage::file_lock::FileLock;
use crate::storage::files::{self, cannot_remove, ignore_not_found};

/// The directory of one run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunFolder {
    path: PathBuf,
}

/// Name of the file with the checksums of the others.
pub const CHECKSUMS_NAME: &str = "SHA256SUMS";

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

/// Name of the file that a process locks while it writes.
const LOCK_FILE: &str = ".lock";

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
        } else if self.checkpoint_file().is_file() {
            Contents::UnfinishedRun
        } else if self.lock_file().is_file() {
            Contents::RunWithoutCheckpoint
        } else if fs::read_dir(&self.path).is_ok_and(|mut entries| entries.next().is_some()) {
            Contents::OtherFiles
        } else {
            Contents::Nothing
        }
    }

    /// Whether the directory contains files that only a run has.
    pub(super) fn has_own_run(&self) -> bool {
        let is_begun = self.scenario_file().is_file() && self.has_table_or_recording();
        is_begun
            || self.summary_file().is_file()
            || self.checkpoint_file().is_file()
            || self.has_state_files()
    }

    /// Whether the directory contains a table of episodes or a recording, which can also be exported.
    pub(super) fn has_table_or_recording(&self) -> bool {
        let [episodes, _] = self.table_files();
        let part = self.unfinished_recording_file();
        let results = [episodes, self.recording_file(), part];
        results.iter().any(|path| path.is_file())
    }

    /// Whether the directory contains files of visited states, which another program recorded.
    #[must_use]
    pub fn has_state_files(&self) -> bool {
        !self.state_files().is_empty()
    }

    /// Paths of the files of visited states, which another program recorded, sorted.
    #[must_use]
    pub fn state_files(&self) -> Vec<PathBuf> {
        let entries = fs::read_dir(self.path.join("states")).into_iter().flatten();
        let paths = entries.flatten().map(|entry| entry.path());
        let mut paths: Vec<PathBuf> = paths.filter(|path| is_state_file(path)).collect();
        paths.sort();
        paths
    }

    /// Locks the directory, and creates it if necessary. Removes what processes that were killed did not
    /// complete. `None` if another process has locked it.
    ///
    /// # Errors
    /// The operating system reports an error.
    pub fn lock(&self) -> io::Result<Option<FileLock>> {
        fs::create_dir_all(&self.path)?;
        let lock = FileLock::acquire(&self.lock_file(), true)?;
        if lock.is_some() {
            let mut own = self.result_files();
            own.extend([self.summary_file(), self.checksums_file()]);
            let is_own = |name: &str| own.contains(&self.path.join(name));
            files::remove_abandoned(&self.path, is_own);
            let is_task = |name: &str| Path::new(name).extension().is_some_and(|end| end == "ron");
            files::remove_abandoned(&self.tasks_folder(), is_task);
            files::remove_abandoned(&self.checkpoint_folder(), |_| true);
        }
        Ok(lock)
    }

    /// Removes the files of a run, and pictures and pages of it that have their usual names, and no other files. The checkpoint is removed first: if this is
    /// stopped, no run can be resumed whose other files are gone.
    ///
    /// # Errors
    /// If a file cannot be removed.
    pub fn clear(&self) -> io::Result<()> {
        let removed = self.remove_checkpoint();
        removed.map_err(|error| cannot_remove(&self.checkpoint_file(), &error))?;
        let recording = self.recording_file();
        let unfinished = ["part", "resuming"].map(|suffix| recording.with_added_extension(suffix));
        let files = [
            self.summary_file(),
            self.checksums_file(),
            recording,
            self.incomplete_recording_file(),
            self.replay_file(),
            self.scenario_file(),
            self.policies_file(),
            self.regret_file(),
            self.visits_file(),
        ];
        for path in files
            .into_iter()
            .chain(self.pictures())
            .chain(unfinished)
            .chain(self.table_files())
        {
            files::remove_if_exists(&path).map_err(|error| cannot_remove(&path, &error))?;
        }
        let tasks = self.tasks_folder();
        let removed = ignore_not_found(fs::remove_dir_all(&tasks));
        removed.map_err(|error| cannot_remove(&tasks, &error))
    }

    /// Names of files that [`clear`](Self::clear) has left, sorted: they are not of a run, or have names that users
    /// chose.
    #[must_use]
    pub fn other_files(&self) -> Vec<String> {
        let entries = fs::read_dir(&self.path).into_iter().flatten().flatten();
        let files = entries.filter(|entry| entry.path().is_file());
        let names = files.map(|entry| entry.file_name().to_string_lossy().into_owned());
        let mut names: Vec<String> = names.filter(|name| name != LOCK_FILE).collect();
        names.sort();
        names
    }

    /// Renames the recording of a run that is continued without one, and returns its new path;
    /// `None` if there is none.
    ///
    /// # Errors
    /// The operating system reports an error.
    pub fn set_recording_aside(&self) -> io::Result<Option<PathBuf>> {
        let aside = self.incomplete_recording_file();
        // Of a run that was stopped while it was finished, the recording has its final name.
        for path in [self.recording_file(), self.unfinished_recording_file()] {
            if path.is_file() {
                fs::rename(path, &aside)?;
                return Ok(Some(aside));
            }
        }
        Ok(None)
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

    /// Path of the recording while the run is in progress.
    #[must_use]
    pub fn unfinished_recording_file(&self) -> PathBuf {
        self.recording_file().with_added_extension("part")
    }

    /// Path of the recording of a run that was continued without one.
    #[must_use]
    pub fn incomplete_recording_file(&self) -> PathBuf {
        self.path.join("incomplete.rrd")
    }

    /// Path of the checksums of the other files.
    #[must_use]
    pub fn checksums_file(&self) -> PathBuf {
        self.path.join(CHECKSUMS_NAME)
    }

    /// Path of the recording that `seedbed replay` writes.
    #[must_use]
    pub fn replay_file(&self) -> PathBuf {
        self.path.join("replay.rrd")
    }

    /// Path of the picture that `seedbed plot` draws of the run.
    #[must_use]
    pub fn plot_file(&self) -> PathBuf {
        self.path.join("plot.svg")
    }

    /// Path of the film that `seedbed film` makes of the run.
    #[must_use]
    pub fn film_file(&self) -> PathBuf {
        self.path.join("film.gif")
    }

    /// Path of the page that `seedbed explore` writes of the run.
    #[must_use]
    pub fn page_file(&self) -> PathBuf {
        self.path.join("explore.html")
    }

    /// Paths of all pictures and pages of the run and of its recordings, unless users chose their names.
    fn pictures(&self) -> Vec<PathBuf> {
        let mut pictures = vec![self.plot_file(), self.film_file(), self.page_file()];
        for recording in [
            self.recording_file(),
            self.replay_file(),
            self.incomplete_recording_file(),
        ] {
            pictures.extend(["svg", "html"].map(|extension| recording.with_extension(extension)));
        }
        pictures
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

    /// Path of the scenario with all defaults, which names the copy of the task in this directory.
    #[must_use]
    pub fn scenario_file(&self) -> PathBuf {
        self.path.join("scenario.ron")
    }

    /// Paths of the copies of tasks, sorted.
    #[must_use]
    pub fn task_files(&self) -> Vec<PathBuf> {
        let entries = fs::read_dir(self.tasks_folder()).into_iter().flatten();
        let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        paths.sort();
        paths
    }

    /// Whether a path is that of a copy of a task.
    #[must_use]
    pub fn is_task_file(&self, path: &Path) -> bool {
        path.parent() == Some(&self.tasks_folder())
    }

    /// Path of the copy of the task `name`.
    #[must_use]
    pub fn task_file(&self, name: &str) -> PathBuf {
        self.tasks_folder().join(format!("{name}.ron"))
    }

    /// Path of the copy of a Python file that makes an environment: beside the copy of the task.
    #[must_use]
    pub fn python_file(&self, original: &Path) -> PathBuf {
        let name = original.file_name().unwrap_or_default();
        self.tasks_folder().join(name)
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

    /// Paths of all files of a finished run except the checkpoint and the summary, whether they exist
    /// or not.
    #[must_use]
    pub fn result_files(&self) -> Vec<PathBuf> {
        let [episodes, rounds] = self.table_files();
        let mut paths = vec![
            episodes,
            rounds,
            self.policies_file(),
            self.recording_file(),
            self.regret_file(),
            self.scenario_file(),
            self.visits_file(),
        ];
        paths.extend(self.task_files());
        paths
    }

    /// Folder of the checkpoint.
    #[must_use]
    pub fn checkpoint_folder(&self) -> PathBuf {
        self.path.join("checkpoint")
    }

    /// Path of the checkpoint.
    #[must_use]
    pub fn checkpoint_file(&self) -> PathBuf {
        self.checkpoint_folder().join("state.bin")
    }

    /// Path of the checkpoint before the newest.
    #[must_use]
    pub fn previous_checkpoint_file(&self) -> PathBuf {
        self.checkpoint_folder().join("previous.bin")
    }

    /// Removes the checkpoint: first the file without which none of the others is used.
    fn remove_checkpoint(&self) -> io::Result<()> {
        files::remove_if_exists(&self.checkpoint_file())?;
        ignore_not_found(fs::remove_dir_all(self.checkpoint_folder()))
    }

    fn tasks_folder(&self) -> PathBuf {
        self.path.join("envs")
    }

    fn lock_file(&self) -> PathBuf {
        self.path.join(LOCK_FILE)
    }
}

/// Whether a path is that of a file of visited states, by its extension.
#[must_use]
pub fn is_state_file(path: &Path) -> bool {
    let is_hidden = |name: &std::ffi::OsStr| name.to_string_lossy().starts_with('.');
    path.extension().is_some_and(|found| found == "states")
        && !path.file_name().is_some_and(is_hidden)
}
