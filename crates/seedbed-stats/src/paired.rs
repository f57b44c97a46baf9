//! Two algorithms run with the same seeds, compared seed by seed.
//!
//! ```
//! use seedbed_stats::paired::{differences, signed_rank_test};
//!
//! let (x, y) = ([3.0, 5.0, 9.0, 7.0, 8.0], [2.0, 3.0, 6.0, 3.0, 3.0]);
//! let differences = differences(&x, &y);
//! assert_eq!(differences, [1.0, 2.0, 3.0, 4.0, 5.0]);
//! // All of one sign: two of the 2⁵ assignments of signs.
//! assert_eq!(signed_rank_test(&differences).p, 0.0625);
//! ```

use super::two_sided_normal;

/// Max number of differences for which the signed-rank test is exact.
const MAX_EXACT: usize = 50;

/// Differences x − y, seed by seed; 0 where both are equal, even infinite.   `x: [n]`, `y: [n]` →
/// `[n]`
///
/// # Panics
/// If the slices differ in length.
#[must_use]
pub fn differences(x: &[f64], y: &[f64]) -> Vec<f64> {
    assert_eq!(x.len(), y.len());
    x.iter()
        .zip(y)
        .map(|(x, y)| if x == y { 0.0 } else { x - y })
        .collect()
}

/// Result of Wilcoxon's signed-rank test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignedRankTest {
    /// Test statistic: the smaller of the rank sums of positive and of negative differences.
    pub statistic: f64,
    /// Two-sided p-value; 1 if all differences are 0.
    pub p: f64,
}

/// Wilcoxon's signed-rank test, two-sided, of differences that are symmetric around 0.
/// `differences: [n]`
///
/// Differences of 0 are dropped, and ties get their mean rank. With at most 50 other differences
/// the test is exact, with or without ties: the permutation test over all signs. With more it is
/// the normal approximation with the variance corrected for ties, without continuity correction.
/// This is the default of `scipy.stats.wilcoxon`, except for 14 to 50 differences with ties or
/// zeros, for which scipy approximates.
#[must_use]
pub fn signed_rank_test(differences: &[f64]) -> SignedRankTest {
    let mut nonzero: Vec<f64> = differences.to_vec();
    nonzero.retain(|difference| *difference != 0.0);
    nonzero.sort_unstable_by(|a, b| a.abs().total_cmp(&b.abs()));
    let ranks = doubled_ranks(&nonzero);
    let mut positive = 0;
    for (difference, rank) in nonzero.iter().zip(&ranks) {
        if *difference > 0.0 {
            positive += rank;
        }
    }
    let all: usize = ranks.iter().sum();
    let smaller = positive.min(all - positive);
    let p = if nonzero.len() <= MAX_EXACT {
        exact_p(&ranks, smaller)
    } else {
        normal_p(&ranks, smaller)
    };
    SignedRankTest {
        statistic: smaller as f64 / 2.0,
        p,
    }
}

/// Twice the rank by magnitude of each difference.   `sorted: [n]` by magnitude → `[n]`
///
/// Ties share the mean of their ranks, which may end in ½. Doubled ranks are whole numbers, so
/// that sums of them can be indices.
fn doubled_ranks(sorted: &[f64]) -> Vec<usize> {
    let mut ranks = Vec::with_capacity(sorted.len());
    for ties in sorted.chunk_by(|a, b| a.abs() == b.abs()) {
        let before = ranks.len();
        // Ranks `before + 1` to `before + ties` have the mean `before + (ties + 1) / 2`.
        ranks.extend(std::iter::repeat_n(2 * before + ties.len() + 1, ties.len()));
    }
    ranks
}

/// min(1, 2 P(W ≤ w)) for the sum W of the ranks of positive differences, each of which is positive
/// with probability ½.
///
/// The distribution of W is built rank by rank: P(W = w) ← ½ P(W = w) + ½ P(W = w − rank).
fn exact_p(ranks: &[usize], smaller: usize) -> f64 {
    let mut probabilities = vec![0.0; ranks.iter().sum::<usize>() + 1];
    probabilities[0] = 1.0;
    for &rank in ranks {
        // From large to small sums, so that `sum - rank` is still without this rank.
        for sum in (0..probabilities.len()).rev() {
            let without = if sum < rank {
                0.0
            } else {
                probabilities[sum - rank]
            };
            probabilities[sum] = f64::midpoint(probabilities[sum], without);
        }
    }
    (2.0 * probabilities[..=smaller].iter().sum::<f64>()).min(1.0)
}

/// Normal approximation of the same: W has mean ½ Σ r and variance ¼ Σ r², with or without ties.
fn normal_p(ranks: &[usize], smaller: usize) -> f64 {
    let mean = ranks.iter().sum::<usize>() as f64 / 2.0;
    let variance = ranks.iter().map(|rank| rank * rank).sum::<usize>() as f64 / 4.0;
    two_sided_normal((smaller as f64 - mean) / variance.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn infinities_differ_only_from_numbers() {
        let never = f64::INFINITY;
        assert_eq!(
            differences(&[never, never, 3.0, 3.0], &[never, 5.0, never, 1.0]),
            [0.0, never, -never, 2.0]
        );
    }

    /// Magnitudes 1, 2, 2, 4 have ranks 1, 2½, 2½, 4.
    #[test]
    fn ties_share_their_mean_rank() {
        assert_eq!(doubled_ranks(&[1.0, -2.0, 2.0, 4.0]), [2, 5, 5, 8]);
    }

    /// Of ranks 1 to 5 the negative one has rank 2. A sum of at most 2 comes from {}, {1} and {2}:
    /// 3 of 2⁵ ways, on two sides.
    #[test]
    fn the_test_is_exact_for_few_differences() {
        let test = signed_rank_test(&[1.0, -2.0, 3.0, 4.0, 5.0]);
        assert_eq!(
            test,
            SignedRankTest {
                statistic: 2.0,
                p: 6.0 / 32.0
            }
        );
    }

    /// Ranks 1½, 1½, 3 and a negative 1½. Sums of at most 1½: {}, {a}, {b}: 3 of 8 ways, on two
    /// sides. The 0 does not count.
    #[test]
    fn the_test_is_exact_with_ties_and_zeros() {
        assert_eq!(
            signed_rank_test(&[1.0, 0.0, -1.0, 3.0]),
            SignedRankTest {
                statistic: 1.5,
                p: 6.0 / 8.0
            }
        );
        assert_eq!(
            signed_rank_test(&[0.0, 0.0]),
            SignedRankTest {
                statistic: 0.0,
                p: 1.0
            }
        );
    }

    /// At the seam the approximation is near the exact test: all signs but those of the ranks 1 to
    /// 15 of 50 are positive.
    #[test]
    fn the_approximation_is_near_the_exact_test() {
        let ranks: Vec<usize> = (1..=50).map(|rank| 2 * rank).collect();
        let (exact, normal) = (exact_p(&ranks, 2 * 450), normal_p(&ranks, 2 * 450));
        assert!(
            (exact - normal).abs() < 0.002 && exact > 0.05,
            "{exact} {normal}"
        );
    }
}
