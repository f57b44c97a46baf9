//! Sums over sorted resamples of one sample, several resamples at once.
//!
//! The scores of a resample are added one after the other in ascending order, each as often as its run was drawn. Sums have the bits
//! of [`Iterator::sum`] over the sorted resample, which is never written down: a number of draws differs from resample to resample,
//! so what is not drawn again adds −0, which changes no sum.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined has other instructions than its caller"
)]

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use super::USUAL_DRAWS;

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
    /// Scores in ascending order: `[n]`.
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
        let (mut all, mut inner, mut positions) = ([-0.0; LANES], [-0.0; LANES], [0; LANES]);
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

/// Adds a score to each sum as often as it was drawn.
#[inline(always)]
fn add(sums: &mut Lanes, score: f64, counts: &Counts) {
    // Two loops, because the end of one with an unpredictable length takes longer than the rest of it.
    for draw in 0..USUAL_DRAWS as u8 {
        add_draw(sums, score, draw, counts);
    }
    for draw in USUAL_DRAWS as u8..largest_count(counts) {
        add_draw(sums, score, draw, counts);
    }
}

/// Adds a score where it was drawn more than `draw` times.
#[inline(always)]
fn add_draw(sums: &mut Lanes, score: f64, draw: u8, counts: &Counts) {
    for (sum, &count) in sums.iter_mut().zip(counts) {
        *sum += if draw < count { score } else { -0.0 };
    }
}

/// Adds a score to each sum as often as it was drawn to a position in the middle.   `positions`: of the first draw
#[inline(always)]
fn add_part(
    sums: &mut Lanes,
    score: f64,
    (counts, positions): (&Counts, &[u32; LANES]),
    middle: &Range<u32>,
) {
    let (mut first_draws, mut numbers_of_draws) = ([0; LANES], [0; LANES]);
    for lane in 0..LANES {
        let [start, end] =
            [middle.start, middle.end].map(|end| end.saturating_sub(positions[lane]));
        first_draws[lane] = start;
        numbers_of_draws[lane] = end.min(counts[lane].into()).saturating_sub(start);
    }
    for draw in 0..u32::from(largest_count(counts)) {
        for ((sum, first), number) in sums.iter_mut().zip(first_draws).zip(numbers_of_draws) {
            // A draw before the first is a large number.
            let is_summed = draw.wrapping_sub(first) < number;
            *sum += if is_summed { score } else { -0.0 };
        }
    }
}

#[inline(always)]
fn advance(positions: &mut [u32; LANES], counts: &Counts) {
    for (position, &count) in positions.iter_mut().zip(counts) {
        *position += u32::from(count);
    }
}

#[inline(always)]
fn largest_count(counts: &Counts) -> u8 {
    counts.iter().copied().fold(0, u8::max)
}

#[inline(always)]
fn smallest(positions: &[u32; LANES]) -> u32 {
    positions.iter().copied().fold(u32::MAX, u32::min)
}

#[inline(always)]
fn largest(positions: &[u32; LANES]) -> u32 {
    positions.iter().copied().fold(0, u32::max)
}
