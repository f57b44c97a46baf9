//! Tests of a difference of means by permutation: of two samples, and of pairs.
//!
//! ```
//! use seedbed_stats::effect_test::{EffectTest, lower_bound};
//! use seedbed_stats::means::TwoMeans;
//!
//! let test = TwoMeans::new(&[5.0, 6.0, 7.0, 8.0, 9.0], &[0.0, 1.0, 2.0, 3.0, 4.0]);
//! assert_eq!(test.estimate(), 5.0);
//! // Of the 252 ways to split ten numbers, only the data have a difference as large.
//! assert_eq!(test.p_above(0.0), 1.0 / 252.0);
//! assert!(lower_bound(&test, 0.025, 0.0) > 0.0);
//! ```

use std::sync::{Arc, Mutex, PoisonError};

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::aggregate::mean;
use super::effect_test::EffectTest;

/// Number of random splits or sign vectors, in addition to that of the data. If there are fewer in
/// all, each is used once and p-values are exact.
pub const RANDOM_PERMUTATIONS: usize = 19_999;

/// Statistics that differ by less than this share are equal: rounding errors must not decide
/// whether a permutation is at least as extreme as the data.
const TOLERANCE: f64 = 1e-9;

/// Standard errors and differences that are smaller than this share of the data's range are
/// rounding errors.
const SMALLEST_DEVIATION: f64 = 1e-7;

/// Distance from the estimate within which bounds are searched, as a multiple of the range of the
/// data.
const SEARCHED_RANGES: f64 = 1e4;

/// Studentized permutation test of the difference of two means (Janssen 1997; Chung and Romano
/// 2013), for all hypothetical differences.
///
/// For a hypothetical difference δ, the statistic is Welch's t of x − δ and y, and its
/// distribution is that over all splits of x − δ and y into samples of the same sizes. The test is
/// exact for samples that differ by a shift, with any number of runs. For samples of unequal shape
/// it is valid with many runs.
#[derive(Clone, Debug)]
pub struct TwoMeans {
    /// Sums of the first sample of each split.
    sums: Vec<SplitSums>,
    /// Sums of x.
    data: SplitSums,
    /// Sums of all values.
    total: SplitSums,
    sizes: [usize; 2],
    estimate: f64,
    range: f64,
    is_exact: bool,
}

/// Sums over the values that a split puts into the first sample: of all values v, of those from x,
/// of v², and the number of values from x.
#[derive(Clone, Copy, Debug, Default)]
struct SplitSums {
    values: f64,
    values_of_x: f64,
    squares: f64,
    count_of_x: f64,
}

/// Ways to split n + m runs into a first sample of n runs and a second of m.
#[derive(Clone, Debug)]
pub struct Splits {
    sizes: [usize; 2],
    /// Runs of the first sample of each split: `[splits × n]`
    first_samples: Vec<u32>,
    is_exact: bool,
}

impl Splits {
    /// All splits if there are at most [`RANDOM_PERMUTATIONS`], otherwise as many random ones,
    /// always the same.
    ///
    /// # Panics
    /// If a sample is empty.
    #[must_use]
    pub fn new(n: usize, m: usize) -> Self {
        assert!(n > 0 && m > 0, "samples of {n} and {m} runs");
        let is_exact = binomial_coefficient(n + m, n) <= RANDOM_PERMUTATIONS as f64;
        let first_samples = if is_exact {
            all_combinations(n + m, n)
        } else {
            random_combinations(n + m, n)
        };
        Self {
            sizes: [n, m],
            first_samples,
            is_exact,
        }
    }
}

/// The random stream of all permutations. It is always the same, so that equal data give equal
/// p-values. Its key must never change, because published results depend on it.
fn permutation_stream() -> ChaCha8Rng {
    let mut key = [0_u8; 32];
    key[8] = 29;
    ChaCha8Rng::from_seed(key)
}

fn binomial_coefficient(n: usize, k: usize) -> f64 {
    (0..k)
        .map(|i| (n - i) as f64 / (k - i) as f64)
        .product::<f64>()
        .round()
}

/// All subsets of `k` of the numbers below `n`, one after the other.
fn all_combinations(n: usize, k: usize) -> Vec<u32> {
    let mut combination: Vec<u32> = (0..k as u32).collect();
    let mut all = combination.clone();
    let has_room = |combination: &[u32], i: usize| (combination[i] as usize) < n - k + i;
    while let Some(i) = (0..k).rfind(|&i| has_room(&combination, i)) {
        combination[i] += 1;
        for j in i + 1..k {
            combination[j] = combination[j - 1] + 1;
        }
        all.extend_from_slice(&combination);
    }
    all
}

