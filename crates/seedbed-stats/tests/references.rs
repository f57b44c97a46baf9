//! Results compared with those of rliable, scipy, statsmodels and lifelines, which
//! `reference/reference.py` stores in `reference/reference.json`; its first lines explain how to
//! run it.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use seedbed_stats::aggregate::{
    interquartile_mean, mean, mean_of_tasks, median, median_of_tasks, optimality_gap,
};
use seedbed_stats::bootstrap::RESAMPLES;
use seedbed_stats::hypothesis::{holm_correction, welch_test};
use seedbed_stats::improvement::probability_of_improvement;
use seedbed_stats::paired::{differences, signed_rank_test};
use seedbed_stats::profile::performance_profile;
use seedbed_stats::survival::{TimeToEvent, kaplan_meier, log_rank_test};
use seedbed_stats::{Estimate, Interval, bootstrap_estimate, stratified_bootstrap_estimate};
use serde::Deserialize;

/// Reference values are rounded to eleven digits. Sums in another order differ by less than that.
const ROUNDING_TOLERANCE: f64 = 1e-9;

/// Tolerance of interval ends, as a share of the width of the interval.
///
/// For a normal bootstrap distribution, the standard error of an end is √(0.025 · 0.975 / 50 000) /
/// φ(1.96) = 0.012 standard deviations, and √2 times as much for the difference between the
/// computed end and the reference. The interval is 3.92 standard deviations wide, so the standard
/// error is 0.0043 widths. The tolerance is five standard errors.
const RESAMPLING_TOLERANCE: f64 = 0.022;

#[derive(Deserialize)]
struct Reference {
    resamples: usize,
    goal: f64,
    aggregates: Vec<AggregateCase>,
    improvements: Vec<ImprovementCase>,
    profile: ProfileCase,
    paired: Vec<PairedCase>,
    signed_ranks: Vec<SignedRankCase>,
    welch: Vec<WelchCase>,
    holm: Vec<HolmCase>,
    survival: Vec<SurvivalCase>,
    log_rank: Vec<LogRankCase>,
}

#[derive(Deserialize)]
struct ReferenceEstimate {
    value: f64,
    low: f64,
    high: f64,
}

fn reference() -> Reference {
    serde_json::from_str(include_str!("reference/reference.json")).unwrap()
}

fn assert_close(name: &str, computed: f64, reference: f64) {
    assert!(
        (computed - reference).abs() <= ROUNDING_TOLERANCE * reference.abs().max(1.0),
        "{name}: {computed}, the reference has {reference}"
    );
}

/// Compares with a tolerance relative to the reference, for small tail probabilities.
fn assert_relatively_close(name: &str, computed: f64, reference: f64) {
    assert!(
        (computed - reference).abs() <= ROUNDING_TOLERANCE * reference.abs(),
        "{name}: {computed}, the reference has {reference}"
    );
}

fn ends(interval: Interval) -> (f64, f64) {
    let Interval::Known { low, high } = interval else {
        panic!("the estimate has no interval")
    };
    (low, high)
}

/// Compares an estimate with its reference: the value up to rounding, the interval ends up to the
/// error of resampling, or up to `step` if the statistic is discrete with this step.
fn assert_estimate(name: &str, computed: &Estimate, reference: &ReferenceEstimate, step: f64) {
    assert_close(name, computed.value, reference.value);
    let (low, high) = ends(computed.interval);
    let tolerance =
        (RESAMPLING_TOLERANCE * (reference.high - reference.low)).max(step) + ROUNDING_TOLERANCE;
    for (end, computed, reference) in [("low", low, reference.low), ("high", high, reference.high)]
    {
        assert!(
            (computed - reference).abs() <= tolerance,
            "{name}, {end}: {computed}, the reference has {reference} ± {tolerance}"
        );
    }
}

#[derive(Deserialize)]
struct AggregateCase {
    name: String,
    scores: Vec<Vec<f64>>,
    mean: ReferenceEstimate,
    median: ReferenceEstimate,
    interquartile_mean: ReferenceEstimate,
    optimality_gap: ReferenceEstimate,
}

