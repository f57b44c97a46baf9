//! Probability of improvement: probability that a run of one algorithm has a higher score than a
//! run of another (Agarwal et al. 2021, §4.3).
//!
//! ```
//! use seedbed_stats::improvement::probability_of_improvement;
//!
//! let (x, y) = (vec![3.0, 2.0], vec![1.0, 2.0]);
//! // 3 is above both scores of y; 2 is above 1 and equal to 2, which counts half.
//! assert_eq!(probability_of_improvement(&[x], &[y]).value, 3.5 / 4.0);
//! ```

use super::{Estimate, stratified_bootstrap_estimate};

/// P(X > Y), averaged over tasks, with its bootstrap interval. A tie counts half.
/// `x: [task][run]`, `y: [task][run]`
///
/// Higher scores count as better. If lower scores are better, negate `x` and `y`.
///
/// # Panics
/// If `x` and `y` have different numbers of tasks, or if a task has no runs.
#[must_use]
pub fn probability_of_improvement(x: &[Vec<f64>], y: &[Vec<f64>]) -> Estimate {
    assert_eq!(x.len(), y.len());
    let strata_of_both = [x, y].concat();
    stratified_bootstrap_estimate(&strata_of_both, |strata_of_both| {
        let (x, y) = strata_of_both.split_at(x.len());
        let shares_of_wins = x.iter().zip(y).map(|(x, y)| share_of_wins(x, y));
        shares_of_wins.sum::<f64>() / x.len() as f64
    })
}

/// Share of pairs (x, y) with x > y, a tie counting half: the Mann–Whitney U / (n m).
/// `x: [n]`, `y: [m]`
fn share_of_wins(x: &[f64], y: &[f64]) -> f64 {
    // A win counts as two half wins, a tie as one, so that the sum is a whole number.
    let mut half_wins = 0_u32;
    for x in x {
        for y in y {
            half_wins += u32::from(x > y) + u32::from(x >= y);
        }
    }
    f64::from(half_wins) / (2 * x.len() * y.len()) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Interval;

    /// 3 is above 1 and 2; 2 is above 1 and equal to 2: (2 + 1 + ½) of 4 pairs.
    #[test]
    fn ties_count_half() {
        assert_eq!(share_of_wins(&[3.0, 2.0], &[1.0, 2.0]), 3.5 / 4.0);
        assert_eq!(share_of_wins(&[f64::INFINITY], &[f64::INFINITY]), 0.5);
    }

    /// x is always above y in the first task and never in the second: ½ in every resample.
    #[test]
    fn the_probability_is_averaged_over_tasks() {
        let (low, high) = (vec![0.0; 5], vec![1.0; 6]);
        let half = probability_of_improvement(&[high.clone(), low.clone()], &[low, high]);
        assert_eq!(
            half,
            Estimate {
                value: 0.5,
                interval: Interval::Known {
                    low: 0.5,
                    high: 0.5
                }
            }
        );
    }
}
