//! Counts how many lines cross each pixel of parallel coordinates.
//!
//! Drawing each state as a separate line would require a pass over the image per state. Instead,
//! states are counted in one 64 × 64 histogram per pair of neighboring axes: all states in one cell
//! have the same line between these axes, so that it is drawn once with the cell's count. Nothing is
//! drawn before an image is asked for, because most rounds have none.

use serde::{Deserialize, Serialize};

use super::axes::{AXIS_HEIGHT, Axes};
use super::{BINS, DensityDelta, cell_counts};

/// Maximum number of cells of a histogram whose memory is freed after each round, because the
/// histograms of thousands of agents would fill the memory. To allocate larger ones in each round
/// would take too long.
const MAX_FREED_CELLS: usize = 1 << 16;

/// Brightness of a pixel with a single line, so that it differs visibly from black (no line).
pub const MIN_BRIGHTNESS: u8 = 40;

/// Counts of the visited states between each pair of neighboring axes, from which the lines over
/// each pixel of parallel coordinates are drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Density {
    gap: usize,
    pairs: usize,
    /// Counts of the states of rounds that have ended: `[pairs × bins × bins]`, by the bins on the
    /// left and the right axis of each pair.
    #[serde(with = "cell_counts")]
    counts: Vec<u32>,
    /// Counts of the states of the current round, in the same order. May be empty if all counts are
    /// zero, as between rounds.
    #[serde(skip)]
    round_counts: Vec<u32>,
    /// The cells of `round_counts` that are not zero.
    #[serde(skip)]
    round_cells: Vec<u32>,
}

impl Density {
    /// A density without states.
    #[must_use]
    pub fn new(axes: &Axes) -> Self {
        Self {
            gap: axes.gap(),
            pairs: axes.pair_count(),
            counts: vec![0; axes.pair_count() * BINS * BINS],
            round_counts: Vec::new(),
            round_cells: Vec::new(),
        }
    }

    /// Whether this density was made for axes of the same number and distance.
    #[must_use]
    pub fn was_made_for(&self, axes: &Axes) -> bool {
        (self.gap, self.pairs) == (axes.gap(), axes.pair_count())
            && self.counts.len() == self.cell_count()
    }

    /// Counts one projected state. Between two axes on one of which it is NaN, it has no line.
    pub fn add(&mut self, axis_positions: &[f32]) {
        self.round_counts.resize(self.cell_count(), 0);
        let mut bins = axis_positions.iter().map(|position| bin(*position));
        let Some(mut left) = bins.next() else { return };
        for (pair, right) in bins.enumerate() {
            if let (Some(left), Some(right)) = (left, right) {
                self.count((pair * BINS + left) * BINS + right);
            }
            left = right;
        }
    }

    fn cell_count(&self) -> usize {
        self.pairs * BINS * BINS
    }

    fn count(&mut self, cell: usize) {
        if self.round_counts[cell] == 0 {
            self.round_cells.push(cell as u32);
        }
        self.round_counts[cell] += 1;
    }

    /// Adds the counts of the current round to those of earlier rounds, and returns them.
    pub fn end_round(&mut self) -> DensityDelta {
        self.round_cells.sort_unstable();
        let counts = &mut self.round_counts;
        let cells = self.round_cells.drain(..);
        let round = cells.map(|cell| (cell, std::mem::take(&mut counts[cell as usize])));
        let delta = DensityDelta::of(round.inspect(|(cell, count)| {
            self.counts[*cell as usize] += count;
        }));
        if self.round_counts.len() <= MAX_FREED_CELLS {
            self.round_counts = Vec::new();
        }
        delta
    }

    /// Whether all cells of a round lie within the grid of this density.
    #[must_use]
    pub fn has_cells_of(&self, round: &DensityDelta) -> bool {
        round
            .cells()
            .all(|(cell, _)| (cell as usize) < self.cell_count())
    }

