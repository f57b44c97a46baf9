//! Comparison of two cells in one measure: effect with its test and interval, and probability that a
//! run of one cell is below a run of the other.
//!
//! Each kind of measure has one effect and one test: see [`rules`](super::rules).

use super::rules::{Pairing, Quantity, Rule, share_of_successes};
use super::score::{RunScore, times_to_event};
use super::ties::with_equal_ties;
use crate::experiment::measure::Measure;
use seedbed_stats::aggregate::{mean, median};
use seedbed_stats::bootstrap::bootstrap_mean_and_interquartile_mean;
use seedbed_stats::effect_test::{EffectTest, OfRange, Opposite, lower_bound, upper_bound};
use seedbed_stats::family::FAMILY_LEVEL;
use seedbed_stats::improvement::win_probability;
use seedbed_stats::shares::wilson_interval;
use seedbed_stats::survival::kaplan_meier;
use seedbed_stats::{Estimate, Interval, MIN_RUNS};

/// Summary of the runs of one cell in one measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aggregate {
    /// Number of runs.
    pub n: usize,
    /// Number of runs that reached the time. Equals `n` if the measure is not a time.
    pub reached: usize,
    /// Share of runs with the value 1, with Wilson's interval; of times the Kaplan–Meier median,
    /// infinite if the survival curve never falls below ½; of other measures the mean.
    pub center: Estimate,
    /// Median; of times, runs that did not reach them count as infinite.
    pub median: f64,
    /// Interquartile mean; `None` of shares, and if a run did not reach the time.
    pub interquartile_mean: Option<Estimate>,
    /// Minimum and maximum.
    pub range: [f64; 2],
}

/// Values of the runs of two cells that are compared.
#[derive(Clone, Debug, PartialEq)]
pub struct Samples {
    quantity: Quantity,
    /// Values of the first and of the second cell. If paired, equal indices are equal run seeds.
    values: [Values; 2],
    pairing: Pairing,
    /// Whether the second cell is tested against the first, and the result is reversed.
    is_reversed: bool,
}

/// Values of runs that are compared.
#[derive(Clone, Debug, PartialEq)]
struct Values {
    /// Smallest possible values: `[runs]`
    least: Vec<f64>,
    /// Largest possible values: `[runs]`. They differ from the smallest in times of runs that ended
    /// early.
    most: Vec<f64>,
}

/// Comparison of a first with a second cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Number of runs of the first and of the second cell. In a paired comparison both are the
    /// number of pairs.
    pub n: [usize; 2],
    /// Means or shares of the first and of the second cell; if only ranges are known, their middles.
    pub values: [f64; 2],
    /// Number of episodes or steps up to which times are compared; infinite for other measures.
    pub horizon: f64,
    /// Number of runs of the first and of the second cell of which the value is not known, because they ended
    /// early without reaching the time that is compared, or without solving their task.
    pub ended_early: [usize; 2],
    /// Effect: first minus second. Its interval is the 95 % interval of a single comparison.
    pub effect: Estimate,
    /// Probability that a run of the first cell is below a run of the second. A tie counts half.
    pub probability_below: Estimate,
    /// Whether all runs of both cells have the same value, so that nothing is compared.
    pub is_constant: bool,
}

/// Summarizes scores of a measure. Infinite times are censored. `None` without scores.
#[must_use]
pub fn summarize_scores(scores: &[RunScore], measure: Measure) -> Option<Aggregate> {
    let values: Vec<f64> = scores.iter().map(|score| score.value).collect();
    if values.is_empty() {
        return None;
    }
    let reached = values.iter().filter(|value| value.is_finite()).count();
    let all_reached = reached == values.len();
    let (center, interquartile_mean) = match Quantity::of(measure, f64::INFINITY) {
        Quantity::Share => (share_with_interval(scores), None),
        Quantity::RestrictedMeanTime { .. } => {
            let iqm = || bootstrap_mean_and_interquartile_mean(&values)[1];
            (median_time(scores), all_reached.then(iqm))
        }
        Quantity::Mean => {
            let [mean, interquartile_mean] = bootstrap_mean_and_interquartile_mean(&values);
            (mean, Some(interquartile_mean))
        }
    };
    Some(Aggregate {
        n: values.len(),
        reached,
        center,
        median: median(&values),
        interquartile_mean,
        range: [
            values.iter().copied().fold(values[0], f64::min),
            values.iter().copied().fold(values[0], f64::max),
        ],
    })
}

