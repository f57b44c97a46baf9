//! Rank correlation of two measures of runs within groups, such as the cells of a study.
//!
//! ```
//! use seedbed_stats::correlation::rank_correlation_within_groups;
//!
//! // In both groups the second measure grows with the first, though the groups have other levels.
//! let low: Vec<[f64; 2]> = (0..8).map(|run| [f64::from(run), f64::from(run)]).collect();
//! let high: Vec<[f64; 2]> = low.iter().map(|[x, y]| [x + 100.0, y - 50.0]).collect();
//! let correlation = rank_correlation_within_groups(&[low, high]).unwrap();
//! assert_eq!(correlation.estimate.value, 1.0);
//! assert!(correlation.p < 0.001);
//! ```

use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::Estimate;
use super::bootstrap::stratified_bootstrap_estimate;

/// Number of random permutations, beside the data themselves, of a p-value.
pub const PERMUTATIONS: u32 = 20_000;

/// A rank correlation, and how likely one as far from 0 is without any relation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correlation {
    /// Spearman's ρ within groups, with a bootstrap interval over the runs of each group.
    pub estimate: Estimate,
    /// Two-sided p-value, by permutations of one measure within each group.
    pub p: f64,
    /// Number of runs of all groups that count.
    pub runs: usize,
}

/// Ranks of both measures of each run, minus their means in the group.
type CenteredRanks = Vec<[f64; 2]>;

/// Spearman's rank correlation within groups: both measures are ranked in each group, so that differences
/// between groups do not count, and the products of the centered ranks are added up over all groups (the
/// correlation of ranks, adjusted for the groups).   `groups: [group][run][measure]`
///
/// A group counts if neither measure is the same in all its runs; `None` if none counts. Infinite numbers are
/// ranked like others, and equal ones share the mean of their ranks. The interval is that of ranks which a
/// resample keeps.
#[must_use]
pub fn rank_correlation_within_groups(groups: &[Vec<[f64; 2]>]) -> Option<Correlation> {
    let groups: Vec<CenteredRanks> = groups.iter().filter_map(|runs| centered(runs)).collect();
    let value = correlation(groups.iter().map(Vec::as_slice))?;
    Some(Correlation {
        estimate: Estimate {
            value,
            ..bootstrap(&groups)
        },
        p: permutation_p(&groups, value),
        runs: groups.iter().map(Vec::len).sum(),
    })
}

/// Runs are numbered over all groups, because the bootstrap draws numbers.
fn bootstrap(groups: &[CenteredRanks]) -> Estimate {
    let runs = groups.concat();
    let mut numbers = (0..runs.len()).map(|number| number as f64);
    let strata: Vec<Vec<f64>> = groups
        .iter()
        .map(|group| numbers.by_ref().take(group.len()).collect())
        .collect();
    stratified_bootstrap_estimate(&strata, |drawn| {
        let mut sums = [0.0; 3];
        for group in drawn {
            add_products(group.iter().map(|&number| runs[number as usize]), &mut sums);
        }
        ratio(sums).unwrap_or(0.0)
    })
}

/// The share of permutations with a correlation at least as far from 0; the data count as one of them.
fn permutation_p(groups: &[CenteredRanks], value: f64) -> f64 {
    let mut random = permutation_stream();
    let mut permuted = groups.to_vec();
    // Sums of the same numbers in another order may differ in their last bits.
    let least = value.abs() - 1e-9;
    let mut as_far = 1;
    for _ in 0..PERMUTATIONS {
        for (group, permuted) in groups.iter().zip(&mut permuted) {
            permuted.shuffle(&mut random);
            for (run, permuted) in group.iter().zip(permuted) {
                permuted[0] = run[0];
            }
        }
        let of_permuted = correlation(permuted.iter().map(Vec::as_slice));
        as_far += u32::from(of_permuted.is_some_and(|other| other.abs() >= least));
    }
    f64::from(as_far) / f64::from(PERMUTATIONS + 1)
}

/// The random stream of all permutations. Its key must never change, because published results depend on it.
fn permutation_stream() -> ChaCha8Rng {
    let mut key = [0_u8; 32];
    key[8] = 31;
    ChaCha8Rng::from_seed(key)
}

/// The correlation of centered ranks; `None` if a measure is the same in all runs.
fn correlation<'a>(groups: impl Iterator<Item = &'a [[f64; 2]]>) -> Option<f64> {
    let mut sums = [0.0; 3];
    for group in groups {
        add_products(group.iter().copied(), &mut sums);
    }
    ratio(sums)
}

