//! Comparison of two cells in one measure: effect with interval, p-value, and probability that a
//! run of one cell is below a run of the other.

use super::file::Test;
use super::measure::Measure;
use super::run_result::RunResult;
use seedbed_stats::aggregate::{interquartile_mean_of_sorted, mean, median_of_sorted};
use seedbed_stats::bootstrap::{bootstrap_sorted_statistics, bootstrap_statistics};
use seedbed_stats::hypothesis::welch_test;
use seedbed_stats::improvement::probability_of_improvement;
use seedbed_stats::paired::{differences, signed_rank_test};
use seedbed_stats::survival::{TimeToEvent, kaplan_meier, log_rank_test};
use seedbed_stats::{Estimate, Interval, bootstrap_estimate};

/// Value of a measure for one run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunScore {
    /// Run seed.
    pub run_seed: u64,
    /// Value of the measure; infinite for a time that was not reached.
    pub value: f64,
    /// For a time that was not reached, the end of the run; otherwise infinite.
    pub observed_until: f64,
}

/// Summary of the runs of one cell in one measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aggregate {
    /// Number of runs.
    pub n: usize,
    /// Number of runs that reached the time. Equals `n` if the measure is not a time.
    pub reached: usize,
    /// Median. For times this is the Kaplan–Meier median, infinite if the survival curve never
    /// falls below ½.
    pub median: Estimate,
    /// Interquartile mean; `None` if a run did not reach the time.
    pub interquartile_mean: Option<Estimate>,
    /// Minimum and maximum.
    pub range: [f64; 2],
}

/// Comparison of a first with a second cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Number of runs of the first and of the second cell. In a paired comparison both are the
    /// number of pairs.
    pub n: [usize; 2],
    /// Effect: first minus second. It is a median for times and a mean for all other measures. NaN
    /// if it depends on unknown differences between times that were not reached.
    pub effect: Estimate,
    /// Smallest and largest effect over all possible values of unknown differences. Both equal the
    /// effect if it does not depend on unknown differences.
    pub effect_bounds: [f64; 2],
    /// Probability that a run of the first cell is below a run of the second. A tie counts half.
    pub probability_below: Estimate,
    /// Two-sided p-value of the test.
    pub p: f64,
    /// Time up to which all runs were observed. Times after it count as not reached.
    pub horizon: f64,
}

impl RunScore {
    /// Score of a run in a measure; `None` if the run does not have this measure.
    #[must_use]
    pub fn of(measure: Measure, run_seed: u64, run: &RunResult) -> Option<Self> {
        let value = measure.of(run)?;
        let time = if measure.is_time() {
            measure.time_to_event(run)
        } else {
            None
        };
        let observed_until = match time {
            Some(time) if !time.observed => time.time,
            _ => f64::INFINITY,
        };
        Some(Self {
            run_seed,
            value,
            observed_until,
        })
    }

    fn time_to_event(self) -> TimeToEvent {
        if self.value.is_finite() {
            TimeToEvent::observed(self.value)
        } else {
            TimeToEvent::censored(self.observed_until)
        }
    }
}

/// Converts scores of times to times for survival analysis. Times that were not reached are
/// censored.
#[must_use]
pub fn times_to_event(scores: &[RunScore]) -> Vec<TimeToEvent> {
    scores.iter().map(|score| score.time_to_event()).collect()
}

/// Summarizes scores. With `are_times`, infinite scores are censored times. `None` without scores.
#[must_use]
pub fn summarize_scores(scores: &[RunScore], are_times: bool) -> Option<Aggregate> {
    let values: Vec<f64> = scores.iter().map(|score| score.value).collect();
    if values.is_empty() {
        return None;
    }
    let reached = values.iter().filter(|value| value.is_finite()).count();
    let all_reached = reached == values.len();
    let (median, interquartile_mean) = match (are_times, all_reached) {
        (true, false) => (median_time(scores), None),
        (true, true) => (
            median_time(scores),
            Some(median_and_interquartile_mean(&values)[1]),
        ),
        (false, _) => {
            let [median, interquartile_mean] = median_and_interquartile_mean(&values);
            (median, all_reached.then_some(interquartile_mean))
        }
    };
    let min = values.iter().copied().fold(values[0], f64::min);
    let max = values.iter().copied().fold(values[0], f64::max);
    Some(Aggregate {
        n: values.len(),
        reached,
        median,
        interquartile_mean,
        range: [min, max],
    })
}

