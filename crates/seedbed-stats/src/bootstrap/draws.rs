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

/// Resamples of the sizes that were used last; the newest are at the back.
static KEPT: Mutex<VecDeque<Arc<Kept>>> = Mutex::new(VecDeque::new());

/// What is kept of a resample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// The drawn runs, in their order.
    Draws,
    /// How often each run was drawn.
    Counts,
}

/// All resamples of strata of these sizes.
struct Kept {
    kind: Kind,
    /// Number of runs of each stratum.
    sizes: Vec<usize>,
    /// Runs or counts of each resample: `[RESAMPLES × sum of sizes]`.
    numbers: Vec<u16>,
}

/// Calls `visit` for each of the [`RESAMPLES`] resamples of strata of these sizes, always in the
/// same order and with the same draws.   `sizes: [stratum]`
///
/// `visit` gets as many runs per stratum as the stratum has, stratum after stratum. Runs are
/// counted from 0 over all strata.   → `[sum of sizes]`
pub(crate) fn for_each_resample(sizes: &[usize], mut visit: impl FnMut(&[u32])) {
    let Some(kept) = kept(Kind::Draws, sizes) else {
        return visit_new(sizes, visit);
    };
    let mut runs = vec![0; sizes.iter().sum()];
    for kept in kept.numbers.chunks_exact(runs.len()) {
        for (run, &kept) in runs.iter_mut().zip(kept) {
            *run = kept.into();
        }
        visit(&runs);
    }
}

/// Calls `visit` for the resamples of [`for_each_resample`] with the number of times that each run was
/// drawn.   → `[sum of sizes]`
pub(crate) fn for_each_counts(sizes: &[usize], mut visit: impl FnMut(&[u16])) {
    let n = sizes.iter().sum();
    if let Some(kept) = kept(Kind::Counts, sizes) {
        kept.numbers.chunks_exact(n).for_each(visit);
    } else {
        let mut counts = vec![0; n];
        visit_new(sizes, |drawn| {
            count(drawn, &mut counts);
            visit(&counts);
        });
    }
}

/// Counts how often each run was drawn. No run is drawn 65 536 times.   `counts: [n]`, overwritten
fn count(drawn: &[u32], counts: &mut [u16]) {
    counts.fill(0);
    for &run in drawn {
        counts[run as usize] += 1;
    }
}

/// The resamples for strata of these sizes; `None` if they are too many to be kept.
fn kept(kind: Kind, sizes: &[usize]) -> Option<Arc<Kept>> {
    if RESAMPLES * sizes.iter().sum::<usize>() > MAX_KEPT_DRAWS {
        return None;
    }
    // The lock is held while runs are drawn, because other threads most likely wait for the same
    // draws.
    let mut all = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    Some(find_or_draw(&mut all, kind, sizes, MAX_KEPT_DRAWS))
}

/// Resamples of strata of these sizes, which are kept for the next samples of the same sizes. Then
/// drops those that were not used for longest, until at most `max_draws` are kept.
fn find_or_draw(
    all: &mut VecDeque<Arc<Kept>>,
    kind: Kind,
    sizes: &[usize],
    max_draws: usize,
) -> Arc<Kept> {
    let is_same = |kept: &Arc<Kept>| kept.kind == kind && kept.sizes == sizes;
    let index = all.iter().position(is_same);
    let kept = match index.and_then(|index| all.remove(index)) {
        Some(kept) => kept,
        None => Arc::new(Kept::of(kind, sizes)),
    };
    all.push_back(Arc::clone(&kept));
    while all.iter().map(|kept| kept.numbers.len()).sum::<usize>() > max_draws {
        all.pop_front();
    }
    kept
}

fn visit_new(sizes: &[usize], mut visit: impl FnMut(&[u32])) {
    let (mut random, mut runs) = (resampling_stream(), vec![0; sizes.iter().sum()]);
    for _ in 0..RESAMPLES {
        draw(sizes, &mut runs, &mut random);
        visit(&runs);
    }
}

impl Kept {
    fn of(kind: Kind, sizes: &[usize]) -> Self {
        let n = sizes.iter().sum::<usize>();
        let mut numbers = vec![0; RESAMPLES * n];
        let mut resamples = numbers.chunks_exact_mut(n);
        visit_new(sizes, |drawn| {
            let Some(numbers) = resamples.next() else {
                return;
            };
            match kind {
                Kind::Counts => count(drawn, numbers),
                // Resamples that are kept are of few runs.
                Kind::Draws => {
                    for (number, &run) in numbers.iter_mut().zip(drawn) {
                        *number = run as u16;
                    }
                }
            }
        });
        Self {
            kind,
            sizes: sizes.to_vec(),
            numbers,
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
            let mut drawn = expected.iter();
            for_each_counts(&sizes, |counts| {
                let drawn = drawn.next().unwrap();
                for (run, &count) in (0_u32..).zip(counts) {
                    let expected = drawn.iter().filter(|&&other| other == run).count();
                    assert_eq!(usize::from(count), expected);
                }
            });
            assert_eq!(drawn.next(), None);
        }
    }

    /// With room for the draws of ten runs, those of five runs are dropped when those of two and
    /// four runs are needed, but not those of four, which were used again before those of six.
    #[test]
    fn draws_that_were_used_last_are_kept() {
        let mut kept = VecDeque::new();
        for size in [5, 4, 2, 4, 6] {
            let found = find_or_draw(&mut kept, Kind::Draws, &[size], 10 * RESAMPLES);
            assert_eq!(found.sizes, [size]);
        }
        let sizes: Vec<usize> = kept.iter().map(|draws| draws.sizes[0]).collect();
        assert_eq!(sizes, [4, 6]);
        let counts = find_or_draw(&mut kept, Kind::Counts, &[4], 10 * RESAMPLES);
        assert_eq!((counts.kind, kept.len()), (Kind::Counts, 2));
    }
}
