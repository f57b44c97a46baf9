//! The lock of a study: what is registered before its runs, and the run seeds that derive from it.
//!
//! It contains everything on which verdicts depend, and its id is the hash of that. Run seeds are derived from the id,
//! so nobody can have seen the runs before the study was registered, and a change of any claim, cell or number of runs
//! changes all runs. A later lock names the earlier ones and their claims.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::cell::CellDescription;
use super::file::{Claim, NamedCell, Study};
use super::former_digests::{claims_of_today, is_hash_of_study};
use crate::provenance;
use crate::storage::hashes::sha256;
use crate::study::FileError;
use crate::study::external::FileHash;
use seedbed_input::limits::{MAX_SMALL_FILE_BYTES, read_text};
use seedbed_input::{FORMER_NAMES, InputError, settings_of};
use seedbed_settings::SCHEMA_VERSION;
use seedbed_stats::family::FAMILY_LEVEL;

/// Number of digits of an id that are shown.
const SHOWN_DIGITS: usize = 12;

/// What is registered: the contents of `STUDY.lock`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lock {
    /// SHA-256, in hexadecimal digits, of [`Registered`] as compact JSON.
    pub id: String,
    /// What was registered.
    pub registered: Registered,
}

/// Everything that a lock fixes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Registered {
    /// Name of the study.
    pub study: String,
    /// Error probability of each family of claims, on each side.
    pub level: f64,
    /// Numbers of runs per cell at which the claims are evaluated, in ascending order.
    pub looks: Vec<u64>,
    /// Claims, as [`Claim::canonical_text`](crate::study::design::file::Claim::canonical_text), followed by their
    /// texts.
    pub claims: Vec<String>,
    /// Version of the digests and hashes of settings; 0 for hashes of printed settings, as earlier versions wrote them.
    // Not in the hash of those locks.
    #[serde(default, skip_serializing_if = "is_former")]
    pub settings_version: u32,
    /// Names of the cells, and digests of everything on which their runs depend.
    pub cells: Vec<(String, String)>,
    /// SHA-256 of the study file's settings, so that no text and no figure can be changed.
    pub study_hash: String,
    /// SHA-256 of the descriptions of the cells in reports, apart from paths.
    pub descriptions_hash: String,
    /// Version of seedbed.
    pub version: String,
    /// Commit of seedbed, if known.
    pub commit: Option<String>,
    /// Build of seedbed.
    pub build: String,
    /// Cells whose settings had runs with other run seeds when the study was registered, and the
    /// number of these runs.
    pub seen_before: Vec<(String, usize)>,
    /// What the project's log of runs had; `None` if none was kept.
    // Not in the hash of earlier locks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run_log: Option<SeenInLog>,
    /// Cells of results of others.
    // Not in the hash of studies without such cells, so that locks of earlier versions stay valid.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub results_of_others: Vec<RegisteredResults>,
    /// Files of results that existed when the study or an earlier version was registered. They are not
    /// used.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub seen_files: Vec<SeenFile>,
    /// Earlier locks of this study, the first one first, and those in the project's log that have a cell or the
    /// name in common with it, and are not those of `related`.
    pub ancestors: Vec<Ancestor>,
    /// Other studies in the same directory that were registered before and have a cell in common with this one.
    // Not in the hash of earlier locks.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub related: Vec<RelatedStudy>,
}

/// Another registered study, which stays registered.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RelatedStudy {
    /// Its name.
    pub study: String,
    /// Id of its lock.
    pub id: String,
}

/// Numbers of runs in the [log of the project](crate::run_log).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeenInLog {
    /// All runs, of any task.
    pub runs: usize,
    /// Runs in tasks of the study with settings that no cell has.
    pub others_in_tasks: usize,
}

/// What is registered of a cell of results of others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RegisteredResults {
    /// Name of the cell.
    pub cell: String,
    /// Where the files are and what in them is what, as in study files.
    pub source: String,
    /// Return and window at which a run counts as solved, as in study files; empty if it has none.
    pub solved: String,
    /// Maximum number of episodes of each agent that are used.
    pub max_episodes: Option<u32>,
    /// Maximum number of environment steps of the team that are used.
    pub max_steps: Option<u32>,
    /// Number of runs.
    pub runs: u64,
    /// What the lock cannot fix.
    pub not_fixed: String,
}

/// What a lock cannot fix of results of others.
pub const NOT_FIXED: &str = "run seeds, code, and when the runs were made";

/// A file of results that existed at a registration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeenFile {
    /// Name of the cell.
    pub cell: String,
    /// The file.
    pub file: FileHash,
}

/// An earlier lock of a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ancestor {
    /// Id of the lock.
    pub id: String,
    /// Its claims.
    pub claims: Vec<String>,
    /// Its looks.
    pub looks: Vec<u64>,
}