/// Kaplan–Meier median with its interval.
fn median_time(scores: &[RunScore]) -> Estimate {
    let curve = kaplan_meier(&times_to_event(scores));
    Estimate {
        value: curve.median().unwrap_or(f64::INFINITY),
        interval: curve.median_interval(),
    }
}

/// Median and interquartile mean with their bootstrap intervals, from the same resamples.
fn median_and_interquartile_mean(values: &[f64]) -> [Estimate; 2] {
    let estimates =
        bootstrap_sorted_statistics(&[vec![values.to_vec()]], 2, |groups, statistics| {
            statistics[0] = median_of_sorted(&groups[0]);
            statistics[1] = interquartile_mean_of_sorted(&groups[0]);
        });
    [estimates[0], estimates[1]]
}

/// Compares the scores of two cells. `None` if a cell has no runs or, in a paired comparison, if
/// the cells have no run seed in common.
#[must_use]
pub fn compare(
    first: &[RunScore],
    second: &[RunScore],
    are_times: bool,
    test: Test,
) -> Option<Comparison> {
    let (first, second) = if test == Test::Paired {
        pairs_with_common_seeds(first, second)
    } else {
        (first.to_vec(), second.to_vec())
    };
    if first.is_empty() || second.is_empty() {
        return None;
    }
    let horizon = horizon(first.iter().chain(&second));
    let (x, y) = (
        values_censored_after(horizon, &first),
        values_censored_after(horizon, &second),
    );
    let (effect, p) = match test {
        Test::Paired => compare_pairs(&x, &y, are_times),
        Test::Independent => compare_samples([&first, &second], [&x, &y], are_times),
    };
    // Values are negated, because the probability of improvement is the probability of a higher
    // score.
    let probability_below = probability_of_improvement(&[negated(&x)], &[negated(&y)]);
    Some(Comparison {
        n: [x.len(), y.len()],
        effect: effect.estimate,
        effect_bounds: effect.bounds,
        probability_below,
        p,
        horizon,
    })
}

fn negated(values: &[f64]) -> Vec<f64> {
    values.iter().map(|value| -value).collect()
}

impl Comparison {
    /// Probability that a run of the first cell is above a run of the second. A tie counts half.
    #[must_use]
    pub fn probability_above(&self) -> Estimate {
        let interval = match self.probability_below.interval {
            Interval::Known { low, high } => Interval::Known {
                low: 1.0 - high,
                high: 1.0 - low,
            },
            too_few_runs @ Interval::TooFewRuns { .. } => too_few_runs,
        };
        Estimate {
            value: 1.0 - self.probability_below.value,
            interval,
        }
    }
}

fn pairs_with_common_seeds(
    first: &[RunScore],
    second: &[RunScore],
) -> (Vec<RunScore>, Vec<RunScore>) {
    let mut pairs = (Vec::new(), Vec::new());
    for score in first {
        if let Some(score_of_second) = second
            .iter()
            .find(|candidate| candidate.run_seed == score.run_seed)
        {
            pairs.0.push(*score);
            pairs.1.push(*score_of_second);
        }
    }
    pairs
}

/// Earliest end of a run that did not reach its time; infinite if all runs reached their times.
///
/// A run can fail to reach its time only because it had fewer episodes than other runs. So cells
/// are compared over the time during which all runs were observed.
fn horizon<'a>(scores: impl Iterator<Item = &'a RunScore>) -> f64 {
    let unreached = scores.filter(|score| score.value.is_infinite());
    unreached
        .map(|score| score.observed_until)
        .fold(f64::INFINITY, f64::min)
}

/// Values of scores, where times after the horizon are infinite (not reached).
fn values_censored_after(horizon: f64, scores: &[RunScore]) -> Vec<f64> {
    let mut values = Vec::with_capacity(scores.len());
    for score in scores {
        let is_within = score.value <= horizon;
        values.push(if is_within {
            score.value
        } else {
            f64::INFINITY
        });
    }
    values
}

/// An effect that may depend on unknown differences between times that were not reached.
struct Effect {
    estimate: Estimate,
    bounds: [f64; 2],
}

fn compare_pairs(x: &[f64], y: &[f64], are_times: bool) -> (Effect, f64) {
    let differences = differences(x, y);
    let effect = if are_times {
        bounded_effect([f64::NEG_INFINITY, f64::INFINITY].map(|unknown| {
            let pairs = x.iter().zip(y);
            let differences: Vec<f64> = pairs
                .map(|(&x, &y)| difference_of_times(x, y, unknown))
                .collect();
            bootstrap_median(differences)
        }))
    } else {
        let estimate = bootstrap_estimate(&differences, mean);
        Effect {
            estimate,
            bounds: [estimate.value; 2],
        }
    };
    (effect, signed_rank_test(&differences).p)
}

