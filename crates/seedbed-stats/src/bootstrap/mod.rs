//! Stratified percentile bootstrap: 95 % confidence intervals of any statistic.
//!
//! Runs are resampled with replacement within each stratum (usually a task), never across strata
//! (Agarwal et al. 2021, §4.1; `StratifiedBootstrap` of their package rliable).
//!
//! ```
//! use seedbed_stats::aggregate::{mean, mean_of_tasks};
//! use seedbed_stats::bootstrap::{bootstrap_estimate, stratified_bootstrap_estimate};
//!
//! // One task, five runs.
//! let estimate = bootstrap_estimate(&[3.0, 1.0, 4.0, 1.0, 5.0], mean);
//! assert_eq!(estimate.value, 2.8);
//!
//! // Two tasks: every resample has as many runs per task as the data.
//! let tasks = [vec![0.0; 5], vec![10.0; 5]];
//! let estimate = stratified_bootstrap_estimate(&tasks, mean_of_tasks);
//! assert_eq!(estimate.interval.ends(), Some([5.0, 5.0]));
//! ```

mod draws;
mod sorted_sums;

use super::aggregate::{interquartile_mean_of_sorted, mean, sorted};
use super::{Estimate, Interval, MIN_RUNS};
pub(crate) use draws::for_each_counts;
use draws::{for_each_counts_of_lanes, for_each_resample};
use sorted_sums::SortedSums;

/// Number of resamples, as in `rliable`.
///
/// If the bootstrap distribution is normal with standard deviation σ, the Monte-Carlo error of an
/// interval end is √(0.025 · 0.975 / 50 000) / φ(1.96) σ ≈ 0.012 σ.
pub const RESAMPLES: usize = 50_000;

/// Shares of resampled values below the lower and below the upper end of a 95 % interval.
const INTERVAL_SHARES: (f64, f64) = (0.025, 0.975);

/// Estimates a statistic of strata, such as the runs of each task, with its 95 % interval.
/// `strata: [stratum][run]`
///
/// To compare two algorithms, pass the strata of both, one after the other, and let `statistic`
/// compute the difference. There is an interval if the smallest stratum has at least [`MIN_RUNS`]
/// runs.
///
/// # Panics
/// If there is no stratum, or if a stratum is empty.
#[must_use]
pub fn stratified_bootstrap_estimate(
    strata: &[Vec<f64>],
    statistic: impl Fn(&[Vec<f64>]) -> f64,
) -> Estimate {
    bootstrap_statistics(strata, 1, |strata, values| values[0] = statistic(strata))[0]
}

/// Estimates a statistic of a single sample, with its 95 % interval.   `sample: [run]`
///
/// # Panics
/// If the sample is empty.
#[must_use]
pub fn bootstrap_estimate(sample: &[f64], statistic: impl Fn(&[f64]) -> f64) -> Estimate {
    stratified_bootstrap_estimate(&[sample.to_vec()], |strata| statistic(&strata[0]))
}

/// Estimates several statistics from the same resamples, each with its 95 % interval.
/// `strata: [stratum][run]` → `[count]`
///
/// `statistic` fills a slice with the `count` values of the statistics.
///
/// # Panics
/// If there is no stratum, or if a stratum is empty.
#[must_use]
pub fn bootstrap_statistics(
    strata: &[Vec<f64>],
    count: usize,
    statistic: impl Fn(&[Vec<f64>], &mut [f64]),
) -> Vec<Estimate> {
    let runs = strata.concat();
    let mut resampled = strata.to_vec();
    estimate_statistics(&sizes(strata), count, |drawn, values| {
        let mut drawn = drawn.iter();
        for resampled in &mut resampled {
            for (resampled, &run) in resampled.iter_mut().zip(&mut drawn) {
                *resampled = runs[run as usize];
            }
        }
        statistic(&resampled, values);
    })
}

