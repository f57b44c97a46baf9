//! Performance profiles: share of runs above a threshold τ, for every τ (Agarwal et al. 2021,
//! §4.2).
//!
//! ```
//! use seedbed_stats::profile::performance_profile;
//!
//! let profile = performance_profile(&[vec![0.0, 1.0, 2.0, 3.0, 4.0]], &[-1.0, 0.0, 9.0]);
//! let shares: Vec<f64> = profile.iter().map(|point| point.value).collect();
//! assert_eq!(shares, [1.0, 0.8, 0.0]);
//! ```

use super::aggregate::sorted;
use super::bootstrap::{
    RESAMPLES, for_each_counts, interval_between, sizes, smallest_stratum, sorted_runs,
};
use super::{Estimate, Interval, MIN_RUNS};

/// Share of the runs of all tasks that score above each threshold, with pointwise 95 % intervals.
/// `tasks: [task][run]`, `thresholds: [T]` → `[T]`
///
/// # Panics
/// If a task has no runs.
#[must_use]
pub fn performance_profile(tasks: &[Vec<f64>], thresholds: &[f64]) -> Vec<Estimate> {
    let (scores, sizes) = (tasks.concat(), sizes(tasks));
    let (sorted, n) = (sorted(&scores), smallest_stratum(&sizes));
    let count_up_to = |value: &f64| sorted.partition_point(|score| score <= value);
    let counts_up_to: Vec<usize> = thresholds.iter().map(count_up_to).collect();
    let intervals = if n < MIN_RUNS {
        vec![Interval::TooFewRuns { n }; thresholds.len()]
    } else {
        resampled_intervals(&sizes, &sorted_runs(&[tasks.to_vec()]), &counts_up_to)
    };
    let share_above = |&count: &usize| (scores.len() - count) as f64 / scores.len() as f64;
    let values = counts_up_to.iter().map(share_above);
    values
        .zip(intervals)
        .map(|(value, interval)| Estimate { value, interval })
        .collect()
}

/// 95 % intervals of the share of runs above each threshold.   `sizes: [task]`, `order: [n]`,
/// `counts_up_to: [T]` → `[T]`
///
/// A share is a count of runs out of n. So it suffices to count how many resamples have each count,
/// instead of sorting the shares of all resamples.
fn resampled_intervals(sizes: &[usize], order: &[u32], counts_up_to: &[usize]) -> Vec<Interval> {
    let n = order.len();
    let mut resamples_with_count = vec![vec![0_u32; n + 1]; counts_up_to.len()];
    // Numbers of drawn runs at all earlier positions.
    let mut drawn_before = vec![0_u32; n + 1];
    for_each_counts(sizes, |counts| {
        for (position, &run) in order.iter().enumerate() {
            drawn_before[position + 1] = drawn_before[position] + u32::from(counts[run as usize]);
        }
        for (resamples, &count) in resamples_with_count.iter_mut().zip(counts_up_to) {
            resamples[n - drawn_before[count] as usize] += 1;
        }
    });
    let interval = |resamples: &Vec<u32>| {
        interval_between(RESAMPLES, |index| {
            count_at(resamples, index).map(|count| count as f64 / n as f64)
        })
    };
    resamples_with_count.iter().map(interval).collect()
}

/// Counts of the resample at `index` and of the next one, in ascending order of counts.
/// `resamples_with_count: [n + 1]`
fn count_at(resamples_with_count: &[u32], index: usize) -> [usize; 2] {
    [index, index + 1].map(|index| {
        let mut resamples = 0;
        let is_reached = |&with_count: &u32| {
            resamples += with_count as usize;
            resamples > index
        };
        let count = resamples_with_count.iter().position(is_reached);
        count.unwrap_or(resamples_with_count.len() - 1)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bootstrap::bootstrap_statistics;

    /// The definition: the share of each resample above each threshold.
    fn naive_profile(tasks: &[Vec<f64>], thresholds: &[f64]) -> Vec<Estimate> {
        bootstrap_statistics(tasks, thresholds.len(), |tasks, shares| {
            for (share, threshold) in shares.iter_mut().zip(thresholds) {
                let scores = tasks.concat();
                let above = scores.iter().filter(|score| *score > threshold).count();
                *share = above as f64 / scores.len() as f64;
            }
        })
    }

    /// Also with ties, infinite scores and thresholds in any order.
    #[test]
    fn counted_profiles_equal_the_definition() {
        let never = f64::INFINITY;
        let tasks = [
            vec![0.3, 1.0, never, 1.0, -0.0, 2.0, 7.0],
            vec![0.0, 0.0, 5.0, -never, 0.3],
        ];
        let thresholds = [1.0, -never, -1.0, 0.0, 0.3, 6.0, 7.0, 9.0, never];
        assert_eq!(
            performance_profile(&tasks, &thresholds),
            naive_profile(&tasks, &thresholds)
        );
        assert_eq!(
            performance_profile(&tasks[1..], &thresholds),
            naive_profile(&tasks[1..], &thresholds)
        );
    }

    /// All scores are above −1, all but one are above 0, and none is above 9, not even in a
    /// resample.
    #[test]
    fn the_profile_counts_runs_strictly_above_the_threshold() {
        let profile = performance_profile(&[vec![0.0, 1.0, 2.0, 3.0, 4.0]], &[-1.0, 0.0, 9.0]);
        assert_eq!(
            profile
                .iter()
                .map(|point| point.value)
                .collect::<Vec<f64>>(),
            [1.0, 0.8, 0.0]
        );
        assert_eq!(
            profile[2].interval,
            Interval::Known {
                low: 0.0,
                high: 0.0
            }
        );
    }
}
