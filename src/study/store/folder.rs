//! The folder of a study: one file per stored run, and a manifest for the report.
//!
//! The name of a result file has the run seed and a hash of everything else on which its run
//! depends. So after a study is changed, the results that are not affected are found again.

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};

use super::manifest::{Manifest, has_own_checksum};
use super::result_file::StoredRun;
use super::run_marks::{self, RunMark};
use crate::experiment::checkpoint::{self, SavedProgress};
use crate::experiment::run_result::RunResult;
use crate::storage::file_lock::FileLock;
use crate::storage::files;
use crate::storage::hashes::shown_digits;
use crate::study::FileError;
use crate::study::design::cell::PlannedRun;
use crate::study::design::file::Claim;
use crate::study::design::plan::StudyPlan;
use crate::study::file_error::replace_file;
use seedbed_input::limits::{MAX_LARGE_FILE_BYTES, MAX_SMALL_FILE_BYTES, read_bytes, read_text};

/// Folder with the results of a study.
#[derive(Clone, Debug)]
pub struct StudyFolder {
    path: PathBuf,
}

/// What is known of a run of a study.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RunState {
    /// Its result is stored.
    Finished,
    /// It failed, and the reason is stored.
    Failed,
    /// A process executes it.
    Running(RunMark),
    /// A process began it, and stopped or ended before it was finished. `None` if it left nothing but a
    /// checkpoint.
    Interrupted(Option<RunMark>),
    /// Its result file is damaged, was edited or has another layout.
    Damaged,
    /// It was not begun, or ended within its first second.
    ToRun,
}

/// Name of the folder of the figures of a report.
pub(in crate::study) const FIGURES: &str = "figures";

