//! Paired comparison of two algorithms that were run with the same run seeds.
//!
//! ```
//! use seedbed_stats::paired::{differences, signed_rank_test};
//!
//! let (x, y) = ([3.0, 5.0, 9.0, 7.0, 8.0], [2.0, 3.0, 6.0, 3.0, 3.0]);
//! let differences = differences(&x, &y);
//! assert_eq!(differences, [1.0, 2.0, 3.0, 4.0, 5.0]);
//! // All differences have the same sign: p = 2 / 2⁵.
//! assert_eq!(signed_rank_test(&differences).p, 0.0625);
//! ```

use super::two_sided_normal;

/// Maximum number of differences for which the signed-rank test is exact.
const MAX_EXACT_DIFFERENCES: usize = 50;

/// Differences x − y, seed by seed. The difference of equal values is 0, even if they are infinite.
/// `x: [n]`, `y: [n]` → `[n]`
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

/// Wilcoxon's signed-rank test, two-sided, of whether differences are symmetric around 0.
/// `differences: [n]`
///
/// Differences of 0 are dropped, and tied differences get their mean rank. With at most 50 nonzero
/// differences the test is the exact permutation test over all signs, also for ties. With more
/// differences it is the normal approximation with the variance corrected for ties, without
/// continuity correction. This equals the default of `scipy.stats.wilcoxon`, except for 14 to 50
/// differences with ties or zeros, for which scipy uses the approximation.
#[must_use]
pub fn signed_rank_test(differences: &[f64]) -> SignedRankTest {
    let mut nonzero: Vec<f64> = differences.to_vec();
    nonzero.retain(|difference| *difference != 0.0);
    nonzero.sort_unstable_by(|a, b| a.abs().total_cmp(&b.abs()));
    let ranks = doubled_ranks(&nonzero);
    let mut positive_rank_sum = 0;
    for (difference, rank) in nonzero.iter().zip(&ranks) {
        if *difference > 0.0 {
            positive_rank_sum += rank;
        }
    }
    let total_rank_sum: usize = ranks.iter().sum();
    let smaller_rank_sum = positive_rank_sum.min(total_rank_sum - positive_rank_sum);
    let p = if nonzero.len() <= MAX_EXACT_DIFFERENCES {
        exact_p_value(&ranks, smaller_rank_sum)
    } else {
        approximate_p_value(&ranks, smaller_rank_sum)
    };
    SignedRankTest {
        statistic: smaller_rank_sum as f64 / 2.0,
        p,
    }
}

/// Twice the rank of each difference, ranked by magnitude.   `sorted: [n]` by magnitude → `[n]`
///
/// Tied differences get their mean rank, which may end in ½. Doubled ranks are whole numbers, so
/// that their sums can be indices.
fn doubled_ranks(sorted: &[f64]) -> Vec<usize> {
    let mut ranks = Vec::with_capacity(sorted.len());
    for ties in sorted.chunk_by(|a, b| a.abs() == b.abs()) {
        let smaller_count = ranks.len();
        // Ranks `smaller_count + 1` to `smaller_count + ties` have the mean `smaller_count + (ties
        // + 1) / 2`.
        ranks.extend(std::iter::repeat_n(
            2 * smaller_count + ties.len() + 1,
            ties.len(),
        ));
    }
    ranks
}

/// min(1, 2 P(W ≤ w)) for the sum W of the ranks of positive differences, each of which is positive
/// with probability ½. `ranks` and w, `smaller_rank_sum`, are [doubled](doubled_ranks).
///
/// The distribution of W is computed by adding one rank at a time:
/// P(W = w) ← ½ P(W = w) + ½ P(W = w − rank).
fn exact_p_value(ranks: &[usize], smaller_rank_sum: usize) -> f64 {
    let mut probabilities = vec![0.0; ranks.iter().sum::<usize>() + 1];
    probabilities[0] = 1.0;
    for &rank in ranks {
        // In descending order of sums, so that the entry at `sum - rank` does not include this rank
        // yet.
        for sum in (0..probabilities.len()).rev() {
            let before_this_rank = if sum < rank {
                0.0
            } else {
                probabilities[sum - rank]
            };
            probabilities[sum] = f64::midpoint(probabilities[sum], before_this_rank);
        }
    }
    (2.0 * probabilities[..=smaller_rank_sum].iter().sum::<f64>()).min(1.0)
}

/// Normal approximation of [`exact_p_value`]: W has mean ½ Σ r and variance ¼ Σ r², also for ties.
fn approximate_p_value(ranks: &[usize], smaller_rank_sum: usize) -> f64 {
    let mean = ranks.iter().sum::<usize>() as f64 / 2.0;
    let variance = ranks.iter().map(|rank| rank * rank).sum::<usize>() as f64 / 4.0;
    two_sided_normal((smaller_rank_sum as f64 - mean) / variance.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_infinities_have_difference_zero() {
        let never = f64::INFINITY;
        assert_eq!(
            differences(&[never, never, 3.0, 3.0], &[never, 5.0, never, 1.0]),
            [0.0, never, -never, 2.0]
        );
    }

    /// The magnitudes 1, 2, 2, 4 have ranks 1, 2½, 2½, 4.
    #[test]
    fn tied_differences_get_their_mean_rank() {
        assert_eq!(doubled_ranks(&[1.0, -2.0, 2.0, 4.0]), [2, 5, 5, 8]);
    }

    /// The differences have ranks 1 to 5; only the one with rank 2 is negative. Three of the 2⁵
    /// sets of ranks, {}, {1} and {2}, have a sum of at most 2, so p = 2 · 3 / 2⁵.
    #[test]
    fn the_signed_rank_test_is_exact_for_few_differences() {
        let test = signed_rank_test(&[1.0, -2.0, 3.0, 4.0, 5.0]);
        assert_eq!(
            test,
            SignedRankTest {
                statistic: 2.0,
                p: 6.0 / 32.0
            }
        );
    }

    /// The nonzero differences have ranks 1½, 1½ and 3; the only negative one has rank 1½. Three of
    /// the 8 sets of ranks have a sum of at most 1½, so p = 2 · 3 / 8. The difference of 0 is
    /// dropped.
    #[test]
    fn the_signed_rank_test_is_exact_with_ties_and_zeros() {
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

    /// For 50 differences without ties, of which those of one sign have the rank sum 450, the
    /// approximate p-value is close to the exact p-value.
    #[test]
    fn the_normal_approximation_is_close_to_the_exact_test() {
        let ranks: Vec<usize> = (1..=50).map(|rank| 2 * rank).collect();
        let (exact, normal) = (
            exact_p_value(&ranks, 2 * 450),
            approximate_p_value(&ranks, 2 * 450),
        );
        assert!(
            (exact - normal).abs() < 0.002 && exact > 0.05,
            "{exact} {normal}"
        );
    }
}
