//! Stratified percentile bootstrap: 95 % confidence intervals of any statistic.
//!
//! Runs are resampled with replacement within each stratum (usually a task), never across strata
//! (Agarwal et al. 2021, §4.1; `rliable.library.StratifiedBootstrap`).
//!
//! ```
//! use seedbed_stats::aggregate::{mean, mean_of_tasks};
//! use seedbed_stats::bootstrap::{bootstrap_estimate, stratified_bootstrap_estimate};
//!
//! // One task, five runs.
//! let estimate = bootstrap_estimate(&[3.0, 1.0, 4.0, 1.0, 5.0], mean);
//! assert_eq!(estimate.value, 2.8);
//!
//! // Two tasks: every resample has as many runs per task as the data.
//! let tasks = [vec![0.0; 5], vec![10.0; 5]];
//! let estimate = stratified_bootstrap_estimate(&tasks, mean_of_tasks);
//! assert_eq!(estimate.interval.ends(), Some([5.0, 5.0]));
//! ```

use rand::RngExt;

use super::{Estimate, Interval, MIN_RUNS};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Number of resamples, as in `rliable`.
///
/// If the bootstrap distribution is normal with standard deviation σ, the Monte-Carlo error of an
/// interval end is √(0.025 · 0.975 / 50 000) / φ(1.96) σ ≈ 0.012 σ.
pub const RESAMPLES: usize = 50_000;

/// Shares of resampled values below the lower and below the upper end of a 95 % interval.
const INTERVAL_SHARES: (f64, f64) = (0.025, 0.975);

/// Estimates a statistic of strata, such as the runs of each task, with its 95 % interval.
/// `strata: [stratum][run]`
///
/// To compare two algorithms, pass the strata of both, one after the other, and let `statistic`
/// compute the difference. There is an interval if the smallest stratum has at least [`MIN_RUNS`]
/// runs.
///
/// # Panics
/// If there is no stratum, or if a stratum is empty.
#[must_use]
pub fn stratified_bootstrap_estimate(
    strata: &[Vec<f64>],
    statistic: impl Fn(&[Vec<f64>]) -> f64,
) -> Estimate {
    bootstrap_statistics(strata, 1, |strata, values| values[0] = statistic(strata))[0]
}

/// Estimates a statistic of a single sample, with its 95 % interval.   `sample: [run]`
///
/// # Panics
/// If the sample is empty.
#[must_use]
pub fn bootstrap_estimate(sample: &[f64], statistic: impl Fn(&[f64]) -> f64) -> Estimate {
    stratified_bootstrap_estimate(&[sample.to_vec()], |strata| statistic(&strata[0]))
}

/// Estimates several statistics from the same resamples, each with its 95 % interval.
/// `strata: [stratum][run]` → `[count]`
///
/// `statistic` fills a slice with the `count` values of the statistics.
///
/// # Panics
/// If there is no stratum, or if a stratum is empty.
#[must_use]
pub fn bootstrap_statistics(
    strata: &[Vec<f64>],
    count: usize,
    statistic: impl Fn(&[Vec<f64>], &mut [f64]),
) -> Vec<Estimate> {
    let smallest_run_count = strata.iter().map(Vec::len).min().unwrap_or(0);
    assert!(smallest_run_count > 0, "a stratum without runs");
    let mut values = vec![0.0; count];
    statistic(strata, &mut values);
    let intervals = if smallest_run_count < MIN_RUNS {
        let n = smallest_run_count;
        vec![Interval::TooFewRuns { n }; count]
    } else {
        resampled_values(strata, count, statistic)
            .into_iter()
            .map(percentile_interval)
            .collect()
    };
    values
        .into_iter()
        .zip(intervals)
        .map(|(value, interval)| Estimate { value, interval })
        .collect()
}

/// The values of all statistics in all resamples.   → `[count][RESAMPLES]`
fn resampled_values(
    strata: &[Vec<f64>],
    count: usize,
    statistic: impl Fn(&[Vec<f64>], &mut [f64]),
) -> Vec<Vec<f64>> {
    let mut random = resampling_stream();
    let mut resampled = strata.to_vec();
    let mut values = vec![0.0; count];
    let mut values_of_resamples = vec![Vec::with_capacity(RESAMPLES); count];
    for _ in 0..RESAMPLES {
        resample(strata, &mut resampled, &mut random);
        statistic(&resampled, &mut values);
        for (values_of_resamples, &value) in values_of_resamples.iter_mut().zip(&values) {
            values_of_resamples.push(value);
        }
    }
    values_of_resamples
}

