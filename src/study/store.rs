//! A study's folder: one small file a finished run, and what the report has to know about the study.
//!
//! A file is named after what its run depends on and its seed, so a changed study finds what its change leaves valid.

use std::fs::{File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::build::{self, BuildMark};
use super::file::{Claim, Study};
use super::measured::Measured;
use super::plan::{StudyPlan, Task};
use crate::env::Quantity;
use crate::input;
use crate::run::files;

/// The layout of result files. Files of another layout count as missing.
const LAYOUT: u32 = 2;

/// Where a study's results lie.
#[derive(Clone, Debug)]
pub struct StudyFolder {
    path: PathBuf,
}

/// What a result file holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StoredRun {
    layout: u32,
    /// The version that ran it.
    pub version: String,
    /// What the run depended on, besides its seed.
    pub digest: String,
    /// Its seed.
    pub seed: u64,
    /// What it came to, or why it failed.
    pub outcome: Result<Measured, String>,
    /// The build that ran it, where it is known. Stands after all else, where those that do not know of it do not look.
    #[serde(skip)]
    pub build: Option<BuildMark>,
}

/// What the report knows of the study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// The version that began the study.
    pub version: String,
    /// The study's name.
    pub name: String,
    /// Its file.
    pub study_path: String,
    /// The text of that file.
    pub study: String,
    /// Whether it was run as `quick` says.
    pub quick: bool,
    /// The seed of each cell's first run.
    pub first_seed: u64,
    /// Runs of each cell.
    pub repeats: u64,
    /// The cells.
    pub cells: Vec<ManifestCell>,
    /// Claims, spelled out, that were written or changed when there were runs of what they compare already.
    #[serde(default)]
    pub late_claims: Vec<String>,
    /// Runs of each cell that were asked for before, from first to last, when some were there already.
    #[serde(default)]
    pub earlier_repeats: Vec<u64>,
}

/// What the report knows of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ManifestCell {
    /// Its name.
    pub name: String,
    /// What its runs depend on, besides their seeds.
    pub digest: String,
    /// The file of its scenario.
    pub scenario: String,
    /// What is replaced there.
    pub overrides: Vec<String>,
    /// K.
    pub agents: u32,
    /// Episodes of each agent after which its runs end at the latest.
    pub most_episodes: u32,
    /// The name of its task.
    pub task: String,
    /// What its agents observe: name, unit, and the ends of the display range.
    pub observations: Vec<(String, String, [f32; 2])>,
}

/// The right to run a study here. Given back when dropped, or when the process ends however it ends.
#[derive(Debug)]
pub struct StudyClaim {
    _lock: File,
}

