//! Result files. Each file has one stored run of a study.
//!
//! A file is plain data in `postcard`'s encoding, followed by a checksum. A file whose checksum is
//! wrong is never read.

use std::collections::HashMap;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh64::xxh64;

use crate::experiment::measure::Curve;
use crate::experiment::run_result::RunResult;
use crate::provenance::{self, BuildId};
use crate::scenario::Rounding;

/// Number of the layout of files with runs of seedbed, whose contents are followed by the
/// [ends of episodes](RunResult::episode_ends). Files of layouts that are not listed here are not read.
const LAYOUT: u32 = 7;

/// Number of the layout of files with results of others: the contents have no returns, which follow
/// as [`ReturnsOfOthers`] before the ends of episodes.
const LAYOUT_OF_OTHERS: u32 = 8;

/// Numbers of the same layouts in earlier versions, without ends of episodes.
const FORMER_LAYOUT: u32 = 5;
const FORMER_LAYOUT_OF_OTHERS: u32 = 6;

/// Number of bytes of the checksum at the end of a file.
const CHECKSUM_BYTES: usize = 8;

/// A stored run.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredRun {
    /// Version of seedbed that made the run.
    pub version: String,
    /// Commit from which that version was built, if known.
    pub commit: Option<String>,
    /// Build that made the run, if known.
    pub build: Option<BuildId>,
    /// Hash of everything on which the run depended, except its run seed.
    pub digest: String,
    /// Run seed.
    pub run_seed: u64,
    /// Result, or the reason why the run failed.
    pub outcome: Result<RunResult, String>,
}

/// Returns in double precision, and how they were rounded.
#[derive(Serialize, Deserialize)]
struct ReturnsOfOthers {
    returns: Vec<Vec<f64>>,
    rounding: Rounding,
}

/// Contents of a file. In the file, they are followed by the XXH64 of all bytes.
#[derive(Serialize, Deserialize)]
struct ResultFile {
    layout: u32,
    version: String,
    commit: Option<String>,
    build: Option<BuildId>,
    digest: String,
    seed: u64,
    /// Keys of the curves, in the order of the curves of the result. Other versions may have other
    /// metrics.
    curves: Vec<String>,
    outcome: Result<RunResult, String>,
}

impl StoredRun {
    /// A run that was made by this build.
    #[must_use]
    pub fn new(digest: String, run_seed: u64, outcome: Result<RunResult, String>) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: provenance::commit().map(str::to_owned),
            build: provenance::build_id(),
            digest,
            run_seed,
            outcome,
        }
    }

    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let keys = Curve::WITH_ROUND_VALUES
            .iter()
            .map(|curve| curve.metric().key);
        let (outcome, returns_of_others) = split(self.outcome.clone());
        let file = ResultFile {
            layout: if returns_of_others.is_some() {
                LAYOUT_OF_OTHERS
            } else {
                LAYOUT
            },
            version: self.version.clone(),
            commit: self.commit.clone(),
            build: self.build,
            digest: self.digest.clone(),
            seed: self.run_seed,
            curves: keys.map(str::to_owned).collect(),
            outcome,
        };
        let mut bytes = encode(&file);
        bytes.extend(returns_of_others.iter().flat_map(encode));
        bytes.extend(
            self.outcome
                .iter()
                .flat_map(|run| encode(&run.episode_ends)),
        );
        let checksum = xxh64(&bytes, 0);
        bytes.extend(checksum.to_le_bytes());
        bytes
    }

    /// Decodes the bytes of a file. `None` if they are damaged or have another layout.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (contents, checksum) = bytes.split_last_chunk::<CHECKSUM_BYTES>()?;
        if xxh64(contents, 0) != u64::from_le_bytes(*checksum) {
            return None;
        }
        let (file, mut rest): (ResultFile, &[u8]) = postcard::take_from_bytes(contents).ok()?;
        let mut outcome = file.outcome;
        if let Ok(run) = &mut outcome {
            if matches!(file.layout, LAYOUT_OF_OTHERS | FORMER_LAYOUT_OF_OTHERS) {
                let others: ReturnsOfOthers = take(&mut rest)?;
                (run.returns, run.rounding) = (others.returns, others.rounding);
            }
            if matches!(file.layout, LAYOUT | LAYOUT_OF_OTHERS) {
                run.episode_ends = take(&mut rest)?;
            }
        }
        let is_known = matches!(
            file.layout,
            LAYOUT | LAYOUT_OF_OTHERS | FORMER_LAYOUT | FORMER_LAYOUT_OF_OTHERS
        );
        if !is_known || !rest.is_empty() {
            return None;
        }
        if let Ok(run) = &mut outcome {
            run.curves = values_in_curve_order(&file.curves, std::mem::take(&mut run.curves));
        }
        Some(Self {
            version: file.version,
            commit: file.commit,
            build: file.build,
            digest: file.digest,
            run_seed: file.seed,
            outcome,
        })
    }

    /// Whether a repetition of the run has bit-identical results.
    #[must_use]
    pub fn is_reproduced_by(&self, outcome: &Result<RunResult, String>) -> bool {
        // Compare bytes instead of numbers, because NaN does not equal itself.
        let bytes = |outcome: &Result<RunResult, String>| encode(&split(outcome.clone()));
        bytes(&self.outcome) == bytes(outcome) && same_ends(&self.outcome, outcome)
    }

    /// Whether another result of the same run is bit-identical. Visited states are compared for those
    /// numbers of first episodes for which both have them.
    #[must_use]
    pub fn agrees_with(&self, other: &Self) -> bool {
        let common = |stored: &Self, other: &Self| Self {
            outcome: stored.outcome.clone().map(|mut run| {
                run.states
                    .retain(|states| other.has_windows(&[states.episodes]));
                run
            }),
            ..stored.clone()
        };
        common(self, other).is_reproduced_by(&common(other, self).outcome)
    }

    /// Whether the result has the visited states for each of these numbers of first episodes. A run
    /// that failed needs none.
    #[must_use]
    pub fn has_windows(&self, windows: &[u32]) -> bool {
        let Ok(run) = &self.outcome else {
            return true;
        };
        let has = |window: &u32| run.states.iter().any(|states| states.episodes == *window);
        windows.iter().all(has)
    }
}