/// [`RANDOM_PERMUTATIONS`] random subsets of `k` of the numbers below `n`, one after the other.
fn random_combinations(n: usize, k: usize) -> Vec<u32> {
    let mut random = permutation_stream();
    let mut runs: Vec<u32> = (0..n as u32).collect();
    let mut all = Vec::with_capacity(RANDOM_PERMUTATIONS * k);
    for _ in 0..RANDOM_PERMUTATIONS {
        // The first k steps of Fisher and Yates' shuffle; the order from the last round does not
        // matter.
        for i in 0..k {
            runs.swap(i, random.random_range(i..n));
        }
        all.extend_from_slice(&runs[..k]);
    }
    all
}

impl TwoMeans {
    /// Test of mean(x) − mean(y).   `x: [n]`, `y: [m]`
    ///
    /// # Panics
    /// If a sample is empty.
    #[must_use]
    pub fn new(x: &[f64], y: &[f64]) -> Self {
        let sizes = [x.len(), y.len()];
        let splits = LAST_SPLITS.get(sizes, || Splits::new(x.len(), y.len()));
        Self::with_splits(x, y, &splits)
    }

    /// Like [`new`](Self::new), with splits that were made before.
    ///
    /// # Panics
    /// If the splits are for other numbers of runs.
    #[must_use]
    pub fn with_splits(x: &[f64], y: &[f64], splits: &Splits) -> Self {
        assert_eq!(splits.sizes, [x.len(), y.len()]);
        // Centered values keep the squares small, which loses fewer digits.
        let center = f64::midpoint(mean(x), mean(y));
        let of_x = x.iter().map(|value| SplitSums::of(value - center, true));
        let of_y = y.iter().map(|value| SplitSums::of(value - center, false));
        let runs: Vec<SplitSums> = of_x.chain(of_y).collect();
        let values: Vec<f64> = runs.iter().map(|run| run.values).collect();
        let sums_of_split = |split: &[u32]| sum(split.iter().map(|&run| runs[run as usize]));
        Self {
            sums: splits
                .first_samples
                .chunks_exact(x.len())
                .map(sums_of_split)
                .collect(),
            data: sum(runs[..x.len()].iter().copied()),
            total: sum(runs.iter().copied()),
            sizes: splits.sizes,
            estimate: mean(x) - mean(y),
            range: range(&values),
            is_exact: splits.is_exact,
        }
    }

    /// p-value for the hypothetical difference `effect`. `sign` is 1 if larger differences are more
    /// extreme, and −1 if smaller ones are.
    fn p(&self, effect: f64, sign: f64) -> f64 {
        let statistic = |sums: &SplitSums| sign * self.welch_t(sums, effect);
        let of_data = statistic(&self.data);
        let threshold = if of_data.is_finite() {
            of_data - TOLERANCE * of_data.abs().max(1.0)
        } else {
            of_data
        };
        share_of_extreme(self.sums.iter().map(statistic), threshold, self.is_exact)
    }

    /// Welch's t of a split after `effect` was subtracted from all values of x. ±∞ if neither
    /// sample varies, 0 if their means are equal, too.
    fn welch_t(&self, sums: &SplitSums, effect: f64) -> f64 {
        let [n, m] = self.sizes.map(|size| size as f64);
        let (first, all) = (sums.shifted(effect), self.total.shifted(effect));
        let second = [all[0] - first[0], all[1] - first[1]];
        let difference = first[0] / n - second[0] / m;
        let variance = variance_of_mean(first, n) + variance_of_mean(second, m);
        let smallest = (SMALLEST_DEVIATION * (self.range + effect.abs())).powi(2);
        if difference.abs() <= smallest.sqrt() {
            0.0
        } else if variance <= smallest {
            difference.signum() * f64::INFINITY
        } else {
            difference / variance.sqrt()
        }
    }
}

impl EffectTest for TwoMeans {
    fn estimate(&self) -> f64 {
        self.estimate
    }

    fn p_above(&self, effect: f64) -> f64 {
        self.p(effect, 1.0)
    }

    fn p_below(&self, effect: f64) -> f64 {
        self.p(effect, -1.0)
    }

    fn limits(&self) -> [f64; 2] {
        [f64::NEG_INFINITY, f64::INFINITY]
    }

    fn search_distance(&self) -> f64 {
        search_distance(self.range)
    }
}

