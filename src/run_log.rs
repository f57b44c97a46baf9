//! The log of a project: which runs were begun and which studies were registered from its folder, wherever their results
//! are. A registration says from it what was tried before.
//!
//! It is the folder `.seedbed` in the nearest folder above the scenario or study that has one, or else a `.git`; without
//! either, in the folder of the scenario or study, or in the working directory for what is built in. Each line of its files
//! is a JSON object and is appended at once, so that processes of one machine can write at the same time; lines that cannot be read
//! are skipped. Nothing but registrations reads it, and whoever deletes it is not found.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::storage::hashes::shown_digits;
use seedbed_input::limits::{MAX_TABLE_BYTES, read_text};

/// Environment variable with the folder of the log; empty for no log.
pub const VARIABLE: &str = "SEEDBED_RUN_LOG";

/// Name of the folder in the project's folder.
const FOLDER: &str = ".seedbed";

/// Folder of the files with runs, one for each digest of settings.
const RUNS: &str = "runs";

/// File with all locks, one in each line.
const LOCKS: &str = "locks.jsonl";

/// One run that was begun or finished.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LoggedRun {
    /// SHA-256 of the settings on which the run depends, apart from its run seed.
    pub digest: String,
    /// Its run seed.
    pub run_seed: u64,
    /// Name of its task.
    pub task: String,
}

/// All runs of a log.
#[derive(Clone, Debug, Default)]
pub struct LoggedRuns {
    /// Task and run seeds by the digest of settings.
    by_digest: BTreeMap<String, (String, BTreeSet<u64>)>,
}

/// The log of a project.
#[derive(Clone, Debug)]
pub struct RunLog {
    /// `None` for no log.
    folder: Option<PathBuf>,
}

impl RunLog {
    /// The log of the project to which a scenario or study file belongs.
    #[must_use]
    pub fn of_file(path: &Path) -> Self {
        if let Some(folder) = std::env::var_os(VARIABLE) {
            let folder = (!folder.is_empty()).then(|| folder.into());
            return Self { folder };
        }
        let file = path.canonicalize().ok().filter(|path| path.is_file());
        let start = file.and_then(|file| file.parent().map(Path::to_owned));
        let start = start.or_else(|| std::env::current_dir().ok());
        Self {
            folder: start.map(|start| project_folder(&start).join(FOLDER)),
        }
    }

    /// Whether runs are logged.
    #[must_use]
    pub fn is_kept(&self) -> bool {
        self.folder.is_some()
    }

    /// Adds a run. The same run may be added several times.
    ///
    /// # Errors
    /// The file cannot be written; the message names it.
    pub fn add_run(&self, run: &LoggedRun) -> Result<(), String> {
        self.append(&format!("{RUNS}/{}.jsonl", shown_digits(&run.digest)), run)
    }

    /// Adds a lock, unless the log has it.
    ///
    /// # Errors
    /// The file cannot be written; the message names it.
    pub fn add_lock<L: Serialize + for<'a> Deserialize<'a> + PartialEq>(
        &self,
        lock: &L,
    ) -> Result<(), String> {
        if self.locks::<L>().contains(lock) {
            return Ok(());
        }
        self.append(LOCKS, lock)
    }

    /// All locks, the first one first.
    #[must_use]
    pub fn locks<L: for<'a> Deserialize<'a>>(&self) -> Vec<L> {
        let folder = self.folder.iter();
        folder
            .flat_map(|folder| lines_of(&folder.join(LOCKS)))
            .collect()
    }

    /// All runs.
    #[must_use]
    pub fn runs(&self) -> LoggedRuns {
        let mut runs = LoggedRuns::default();
        let folder = self.folder.as_ref().map(|folder| folder.join(RUNS));
        let entries = folder.and_then(|folder| fs::read_dir(folder).ok());
        for entry in entries.into_iter().flatten().flatten() {
            for run in lines_of::<LoggedRun>(&entry.path()) {
                let of_digest = runs.by_digest.entry(run.digest);
                let (_, run_seeds) = of_digest.or_insert((run.task, BTreeSet::new()));
                run_seeds.insert(run.run_seed);
            }
        }
        runs
    }

