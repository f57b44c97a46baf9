//! Locks of earlier versions, in which digests were hashes of printed settings, and claims had printed measures.
//!
//! A lock cannot be changed, because run seeds are derived from it. What the digests of its cells are called today is
//! written in a file beside it, which also explains published results. Hashes of the study files are known for all locks
//! of these versions.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use super::cell::CellDescription;
use crate::experiment::measure::Measure;
use crate::study::FileError;
use seedbed_input::limits::{MAX_SMALL_FILE_BYTES, read_text};

/// What the digests of a study's cells are in its lock: the contents of `STUDY.digests`.
#[derive(Debug, Default)]
pub(in crate::study) struct FormerDigests {
    by_digest: BTreeMap<String, String>,
}

impl FormerDigests {
    /// Reads the file of a study; there is none if its lock has the digests of today.
    ///
    /// # Errors
    /// The file cannot be read, or is none of this kind.
    pub(in crate::study) fn beside(study: &Path) -> Result<Self, FileError> {
        let path = Self::path(study);
        let failed = |reason: String| FileError {
            path: path.clone(),
            reason,
        };
        let text = match read_text(&path, MAX_SMALL_FILE_BYTES) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Self::default()),
            Err(error) => return Err(failed(error.to_string())),
        };
        let by_digest = serde_json::from_str(&text).map_err(|error| {
            failed(format!(
                "expected an object of digests and former digests: {error}"
            ))
        })?;
        Ok(Self { by_digest })
    }

    /// Whether `written`, in results or in a lock, is the digest of today or the former one.
    pub(in crate::study) fn are_same(&self, digest: &str, written: &str) -> bool {
        let former = self.by_digest.get(digest);
        written == digest || former.is_some_and(|former| written == former)
    }

    /// Path of the file of a study, such as `fig_6_1.ron.digests`.
    pub(in crate::study) fn path(study: &Path) -> PathBuf {
        study.with_added_extension("digests")
    }

    /// Cells with the digests that they had when the study was locked.
    pub(super) fn of_cells(&self, cells: Vec<CellDescription>) -> Vec<CellDescription> {
        let with_former = |cell: CellDescription| match self.by_digest.get(&cell.digest) {
            Some(former) => CellDescription {
                digest: former.clone(),
                ..cell
            },
            None => cell,
        };
        cells.into_iter().map(with_former).collect()
    }
}

/// Today's hash of each study file that an earlier version locked, the hash in its lock, and its name.
const FORMER_STUDIES: &str = include_str!("former_studies.txt");

/// Whether `written`, in a lock, is the hash of the study file with today's hash `hash`.
pub(super) fn is_hash_of_study(written: &str, hash: &str) -> bool {
    let are_together = |line: &str| line.starts_with(&format!("{hash} {written} "));
    written == hash || FORMER_STUDIES.lines().any(are_together)
}

/// Claims as they are written today. In earlier versions, the measure in the third part of the text was printed as
/// `At { of: Return, episode: Count(9) }`.
pub(in crate::study) fn claims_of_today(claims: &[String]) -> Vec<String> {
    let of_today = |claim: &String| {
        let parts: Vec<&str> = claim.splitn(4, " | ").collect();
        let [first, second, measure, rest] = parts[..] else {
            return claim.clone();
        };
        match former_measure(measure) {
            Some(measure) => format!("{first} | {second} | {} | {rest}", measure.canonical_text()),
            None => claim.clone(),
        }
    };
    claims.iter().map(of_today).collect()
}

/// The measure that an earlier version printed; `None` if the text is of today.
fn former_measure(text: &str) -> Option<Measure> {
    const NUMBER: &str = "Count(";
    let mut text = text.replace(" { ", "(").replace(" }", ")");
    while let Some(start) = text.find(NUMBER) {
        let length = text[start..].find(')')?;
        text.remove(start + length);
        text.replace_range(start..start + NUMBER.len(), "");
    }
    let document = seedbed_input::parse("", text).ok()?;
    Some(document.value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::design::lock::Lock;
    use crate::study::design::plan::StudyPlan;

    fn locked_studies() -> Vec<PathBuf> {
        let folders = ["thesis", "benchmark", "coordination"];
        let mut studies: Vec<PathBuf> = Vec::new();
        for folder in folders {
            let entries = std::fs::read_dir(Path::new("scenarios").join(folder)).unwrap();
            let paths = entries.map(|entry| entry.unwrap().path());
            studies.extend(paths.filter(|path| Lock::path(path).exists()));
        }
        studies
    }

    /// When the files were written, the digests of these cells were also computed as earlier versions did: each was
    /// that of the lock.
    #[test]
    fn locked_studies_have_cells_with_the_digests_of_their_locks() {
        let studies = locked_studies();
        assert_eq!(studies.len(), 41);
        for path in studies {
            let plan = StudyPlan::load_before_results(&path, false).unwrap();
            let registered = plan.registered();
            assert!(registered.is_ok(), "{}: {registered:?}", path.display());
        }
    }

    #[test]
    fn former_measures_in_claims_are_written_as_today() {
        for (former, today) in [
            (
                "a | b | At { of: TeamCoverage, episode: Count(230) } | More | 1 | x | y",
                "a | b | At(episode = 230, of = TeamCoverage) | More | 1 | x | y",
            ),
            (
                "a | b | FinalReturn { window: Count(25) } | More",
                "a | b | FinalReturn | More",
            ),
            (
                "a | b | Solved | Less | { Count(3) }",
                "a | b | Solved | Less | { Count(3) }",
            ),
            ("a | b | Count(3 | Less", "a | b | Count(3 | Less"),
            ("p", "p"),
        ] {
            assert_eq!(claims_of_today(&[former.to_owned()]), [today]);
            assert_eq!(claims_of_today(&[today.to_owned()]), [today]);
        }
    }

    #[test]
    fn a_changed_study_file_is_not_that_of_its_lock() {
        let path = Path::new("scenarios/coordination/planners.ron");
        let mut plan = StudyPlan::load_before_results(path, false).unwrap();
        let changed = plan.document.text.replacen("title: \"", "title: \"New ", 1);
        plan.document = seedbed_input::parse("planners.ron", changed).unwrap();
        let error = plan.registered().unwrap_err().to_string();
        assert!(
            error.contains("a text, a figure, a measure or another value was changed"),
            "{error}"
        );
    }

    #[test]
    fn a_changed_cell_is_not_in_its_lock() {
        let path = Path::new("scenarios/coordination/planners.ron");
        let mut plan = StudyPlan::load_before_results(path, false).unwrap();
        plan.cells[0].digest = "0".repeat(64).into();
        let error = plan.registered().unwrap_err().to_string();
        assert!(
            error.contains("the settings of cell `own draws` were changed"),
            "{error}"
        );
    }
}
