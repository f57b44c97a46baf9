//! A run that was read from files.

use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::data_file::{FileHash, name_of};
use crate::experiment::measure::Curve;
use crate::experiment::run_result::RunResult;
use seedbed_env::Quantity;

/// A run that others made, in descriptions of studies.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExternalRun {
    /// Path relative to the folder of the study, and for files with several runs the run.
    pub name: String,
    /// The first six bytes of a SHA-256 of the contents, which take the place of a run seed.
    pub id: u64,
    /// Its files.
    pub files: Vec<FileHash>,
}

/// Why the files of most other programs have no curves of rounds.
pub(super) const RETURNS_ONLY: &str = "its files have returns only";

/// A run with its result.
#[derive(Clone, Debug)]
pub(super) struct ReadRun {
    pub(super) run: ExternalRun,
    pub(super) result: RunResult,
    /// Names, units and ranges of the observations; `None` if they are not known before all states are read.
    pub(super) observations: Option<Vec<Quantity>>,
    /// Why curves of rounds are not known; `None` if they are.
    pub(super) without_rounds: Option<&'static str>,
    pub(super) warnings: Vec<String>,
}

impl ReadRun {
    pub(super) fn new(folder: &Path, path: &Path, files: Vec<FileHash>, result: RunResult) -> Self {
        let id = id(&files, "");
        Self {
            run: ExternalRun {
                name: name_of(folder, path),
                id,
                files,
            },
            result,
            observations: None,
            without_rounds: Some(RETURNS_ONLY),
            warnings: Vec::new(),
        }
    }

    pub(super) fn with_warnings(self, warnings: Vec<String>) -> Self {
        Self { warnings, ..self }
    }

    /// Why a curve of rounds is not known; `None` if it is, or if it is that of returns.
    pub(super) fn without_curve(&self, curve: Option<Curve>) -> Option<&'static str> {
        let is_missing = |curve| self.result.curve(curve).is_empty();
        let missing = curve.is_some_and(is_missing).then_some(RETURNS_ONLY);
        self.without_rounds.or(missing)
    }

    /// The run that a file with several runs has under this label in a column.
    pub(super) fn with_label(mut self, column: &str, label: &str) -> Self {
        self.run.name += &format!(", {column} {label}");
        self.run.id = id(&self.run.files, label);
        self
    }
}

/// The first six bytes of the SHA-256 of the hashes of the files and the label, as a big-endian
/// number.
fn id(files: &[FileHash], label: &str) -> u64 {
    let mut hash = Sha256::new();
    for file in files {
        hash.update(&file.sha256);
    }
    hash.update(label);
    hash.finalize()[..6]
        .iter()
        .fold(0, |id, &byte| id << 8 | u64::from(byte))
}
