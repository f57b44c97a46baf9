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
use seedbed_stats::effect_test::EffectTest;
use seedbed_stats::family::{holm_correction, holm_decisions};
use seedbed_stats::improvement::win_probability;
use seedbed_stats::means::{MeanOfDifferences, TwoMeans};
use seedbed_stats::power::{power_of_differences, power_of_means, runs_needed};
use seedbed_stats::profile::performance_profile;
use seedbed_stats::shares::{Share, TwoShares, wilson_interval};
use seedbed_stats::survival::{TimeToEvent, kaplan_meier};
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
    wins: Vec<WinCase>,
    profile: ProfileCase,
    means: Vec<MeansCase>,
    differences: Vec<DifferencesCase>,
    mcnemar: Vec<McnemarCase>,
    shares: Vec<SharesCase>,
    single_shares: Vec<SingleShareCase>,
    power: Vec<PowerCase>,
    holm: Vec<HolmCase>,
    survival: Vec<SurvivalCase>,
    restricted: Vec<RestrictedCase>,
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
struct WinCase {
    x: Vec<f64>,
    y: Vec<f64>,
    probability: f64,
}

#[test]
fn the_win_probability_equals_scipys_rank_test() {
    let cases = reference().wins;
    assert_eq!(cases.len(), 2);
    for case in cases {
        assert_close(
            "wins",
            win_probability(&case.x, &case.y).value,
            case.probability,
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

/// Compares a p-value with that of a permutation test. Both are exact if there are few
/// permutations. Otherwise they are from 20,000 and 100,000 random ones: the tolerance is five
/// standard errors of their difference.
fn assert_permutation_p_value(name: &str, computed: f64, reference: f64, is_exact: bool) {
    let variance = reference * (1.0 - reference) * (1.0 / 20_000.0 + 1.0 / 100_000.0);
    let tolerance = if is_exact {
        ROUNDING_TOLERANCE
    } else {
        5.0 * variance.sqrt()
    };
    assert!(
        (computed - reference).abs() <= tolerance,
        "{name}: {computed}, the reference has {reference} ± {tolerance}"
    );
}

#[derive(Deserialize)]
struct MeansCase {
    x: Vec<f64>,
    y: Vec<f64>,
    difference: f64,
    p_above: f64,
    p_below: f64,
}

#[test]
fn tests_of_two_means_equal_scipys_permutation_test() {
    let cases = reference().means;
    assert_eq!(cases.len(), 3);
    for case in cases {
        let test = TwoMeans::new(&case.x, &case.y);
        let is_exact = case.x.len() < 10;
        assert_close("difference", test.estimate(), case.difference);
        assert_permutation_p_value("above", test.p_above(0.0), case.p_above, is_exact);
        assert_permutation_p_value("below", test.p_below(0.0), case.p_below, is_exact);
    }
}

#[derive(Deserialize)]
struct DifferencesCase {
    differences: Vec<f64>,
    p_above: f64,
    p_below: f64,
}

#[test]
fn tests_of_differences_equal_scipys_permutation_test() {
    let cases = reference().differences;
    assert_eq!(cases.len(), 3);
    for case in cases {
        let test = MeanOfDifferences::new(&case.differences);
        let is_exact = case.differences.len() < 14;
        assert_permutation_p_value("above", test.p_above(0.0), case.p_above, is_exact);
        assert_permutation_p_value("below", test.p_below(0.0), case.p_below, is_exact);
    }
}

#[derive(Deserialize)]
struct McnemarCase {
    negative: usize,
    positive: usize,
    two_sided: f64,
}

#[test]
fn tests_of_paired_successes_equal_statsmodels_mcnemar() {
    let cases = reference().mcnemar;
    assert_eq!(cases.len(), 3);
    for case in cases {
        let signs = [vec![-1.0; case.negative], vec![1.0; case.positive]].concat();
        let one_sided = MeanOfDifferences::new(&signs).p_above(0.0);
        assert_close("McNemar", (2.0 * one_sided).min(1.0), case.two_sided);
    }
}

#[derive(Deserialize)]
struct SharesCase {
    first: [usize; 2],
    second: [usize; 2],
    p_above: f64,
    p_below: f64,
}

/// Both maximize over points: here 257, in scipy 512 others. Their maxima differ a little.
#[test]
fn tests_of_two_shares_equal_scipys_barnard_exact() {
    let cases = reference().shares;
    assert_eq!(cases.len(), 4);
    for case in cases {
        let [first, second] =
            [case.first, case.second].map(|[successes, runs]| Share { successes, runs });
        let test = TwoShares::new(first, second);
        for (computed, reference) in [
            (test.p_above(0.0), case.p_above),
            (test.p_below(0.0), case.p_below),
        ] {
            assert!(
                (computed - reference).abs() <= 2e-3 * reference,
                "{first:?} {second:?}: {computed}, the reference has {reference}"
            );
        }
    }
}

#[derive(Deserialize)]
struct SingleShareCase {
    successes: usize,
    runs: usize,
    low: f64,
    high: f64,
}

#[test]
fn wilsons_interval_equals_statsmodels() {
    let cases = reference().single_shares;
    assert_eq!(cases.len(), 3);
    for SingleShareCase {
        successes,
        runs,
        low,
        high,
    } in cases
    {
        let computed = ends(wilson_interval(Share { successes, runs }));
        assert_close("low", computed.0, low);
        assert_close("high", computed.1, high);
    }
}

#[derive(Deserialize)]
struct PowerCase {
    effect: f64,
    level: f64,
    power: f64,
    runs: usize,
    pairs: usize,
}

#[test]
fn numbers_of_runs_equal_statsmodels_within_one() {
    let cases = reference().power;
    assert_eq!(cases.len(), 12);
    for PowerCase {
        effect,
        level,
        power,
        runs,
        pairs,
    } in cases
    {
        let computed = runs_needed(power, |runs| power_of_means(effect, runs, level)).unwrap();
        assert!(
            computed.abs_diff(runs) <= 1,
            "{effect} {level} {power}: {computed}, not {runs}"
        );
        let computed =
            runs_needed(power, |pairs| power_of_differences(effect, pairs, level)).unwrap();
        assert!(
            computed.abs_diff(pairs) <= 1,
            "{effect} {level} {power}: {computed}, not {pairs}"
        );
    }
}

#[derive(Deserialize)]
struct HolmCase {
    p: Vec<f64>,
    corrected: Vec<f64>,
    rejected: Vec<bool>,
}

#[test]
fn holms_correction_equals_statsmodels() {
    let cases = reference().holm;
    assert_eq!(cases.len(), 3);
    for case in cases {
        assert_eq!(holm_decisions(&case.p, 0.05).are_rejected(), case.rejected);
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
struct RestrictedCase {
    times: Vec<f64>,
    reached: Vec<bool>,
    horizon: f64,
    mean: f64,
}

#[test]
fn restricted_mean_times_equal_lifelines() {
    let cases = reference().restricted;
    assert_eq!(cases.len(), 3);
    for RestrictedCase {
        times,
        reached,
        horizon,
        mean: expected,
    } in cases
    {
        let runs = GroupTimes { times, reached }.runs();
        let restricted: Vec<f64> = runs.iter().map(|run| run.restricted_to(horizon)).collect();
        assert_close("restricted mean", mean(&restricted), expected);
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
