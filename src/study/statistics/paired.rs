//! Two algorithms run with the same seeds, compared seed by seed.

use super::two_sided_normal;

/// Up to so many differences the signed-rank test is exact.
const MOST_EXACT: usize = 50;

/// Seed by seed, x − y; 0 where they are equal, even where both are infinite.   `x: [n]`, `y: [n]` → `[n]`
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

/// Wilcoxon's signed-rank test of differences that scatter evenly around 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignedRank {
    /// The smaller of the rank sums of positive and negative differences.
    pub statistic: f64,
    /// The two-sided p; 1 where all differences are 0.
    pub p: f64,
}

/// Wilcoxon's signed-rank test, two-sided. Differences of 0 are left out and ties share their mean rank.   `differences: [n]`
///
/// Up to 50 differences other than 0 it is exact, ties or not: the permutation test over all signs. Beyond, it is the normal
/// approximation with the variance corrected for ties and without correction for continuity. So it is what
/// `scipy.stats.wilcoxon` does by default, but for ties or zeros among 14 to 50 differences, where scipy approximates.
#[must_use]
pub fn signed_rank(differences: &[f64]) -> SignedRank {
    let mut others: Vec<f64> = differences
        .iter()
        .copied()
        .filter(|difference| *difference != 0.0)
        .collect();
    others.sort_unstable_by(|a, b| a.abs().total_cmp(&b.abs()));
    let ranks = doubled_ranks(&others);
    let positive: usize = others
        .iter()
        .zip(&ranks)
        .filter(|(difference, _)| **difference > 0.0)
        .map(|(_, rank)| rank)
        .sum();
    let all: usize = ranks.iter().sum();
    let smaller = positive.min(all - positive);
    let p = if others.len() <= MOST_EXACT {
        exact_p(&ranks, smaller)
    } else {
        normal_p(&ranks, smaller)
    };
    SignedRank {
        statistic: smaller as f64 / 2.0,
        p,
    }
}

/// Twice the rank of each by magnitude, so that the mean rank of ties is whole.   `sorted: [n]` by magnitude → `[n]`
fn doubled_ranks(sorted: &[f64]) -> Vec<usize> {
    let mut ranks = Vec::with_capacity(sorted.len());
    for ties in sorted.chunk_by(|a, b| a.abs() == b.abs()) {
        let before = ranks.len();
        ranks.extend(std::iter::repeat_n(2 * before + ties.len() + 1, ties.len()));
    }
    ranks
}

/// 2 P(W ≤ w) where each rank is positive with probability ½, at most 1.
///
/// The distribution of the sum grows rank by rank: P(W = w) ← ½ P(W = w) + ½ P(W = w − rank).
fn exact_p(ranks: &[usize], smaller: usize) -> f64 {
    let mut probabilities = vec![0.0; ranks.iter().sum::<usize>() + 1];
    probabilities[0] = 1.0;
    for &rank in ranks {
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

/// Of ranks that are positive with probability ½ the sum has mean ½ Σ r and variance ¼ Σ r², ties or not.
fn normal_p(ranks: &[usize], smaller: usize) -> f64 {
    let mean = ranks.iter().sum::<usize>() as f64 / 2.0;
    let variance = ranks.iter().map(|rank| rank * rank).sum::<usize>() as f64 / 4.0;
    two_sided_normal((smaller as f64 - mean) / variance.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn infinities_differ_from_numbers_alone() {
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

    /// Of ranks 1 to 5 the negative one has rank 2. A sum of at most 2 comes from {}, {1} and {2}: 3 of 2⁵ ways, on two sides.
    #[test]
    fn few_differences_are_counted_out() {
        let test = signed_rank(&[1.0, -2.0, 3.0, 4.0, 5.0]);
        assert_eq!(
            test,
            SignedRank {
                statistic: 2.0,
                p: 6.0 / 32.0
            }
        );
    }

    /// Ranks 1½, 1½, 3 and a negative 1½. Sums of at most 1½: {}, {a}, {b}: 3 of 8 ways, on two sides. The 0 does not count.
    #[test]
    fn ties_and_zeros_are_counted_out_too() {
        assert_eq!(
            signed_rank(&[1.0, 0.0, -1.0, 3.0]),
            SignedRank {
                statistic: 1.5,
                p: 6.0 / 8.0
            }
        );
        assert_eq!(
            signed_rank(&[0.0, 0.0]),
            SignedRank {
                statistic: 0.0,
                p: 1.0
            }
        );
    }

    /// At the seam the approximation is near the exact test: all signs but those of the ranks 1 to 15 of 50 are positive.
    #[test]
    fn the_approximation_joins_on() {
        let ranks: Vec<usize> = (1..=50).map(|rank| 2 * rank).collect();
        let (exact, normal) = (exact_p(&ranks, 2 * 450), normal_p(&ranks, 2 * 450));
        assert!(
            (exact - normal).abs() < 0.002 && exact > 0.05,
            "{exact} {normal}"
        );
    }
}
