//! Power: how many runs a comparison needs, before they are run.
//!
//! ```
//! use seedbed_stats::power::{power_of_means, power_of_shares, runs_needed};
//!
//! // Means that are half a standard deviation apart, tested at 0.025 with 80 % power.
//! assert_eq!(runs_needed(0.8, |runs| power_of_means(0.5, runs, 0.025)), Some(64));
//! // 70 % against 95 % of runs solved.
//! assert!(power_of_shares([0.95, 0.7], 40, 0.025) > 0.8);
//! ```

use statrs::distribution::{ContinuousCDF, Normal};

use super::shares::EqualSharesTest;

/// Maximum number of runs that [`runs_needed`] tries.
pub const MAX_RUNS: usize = 2000;

/// Smallest number of runs per cell, from 2 to [`MAX_RUNS`], with at least this power; `None` if
/// there is none. `power_of_runs` gives the power of a number of runs.
///
/// The power of tests of shares does not rise with every run. The number is the smallest with
/// enough power, not the first from which on all have enough.
#[must_use]
pub fn runs_needed(power: f64, power_of_runs: impl Fn(usize) -> f64) -> Option<usize> {
    let first_enough = (1..=11).map(|exponent| (1 << exponent).min(MAX_RUNS));
    let enough = first_enough
        .into_iter()
        .find(|&runs| power_of_runs(runs) >= power)?;
    (enough / 2 + 1..enough)
        .find(|&runs| power_of_runs(runs) >= power)
        .or(Some(enough))
}

/// Power of a one-sided comparison of two means with `runs` runs each, at this level. `effect` is
/// the difference in standard deviations of a run.
///
/// Normal approximation with Guenther's (1981) correction for estimated deviations: within one run
/// of `statsmodels.stats.power.TTestIndPower` where 5 or more runs are needed.
#[must_use]
pub fn power_of_means(effect: f64, runs: usize, level: f64) -> f64 {
    normal_power(effect, level, |z| (runs as f64 - z * z / 4.0) / 2.0)
}

/// Power of a one-sided test of the mean of `pairs` differences, at this level. `effect` is the mean
/// in standard deviations of a difference.
#[must_use]
pub fn power_of_differences(effect: f64, pairs: usize, level: f64) -> f64 {
    normal_power(effect, level, |z| pairs as f64 - z * z / 2.0)
}

fn normal_power(effect: f64, level: f64, runs: impl Fn(f64) -> f64) -> f64 {
    let normal = Normal::standard();
    let z = normal.inverse_cdf(1.0 - level);
    normal.cdf(effect.abs() * runs(z).max(0.0).sqrt() - z)
}

/// Power of the one-sided [exact test of two shares](super::shares::TwoShares) with `runs` runs each, at this
/// level, if the true shares are `shares`. Exact: the sum over all tables that reject.
///
/// # Panics
/// If there are no runs.
#[must_use]
pub fn power_of_shares(shares: [f64; 2], runs: usize, level: f64) -> f64 {
    let [low, high] = [shares[0].min(shares[1]), shares[0].max(shares[1])];
    let test = EqualSharesTest::new(runs);
    // For each number of successes of the higher share, those of the lower that reject are 0, 1, …
    let mut rejected = 0;
    let mut power = 0.0;
    let probabilities = [high, low].map(|share| test.probabilities(share));
    let mut cumulative = 0.0;
    for (first, probability) in probabilities[0].iter().enumerate() {
        while rejected <= runs && test.p_above([first, rejected]) <= level {
            cumulative += probabilities[1][rejected];
            rejected += 1;
        }
        power += probability * cumulative;
    }
    power
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two runs each: only two of two against none of two has p = 1/16. With the true shares 0.9
    /// and 0.2 it has the probability 0.9² · 0.8² = 0.5184.
    #[test]
    fn the_power_of_shares_is_the_probability_of_the_tables_that_reject() {
        assert!((power_of_shares([0.9, 0.2], 2, 0.1) - 0.5184).abs() < 1e-12);
        assert!((power_of_shares([0.2, 0.9], 2, 0.1) - 0.5184).abs() < 1e-12);
        assert_eq!(power_of_shares([0.9, 0.2], 2, 0.05), 0.0);
    }

    /// Without an effect the power is the level, apart from the correction.
    #[test]
    fn without_effect_the_power_is_the_level() {
        assert!((power_of_means(0.0, 30, 0.025) - 0.025).abs() < 1e-9);
        assert!((power_of_differences(0.0, 30, 0.025) - 0.025).abs() < 1e-9);
    }

    #[test]
    fn an_effect_that_no_number_of_runs_shows_needs_none() {
        assert_eq!(
            runs_needed(0.8, |runs| power_of_means(0.01, runs, 0.025)),
            None
        );
    }
}