impl StudyFolder {
    /// The folder at `path`, which need not exist.
    #[must_use]
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into() }
    }

    /// Path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Locks the folder, and creates it if necessary. An `exclusive` lock is for one process; other
    /// locks can be held by any number of processes, each of which adds single runs. Removes files that
    /// processes did not complete because they were killed. `None` if a lock of another process
    /// conflicts.
    ///
    /// # Errors
    /// If the folder or the lock file cannot be created.
    pub fn lock(&self, exclusive: bool) -> io::Result<Option<FileLock>> {
        std::fs::create_dir_all(&self.path)?;
        let lock = FileLock::acquire(&self.path.join(".lock"), exclusive)?;
        if lock.is_some() {
            let figures = self.path.join(FIGURES);
            for folder in [&self.path, &self.runs_folder(), &figures] {
                files::remove_abandoned(folder, |_| true);
            }
        }
        Ok(lock)
    }

    /// Stored result of the run with this digest and run seed. `None` if there is none, or if it
    /// lacks the visited states for one of `windows`.
    #[must_use]
    pub fn find_run(&self, digest: &str, run_seed: u64, windows: &[u32]) -> Option<StoredRun> {
        let bytes = read_bytes(&self.result_file(digest, run_seed), MAX_LARGE_FILE_BYTES).ok()?;
        let stored = StoredRun::from_bytes(&bytes)?;
        let matches_request = stored.digest == digest && stored.run_seed == run_seed;
        (matches_request && stored.has_windows(windows)).then_some(stored)
    }

    /// Stored result of a planned run. `None` if there is none, if it lacks visited states that the
    /// run should have, or if an earlier version rounded returns of others more than their files.
    #[must_use]
    pub fn stored_run(&self, run: &PlannedRun<'_>) -> Option<StoredRun> {
        let stored = self.find_run(run.cell.digest(), run.run_seed, run.windows())?;
        let external = run.cell.source.found();
        let current = external.and_then(|runs| runs.result(run.run_seed));
        let is_as_rounded = match (&stored.outcome, current) {
            (Ok(stored), Some(current)) => stored.rounding == current.rounding,
            _ => true,
        };
        is_as_rounded.then_some(stored)
    }

    /// Stores the outcome of a run.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn store(
        &self,
        run: &PlannedRun<'_>,
        outcome: Result<RunResult, String>,
    ) -> Result<StoredRun, FileError> {
        let stored = StoredRun::new(run.cell.digest().to_owned(), run.run_seed, outcome);
        let path = self.result_file(&stored.digest, stored.run_seed);
        replace_file(path, &stored.to_bytes())?;
        Ok(stored)
    }

    /// Path of the result file of a run: its name has the first digits of the digest, the file has all.
    #[must_use]
    pub fn result_file(&self, digest: &str, run_seed: u64) -> PathBuf {
        let name = format!("{}-{run_seed}.run", shown_digits(digest));
        self.runs_folder().join(name)
    }

    /// What is known of a run.
    #[must_use]
    pub fn state_of(&self, run: &PlannedRun<'_>) -> RunState {
        let stored = self.stored_run(run).map(|stored| stored.outcome);
        match (stored, run_marks::find(&self.mark_file(run))) {
            (Some(Ok(_)), _) => RunState::Finished,
            (_, Some((mark, true))) => RunState::Running(mark),
            (Some(Err(_)), _) => RunState::Failed,
            (None, Some((mark, false))) => RunState::Interrupted(Some(mark)),
            (None, None) if self.damaged_file(run.cell.digest(), run.run_seed).is_some() => {
                RunState::Damaged
            }
            (None, None) if self.saved_progress(run).is_some() => RunState::Interrupted(None),
            (None, None) => RunState::ToRun,
        }
    }

    /// Path of the mark of a run that a process executes.
    pub(in crate::study) fn mark_file(&self, run: &PlannedRun<'_>) -> PathBuf {
        let result = self.result_file(run.cell.digest(), run.run_seed);
        result.with_extension(run_marks::EXTENSION)
    }

    /// Path of the checkpoint of a run that is not finished.
    fn checkpoint_file(&self, run: &PlannedRun<'_>) -> PathBuf {
        checkpoint::file_in(&self.runs_folder(), run.cell.digest(), run.run_seed)
    }

    /// How far the checkpoint of a run is; `None` if this build cannot continue from one.
    #[must_use]
    pub fn saved_progress(&self, run: &PlannedRun<'_>) -> Option<SavedProgress> {
        checkpoint::progress(&self.checkpoint_file(run))
    }

    /// Removes the checkpoint of a run whose result is stored.
    pub(in crate::study) fn remove_checkpoint(&self, run: &PlannedRun<'_>) {
        checkpoint::remove(&self.checkpoint_file(run));
    }

    /// Removes the checkpoints that processes left of runs whose results are stored, because they were
    /// killed in between or executed a run that another one finished.
    pub fn remove_checkpoints_of_finished(&self, runs: &[PlannedRun<'_>]) {
        for run in runs {
            if self.checkpoint_file(run).exists() && self.stored_run(run).is_some() {
                self.remove_checkpoint(run);
            }
        }
    }

    /// Removes the marks of processes that ended before their runs were finished. Of use only if no
    /// other process executes runs.
    pub fn remove_leftovers(&self) {
        run_marks::remove_all(&self.runs_folder());
    }

    /// Whether there is a result file of the run, readable or not.
    #[must_use]
    pub fn has_result_file(&self, digest: &str, run_seed: u64) -> bool {
        self.result_file(digest, run_seed).exists()
    }

    /// Path of the result file of a run, if it is damaged, was edited or has another layout.
    #[must_use]
    pub fn damaged_file(&self, digest: &str, run_seed: u64) -> Option<PathBuf> {
        let is_damaged = self.has_result_file(digest, run_seed)
            && self.find_run(digest, run_seed, &[]).is_none();
        is_damaged.then(|| self.result_file(digest, run_seed))
    }

    /// Run seeds of all result files of runs with this digest.
    #[must_use]
    pub fn run_seeds(&self, digest: &str) -> BTreeSet<u64> {
        let prefix = format!("{}-", shown_digits(digest));
        let run_seed = |name: &String| {
            let rest = name.strip_prefix(&prefix)?;
            rest.strip_suffix(".run")?.parse().ok()
        };
        self.result_file_names()
            .iter()
            .filter_map(run_seed)
            .collect()
    }

    /// Names of all result files; empty if there is no folder of result files.
    #[must_use]
    pub fn result_file_names(&self) -> Vec<String> {
        let Ok(entries) = std::fs::read_dir(self.runs_folder()) else {
            return Vec::new();
        };
        let is_result =
            |path: &PathBuf| path.extension().is_some_and(|extension| extension == "run");
        let paths = entries
            .flatten()
            .map(|entry| entry.path())
            .filter(is_result);
        paths
            .filter_map(|path| path.file_name()?.to_str().map(str::to_owned))
            .collect()
    }

    /// Path of the folder of all result files.
    #[must_use]
    pub fn runs_folder(&self) -> PathBuf {
        self.path.join("runs")
    }

    /// Writes the manifest unless it is up to date. Updates late claims and earlier numbers of
    /// runs.
    ///
    /// # Errors
    /// If the file cannot be written.
    ///
    /// # Panics
    /// Never: plain data always serializes.
    pub fn write_manifest(&self, plan: &StudyPlan) -> Result<(), FileError> {
        self.write_manifest_with(plan, &[])
    }

    /// As [`write_manifest`](Self::write_manifest), with the histories of other folders of the study.
    pub(super) fn write_manifest_with(
        &self,
        plan: &StudyPlan,
        others: &[StudyFolder],
    ) -> Result<(), FileError> {
        let path = self.manifest_file();
        let mut manifest = self.new_manifest(plan)?;
        for other in others {
            manifest.add_history(other.new_manifest(plan)?);
        }
        let text = manifest.to_json();
        if read_text(&path, MAX_SMALL_FILE_BYTES).is_ok_and(|stored_text| stored_text == text) {
            return Ok(());
        }
        replace_file(path, text.as_bytes())
    }

    /// The manifest of the study, with the history of this folder.
    fn new_manifest(&self, plan: &StudyPlan) -> Result<Manifest, FileError> {
        let previous = self.manifest_if_any()?;
        let manifest = Manifest {
            late_claims: self.late_claims(plan, previous.as_ref()),
            earlier_repeats: self.earlier_repeats(plan, previous.as_ref()),
            ..Manifest::of(plan)
        };
        Ok(manifest.with_history(previous.as_ref()))
    }

    /// Late claims: late claims of the previous manifest, and new claims whose cells both have
    /// runs.
    fn late_claims(&self, plan: &StudyPlan, previous: Option<&Manifest>) -> Vec<String> {
        let study = plan.study();
        let previous_claims = previous.map(Manifest::claims).unwrap_or_default();
        let mut late_claims = Vec::new();
        for claim in &study.claims {
            let text = claim.canonical_text(study);
            let was_late = previous.is_some_and(|previous| previous.late_claims.contains(&text));
            let is_late =
                was_late || !previous_claims.contains(&text) && self.has_runs_of_both(plan, claim);
            if is_late {
                late_claims.push(text);
            }
        }
        late_claims
    }

    /// Whether both cells that a claim compares have runs.
    fn has_runs_of_both(&self, plan: &StudyPlan, claim: &Claim) -> bool {
        let runs = plan.runs();
        let has_runs = |cell: &str| {
            let mut runs = runs.iter().filter(|run| run.cell.name == cell);
            runs.any(|run| self.stored_run(run).is_some())
        };
        has_runs(&claim.compare.0) && (claim.number().is_some() || has_runs(&claim.compare.1))
    }

    /// Earlier numbers of runs per cell: the earlier numbers in the previous manifest and, if the
    /// number has changed and there are stored runs, the number of the previous manifest.
    fn earlier_repeats(&self, plan: &StudyPlan, previous: Option<&Manifest>) -> Vec<u64> {
        let Some(previous) = previous else {
            return Vec::new();
        };
        let mut repeats = previous.earlier_repeats.clone();
        let has_runs = || {
            let runs = plan.runs();
            let mut stored = runs
                .iter()
                .filter(|run| run.name.is_none())
                .map(|run| self.find_run(run.cell.digest(), run.run_seed, &[]));
            stored.any(|stored| stored.is_some())
        };
        if previous.repeats != plan.repeats() && has_runs() {
            repeats.push(previous.repeats);
        }
        repeats
    }

    /// Manifest of the study.
    ///
    /// # Errors
    /// If there is no manifest, or if it is damaged or cannot be read.
    pub fn manifest(&self) -> Result<Manifest, FileError> {
        let path = self.manifest_file();
        let text = read_text(&path, MAX_SMALL_FILE_BYTES).map_err(|error| error.to_string());
        let manifest = text.and_then(|text| {
            has_own_checksum(&text)?;
            serde_json::from_str(&text).map_err(|error| error.to_string())
        });
        manifest.map_err(|reason| FileError { path, reason })
    }

    /// Manifest of the study; `None` if there is none.
    ///
    /// # Errors
    /// If it is damaged or cannot be read.
    pub fn manifest_if_any(&self) -> Result<Option<Manifest>, FileError> {
        if self.manifest_file().exists() {
            self.manifest().map(Some)
        } else {
            Ok(None)
        }
    }

    /// Whether the manifest has a checksum; those of earlier versions have none.
    ///
    /// # Errors
    /// As [`manifest`](Self::manifest).
    pub fn manifest_has_checksum(&self) -> Result<bool, FileError> {
        let path = self.manifest_file();
        let text = read_text(&path, MAX_SMALL_FILE_BYTES).map_err(|error| error.to_string());
        text.and_then(|text| has_own_checksum(&text))
            .map_err(|reason| FileError { path, reason })
    }

    /// Whether the folder has the manifest of a study, readable or not.
    #[must_use]
    pub fn has_manifest(&self) -> bool {
        self.manifest_file().exists()
    }

    fn manifest_file(&self) -> PathBuf {
        self.path.join("study.json")
    }
}