impl StudyFolder {
    /// The folder at `path`, which need not exist.
    #[must_use]
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into() }
    }

    /// The folder itself.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Claims the folder, creating it where there is none: for one process alone, or for many that each add a single run. `None` where
    /// another process stands in the way.
    ///
    /// # Errors
    /// The system refuses.
    pub fn claim(&self, alone: bool) -> io::Result<Option<StudyClaim>> {
        std::fs::create_dir_all(&self.path)?;
        let lock = File::options()
            .create(true)
            .truncate(false)
            .write(true)
            .open(self.path.join(".lock"))?;
        match if alone {
            lock.try_lock()
        } else {
            lock.try_lock_shared()
        } {
            Ok(()) => Ok(Some(StudyClaim { _lock: lock })),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(error)) => Err(error),
        }
    }

    /// What is stored of a run, if it is whole and has the states that are wanted of it.
    #[must_use]
    pub fn stored(&self, digest: &str, seed: u64, windows: &[u32]) -> Option<StoredRun> {
        let bytes = std::fs::read(self.file(digest, seed)).ok()?;
        let (stored, rest) = postcard::take_from_bytes::<StoredRun>(&bytes).ok()?;
        let stored = StoredRun {
            build: postcard::from_bytes(rest).ok(),
            ..stored
        };
        let kept = |run: &Measured| {
            windows
                .iter()
                .all(|window| run.states.iter().any(|states| states.episodes == *window))
        };
        let whole = stored.layout == LAYOUT && stored.digest == digest && stored.seed == seed;
        (whole && stored.outcome.as_ref().map_or(true, kept)).then_some(stored)
    }

    /// The same for a task.
    #[must_use]
    pub fn stored_task(&self, task: &Task<'_>) -> Option<StoredRun> {
        self.stored(&task.cell.digest, task.seed, task.windows())
    }

    /// Stores what came of a task.
    ///
    /// # Errors
    /// The file cannot be written.
    ///
    /// # Panics
    /// Never: plain data always serialises.
    pub fn store(
        &self,
        task: &Task<'_>,
        outcome: Result<Measured, String>,
    ) -> Result<StoredRun, StoreError> {
        let (version, digest) = (
            env!("CARGO_PKG_VERSION").to_owned(),
            task.cell.digest.clone(),
        );
        let stored = StoredRun {
            layout: LAYOUT,
            version,
            digest,
            seed: task.seed,
            outcome,
            build: build::mark(),
        };
        let mut bytes = postcard::to_stdvec(&stored).expect("plain data always serialises");
        bytes.extend(stored.build.into_iter().flatten());
        let path = self.file(&stored.digest, stored.seed);
        files::replace(&path, &bytes).map_err(|error| StoreError {
            path,
            reason: error.to_string(),
        })?;
        Ok(stored)
    }

    /// Where a run's result lies.
    #[must_use]
    pub fn file(&self, digest: &str, seed: u64) -> PathBuf {
        self.runs().join(format!("{digest}-{seed}.run"))
    }

    /// Where all results lie.
    #[must_use]
    pub fn runs(&self) -> PathBuf {
        self.path.join("runs")
    }

    /// Notes what the study is, unless the same is noted already, which of its claims come late, and whether its repeats were changed.
    ///
    /// # Errors
    /// The file cannot be written.
    ///
    /// # Panics
    /// Never: plain data always serialises.
    pub fn note(&self, plan: &StudyPlan) -> Result<(), StoreError> {
        let path = self.manifest_file();
        let noted = self.manifest().ok();
        let (late_claims, earlier_repeats) = (
            self.late_claims(plan, noted.as_ref()),
            self.earlier_repeats(plan, noted.as_ref()),
        );
        let manifest = Manifest {
            late_claims,
            earlier_repeats,
            ..Manifest::of(plan)
        };
        let mut text =
            serde_json::to_string_pretty(&manifest).expect("plain data always serialises");
        text.push('\n');
        if std::fs::read_to_string(&path).is_ok_and(|noted| noted == text) {
            return Ok(());
        }
        files::replace(&path, text.as_bytes()).map_err(|error| StoreError {
            path,
            reason: error.to_string(),
        })
    }

    /// Claims that were late before and still are there, and those that are new although both sides have runs.
    fn late_claims(&self, plan: &StudyPlan, noted: Option<&Manifest>) -> Vec<String> {
        let known = noted
            .and_then(|noted| input::parse::<Study>(&noted.study_path, noted.study.clone()).ok());
        let known: Vec<String> = known
            .iter()
            .flat_map(|study| {
                study
                    .value
                    .claims
                    .iter()
                    .map(|claim| claim.spelled_out(&study.value))
            })
            .collect();
        let was_late =
            |claim: &String| noted.is_some_and(|noted| noted.late_claims.contains(claim));
        let (study, tasks) = (plan.study(), plan.tasks());
        let has_runs = |name: &str| {
            tasks
                .iter()
                .any(|task| task.cell.name == name && self.stored_task(task).is_some())
        };
        let is_late = |(claim, spelled): &(&Claim, String)| {
            was_late(spelled)
                || !known.contains(spelled)
                    && has_runs(&claim.compare.0)
                    && has_runs(&claim.compare.1)
        };
        let spelled = study
            .claims
            .iter()
            .map(|claim| (claim, claim.spelled_out(study)));
        spelled
            .filter(is_late)
            .map(|(_, spelled)| spelled)
            .collect()
    }

    /// Repeats that were noted before, and those noted last if they are others now although there are runs.
    fn earlier_repeats(&self, plan: &StudyPlan, noted: Option<&Manifest>) -> Vec<u64> {
        let Some(noted) = noted else {
            return Vec::new();
        };
        let has_runs = || {
            plan.tasks()
                .iter()
                .any(|task| self.stored(&task.cell.digest, task.seed, &[]).is_some())
        };
        let changed = noted.repeats != plan.repeats() && has_runs();
        noted
            .earlier_repeats
            .iter()
            .copied()
            .chain(changed.then_some(noted.repeats))
            .collect()
    }

    /// What study this is.
    ///
    /// # Errors
    /// No study was ever run here, or by another version.
    pub fn manifest(&self) -> Result<Manifest, StoreError> {
        let path = self.manifest_file();
        let text = std::fs::read_to_string(&path).map_err(|error| error.to_string());
        let manifest =
            text.and_then(|text| serde_json::from_str(&text).map_err(|error| error.to_string()));
        manifest.map_err(|reason| StoreError { path, reason })
    }

    fn manifest_file(&self) -> PathBuf {
        self.path.join("study.json")
    }
}

impl Manifest {
    /// How often each cell was to be run, from first to last, if that was changed when there were runs: such as `Runs were extended from 10 to 20 …`.
    #[must_use]
    pub fn changed_repeats(&self) -> Option<String> {
        let last = self.earlier_repeats.last()?;
        let word = if self.earlier_repeats.is_sorted() && *last < self.repeats {
            "extended"
        } else {
            "changed"
        };
        let all = self
            .earlier_repeats
            .iter()
            .chain([&self.repeats])
            .map(u64::to_string);
        Some(format!(
            "Runs were {word} from {} after the first were there.",
            all.collect::<Vec<_>>().join(" to ")
        ))
    }

    /// What the report has to know of a study before any of it is run.
    fn of(plan: &StudyPlan) -> Self {
        let cell = |cell: &super::plan::Cell| ManifestCell {
            name: cell.name.clone(),
            digest: cell.digest.clone(),
            scenario: cell.scenario.display().to_string(),
            overrides: cell.overrides.clone(),
            agents: cell.course.agents(),
            most_episodes: cell.course.most_episodes(),
            task: cell.course.task().to_owned(),
            observations: cell.course.observations().iter().map(noted).collect(),
        };
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            name: plan.name.clone(),
            study_path: plan.path.display().to_string(),
            study: plan.document.text.clone(),
            quick: plan.quick,
            first_seed: *plan.study().first_seed,
            repeats: plan.repeats(),
            cells: plan.cells.iter().map(cell).collect(),
            late_claims: Vec::new(),
            earlier_repeats: Vec::new(),
        }
    }
}

fn noted(quantity: &Quantity) -> (String, String, [f32; 2]) {
    (quantity.name.clone(), quantity.unit.clone(), quantity.range)
}

/// A file of a study's folder that cannot be read or written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{path}: {reason}")]
pub struct StoreError {
    /// The file.
    pub path: PathBuf,
    /// What the system said.
    pub reason: String,
}