#[test]
fn aggregates_equal_rliable() {
    let reference = reference();
    assert_eq!(
        (reference.resamples, reference.aggregates.len()),
        (RESAMPLES, 4)
    );
    for case in &reference.aggregates {
        let check =
            |kind: &str, reference: &ReferenceEstimate, statistic: &dyn Fn(&[Vec<f64>]) -> f64| {
                assert_estimate(
                    &format!("{}, {kind}", case.name),
                    &stratified_bootstrap_estimate(&case.scores, statistic),
                    reference,
                    0.0,
                );
            };
        check("mean", &case.mean, &mean_of_tasks);
        check("median", &case.median, &median_of_tasks);
        check("IQM", &case.interquartile_mean, &|tasks| {
            interquartile_mean(&tasks.concat())
        });
        check("gap", &case.optimality_gap, &|tasks| {
            optimality_gap(&tasks.concat(), reference.goal)
        });
    }
}

#[derive(Deserialize)]
struct ImprovementCase {
    name: String,
    x: Vec<Vec<f64>>,
    y: Vec<Vec<f64>>,
    probability: ReferenceEstimate,
}

#[test]
fn the_probability_of_improvement_equals_rliable() {
    let cases = reference().improvements;
    assert_eq!(cases.len(), 2);
    for ImprovementCase {
        name,
        x,
        y,
        probability,
    } in cases
    {
        let step = 0.5 / (x[0].len() * y[0].len() * x.len()) as f64;
        assert_estimate(
            &name,
            &probability_of_improvement(&x, &y),
            &probability,
            step,
        );
    }
}

#[derive(Deserialize)]
struct ProfileCase {
    scores: Vec<Vec<f64>>,
    thresholds: Vec<f64>,
    points: Vec<ReferenceEstimate>,
}

#[test]
fn the_performance_profile_equals_rliable() {
    let ProfileCase {
        scores,
        thresholds,
        points,
    } = reference().profile;
    let computed = performance_profile(&scores, &thresholds);
    assert_eq!((computed.len(), points.len()), (7, 7));
    let step = 1.0 / scores.concat().len() as f64;
    for ((computed, reference), threshold) in computed.iter().zip(&points).zip(&thresholds) {
        assert_estimate(&format!("above {threshold}"), computed, reference, step);
    }
}

#[derive(Deserialize)]
struct PairedCase {
    name: String,
    x: Vec<f64>,
    y: Vec<f64>,
    mean: ReferenceEstimate,
    median: ReferenceEstimate,
}

#[test]
fn intervals_of_paired_differences_equal_scipy() {
    let cases = reference().paired;
    assert_eq!(cases.len(), 2);
    for case in cases {
        let differences = differences(&case.x, &case.y);
        assert_estimate(
            &format!("{}, mean", case.name),
            &bootstrap_estimate(&differences, mean),
            &case.mean,
            0.0,
        );
        assert_estimate(
            &format!("{}, median", case.name),
            &bootstrap_estimate(&differences, median),
            &case.median,
            0.0,
        );
    }
}

#[derive(Deserialize)]
struct SignedRankCase {
    name: String,
    differences: Vec<f64>,
    statistic: f64,
    p: f64,
}

#[test]
fn the_signed_rank_test_equals_scipy() {
    let cases = reference().signed_ranks;
    assert_eq!(cases.len(), 7);
    for case in cases {
        let computed = signed_rank_test(&case.differences);
        assert_relatively_close(&case.name, computed.p, case.p);
        // For its permutation test, scipy reports the sum of positive ranks as the statistic, not
        // the smaller of both sums.
        let nonzero_count = case
            .differences
            .iter()
            .filter(|difference| **difference != 0.0)
            .count() as f64;
        let total_rank_sum = nonzero_count * (nonzero_count + 1.0) / 2.0;
        assert_close(
            &case.name,
            computed.statistic,
            case.statistic.min(total_rank_sum - case.statistic),
        );
    }
}

#[derive(Deserialize)]
struct WelchCase {
    x: Vec<f64>,
    y: Vec<f64>,
    t: f64,
    degrees: f64,
    p: f64,
}

#[test]
fn the_welch_test_equals_scipy() {
    let cases = reference().welch;
    assert_eq!(cases.len(), 3);
    for case in cases {
        let computed = welch_test(&case.x, &case.y).unwrap();
        assert_close("t", computed.t, case.t);
        assert_close("degrees", computed.degrees_of_freedom, case.degrees);
        assert_relatively_close("p", computed.p, case.p);
    }
}

#[derive(Deserialize)]
struct HolmCase {
    p: Vec<f64>,
    corrected: Vec<f64>,
}

#[test]
fn holms_correction_equals_statsmodels() {
    let cases = reference().holm;
    assert_eq!(cases.len(), 3);
    for case in cases {
        let computed = holm_correction(&case.p);
        assert_eq!(computed.len(), case.corrected.len());
        for (computed, &reference) in computed.iter().zip(&case.corrected) {
            assert_relatively_close("Holm", *computed, reference);
        }
    }
}