/// The random stream of all resamples. It is always the same, so that equal data give equal
/// intervals. Its key must never change, because published intervals depend on it.
fn resampling_stream() -> ChaCha8Rng {
    let mut key = [0_u8; 32];
    key[8] = 13;
    ChaCha8Rng::from_seed(key)
}

/// Fills each stratum of `resampled` with runs of the same stratum, drawn with replacement.
fn resample(strata: &[Vec<f64>], resampled: &mut [Vec<f64>], random: &mut ChaCha8Rng) {
    for (runs, resampled) in strata.iter().zip(resampled) {
        resampled.fill_with(|| runs[random.random_range(0..runs.len())]);
    }
}

fn percentile_interval(mut values: Vec<f64>) -> Interval {
    values.sort_unstable_by(f64::total_cmp);
    Interval::Known {
        low: percentile(&values, INTERVAL_SHARES.0),
        high: percentile(&values, INTERVAL_SHARES.1),
    }
}

/// Percentile of sorted values, with linear interpolation between neighboring values, as
/// `numpy.percentile`.
fn percentile(sorted: &[f64], share: f64) -> f64 {
    let position = share * (sorted.len() - 1) as f64;
    let (low, high) = (
        sorted[position.floor() as usize],
        sorted[position.ceil() as usize],
    );
    // Statistics of runs that never reached a goal may be infinite. ∞ − ∞ is NaN, so equal
    // neighbors are not interpolated.
    if low == high {
        return low;
    }
    // Between a finite value and ∞, interpolation gives ∞ for every fraction above 0.
    if low.is_finite() {
        return low + (high - low) * position.fract();
    }
    // Between −∞ and a finite value, interpolation would give −∞ + ∞ = NaN: take the nearer
    // neighbor.
    if position.fract() < 0.5 { low } else { high }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aggregate::{mean, mean_of_tasks, median};

    /// Position 0.025 · 4 = 0.1 is a tenth of the way from the first to the second value.
    #[test]
    fn percentiles_are_interpolated() {
        assert!((percentile(&[10.0, 20.0, 30.0, 40.0, 50.0], 0.025) - 11.0).abs() < 1e-12);
        assert_eq!(percentile(&[10.0, 20.0, 30.0, 40.0, 50.0], 0.5), 30.0);
        assert_eq!(
            percentile(&[1.0, f64::INFINITY, f64::INFINITY], 0.975),
            f64::INFINITY
        );
        assert_eq!(
            [0.1, 0.4].map(|share| percentile(&[f64::NEG_INFINITY, 1.0, 2.0], share)),
            [f64::NEG_INFINITY, 1.0]
        );
    }

    #[test]
    fn fewer_than_five_runs_give_no_interval() {
        let estimate_of_four = bootstrap_estimate(&[1.0, 2.0, 3.0, 4.0], median);
        assert_eq!(
            estimate_of_four,
            Estimate {
                value: 2.5,
                interval: Interval::TooFewRuns { n: 4 }
            }
        );
        let estimate_with_a_short_task =
            stratified_bootstrap_estimate(&[vec![1.0; 9], vec![2.0; 3]], mean_of_tasks);
        assert_eq!(
            estimate_with_a_short_task.interval,
            Interval::TooFewRuns { n: 3 }
        );
    }

    #[test]
    fn equal_data_give_equal_intervals() {
        let sample = [3.0, 1.0, 4.0, 1.0, 5.0, 9.0, 2.0];
        assert_eq!(
            bootstrap_estimate(&sample, mean),
            bootstrap_estimate(&sample, mean)
        );
    }

    /// Two tasks have the constant scores 0 and 10. If runs are resampled within their task, every
    /// resample has the mean 5; resamples across tasks would have different means.
    #[test]
    fn runs_are_resampled_within_their_task() {
        let estimate = stratified_bootstrap_estimate(&[vec![0.0; 5], vec![10.0; 5]], mean_of_tasks);
        assert_eq!(
            estimate,
            Estimate {
                value: 5.0,
                interval: Interval::Known {
                    low: 5.0,
                    high: 5.0
                }
            }
        );
    }

    /// One run with score 1 and four with score 0: the sum of a resample is binomial(5, 0.2), with
    /// P(0) = 0.8⁵ = 0.328, P(≤ 2) = 0.942 and P(≤ 3) = 0.993. So the 2.5 % quantile of the mean is
    /// 0, and the 97.5 % quantile is 3/5.
    #[test]
    fn the_interval_of_a_binomial_sample_equals_its_quantiles() {
        let estimate = bootstrap_estimate(&[0.0, 0.0, 1.0, 0.0, 0.0], mean);
        assert_eq!(
            estimate,
            Estimate {
                value: 0.2,
                interval: Interval::Known {
                    low: 0.0,
                    high: 0.6
                }
            }
        );
    }
}
