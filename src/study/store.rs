//! The folder of a study: one file per stored run, and a manifest for the report.
//!
//! The name of a result file has the run seed and a hash of everything else on which its run
//! depends. So after a study is changed, the results that are not affected are found again.

use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::external::{ExternalCell, ExternalRun, ExternalRuns};
use super::file::{Claim, Study};
use super::plan::{PlannedRun, StudyPlan};
use super::registration::Lock;
use super::report;
pub use super::result_file::StoredRun;
use super::run_checkpoint::{self, SavedProgress};
use super::run_marks::{self, RunMark};
use super::run_result::RunResult;
use crate::input_files;
use crate::storage::file_lock::FileLock;
use crate::storage::files;
use crate::storage::hashes::sha256;
use seedbed_env::Quantity;
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

/// Description of a study for its report: `study.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of seedbed that wrote the manifest.
    pub version: String,
    /// Name of the study.
    pub name: String,
    /// Path of the study file.
    pub study_path: String,
    /// Text of the study file.
    pub study: String,
    /// Whether the study was run with the settings of `quick`.
    pub quick: bool,
    /// Lock from which run seeds are derived; `None` for runs that are not registered.
    #[serde(default)]
    pub lock: Option<Lock>,
    /// Run seed of the first run of each cell, for runs that are not registered.
    pub first_seed: u64,
    /// Number of runs per cell.
    pub repeats: u64,
    /// Cells.
    pub cells: Vec<ManifestCell>,
    /// Claims that were added or changed after both of their cells had runs, as
    /// [`Claim::canonical_text`].
    #[serde(default)]
    pub late_claims: Vec<String>,
    /// Earlier values of `repeats`, in the order in which they were used. Only values with stored
    /// runs count.
    #[serde(default)]
    pub earlier_repeats: Vec<u64>,
    /// What changed in results of others of a registered study since they were read for the first
    /// time, as sentences.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub changed_results: Vec<String>,
    /// All results of others that a registered study has read.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub read_results: Vec<ReadResult>,
}

/// Description of a cell for the report.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ManifestCell {
    /// Name of the cell.
    pub name: String,
    /// Hash of everything on which its runs depend, except their run seeds.
    pub digest: String,
    /// Path of its scenario.
    pub scenario: String,
    /// Values that are replaced in the scenario, each as `path=value`.
    pub overrides: Vec<String>,
    /// Number of agents K.
    pub agents: u32,
    /// Maximum number of episodes per agent.
    pub max_episodes: u32,
    /// Name of its task.
    pub task: String,
    /// Observations of its agents: name, unit, and ends of the display range.
    pub observations: Vec<(String, String, [f32; 2])>,
    /// Results of others; `None` for a scenario.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub external: Option<ExternalCell>,
}

/// Number of digits of a digest in names of files.
const SHOWN_DIGITS: usize = 16;

