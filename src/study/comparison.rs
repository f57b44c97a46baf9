//! Two settings against each other: how far apart their runs lie, how sure that is, and who is ahead how often.

use super::file::Test;
use super::measure::Measure;
use super::measured::Measured;
use super::statistics::aggregate::{interquartile_mean, mean, median};
use super::statistics::comparison::welch;
use super::statistics::improvement::probability_of_improvement;
use super::statistics::paired::{differences, signed_rank};
use super::statistics::survival::{Lifetime, kaplan_meier, log_rank};
use super::statistics::{Estimate, Interval, estimate, estimate_of_sample};

/// A measure of one run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// The run's seed.
    pub seed: u64,
    /// The number; infinite for a time that was not reached.
    pub value: f64,
    /// Up to when a run that did not get there was watched; infinite for all that is known.
    pub watched: f64,
}

/// What the runs of one setting come to in one measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aggregate {
    /// Runs.
    pub n: usize,
    /// Of these, how many got there; all, where the measure is no time.
    pub reached: usize,
    /// The median; of times Kaplan and Meier's, infinite where fewer than half got there.
    pub median: Estimate,
    /// The mean of the middle half; none where a run did not get there.
    pub interquartile_mean: Option<Estimate>,
    /// The least and the most.
    pub range: [f64; 2],
}

/// One setting against another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Runs of the first and of the second, or pairs twice.
    pub n: [usize; 2],
    /// The first less the second: the median of times, the mean of all else.
    pub effect: Estimate,
    /// From where to where the effect may lie where times that were not reached decide it; else both are the effect.
    pub between: [f64; 2],
    /// How likely a run of the first is below one of the second; a tie counts half.
    pub below: Estimate,
    /// The two-sided p of the test.
    pub p: f64,
    /// Times were compared up to here, because from here on not all runs were watched.
    pub horizon: f64,
}

impl Score {
    /// A measure of a run, if the run can tell it.
    #[must_use]
    pub fn of(measure: Measure, seed: u64, run: &Measured) -> Option<Self> {
        let value = measure.of(run)?;
        let lifetime = measure.is_time().then(|| measure.lifetime(run)).flatten();
        let watched = lifetime
            .filter(|lifetime| !lifetime.reached)
            .map_or(f64::INFINITY, |lifetime| lifetime.time);
        Some(Self {
            seed,
            value,
            watched,
        })
    }

    fn lifetime(self) -> Lifetime {
        let reached = self.value.is_finite();
        Lifetime {
            time: if reached { self.value } else { self.watched },
            reached,
        }
    }
}

/// Times of runs, censored where they did not get there.
#[must_use]
pub fn lifetimes(scores: &[Score]) -> Vec<Lifetime> {
    scores.iter().map(|score| score.lifetime()).collect()
}

/// What scores come to; `are_times` says that infinite ones are censored. `None` without scores.
#[must_use]
pub fn aggregate(scores: &[Score], are_times: bool) -> Option<Aggregate> {
    let values: Vec<f64> = scores.iter().map(|score| score.value).collect();
    let reached = values.iter().filter(|value| value.is_finite()).count();
    let range = values
        .iter()
        .fold(None, |range: Option<[f64; 2]>, &value| {
            Some(range.map_or([value; 2], |[low, high]| [low.min(value), high.max(value)]))
        })?;
    let middle = if are_times {
        let curve = kaplan_meier(&lifetimes(scores));
        Estimate {
            value: curve.median().unwrap_or(f64::INFINITY),
            interval: curve.median_interval(),
        }
    } else {
        estimate_of_sample(&values, median)
    };
    let complete = reached == values.len();
    let interquartile_mean = complete.then(|| estimate_of_sample(&values, interquartile_mean));
    Some(Aggregate {
        n: values.len(),
        reached,
        median: middle,
        interquartile_mean,
        range,
    })
}