/// Estimates several statistics that depend on the sorted scores of groups, such as medians, from
/// the same resamples, each with its 95 % interval.   `groups: [group][stratum][run]` → `[count]`
///
/// `statistic` gets the scores of each group in ascending order, `[group][run]`, and fills a slice
/// with the `count` values of the statistics. Results are to the bit those of
/// [`bootstrap_statistics`] with all strata, one after the other, and a statistic that sorts the
/// scores of each group by [`f64::total_cmp`]. Scores are sorted once: a resample needs only the
/// number of times that each run was drawn.
///
/// # Panics
/// If there is no stratum, or if a stratum is empty.
#[must_use]
pub fn bootstrap_sorted_statistics(
    groups: &[Vec<Vec<f64>>],
    count: usize,
    statistic: impl Fn(&[Vec<f64>], &mut [f64]),
) -> Vec<Estimate> {
    let sorted: Vec<Vec<f64>> = groups.iter().map(|group| sorted(&group.concat())).collect();
    let sizes = sizes(groups.iter().flatten());
    let n = smallest_stratum(&sizes);
    let mut values = vec![0.0; count];
    statistic(&sorted, &mut values);
    if sorted.iter().all(|group| has_equal_bits(group)) {
        return estimates_of_equal_scores(n, &values);
    }
    let (order, mut resampled) = (sorted_runs(groups), sorted.clone());
    estimates(n, &values.clone(), |add| {
        for_each_counts(&sizes, |counts| {
            let mut order = &order[..];
            for (sorted, resampled) in sorted.iter().zip(&mut resampled) {
                let (of_group, others) = order.split_at(sorted.len());
                repeat_scores(sorted, of_group, counts, resampled);
                order = others;
            }
            statistic(&resampled, &mut values);
            add(&values);
        });
    })
}

/// Estimates the mean and the interquartile mean of a sample from the same resamples, each with its
/// 95 % interval.   `sample: [run]`
///
/// Sums of resamples of finite scores are those of products of scores and numbers of draws: they may differ in their
/// last digits from sums of one score after the other.
///
/// # Panics
/// If the sample is empty.
#[must_use]
pub fn bootstrap_mean_and_interquartile_mean(sample: &[f64]) -> [Estimate; 2] {
    let (sorted, n) = (sorted(sample), sample.len());
    let groups = [vec![sample.to_vec()]];
    let means = |sorted: &[f64]| [mean(sorted), interquartile_mean_of_sorted(sorted)];
    let is_finite = sorted.iter().all(|score| score.is_finite());
    let estimates = if has_equal_bits(&sorted) || !is_finite {
        bootstrap_sorted_statistics(&groups, 2, |groups, values| {
            values.copy_from_slice(&means(&groups[0]));
        })
    } else {
        let (order, middle) = (sorted_runs(&groups), n / 4..n - n / 4);
        let sums = SortedSums {
            sorted: &sorted,
            order: &order,
            middle: &middle,
        };
        estimates(n, &means(&sorted), |add| {
            for_each_counts_of_lanes(n, |counts| {
                let [all, inner] = sums.of(counts);
                for (all, inner) in all.into_iter().zip(inner) {
                    add(&[all / n as f64, inner / middle.len() as f64]);
                }
            });
        })
    };
    [estimates[0], estimates[1]]
}

/// Whether all sorted scores have the same bits.
fn has_equal_bits(sorted: &[f64]) -> bool {
    sorted.first().map(|score| score.to_bits()) == sorted.last().map(|score| score.to_bits())
}

/// Estimates statistics of samples in which all scores are equal: every resample equals the data.
/// `n`: number of runs of the smallest stratum
fn estimates_of_equal_scores(n: usize, values: &[f64]) -> Vec<Estimate> {
    let estimate = |&value: &f64| Estimate {
        value,
        interval: Interval::of_runs(n, value, value),
    };
    values.iter().map(estimate).collect()
}

/// Estimates the mean over runs of each of several quantities, from the same resamples, each with
/// its 95 % interval.   `runs: [run][count]` → `[count]`
///
/// # Panics
/// If there are no runs, or if the numbers of quantities differ.
#[must_use]
pub fn bootstrap_means(runs: &[Vec<f64>]) -> Vec<Estimate> {
    assert!(!runs.is_empty(), "no runs");
    estimate_statistics(&[runs.len()], runs[0].len(), |drawn, means| {
        // As the sum of an iterator begins, so that the sum of −0 is −0.
        means.fill(-0.0);
        for &run in drawn {
            let run = &runs[run as usize];
            assert_eq!(run.len(), means.len());
            for (sum, value) in means.iter_mut().zip(run) {
                *sum += value;
            }
        }
        for mean in means {
            *mean /= runs.len() as f64;
        }
    })
}

/// Number of runs of each stratum.
pub(crate) fn sizes<'a>(strata: impl IntoIterator<Item = &'a Vec<f64>>) -> Vec<usize> {
    strata.into_iter().map(Vec::len).collect()
}