    /// Number of lines of the given rounds over each pixel: `[height × width]`.
    #[must_use]
    pub fn pixels_of_rounds<'a>(&self, rounds: impl Iterator<Item = &'a DensityDelta>) -> Vec<u32> {
        let mut counts = vec![0; self.cell_count()];
        for (cell, states) in rounds.flat_map(DensityDelta::cells) {
            counts[cell as usize] += states;
        }
        self.draw(&counts)
    }

    /// Number of lines of all states over each pixel: `[height × width]`.
    #[must_use]
    pub fn pixels(&self) -> Vec<u32> {
        if self.round_cells.is_empty() {
            return self.draw(&self.counts);
        }
        let rounds = self.counts.iter().zip(&self.round_counts);
        self.draw(
            &rounds
                .map(|(ended, current)| ended + current)
                .collect::<Vec<_>>(),
        )
    }

    fn draw(&self, counts: &[u32]) -> Vec<u32> {
        let width = self.pairs * self.gap + 1;
        let mut columns = vec![[0; AXIS_HEIGHT]; width];
        for (cell, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
            self.draw_cell(cell, *count, &mut columns);
        }
        let rows = 0..AXIS_HEIGHT;
        rows.flat_map(|row| columns.iter().map(move |column| column[row]))
            .collect()
    }

    /// Draws a cell as a straight line between two axes, with the height of one bin. The columns of
    /// the last pair include the last axis. `columns`: `[width][height]`, next to each other in memory
    /// where a line crosses them
    fn draw_cell(&self, cell: usize, count: u32, columns: &mut [[u32; AXIS_HEIGHT]]) {
        let (pair, left, right) = (cell / (BINS * BINS), cell / BINS % BINS, cell % BINS);
        let (left_row, right_row) = (row(left), row(right));
        let width = if pair + 1 == self.pairs {
            self.gap + 1
        } else {
            self.gap
        };
        // Fixed-point numbers in units of 1/65,536 pixel need one division per line instead of one
        // per column, and give the same pixels on every machine.
        let y_step = (((right_row as i64) - (left_row as i64)) << 16) / self.gap as i64;
        let mut y = ((left_row as i64) << 16) + (1 << 15);
        for column in columns.iter_mut().skip(pair * self.gap).take(width) {
            column[(y >> 16) as usize % AXIS_HEIGHT] += count;
            y += y_step;
        }
    }
}

/// `None` for NaN.
fn bin(fraction: f32) -> Option<usize> {
    (!fraction.is_nan()).then(|| ((fraction * BINS as f32) as usize).min(BINS - 1))
}

/// The row of pixels of a bin. Bin 0 is the lowest row.
fn row(bin: usize) -> usize {
    BINS - 1 - bin
}

/// Brightness of each pixel: 0 without a line, otherwise from [`MIN_BRIGHTNESS`] (one line) to 255
/// (`max_lines` lines or more), on a logarithmic scale.
#[must_use]
pub fn brightness_of_pixels(pixels: &[u32], max_lines: u32) -> Vec<u8> {
    let max_log = log2_in_256ths(max_lines).max(1);
    let brightness = |lines: u32| {
        MIN_BRIGHTNESS
            + (log2_in_256ths(lines.min(max_lines)) * u32::from(255 - MIN_BRIGHTNESS) / max_log)
                as u8
    };
    pixels
        .iter()
        .map(|&lines| if lines == 0 { 0 } else { brightness(lines) })
        .collect()
}

/// 256 log₂ `n`, interpolated linearly between powers of two; 0 for 0. Uses integers only, so that
/// images have the same bytes on every machine.
fn log2_in_256ths(n: u32) -> u32 {
    let Some(whole) = n.checked_ilog2() else {
        return 0;
    };
    let fraction = ((u64::from(n) << 8) >> whole) as u32 - 256;
    whole * 256 + fraction
}

#[cfg(test)]
mod tests {
    use super::super::axes::tests::spec;
    use super::*;
    use crate::run::recorder::BonusRange;
    use crate::scenario::recording::AxisChoice;

    fn axes(observations: usize) -> Axes {
        Axes::of(
            &spec(&vec![[0.0, 1.0]; observations]),
            &[AxisChoice::Observations],
            BonusRange::None,
        )
    }

    #[test]
    fn a_horizontal_line_crosses_the_pixels_of_its_bin() {
        let axes = axes(2);
        let mut density = Density::new(&axes);
        density.add(&[0.0, 0.0]);
        density.add(&[0.0, 0.0]);
        let width = axes.width();
        let pixels = density.pixels();
        assert!(pixels[..63 * width].iter().all(|&lines| lines == 0));
        assert!(pixels[63 * width..].iter().all(|&lines| lines == 2));
    }