#[derive(Deserialize)]
struct GroupTimes {
    times: Vec<f64>,
    reached: Vec<bool>,
}

impl GroupTimes {
    fn runs(&self) -> Vec<TimeToEvent> {
        self.times
            .iter()
            .zip(&self.reached)
            .map(|(&time, &observed)| TimeToEvent { time, observed })
            .collect()
    }
}

#[derive(Deserialize)]
struct SurvivalCase {
    name: String,
    times: Vec<f64>,
    reached: Vec<bool>,
    steps: Vec<ReferenceStep>,
    median: Option<f64>,
    median_low: Option<f64>,
    median_high: Option<f64>,
}

#[derive(Deserialize)]
struct ReferenceStep {
    time: f64,
    survival: f64,
    low: f64,
    high: f64,
}

#[test]
fn survival_curves_equal_scipy_and_their_bands_equal_lifelines() {
    let cases = reference().survival;
    assert_eq!(cases.len(), 8);
    for SurvivalCase {
        name,
        times,
        reached,
        steps,
        ..
    } in cases
    {
        let curve = kaplan_meier(&GroupTimes { times, reached }.runs());
        assert_eq!(curve.steps.len(), steps.len(), "{name}");
        for (computed, reference) in curve.steps.iter().zip(&steps) {
            assert_eq!(computed.time, reference.time, "{name}");
            assert_close(&name, computed.survival, reference.survival);
            let (low, high) = ends(computed.interval);
            assert_close(&name, low, reference.low);
            assert_close(&name, high, reference.high);
        }
    }
}

/// `lifelines` defines the median as the first time at which S is at most ½. If S is ½ until a
/// later step, the median computed here is the midpoint of both times.
#[test]
fn median_times_equal_lifelines() {
    let mut curves_at_half = 0;
    for SurvivalCase {
        name,
        times,
        reached,
        steps,
        median: first_median,
        median_low,
        median_high,
    } in reference().survival
    {
        let curve = kaplan_meier(&GroupTimes { times, reached }.runs());
        let steps_at_half = steps.windows(2).find(|pair| pair[0].survival == 0.5);
        let middle = steps_at_half.map(|pair| f64::midpoint(first_median.unwrap(), pair[1].time));
        curves_at_half += usize::from(steps_at_half.is_some());
        assert_eq!(curve.median(), middle.or(first_median), "{name}");
        let expected = (
            median_low.unwrap_or(f64::INFINITY),
            median_high.unwrap_or(f64::INFINITY),
        );
        assert_eq!(ends(curve.median_interval()), expected, "{name}");
    }
    assert!(
        curves_at_half >= 2,
        "{curves_at_half} curves equal ½ over an interval"
    );
}

#[derive(Deserialize)]
struct LogRankCase {
    x: GroupTimes,
    y: GroupTimes,
    z: f64,
    p: f64,
}

#[test]
fn the_log_rank_test_equals_scipy() {
    let cases = reference().log_rank;
    assert_eq!(cases.len(), 4);
    for case in cases {
        let computed = log_rank_test(&case.x.runs(), &case.y.runs()).unwrap();
        assert_close("z", computed.z, case.z);
        assert_relatively_close("p", computed.p, case.p);
    }
}

/// Share of 200 samples of 20 standard-normal numbers whose interval contains the true value 0.
///
/// The width of a percentile interval of the mean is √(19/20) · 1.96 / 2.09 times that of Student's
/// interval, so its coverage is 92.9 %. The standard error of the share is
/// √(0.93 · 0.07 / 200) = 1.8 %.
fn coverage(statistic: impl Fn(&[f64]) -> f64) -> f64 {
    let samples = 200;
    let contains_true_value = |sample: u32| {
        let normals: Vec<f64> = StandardNormal
            .sample_iter(ChaCha8Rng::seed_from_u64(u64::from(sample)))
            .take(20)
            .collect();
        let (low, high) = ends(bootstrap_estimate(&normals, &statistic).interval);
        low <= 0.0 && 0.0 <= high
    };
    (0..samples)
        .filter(|&sample| contains_true_value(sample))
        .count() as f64
        / f64::from(samples)
}

#[test]
fn intervals_contain_the_true_value_in_90_to_99_percent_of_samples() {
    for (name, share) in [("mean", coverage(mean)), ("median", coverage(median))] {
        assert!((0.9..=0.99).contains(&share), "{name}: {share}");
    }
}
