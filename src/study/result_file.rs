//! Result files: one stored run of a study each.
//!
//! A file is plain data in `postcard`'s encoding. Files of an older layout are still read; see
//! [`OLDER_LAYOUT`].

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use super::measure::Curve;
use super::provenance::{self, BuildId};
use super::run_result::RunResult;

/// Layout of the files that are written.
const LAYOUT: u32 = 3;

/// Layout without the commit and the names of curves, and with 0 (1 for ratios) in rounds in which
/// nothing was measured.
const OLDER_LAYOUT: u32 = 2;

/// Curves in files of [`OLDER_LAYOUT`], in their order, each with the value that stands for no
/// measurement.
const OLDER_CURVES: [(Curve, f32); 14] = [
    (Curve::ValueLoss, 0.0),
    (Curve::PolicyLoss, 0.0),
    (Curve::RatioDeviation, 1.0),
    (Curve::LargestRatio, 1.0),
    (Curve::ClippedFraction, 0.0),
    (Curve::Entropy, 0.0),
    (Curve::IntrinsicReward, 0.0),
    (Curve::PredictionError, 0.0),
    (Curve::BonusAgreement, 0.0),
    (Curve::Coverage, 0.0),
    (Curve::VisitationEvenness, 0.0),
    (Curve::TeamCoverage, 0.0),
    (Curve::TeamOverlap, 0.0),
    (Curve::EffectiveAgents, 0.0),
];

/// A stored run.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredRun {
    /// Version of seedbed that ran it.
    pub version: String,
    /// Commit that this version was built from, if known.
    pub commit: Option<String>,
    /// Build that ran it, if known.
    pub build: Option<BuildId>,
    /// Hash of all that the run depended on, besides its seed.
    pub digest: String,
    /// Seed of the run.
    pub seed: u64,
    /// Result, or why the run failed.
    pub outcome: Result<RunResult, String>,
    /// Whether it was read from a file of [`OLDER_LAYOUT`].
    is_older: bool,
}

/// Contents of a file, except for the build, whose bytes follow.
#[derive(Serialize, Deserialize)]
struct ResultFile {
    layout: u32,
    version: String,
    commit: Option<String>,
    digest: String,
    seed: u64,
    /// Keys of the curves in the order of the result's: other versions may have other metrics.
    curves: Vec<String>,
    outcome: Result<RunResult, String>,
}

/// Contents of a file of [`OLDER_LAYOUT`].
#[derive(Deserialize)]
struct OlderResultFile {
    _layout: u32,
    version: String,
    digest: String,
    seed: u64,
    outcome: Result<RunResult, String>,
}

impl StoredRun {
    /// An outcome of this build.
    #[must_use]
    pub fn new(digest: String, seed: u64, outcome: Result<RunResult, String>) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: provenance::commit().map(str::to_owned),
            build: provenance::build_id(),
            digest,
            seed,
            outcome,
            is_older: false,
        }
    }

    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let keys = Curve::OF_ROUNDS.iter().map(|curve| curve.metric().key);
        let file = ResultFile {
            layout: LAYOUT,
            version: self.version.clone(),
            commit: self.commit.clone(),
            digest: self.digest.clone(),
            seed: self.seed,
            curves: keys.map(str::to_owned).collect(),
            outcome: self.outcome.clone(),
        };
        let mut bytes = postcard::to_stdvec(&file).expect("plain data always serializes");
        bytes.extend(self.build.into_iter().flatten());
        bytes
    }

    /// Reads the bytes of a file. `None` if they are incomplete or of an unknown layout.
    pub(super) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (layout, _) = postcard::take_from_bytes::<u32>(bytes).ok()?;
        let (mut file, rest) = match layout {
            LAYOUT => postcard::take_from_bytes::<ResultFile>(bytes).ok()?,
            OLDER_LAYOUT => {
                let (file, rest) = postcard::take_from_bytes::<OlderResultFile>(bytes).ok()?;
                (ResultFile::from(file), rest)
            }
            _ => return None,
        };
        if let Ok(run) = &mut file.outcome {
            run.curves = in_order_of_curves(&file.curves, std::mem::take(&mut run.curves));
        }
        Some(Self {
            version: file.version,
            commit: file.commit,
            build: postcard::from_bytes(rest).ok(),
            digest: file.digest,
            seed: file.seed,
            outcome: file.outcome,
            is_older: layout == OLDER_LAYOUT,
        })
    }

    /// Whether a repetition of the run has the same result, bit by bit.
    #[must_use]
    pub fn is_reproduced_by(&self, outcome: &Result<RunResult, String>) -> bool {
        let bytes = |outcome: &Result<RunResult, String>| {
            let outcome = if self.is_older {
                outcome.clone().map(in_older_form)
            } else {
                outcome.clone()
            };
            // Bytes instead of numbers, so that what is not a number equals itself.
            postcard::to_stdvec(&outcome).expect("plain data always serializes")
        };
        bytes(&self.outcome) == bytes(outcome)
    }
}