/// Share of runs with the value 1, with Wilson's interval; if only a range is known, its middle, with the interval
/// of all that is possible.
fn share_with_interval(scores: &[RunScore]) -> Estimate {
    let values = Values::of(scores, Quantity::Share);
    hull([&values.least, &values.most].map(|values| {
        let share = share_of_successes(values);
        Estimate {
            value: share.value(),
            interval: wilson_interval(share),
        }
    }))
}

/// Kaplan–Meier median with its interval.
fn median_time(scores: &[RunScore]) -> Estimate {
    let curve = kaplan_meier(&times_to_event(scores));
    Estimate {
        value: curve.median().unwrap_or(f64::INFINITY),
        interval: curve.median_interval(),
    }
}

impl Values {
    fn of(scores: &[RunScore], quantity: Quantity) -> Self {
        let ranges = scores.iter().map(|score| quantity.range(*score));
        let (least, most) = ranges.map(|[least, most]| (least, most)).unzip();
        Self { least, most }
    }

    /// The mean; the middle of the possible ones if it is not known.
    fn mean(&self) -> f64 {
        f64::midpoint(mean(&self.least), mean(&self.most))
    }

    /// Number of values of which only a range is known.
    fn unknown(&self) -> usize {
        let pairs = self.least.iter().zip(&self.most);
        pairs.filter(|(least, most)| least != most).count()
    }

    fn all(&self) -> impl Iterator<Item = f64> {
        self.least.iter().chain(&self.most).copied()
    }
}

impl Samples {
    /// The runs of two cells. If `paired`, only those with a run seed that both cells have. `None`
    /// if a cell has none.
    #[must_use]
    pub fn new(
        first: &[RunScore],
        second: &[RunScore],
        quantity: Quantity,
        paired: bool,
    ) -> Option<Self> {
        let pairing = if paired {
            Pairing::ByRunSeed
        } else {
            Pairing::Independent
        };
        Self::with_pairing(first, second, quantity, pairing)
    }

    fn with_pairing(
        first: &[RunScore],
        second: &[RunScore],
        quantity: Quantity,
        pairing: Pairing,
    ) -> Option<Self> {
        let values = if pairing == Pairing::Independent {
            [first.to_vec(), second.to_vec()]
        } else {
            pairs_with_common_seeds(first, second)
        };
        let values = with_equal_ties(values).map(|scores| Values::of(&scores, quantity));
        let is_complete = values.iter().all(|values| !values.most.is_empty());
        is_complete.then_some(Self {
            quantity,
            values,
            pairing,
            is_reversed: false,
        })
    }

    /// The runs of a cell, which are compared with a number. `None` if there are none.
    #[must_use]
    pub fn against(scores: &[RunScore], number: f64, quantity: Quantity) -> Option<Self> {
        let score_of_number = |score: &RunScore| RunScore {
            run_seed: score.run_seed,
            value: number,
            observed_until: f64::INFINITY,
            magnitude: number.abs(),
        };
        let numbers: Vec<RunScore> = scores.iter().map(score_of_number).collect();
        Self::with_pairing(scores, &numbers, quantity, Pairing::WithNumber)
    }

    /// Like [`new`](Self::new), but tested as the comparison of the second with the first cell if
    /// `is_reversed`: see [`reversed`](Self::reversed).
    #[must_use]
    pub fn in_direction(
        is_reversed: bool,
        first: &[RunScore],
        second: &[RunScore],
        quantity: Quantity,
        paired: bool,
    ) -> Option<Self> {
        if is_reversed {
            return Self::new(second, first, quantity, paired).map(Self::reversed);
        }
        Self::new(first, second, quantity, paired)
    }

    /// The comparison of the second with the first cell, whose effect and interval are exactly those
    /// of the comparison of the first with the second with the opposite sign. Tests draw permutations
    /// at random, so that a test of its own would have another interval.
    #[must_use]
    pub fn reversed(mut self) -> Self {
        self.values.swap(0, 1);
        self.is_reversed = !self.is_reversed;
        self
    }

