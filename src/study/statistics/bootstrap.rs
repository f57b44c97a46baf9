//! Percentile bootstrap at 95 %, stratified: runs are redrawn within each task, never across tasks (Agarwal et al. 2021, §4.1;
//! `rliable.library.StratifiedBootstrap`).

use rand::RngExt;

use super::{Estimate, Interval, LEAST_RUNS};
use crate::random::{Purpose, Stream, stream};

/// How often the runs are redrawn, as in `rliable`.
///
/// An end of a normal bootstrap distribution of deviation σ is then off by √(0.025 · 0.975 / 50 000) / φ(1.96) σ ≈ 0.012 σ.
pub const RESAMPLES: usize = 50_000;

/// The shares of redrawn values below the two ends.
const ENDS: (f64, f64) = (0.025, 0.975);

/// A statistic of strata, such as the tasks' runs, with its interval.   `strata: [stratum][run]`
///
/// Two algorithms are told apart by giving the strata of both, one after the other. The smallest stratum decides whether there
/// are enough runs.
///
/// # Panics
/// If a stratum is empty.
#[must_use]
pub fn estimate(strata: &[Vec<f64>], statistic: impl Fn(&[Vec<f64>]) -> f64) -> Estimate {
    estimates(strata, 1, |strata, values| values[0] = statistic(strata))[0]
}

/// The same of a single sample.   `sample: [n]`
///
/// # Panics
/// If it is empty.
#[must_use]
pub fn estimate_of_sample(sample: &[f64], statistic: impl Fn(&[f64]) -> f64) -> Estimate {
    estimate(&[sample.to_vec()], |strata| statistic(&strata[0]))
}

/// `count` statistics of the same redrawn strata, each with its interval. `statistic` fills a slice of `count` values.
///
/// # Panics
/// If a stratum is empty.
#[must_use]
pub fn estimates(
    strata: &[Vec<f64>],
    count: usize,
    statistic: impl Fn(&[Vec<f64>], &mut [f64]),
) -> Vec<Estimate> {
    let runs = strata.iter().map(Vec::len).min().unwrap_or(0);
    assert!(runs > 0, "a stratum without runs");
    let mut values = vec![0.0; count];
    statistic(strata, &mut values);
    let intervals = if runs < LEAST_RUNS {
        vec![Interval::TooFewRuns { n: runs }; count]
    } else {
        redrawn_values(strata, count, statistic)
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

/// The statistics of redrawn strata.   → `[count][RESAMPLES]`
fn redrawn_values(
    strata: &[Vec<f64>],
    count: usize,
    statistic: impl Fn(&[Vec<f64>], &mut [f64]),
) -> Vec<Vec<f64>> {
    let mut random = stream(0, Purpose::Bootstrap, 0, 0);
    let mut redrawn = strata.to_vec();
    let mut values = vec![0.0; count];
    let mut all = vec![Vec::with_capacity(RESAMPLES); count];
    for _ in 0..RESAMPLES {
        redraw(strata, &mut redrawn, &mut random);
        statistic(&redrawn, &mut values);
        all.iter_mut()
            .zip(&values)
            .for_each(|(all, &value)| all.push(value));
    }
    all
}

/// As many runs of each stratum as it has, drawn with replacement.
fn redraw(strata: &[Vec<f64>], redrawn: &mut [Vec<f64>], random: &mut Stream) {
    for (runs, redrawn) in strata.iter().zip(redrawn) {
        redrawn.fill_with(|| runs[random.random_range(0..runs.len())]);
    }
}

fn percentile_interval(mut values: Vec<f64>) -> Interval {
    values.sort_unstable_by(f64::total_cmp);
    Interval::Known {
        low: percentile(&values, ENDS.0),
        high: percentile(&values, ENDS.1),
    }
}

/// The value below which lies a `share` of sorted values, between two of them in a straight line, as numpy does.
fn percentile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len() - 1) as f64;
    let (low, high) = (
        sorted[place.floor() as usize],
        sorted[place.ceil() as usize],
    );
    match (low == high, low.is_finite()) {
        (true, _) => low,
        (false, true) => low + (high - low) * place.fract(),
        // Halfway up from −∞ is nowhere.
        (false, false) => {
            if place.fract() < 0.5 {
                low
            } else {
                high
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::statistics::aggregate::{mean, mean_of_tasks, median};

    /// Place 0.025 · 4 = 0.1 lies a tenth of the way from the first to the second value.
    #[test]
    fn percentiles_lie_between_values() {
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
    fn few_runs_make_no_interval() {
        let four = estimate_of_sample(&[1.0, 2.0, 3.0, 4.0], median);
        assert_eq!(
            four,
            Estimate {
                value: 2.5,
                interval: Interval::TooFewRuns { n: 4 }
            }
        );
        let one_short_task = estimate(&[vec![1.0; 9], vec![2.0; 3]], mean_of_tasks);
        assert_eq!(one_short_task.interval, Interval::TooFewRuns { n: 3 });
    }

    #[test]
    fn equal_data_give_equal_intervals() {
        let sample = [3.0, 1.0, 4.0, 1.0, 5.0, 9.0, 2.0];
        assert_eq!(
            estimate_of_sample(&sample, mean),
            estimate_of_sample(&sample, mean)
        );
    }

    /// Tasks of constant scores 0 and 10 have mean 5 however often runs are redrawn; across tasks it would scatter.
    #[test]
    fn runs_stay_in_their_task() {
        let both = estimate(&[vec![0.0; 5], vec![10.0; 5]], mean_of_tasks);
        assert_eq!(
            both,
            Estimate {
                value: 5.0,
                interval: Interval::Known {
                    low: 5.0,
                    high: 5.0
                }
            }
        );
    }

    /// Five runs, one of them 1 and the others 0: a redrawn sum is binomial(5, 0.2), with P(0) = 0.8⁵ = 0.328 and
    /// P(≤ 2) = 0.942, P(≤ 3) = 0.993. So the 2.5 % point of the mean is 0 and the 97.5 % point is 3/5.
    #[test]
    fn the_ends_of_a_binomial_are_known() {
        let one_of_five = estimate_of_sample(&[0.0, 0.0, 1.0, 0.0, 0.0], mean);
        assert_eq!(
            one_of_five,
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