/// Estimates `count` statistics of the runs with these numbers, counted over all strata.
/// `sizes: [stratum]` → `[count]`
///
/// # Panics
/// If there is no stratum, or if a stratum is empty.
pub(crate) fn estimate_statistics(
    sizes: &[usize],
    count: usize,
    mut statistic: impl FnMut(&[u32], &mut [f64]),
) -> Vec<Estimate> {
    let mut values = vec![0.0; count];
    let all_runs: Vec<u32> = (0..sizes.iter().sum::<usize>() as u32).collect();
    statistic(&all_runs, &mut values);
    estimates(smallest_stratum(sizes), &values.clone(), |add| {
        for_each_resample(sizes, |drawn| {
            statistic(drawn, &mut values);
            add(&values);
        });
    })
}

/// Estimates of statistics with these values. If the smallest stratum has enough runs for an interval, `resample` calls
/// its argument with the values in each resample.   `values: [count]` → `[count]`
fn estimates(
    n: usize,
    values: &[f64],
    resample: impl FnOnce(&mut dyn FnMut(&[f64])),
) -> Vec<Estimate> {
    let intervals = if n < MIN_RUNS {
        vec![Interval::TooFewRuns { n }; values.len()]
    } else {
        let mut of_resamples = vec![Vec::with_capacity(RESAMPLES); values.len()];
        resample(&mut |values| {
            for (of_resamples, &value) in of_resamples.iter_mut().zip(values) {
                of_resamples.push(value);
            }
        });
        of_resamples.into_iter().map(percentile_interval).collect()
    };
    let estimate = |(&value, interval)| Estimate { value, interval };
    values.iter().zip(intervals).map(estimate).collect()
}

/// Number of runs of the smallest stratum.
///
/// # Panics
/// If there is no stratum, or if a stratum is empty.
pub(crate) fn smallest_stratum(sizes: &[usize]) -> usize {
    let smallest = sizes.iter().copied().min().unwrap_or(0);
    assert!(smallest > 0, "a stratum without runs");
    smallest
}

/// The run at each position of the sorted scores of all groups, group after group, counted over all strata.
/// `groups: [group][stratum][run]` → `[run]`
pub(crate) fn sorted_runs(groups: &[Vec<Vec<f64>>]) -> Vec<u32> {
    let mut runs: Vec<u32> = Vec::new();
    for group in groups {
        let (scores, first) = (group.concat(), runs.len());
        let mut order: Vec<usize> = (0..scores.len()).collect();
        order.sort_by(|&a, &b| scores[a].total_cmp(&scores[b]));
        runs.extend(order.into_iter().map(|run| (first + run) as u32));
    }
    runs
}

/// Largest number of draws of one run that is not exceptional: five or more draws have probability
/// 0.4 % in a large sample.
const USUAL_DRAWS: usize = 4;

/// Repeats each score as often as its run was drawn.   `sorted: [m]`, `order: [m]` runs of these scores,
/// `counts: [n]` → `repeated: [m]`
fn repeat_scores(sorted: &[f64], order: &[u32], counts: &[u16], repeated: &mut [f64]) {
    let mut end = 0;
    for (&score, &run) in sorted.iter().zip(order) {
        let count = usize::from(counts[run as usize]);
        let rest = &mut repeated[end..];
        // Always writes four scores, of which later scores overwrite those too many: a loop of an
        // unpredictable length takes several times as long.
        match rest.first_chunk_mut::<USUAL_DRAWS>() {
            Some(usual) if count <= USUAL_DRAWS => *usual = [score; USUAL_DRAWS],
            _ => rest[..count].fill(score),
        }
        end += count;
    }
}

fn percentile_interval(mut values: Vec<f64>) -> Interval {
    interval_between(values.len(), |index| neighbors(&mut values, index))
}

/// The 95 % interval of `count` values, of which `neighbors(i)` are the i-th and the next in
/// ascending order; the next of the last is any number.
pub(crate) fn interval_between(
    count: usize,
    mut neighbors: impl FnMut(usize) -> [f64; 2],
) -> Interval {
    Interval::Known {
        low: percentile(count, INTERVAL_SHARES.0, &mut neighbors),
        high: percentile(count, INTERVAL_SHARES.1, &mut neighbors),
    }
}

