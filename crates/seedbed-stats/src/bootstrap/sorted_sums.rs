//! Sums over sorted resamples of one sample, several resamples at once.
//!
//! Each score is multiplied by the number of times that its run was drawn, and these products are added in ascending order of the
//! scores: the sorted resample is never written down. The scores are finite, because ∞ times no draw would be NaN.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined has other instructions than its caller"
)]

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

/// Number of resamples that are summed at once.
pub(super) const LANES: usize = 16;

/// How often one run was drawn in each resample.
pub(super) type Counts = [u8; LANES];

/// A number for each resample.
type Lanes = [f64; LANES];

/// Number of scores for which it is asked at once whether they are in the middle.
const BLOCK: usize = 16;

/// What is summed.
#[derive(Clone, Copy)]
pub(super) struct SortedSums<'a> {
    /// Finite scores in ascending order: `[n]`.
    pub(super) sorted: &'a [f64],
    /// The run of each of these scores: `[n]`.
    pub(super) order: &'a [u32],
    /// Positions in a sorted resample of the scores that are summed by themselves.
    pub(super) middle: &'a Range<usize>,
}

impl SortedSums<'_> {
    /// The sums of all scores, and of those in the middle, of each resample.   `counts: [n]`, by run
    pub(super) fn of(self, counts: &[Counts]) -> [Lanes; 2] {
        Arch::new().dispatch(OfResamples { of: self, counts })
    }
}

struct OfResamples<'a> {
    of: SortedSums<'a>,
    counts: &'a [Counts],
}

impl WithSimd for OfResamples<'_> {
    type Output = [Lanes; 2];

    // The compiler makes use of the instructions that it is dispatched for. Sums are only added to, so that bits do not depend on them.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let SortedSums {
            sorted,
            order,
            middle,
        } = self.of;
        let middle = middle.start as u32..middle.end as u32;
        let (mut all, mut inner, mut positions) = ([0.0; LANES], [0.0; LANES], [0; LANES]);
        for (scores, runs) in sorted.chunks(BLOCK).zip(order.chunks(BLOCK)) {
            let of_block = || {
                let counts = runs.iter().map(|&run| &self.counts[run as usize]);
                scores.iter().copied().zip(counts)
            };
            let begin = positions;
            for (_, counts) in of_block() {
                advance(&mut positions, counts);
            }
            let (least, most) = (smallest(&begin), largest(&positions));
            if most <= middle.start || least >= middle.end {
                for (score, counts) in of_block() {
                    add(&mut all, score, counts);
                }
            } else if least >= middle.start && most <= middle.end {
                for (score, counts) in of_block() {
                    add(&mut all, score, counts);
                    add(&mut inner, score, counts);
                }
            } else {
                let mut position = begin;
                for (score, counts) in of_block() {
                    add(&mut all, score, counts);
                    add_part(&mut inner, score, (counts, &position), &middle);
                    advance(&mut position, counts);
                }
            }
        }
        [all, inner]
    }
}

/// Adds a score times the number of its draws to each sum.
#[inline(always)]
fn add(sums: &mut Lanes, score: f64, counts: &Counts) {
    for (sum, &count) in sums.iter_mut().zip(counts) {
        *sum += score * f64::from(count);
    }
}

/// Adds a score times the number of its draws that are in the middle to each sum.   `positions`: of the first draw
#[inline(always)]
fn add_part(
    sums: &mut Lanes,
    score: f64,
    (counts, positions): (&Counts, &[u32; LANES]),
    middle: &Range<u32>,
) {
    let mut draws = [0; LANES];
    for ((draws, &position), &count) in draws.iter_mut().zip(positions).zip(counts) {
        let (start, end) = (
            middle.start.max(position),
            middle.end.min(position + u32::from(count)),
        );
        *draws = (end.max(start) - start) as u8;
    }
    add(sums, score, &draws);
}

#[inline(always)]
fn advance(positions: &mut [u32; LANES], counts: &Counts) {
    for (position, &count) in positions.iter_mut().zip(counts) {
        *position += u32::from(count);
    }
}

#[inline(always)]
fn smallest(positions: &[u32; LANES]) -> u32 {
    positions.iter().copied().fold(u32::MAX, u32::min)
}

#[inline(always)]
fn largest(positions: &[u32; LANES]) -> u32 {
    positions.iter().copied().fold(0, u32::max)
}
