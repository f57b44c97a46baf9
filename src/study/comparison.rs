//! Comparison of two settings: how far apart their runs are, how certain that is, and how often a
//! run of one is ahead of a run of the other.

use super::file::Test;
use super::measure::Measure;
use super::run_result::RunResult;
use seedbed_stats::aggregate::{interquartile_mean, mean, median};
use seedbed_stats::hypothesis::welch_test;
use seedbed_stats::improvement::probability_of_improvement;
use seedbed_stats::paired::{differences, signed_rank_test};
use seedbed_stats::survival::{TimeToEvent, kaplan_meier, log_rank_test};
use seedbed_stats::{Estimate, Interval, bootstrap_sample, bootstrap_strata};

/// A measure of one run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Seed of the run.
    pub seed: u64,
    /// Value; infinite for a time that was not reached.
    pub value: f64,
    /// End of a run that did not reach the time; infinite if the value is known.
    pub observed_until: f64,
}

/// Summary of the runs of one setting in one measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aggregate {
    /// Number of runs.
    pub n: usize,
    /// Number of runs that reached the time; all, if the measure is not a time.
    pub reached: usize,
    /// Median; of times the Kaplan–Meier median, infinite if fewer than half of the runs reached it.
    pub median: Estimate,
    /// Interquartile mean; `None` if a run did not reach the time.
    pub interquartile_mean: Option<Estimate>,
    /// Min and max.
    pub range: [f64; 2],
}

/// One setting against another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Number of runs of the first and of the second setting; of pairs, the number of pairs twice.
    pub n: [usize; 2],
    /// Effect: the first less the second. Medians of times, means of all other measures. Not a
    /// number if it depends on times that were not reached.
    pub effect: Estimate,
    /// Smallest and largest value that the effect can have, whatever the times that were not
    /// reached are; twice the effect if it does not depend on them.
    pub effect_bounds: [f64; 2],
    /// Probability that a run of the first is below a run of the second; a tie counts half.
    pub probability_below: Estimate,
    /// Two-sided p-value of the test.
    pub p: f64,
    /// Time up to which all runs were observed. Later times count as not reached.
    pub horizon: f64,
}

