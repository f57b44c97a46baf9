//! `study.json`: what a study is, for readers of its results.

use serde::{Deserialize, Deserializer, Serialize};

use crate::storage::hashes::sha256;
use crate::study::design::cell::{Cell, CellDescription, shown_path};
use crate::study::design::claims_of_today;
use crate::study::design::file::Study;
use crate::study::design::lock::Lock;
use crate::study::design::plan::StudyPlan;
use crate::study::external::ExternalRun;
use crate::study::file_error::to_json;

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
    pub cells: Vec<CellDescription>,
    /// Claims that were added or changed after both of their cells had runs, as
    /// [`Claim::canonical_text`](crate::study::design::file::Claim::canonical_text).
    #[serde(default, deserialize_with = "read_claims")]
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

/// Reads claims, which may be written as in earlier versions.
fn read_claims<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<String>, D::Error> {
    let claims: Vec<String> = Vec::deserialize(deserializer)?;
    Ok(claims_of_today(&claims))
}

/// End of a JSON object for readers.
const JSON_END: &str = "\n}\n";

/// What precedes the checksum in `study.json`: the SHA-256 of everything before this field.
const CHECKSUM_FIELD: &str = ",\n  \"sha256\": \"";

/// Whether a manifest ends with the checksum of its other fields; `false` if it has none.
///
/// # Errors
/// The checksum is wrong.
pub(super) fn has_own_checksum(text: &str) -> Result<bool, String> {
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

impl Manifest {
    /// The bytes of `study.json`, which end with their own checksum.
    pub(in crate::study) fn to_json(&self) -> String {
        let json = to_json(self);
        let fields = json.strip_suffix(JSON_END).unwrap_or(&json);
        let sum = sha256(fields);
        format!("{fields}{CHECKSUM_FIELD}{sum}\"{JSON_END}")
    }

    /// Claims of the study, as [`Claim::canonical_text`](crate::study::design::file::Claim::canonical_text); empty if this version cannot read the
    /// study file.
    pub(super) fn claims(&self) -> Vec<String> {
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
    pub fn run_seeds_of(&self, cell: &CellDescription) -> Vec<u64> {
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

    pub(in crate::study) fn of(plan: &StudyPlan) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            name: plan.name.clone(),
            study_path: shown_path(&plan.path.display().to_string()),
            study: plan.document.text.clone(),
            quick: plan.quick,
            lock: plan.lock.clone(),
            first_seed: *plan.study().first_seed,
            repeats: plan.repeats(),
            cells: plan.cells.iter().map(Cell::description).collect(),
            late_claims: Vec::new(),
            earlier_repeats: Vec::new(),
            changed_results: Vec::new(),
            read_results: Vec::new(),
        }
    }
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
    pub(super) fn with_history(mut self, previous: Option<&Self>) -> Self {
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
    pub(super) fn add_history(&mut self, other: Self) {
        add_new(&mut self.late_claims, other.late_claims);
        add_new(&mut self.earlier_repeats, other.earlier_repeats);
        add_new(&mut self.changed_results, other.changed_results);
        add_new(&mut self.read_results, other.read_results);
    }

    /// The runs of others.
    fn results_of_others(&self) -> Vec<ReadResult> {
        let runs_of = |cell: &CellDescription| {
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