/// Compares two settings. `None` where one has no runs, or no seed is common to both and pairs are asked for.
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
    let (x, y) = (up_to(horizon, &first), up_to(horizon, &second));
    let ((effect, between), p) = match test {
        Test::Paired => paired(&x, &y, are_times),
        Test::Independent => independent([&first, &second], [&x, &y], are_times),
    };
    let negated = |values: &[f64]| vec![values.iter().map(|value| -value).collect::<Vec<f64>>()];
    let below = probability_of_improvement(&negated(&x), &negated(&y));
    Some(Comparison {
        n: [x.len(), y.len()],
        effect,
        between,
        below,
        p,
        horizon,
    })
}

impl Comparison {
    /// How likely a run of the first is above one of the second; a tie counts half.
    #[must_use]
    pub fn above(&self) -> Estimate {
        let interval = match self.below.interval {
            Interval::Known { low, high } => Interval::Known {
                low: 1.0 - high,
                high: 1.0 - low,
            },
            few @ Interval::TooFewRuns { .. } => few,
        };
        Estimate {
            value: 1.0 - self.below.value,
            interval,
        }
    }
}

fn common_seeds(first: &[Score], second: &[Score]) -> (Vec<Score>, Vec<Score>) {
    let partner = |score: &Score| {
        second
            .iter()
            .find(|other| other.seed == score.seed)
            .map(|other| (*score, *other))
    };
    first.iter().filter_map(partner).unzip()
}

/// A run that was given fewer episodes may not have got there for that reason alone. So both settings are judged by the time of which
/// everything is known: up to the end of the first run that did not get there.
fn horizon<'a>(scores: impl Iterator<Item = &'a Score>) -> f64 {
    scores
        .filter(|score| score.value.is_infinite())
        .map(|score| score.watched)
        .fold(f64::INFINITY, f64::min)
}

fn up_to(horizon: f64, scores: &[Score]) -> Vec<f64> {
    scores
        .iter()
        .map(|score| {
            if score.value <= horizon {
                score.value
            } else {
                f64::INFINITY
            }
        })
        .collect()
}

fn paired(x: &[f64], y: &[f64], are_times: bool) -> ((Estimate, [f64; 2]), f64) {
    let differences = differences(x, y);
    let effect = if are_times {
        let assuming = |unknown: f64| {
            x.iter()
                .zip(y)
                .map(|(&x, &y)| difference_of_times(x, y, unknown))
                .collect::<Vec<f64>>()
        };
        whatever_is_unknown(|unknown| estimate_of_sample(&assuming(unknown), median))
    } else {
        let effect = estimate_of_sample(&differences, mean);
        (effect, [effect.value; 2])
    };
    (effect, signed_rank(&differences).p)
}

/// Of two times that were both not reached nobody knows which is the longer.
fn difference_of_times(x: f64, y: f64, unknown: f64) -> f64 {
    if x.is_infinite() && y.is_infinite() {
        unknown
    } else {
        x - y
    }
}

/// An estimate whose interval holds whatever unknown differences are, from −∞ to ∞; no number where that decides. And what it lies between.
fn whatever_is_unknown(assuming: impl Fn(f64) -> Estimate) -> (Estimate, [f64; 2]) {
    let (least, most) = (assuming(f64::NEG_INFINITY), assuming(f64::INFINITY));
    let interval = match (least.interval, most.interval) {
        (Interval::Known { low, .. }, Interval::Known { high, .. }) => {
            Interval::Known { low, high }
        }
        (few, _) => few,
    };
    let value = if least.value == most.value {
        least.value
    } else {
        f64::NAN
    };
    (Estimate { value, interval }, [least.value, most.value])
}