    #[test]
    fn a_rising_line_crosses_the_middle_row_half_way() {
        let axes = axes(2);
        let mut density = Density::new(&axes);
        density.add(&[0.0, 1.0]);
        let width = axes.width();
        let pixels = density.pixels();
        let rows = |column: usize| {
            (0..AXIS_HEIGHT)
                .filter(|row| pixels[row * width + column] == 1)
                .collect::<Vec<_>>()
        };
        assert_eq!(
            (rows(0), rows(96), rows(192)),
            (vec![63], vec![32], vec![0])
        );
        assert_eq!(pixels.iter().sum::<u32>() as usize, width);
    }

    /// Two states on three axes, of which one is NaN on the first and one on the last: each has a line
    /// between the two other axes only.
    #[test]
    fn a_state_has_no_line_to_an_axis_where_it_is_nan() {
        let axes = axes(3);
        let mut density = Density::new(&axes);
        density.add(&[f32::NAN, 0.0, 0.0]);
        density.add(&[1.0, 1.0, f32::NAN]);
        let width = axes.width();
        let pixels = density.pixels();
        let lines_in_column =
            |column: usize| -> u32 { pixels.iter().skip(column).step_by(width).sum() };
        assert_eq!([0, 95, 96, 192].map(lines_in_column), [1; 4]);
        assert_eq!([pixels[0], pixels[64 * width - 1]], [1, 1]);
    }

    #[test]
    fn the_density_does_not_depend_on_when_rounds_end() {
        let axes = axes(3);
        let states = [[0.1, 0.5, 0.9], [0.3, 0.3, 0.2], [0.1, 0.5, 0.9]];
        let (mut often, mut once) = (Density::new(&axes), Density::new(&axes));
        for state in &states {
            often.add(state);
            often.end_round();
            once.add(state);
        }
        assert_eq!(often.pixels(), once.pixels());
    }

    /// Between rounds, a checkpoint has only the cells with states: here two of 4,096, the second after
    /// 126 empty ones, in four bytes after the numbers of the axes, of cells and of these bytes.
    #[test]
    fn checkpoints_store_cells_with_states_only() {
        let mut density = Density::new(&axes(2));
        density.add(&[0.0, 1.0]);
        density.add(&[2.0 / 64.0, 62.0 / 64.0]);
        density.end_round();
        let bytes = postcard::to_stdvec(&density).unwrap();
        assert_eq!(bytes, [192, 1, 1, 128, 32, 4, 63, 1, 126, 1]);
        assert_eq!(postcard::from_bytes::<Density>(&bytes).unwrap(), density);
        let cell_outside = DensityDelta::of([(7, 1)].into_iter());
        let damaged = postcard::to_stdvec(&(192_usize, 1_usize, 3_u32, cell_outside)).unwrap();
        assert!(postcard::from_bytes::<Density>(&damaged).is_err());
    }

    #[test]
    fn single_rounds_can_be_drawn_without_earlier_rounds() {
        let axes = axes(3);
        let states = [
            [0.1, 0.5, 0.9],
            [0.3, 0.3, 0.2],
            [0.1, 0.5, 0.9],
            [0.8, 0.1, 0.4],
        ];
        let (mut all, mut later) = (Density::new(&axes), Density::new(&axes));
        let rounds: Vec<DensityDelta> = states
            .iter()
            .map(|state| {
                all.add(state);
                all.end_round()
            })
            .collect();
        assert_eq!(all.pixels_of_rounds(rounds.iter()), all.pixels());
        states[2..].iter().for_each(|state| later.add(state));
        assert_eq!(all.pixels_of_rounds(rounds[2..].iter()), later.pixels());
        assert!(
            all.has_cells_of(&rounds[3])
                && !all.has_cells_of(&DensityDelta::of([(2 * 64 * 64, 1)].into_iter()))
        );
    }

    #[test]
    fn brightness_is_logarithmic() {
        assert_eq!(
            brightness_of_pixels(&[0, 1, 2, 4, 16], 16),
            [0, 40, 40 + 53, 40 + 107, 255]
        );
        assert_eq!(
            brightness_of_pixels(&[1, 16], 256),
            [40, 40 + 107],
            "the pixel with `max_lines` lines may be in another image"
        );
        assert_eq!(brightness_of_pixels(&[0, 0], 0), [0, 0]);
        assert_eq!(
            (
                log2_in_256ths(1),
                log2_in_256ths(3),
                log2_in_256ths(4),
                log2_in_256ths(u32::MAX)
            ),
            (0, 256 + 128, 512, 31 * 256 + 255)
        );
    }
}
