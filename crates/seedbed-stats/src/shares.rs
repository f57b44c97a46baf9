//! Shares: Wilson's interval of one share, and the exact unconditional score test of the difference
//! of two shares.
//!
//! ```
//! use seedbed_stats::effect_test::{EffectTest, lower_bound};
//! use seedbed_stats::shares::{Share, TwoShares, wilson_interval};
//!
//! let (ours, baseline) = (Share { successes: 20, runs: 20 }, Share { successes: 9, runs: 20 });
//! assert!(wilson_interval(ours).ends().is_some_and(|[low, high]| low > 0.83 && high == 1.0));
//! let test = TwoShares::new(ours, baseline);
//! assert_eq!(test.estimate(), 0.55);
//! assert!(lower_bound(&test, 0.025, 0.0) > 0.3);
//! ```

use statrs::distribution::{ContinuousCDF, Normal};
use statrs::function::factorial::ln_binomial;

use super::Interval;
use super::effect_test::EffectTest;

/// Number of values of the unknown second share over which p-values are maximized.
const GRID: usize = 256;

/// Score statistics that differ by less than this are equal.
const TOLERANCE: f64 = 1e-9;

/// A number of successful runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share {
    /// Number of successful runs.
    pub successes: usize,
    /// Number of runs.
    pub runs: usize,
}

impl Share {
    /// Share of the runs that were successful.
    #[must_use]
    pub fn value(self) -> f64 {
        self.successes as f64 / self.runs as f64
    }
}

/// 95 % score interval of a share (Wilson 1927). It has a width for no and for only successes, and
/// any number of runs is enough.
///
/// Equals `statsmodels.stats.proportion.proportion_confint(…, method="wilson")`.
///
/// # Panics
/// If there are no runs.
#[must_use]
pub fn wilson_interval(share: Share) -> Interval {
    assert!(share.runs > 0, "a share of no runs");
    let (n, p) = (share.runs as f64, share.value());
    let z = Normal::standard().inverse_cdf(0.975);
    let center = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half_width = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt() / (1.0 + z * z / n);
    Interval::Known {
        low: if share.successes == 0 {
            0.0
        } else {
            center - half_width
        },
        high: if share.successes == share.runs {
            1.0
        } else {
            center + half_width
        },
    }
}

/// Exact unconditional test of the difference p₁ − p₂ of two shares, for all hypothetical
/// differences δ (Chan and Zhang 1999).
///
/// Tables are ordered by the score statistic z = (p̂₁ − p̂₂ − δ) / √(p̃₁(1 − p̃₁)/n₁ + p̃₂(1 − p̃₂)/n₂),
/// where p̃ are the maximum-likelihood shares with p̃₁ − p̃₂ = δ (Farrington and Manning 1990;
/// Miettinen and Nurminen 1985 apart from a factor). The p-value is the probability of tables that
/// are at least as extreme, maximized over p₂ at p₁ = p₂ + δ, so that false rejections are never
/// more frequent than the level, for any number of runs. For δ = 0, one-sided p-values equal those
/// of `scipy.stats.barnard_exact(…, pooled=True)`.
#[derive(Clone, Debug)]
pub struct TwoShares {
    first: Share,
    second: Share,
    /// ln of the binomial coefficients of both numbers of runs.
    ln_binomials: [Vec<f64>; 2],
}

impl TwoShares {
    /// Test of the first share minus the second.
    ///
    /// # Panics
    /// If a share has no runs.
    #[must_use]
    pub fn new(first: Share, second: Share) -> Self {
        assert!(first.runs > 0 && second.runs > 0, "a share of no runs");
        Self {
            first,
            second,
            ln_binomials: [first, second].map(|share| ln_binomials(share.runs)),
        }
    }

    /// The same test with the roles of the two shares exchanged.
    fn exchanged(&self) -> Self {
        let [first, second] = self.ln_binomials.clone();
        Self {
            first: self.second,
            second: self.first,
            ln_binomials: [second, first],
        }
    }
}