/// The digits of a digest in names of files.
pub(super) fn shown_digits(digest: &str) -> &str {
    digest.get(..SHOWN_DIGITS).unwrap_or(digest)
}

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
            let figures = self.path.join(report::FIGURES);
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
        let stored = self.find_run(&run.cell.digest, run.run_seed, run.windows())?;
        let external = run.cell.source.external();
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
    ) -> Result<StoredRun, StoreError> {
        let stored = StoredRun::new(run.cell.digest.clone(), run.run_seed, outcome);
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
            (None, None) if self.damaged_file(&run.cell.digest, run.run_seed).is_some() => {
                RunState::Damaged
            }
            (None, None) if self.saved_progress(run).is_some() => RunState::Interrupted(None),
            (None, None) => RunState::ToRun,
        }
    }

    /// Path of the mark of a run that a process executes.
    pub(super) fn mark_file(&self, run: &PlannedRun<'_>) -> PathBuf {
        let result = self.result_file(&run.cell.digest, run.run_seed);
        result.with_extension(run_marks::EXTENSION)
    }

    /// Path of the checkpoint of a run that is not finished.
    fn checkpoint_file(&self, run: &PlannedRun<'_>) -> PathBuf {
        let result = self.result_file(&run.cell.digest, run.run_seed);
        result.with_extension(run_checkpoint::EXTENSION)
    }

    /// How far the checkpoint of a run is; `None` if this build cannot continue from one.
    #[must_use]
    pub fn saved_progress(&self, run: &PlannedRun<'_>) -> Option<SavedProgress> {
        run_checkpoint::progress(&self.checkpoint_file(run))
    }

    /// Removes the checkpoint of a run whose result is stored.
    pub(super) fn remove_checkpoint(&self, run: &PlannedRun<'_>) {
        run_checkpoint::remove(&self.checkpoint_file(run));
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

    /// Number of result files of runs with this digest.
    #[must_use]
    pub fn count_runs(&self, digest: &str) -> usize {
        let prefix = format!("{}-", shown_digits(digest));
        self.result_file_names()
            .iter()
            .filter(|name| name.starts_with(&prefix))
            .count()
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
    pub fn write_manifest(&self, plan: &StudyPlan) -> Result<(), StoreError> {
        self.write_manifest_with(plan, &[])
    }

    /// As [`write_manifest`](Self::write_manifest), with the histories of other folders of the study.
    pub(super) fn write_manifest_with(
        &self,
        plan: &StudyPlan,
        others: &[StudyFolder],
    ) -> Result<(), StoreError> {
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
    fn new_manifest(&self, plan: &StudyPlan) -> Result<Manifest, StoreError> {
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
                .map(|run| self.find_run(&run.cell.digest, run.run_seed, &[]));
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
    pub fn manifest(&self) -> Result<Manifest, StoreError> {
        let path = self.manifest_file();
        let text = read_text(&path, MAX_SMALL_FILE_BYTES).map_err(|error| error.to_string());
        let manifest = text.and_then(|text| {
            has_own_checksum(&text)?;
            serde_json::from_str(&text).map_err(|error| error.to_string())
        });
        manifest.map_err(|reason| StoreError { path, reason })
    }

    /// Manifest of the study; `None` if there is none.
    ///
    /// # Errors
    /// If it is damaged or cannot be read.
    pub fn manifest_if_any(&self) -> Result<Option<Manifest>, StoreError> {
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
    pub fn manifest_has_checksum(&self) -> Result<bool, StoreError> {
        let path = self.manifest_file();
        let text = read_text(&path, MAX_SMALL_FILE_BYTES).map_err(|error| error.to_string());
        text.and_then(|text| has_own_checksum(&text))
            .map_err(|reason| StoreError { path, reason })
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

/// End of a JSON object for readers.
const JSON_END: &str = "\n}\n";

/// What precedes the checksum in `study.json`: the SHA-256 of everything before this field.
const CHECKSUM_FIELD: &str = ",\n  \"sha256\": \"";

/// Whether a manifest ends with the checksum of its other fields; `false` if it has none.
///
/// # Errors
/// The checksum is wrong.
fn has_own_checksum(text: &str) -> Result<bool, String> {
    let Some((fields, rest)) = text.rsplit_once(CHECKSUM_FIELD) else {
        return Ok(false);
    };
    let sum = rest
        .strip_suffix(JSON_END)
        .and_then(|sum| sum.strip_suffix('"'));
    if sum == Some(sha256(fields).as_str()) {
        return Ok(true);
    }
    Err(
        "is damaged, or was changed after seedbed wrote it: its checksum does not match; if it is deleted, \
         `seedbed study` writes it again, without its history"
            .to_owned(),
    )
}

/// A value as JSON for readers, with a line break at the end.
pub(super) fn to_json(value: &impl Serialize) -> String {
    serde_json::to_string_pretty(value).expect("plain data always serializes") + "\n"
}

/// Writes a file in place of an earlier one.
pub(super) fn replace_file(path: PathBuf, bytes: &[u8]) -> Result<(), StoreError> {
    files::replace(&path, bytes).map_err(|error| StoreError {
        path,
        reason: error.to_string(),
    })
}

impl Manifest {
    /// The bytes of `study.json`, which end with their own checksum.
    pub(super) fn to_json(&self) -> String {
        let json = to_json(self);
        let fields = json.strip_suffix(JSON_END).unwrap_or(&json);
        let sum = sha256(fields);
        format!("{fields}{CHECKSUM_FIELD}{sum}\"{JSON_END}")
    }

    /// Claims of the study, as [`Claim::canonical_text`]; empty if this version cannot read the
    /// study file.
    fn claims(&self) -> Vec<String> {
        let Ok(study) = seedbed_input::parse::<Study>(&self.study_path, self.study.clone()) else {
            return Vec::new();
        };
        let claims = study.value.claims.iter();
        claims
            .map(|claim| claim.canonical_text(&study.value))
            .collect()
    }

    /// Run seeds of a cell, or ids of its runs if others made them.
    #[must_use]
    pub fn run_seeds_of(&self, cell: &ManifestCell) -> Vec<u64> {
        match &cell.external {
            Some(external) => external.runs.iter().map(|run| run.id).collect(),
            None => self.run_seeds(),
        }
    }

    /// Run seeds of each cell with a scenario.
    #[must_use]
    pub fn run_seeds(&self) -> Vec<u64> {
        match &self.lock {
            Some(lock) => {
                let repeats = lock.registered.looks.last().copied().unwrap_or(0);
                (0..repeats).map(|repeat| lock.run_seed(repeat)).collect()
            }
            None => (0..self.repeats)
                .map(|repeat| self.first_seed + repeat)
                .collect(),
        }
    }

    /// Sentence for the report if the number of runs per cell was changed after some runs, such as
    /// `The number of runs per cell was extended from 10 to 20 after some of them had been run.`
    #[must_use]
    pub fn changed_repeats_sentence(&self) -> Option<String> {
        if self.lock.is_some() {
            return None;
        }
        let last = self.earlier_repeats.last()?;
        let is_extended = self.earlier_repeats.is_sorted() && *last < self.repeats;
        let verb = if is_extended { "extended" } else { "changed" };
        let all_repeats = self.earlier_repeats.iter().chain([&self.repeats]);
        let all_repeats: Vec<String> = all_repeats.map(u64::to_string).collect();
        Some(format!(
            "The number of runs per cell was {verb} from {} after some of them had been run.",
            all_repeats.join(" to ")
        ))
    }

    pub(super) fn of(plan: &StudyPlan) -> Self {
        let cell = |cell: &super::plan::Cell| ManifestCell {
            name: cell.name.clone(),
            digest: cell.digest.clone(),
            scenario: shown_path(&cell.scenario),
            overrides: cell.overrides.clone(),
            agents: cell.source.agents(),
            max_episodes: cell.source.max_episodes(),
            task: cell.source.task().to_owned(),
            observations: cell.source.observations().iter().map(observation).collect(),
            external: cell.source.external().map(ExternalRuns::description),
        };
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            name: plan.name.clone(),
            study_path: shown_path(&plan.path.display().to_string()),
            study: plan.document.text.clone(),
            quick: plan.quick,
            lock: plan.lock.clone(),
            first_seed: *plan.study().first_seed,
            repeats: plan.repeats(),
            cells: plan.cells.iter().map(cell).collect(),
            late_claims: Vec::new(),
            earlier_repeats: Vec::new(),
            changed_results: Vec::new(),
            read_results: Vec::new(),
        }
    }
}

/// A path as results contain it, which others may read: relative to the working directory, or without
/// its folders, whose names are nobody's business.
fn shown_path(path: &str) -> String {
    let relative = input_files::relative_path(Path::new(path));
    let shown = if relative.is_absolute() {
        relative.file_name().map(PathBuf::from)
    } else {
        Some(relative)
    };
    shown.map_or_else(|| path.to_owned(), |shown| shown.display().to_string())
}

/// A run of others that a registered study has read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReadResult {
    /// Name of its cell.
    pub cell: String,
    /// Name of the run.
    pub run: String,
    /// Id of the run, which depends on its contents.
    pub id: u64,
}

impl Manifest {
    /// Completes the description of a registered study by what was read earlier of results of others.
    fn with_history(mut self, previous: Option<&Self>) -> Self {
        let id = |manifest: &Self| manifest.lock.as_ref().map(|lock| lock.id.clone());
        if self.lock.is_none() {
            return self;
        }
        if let Some(previous) = previous.filter(|previous| id(previous) == id(&self)) {
            self.read_results.clone_from(&previous.read_results);
            self.changed_results.clone_from(&previous.changed_results);
        }
        let now = self.results_of_others();
        for sentence in changes(&self.read_results, &now) {
            if !self.changed_results.contains(&sentence) {
                self.changed_results.push(sentence);
            }
        }
        for read in now {
            if !self.read_results.contains(&read) {
                self.read_results.push(read);
            }
        }
        self
    }

    /// Adds what happened in another folder of the same study.
    fn add_history(&mut self, other: Self) {
        add_new(&mut self.late_claims, other.late_claims);
        add_new(&mut self.earlier_repeats, other.earlier_repeats);
        add_new(&mut self.changed_results, other.changed_results);
        add_new(&mut self.read_results, other.read_results);
    }

    /// The runs of others.
    fn results_of_others(&self) -> Vec<ReadResult> {
        let runs_of = |cell: &ManifestCell| {
            let runs = cell.external.iter().flat_map(|external| &external.runs);
            let read = |run: &ExternalRun| ReadResult {
                cell: cell.name.clone(),
                run: run.name.clone(),
                id: run.id,
            };
            runs.map(read).collect::<Vec<_>>()
        };
        self.cells.iter().flat_map(runs_of).collect()
    }
}

/// Appends the items that are not yet in a list.
fn add_new<T: PartialEq>(list: &mut Vec<T>, items: Vec<T>) {
    for item in items {
        if !list.contains(&item) {
            list.push(item);
        }
    }
}

/// What changed in results of others since they were read: new runs with the contents of a run of
/// another cell, with the name of an earlier run, or in place of one that is gone. Without new runs,
/// those that are gone are only missing.
fn changes(earlier: &[ReadResult], now: &[ReadResult]) -> Vec<String> {
    let contains = |runs: &[ReadResult], run: &ReadResult| {
        let mut runs = runs.iter();
        runs.any(|other| other.cell == run.cell && other.id == run.id)
    };
    let mut sentences = Vec::new();
    for new in now.iter().filter(|run| !contains(earlier, run)) {
        let ReadResult { cell, run, id } = new;
        let mut of_cell = earlier.iter().filter(|other| other.cell == *cell);
        let sentence = if let Some(other) = earlier.iter().find(|other| other.id == *id) {
            format!(
                "The run `{run}` of cell `{cell}` had been read as `{}` of cell `{}`.",
                other.run, other.cell
            )
        } else if of_cell.clone().any(|other| other.run == *run) {
            format!("The run `{run}` of cell `{cell}` was changed after it had been read.")
        } else if let Some(gone) = of_cell.find(|other| !contains(now, other)) {
            format!(
                "The run `{run}` of cell `{cell}` was added when `{}`, which had been read, was gone.",
                gone.run
            )
        } else {
            continue;
        };
        sentences.push(sentence);
    }
    sentences
}

fn observation(quantity: &Quantity) -> (String, String, [f32; 2]) {
    (quantity.name.clone(), quantity.unit.clone(), quantity.range)
}

/// Error: a file in the folder of a study cannot be read or written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{path}: {reason}")]
pub struct StoreError {
    /// Path of the file.
    pub path: PathBuf,
    /// Reason, such as an error of the operating system.
    pub reason: String,
}