fn independent(
    scores: [&[Score]; 2],
    [x, y]: [&[f64]; 2],
    are_times: bool,
) -> ((Estimate, [f64; 2]), f64) {
    let middle = if are_times { median } else { mean };
    let effect = whatever_is_unknown(|unknown| {
        estimate(&[x.to_vec(), y.to_vec()], |both| {
            difference_of_times(middle(&both[0]), middle(&both[1]), unknown)
        })
    });
    let p = if are_times {
        let [first, second] = scores.map(lifetimes);
        log_rank(&first, &second).map(|test| test.p)
    } else {
        welch(x, y).map(|test| test.p)
    };
    (effect, p.unwrap_or(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times; a `+` marks a run that did not get there. Seeds count from 0.
    fn times(words: &str) -> Vec<Score> {
        let score = |(seed, word): (usize, &str)| {
            let time = word.trim_end_matches('+').parse().unwrap();
            let (value, watched) = if word.ends_with('+') {
                (f64::INFINITY, time)
            } else {
                (time, f64::INFINITY)
            };
            Score {
                seed: seed as u64,
                value,
                watched,
            }
        };
        words.split_whitespace().enumerate().map(score).collect()
    }

    fn paired_times(first: &str, second: &str) -> Comparison {
        compare(&times(first), &times(second), true, Test::Paired).unwrap()
    }

    /// Differences −10, −20, −30, −40, −50 have median −30; all of one sign has p = 2/2⁵. Of the 25 pairs 10 beats five of 20 to
    /// 100 and so on: each of 10, 20, 30, 40, 50 is below 5, 4½, 4, 3½, 3 of them, which makes 20 in 25.
    #[test]
    fn pairs_are_compared_seed_by_seed() {
        let comparison = paired_times("10 20 30 40 50", "20 40 60 80 100");
        assert_eq!(
            (
                comparison.effect.value,
                comparison.below.value,
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
        assert!((comparison.above().value - 0.2).abs() < 1e-15);
    }

    /// Of the second nothing is known after 50 episodes, when it was not solved yet; the first took 80 or 90 and was not either.
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
        assert_eq!((open.below.value, open.p, open.horizon), (0.5, 1.0, 50.0));
        let won = paired_times("30 30 30 30 80", "50+ 50+ 50+ 50+ 50+");
        assert_eq!(
            (won.effect.value, won.below.value),
            (f64::NEG_INFINITY, 0.9)
        );
    }

    /// Four known differences of −10 and one unknown: the median is −10 whatever it is, though redrawn samples may hold it three times.
    /// As two samples, both medians are not reached: nothing is known.
    #[test]
    fn two_times_that_were_not_reached_differ_by_nobody_knows_what() {
        let mostly = paired_times("10 10 10 10 50+", "20 20 20 20 50+");
        assert_eq!(mostly.effect.value, -10.0);
        assert_eq!(
            mostly.effect.interval,
            Interval::Known {
                low: f64::NEG_INFINITY,
                high: f64::INFINITY
            }
        );
        // Of six differences −9 to −5 and one unknown the median lies halfway to its neighbour on the one or on the other side.
        let even = paired_times("10 10 10 10 10 50+", "15 16 17 18 19 50+");
        assert!(
            even.effect.value.is_nan() && even.between == [-7.5, -6.5],
            "{even:?}"
        );
        let scores = (times("10 50+ 50+ 50+ 50+"), times("50+ 50+ 50+ 50+ 50+"));
        let samples = compare(&scores.0, &scores.1, true, Test::Independent).unwrap();
        assert!(
            samples.effect.value.is_nan() && verdict_is_open(samples.effect.interval),
            "{samples:?}"
        );
    }

    fn verdict_is_open(interval: Interval) -> bool {
        interval
            == Interval::Known {
                low: f64::NEG_INFINITY,
                high: f64::INFINITY,
            }
    }

    /// Seeds 1 and 2 are common: 20 − 4 and 30 − 6 have mean 20. As two samples all three and both count: 20 − 5.
    #[test]
    fn pairs_take_common_seeds_alone() {
        let scores = |first: u64, values: &[f64]| -> Vec<Score> {
            (first..)
                .zip(values)
                .map(|(seed, &value)| Score {
                    seed,
                    value,
                    watched: f64::INFINITY,
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

    /// Two of five got there: the median is unknown, and so is a mean of the middle.
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
