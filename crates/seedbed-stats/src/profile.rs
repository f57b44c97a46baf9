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

use super::Estimate;
use super::aggregate::sorted;
use super::bootstrap::bootstrap_statistics;

/// Share of the runs of all tasks that score above each threshold, with pointwise 95 % intervals.
/// `tasks: [task][run]`, `thresholds: [T]` → `[T]`
///
/// # Panics
/// If a task has no runs.
#[must_use]
pub fn performance_profile(tasks: &[Vec<f64>], thresholds: &[f64]) -> Vec<Estimate> {
    bootstrap_statistics(tasks, thresholds.len(), |tasks, shares| {
        let sorted = sorted(&tasks.concat());
        for (share, threshold) in shares.iter_mut().zip(thresholds) {
            let count_above = sorted.len() - sorted.partition_point(|score| score <= threshold);
            *share = count_above as f64 / sorted.len() as f64;
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Interval;

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
