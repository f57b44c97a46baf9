//! Random draws of runs, with replacement within each stratum. Draws depend on the sizes of the
//! strata only, so samples of equal size share them.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::RESAMPLES;

/// Maximum number of draws that are kept in memory, of 2 bytes each. Larger resamples are drawn again
/// for each statistic.
const MAX_KEPT_DRAWS: usize = 1 << 27;

/// Draws of the sizes that were used last; the newest are at the back.
static KEPT: Mutex<VecDeque<Arc<Draws>>> = Mutex::new(VecDeque::new());

/// All draws for strata of these sizes.
struct Draws {
    /// Number of runs of each stratum.
    sizes: Vec<usize>,
    /// Runs of each resample: `[RESAMPLES × sum of sizes]`.
    runs: Vec<u16>,
}

/// Calls `visit` for each of the [`RESAMPLES`] resamples of strata of these sizes, always in the
/// same order and with the same draws.   `sizes: [stratum]`
///
/// `visit` gets as many runs per stratum as the stratum has, stratum after stratum. Runs are
/// counted from 0 over all strata.   → `[sum of sizes]`
pub(crate) fn for_each_resample(sizes: &[usize], visit: impl FnMut(&[u32])) {
    if RESAMPLES * sizes.iter().sum::<usize>() <= MAX_KEPT_DRAWS {
        // The lock is held while runs are drawn, because other threads most likely wait for the
        // same draws.
        let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
        let draws = kept_draws(&mut kept, sizes, MAX_KEPT_DRAWS);
        drop(kept);
        visit_kept(&draws, visit);
    } else {
        visit_new(sizes, visit);
    }
}

/// Draws for strata of these sizes, which are kept for the next samples of the same sizes. Then
/// drops those that were not used for longest, until at most `max_draws` are kept.
fn kept_draws(kept: &mut VecDeque<Arc<Draws>>, sizes: &[usize], max_draws: usize) -> Arc<Draws> {
    let index = kept.iter().position(|draws| draws.sizes == sizes);
    let draws = match index.and_then(|index| kept.remove(index)) {
        Some(draws) => draws,
        None => Arc::new(Draws::of(sizes)),
    };
    kept.push_back(Arc::clone(&draws));
    while kept.iter().map(|draws| draws.runs.len()).sum::<usize>() > max_draws {
        kept.pop_front();
    }
    draws
}

fn visit_kept(draws: &Draws, mut visit: impl FnMut(&[u32])) {
    let mut runs = vec![0; draws.sizes.iter().sum()];
    for kept in draws.runs.chunks_exact(runs.len()) {
        for (run, &kept) in runs.iter_mut().zip(kept) {
            *run = kept.into();
        }
        visit(&runs);
    }
}

fn visit_new(sizes: &[usize], mut visit: impl FnMut(&[u32])) {
    let (mut random, mut runs) = (resampling_stream(), vec![0; sizes.iter().sum()]);
    for _ in 0..RESAMPLES {
        draw(sizes, &mut runs, &mut random);
        visit(&runs);
    }
}

impl Draws {
    fn of(sizes: &[usize]) -> Self {
        let mut runs = Vec::with_capacity(RESAMPLES * sizes.iter().sum::<usize>());
        // Draws that are kept are of few runs.
        visit_new(sizes, |drawn| {
            runs.extend(drawn.iter().map(|&run| run as u16));
        });
        Self {
            sizes: sizes.to_vec(),
            runs,
        }
    }
}

/// Draws the runs of one resample, for each stratum as many as it has.
fn draw(sizes: &[usize], mut runs: &mut [u32], random: &mut ChaCha8Rng) {
    let mut first = 0;
    for &size in sizes {
        let (of_stratum, others) = runs.split_at_mut(size);
        of_stratum.fill_with(|| (first + random.random_range(0..size)) as u32);
        (first, runs) = (first + size, others);
    }
}

/// The random stream of all resamples. It is always the same, so that equal data give equal
/// intervals. Its key must never change, because published intervals depend on it.
fn resampling_stream() -> ChaCha8Rng {
    let mut key = [0_u8; 32];
    key[8] = 13;
    ChaCha8Rng::from_seed(key)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The definition: one index of the own stratum after the other from one random stream. New
    /// draws and kept draws equal it.
    #[test]
    fn draws_are_consecutive_numbers_of_one_stream() {
        for sizes in [vec![5], vec![3, 7]] {
            let mut random = resampling_stream();
            let mut resample = || -> Vec<u32> {
                let (mut first, mut runs) = (0, Vec::new());
                for &size in &sizes {
                    runs.extend((0..size).map(|_| (first + random.random_range(0..size)) as u32));
                    first += size;
                }
                runs
            };
            let expected: Vec<Vec<u32>> = (0..RESAMPLES).map(|_| resample()).collect();
            let (mut new, mut kept) = (expected.iter(), expected.iter());
            visit_new(&sizes, |runs| {
                assert_eq!(Some(runs), new.next().map(|runs| &runs[..]));
            });
            for_each_resample(&sizes, |runs| assert_eq!(runs, kept.next().unwrap()));
            assert_eq!((new.next(), kept.next()), (None, None));
        }
    }

    /// With room for the draws of ten runs, those of five runs are dropped when those of two and
    /// four runs are needed, but not those of four, which were used again before those of six.
    #[test]
    fn draws_that_were_used_last_are_kept() {
        let mut kept = VecDeque::new();
        for size in [5, 4, 2, 4, 6] {
            assert_eq!(kept_draws(&mut kept, &[size], 10 * RESAMPLES).sizes, [size]);
        }
        let sizes: Vec<usize> = kept.iter().map(|draws| draws.sizes[0]).collect();
        assert_eq!(sizes, [4, 6]);
    }
}
