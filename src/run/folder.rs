//! The directory of a run: the paths of its files, what it contains, and a lock that lets only one
//! process write to it.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::checksums::Checksums;
use super::file_lock::FileLock;
use super::files::{cannot_remove, ignore_not_found};
use super::{checkpoint, checksums, files, overview};
use crate::input_files;
use crate::record::state_files::StateFiles;
use crate::scenario::{self, Scenario, overrides};
use seedbed_input::{Document, InputError};

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

/// Name of the file that a process locks while it writes.
const LOCK_FILE: &str = ".lock";

impl RunFolder {
    /// The directory at `path`, which need not exist.
    #[must_use]
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into() }
    }

    /// The directory of the run whose scenario is at `path`; `None` if it is not that of a run.
    fn of_scenario(path: &Path) -> Option<Self> {
        let folder = Self::new(path.parent()?);
        let is_named_so = !input_files::is_builtin(path) && folder.scenario_file() == path;
        let is_of_run = is_named_so
            && (folder.checksums_file().is_file()
                || matches!(
                    folder.contents(),
                    Contents::FinishedRun | Contents::UnfinishedRun
                ));
        is_of_run.then_some(folder)
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

    /// Whether the directory contains results of a run, finished or not. A table or a recording alone,
    /// beside runs in subdirectories, was exported from them.
    #[must_use]
    pub fn has_run(&self) -> bool {
        self.has_own_run()
            || (self.has_table_or_recording() && overview::runs_below(&self.path).is_empty())
    }

    /// Whether the directory contains files that only a run has.
    pub(super) fn has_own_run(&self) -> bool {
        let is_begun = self.scenario_file().is_file() && self.has_table_or_recording();
        is_begun
            || self.summary_file().is_file()
            || checkpoint::file(&self.path).is_file()
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
        !StateFiles::paths_in(&self.path).is_empty()
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
            checkpoint::remove_abandoned(&self.path);
        }
        Ok(lock)
    }

    /// Removes the files of a run, and pictures and pages of it that have their usual names, and no other files. The checkpoint is removed first: if this is
    /// stopped, no run can be resumed whose other files are gone.
    ///
    /// # Errors
    /// If a file cannot be removed.
    pub fn clear(&self) -> io::Result<()> {
        let removed = checkpoint::remove(&self.path);
        removed.map_err(|error| cannot_remove(&checkpoint::file(&self.path), &error))?;
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
        self.path.join(checksums::FILE_NAME)
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

    fn tasks_folder(&self) -> PathBuf {
        self.path.join("envs")
    }

    fn lock_file(&self) -> PathBuf {
        self.path.join(LOCK_FILE)
    }
}

/// Reads a scenario. That of a run names the copy of the task in the folder of the run, however it was
/// named when the run began: names and paths may mean another task, or none, where the folder is now.
///
/// # Errors
/// The file cannot be read, is no scenario, or belongs to a run that has lost the copy of its task.
pub fn read_scenario(path: &Path) -> Result<Document<Scenario>, InputError> {
    parse_scenario(path, &input_files::read_text(path)?)
}

/// Like [`read_scenario`], for a text that was read from `path`.
///
/// # Errors
/// See [`read_scenario`].
pub fn parse_scenario(path: &Path, text: &str) -> Result<Document<Scenario>, InputError> {
    let mut document: Document<Scenario> = overrides::parse(path, text)?;
    if let Some(folder) = RunFolder::of_scenario(path) {
        let task = scenario::task_name(&document.value.environment).to_owned();
        if folder.task_file(&task).is_file() {
            document.value.environment = scenario::environment_in_folder(&task).into();
        } else {
            Checksums::read(&folder)?.check_presence(&folder.task_file(&task))?;
        }
    }
    Ok(document)
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