/// For each number of successes of the first share, how many numbers of successes of the second
/// (0, 1, …) give a score of at least that of the data.   → `[n₁ + 1]`
fn extreme_tables(first: Share, second: Share, effect: f64) -> Vec<usize> {
    let of_data = score(first, second, effect);
    let threshold = of_data - TOLERANCE * of_data.abs().max(1.0);
    let is_extreme = |successes_of_first: usize, successes_of_second: usize| {
        let first = Share {
            successes: successes_of_first,
            ..first
        };
        let second = Share {
            successes: successes_of_second,
            ..second
        };
        score(first, second, effect) >= threshold
    };
    // Scores rise with the first number and fall with the second.
    let mut counts = Vec::with_capacity(first.runs + 1);
    let mut count = 0;
    for successes in 0..=first.runs {
        while count <= second.runs && is_extreme(successes, count) {
            count += 1;
        }
        counts.push(count);
    }
    counts
}

/// Probability of tables whose numbers of successes of the second share are below `extreme`, from
/// the probabilities of the numbers of successes of both shares.
/// `extreme: [n₁ + 1]`, `first: [n₁ + 1]`, `second: [n₂ + 1]`
fn probability_of_tables(extreme: &[usize], first: &[f64], second: &[f64]) -> f64 {
    let (mut cumulative, mut included, mut sum) = (0.0, 0, 0.0);
    for (probability, &count) in first.iter().zip(extreme) {
        cumulative += second[included..count].iter().sum::<f64>();
        included = count;
        sum += probability * cumulative;
    }
    sum.min(1.0)
}

/// Pairs of shares p₁ = p₂ + `effect` and p₂, over which p-values are maximized.
fn pairs_of_shares(effect: f64) -> impl Iterator<Item = [f64; 2]> {
    // All p₂ for which both shares are between 0 and 1.
    let (low, high) = ((-effect).max(0.0), (1.0 - effect).min(1.0));
    (0..=GRID).map(move |step| {
        // Steps are small at both ends, where probabilities change fast.
        let angle = std::f64::consts::FRAC_PI_2 * step as f64 / GRID as f64;
        let second = low + (high - low) * angle.sin().powi(2);
        [second + effect, second].map(|share| share.clamp(0.0, 1.0))
    })
}

/// p-values of all tables with `runs` runs of each share, for the hypothesis that the shares are
/// equal: as [`TwoShares::p_above`], with common probabilities that are computed once.
pub(crate) struct EqualSharesTest {
    ln_binomials: Vec<f64>,
    /// Probabilities of the numbers of successes for each share of the grid.
    probabilities: Vec<Vec<f64>>,
}

impl EqualSharesTest {
    pub(crate) fn new(runs: usize) -> Self {
        let ln_binomials = ln_binomials(runs);
        let probabilities =
            pairs_of_shares(0.0).map(|[share, _]| binomial_probabilities(&ln_binomials, share));
        Self {
            probabilities: probabilities.collect(),
            ln_binomials,
        }
    }

    /// p-value of `successes` of the first and of the second share, against a larger first share.
    pub(crate) fn p_above(&self, successes: [usize; 2]) -> f64 {
        let runs = self.ln_binomials.len() - 1;
        let [first, second] = successes.map(|successes| Share { successes, runs });
        let extreme = extreme_tables(first, second, 0.0);
        let probabilities = self.probabilities.iter();
        probabilities
            .map(|probabilities| probability_of_tables(&extreme, probabilities, probabilities))
            .fold(0.0, f64::max)
    }

    /// Probabilities of 0, 1, … successes with this share.   → `[runs + 1]`
    pub(crate) fn probabilities(&self, share: f64) -> Vec<f64> {
        binomial_probabilities(&self.ln_binomials, share)
    }
}

impl EffectTest for TwoShares {
    fn estimate(&self) -> f64 {
        self.first.value() - self.second.value()
    }

    fn p_above(&self, effect: f64) -> f64 {
        let extreme = extreme_tables(self.first, self.second, effect);
        let probability = |shares: [f64; 2]| {
            let [first, second] = [0, 1]
                .map(|share| binomial_probabilities(&self.ln_binomials[share], shares[share]));
            probability_of_tables(&extreme, &first, &second)
        };
        pairs_of_shares(effect).map(probability).fold(0.0, f64::max)
    }

    fn p_below(&self, effect: f64) -> f64 {
        self.exchanged().p_above(-effect)
    }