/// Percentile of `count` values, with linear interpolation between neighboring values, as
/// `numpy.percentile`. `neighbors` is as in [`interval_between`].
fn percentile(count: usize, share: f64, neighbors: impl FnOnce(usize) -> [f64; 2]) -> f64 {
    let position = share * (count - 1) as f64;
    interpolate(neighbors(position.floor() as usize), position.fract())
}

/// The value that has `index` values below it, and the next one. Reorders the values.
fn neighbors(values: &mut [f64], index: usize) -> [f64; 2] {
    let (_, &mut value, above) = values.select_nth_unstable_by(index, f64::total_cmp);
    let next = above.iter().copied().min_by(f64::total_cmp);
    [value, next.unwrap_or(value)]
}

/// Linear interpolation between neighboring values, `fraction` of the way.
fn interpolate([low, high]: [f64; 2], fraction: f64) -> f64 {
    // Statistics of runs that never reached a goal may be infinite. ∞ − ∞ is NaN, so equal
    // neighbors are not interpolated.
    if fraction == 0.0 || low == high {
        return low;
    }
    // Between a finite value and ∞, interpolation gives ∞ for every fraction above 0.
    if low.is_finite() {
        return low + (high - low) * fraction;
    }
    // Between −∞ and a finite value, interpolation would give −∞ + ∞ = NaN: take the nearer
    // neighbor.
    if fraction < 0.5 { low } else { high }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aggregate::{interquartile_mean, mean_of_tasks, median, median_of_sorted};

    fn percentile(values: &[f64], share: f64) -> f64 {
        super::percentile(values.len(), share, |index| {
            neighbors(&mut values.to_vec(), index)
        })
    }

    /// Position 0.025 · 4 = 0.1 is a tenth of the way from the first to the second value.
    #[test]
    fn percentiles_are_interpolated() {
        assert!((percentile(&[40.0, 20.0, 50.0, 30.0, 10.0], 0.025) - 11.0).abs() < 1e-12);
        assert_eq!(percentile(&[10.0, 20.0, 30.0, 40.0, 50.0], 0.5), 30.0);
        assert_eq!(
            percentile(&[1.0, f64::INFINITY, f64::INFINITY], 0.975),
            f64::INFINITY
        );
        assert_eq!(
            [0.1, 0.4].map(|share| percentile(&[f64::NEG_INFINITY, 1.0, 2.0], share)),
            [f64::NEG_INFINITY, 1.0]
        );
    }

    #[test]
    fn fewer_than_five_runs_give_no_interval() {
        let estimate_of_four = bootstrap_estimate(&[1.0, 2.0, 3.0, 4.0], median);
        assert_eq!(
            estimate_of_four,
            Estimate {
                value: 2.5,
                interval: Interval::TooFewRuns { n: 4 }
            }
        );
        let estimate_with_a_short_task =
            stratified_bootstrap_estimate(&[vec![1.0; 9], vec![2.0; 3]], mean_of_tasks);
        assert_eq!(
            estimate_with_a_short_task.interval,
            Interval::TooFewRuns { n: 3 }
        );
    }

    #[test]
    fn equal_data_give_equal_intervals() {
        let sample = [3.0, 1.0, 4.0, 1.0, 5.0, 9.0, 2.0];
        assert_eq!(
            bootstrap_estimate(&sample, mean),
            bootstrap_estimate(&sample, mean)
        );
    }

    /// Two tasks have the constant scores 0 and 10. If runs are resampled within their task, every
    /// resample has the mean 5; resamples across tasks would have different means.
    #[test]
    fn runs_are_resampled_within_their_task() {
        let estimate = stratified_bootstrap_estimate(&[vec![0.0; 5], vec![10.0; 5]], mean_of_tasks);
        assert_eq!(
            estimate,
            Estimate {
                value: 5.0,
                interval: Interval::Known {
                    low: 5.0,
                    high: 5.0
                }
            }
        );
    }

    /// One run with score 1 and four with score 0: the sum of a resample is binomial(5, 0.2), with
    /// P(0) = 0.8⁵ = 0.328, P(≤ 2) = 0.942 and P(≤ 3) = 0.993. So the 2.5 % quantile of the mean is
    /// 0, and the 97.5 % quantile is 3/5.
    #[test]
    fn the_interval_of_a_binomial_sample_equals_its_quantiles() {
        let estimate = bootstrap_estimate(&[0.0, 0.0, 1.0, 0.0, 0.0], mean);
        assert_eq!(
            estimate,
            Estimate {
                value: 0.2,
                interval: Interval::Known {
                    low: 0.0,
                    high: 0.6
                }
            }
        );
    }

    /// Samples of equal scores, and samples with ties, infinities and both zeros.
    fn samples() -> Vec<Vec<f64>> {
        let never = f64::INFINITY;
        let fractions = (0..30).map(|run| f64::from(run * run % 17) / 7.0 - 1.0);
        vec![
            vec![0.1; 7],
            vec![never; 6],
            vec![0.0, -0.0, 0.1, -0.0, 0.3],
            vec![3.0, never, 1.0, -never, 3.0, 0.1, never, 2.0],
            fractions.collect(),
        ]
    }

    /// Values and ends of intervals.
    fn numbers(estimates: &[Estimate]) -> Vec<f64> {
        let numbers = |estimate: &Estimate| {
            let [low, high] = estimate.interval.ends().unwrap();
            [estimate.value, low, high]
        };
        estimates.iter().flat_map(numbers).collect()
    }

    /// Their bits, so that NaN equals itself, and 0 differs from −0.
    fn bits(estimates: &[Estimate]) -> Vec<u64> {
        numbers(estimates).into_iter().map(f64::to_bits).collect()
    }

    /// Counted resamples of sorted scores give the bits of resamples that are sorted.
    #[test]
    fn statistics_of_counts_equal_statistics_of_sorted_resamples() {
        for sample in samples() {
            let counted =
                bootstrap_sorted_statistics(&[vec![sample.clone()]], 2, |groups, values| {
                    values[0] = median_of_sorted(&groups[0]);
                    values[1] = interquartile_mean_of_sorted(&groups[0]);
                });
            let sorted = [
                bootstrap_estimate(&sample, median),
                bootstrap_estimate(&sample, interquartile_mean),
            ];
            assert_eq!(bits(&counted), bits(&sorted), "{sample:?}");
        }
    }

    /// Sums of several resamples at once are those of sorted resamples but for their rounding: at most 301 units in the last place of
    /// sums below 301. With infinite scores they have the same bits. 301 scores have resamples that all leave out a score, or all have
    /// it in the middle.
    #[test]
    fn means_of_several_resamples_at_once_equal_means_of_sorted_resamples() {
        let many = (0..301).map(|run| (f64::from(run) * 0.7).sin());
        for sample in samples().into_iter().chain([many.collect()]) {
            let at_once = bootstrap_mean_and_interquartile_mean(&sample);
            let sorted = [
                bootstrap_estimate(&sample, |scores| mean(&sorted(scores))),
                bootstrap_estimate(&sample, interquartile_mean),
            ];
            let [at_once, sorted] = [&at_once, &sorted].map(|estimates| numbers(estimates));
            for (at_once, sorted) in at_once.into_iter().zip(sorted) {
                let is_equal = at_once == sorted || at_once.is_nan() && sorted.is_nan();
                assert!(is_equal || (at_once - sorted).abs() < 1e-13, "{sample:?}");
            }
        }
    }

    /// The first group has two strata, which are pooled, and the second has one.
    #[test]
    fn groups_of_strata_are_resampled_by_stratum_and_sorted_together() {
        let strata = samples().split_off(2);
        let groups = [strata[..2].to_vec(), strata[2..].to_vec()];
        let counted = bootstrap_sorted_statistics(&groups, 1, |groups, values| {
            values[0] = median_of_sorted(&groups[0]) - interquartile_mean_of_sorted(&groups[1]);
        });
        let sorted = stratified_bootstrap_estimate(&strata, |strata| {
            median(&strata[..2].concat()) - interquartile_mean(&strata[2])
        });
        assert_eq!(bits(&counted), bits(&[sorted]));
    }

    /// Means of several quantities have the bits of the means of each.
    #[test]
    fn means_of_several_quantities_equal_the_mean_of_each() {
        let quantities = [
            vec![0.1, 0.2, 0.3, 0.7, 1.9, 0.2],
            vec![1e9, 0.3, -1e9, 3.0, 0.1, 7.0],
            vec![-0.0; 6],
        ];
        let run = |run: usize| quantities.iter().map(|values| values[run]).collect();
        let runs: Vec<Vec<f64>> = (0..6).map(run).collect();
        let of_each = quantities.map(|values| bootstrap_estimate(&values, mean));
        assert_eq!(bits(&bootstrap_means(&runs)), bits(&of_each));
    }
}
