//! Aggregates: one number for the scores of many runs (Agarwal et al. 2021, §4.3).
//!
//! [`median`] accepts infinite scores, which stand for runs that never reached a goal.
//!
//! ```
//! use seedbed_stats::aggregate::{interquartile_mean, mean, median};
//!
//! let scores = [0.0, 2.0, 3.0, 4.0, 100.0];
//! assert_eq!(mean(&scores), 21.8);
//! assert_eq!(median(&scores), 3.0);
//! assert_eq!(interquartile_mean(&scores), 3.0);
//! ```

/// Arithmetic mean.   `scores: [n]`
///
/// # Panics
/// If there are no scores.
#[must_use]
pub fn mean(scores: &[f64]) -> f64 {
    assert!(!scores.is_empty());
    scores.iter().sum::<f64>() / scores.len() as f64
}

/// Middle score, or the midpoint of the middle two; the midpoint of −∞ and ∞ is 0.
/// `scores: [n]`
///
/// # Panics
/// If there are no scores.
#[must_use]
pub fn median(scores: &[f64]) -> f64 {
    median_of_sorted(&sorted(scores))
}

/// [`median`] of scores that are in ascending order.   `sorted: [n]`
///
/// # Panics
/// If there are no scores.
#[must_use]
pub fn median_of_sorted(sorted: &[f64]) -> f64 {
    assert!(!sorted.is_empty());
    let (low, high) = (sorted[(sorted.len() - 1) / 2], sorted[sorted.len() / 2]);
    if low == -high {
        // Includes −∞ and ∞, whose mean would be NaN.
        0.0
    } else {
        f64::midpoint(low, high)
    }
}

/// The quantile `share` (0 to 1), interpolated linearly between scores like NumPy's default.
/// `scores: [n]`
///
/// # Panics
/// If there are no scores.
#[must_use]
pub fn quantile(scores: &[f64], share: f64) -> f64 {
    let sorted = sorted(scores);
    let position = share * (sorted.len() - 1) as f64;
    let below = position.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (position - below as f64) * (sorted[above] - sorted[below])
}

/// Interquartile mean (IQM): the mean without the ⌊n/4⌋ lowest and the ⌊n/4⌋ highest scores.
/// `scores: [n]`
///
/// Equals `scipy.stats.trim_mean(scores, 0.25)`. `rliable` applies it to all runs of all tasks at
/// once: `interquartile_mean(&tasks.concat())`.
///
/// # Panics
/// If there are no scores.
#[must_use]
pub fn interquartile_mean(scores: &[f64]) -> f64 {
    interquartile_mean_of_sorted(&sorted(scores))
}

/// [`interquartile_mean`] of scores that are in ascending order.   `sorted: [n]`
///
/// # Panics
/// If there are no scores.
#[must_use]
pub fn interquartile_mean_of_sorted(sorted: &[f64]) -> f64 {
    let dropped_per_end = sorted.len() / 4;
    mean(&sorted[dropped_per_end..sorted.len() - dropped_per_end])
}

/// Optimality gap: mean amount by which scores fall short of a goal γ, γ − mean(min(x, γ)).
/// `scores: [n]`
///
/// # Panics
/// If there are no scores.
#[must_use]
pub fn optimality_gap(scores: &[f64], goal: f64) -> f64 {
    assert!(!scores.is_empty());
    goal - scores.iter().map(|score| score.min(goal)).sum::<f64>() / scores.len() as f64
}

/// Mean over tasks of the mean score of each task, so that all tasks have the same weight.
/// `tasks: [task][run]`
///
/// # Panics
/// If there are no tasks, or if a task has no runs.
#[must_use]
pub fn mean_of_tasks(tasks: &[Vec<f64>]) -> f64 {
    mean(&mean_per_task(tasks))
}

/// Median over tasks of the mean score of each task, as `rliable` defines the median. For a single
/// task this is the mean of its scores.   `tasks: [task][run]`
///
/// # Panics
/// If there are no tasks, or if a task has no runs.
#[must_use]
pub fn median_of_tasks(tasks: &[Vec<f64>]) -> f64 {
    median(&mean_per_task(tasks))
}

fn mean_per_task(tasks: &[Vec<f64>]) -> Vec<f64> {
    tasks.iter().map(|runs| mean(runs)).collect()
}

/// Scores in ascending order.
pub(super) fn sorted(scores: &[f64]) -> Vec<f64> {
    assert!(!scores.is_empty());
    let mut sorted = scores.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_the_middle_score() {
        assert_eq!(median(&[9.0, 1.0, 2.0]), 2.0);
        // Halfway between 2 and 5.
        assert_eq!(median(&[9.0, 1.0, 5.0, 2.0]), 3.5);
        assert_eq!(median(&[f64::INFINITY, 1.0, 2.0]), 2.0);
        assert_eq!(
            median(&[f64::INFINITY, 1.0, f64::INFINITY, 2.0]),
            f64::INFINITY
        );
        assert_eq!(median(&[f64::INFINITY, f64::NEG_INFINITY]), 0.0);
        assert_eq!(median(&[-3.0, 3.0]), 0.0);
    }

    /// Four scores have positions 0 to 3: the quantile 0.75 is at 2.25, a quarter of the way from 4
    /// to 8.
    #[test]
    fn quantiles_are_interpolated() {
        assert_eq!(quantile(&[8.0, 1.0, 4.0, 2.0], 0.75), 5.0);
        assert_eq!(quantile(&[8.0, 1.0, 4.0, 2.0], 1.0), 8.0);
        assert_eq!(quantile(&[7.0], 0.05), 7.0);
    }

    /// Of nine scores, ⌊9/4⌋ = 2 are dropped at each end: (2 + 3 + 4 + 5 + 16) / 5 = 6. Of three
    /// scores none is dropped: (1 + 2 + 9) / 3 = 4.
    #[test]
    fn the_interquartile_mean_drops_whole_scores() {
        assert_eq!(
            interquartile_mean(&[900.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 16.0, 100.0]),
            6.0
        );
        assert_eq!(interquartile_mean(&[1.0, 9.0, 2.0]), 4.0);
    }

    /// The scores 0.5, 3 and −0.5 fall short of the goal 1 by 0.5, 0 and 1.5: mean 2/3.
    #[test]
    fn the_optimality_gap_ignores_scores_above_the_goal() {
        assert!((optimality_gap(&[0.5, 3.0, -0.5], 1.0) - 2.0 / 3.0).abs() < 1e-15);
    }

    /// The means of the three tasks are 2, 10 and 3, with mean 5 and median 3. The mean over all
    /// five runs would be 4.2.
    #[test]
    fn every_task_has_the_same_weight() {
        let tasks = [vec![1.0, 3.0], vec![10.0], vec![2.0, 4.0]];
        assert_eq!((mean_of_tasks(&tasks), median_of_tasks(&tasks)), (5.0, 3.0));
    }
}