impl RelatedStudy {
    /// The study of a lock.
    pub(super) fn of_lock(lock: &Lock) -> Self {
        Self {
            study: lock.registered.study.clone(),
            id: lock.id.clone(),
        }
    }

    /// The first digits of the id of its lock.
    #[must_use]
    pub fn short_id(&self) -> &str {
        short_id(&self.id)
    }
}

/// Error: a study cannot be registered or confirmed.
#[derive(Debug, thiserror::Error)]
pub enum RegistrationError {
    /// The lock file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The lock file, or the file of former digests beside it, cannot be read.
    #[error(transparent)]
    Unreadable(FileError),
    /// There is no lock file.
    #[error("{path}: no such file; register the study with `seedbed study register` first", path = .0.display())]
    NotRegistered(PathBuf),
    /// The lock file is no lock.
    #[error("{path}: this is no lock of a study: {reason}; expected an unchanged file that `seedbed study register` wrote", path = .path.display())]
    Invalid {
        /// Path of the lock file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The lock file was changed after it was written.
    #[error("{path}: this lock was changed after it was made: its contents do not have its id; expected an unchanged file", path = .0.display())]
    Changed(PathBuf),
    /// The study differs from its lock.
    #[error("{path}: the study differs from its lock: {differences}; expected no difference, or a new registration with `seedbed study register`", path = .path.display(), differences = .differences.join("; "))]
    Differs {
        /// Path of the lock file.
        path: PathBuf,
        /// What differs.
        differences: Vec<String>,
    },
    /// Results of others cannot be used.
    #[error(transparent)]
    Results(#[from] InputError),
    /// The study has nothing to confirm.
    #[error("{path}: the study has no confirmatory claim; expected `confirmatory: true` in at least one claim", path = .0.display())]
    NothingToConfirm(PathBuf),
}

impl Registered {
    /// What is registered of a study whose cells have these names and digests, by this build and
    /// without a history.
    pub(in crate::study) fn of(
        name: &str,
        (study, text): (&Study, &str),
        cells: &[CellDescription],
    ) -> Self {
        let claim = |claim: &Claim| format!("{} | {}", claim.canonical_text(study), claim.text);
        Self {
            study: name.to_owned(),
            level: FAMILY_LEVEL,
            looks: study.looks(),
            claims: study.claims.iter().map(claim).collect(),
            settings_version: SCHEMA_VERSION,
            cells: cells
                .iter()
                .map(|cell| (cell.name.clone(), cell.digest.clone()))
                .collect(),
            study_hash: settings_of::<Study>(text).digest(&FORMER_NAMES),
            descriptions_hash: sha256_of_json(&without_paths(study, cells)),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: provenance::commit().map(str::to_owned),
            build: provenance::format_build_id(provenance::build_id()),
            seen_before: Vec::new(),
            run_log: None,
            results_of_others: study
                .cells
                .iter()
                .filter_map(|cell| RegisteredResults::of(study, cell))
                .collect(),
            seen_files: Vec::new(),
            ancestors: Vec::new(),
            related: Vec::new(),
        }
    }

    /// What differs from `other` in claims, cells and looks, as sentences without a full stop.
    pub(in crate::study) fn differences(&self, other: &Self) -> Vec<String> {
        let mut differences = Vec::new();
        let [locked, planned] = [&self.claims, &other.claims].map(|claims| claims_of_today(claims));
        for claim in locked.iter().filter(|claim| !planned.contains(claim)) {
            differences.push(format!("the claim `{claim}` is not in the study"));
        }
        for claim in planned.iter().filter(|claim| !locked.contains(claim)) {
            differences.push(format!("the claim `{claim}` is not in the lock"));
        }
        if self.looks != other.looks {
            differences.push(format!(
                "numbers of runs per cell are {} in the lock and {} in the study",
                list(&self.looks),
                list(&other.looks)
            ));
        }
        for (name, digest) in &self.cells {
            match other.cells.iter().find(|(other, _)| other == name) {
                Some((_, other_digest)) if other_digest == digest => {}
                Some(_) => differences.push(format!(
                    "the scenario, the task or the settings of cell `{name}` were changed"
                )),
                None => differences.push(format!("the cell `{name}` is not in the study")),
            }
        }
        let is_new = |name: &String| !self.cells.iter().any(|(other, _)| other == name);
        for (name, _) in other.cells.iter().filter(|(name, _)| is_new(name)) {
            differences.push(format!("the cell `{name}` is not in the lock"));
        }
        if differences.is_empty() && self.study != other.study {
            differences.push(format!(
                "the study is named `{}`, not `{}`",
                other.study, self.study
            ));
        }
        if differences.is_empty() && !is_hash_of_study(&self.study_hash, &other.study_hash) {
            differences.push("a text, a figure, a measure or another value was changed".to_owned());
        }
        if differences.is_empty() && self.descriptions_hash != other.descriptions_hash {
            differences.push("the description of a cell was changed".to_owned());
        }
        differences
    }
}

impl RegisteredResults {
    /// What is registered of a cell; `None` if it has a scenario.
    fn of(study: &Study, cell: &NamedCell) -> Option<Self> {
        let source = cell.results.as_ref()?;
        let solved = cell.solved.as_deref().or(study.solved.as_deref());
        let max_episodes = cell
            .max_episodes
            .as_deref()
            .or(study.max_episodes.as_deref());
        let max_steps = cell.max_steps.as_deref().or(study.max_steps.as_deref());
        let runs = study.expected_runs_of_others(&cell.name, true);
        Some(Self {
            cell: cell.name.value().clone(),
            source: source.text(),
            solved: solved.map_or(String::new(), |solved| {
                ron::to_string(solved).expect("plain data always serializes")
            }),
            max_episodes: max_episodes.map(|max| max.get()),
            max_steps: max_steps.map(|max| max.get()),
            runs: runs.unwrap_or_default(),
            not_fixed: NOT_FIXED.to_owned(),
        })
    }
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde passes a reference"
)]
fn is_former(version: &u32) -> bool {
    *version == 0
}

/// SHA-256 of the compact JSON of a value, in hexadecimal digits.
fn sha256_of_json(value: &impl Serialize) -> String {
    let text = serde_json::to_string(value).expect("plain data always serializes");
    sha256(text)
}

/// Descriptions of cells without paths, which depend on the working directory, and without what
/// follows from the files of results of others, which need not exist yet.
fn without_paths(study: &Study, cells: &[CellDescription]) -> Vec<CellDescription> {
    let without_path = |cell: &CellDescription| {
        let cell = cell.without_path_and_derived();
        let Some(named_cell) = study.external_cell(&cell.name) else {
            return cell;
        };
        let max_episodes = named_cell
            .max_episodes
            .as_deref()
            .or(study.max_episodes.as_deref());
        CellDescription {
            agents: if named_cell.agents.is_some() {
                cell.agents
            } else {
                0
            },
            max_episodes: if max_episodes.is_some() {
                cell.max_episodes
            } else {
                0
            },
            observations: Vec::new(),
            external: None,
            ..cell
        }
    };
    cells.iter().map(without_path).collect()
}

pub(in crate::study) fn list(numbers: &[u64]) -> String {
    numbers
        .iter()
        .map(u64::to_string)
        .collect::<Vec<_>>()
        .join(", ")
}

impl Lock {
    /// Path of the lock of a study file, such as `fig_6_1.ron.lock`.
    #[must_use]
    pub fn path(study: &Path) -> PathBuf {
        study.with_added_extension("lock")
    }

