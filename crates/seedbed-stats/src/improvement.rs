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

use super::Estimate;
use super::aggregate::sorted;
use super::bootstrap::{estimate_statistics, sizes};

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
    let levels = levels(x, y);
    let runs_of_x: usize = x.iter().map(Vec::len).sum();
    let mut counts = vec![0; levels.iter().max().map_or(0, |&level| level as usize + 1)];
    let estimates = estimate_statistics(&sizes(x.iter().chain(y)), 1, |drawn, probability| {
        let (mut of_x, mut of_y) = drawn.split_at(runs_of_x);
        let shares_of_wins = x.iter().zip(y).map(|(x, y)| {
            let (x_of_task, y_of_task);
            (x_of_task, of_x) = of_x.split_at(x.len());
            (y_of_task, of_y) = of_y.split_at(y.len());
            share_of_wins(&levels, x_of_task, y_of_task, &mut counts)
        });
        probability[0] = shares_of_wins.sum::<f64>() / x.len() as f64;
    });
    estimates[0]
}

/// Levels of all runs, first those of x: within a task, equal scores have equal levels, and higher
/// scores have higher levels.   `x: [task][run]`, `y: [task][run]` → `[run]`
fn levels(x: &[Vec<f64>], y: &[Vec<f64>]) -> Vec<u32> {
    let (mut levels_of_x, mut levels_of_y) = (Vec::new(), Vec::new());
    for (x, y) in x.iter().zip(y) {
        let mut distinct = sorted(&[&x[..], y].concat());
        distinct.retain(|score| !score.is_nan());
        distinct.dedup();
        let level = |score: &f64, level_of_nan: usize| {
            let level = 1 + distinct.partition_point(|other| other < score);
            (if score.is_nan() { level_of_nan } else { level }) as u32
        };
        // NaN is neither above nor below nor equal to any score. So as an x it has the lowest
        // level, where there is no y, and as a y the highest, where there is no x.
        levels_of_x.extend(x.iter().map(|score| level(score, 0)));
        levels_of_y.extend(y.iter().map(|score| level(score, distinct.len() + 1)));
    }
    [levels_of_x, levels_of_y].concat()
}

/// Share of pairs (x, y) with x > y, a tie counting half: the Mann–Whitney U / (n m).
/// `levels: [runs]`, `x: [n]` and `y: [m]` as indices of runs
///
/// Instead of comparing n m pairs, counts the scores of y at each level; `counts` has an entry for
/// each level.
fn share_of_wins(levels: &[u32], x: &[u32], y: &[u32], counts: &mut [u32]) -> f64 {
    counts.fill(0);
    for &run in y {
        counts[levels[run as usize] as usize] += 1;
    }
    // Half wins of an x at each level: two for each y below it and one for each y equal to it, so
    // that sums are whole numbers.
    let mut below = 0;
    for count in counts.iter_mut() {
        let equal = *count;
        *count = 2 * below + equal;
        below += equal;
    }
    let half_wins_of = |&run: &u32| u64::from(counts[levels[run as usize] as usize]);
    let half_wins: u64 = x.iter().map(half_wins_of).sum();
    half_wins as f64 / (2 * x.len() * y.len()) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Interval, stratified_bootstrap_estimate};

    /// The definition: the share of wins among all pairs, a tie counting half.
    fn share_of_pairs(x: &[f64], y: &[f64]) -> f64 {
        let pairs = x.iter().flat_map(|x| y.iter().map(move |y| (x, y)));
        let half_wins = pairs.map(|(x, y)| u32::from(x > y) + u32::from(x >= y));
        f64::from(half_wins.sum::<u32>()) / (2 * x.len() * y.len()) as f64
    }

    fn share(x: &[f64], y: &[f64]) -> f64 {
        probability_of_improvement(&[x.to_vec()], &[y.to_vec()]).value
    }

    /// 3 is above 1 and 2; 2 is above 1 and equal to 2: (2 + 1 + ½) of 4 pairs. NaN wins and loses
    /// nothing: of the pairs of NaN and 2 with 1 and NaN, only (2, 1) is a win.
    #[test]
    fn ties_count_half() {
        assert_eq!(share(&[3.0, 2.0], &[1.0, 2.0]), 3.5 / 4.0);
        assert_eq!(share(&[f64::INFINITY], &[f64::INFINITY]), 0.5);
        assert_eq!(share(&[0.0], &[-0.0]), 0.5);
        assert_eq!(share(&[f64::NAN, 2.0], &[1.0, f64::NAN]), 0.25);
    }

    /// Counting at levels gives the numbers of comparing all pairs in every resample, to the bit.
    #[test]
    fn counted_wins_equal_compared_pairs() {
        let scores = |n: u32, factor: u32| -> Vec<f64> {
            let score = |run: u32| f64::from(run * run * factor % 13) / 3.0 - 1.0;
            (0..n).map(score).collect()
        };
        let never = f64::INFINITY;
        let x = [scores(9, 5), vec![never, 1.0, -never, 0.0, never, 2.0]];
        let y = [scores(14, 7), vec![never, -0.0, 1.0, 1.0, 3.0]];
        let compared = stratified_bootstrap_estimate(&[&x[..], &y].concat(), |strata| {
            let [x0, x1, y0, y1] = strata else {
                unreachable!()
            };
            f64::midpoint(share_of_pairs(x0, y0), share_of_pairs(x1, y1))
        });
        assert_eq!(probability_of_improvement(&x, &y), compared);
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