    fn limits(&self) -> [f64; 2] {
        [-1.0, 1.0]
    }

    fn search_distance(&self) -> f64 {
        2.0
    }
}

/// ln of the binomial coefficients of `n`.   → `[n + 1]`
fn ln_binomials(n: usize) -> Vec<f64> {
    (0..=n as u64).map(|k| ln_binomial(n as u64, k)).collect()
}

/// Probabilities of 0, 1, …, n successes. `ln_binomials: [n + 1]` → `[n + 1]`
fn binomial_probabilities(ln_binomials: &[f64], p: f64) -> Vec<f64> {
    let n = ln_binomials.len() - 1;
    let probability = |(k, ln_binomial): (usize, &f64)| {
        // 0 · ln 0 is 0 here: no successes are certain if p is 0.
        let ln_power = |count: usize, p: f64| {
            if count == 0 {
                0.0
            } else {
                count as f64 * p.ln()
            }
        };
        (ln_binomial + ln_power(k, p) + ln_power(n - k, 1.0 - p)).exp()
    };
    ln_binomials.iter().enumerate().map(probability).collect()
}

/// Score statistic of the hypothesis that the shares differ by `effect`; ±∞ if the hypothesis
/// allows no variation and the data contradict it.
fn score(first: Share, second: Share, effect: f64) -> f64 {
    let [p1, p2] = constrained_shares(first, second, effect);
    let variance = p1 * (1.0 - p1) / first.runs as f64 + p2 * (1.0 - p2) / second.runs as f64;
    let deviation = first.value() - second.value() - effect;
    if deviation.abs() < TOLERANCE {
        0.0
    } else {
        // Division by 0 gives the infinity that is meant.
        deviation / variance.max(0.0).sqrt()
    }
}