    /// The lock of what is registered.
    pub(super) fn new(registered: Registered) -> Self {
        Self {
            id: sha256_of_json(&registered),
            registered,
        }
    }

    /// Reads a lock file.
    ///
    /// # Errors
    /// If there is none, if it cannot be read, or if it was changed after it was made.
    pub fn read(path: &Path) -> Result<Self, RegistrationError> {
        let text = match read_text(path, MAX_SMALL_FILE_BYTES) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Err(RegistrationError::NotRegistered(path.to_owned()));
            }
            Err(error) if error.kind() == std::io::ErrorKind::InvalidData => {
                return Err(Self::invalid(path, &error));
            }
            Err(error) => {
                let error = file_error(path, &error);
                return Err(RegistrationError::Unreadable(error));
            }
        };
        let lock: Self =
            serde_json::from_str(&text).map_err(|error| Self::invalid(path, &error))?;
        if lock.is_unchanged() {
            Ok(lock)
        } else {
            Err(RegistrationError::Changed(path.to_owned()))
        }
    }

    fn invalid(path: &Path, reason: &dyn Display) -> RegistrationError {
        RegistrationError::Invalid {
            path: path.to_owned(),
            reason: reason.to_string(),
        }
    }

    /// Whether the contents have the id.
    #[must_use]
    pub fn is_unchanged(&self) -> bool {
        sha256_of_json(&self.registered) == self.id
    }

    /// Run seed of the run with this index in its cell: the first six bytes of the SHA-256 of
    /// `ID:INDEX`, as a big-endian number.
    #[must_use]
    pub fn run_seed(&self, index: u64) -> u64 {
        let hash = Sha256::digest(format!("{}:{index}", self.id));
        hash[..6]
            .iter()
            .fold(0, |seed, &byte| seed << 8 | u64::from(byte))
    }

    /// First digits of the id.
    #[must_use]
    pub fn short_id(&self) -> &str {
        short_id(&self.id)
    }

    /// Claims of earlier locks that this lock does not have, each once.
    #[must_use]
    pub fn withdrawn_claims(&self) -> Vec<&str> {
        let mut known = claims_of_today(&self.registered.claims);
        let mut withdrawn: Vec<&str> = Vec::new();
        for ancestor in &self.registered.ancestors {
            for (written, claim) in ancestor
                .claims
                .iter()
                .zip(claims_of_today(&ancestor.claims))
            {
                if !known.contains(&claim) {
                    withdrawn.push(written);
                    known.push(claim);
                }
            }
        }
        withdrawn
    }

    /// The ancestors of a lock that follows this one.
    pub(super) fn with_ancestors(&self) -> Vec<Ancestor> {
        let mut ancestors = self.registered.ancestors.clone();
        ancestors.push(Ancestor {
            id: self.id.clone(),
            claims: self.registered.claims.clone(),
            looks: self.registered.looks.clone(),
        });
        ancestors
    }

    /// Whether this is a lock of the study with this name, or of one that has a cell with the same settings.
    pub(super) fn is_related(&self, study: &Registered) -> bool {
        let has_digest = |digest: &String| study.cells.iter().any(|(_, other)| other == digest);
        let mut digests = self.registered.cells.iter().map(|(_, digest)| digest);
        self.registered.study == study.study || digests.any(has_digest)
    }
}