    /// The samples in the order in which they are tested.
    fn tested(&self) -> [&Values; 2] {
        let [first, second] = &self.values;
        if self.is_reversed {
            [second, first]
        } else {
            [first, second]
        }
    }

    /// Number of runs of the first and of the second cell.
    #[must_use]
    pub fn n(&self) -> [usize; 2] {
        [0, 1].map(|cell| self.values[cell].most.len())
    }

    /// The test of the effect. If only ranges of values are known, its bounds hold for all that is
    /// possible.
    #[must_use]
    pub fn test(&self) -> Box<dyn EffectTest> {
        let [first, second] = self.tested();
        let test = if first.unknown() + second.unknown() == 0 {
            self.test_of(&first.most, &second.most)
        } else {
            Box::new(OfRange {
                smallest: self.test_of(&first.least, &second.most),
                largest: self.test_of(&first.most, &second.least),
            })
        };
        if self.is_reversed {
            Box::new(Opposite(test))
        } else {
            test
        }
    }

    fn test_of(&self, first: &[f64], second: &[f64]) -> Box<dyn EffectTest> {
        (Rule::of(self.quantity, self.pairing).make)(first, second)
    }

    /// The interval of the effect between bounds with these error probabilities. `thresholds` are
    /// the effects below and above the estimate with which the bounds are compared.
    #[must_use]
    pub fn interval(
        &self,
        test: &dyn EffectTest,
        levels: [f64; 2],
        thresholds: [f64; 2],
    ) -> Interval {
        let [first, second] = self.n();
        let n = first.min(second);
        if n < MIN_RUNS {
            return Interval::TooFewRuns { n };
        }
        Interval::Known {
            low: lower_bound(test, levels[0], thresholds[0]),
            high: upper_bound(test, levels[1], thresholds[1]),
        }
    }

    /// Probability that a run of the first cell is below a run of the second.
    fn probability_below(&self) -> Estimate {
        let [first, second] = self.tested();
        let probability = hull([
            win_probability(&second.least, &first.most),
            win_probability(&second.most, &first.least),
        ]);
        if self.is_reversed {
            complement(probability)
        } else {
            probability
        }
    }

    /// The comparison, with the interval of a single comparison.
    #[must_use]
    pub fn compare(&self, test: &dyn EffectTest) -> Comparison {
        let [first, second] = &self.values;
        Comparison {
            n: self.n(),
            values: [first.mean(), second.mean()],
            horizon: match self.quantity {
                Quantity::RestrictedMeanTime { horizon } => horizon,
                Quantity::Share | Quantity::Mean => f64::INFINITY,
            },
            ended_early: [first.unknown(), second.unknown()],
            effect: Estimate {
                value: test.estimate(),
                interval: self.interval(test, [FAMILY_LEVEL; 2], [0.0; 2]),
            },
            probability_below: self.probability_below(),
            is_constant: first
                .all()
                .chain(second.all())
                .all(|value| value == first.most[0]),
        }
    }
}

/// The middle of the smallest and the largest possible value, with the interval that has both intervals
/// in it.
fn hull([smallest, largest]: [Estimate; 2]) -> Estimate {
    let interval = match (smallest.interval, largest.interval) {
        (Interval::Known { low, .. }, Interval::Known { high, .. }) => {
            Interval::Known { low, high }
        }
        (too_few_runs, _) => too_few_runs,
    };
    Estimate {
        value: f64::midpoint(smallest.value, largest.value),
        interval,
    }
}

/// The probability of the opposite, with the opposite interval.
fn complement(probability: Estimate) -> Estimate {
    let interval = match probability.interval {
        Interval::Known { low, high } => Interval::Known {
            low: 1.0 - high,
            high: 1.0 - low,
        },
        too_few_runs @ Interval::TooFewRuns { .. } => too_few_runs,
    };
    Estimate {
        value: 1.0 - probability.value,
        interval,
    }
}

impl Comparison {
    /// Probability that a run of the first cell is above a run of the second. A tie counts half.
    #[must_use]
    pub fn probability_above(&self) -> Estimate {
        complement(self.probability_below)
    }