impl SplitSums {
    /// The sums over one value. A value of y adds 0, which changes no sum: a branch would take longer.
    fn of(value: f64, is_of_x: bool) -> Self {
        Self {
            values: value,
            values_of_x: if is_of_x { value } else { 0.0 },
            squares: value * value,
            count_of_x: f64::from(u8::from(is_of_x)),
        }
    }

    /// Sum and sum of squares of the values after `effect` was subtracted from those of x.
    fn shifted(&self, effect: f64) -> [f64; 2] {
        [
            self.values - effect * self.count_of_x,
            self.squares - 2.0 * effect * self.values_of_x + effect * effect * self.count_of_x,
        ]
    }
}

/// The sums over all values, added in their order.
fn sum(values: impl Iterator<Item = SplitSums>) -> SplitSums {
    values.fold(SplitSums::default(), |sums, value| SplitSums {
        values: sums.values + value.values,
        values_of_x: sums.values_of_x + value.values_of_x,
        squares: sums.squares + value.squares,
        count_of_x: sums.count_of_x + value.count_of_x,
    })
}

/// Squared standard error of the mean of n values with this sum and sum of squares; 0 for one value.
fn variance_of_mean([sum, squares]: [f64; 2], n: f64) -> f64 {
    if n < 2.0 {
        return 0.0;
    }
    ((squares - sum * sum / n) / (n * (n - 1.0))).max(0.0)
}

/// Test of the mean of differences by changes of sign, for all hypothetical means δ: the
/// distribution of Σ ± (d − δ) over all signs.
///
/// It is exact for differences that are symmetric around their mean, as those of two samples of
/// equal distribution are, and valid with many runs otherwise. For δ = 0 and differences of −1, 0
/// and 1 it is the exact test of McNemar (1947).
#[derive(Clone, Debug)]
pub struct MeanOfDifferences {
    /// For each sign vector, the sum of signed differences and the sum of signs.
    sums: Vec<[f64; 2]>,
    data: [f64; 2],
    range: f64,
    is_exact: bool,
}

impl MeanOfDifferences {
    /// Test of the mean of `differences`.   `differences: [n]`
    ///
    /// # Panics
    /// If there are no differences.
    #[must_use]
    pub fn new(differences: &[f64]) -> Self {
        let n = differences.len();
        assert!(n > 0, "no differences");
        let vectors = LAST_SIGN_VECTORS.get(n, || SignVectors::new(n));
        Self {
            sums: vectors.signed_sums(differences),
            data: [differences.iter().sum(), n as f64],
            range: range(differences),
            is_exact: vectors.is_exact,
        }
    }

    fn p(&self, effect: f64, sign: f64) -> f64 {
        let statistic = |[differences, signs]: &[f64; 2]| sign * (differences - effect * signs);
        let threshold =
            statistic(&self.data) - TOLERANCE * self.data[1] * (self.range + effect.abs());
        share_of_extreme(self.sums.iter().map(statistic), threshold, self.is_exact)
    }
}

/// Vectors of n signs: all if there are at most [`RANDOM_PERMUTATIONS`], otherwise as many random ones, always the
/// same.
#[derive(Debug)]
struct SignVectors {
    n: usize,
    /// A bit of 1 is a minus; the bits after the n-th are 0.   `[vectors × ⌈n / 8⌉]`
    bytes: Vec<u8>,
    is_exact: bool,
}

/// The permutations that were used last: the tests of a study have as many runs, and drawing takes longer than all
/// else.
struct Last<K, T>(Mutex<Option<(K, Arc<T>)>>);

static LAST_SPLITS: Last<[usize; 2], Splits> = Last(Mutex::new(None));

static LAST_SIGN_VECTORS: Last<usize, SignVectors> = Last(Mutex::new(None));

impl<K: Copy + PartialEq, T> Last<K, T> {
    /// The permutations for samples of these sizes, which are drawn if they are others than the last.
    fn get(&self, sizes: K, draw: impl FnOnce() -> T) -> Arc<T> {
        let mut last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match &*last {
            Some((of, permutations)) if *of == sizes => Arc::clone(permutations),
            _ => {
                let permutations = Arc::new(draw());
                *last = Some((sizes, Arc::clone(&permutations)));
                permutations
            }
        }
    }
}

