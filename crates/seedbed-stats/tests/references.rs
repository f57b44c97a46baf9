//! Results against the packages that the field uses. `reference/reference.py` computed the numbers of
//! `reference/reference.json`, and says how to do so again.

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
use seedbed_stats::{Estimate, Interval, bootstrap_sample, bootstrap_strata};
use serde::Deserialize;

/// References are rounded to eleven digits, and sums over a hundred scores in another order differ
/// less.
const ROUNDING: f64 = 1e-9;

/// How far an end may lie from the reference's, as a share of the interval's width.
///
/// Each end errs by √(0.025 · 0.975 / 50 000) / φ(1.96) = 0.012 deviations of a normal bootstrap
/// distribution, the difference of two ends by √2 as much, and the interval is 3.92 deviations
/// wide: 0.0043 widths. This is five times that.
const MONTE_CARLO: f64 = 0.022;

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

fn assert_close(name: &str, ours: f64, reference: f64) {
    assert!(
        (ours - reference).abs() <= ROUNDING * reference.abs().max(1.0),
        "{name}: {ours}, the reference has {reference}"
    );
}

/// For tails, whose first digits count however small they are.
fn assert_relatively_close(name: &str, ours: f64, reference: f64) {
    assert!(
        (ours - reference).abs() <= ROUNDING * reference.abs(),
        "{name}: {ours}, the reference has {reference}"
    );
}

fn ends(interval: Interval) -> (f64, f64) {
    let Interval::Known { low, high } = interval else {
        panic!("no interval")
    };
    (low, high)
}