    fn append(&self, file: &str, line: &impl Serialize) -> Result<(), String> {
        let Some(folder) = &self.folder else {
            return Ok(());
        };
        let path = folder.join(file);
        let text = serde_json::to_string(line).expect("plain data always serializes") + "\n";
        append_to(&path, &text).map_err(|error| format!("{}: {error}", path.display()))
    }
}

impl LoggedRuns {
    /// Number of all runs.
    #[must_use]
    pub fn count(&self) -> usize {
        let counts = self.by_digest.values();
        counts.map(|(_, run_seeds)| run_seeds.len()).sum()
    }

    /// Run seeds of all runs with these settings.
    #[must_use]
    pub fn run_seeds(&self, digest: &str) -> BTreeSet<u64> {
        let of_digest = self.by_digest.get(digest);
        of_digest.map_or(BTreeSet::new(), |(_, run_seeds)| run_seeds.clone())
    }

    /// Number of runs in these tasks with other settings than those of `digests`.
    #[must_use]
    pub fn count_others_in(&self, tasks: &BTreeSet<&str>, digests: &BTreeSet<&str>) -> usize {
        let others = self.by_digest.iter().filter(|(digest, (task, _))| {
            tasks.contains(task.as_str()) && !digests.contains(digest.as_str())
        });
        others.map(|(_, (_, run_seeds))| run_seeds.len()).sum()
    }
}

/// The nearest of a folder and those above it that has a log or a repository of Git; the folder itself if none has.
fn project_folder(start: &Path) -> &Path {
    let is_project = |folder: &&Path| folder.join(FOLDER).is_dir() || folder.join(".git").exists();
    start.ancestors().find(is_project).unwrap_or(start)
}

/// All lines of a file that can be read; empty if there is none.
fn lines_of<T: for<'a> Deserialize<'a>>(path: &Path) -> Vec<T> {
    let text = read_text(path, MAX_TABLE_BYTES).unwrap_or_default();
    let lines = text.lines();
    lines
        .filter_map(|line| serde_json::from_str(line).ok())
        .collect()
}

/// Adds a text at the end of a file, in one piece.
fn append_to(path: &Path, text: &str) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let mut file = OpenOptions::new().create(true).append(true).open(path)?;
    file.write_all(text.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(folder: &Path) -> RunLog {
        RunLog {
            folder: Some(folder.join(FOLDER)),
        }
    }

    fn run(digest: &str, run_seed: u64, task: &str) -> LoggedRun {
        LoggedRun {
            digest: digest.to_owned(),
            run_seed,
            task: task.to_owned(),
        }
    }

    #[test]
    fn runs_count_once_and_by_settings() {
        let folder = tempfile::tempdir().unwrap();
        let log = log(folder.path());
        for run in [
            run("a", 1, "x"),
            run("a", 1, "x"),
            run("a", 2, "x"),
            run("b", 1, "x"),
            run("c", 1, "y"),
        ] {
            log.add_run(&run).unwrap();
        }
        let runs = log.runs();
        assert_eq!(runs.count(), 4);
        assert_eq!(runs.run_seeds("a"), BTreeSet::from([1, 2]));
        assert_eq!(
            runs.count_others_in(&BTreeSet::from(["x"]), &BTreeSet::from(["a"])),
            1
        );
    }

    #[test]
    fn a_line_that_was_cut_costs_only_itself() {
        let folder = tempfile::tempdir().unwrap();
        let log = log(folder.path());
        log.add_run(&run("a", 1, "x")).unwrap();
        let file = folder.path().join(".seedbed/runs/a.jsonl");
        append_to(&file, "{\"digest\":\"a\",\"run_se\n").unwrap();
        log.add_run(&run("a", 2, "x")).unwrap();
        assert_eq!(log.runs().run_seeds("a"), BTreeSet::from([1, 2]));
    }

    #[test]
    fn a_log_belongs_to_the_nearest_repository_or_log_above() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("a/b");
        fs::create_dir_all(&inner).unwrap();
        assert_eq!(project_folder(&inner), inner);
        fs::create_dir(folder.path().join(".git")).unwrap();
        assert_eq!(project_folder(&inner), folder.path());
        fs::create_dir(folder.path().join("a/.seedbed")).unwrap();
        assert_eq!(project_folder(&inner), folder.path().join("a"));
    }
}