impl SignVectors {
    fn new(n: usize) -> Self {
        let is_exact = n < 64 && 1_usize << n <= RANDOM_PERMUTATIONS;
        let count = if is_exact {
            1 << n
        } else {
            RANDOM_PERMUTATIONS
        };
        let mut random = permutation_stream();
        let mut bytes = vec![0; count * n.div_ceil(8)];
        for (number, vector) in bytes.chunks_exact_mut(n.div_ceil(8)).enumerate() {
            for i in 0..n {
                let is_kept = if is_exact {
                    number >> i & 1 == 0
                } else {
                    random.random()
                };
                vector[i / 8] |= u8::from(!is_kept) << (i % 8);
            }
        }
        Self { n, bytes, is_exact }
    }

    /// For each vector, the sum of signed differences and the sum of signs.
    fn signed_sums(&self, differences: &[f64]) -> Vec<[f64; 2]> {
        let tables: Vec<[f64; 256]> = differences.chunks(8).map(sums_of_signs).collect();
        let sums = |vector: &[u8]| {
            let mut sum = 0.0;
            let mut minuses = 0;
            for (byte, table) in vector.iter().zip(&tables) {
                sum += table[usize::from(*byte)];
                minuses += byte.count_ones();
            }
            [sum, self.n as f64 - 2.0 * f64::from(minuses)]
        };
        let vectors = self.bytes.chunks_exact(tables.len());
        vectors.map(sums).collect()
    }
}

/// The sum of up to eight values for each byte of signs; a bit of 1 is a minus.
fn sums_of_signs(values: &[f64]) -> [f64; 256] {
    let mut sums = [0.0; 256];
    for (byte, sum) in sums.iter_mut().enumerate().take(1 << values.len()) {
        for (bit, value) in values.iter().enumerate() {
            *sum += if byte >> bit & 1 == 0 { *value } else { -value };
        }
    }
    sums
}

impl EffectTest for MeanOfDifferences {
    fn estimate(&self) -> f64 {
        self.data[0] / self.data[1]
    }

    fn p_above(&self, effect: f64) -> f64 {
        self.p(effect, 1.0)
    }

    fn p_below(&self, effect: f64) -> f64 {
        self.p(effect, -1.0)
    }

    fn limits(&self) -> [f64; 2] {
        [f64::NEG_INFINITY, f64::INFINITY]
    }

    fn search_distance(&self) -> f64 {
        search_distance(self.range)
    }
}

/// p-value: share of the permutations whose statistic is at least `threshold`. Random permutations
/// count the data as one more of them, so that p is never 0 (Phipson and Smyth 2010).
fn share_of_extreme(
    statistics: impl ExactSizeIterator<Item = f64>,
    threshold: f64,
    is_exact: bool,
) -> f64 {
    let data = usize::from(!is_exact);
    let all = statistics.len() + data;
    let extreme = statistics
        .filter(|&statistic| statistic >= threshold)
        .count()
        + data;
    extreme as f64 / all as f64
}

/// Largest minus smallest value.
fn range(values: &[f64]) -> f64 {
    let max = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let min = values.iter().copied().fold(f64::INFINITY, f64::min);
    max - min
}

