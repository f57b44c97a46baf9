//! Result files. Each file has one stored run of a study.
//!
//! A file is plain data in `postcard`'s encoding. Files of an older layout are still read; see
//! `OLDER_LAYOUT`.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use super::measure::Curve;
use super::provenance::{self, BuildId};
use super::run_result::RunResult;

/// Number of the layout in which files are written.
const LAYOUT: u32 = 3;

/// Number of the older layout, without commit and names of curves, and with 0 (1 for ratios)
/// instead of unmeasured values.
const OLDER_LAYOUT: u32 = 2;

/// Curves in files of `OLDER_LAYOUT`, in the order of the file, each with its placeholder for
/// unmeasured values.
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
    /// Whether the run was read from a file of `OLDER_LAYOUT`.
    has_older_layout: bool,
}

/// Contents of a file. In the file, they are followed by the bytes of the build id.
#[derive(Serialize, Deserialize)]
struct ResultFile {
    layout: u32,
    version: String,
    commit: Option<String>,
    digest: String,
    seed: u64,
    /// Keys of the curves, in the order of the curves of the result. Other versions may have other
    /// metrics.
    curves: Vec<String>,
    outcome: Result<RunResult, String>,
}

/// Contents of a file of `OLDER_LAYOUT`.
#[derive(Deserialize)]
struct OlderResultFile {
    _layout: u32,
    version: String,
    digest: String,
    seed: u64,
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
            has_older_layout: false,
        }
    }

    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let keys = Curve::WITH_ROUND_VALUES
            .iter()
            .map(|curve| curve.metric().key);
        let file = ResultFile {
            layout: LAYOUT,
            version: self.version.clone(),
            commit: self.commit.clone(),
            digest: self.digest.clone(),
            seed: self.run_seed,
            curves: keys.map(str::to_owned).collect(),
            outcome: self.outcome.clone(),
        };
        let mut bytes = postcard::to_stdvec(&file).expect("plain data always serializes");
        bytes.extend(self.build.into_iter().flatten());
        bytes
    }

    /// Decodes the bytes of a file. `None` if they are incomplete or have an unknown layout.
    pub(super) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (layout, _) = postcard::take_from_bytes::<u32>(bytes).ok()?;
        let (mut file, remaining_bytes) = match layout {
            LAYOUT => postcard::take_from_bytes::<ResultFile>(bytes).ok()?,
            OLDER_LAYOUT => {
                let (file, remaining_bytes) =
                    postcard::take_from_bytes::<OlderResultFile>(bytes).ok()?;
                (ResultFile::from(file), remaining_bytes)
            }
            _ => return None,
        };
        if let Ok(run) = &mut file.outcome {
            run.curves = values_in_curve_order(&file.curves, std::mem::take(&mut run.curves));
        }
        Some(Self {
            version: file.version,
            commit: file.commit,
            build: postcard::from_bytes(remaining_bytes).ok(),
            digest: file.digest,
            run_seed: file.seed,
            outcome: file.outcome,
            has_older_layout: layout == OLDER_LAYOUT,
        })
    }

    /// Whether a repetition of the run has bit-identical results.
    ///
    /// # Panics
    /// Never: plain data always serializes.
    #[must_use]
    pub fn is_reproduced_by(&self, outcome: &Result<RunResult, String>) -> bool {
        let bytes = |outcome: &Result<RunResult, String>| {
            let outcome = if self.has_older_layout {
                outcome.clone().map(in_older_layout)
            } else {
                outcome.clone()
            };
            // Compare bytes instead of numbers, because NaN does not equal itself.
            postcard::to_stdvec(&outcome).expect("plain data always serializes")
        };
        bytes(&self.outcome) == bytes(outcome)
    }
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

impl From<OlderResultFile> for ResultFile {
    fn from(older_file: OlderResultFile) -> Self {
        let keys = OLDER_CURVES.iter().map(|(curve, _)| curve.metric().key);
        Self {
            layout: LAYOUT,
            version: older_file.version,
            commit: None,
            digest: older_file.digest,
            seed: older_file.seed,
            curves: keys.map(str::to_owned).collect(),
            outcome: older_file.outcome.map(without_placeholders),
        }
    }
}

