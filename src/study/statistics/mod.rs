//! Statistics of many runs as pure functions, after Agarwal et al. 2021 ("Deep RL at the edge of the statistical precipice", its
//! package `rliable`) and Patterson et al. 2024 ("Empirical design in reinforcement learning").
//!
//! Scores are `[task][run]`: one number a whole team run. No interval is made from fewer than [`LEAST_RUNS`] runs. Equal data
//! give equal intervals: resampling draws from a named stream. Values are held against `rliable`, `scipy`, `lifelines` and
//! `statsmodels` by `tests/statistics.rs`.

pub mod aggregate;
pub mod bootstrap;
pub mod comparison;
pub mod improvement;
pub mod paired;
pub mod profile;
pub mod survival;
pub mod verdict;

use statrs::distribution::{ContinuousCDF, Normal};

pub use bootstrap::{estimate, estimate_of_sample};
pub use verdict::{Direction, Verdict, is_smaller_than_claimed, verdict};

/// Fewer runs than this make no interval.
pub const LEAST_RUNS: usize = 5;

/// A confidence interval at 95 %, or why there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Interval {
    /// Both ends belong to it. An end is infinite where the data do not bound it.
    Known {
        /// The lower end.
        low: f64,
        /// The upper end.
        high: f64,
    },
    /// Too few runs for an interval that would mean anything.
    TooFewRuns {
        /// So many there are.
        n: usize,
    },
}

impl Interval {
    /// The interval from `low` to `high`, if `n` runs are enough for one.
    fn of_runs(n: usize, low: f64, high: f64) -> Self {
        if n < LEAST_RUNS {
            Self::TooFewRuns { n }
        } else {
            Self::Known { low, high }
        }
    }
}

/// What the data say a number is, and how sure that is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The number for the data as they are.
    pub value: f64,
    /// Its 95 % interval.
    pub interval: Interval,
}

/// How likely a standard normal number lies as far from 0 as `z`, on either side.
fn two_sided_normal(z: f64) -> f64 {
    2.0 * Normal::standard().sf(z.abs())
}