impl Score {
    /// A measure of a run; `None` if the run does not have it.
    #[must_use]
    pub fn of(measure: Measure, seed: u64, run: &RunResult) -> Option<Self> {
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
            seed,
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

/// Times of runs, censored if they were not reached.
#[must_use]
pub fn times_to_event(scores: &[Score]) -> Vec<TimeToEvent> {
    scores.iter().map(|score| score.time_to_event()).collect()
}

/// Summary of scores. With `are_times`, infinite ones are censored. `None` without scores.
#[must_use]
pub fn aggregate(scores: &[Score], are_times: bool) -> Option<Aggregate> {
    let values: Vec<f64> = scores.iter().map(|score| score.value).collect();
    if values.is_empty() {
        return None;
    }
    let reached = values.iter().filter(|value| value.is_finite()).count();
    let median = if are_times {
        let curve = kaplan_meier(&times_to_event(scores));
        Estimate {
            value: curve.median().unwrap_or(f64::INFINITY),
            interval: curve.median_interval(),
        }
    } else {
        bootstrap_sample(&values, median)
    };
    let all_reached = reached == values.len();
    let interquartile_mean = all_reached.then(|| bootstrap_sample(&values, interquartile_mean));
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

/// Compares two settings. `None` if one has no runs or, in a paired comparison, if they have no seed
/// in common.
#[must_use]
pub fn compare(
    first: &[Score],
    second: &[Score],
    are_times: bool,
    test: Test,
) -> Option<Comparison> {
    let (first, second) = if test == Test::Paired {
        common_seeds(first, second)
    } else {
        (first.to_vec(), second.to_vec())
    };
    if first.is_empty() || second.is_empty() {
        return None;
    }
    let horizon = horizon(first.iter().chain(&second));
    let (x, y) = (censored_at(horizon, &first), censored_at(horizon, &second));
    let (effect, p) = match test {
        Test::Paired => compare_pairs(&x, &y, are_times),
        Test::Independent => compare_samples([&first, &second], [&x, &y], are_times),
    };
    // The probability of improvement counts higher scores as better: lower ones, negated.
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
    /// Probability that a run of the first is above a run of the second; a tie counts half.
    #[must_use]
    pub fn probability_above(&self) -> Estimate {
        let interval = match self.probability_below.interval {
            Interval::Known { low, high } => Interval::Known {
                low: 1.0 - high,
                high: 1.0 - low,
            },
            few @ Interval::TooFewRuns { .. } => few,
        };
        Estimate {
            value: 1.0 - self.probability_below.value,
            interval,
        }
    }
}

fn common_seeds(first: &[Score], second: &[Score]) -> (Vec<Score>, Vec<Score>) {
    let mut pairs = (Vec::new(), Vec::new());
    for score in first {
        if let Some(partner) = second.iter().find(|other| other.seed == score.seed) {
            pairs.0.push(*score);
            pairs.1.push(*partner);
        }
    }
    pairs
}

/// End of the first run that did not reach its time.
///
/// A run that was given fewer episodes may have missed the time for that reason alone. So both
/// settings are compared over the time during which all runs were observed.
fn horizon<'a>(scores: impl Iterator<Item = &'a Score>) -> f64 {
    let missed = scores.filter(|score| score.value.is_infinite());
    missed
        .map(|score| score.observed_until)
        .fold(f64::INFINITY, f64::min)
}

/// Values of scores; times after the horizon count as not reached.
fn censored_at(horizon: f64, scores: &[Score]) -> Vec<f64> {
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

/// An effect that may depend on differences between times that were not reached.
struct Effect {
    estimate: Estimate,
    bounds: [f64; 2],
}

fn compare_pairs(x: &[f64], y: &[f64], are_times: bool) -> (Effect, f64) {
    let differences = differences(x, y);
    let effect = if are_times {
        bound_by_unknown(|unknown| {
            let pairs = x.iter().zip(y);
            let differences: Vec<f64> = pairs
                .map(|(&x, &y)| difference_of_times(x, y, unknown))
                .collect();
            bootstrap_sample(&differences, median)
        })
    } else {
        let estimate = bootstrap_sample(&differences, mean);
        Effect {
            estimate,
            bounds: [estimate.value; 2],
        }
    };
    (effect, signed_rank_test(&differences).p)
}

/// Difference of two times. If neither was reached, either may be the longer one by any amount:
/// their difference is `unknown`.
fn difference_of_times(x: f64, y: f64, unknown: f64) -> f64 {
    if x.is_infinite() && y.is_infinite() {
        unknown
    } else {
        x - y
    }
}

/// Bounds an effect that depends on unknown differences.
///
/// `assuming(d)` estimates the effect if every unknown difference were `d`. Medians never decrease
/// when one of their values increases. So the estimates for d = −∞ and d = ∞ are the smallest and
/// the largest that any unknown differences can give, and so are the ends of their intervals: from
/// the lower end for −∞ to the upper end for ∞ the interval covers all cases. If both estimates are
/// equal, the effect does not depend on what is unknown; otherwise its value is not a number.
fn bound_by_unknown(assuming: impl Fn(f64) -> Estimate) -> Effect {
    let (smallest, largest) = (assuming(f64::NEG_INFINITY), assuming(f64::INFINITY));
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

fn compare_samples(scores: [&[Score]; 2], [x, y]: [&[f64]; 2], are_times: bool) -> (Effect, f64) {
    let center = if are_times { median } else { mean };
    let samples = [x.to_vec(), y.to_vec()];
    let effect = bound_by_unknown(|unknown| {
        bootstrap_strata(&samples, |samples| {
            difference_of_times(center(&samples[0]), center(&samples[1]), unknown)
        })
    });
    // The log-rank test treats censored times itself, so it takes them without the common horizon.
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

    /// Times; a `+` marks a run that ended then without reaching it. Seeds count from 0.
    fn times(words: &str) -> Vec<Score> {
        let score = |(seed, word): (usize, &str)| {
            let time = word.trim_end_matches('+').parse().unwrap();
            let (value, observed_until) = if word.ends_with('+') {
                (f64::INFINITY, time)
            } else {
                (time, f64::INFINITY)
            };
            Score {
                seed: seed as u64,
                value,
                observed_until,
            }
        };
        words.split_whitespace().enumerate().map(score).collect()
    }

    fn paired_times(first: &str, second: &str) -> Comparison {
        compare(&times(first), &times(second), true, Test::Paired).unwrap()
    }

    /// Differences −10, −20, −30, −40, −50 have median −30; all of one sign has p = 2/2⁵. Of the 25
    /// pairs 10 beats five of 20 to 100 and so on: each of 10, 20, 30, 40, 50 is below 5, 4½, 4,
    /// 3½, 3 of them, which makes 20 in 25.
    #[test]
    fn pairs_are_compared_seed_by_seed() {
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
            panic!("five are enough")
        };
        assert!(
            (-50.0..-30.0).contains(&low) && (-30.0..=-10.0).contains(&high),
            "{low} to {high}"
        );
        assert!((comparison.probability_above().value - 0.2).abs() < 1e-15);
    }

    /// The second was not solved when it ended after 50 episodes. The first took 80 or 90, so it was
    /// not solved then either.
    #[test]
    fn a_run_with_fewer_episodes_does_not_lose_for_that() {
        let open = paired_times("80 90 80 90 80", "50+ 50+ 50+ 50+ 50+");
        assert!(
            open.effect.value.is_nan(),
            "nothing is known after 50 episodes"
        );
        assert_eq!(
            open.effect.interval,
            Interval::Known {
                low: f64::NEG_INFINITY,
                high: f64::INFINITY
            }
        );
        assert_eq!(
            (open.probability_below.value, open.p, open.horizon),
            (0.5, 1.0, 50.0)
        );
        let won = paired_times("30 30 30 30 80", "50+ 50+ 50+ 50+ 50+");
        assert_eq!(
            (won.effect.value, won.probability_below.value),
            (f64::NEG_INFINITY, 0.9)
        );
    }

    /// Four known differences of −10 and one unknown: the median is −10 whatever it is, but
    /// resamples may contain it three times. As two samples, both medians are not reached: nothing
    /// is known.
    #[test]
    fn the_difference_of_two_times_that_were_not_reached_is_unknown() {
        let mostly = paired_times("10 10 10 10 50+", "20 20 20 20 50+");
        assert_eq!(mostly.effect.value, -10.0);
        assert_eq!(
            mostly.effect.interval,
            Interval::Known {
                low: f64::NEG_INFINITY,
                high: f64::INFINITY
            }
        );
        // Of six differences −9 to −5 and one unknown the median lies halfway to its neighbour on
        // the one or on the other side.
        let even = paired_times("10 10 10 10 10 50+", "15 16 17 18 19 50+");
        assert!(
            even.effect.value.is_nan() && even.effect_bounds == [-7.5, -6.5],
            "{even:?}"
        );
        let scores = (times("10 50+ 50+ 50+ 50+"), times("50+ 50+ 50+ 50+ 50+"));
        let samples = compare(&scores.0, &scores.1, true, Test::Independent).unwrap();
        assert!(
            samples.effect.value.is_nan() && is_unbounded(samples.effect.interval),
            "{samples:?}"
        );
    }

    fn is_unbounded(interval: Interval) -> bool {
        interval
            == Interval::Known {
                low: f64::NEG_INFINITY,
                high: f64::INFINITY,
            }
    }

    /// Seeds 1 and 2 are common: 20 − 4 and 30 − 6 have mean 20. As two samples, all three and both
    /// count: 20 − 5.
    #[test]
    fn pairs_have_seeds_in_common() {
        let scores = |first: u64, values: &[f64]| -> Vec<Score> {
            (first..)
                .zip(values)
                .map(|(seed, &value)| Score {
                    seed,
                    value,
                    observed_until: f64::INFINITY,
                })
                .collect()
        };
        let (first, second) = (scores(0, &[10.0, 20.0, 30.0]), scores(1, &[4.0, 6.0]));
        let pairs = compare(&first, &second, false, Test::Paired).unwrap();
        assert_eq!((pairs.n, pairs.effect.value), ([2, 2], 20.0));
        let samples = compare(&first, &second, false, Test::Independent).unwrap();
        assert_eq!((samples.n, samples.effect.value), ([3, 2], 15.0));
        assert_eq!(
            compare(&first, &scores(7, &[1.0]), false, Test::Paired),
            None
        );
    }

    /// Two of five reached it: the median is unknown, and so is the interquartile mean.
    #[test]
    fn times_that_were_not_reached_are_censored() {
        let aggregate = aggregate(&times("10 20 50+ 50+ 50+"), true).unwrap();
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