/// Maximum-likelihood shares with the difference `effect`: the root of a cubic equation
/// (Farrington and Manning 1990, appendix).
fn constrained_shares(first: Share, second: Share, effect: f64) -> [f64; 2] {
    let [n1, n2] = [first.runs as f64, second.runs as f64];
    let (p1, p2, ratio) = (first.value(), second.value(), n2 / n1);
    let a = 1.0 + ratio;
    let b = -(1.0 + ratio + p1 + ratio * p2 + effect * (ratio + 2.0));
    let c = effect * effect + effect * (2.0 * p1 + ratio + 1.0) + p1 + ratio * p2;
    let d = -p1 * effect * (1.0 + effect);
    let v = (b / (3.0 * a)).powi(3) - b * c / (6.0 * a * a) + d / (2.0 * a);
    let u = v.signum() * ((b / (3.0 * a)).powi(2) - c / (3.0 * a)).max(0.0).sqrt();
    let cosine = if u == 0.0 {
        0.0
    } else {
        (v / u.powi(3)).clamp(-1.0, 1.0)
    };
    let w = (std::f64::consts::PI + cosine.acos()) / 3.0;
    let share = (2.0 * u * w.cos() - b / (3.0 * a)).clamp(effect.max(0.0), (1.0 + effect).min(1.0));
    [share, (share - effect).clamp(0.0, 1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect_test::{lower_bound, upper_bound};

    fn test(first: [usize; 2], second: [usize; 2]) -> TwoShares {
        let share = |[successes, runs]: [usize; 2]| Share { successes, runs };
        TwoShares::new(share(first), share(second))
    }

    /// With δ = 0 the constrained shares are the pooled share: (7 + 2) / (10 + 20).
    #[test]
    fn without_difference_the_constrained_share_is_the_pooled_one() {
        let shares = constrained_shares(
            Share {
                successes: 7,
                runs: 10,
            },
            Share {
                successes: 2,
                runs: 20,
            },
            0.0,
        );
        assert!(
            shares.iter().all(|share| (share - 0.3).abs() < 1e-12),
            "{shares:?}"
        );
    }

    /// The constrained shares maximize the likelihood x₁ ln p₁ + (n₁ − x₁) ln(1 − p₁) + … among all
    /// shares with this difference.
    #[test]
    fn constrained_shares_have_the_greatest_likelihood() {
        let shares = [
            Share {
                successes: 8,
                runs: 9,
            },
            Share {
                successes: 4,
                runs: 13,
            },
        ];
        let term = |share: Share, p: f64| {
            let failures = (share.runs - share.successes) as f64;
            share.successes as f64 * p.ln() + failures * (1.0 - p).ln()
        };
        for effect in [-0.4, -0.1, 0.2, 0.7] {
            let likelihood = |p1: f64| term(shares[0], p1) + term(shares[1], p1 - effect);
            let [p1, p2] = constrained_shares(shares[0], shares[1], effect);
            assert!((p1 - p2 - effect).abs() < 1e-12);
            for nearby in [p1 - 1e-3, p1 + 1e-3] {
                assert!(likelihood(p1) > likelihood(nearby), "{effect}: {p1}");
            }
        }
    }

    /// Two of two against none of two: only this table is as extreme. Its probability p² (1 − p)²
    /// has the maximum 1/16 at p = ½.
    #[test]
    fn the_p_value_is_the_maximum_over_the_unknown_share() {
        assert!((test([2, 2], [0, 2]).p_above(0.0) - 1.0 / 16.0).abs() < 1e-12);
        assert_eq!(test([0, 2], [2, 2]).p_above(0.0), 1.0);
        assert!((test([0, 2], [2, 2]).p_below(0.0) - 1.0 / 16.0).abs() < 1e-12);
    }

    /// The common probabilities change nothing.
    #[test]
    fn tests_of_equal_shares_have_the_p_values_of_two_shares() {
        let equal = EqualSharesTest::new(12);
        for successes in [[12, 3], [7, 7], [1, 9], [12, 12]] {
            let [first, second] = successes.map(|successes| [successes, 12]);
            assert_eq!(equal.p_above(successes), test(first, second).p_above(0.0));
        }
    }

    /// All runs of both cells solved: the difference is 0, and its interval has a width.
    #[test]
    fn equal_shares_of_one_have_an_interval_with_a_width() {
        let test = test([20, 20], [20, 20]);
        let (low, high) = (
            lower_bound(&test, 0.025, 0.0),
            upper_bound(&test, 0.025, 0.0),
        );
        assert!(
            (low + high).abs() < 1e-6 && (0.1..0.2).contains(&high),
            "{low} {high}"
        );
    }

    /// Coverage of the interval by definition: the probability of tables whose interval has the
    /// true difference, for many pairs of true shares. It is at least 95 %.
    #[test]
    fn intervals_cover_the_true_difference_with_at_least_95_percent() {
        const N: usize = 8;
        let mut intervals = Vec::new();
        for x1 in 0..=N {
            for x2 in 0..=N {
                let test = test([x1, N], [x2, N]);
                let ends = [
                    lower_bound(&test, 0.025, 0.0),
                    upper_bound(&test, 0.025, 0.0),
                ];
                intervals.push(([x1, x2], ends));
            }
        }
        for p1 in [0.03, 0.2, 0.5, 0.77, 0.96] {
            for p2 in [0.05, 0.35, 0.5, 0.9] {
                let [first, second] = [p1, p2].map(|p| EqualSharesTest::new(N).probabilities(p));
                let covers = |ends: &[f64; 2]| ends[0] <= p1 - p2 && p1 - p2 <= ends[1];
                let covering = intervals.iter().filter(|(_, ends)| covers(ends));
                let coverage: f64 = covering.map(|([x1, x2], _)| first[*x1] * second[*x2]).sum();
                assert!(coverage >= 0.9499, "{p1} {p2}: {coverage}");
            }
        }
    }

    /// 0 of 10 and 10 of 10: Wilson's limits are z² / (n + z²) = 0.2775 from the certain end.
    #[test]
    fn wilsons_interval_has_a_width_at_both_ends() {
        let [none, all] = [0, 10].map(|successes| {
            wilson_interval(Share {
                successes,
                runs: 10,
            })
            .ends()
            .unwrap()
        });
        assert!(
            none[0] == 0.0 && (none[1] - 0.277_5).abs() < 1e-4,
            "{none:?}"
        );
        assert!(all[1] == 1.0 && (all[0] - 0.722_5).abs() < 1e-4, "{all:?}");
    }
}
