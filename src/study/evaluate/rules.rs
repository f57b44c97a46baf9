//! The table of comparisons: what is compared of two cells, with which test, and in which words.
//!
//! A new kind of comparison is a [`Rule`] and a row in [`Rule::of`].

use super::score::RunScore;
use crate::experiment::measure::Measure;
use seedbed_stats::effect_test::EffectTest;
use seedbed_stats::means::{MeanOfDifferences, TwoMeans};
use seedbed_stats::shares::{self, TwoShares};

/// What is compared, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quantity {
    /// Shares of runs with the value 1. Runs of others that ended early without it may have had either.
    Share,
    /// Means.
    Mean,
    /// Restricted mean times: times after the horizon count as the horizon. Times of runs that ended
    /// before it without reaching them may be any from the end of the run to the horizon.
    RestrictedMeanTime {
        /// Number of episodes or steps up to which times are compared.
        horizon: f64,
    },
}

impl Quantity {
    /// What is compared in a measure. Times are compared up to `horizon`.
    #[must_use]
    pub fn of(measure: Measure, horizon: f64) -> Self {
        if measure.is_time() {
            Self::RestrictedMeanTime { horizon }
        } else if measure.is_yes_or_no() {
            Self::Share
        } else {
            Self::Mean
        }
    }

    /// The value of a run that is compared: a time up to the horizon, or the measure itself. Of a run
    /// that ended early, the largest possible time, or ½ if it may have solved its task afterwards.
    #[must_use]
    pub fn value(self, score: RunScore) -> f64 {
        let [least, most] = self.range(score);
        match self {
            Self::Share => f64::midpoint(least, most),
            Self::Mean | Self::RestrictedMeanTime { .. } => most,
        }
    }

    /// The smallest and the largest possible value of a run.
    pub(super) fn range(self, score: RunScore) -> [f64; 2] {
        match self {
            Self::Share if score.observed_until.is_finite() => [0.0, 1.0],
            Self::Share | Self::Mean => [score.value; 2],
            Self::RestrictedMeanTime { horizon } => score.time_to_event().range_up_to(horizon),
        }
    }
}

/// How the runs of two cells belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pairing {
    /// Not at all.
    Independent,
    /// Those with equal run seeds are compared with each other.
    ByRunSeed,
    /// There is one cell, whose runs are compared with a number.
    WithNumber,
}

/// How two cells are compared.
#[derive(Clone, Copy, Debug)]
pub struct Rule {
    /// Definition of the effect.
    pub effect: &'static str,
    /// Name of the test.
    pub test: &'static str,
    /// The test of values of the first and of the second cell: `[runs]`, `[runs]`.
    pub(super) make: fn(&[f64], &[f64]) -> Box<dyn EffectTest>,
}

const STUDENTIZED: &str = "studentized permutation test";
const CHANGES_OF_SIGN: &str = "permutation test (changes of sign)";

const SHARES: Rule = Rule {
    effect: "difference between the shares of runs",
    test: "exact unconditional score test (Chan and Zhang)",
    make: two_shares,
};
const TIMES: Rule = Rule {
    effect: "difference between restricted mean times",
    test: STUDENTIZED,
    make: two_means,
};
const MEANS: Rule = Rule {
    effect: "difference between the means",
    test: STUDENTIZED,
    make: two_means,
};
const PAIRED_TIMES: Rule = Rule {
    effect: "mean difference between restricted times of the same run seed",
    test: CHANGES_OF_SIGN,
    make: mean_of_differences,
};
const PAIRED_MEANS: Rule = Rule {
    effect: "mean difference between runs of the same run seed",
    test: CHANGES_OF_SIGN,
    make: mean_of_differences,
};
const NUMBER: Rule = Rule {
    effect: "mean minus the number",
    test: CHANGES_OF_SIGN,
    make: mean_of_differences,
};

impl Rule {
    /// The rule for a quantity of two cells.
    #[must_use]
    pub fn of(quantity: Quantity, pairing: Pairing) -> &'static Self {
        use Pairing::{ByRunSeed, Independent, WithNumber};
        use Quantity::{Mean, RestrictedMeanTime, Share};
        match (quantity, pairing) {
            (Share, _) => &SHARES,
            (Mean | RestrictedMeanTime { .. }, WithNumber) => &NUMBER,
            (RestrictedMeanTime { .. }, ByRunSeed) => &PAIRED_TIMES,
            (RestrictedMeanTime { .. }, Independent) => &TIMES,
            (Mean, ByRunSeed) => &PAIRED_MEANS,
            (Mean, Independent) => &MEANS,
        }
    }
}

fn two_means(first: &[f64], second: &[f64]) -> Box<dyn EffectTest> {
    Box::new(TwoMeans::new(first, second))
}

fn mean_of_differences(first: &[f64], second: &[f64]) -> Box<dyn EffectTest> {
    let pairs = first.iter().zip(second);
    let differences: Vec<f64> = pairs.map(|(first, second)| first - second).collect();
    Box::new(MeanOfDifferences::new(&differences))
}

fn two_shares(first: &[f64], second: &[f64]) -> Box<dyn EffectTest> {
    let [first, second] = [first, second].map(share_of_successes);
    Box::new(TwoShares::new(first, second))
}

/// The share of values that are 1.
pub(super) fn share_of_successes(values: &[f64]) -> shares::Share {
    shares::Share {
        successes: values.iter().filter(|&&value| value > 0.5).count(),
        runs: values.len(),
    }
}
