//! Performance profiles: which share of runs does better than τ, for every τ (Agarwal et al. 2021, §4.2).

use super::Estimate;
use super::aggregate::sorted;
use super::bootstrap::estimates;

/// The share of runs of all tasks above each threshold, with its pointwise band.
/// `tasks: [task][run]`, `thresholds: [T]` → `[T]`
///
/// # Panics
/// If a task has no runs.
#[must_use]
pub fn performance_profile(tasks: &[Vec<f64>], thresholds: &[f64]) -> Vec<Estimate> {
    estimates(tasks, thresholds.len(), |tasks, shares| {
        let sorted = sorted(&tasks.concat());
        for (share, threshold) in shares.iter_mut().zip(thresholds) {
            let above = sorted.len() - sorted.partition_point(|score| score <= threshold);
            *share = above as f64 / sorted.len() as f64;
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::statistics::Interval;

    /// Above 0 are all but the one at 0 itself; above 9 is none, however often they are redrawn.
    #[test]
    fn a_run_at_the_threshold_is_not_above_it() {
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