/// Difference of two times. If neither time was reached, either may be longer by any amount, so the
/// difference is the parameter `unknown`.
fn difference_of_times(x: f64, y: f64, unknown: f64) -> f64 {
    if x.is_infinite() && y.is_infinite() {
        unknown
    } else {
        x - y
    }
}

fn bootstrap_median(values: Vec<f64>) -> Estimate {
    bootstrap_sorted_statistics(&[vec![values]], 1, |groups, statistics| {
        statistics[0] = median_of_sorted(&groups[0]);
    })[0]
}

/// An effect that may depend on unknown differences, with bounds, from the estimates of the effect
/// if every unknown difference were −∞ and if every unknown difference were ∞.
///
/// Medians never decrease when one of their values increases. So these estimates are the smallest
/// and the largest that any unknown differences can give. The same holds for the ends of their
/// intervals, so the interval from the lower end for −∞ to the upper end for ∞ covers all cases. If
/// both estimates are equal, the effect does not depend on unknown differences; otherwise its value
/// is NaN.
fn bounded_effect([smallest, largest]: [Estimate; 2]) -> Effect {
    let interval = match (smallest.interval, largest.interval) {
        (Interval::Known { low, .. }, Interval::Known { high, .. }) => {
            Interval::Known { low, high }
        }
        (too_few_runs, _) => too_few_runs,
    };
    let is_known = smallest.value == largest.value;
    let value = if is_known { smallest.value } else { f64::NAN };
    Effect {
        estimate: Estimate { value, interval },
        bounds: [smallest.value, largest.value],
    }
}