/// First digits of an id.
fn short_id(id: &str) -> &str {
    id.get(..SHOWN_DIGITS).unwrap_or(id)
}

fn file_error(path: &Path, error: &dyn Display) -> FileError {
    FileError {
        path: path.to_owned(),
        reason: error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn registered(claims: &[&str], looks: &[u64]) -> Registered {
        Registered {
            study: "x".to_owned(),
            level: FAMILY_LEVEL,
            looks: looks.to_vec(),
            claims: claims.iter().map(|&claim| claim.to_owned()).collect(),
            cells: vec![
                ("a".to_owned(), "0".to_owned()),
                ("b".to_owned(), "1".to_owned()),
            ],
            settings_version: SCHEMA_VERSION,
            study_hash: String::new(),
            descriptions_hash: String::new(),
            version: "1".to_owned(),
            commit: None,
            build: "2".to_owned(),
            seen_before: Vec::new(),
            run_log: None,
            results_of_others: Vec::new(),
            seen_files: Vec::new(),
            ancestors: Vec::new(),
            related: Vec::new(),
        }
    }

    fn lock(registered: Registered) -> Lock {
        Lock {
            id: sha256_of_json(&registered),
            registered,
        }
    }

    /// `printf 'abc:0' | sha256sum` begins with 5f36efce86f6; the seeds of other indices and ids differ.
    #[test]
    fn run_seeds_are_hashes_of_the_id_and_the_index() {
        let mut lock = lock(registered(&["p"], &[10]));
        lock.id = "abc".to_owned();
        assert_eq!(lock.run_seed(0), EXPECTED_SEED);
        assert_ne!(lock.run_seed(0), lock.run_seed(1));
        lock.id = "xyz".to_owned();
        assert_ne!(lock.run_seed(0), EXPECTED_SEED);
    }

    const EXPECTED_SEED: u64 = 0x5f36_efce_86f6;

    #[test]
    fn any_change_of_the_contents_is_found() {
        let mut lock = lock(registered(&["p"], &[10]));
        assert!(lock.is_unchanged());
        lock.registered.looks = vec![20];
        assert!(!lock.is_unchanged());
    }

    #[test]
    fn differences_name_claims_cells_and_looks() {
        let (locked, mut changed) = (
            registered(&["p", "q"], &[10]),
            registered(&["q", "r"], &[10, 20]),
        );
        changed.cells = vec![
            ("a".to_owned(), "9".to_owned()),
            ("c".to_owned(), "1".to_owned()),
        ];
        assert_eq!(locked.differences(&locked.clone()), [""; 0]);
        assert_eq!(
            locked.differences(&changed),
            [
                "the claim `p` is not in the study",
                "the claim `r` is not in the lock",
                "numbers of runs per cell are 10 in the lock and 10, 20 in the study",
                "the scenario, the task or the settings of cell `a` were changed",
                "the cell `b` is not in the study",
                "the cell `c` is not in the lock",
            ]
        );
    }

    #[test]
    fn a_later_lock_names_earlier_ones_and_withdrawn_claims() {
        let first = lock(registered(&["p", "q"], &[10]));
        let mut second = registered(&["q"], &[10]);
        second.ancestors = first.with_ancestors();
        let second = lock(second);
        assert_eq!(second.withdrawn_claims(), ["p"]);
        assert_eq!(second.with_ancestors().len(), 2);
        assert_eq!(second.with_ancestors()[0].id, first.id);
    }
}