/// The value to rounding, the ends to the error of resampling, or to `step` where values come in
/// steps.
fn assert_estimate(name: &str, ours: &Estimate, reference: &ReferenceEstimate, step: f64) {
    assert_close(name, ours.value, reference.value);
    let (low, high) = ends(ours.interval);
    let tolerance = (MONTE_CARLO * (reference.high - reference.low)).max(step) + ROUNDING;
    for (end, ours, reference) in [("low", low, reference.low), ("high", high, reference.high)] {
        assert!(
            (ours - reference).abs() <= tolerance,
            "{name}, {end}: {ours}, the reference has {reference} ± {tolerance}"
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
fn aggregates_are_those_of_rliable() {
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
                    &bootstrap_strata(&case.scores, statistic),
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
fn the_probability_of_improvement_is_rliables() {
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
fn the_performance_profile_is_rliables() {
    let ProfileCase {
        scores,
        thresholds,
        points,
    } = reference().profile;
    let ours = performance_profile(&scores, &thresholds);
    assert_eq!((ours.len(), points.len()), (7, 7));
    let step = 1.0 / scores.concat().len() as f64;
    for ((ours, reference), threshold) in ours.iter().zip(&points).zip(&thresholds) {
        assert_estimate(&format!("above {threshold}"), ours, reference, step);
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
fn paired_differences_have_scipys_intervals() {
    let cases = reference().paired;
    assert_eq!(cases.len(), 2);
    for case in cases {
        let differences = differences(&case.x, &case.y);
        assert_estimate(
            &format!("{}, mean", case.name),
            &bootstrap_sample(&differences, mean),
            &case.mean,
            0.0,
        );
        assert_estimate(
            &format!("{}, median", case.name),
            &bootstrap_sample(&differences, median),
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
fn the_signed_rank_test_is_scipys() {
    let cases = reference().signed_ranks;
    assert_eq!(cases.len(), 7);
    for case in cases {
        let ours = signed_rank_test(&case.differences);
        assert_relatively_close(&case.name, ours.p, case.p);
        // Under a permutation scipy reports the sum of positive ranks.
        let other = case
            .differences
            .iter()
            .filter(|difference| **difference != 0.0)
            .count() as f64;
        let all = other * (other + 1.0) / 2.0;
        assert_close(
            &case.name,
            ours.statistic,
            case.statistic.min(all - case.statistic),
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
fn welchs_test_is_scipys() {
    let cases = reference().welch;
    assert_eq!(cases.len(), 3);
    for case in cases {
        let ours = welch_test(&case.x, &case.y).unwrap();
        assert_close("t", ours.t, case.t);
        assert_close("degrees", ours.degrees_of_freedom, case.degrees);
        assert_relatively_close("p", ours.p, case.p);
    }
}

#[derive(Deserialize)]
struct HolmCase {
    p: Vec<f64>,
    corrected: Vec<f64>,
}

#[test]
fn holms_correction_is_that_of_statsmodels() {
    let cases = reference().holm;
    assert_eq!(cases.len(), 3);
    for case in cases {
        let ours = holm_correction(&case.p);
        assert_eq!(ours.len(), case.corrected.len());
        ours.iter()
            .zip(&case.corrected)
            .for_each(|(ours, &reference)| assert_relatively_close("Holm", *ours, reference));
    }
}

#[derive(Deserialize)]
struct Lifetimes {
    times: Vec<f64>,
    reached: Vec<bool>,
}

impl Lifetimes {
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
fn survival_curves_are_those_of_scipy_and_bands_those_of_lifelines() {
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
        let curve = kaplan_meier(&Lifetimes { times, reached }.runs());
        assert_eq!(curve.steps.len(), steps.len(), "{name}");
        for (ours, reference) in curve.steps.iter().zip(&steps) {
            assert_eq!(ours.time, reference.time, "{name}");
            assert_close(&name, ours.survival, reference.survival);
            let (low, high) = ends(ours.interval);
            assert_close(&name, low, reference.low);
            assert_close(&name, high, reference.high);
        }
    }
}

/// `lifelines` takes the first time at which S is ½ or less. Where S is ½ until a later step, ours
/// lies halfway to it.
#[test]
fn median_times_are_those_of_lifelines() {
    let mut rests = 0;
    for SurvivalCase {
        name,
        times,
        reached,
        steps,
        median: start,
        median_low,
        median_high,
    } in reference().survival
    {
        let curve = kaplan_meier(&Lifetimes { times, reached }.runs());
        let rest = steps.windows(2).find(|pair| pair[0].survival == 0.5);
        let halfway = rest.map(|pair| f64::midpoint(start.unwrap(), pair[1].time));
        rests += usize::from(rest.is_some());
        assert_eq!(curve.median(), halfway.or(start), "{name}");
        let expected = (
            median_low.unwrap_or(f64::INFINITY),
            median_high.unwrap_or(f64::INFINITY),
        );
        assert_eq!(ends(curve.median_interval()), expected, "{name}");
    }
    assert!(rests >= 2, "{rests} curves rest on ½");
}

#[derive(Deserialize)]
struct LogRankCase {
    x: Lifetimes,
    y: Lifetimes,
    z: f64,
    p: f64,
}

#[test]
fn the_log_rank_test_is_scipys() {
    let cases = reference().log_rank;
    assert_eq!(cases.len(), 4);
    for case in cases {
        let ours = log_rank_test(&case.x.runs(), &case.y.runs()).unwrap();
        assert_close("z", ours.z, case.z);
        assert_relatively_close("p", ours.p, case.p);
    }
}

/// Of 200 samples of 20 normal numbers the share whose interval contains the truth. A percentile
/// interval of the mean is narrower than Student's by √(19/20) · 1.96 / 2.09, which makes it cover
/// 92.9 %; the share scatters by √(0.93 · 0.07 / 200) = 1.8 %.
fn coverage(statistic: impl Fn(&[f64]) -> f64) -> f64 {
    let samples = 200;
    let contains_truth = |sample: u32| {
        let normals: Vec<f64> = StandardNormal
            .sample_iter(ChaCha8Rng::seed_from_u64(u64::from(sample)))
            .take(20)
            .collect();
        let (low, high) = ends(bootstrap_sample(&normals, &statistic).interval);
        low <= 0.0 && 0.0 <= high
    };
    (0..samples)
        .filter(|&sample| contains_truth(sample))
        .count() as f64
        / f64::from(samples)
}

#[test]
fn intervals_contain_the_truth_as_often_as_they_say() {
    for (name, share) in [("mean", coverage(mean)), ("median", coverage(median))] {
        assert!((0.9..=0.99).contains(&share), "{name}: {share}");
    }
}