fn compare_samples(
    scores: [&[RunScore]; 2],
    [x, y]: [&[f64]; 2],
    are_times: bool,
) -> (Effect, f64) {
    let effects = |[x, y]: [f64; 2], effects: &mut [f64]| {
        effects[0] = difference_of_times(x, y, f64::NEG_INFINITY);
        effects[1] = difference_of_times(x, y, f64::INFINITY);
    };
    let samples = [x.to_vec(), y.to_vec()];
    let estimates = if are_times {
        bootstrap_sorted_statistics(&samples.map(|sample| vec![sample]), 2, |groups, values| {
            effects([0, 1].map(|group| median_of_sorted(&groups[group])), values);
        })
    } else {
        bootstrap_statistics(&samples, 2, |samples, values| {
            effects([0, 1].map(|sample| mean(&samples[sample])), values);
        })
    };
    let effect = bounded_effect([estimates[0], estimates[1]]);
    // The log-rank test accounts for censoring itself, so it gets the times without the common
    // horizon.
    let p = if are_times {
        let [first, second] = scores.map(times_to_event);
        log_rank_test(&first, &second).map(|test| test.p)
    } else {
        welch_test(x, y).map(|test| test.p)
    };
    (effect, p.unwrap_or(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scores of times such as `10 50+`, where `50+` is a run that ended at 50 without reaching its
    /// time. Run seeds count from 0.
    fn times(text: &str) -> Vec<RunScore> {
        let score = |(run_seed, token): (usize, &str)| {
            let time = token.trim_end_matches('+').parse().unwrap();
            let (value, observed_until) = if token.ends_with('+') {
                (f64::INFINITY, time)
            } else {
                (time, f64::INFINITY)
            };
            RunScore {
                run_seed: run_seed as u64,
                value,
                observed_until,
            }
        };
        text.split_whitespace().enumerate().map(score).collect()
    }

    fn paired_times(first: &str, second: &str) -> Comparison {
        compare(&times(first), &times(second), true, Test::Paired).unwrap()
    }

    /// The differences −10, −20, −30, −40, −50 have median −30, and p = 2/2⁵ because all have the
    /// same sign. The first times 10, 20, 30, 40 and 50 are below 5, 4½, 4, 3½ and 3 of the second
    /// times, where a tie counts half: 20 of 25 pairs.
    #[test]
    fn paired_comparisons_use_differences_per_seed() {
        let comparison = paired_times("10 20 30 40 50", "20 40 60 80 100");
        assert_eq!(
            (
                comparison.effect.value,
                comparison.probability_below.value,
                comparison.p
            ),
            (-30.0, 0.8, 0.0625)
        );
        let Interval::Known { low, high } = comparison.effect.interval else {
            panic!("five pairs are enough for an interval")
        };
        assert!(
            (-50.0..-30.0).contains(&low) && (-30.0..=-10.0).contains(&high),
            "{low} to {high}"
        );
        assert!((comparison.probability_above().value - 0.2).abs() < 1e-15);
    }

    /// All runs of the second cell ended after 50 episodes without solving the task. The runs of
    /// the first cell solved it after 80 or 90 episodes, so they had not solved it after 50
    /// episodes either.
    #[test]
    fn times_after_the_shortest_run_count_as_not_reached() {
        let all_unknown = paired_times("80 90 80 90 80", "50+ 50+ 50+ 50+ 50+");
        assert!(
            all_unknown.effect.value.is_nan(),
            "differences after 50 episodes are unknown"
        );
        assert_eq!(
            all_unknown.effect.interval,
            Interval::Known {
                low: f64::NEG_INFINITY,
                high: f64::INFINITY
            }
        );
        assert_eq!(
            (
                all_unknown.probability_below.value,
                all_unknown.p,
                all_unknown.horizon
            ),
            (0.5, 1.0, 50.0)
        );
        let known_and_unknown = paired_times("30 30 30 30 80", "50+ 50+ 50+ 50+ 50+");
        assert_eq!(
            (
                known_and_unknown.effect.value,
                known_and_unknown.probability_below.value
            ),
            (f64::NEG_INFINITY, 0.9)
        );
    }

    /// With four differences of −10 and one unknown difference, the median is −10, but its interval
    /// is infinite, because a resample may contain the unknown difference three times. In an
    /// independent comparison neither median is reached, so the effect is unknown.
    #[test]
    fn differences_between_times_that_were_not_reached_are_unknown() {
        let one_unknown = paired_times("10 10 10 10 50+", "20 20 20 20 50+");
        assert_eq!(one_unknown.effect.value, -10.0);
        assert_eq!(
            one_unknown.effect.interval,
            Interval::Known {
                low: f64::NEG_INFINITY,
                high: f64::INFINITY
            }
        );
        // The median of the differences −9, −8, −7, −6, −5 and an unknown difference is −7.5 if the
        // unknown difference is −∞, and −6.5 if it is ∞.
        let even_number_of_pairs = paired_times("10 10 10 10 10 50+", "15 16 17 18 19 50+");
        assert!(
            even_number_of_pairs.effect.value.is_nan()
                && even_number_of_pairs.effect_bounds == [-7.5, -6.5],
            "{even_number_of_pairs:?}"
        );
        let scores = (times("10 50+ 50+ 50+ 50+"), times("50+ 50+ 50+ 50+ 50+"));
        let independent = compare(&scores.0, &scores.1, true, Test::Independent).unwrap();
        assert!(
            independent.effect.value.is_nan() && is_unbounded(independent.effect.interval),
            "{independent:?}"
        );
    }

    fn is_unbounded(interval: Interval) -> bool {
        interval
            == Interval::Known {
                low: f64::NEG_INFINITY,
                high: f64::INFINITY,
            }
    }

    /// The common run seeds are 1 and 2: the mean of 20 − 4 and 30 − 6 is 20. The independent
    /// comparison uses all runs: 20 − 5 = 15.
    #[test]
    fn paired_comparisons_use_common_seeds() {
        let scores = |first: u64, values: &[f64]| -> Vec<RunScore> {
            (first..)
                .zip(values)
                .map(|(run_seed, &value)| RunScore {
                    run_seed,
                    value,
                    observed_until: f64::INFINITY,
                })
                .collect()
        };
        let (first, second) = (scores(0, &[10.0, 20.0, 30.0]), scores(1, &[4.0, 6.0]));
        let paired = compare(&first, &second, false, Test::Paired).unwrap();
        assert_eq!((paired.n, paired.effect.value), ([2, 2], 20.0));
        let independent = compare(&first, &second, false, Test::Independent).unwrap();
        assert_eq!((independent.n, independent.effect.value), ([3, 2], 15.0));
        assert_eq!(
            compare(&first, &scores(7, &[1.0]), false, Test::Paired),
            None
        );
    }

    /// Two of five runs reached their time, so the median is infinite and there is no interquartile
    /// mean.
    #[test]
    fn the_aggregate_of_times_censors_runs_that_did_not_reach_them() {
        let aggregate = summarize_scores(&times("10 20 50+ 50+ 50+"), true).unwrap();
        assert_eq!(
            (aggregate.n, aggregate.reached, aggregate.median.value),
            (5, 2, f64::INFINITY)
        );
        assert_eq!(
            (aggregate.interquartile_mean, aggregate.range),
            (None, [10.0, f64::INFINITY])
        );
    }
}