/// Takes the returns of others out of an outcome.
fn split(
    mut outcome: Result<RunResult, String>,
) -> (Result<RunResult, String>, Option<ReturnsOfOthers>) {
    let returns = outcome.as_mut().ok().and_then(|run| {
        (run.rounding != Rounding::SingleRewards).then(|| ReturnsOfOthers {
            returns: std::mem::take(&mut run.returns),
            rounding: run.rounding,
        })
    });
    (outcome, returns)
}

/// Whether episodes ended at the same steps, as far as both results know it.
fn same_ends(one: &Result<RunResult, String>, other: &Result<RunResult, String>) -> bool {
    let (Ok(one), Ok(other)) = (one, other) else {
        return true;
    };
    let (one, other) = (&one.episode_ends, &other.episode_ends);
    one.is_empty() || other.is_empty() || one == other
}

/// Decodes a value at the beginning of `bytes`, and goes on behind it.
fn take<T: DeserializeOwned>(bytes: &mut &[u8]) -> Option<T> {
    let (value, rest) = postcard::take_from_bytes(bytes).ok()?;
    *bytes = rest;
    Some(value)
}

fn encode(data: &impl Serialize) -> Vec<u8> {
    postcard::to_stdvec(data).expect("plain data always serializes")
}

/// Sorts curves with the given keys into the order of [`Curve::WITH_ROUND_VALUES`]. Curves whose
/// key is missing are empty.
fn values_in_curve_order(keys: &[String], curves: Vec<Vec<f32>>) -> Vec<Vec<f32>> {
    let keys = keys.iter().map(String::as_str);
    let mut curves: HashMap<&str, Vec<f32>> = keys.zip(curves).collect();
    let mut ordered_values = Vec::with_capacity(Curve::WITH_ROUND_VALUES.len());
    for curve in Curve::WITH_ROUND_VALUES {
        ordered_values.push(curves.remove(curve.metric().key).unwrap_or_default());
    }
    ordered_values
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROUNDS: usize = 3;

    /// A run whose curves have constant values 1, 2, 3, …
    fn run(curves: usize) -> RunResult {
        let curve = |curve: usize| vec![curve as f32 + 1.0; ROUNDS];
        RunResult {
            episodes: vec![1, 2, 3],
            curves: (0..curves).map(curve).collect(),
            ..RunResult::default()
        }
    }

    #[test]
    fn a_stored_run_equals_the_written_run() {
        let outcome = Ok(run(Curve::WITH_ROUND_VALUES.len()));
        let written = StoredRun::new("digest".to_owned(), 7, outcome.clone());
        let read = StoredRun::from_bytes(&written.to_bytes()).unwrap();
        assert_eq!(read, written);
        assert!(read.is_reproduced_by(&outcome));
        assert!(!read.is_reproduced_by(&Ok(run(3))));
    }

    /// A change of any bit of a file is found.
    #[test]
    fn a_changed_file_is_not_read() {
        let bytes = StoredRun::new("digest".to_owned(), 7, Ok(run(2))).to_bytes();
        for byte in 0..bytes.len() {
            for bit in 0..8 {
                let mut changed = bytes.clone();
                changed[byte] ^= 1 << bit;
                assert_eq!(
                    StoredRun::from_bytes(&changed),
                    None,
                    "byte {byte}, bit {bit}"
                );
            }
        }
        assert_eq!(StoredRun::from_bytes(&bytes[..bytes.len() - 1]), None);
        assert_eq!(StoredRun::from_bytes(&[]), None);
    }

    /// 0.1 and 1e39 are not numbers of single precision.
    #[test]
    fn returns_of_others_are_stored_in_double_precision() {
        let outcome = |value: f64| {
            Ok(RunResult {
                returns: vec![vec![0.1, value]],
                rounding: Rounding::Double,
                ..run(Curve::WITH_ROUND_VALUES.len())
            })
        };
        let written = StoredRun::new("digest".to_owned(), 7, outcome(1e39));
        let read = StoredRun::from_bytes(&written.to_bytes()).unwrap();
        assert_eq!(read, written);
        assert!(read.is_reproduced_by(&outcome(1e39)));
        assert!(!read.is_reproduced_by(&outcome(1e39_f64.next_up())));
    }

    #[test]
    fn files_of_another_layout_are_not_read() {
        let mut bytes = StoredRun::new("digest".to_owned(), 7, Ok(run(2))).to_bytes();
        bytes.truncate(bytes.len() - CHECKSUM_BYTES);
        bytes[0] = LAYOUT as u8 - 1;
        bytes.extend(xxh64(&bytes, 0).to_le_bytes());
        assert_eq!(StoredRun::from_bytes(&bytes), None);
    }
}