    /// Standard deviation of the scores of runs, or of paired differences, that makes the 95 % interval of the effect as
    /// wide as it is. `None` if they do not differ, if the interval is not known, or if it holds for all that is
    /// possible after runs that ended early.
    #[must_use]
    pub fn deviation(&self, is_paired: bool) -> Option<f64> {
        let [low, high] = self.effect.interval.ends()?;
        let standard_error = (high - low) / (2.0 * DEVIATIONS_OF_95_PERCENT);
        let [first, second] = self.n.map(|n| n as f64);
        let variance_per_run = if is_paired {
            1.0 / first
        } else {
            1.0 / first + 1.0 / second
        };
        let deviation = standard_error / variance_per_run.sqrt();
        let is_known = deviation > 0.0 && deviation.is_finite() && self.ended_early == [0, 0];
        (is_known && !self.is_constant).then_some(deviation)
    }
}

/// Half the width of a 95 % interval of the normal distribution, in standard deviations.
const DEVIATIONS_OF_95_PERCENT: f64 = 1.96;

fn pairs_with_common_seeds(first: &[RunScore], second: &[RunScore]) -> [Vec<RunScore>; 2] {
    let mut pairs = [Vec::new(), Vec::new()];
    for score in first {
        let mut candidates = second.iter();
        let has_equal_seed = |candidate: &&RunScore| candidate.run_seed == score.run_seed;
        if let Some(score_of_second) = candidates.find(has_equal_seed) {
            pairs[0].push(*score);
            pairs[1].push(*score_of_second);
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_stats::shares::Share;

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
                magnitude: value.abs(),
            }
        };
        text.split_whitespace().enumerate().map(score).collect()
    }

    fn compare(first: &str, second: &str, quantity: Quantity, paired: bool) -> Comparison {
        let samples = Samples::new(&times(first), &times(second), quantity, paired).unwrap();
        samples.compare(&*samples.test())
    }

    /// Differences −10, −20, −30, −40, −50: mean −30. The first times 10, 20, 30, 40 and 50 are
    /// below 5, 4½, 4, 3½ and 3 of the second times, where a tie counts half: 20 of 25 pairs. With
    /// five pairs no bound has an error probability as small as 2.5 %: the smallest is 1 / 2⁵.
    #[test]
    fn paired_comparisons_use_differences_per_seed() {
        let comparison = compare("10 20 30 40 50", "20 40 60 80 100", Quantity::Mean, true);
        assert_eq!(
            (comparison.effect.value, comparison.probability_below.value),
            (-30.0, 0.8)
        );
        let unlimited = [f64::NEG_INFINITY, f64::INFINITY];
        assert_eq!(comparison.effect.interval.ends(), Some(unlimited));
        assert!((comparison.probability_above().value - 0.2).abs() < 1e-15);
    }

    /// The interval has the width of a deviation: whole numbers from 1 to 50 have one of 14.6, and so have their
    /// differences from a number that stays; shares of one half deviate by 0.5.
    #[test]
    fn deviations_are_those_of_runs_or_of_differences() {
        let text = |value: fn(usize) -> usize| {
            let values: Vec<String> = (1..=50).map(|run| value(run).to_string()).collect();
            values.join(" ")
        };
        let (all, halves, same) = (text(|run| run), text(|run| run % 2), text(|_| 0));
        for (first, second, quantity, paired, expected) in [
            (&all, &all, Quantity::Mean, false, 14.6),
            (&all, &same, Quantity::Mean, true, 14.6),
            (&halves, &halves, Quantity::Share, false, 0.5),
        ] {
            let comparison = compare(first, second, quantity, paired);
            let found = comparison.deviation(paired).unwrap();
            assert!((found / expected - 1.0).abs() < 0.08, "{found}");
        }
        for quantity in [Quantity::Mean, Quantity::Share] {
            let equal = compare(&same, &same, quantity, false);
            assert_eq!(equal.deviation(false), None, "{quantity:?}");
        }
    }

    /// Up to episode 60, the first cell takes 30, 60, 60 (not solved), 60 (solved at 80) and 30
    /// episodes, 48 on average, and the second 60 in all runs. Run seeds are not compared.
    #[test]
    fn times_are_compared_up_to_the_horizon() {
        let horizon = Quantity::RestrictedMeanTime { horizon: 60.0 };
        let comparison = compare("30 60 60+ 80 30", "60+ 90 61 100 60+", horizon, false);
        assert_eq!(comparison.values, [48.0, 60.0]);
        assert_eq!(comparison.effect.value, -12.0);
        assert!(!comparison.is_constant);
    }

    /// Up to episode 120, runs that ended at 30 may have been solved at any time from 30 to 120. So the
    /// difference to times of 80 is at least 80 − 120 and at most 80 − 30, and the first runs may be
    /// above or below all of the second.
    #[test]
    fn nothing_is_known_of_runs_after_their_end() {
        let horizon = Quantity::RestrictedMeanTime { horizon: 120.0 };
        let samples = |first, second| Samples::new(&times(first), &times(second), horizon, false);
        let [solved, ended] = ["80 80 80 80 80 80 80 80", "30+ 30+ 30+ 30+ 30+ 30+ 30+ 30+"];
        let samples = samples(solved, ended).unwrap();
        let reversed = samples.clone().reversed();
        for (samples, sign) in [(samples, 1.0), (reversed, -1.0)] {
            let test = samples.test();
            let comparison = samples.compare(&*test);
            assert_eq!(comparison.effect.value, sign * 5.0);
            let [low, high] = comparison.effect.interval.ends().unwrap();
            assert!(
                low.min(-high) <= -40.0 && (-low).max(high) >= 50.0,
                "{low} {high}"
            );
            assert_eq!(comparison.probability_below.value, 0.5);
            assert!(!comparison.is_constant);
            assert_eq!((test.p_above(0.0), test.p_below(0.0)), (1.0, 1.0));
        }
        let values = [80.0, 75.0];
        let comparison = compare(solved, ended, horizon, false);
        assert_eq!(
            (comparison.values, comparison.ended_early),
            (values, [0, 8])
        );
    }

    /// What is not known does not matter if it is little: runs that ended one episode early.
    #[test]
    fn a_range_decides_what_all_of_it_decides() {
        let horizon = Quantity::RestrictedMeanTime { horizon: 100.0 };
        let [solved, ended] = ["20 21 22 23 24 25 26 27", "99+ 99+ 99+ 99+ 90 91 92 93"];
        let samples = Samples::new(&times(solved), &times(ended), horizon, false).unwrap();
        let test = samples.test();
        assert!(test.p_below(0.0) < 0.001);
        let comparison = samples.compare(&*test);
        assert_eq!(
            (comparison.effect.value, comparison.ended_early),
            (-72.0, [0, 4])
        );
    }

    /// Two runs of the first cell ended early without solving their task: 2, 3 or 4 of 6 may have solved it. The
    /// interval is that of the shares 2/6 and 4/6 against 1/6.
    #[test]
    fn runs_that_ended_early_may_have_solved_their_task() {
        let mut first = times("1 1 0 0 0 0");
        first[2].observed_until = 30.0;
        first[3].observed_until = 40.0;
        let second = times("1 0 0 0 0 0");
        let samples =
            |first: &[RunScore]| Samples::new(first, &second, Quantity::Share, false).unwrap();
        let unknown = samples(&first);
        let test = unknown.test();
        let found = unknown.compare(&*test);
        assert_eq!(
            (found.values, found.ended_early),
            ([0.5, 1.0 / 6.0], [2, 0])
        );
        assert!((found.effect.value - 1.0 / 3.0).abs() < 1e-12);
        let [least, most] = ["1 1 0 0 0 0", "1 1 1 1 0 0"].map(|first| {
            let first = times(first);
            let known = samples(&first);
            known
                .compare(&*known.test())
                .effect
                .interval
                .ends()
                .unwrap()
        });
        assert_eq!(found.effect.interval.ends(), Some([least[0], most[1]]));
        assert!(!found.is_constant);

        let share = summarize_scores(&first, Measure::Solved).unwrap().center;
        let wilson = |successes| {
            wilson_interval(Share { successes, runs: 6 })
                .ends()
                .unwrap()
        };
        assert_eq!(share.value, 0.5);
        assert_eq!(share.interval.ends(), Some([wilson(2)[0], wilson(4)[1]]));
    }

    /// Six of six against none of six.
    #[test]
    fn shares_have_an_interval_with_a_width() {
        let comparison = compare("1 1 1 1 1 1", "0 0 0 0 0 0", Quantity::Share, false);
        assert_eq!(
            (comparison.values, comparison.effect.value),
            ([1.0, 0.0], 1.0)
        );
        let [low, high] = comparison.effect.interval.ends().unwrap();
        assert!((0.4..0.7).contains(&low) && high == 1.0, "{low} {high}");
    }

    #[test]
    fn equal_values_of_all_runs_are_constant() {
        let comparison = compare("7 7 7 7 7", "7 7 7 7 7", Quantity::Mean, false);
        assert!(comparison.is_constant);
        assert_eq!(comparison.effect.interval.ends(), Some([0.0, 0.0]));
    }

    /// Sixteen runs have more splits than are used, so that those used are drawn at random.
    #[test]
    fn a_reversed_comparison_has_the_opposite_interval() {
        let [first, second] = ["3 9 4 8 7 11 2 5", "1 2 5 0 6 2 3 4"];
        for (quantity, paired) in [
            (Quantity::Mean, false),
            (Quantity::Mean, true),
            (Quantity::Share, false),
        ] {
            let samples = |a, b| Samples::new(&times(a), &times(b), quantity, paired).unwrap();
            let one = samples(first, second);
            let other = samples(first, second).reversed();
            assert_eq!(other.values, samples(second, first).values);
            let [one, other] = [one, other].map(|samples| samples.compare(&*samples.test()));
            assert_eq!(other.effect.value, -one.effect.value);
            let [low, high] = one.effect.interval.ends().unwrap();
            assert_eq!(other.effect.interval.ends(), Some([-high, -low]));
            assert_eq!(other.probability_below, one.probability_above());
            assert_eq!(other.n, one.n);
        }
    }

    /// The mean of 10, 20, …, 60 is 35, which is 30 above 5. All six are above: p = 1 / 2⁶.
    #[test]
    fn a_cell_is_compared_with_a_number() {
        let scores = times("10 20 30 40 50 60");
        let samples = Samples::against(&scores, 5.0, Quantity::Mean).unwrap();
        let test = samples.test();
        assert_eq!((test.estimate(), test.p_above(0.0)), (30.0, 1.0 / 64.0));
        assert_eq!(samples.compare(&*test).values, [35.0, 5.0]);
    }

    #[test]
    fn pairs_need_equal_run_seeds() {
        let second: Vec<RunScore> = times("5 6 7").into_iter().skip(1).collect();
        let samples = Samples::new(&times("1 2"), &second, Quantity::Mean, true).unwrap();
        let values = samples.values.clone().map(|values| values.most);
        assert_eq!((samples.n(), values), ([1, 1], [vec![2.0], vec![6.0]]));
        assert_eq!(
            Samples::new(&times("1"), &second, Quantity::Mean, true),
            None
        );
        assert_eq!(Samples::new(&[], &second, Quantity::Mean, false), None);
    }

    /// Runs that did not reach their time have no interquartile mean.
    #[test]
    fn unreached_times_are_censored_in_summaries() {
        let aggregate =
            summarize_scores(&times("10 20 30 40+ 40+"), Measure::EpisodesToSolve).unwrap();
        assert_eq!(
            (aggregate.n, aggregate.reached, aggregate.center.value),
            (5, 3, 30.0)
        );
        assert_eq!(aggregate.interquartile_mean, None);
        let aggregate =
            summarize_scores(&times("10 20 30 40 50"), Measure::EpisodesToSolve).unwrap();
        assert_eq!(aggregate.interquartile_mean.unwrap().value, 30.0);
    }

    /// Tables show the quantity that is tested. Half of four runs: Wilson's interval is
    /// (p + z²/2n ± z √(p(1 − p)/n + z²/4n²)) / (1 + z²/n) = 0.5 ± 0.34996 with z = 1.96.
    #[test]
    fn summaries_have_means_and_shares() {
        let scores = times("0 0 1 1");
        let share = summarize_scores(&scores, Measure::Solved).unwrap();
        let [low, high] = share.center.interval.ends().unwrap();
        assert_eq!(share.center.value, 0.5);
        assert!((low - 0.15).abs() < 1e-4 && (high - 0.85).abs() < 1e-4);
        let mean = summarize_scores(&times("0 0 0 8"), Measure::Coverage).unwrap();
        assert_eq!((mean.center.value, mean.median), (2.0, 0.0));
        assert_eq!(mean.interquartile_mean.unwrap().value, 0.0);
    }
}