/// Adds the products of the deviations from the means of a group: of the first measure with itself, of both,
/// and of the second with itself.
fn add_products(runs: impl ExactSizeIterator<Item = [f64; 2]>, sums: &mut [f64; 3]) {
    let count = runs.len() as f64;
    let (mut first, mut second, mut products) = (0.0, 0.0, [0.0; 3]);
    for [x, y] in runs {
        first += x;
        second += y;
        products[0] += x * x;
        products[1] += x * y;
        products[2] += y * y;
    }
    sums[0] += products[0] - first * first / count;
    sums[1] += products[1] - first * second / count;
    sums[2] += products[2] - second * second / count;
}

fn ratio([first, both, second]: [f64; 3]) -> Option<f64> {
    let scale = (first * second).sqrt();
    (scale > 1e-9).then(|| (both / scale).clamp(-1.0, 1.0))
}

/// Centered ranks of a group; `None` if a measure is the same in all runs.
fn centered(runs: &[[f64; 2]]) -> Option<CenteredRanks> {
    let mean = 0.5 * (runs.len() as f64 + 1.0);
    let [first, second] = [0, 1].map(|measure| {
        let values: Vec<f64> = runs.iter().map(|run| run[measure]).collect();
        ranks(&values)
    });
    let is_constant = |ranks: &[f64]| ranks.iter().all(|&rank| rank == mean);
    if is_constant(&first) || is_constant(&second) {
        return None;
    }
    let pairs = first.into_iter().zip(second);
    Some(pairs.map(|(x, y)| [x - mean, y - mean]).collect())
}

/// Ranks of values, from 1; equal values share the mean of their ranks. `values: [N]` → `[N]`
fn ranks(values: &[f64]) -> Vec<f64> {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Ranks 1 2 3 4 and 2 1 4 3: 1 − 6 Σd²/(n(n² − 1)) = 1 − 6·4/60 = 0.6. A group with the opposite order of
    /// as many runs, −0.6, cancels it. Twice the same group is the same correlation.
    #[test]
    fn correlations_by_hand() {
        let one = vec![[1.0, 0.2], [5.0, 0.1], [6.0, 0.4], [90.0, 0.3]];
        let opposite: Vec<[f64; 2]> = one.iter().map(|[x, y]| [-x, *y]).collect();
        let value = |groups: &[Vec<[f64; 2]>]| {
            let correlation = rank_correlation_within_groups(groups).unwrap();
            correlation.estimate.value
        };
        assert!((value(std::slice::from_ref(&one)) - 0.6).abs() < 1e-12);
        assert!((value(&[one.clone(), one.clone()]) - 0.6).abs() < 1e-12);
        assert!(value(&[one, opposite]).abs() < 1e-12);
    }

    /// Levels of groups do not count: here they would give a correlation of almost 1, within groups it is −1. A
    /// group in which a measure does not vary is left out. Times that were not reached are last.
    #[test]
    fn only_differences_within_groups_count() {
        let falling = |level: f64| -> Vec<[f64; 2]> {
            let runs = (0..6).map(f64::from);
            runs.map(|run| [level + run, level - run]).collect()
        };
        let constant = vec![[0.0, 1.0], [0.0, 2.0]];
        let groups = [falling(0.0), constant.clone(), falling(1000.0)];
        let correlation = rank_correlation_within_groups(&groups).unwrap();
        assert_eq!((correlation.estimate.value, correlation.runs), (-1.0, 12));
        assert_eq!(rank_correlation_within_groups(&[constant]), None);
        let times = vec![[1.0, 3.0], [2.0, f64::INFINITY], [3.0, f64::INFINITY]];
        let correlation = rank_correlation_within_groups(&[times]).unwrap();
        assert!((correlation.estimate.value - 0.75_f64.sqrt()).abs() < 1e-12);
    }

    /// Four runs in the same order: of the 24 permutations, 1 has the correlation 1 and 1 has −1, so p = 2/24.
    /// Without a relation, p is uniform: of 200 samples about a tenth has a p below 0.1.
    #[test]
    fn p_values_are_shares_of_permutations() {
        let ordered: Vec<[f64; 2]> = (0..4).map(|run| [f64::from(run); 2]).collect();
        let p = rank_correlation_within_groups(&[ordered]).unwrap().p;
        assert!((p - 2.0 / 24.0).abs() < 0.01, "{p}");
        let mut random = ChaCha8Rng::from_seed([5; 32]);
        let mut numbers: Vec<f64> = (0..20).map(f64::from).collect();
        let below = (0..200).filter(|_| {
            let mut group = || -> Vec<[f64; 2]> {
                numbers.shuffle(&mut random);
                let runs = numbers.iter().enumerate();
                runs.map(|(x, &y)| [x as f64, y]).collect()
            };
            let groups: Vec<CenteredRanks> = [group(), group()]
                .iter()
                .filter_map(|runs| centered(runs))
                .collect();
            let value = correlation(groups.iter().map(Vec::as_slice)).unwrap();
            permutation_p(&groups, value) < 0.1
        });
        let share = below.count() as f64 / 200.0;
        assert!((0.04..0.17).contains(&share), "{share}");
    }
}