/// Curves with these keys, in the order of [`Curve::OF_ROUNDS`]; empty if a key is missing.
fn in_order_of_curves(keys: &[String], curves: Vec<Vec<f32>>) -> Vec<Vec<f32>> {
    let keys = keys.iter().map(String::as_str);
    let mut curves: HashMap<&str, Vec<f32>> = keys.zip(curves).collect();
    let mut ordered = Vec::with_capacity(Curve::OF_ROUNDS.len());
    for curve in Curve::OF_ROUNDS {
        ordered.push(curves.remove(curve.metric().key).unwrap_or_default());
    }
    ordered
}

impl From<OlderResultFile> for ResultFile {
    fn from(older: OlderResultFile) -> Self {
        let keys = OLDER_CURVES.iter().map(|(curve, _)| curve.metric().key);
        Self {
            layout: LAYOUT,
            version: older.version,
            commit: None,
            digest: older.digest,
            seed: older.seed,
            curves: keys.map(str::to_owned).collect(),
            outcome: older.outcome.map(without_placeholders),
        }
    }
}

/// Drops curves of the older layout that were not measured.
///
/// A loss, a bonus or an error is hardly ever 0 in every round of a run, so such a curve was not
/// measured. A policy without a loss has neither ratios nor clipping, but a learning one may well
/// have a clipped fraction of 0.
fn without_placeholders(mut run: RunResult) -> RunResult {
    let is_missing = |curve: Curve| {
        let index = OLDER_CURVES.iter().position(|(other, _)| *other == curve);
        let values = index.and_then(|index| run.curves.get(index));
        values.is_none_or(|values| values.iter().all(|value| *value == 0.0))
    };
    let mut missing = vec![
        Curve::ValueLoss,
        Curve::PolicyLoss,
        Curve::IntrinsicReward,
        Curve::PredictionError,
        Curve::BonusAgreement,
    ];
    missing.retain(|curve| is_missing(*curve));
    if missing.contains(&Curve::PolicyLoss) {
        missing.extend([
            Curve::RatioDeviation,
            Curve::LargestRatio,
            Curve::ClippedFraction,
        ]);
    }
    for ((curve, _), values) in OLDER_CURVES.iter().zip(&mut run.curves) {
        if missing.contains(curve) {
            values.clear();
        }
    }
    run
}

