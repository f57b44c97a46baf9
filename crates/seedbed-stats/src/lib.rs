#![doc = include_str!("../README.md")]

pub mod aggregate;
pub mod bootstrap;
pub mod correlation;
pub mod effect_test;
pub mod family;
pub mod improvement;
pub mod means;
pub mod power;
pub mod profile;
pub mod ratios;
pub mod shares;
pub mod survival;
pub mod verdict;

pub use bootstrap::{bootstrap_estimate, stratified_bootstrap_estimate};
pub use verdict::{Direction, Verdict, verdict_on_effect, verdict_on_no_effect};

/// Minimum number of runs for an interval. With fewer runs, a bootstrap interval is far too narrow.
pub const MIN_RUNS: usize = 5;

/// A 95 % confidence interval, or the reason why there is none.
///
/// ```
/// use seedbed_stats::Interval;
///
/// let interval = Interval::Known { low: -0.5, high: 1.5 };
/// assert_eq!(interval.ends(), Some([-0.5, 1.5]));
/// assert_eq!(Interval::TooFewRuns { n: 3 }.ends(), None);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Interval {
    /// An interval that includes both ends. An end is infinite if the data give no bound.
    Known {
        /// Lower end.
        low: f64,
        /// Upper end.
        high: f64,
    },
    /// Fewer than [`MIN_RUNS`] runs.
    TooFewRuns {
        /// Number of runs.
        n: usize,
    },
}

impl Interval {
    /// Lower and upper end; `None` with too few runs.
    #[must_use]
    pub fn ends(self) -> Option<[f64; 2]> {
        match self {
            Self::Known { low, high } => Some([low, high]),
            Self::TooFewRuns { .. } => None,
        }
    }

    /// The interval from `low` to `high`, unless the `n` runs are fewer than [`MIN_RUNS`].
    fn of_runs(n: usize, low: f64, high: f64) -> Self {
        if n < MIN_RUNS {
            Self::TooFewRuns { n }
        } else {
            Self::Known { low, high }
        }
    }
}

/// A point estimate with its 95 % confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The statistic of the data.
    pub value: f64,
    /// The 95 % confidence interval of the statistic.
    pub interval: Interval,
}