/// Removes curves of the older layout that were not measured.
///
/// Losses, bonuses and errors that are 0 in every round of a run count as not measured. If the
/// policy loss was not measured, neither were ratios and clipping. Otherwise a clipped fraction of
/// 0 is a measured value.
fn without_placeholders(mut run: RunResult) -> RunResult {
    let is_unmeasured = |curve: Curve| {
        let index = OLDER_CURVES.iter().position(|(other, _)| *other == curve);
        let values = index.and_then(|index| run.curves.get(index));
        values.is_none_or(|values| values.iter().all(|value| *value == 0.0))
    };
    let mut unmeasured = vec![
        Curve::ValueLoss,
        Curve::PolicyLoss,
        Curve::IntrinsicReward,
        Curve::PredictionError,
        Curve::BonusAgreement,
    ];
    unmeasured.retain(|curve| is_unmeasured(*curve));
    if unmeasured.contains(&Curve::PolicyLoss) {
        unmeasured.extend([
            Curve::RatioDeviation,
            Curve::LargestRatio,
            Curve::ClippedFraction,
        ]);
    }
    for ((curve, _), values) in OLDER_CURVES.iter().zip(&mut run.curves) {
        if unmeasured.contains(curve) {
            values.clear();
        }
    }
    run
}

/// Converts a result to the older layout, which has fewer curves, and placeholders for unmeasured
/// values.
fn in_older_layout(mut run: RunResult) -> RunResult {
    for (curve, values) in Curve::WITH_ROUND_VALUES.iter().zip(&mut run.curves) {
        let older_curve = OLDER_CURVES.iter().find(|(other, _)| other == curve);
        let Some((_, placeholder)) = older_curve else {
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

    /// A run whose curves have constant values 1, 2, 3, …
    fn run(curves: usize) -> RunResult {
        let curve = |curve: usize| vec![curve as f32 + 1.0; ROUNDS];
        RunResult {
            episodes: vec![1, 2, 3],
            curves: (0..curves).map(curve).collect(),
            ..RunResult::default()
        }
    }

    fn stored_run_of_older_layout(run: &RunResult) -> StoredRun {
        let outcome: Result<&RunResult, String> = Ok(run);
        let file = (OLDER_LAYOUT, "0.1.0", "digest", 7_u64, outcome);
        let mut bytes = postcard::to_stdvec(&file).unwrap();
        bytes.extend([3; 8]);
        StoredRun::from_bytes(&bytes).unwrap()
    }

    /// A run of value-based learners without bonus, as versions with the older layout stored it.
    fn older_run_with_placeholders() -> RunResult {
        let mut run = run(OLDER_CURVES.len());
        for index in [1, 2, 3, 4, 6, 7, 8] {
            run.curves[index] = vec![OLDER_CURVES[index].1; ROUNDS];
        }
        run
    }

    fn measured_curves(run: &RunResult) -> Vec<Curve> {
        let mut measured_curves = Curve::WITH_ROUND_VALUES.to_vec();
        measured_curves.retain(|curve| !run.curve(*curve).is_empty());
        measured_curves
    }

    #[test]
    fn a_stored_run_equals_the_written_run() {
        let outcome = Ok(run(Curve::WITH_ROUND_VALUES.len()));
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
    fn curves_of_the_older_layout_are_read_by_name() {
        let read = stored_run_of_older_layout(&run(OLDER_CURVES.len()));
        let run = read.outcome.unwrap();
        for (position, (curve, _)) in OLDER_CURVES.iter().enumerate() {
            assert_eq!(run.curve(*curve), [position as f64 + 1.0; ROUNDS]);
        }
        assert!(run.curve(Curve::VisitationEntropy).is_empty());
        assert_eq!(read.build, Some([3; 8]));
    }

    #[test]
    fn placeholders_of_the_older_layout_count_as_unmeasured() {
        let run = stored_run_of_older_layout(&older_run_with_placeholders())
            .outcome
            .unwrap();
        let measured_curves = measured_curves(&run);
        assert_eq!(measured_curves[..2], [Curve::ValueLoss, Curve::Entropy]);
        assert_eq!(measured_curves.len(), 2 + 5);
    }

    /// If there is a policy loss, a clipped fraction of 0 means that nothing was clipped.
    #[test]
    fn a_clipped_fraction_of_zero_is_measured_if_there_is_a_policy_loss() {
        let mut stored = run(OLDER_CURVES.len());
        stored.curves[4] = vec![0.0; ROUNDS];
        let run = stored_run_of_older_layout(&stored).outcome.unwrap();
        assert_eq!(run.curve(Curve::ClippedFraction), [0.0; ROUNDS]);
    }

    /// A repetition has an additional curve, and NaN instead of placeholders.
    #[test]
    fn a_repetition_reproduces_a_run_of_the_older_layout() {
        let stored = stored_run_of_older_layout(&older_run_with_placeholders());
        let mut repetition = stored.outcome.clone().unwrap();
        for (curve, values) in Curve::WITH_ROUND_VALUES.iter().zip(&mut repetition.curves) {
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