/// The result as the older layout would have it: with its curves alone, and with a number in every
/// round.
fn in_older_form(mut run: RunResult) -> RunResult {
    for (curve, values) in Curve::OF_ROUNDS.iter().zip(&mut run.curves) {
        let older = OLDER_CURVES.iter().find(|(other, _)| other == curve);
        let Some((_, placeholder)) = older else {
            values.clear();
            continue;
        };
        values.resize(run.episodes.len(), f32::NAN);
        for value in values {
            if value.is_nan() {
                *value = *placeholder;
            }
        }
    }
    run
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROUNDS: usize = 3;

    /// A run in which each curve has the value of its position, from 1.
    fn run(curves: usize) -> RunResult {
        let curve = |curve: usize| vec![curve as f32 + 1.0; ROUNDS];
        RunResult {
            episodes: vec![1, 2, 3],
            curves: (0..curves).map(curve).collect(),
            ..RunResult::default()
        }
    }

    fn older(run: &RunResult) -> StoredRun {
        let outcome: Result<&RunResult, String> = Ok(run);
        let file = (OLDER_LAYOUT, "0.1.0", "digest", 7_u64, outcome);
        let mut bytes = postcard::to_stdvec(&file).unwrap();
        bytes.extend([3; 8]);
        StoredRun::from_bytes(&bytes).unwrap()
    }

    /// As value-based learners without curiosity left it.
    fn older_run_with_placeholders() -> RunResult {
        let mut run = run(OLDER_CURVES.len());
        for index in [1, 2, 3, 4, 6, 7, 8] {
            run.curves[index] = vec![OLDER_CURVES[index].1; ROUNDS];
        }
        run
    }

    fn measured(run: &RunResult) -> Vec<Curve> {
        let mut measured = Curve::OF_ROUNDS.to_vec();
        measured.retain(|curve| !run.curve(*curve).is_empty());
        measured
    }

    #[test]
    fn a_stored_run_is_read_as_it_was_written() {
        let outcome = Ok(run(Curve::OF_ROUNDS.len()));
        let written = StoredRun::new("digest".to_owned(), 7, outcome.clone());
        let read = StoredRun::from_bytes(&written.to_bytes()).unwrap();
        assert_eq!(read, written);
        assert!(read.is_reproduced_by(&outcome));
        assert!(!read.is_reproduced_by(&Ok(run(3))));
        let mut unknown = written.to_bytes();
        unknown[0] = 99;
        assert_eq!(StoredRun::from_bytes(&unknown), None);
    }

    #[test]
    fn curves_of_the_older_layout_keep_their_names() {
        let read = older(&run(OLDER_CURVES.len()));
        let run = read.outcome.unwrap();
        for (position, (curve, _)) in OLDER_CURVES.iter().enumerate() {
            assert_eq!(run.curve(*curve), [position as f64 + 1.0; ROUNDS]);
        }
        assert!(run.curve(Curve::VisitationEntropy).is_empty());
        assert_eq!(read.build, Some([3; 8]));
    }

    #[test]
    fn placeholders_of_the_older_layout_are_not_measured() {
        let run = older(&older_run_with_placeholders()).outcome.unwrap();
        let measured = measured(&run);
        assert_eq!(measured[..2], [Curve::ValueLoss, Curve::Entropy]);
        assert_eq!(measured.len(), 2 + 5);
    }

    /// Clipping that never happens has a fraction of 0.
    #[test]
    fn a_fraction_of_zero_is_measured_where_a_policy_learns() {
        let mut before = run(OLDER_CURVES.len());
        before.curves[4] = vec![0.0; ROUNDS];
        let run = older(&before).outcome.unwrap();
        assert_eq!(run.curve(Curve::ClippedFraction), [0.0; ROUNDS]);
    }

    /// A repetition has a curve more, and no numbers where nothing was measured.
    #[test]
    fn a_run_of_the_older_layout_can_be_reproduced() {
        let stored = older(&older_run_with_placeholders());
        let mut repetition = stored.outcome.clone().unwrap();
        for (curve, values) in Curve::OF_ROUNDS.iter().zip(&mut repetition.curves) {
            if *curve == Curve::VisitationEntropy {
                *values = vec![0.5; ROUNDS];
            } else if values.is_empty() {
                *values = vec![f32::NAN; ROUNDS];
            }
        }
        assert!(stored.is_reproduced_by(&Ok(repetition.clone())));
        repetition.curves[0][1] += 1.0;
        assert!(!stored.is_reproduced_by(&Ok(repetition)));
    }
}