/// Distance from the estimate within which bounds are searched; values without range have their
/// bounds at the estimate.
fn search_distance(range: f64) -> f64 {
    SEARCHED_RANGES * if range > 0.0 { range } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect_test::{lower_bound, upper_bound};

    /// The definition: Welch's t of every split, from the values themselves.
    fn p_by_definition(x: &[f64], y: &[f64], effect: f64) -> f64 {
        let shifted: Vec<f64> = x
            .iter()
            .map(|x| x - effect)
            .chain(y.iter().copied())
            .collect();
        let t = |runs: &[u32]| {
            let is_first = |run: &usize| runs.contains(&(*run as u32));
            let (first, second): (Vec<usize>, Vec<usize>) = (0..shifted.len()).partition(is_first);
            let [(a, va), (b, vb)] = [first, second].map(|runs| {
                let n = runs.len() as f64;
                let mean = runs.iter().map(|&run| shifted[run]).sum::<f64>() / n;
                let squares: f64 = runs.iter().map(|&run| (shifted[run] - mean).powi(2)).sum();
                (mean, squares / (n * (n - 1.0)))
            });
            (a - b) / (va + vb).sqrt()
        };
        let splits = all_combinations(shifted.len(), x.len());
        let data: Vec<u32> = (0..x.len() as u32).collect();
        let all: Vec<f64> = splits.chunks_exact(x.len()).map(t).collect();
        let extreme = all
            .iter()
            .filter(|&&other| other >= t(&data) - 1e-9)
            .count();
        extreme as f64 / all.len() as f64
    }

    const X: [f64; 5] = [3.0, 8.5, 4.0, 6.0, 20.0];
    const Y: [f64; 4] = [2.0, 5.0, 1.0, 3.5];

    #[test]
    fn p_values_equal_those_of_all_splits() {
        let test = TwoMeans::new(&X, &Y);
        for effect in [-3.0, 0.0, 1.25, 5.0, 30.0] {
            assert_eq!(
                test.p_above(effect),
                p_by_definition(&X, &Y, effect),
                "{effect}"
            );
        }
    }

    /// Exchanging the samples reverses the sign, and so does the mirror image of the values.
    #[test]
    fn the_test_is_symmetric() {
        let (test, exchanged) = (TwoMeans::new(&X, &Y), TwoMeans::new(&Y, &X));
        assert_eq!(test.estimate(), -exchanged.estimate());
        for effect in [-2.0, 0.0, 4.0] {
            assert_eq!(test.p_above(effect), exchanged.p_below(-effect));
        }
        let bounds = [
            lower_bound(&test, 0.1, 0.0),
            upper_bound(&exchanged, 0.1, 0.0),
        ];
        assert!((bounds[0] + bounds[1]).abs() < 1e-6, "{bounds:?}");
    }

    /// A shift of all values of x by 7 moves the bounds by 7.
    #[test]
    fn bounds_move_with_the_data() {
        let shifted = X.map(|x| x + 7.0);
        let [bound, moved] =
            [&X, &shifted].map(|x| lower_bound(&TwoMeans::new(x, &Y), 0.05, f64::NAN));
        assert!(bound.is_finite() && (moved - bound - 7.0).abs() < 1e-6);
    }

    /// All values of each sample are equal: one of C(10, 5) = 252 splits is as extreme. Samples of
    /// three have 20 splits, which is too few for a level of 0.025: no bound.
    #[test]
    fn samples_without_variation_are_compared_by_the_number_of_splits() {
        let test = TwoMeans::new(&[200.0; 5], &[9.0; 5]);
        assert_eq!([test.p_above(0.0), test.p_below(0.0)], [1.0 / 252.0, 1.0]);
        assert!((lower_bound(&test, 0.025, 0.0) - 191.0).abs() < 1e-3);
        let few = TwoMeans::new(&[200.0; 3], &[9.0; 3]);
        assert_eq!(lower_bound(&few, 0.025, 0.0), f64::NEG_INFINITY);
    }

    /// Twenty runs have too many splits: p is a multiple of 1 / 20,000, and never 0.
    #[test]
    fn random_splits_count_the_data_as_one_of_them() {
        let x: Vec<f64> = (0..20).map(|run| f64::from(run) + 100.0).collect();
        let y: Vec<f64> = (0..20).map(f64::from).collect();
        assert_eq!(TwoMeans::new(&x, &y).p_above(0.0), 1.0 / 20_000.0);
    }

    /// Five positive differences: one of 2⁵ sign vectors has a sum as large.
    #[test]
    fn sign_changes_give_exact_p_values() {
        let test = MeanOfDifferences::new(&[1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(test.estimate(), 3.0);
        assert_eq!([test.p_above(0.0), test.p_below(0.0)], [1.0 / 32.0, 1.0]);
        // For δ = 3 the differences are −2 … 2: half of the vectors, and those with the sum 0.
        assert_eq!(test.p_above(3.0), test.p_below(3.0));
    }

    /// By the definition, for nine values (more than a byte of signs).
    #[test]
    fn sums_of_all_sign_vectors_are_those_of_the_definition() {
        let differences = [0.5, -1.25, 3.0, 7.5, -0.125, 2.0, 11.0, -4.0, 0.25];
        let sums = MeanOfDifferences::new(&differences).sums;
        assert_eq!(sums.len(), 512);
        for (number, sums) in sums.iter().enumerate() {
            let sign = |i: usize| if number >> i & 1 == 0 { 1.0 } else { -1.0 };
            let signed = differences.iter().enumerate().map(|(i, d)| sign(i) * d);
            let signs: f64 = (0..9).map(sign).sum();
            assert_eq!(*sums, [signed.sum(), signs]);
        }
    }

    /// Of six discordant pairs one is negative. McNemar's exact test: P(at most 1 of 6) = 7 / 64.
    #[test]
    fn differences_of_successes_have_the_p_value_of_mcnemars_test() {
        let differences = [1.0, 0.0, 1.0, 1.0, -1.0, 0.0, 1.0, 1.0];
        assert_eq!(
            MeanOfDifferences::new(&differences).p_above(0.0),
            7.0 / 64.0
        );
    }
}
