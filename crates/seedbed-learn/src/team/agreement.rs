//! Agreement of the agents' intrinsic rewards: whether the same steps have high intrinsic rewards
//! for all agents.

/// Spearman's rank correlation of two agents' intrinsic rewards for the same N steps, averaged over
/// all pairs of agents. Ties share their mean rank. `rewards: [K][N]`. `None` for fewer than two
/// agents, or if all rewards of an agent are equal.
///
/// With ranks standardized to z, the mean of z_i·z_j/N over pairs i ≠ j is (‖Σ z‖²/N − K) / (K (K −
/// 1)), which takes O(K·N) instead of O(K²·N).
pub(super) fn mean_rank_correlation(rewards: &[Vec<f32>]) -> Option<f64> {
    let (agents, steps) = (rewards.len() as f64, rewards.first()?.len());
    let mut sum = vec![0.0; steps];
    for rewards_of_agent in rewards {
        let standardized_ranks = standardized(&ranks(rewards_of_agent))?;
        sum.iter_mut()
            .zip(standardized_ranks)
            .for_each(|(sum, z)| *sum += z);
    }
    let mean_square = sum.iter().map(|sum| sum * sum).sum::<f64>() / steps as f64;
    (rewards.len() > 1).then(|| (mean_square - agents) / (agents * (agents - 1.0)))
}

/// Ranks of values, from 1; equal values share the mean of their ranks. `values: [N]` → `[N]`
fn ranks(values: &[f32]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    let mut first = 0;
    for tied in order.chunk_by(|&a, &b| values[a] == values[b]) {
        let rank = first as f64 + 0.5 * (tied.len() as f64 + 1.0);
        for &index in tied {
            ranks[index] = rank;
        }
        first += tied.len();
    }
    ranks
}

/// Ranks with mean 0 and standard deviation 1; `None` if all ranks are equal.
fn standardized(ranks: &[f64]) -> Option<Vec<f64>> {
    let count = ranks.len() as f64;
    let mean = ranks.iter().sum::<f64>() / count;
    let deviation = (ranks.iter().map(|rank| (rank - mean).powi(2)).sum::<f64>() / count).sqrt();
    (deviation > 0.0).then(|| ranks.iter().map(|rank| (rank - mean) / deviation).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tied_values_share_their_ranks() {
        assert_eq!(ranks(&[3.0, 1.0, 3.0, 2.0]), [3.5, 1.0, 3.5, 2.0]);
    }

    /// Ranks 1 2 3 4 and 2 1 4 3: 1 − 6 Σd²/(n(n² − 1)) = 1 − 6·4/60 = 0.6. With a third agent
    /// whose rewards equal those of the first, the mean over pairs is (1 + 0.6 + 0.6)/3.
    #[test]
    fn correlations_equal_those_computed_by_hand() {
        let (one, other) = (vec![1.0, 5.0, 6.0, 90.0], vec![0.2, 0.1, 0.4, 0.3]);
        let close = |value: Option<f64>, expected: f64| (value.unwrap() - expected).abs() < 1e-12;
        assert!(close(
            mean_rank_correlation(&[one.clone(), other.clone()]),
            0.6
        ));
        assert!(close(
            mean_rank_correlation(&[one.clone(), one.clone(), other]),
            2.2 / 3.0
        ));
        let reversed = one.iter().map(|value| -value).collect();
        assert!(close(mean_rank_correlation(&[one.clone(), reversed]), -1.0));
        assert_eq!(mean_rank_correlation(std::slice::from_ref(&one)), None);
        assert_eq!(mean_rank_correlation(&[one, vec![1.0; 4]]), None);
        assert_eq!(mean_rank_correlation(&[]), None);
    }
}
