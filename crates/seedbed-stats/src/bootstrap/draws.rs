//! Random draws of runs, with replacement within each stratum. Draws depend on the sizes of the
//! strata only, so samples of equal size share them.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::RESAMPLES;
use super::sorted_sums::{Counts, LANES};

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
    /// How often each run was drawn in each of [`LANES`] resamples.
    CountsOfLanes,
}

/// All resamples of strata of these sizes.
struct Kept {
    kind: Kind,
    /// Number of runs of each stratum.
    sizes: Vec<usize>,
    /// Runs or counts of all resamples: `[RESAMPLES × sum of sizes]`; empty for counts of lanes.
    numbers: Vec<u16>,
    /// Counts of lanes: `[RESAMPLES / LANES × sum of sizes]`; otherwise empty.
    counts_of_lanes: Vec<Counts>,
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

/// Calls `visit` for the resamples of [`for_each_resample`] of one stratum of `n` runs, [`LANES`] at a time, with
/// the number of times that each run was drawn in each of them.   → `[n]`
pub(super) fn for_each_counts_of_lanes(n: usize, mut visit: impl FnMut(&[Counts])) {
    let mut counts = vec![[0; LANES]; n];
    if let Some(kept) = kept(Kind::CountsOfLanes, &[n]) {
        for kept in kept.counts_of_lanes.chunks_exact(n) {
            // A copy, because memory is fetched in advance only if it is read in order.
            counts.copy_from_slice(kept);
            visit(&counts);
        }
    } else {
        let mut lane = 0;
        visit_new(&[n], |drawn| {
            count_in_lane(drawn, lane, &mut counts);
            lane = (lane + 1) % LANES;
            if lane == 0 {
                visit(&counts);
                counts.fill([0; LANES]);
            }
        });
    }
}

/// Counts how often each run was drawn, in one of the lanes. No run is drawn 256 times: a sample has fewer runs, or this
/// has a probability of less than 10⁻⁵⁰⁰.   `counts: [n]`, 0 in this lane
fn count_in_lane(drawn: &[u32], lane: usize, counts: &mut [Counts]) {
    const { assert!(RESAMPLES.is_multiple_of(LANES)) };
    for &run in drawn {
        counts[run as usize][lane] += 1;
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
    while all.iter().map(|kept| kept.draws()).sum::<usize>() > max_draws {
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
    /// Number of draws that are kept.
    fn draws(&self) -> usize {
        RESAMPLES * self.sizes.iter().sum::<usize>()
    }

    fn of(kind: Kind, sizes: &[usize]) -> Self {
        let n = sizes.iter().sum::<usize>();
        let (mut numbers, mut counts_of_lanes, mut resample) = (Vec::new(), Vec::new(), 0);
        match kind {
            Kind::CountsOfLanes => counts_of_lanes.resize(RESAMPLES / LANES * n, [0; LANES]),
            Kind::Counts | Kind::Draws => numbers.resize(RESAMPLES * n, 0),
        }
        visit_new(sizes, |drawn| {
            let of_resample = resample * n..(resample + 1) * n;
            match kind {
                Kind::Counts => count(drawn, &mut numbers[of_resample]),
                // Resamples that are kept are of few runs.
                Kind::Draws => {
                    for (number, &run) in numbers[of_resample].iter_mut().zip(drawn) {
                        *number = run as u16;
                    }
                }
                Kind::CountsOfLanes => {
                    let of_lanes = &mut counts_of_lanes[resample / LANES * n..][..n];
                    count_in_lane(drawn, resample % LANES, of_lanes);
                }
            }
            resample += 1;
        });
        Self {
            kind,
            sizes: sizes.to_vec(),
            numbers,
            counts_of_lanes,
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
