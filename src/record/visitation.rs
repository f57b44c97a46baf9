//! What the pictures of visited states are computed from: parallel coordinates, their density, and which states become lines.
//!
//! A state is one polyline across upright axes, one axis for each observation. Any drawing library may draw this; none may enter.
//! Coordinates are in pixels of the density image, to the right and downwards.

use rand::RngExt;
use serde::{Deserialize, Serialize};

use crate::env::{Quantity, Spec};
use crate::random::Stream;

/// Equal parts into which the range of each axis is divided.
pub const BINS: usize = 64;

/// Height of the axes, in pixels: one for each bin.
pub const HEIGHT: usize = BINS;

/// All axes together are about this wide, in pixels.
const WIDTH: usize = 192;

/// Axes are never closer than this, in pixels.
const MIN_GAP: usize = 32;

/// The axes of a task, from left to right.
#[derive(Clone, Debug, PartialEq)]
pub struct Axes {
    axes: Vec<Axis>,
    gap: usize,
}

/// One upright axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// What is read off it, with the values at its lower and upper end.
    pub quantity: Quantity,
    source: Source,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Source {
    Step,
    Observation(usize),
    IntrinsicReward,
}

impl Axes {
    /// One axis an observation. A task that observes a single number gets the step within the episode as its first axis; curious agents
    /// have their bonus, up to `largest_bonus`, as their last one.
    #[must_use]
    pub fn of(spec: &Spec, largest_bonus: Option<f32>) -> Self {
        Self::of_quantities(&spec.observations, spec.time_limit, largest_bonus)
    }

    /// Likewise, from what is observed and the steps that an episode may have.
    #[must_use]
    pub fn of_quantities(observations: &[Quantity], time_limit: u32, largest_bonus: Option<f32>) -> Self {
        let observed = observations.iter().enumerate();
        let observed = observed.map(|(i, quantity)| Axis { quantity: quantity.clone(), source: Source::Observation(i) });
        let mut axes: Vec<Axis> = observed.collect();
        if axes.len() < 2 {
            axes.insert(0, step_axis(time_limit));
        }
        axes.extend(largest_bonus.map(bonus_axis));
        Self::side_by_side(axes)
    }

    fn side_by_side(axes: Vec<Axis>) -> Self {
        let gap = (WIDTH / (axes.len() - 1).max(1)).max(MIN_GAP);
        Self { axes, gap }
    }

    /// Some of these axes, by their places, as axes of a picture of their own.
    #[must_use]
    pub fn chosen(&self, places: &[usize]) -> Self {
        Self::side_by_side(places.iter().map(|&place| self.axes[place].clone()).collect())
    }

    /// From left to right.
    #[must_use]
    pub fn all(&self) -> &[Axis] {
        &self.axes
    }

    /// Pairs of neighbouring axes.
    #[must_use]
    pub fn pairs(&self) -> usize {
        self.axes.len() - 1
    }

    /// Width of the density image, in pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.pairs() * self.gap + 1
    }

    /// Where axis `axis` stands: the middle of its column of pixels.
    #[must_use]
    pub fn x(&self, axis: usize) -> f32 {
        (axis * self.gap) as f32 + 0.5
    }

    /// Puts where a state crosses the axes, 0 at their lower and 1 at their upper ends, into `fractions`: `[axes]`.
    /// What lies beyond an end counts as at the end.
    pub fn project(&self, step: usize, observation: &[f32], bonus: f32, fractions: &mut Vec<f32>) {
        fractions.clear();
        fractions.extend(self.axes.iter().map(|axis| {
            let value = match axis.source {
                Source::Step => step as f32,
                Source::Observation(i) => observation[i],
                Source::IntrinsicReward => bonus,
            };
            fraction(value, axis.quantity.range)
        }));
    }

    /// The polyline of a projected state: `[axes]` points.
    pub fn line(&self, fractions: &[f32]) -> impl Iterator<Item = [f32; 2]> {
        fractions.iter().enumerate().map(|(axis, fraction)| [self.x(axis), (1.0 - fraction) * HEIGHT as f32])
    }
}

fn step_axis(time_limit: u32) -> Axis {
    let range = [0.0, time_limit.max(1) as f32];
    Axis { quantity: Quantity { name: "step".to_owned(), unit: String::new(), range }, source: Source::Step }
}

/// A range without extent, where bonuses weigh nothing, gets one.
fn bonus_axis(largest: f32) -> Axis {
    let range = [0.0, if largest > 0.0 { largest } else { 1.0 }];
    Axis {
        quantity: Quantity { name: "intrinsic reward".to_owned(), unit: String::new(), range },
        source: Source::IntrinsicReward,
    }
}

/// Not a number counts as low.
fn fraction(value: f32, [low, high]: [f32; 2]) -> f32 {
    let fraction = (value - low) / (high - low);
    if fraction > 0.0 { fraction.min(1.0) } else { 0.0 }
}

/// How many lines cross each pixel between neighbouring axes.
///
/// States are counted in a 64 × 64 histogram for each pair of axes; only cells that changed are drawn again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Density {
    gap: usize,
    pairs: usize,
    /// States since the latest drawing: `[pairs × bins × bins]`, by the bins on the left and the right axis.
    counts: Vec<u32>,
    /// The cells of `counts` that are not zero.
    touched: Vec<u32>,
    /// Lines over each pixel, without those still in `counts`: `[height × width]`.
    pixels: Vec<u32>,
}

impl Density {
    /// Nothing visited yet.
    #[must_use]
    pub fn new(axes: &Axes) -> Self {
        Self {
            gap: axes.gap,
            pairs: axes.pairs(),
            counts: vec![0; axes.pairs() * BINS * BINS],
            touched: Vec::new(),
            pixels: vec![0; axes.width() * HEIGHT],
        }
    }

    /// Whether this was made for such axes.
    #[must_use]
    pub fn fits(&self, axes: &Axes) -> bool {
        (self.gap, self.pairs) == (axes.gap, axes.pairs()) && self.pixels.len() == axes.width() * HEIGHT
    }

    /// Counts one projected state.
    pub fn add(&mut self, fractions: &[f32]) {
        for (pair, ends) in fractions.windows(2).enumerate() {
            let cell = (pair * BINS + bin(ends[0])) * BINS + bin(ends[1]);
            if self.counts[cell] == 0 {
                self.touched.push(cell as u32);
            }
            self.counts[cell] += 1;
        }
    }

    /// Lines over each pixel: `[height × width]`.
    pub fn pixels(&mut self) -> &[u32] {
        for cell in std::mem::take(&mut self.touched) {
            let count = std::mem::take(&mut self.counts[cell as usize]);
            self.draw(cell as usize, count);
        }
        &self.pixels
    }

    /// Draws a cell as a straight line, one bin high, from axis to axis; the last pair includes the last axis.
    fn draw(&mut self, cell: usize, count: u32) {
        let (pair, left, right) = (cell / (BINS * BINS), cell / BINS % BINS, cell % BINS);
        let (left, right) = (row(left), row(right));
        let width = self.pairs * self.gap + 1;
        let columns = if pair + 1 == self.pairs { self.gap + 1 } else { self.gap };
        // Heights in 65,536ths of a pixel, so that no column needs a division.
        let rise = (((right as i64) - (left as i64)) << 16) / self.gap as i64;
        let mut height = ((left as i64) << 16) + (1 << 15);
        for column in 0..columns {
            let pixel = (height >> 16) as usize * width + pair * self.gap + column;
            self.pixels[pixel] += count;
            height += rise;
        }
    }
}

fn bin(fraction: f32) -> usize {
    ((fraction * BINS as f32) as usize).min(BINS - 1)
}

/// The row of pixels of a bin; bin 0 is the lowest.
fn row(bin: usize) -> usize {
    BINS - 1 - bin
}

/// Brightness of each pixel: 0 where no line passes, else from 40 (one line) to 255 (the most lines), on a logarithmic scale.
#[must_use]
pub fn shade(pixels: &[u32]) -> Vec<u8> {
    let most = log2(pixels.iter().copied().max().unwrap_or(0)).max(1);
    let brightness = |lines: u32| 40 + (log2(lines) * 215 / most) as u8;
    pixels.iter().map(|&lines| if lines == 0 { 0 } else { brightness(lines) }).collect()
}

/// 256 log₂ `n`, straight between powers of two; the same on every machine. 0 for 0.
fn log2(n: u32) -> u32 {
    let Some(whole) = n.checked_ilog2() else { return 0 };
    let part = ((u64::from(n) << 8) >> whole) as u32 - 256;
    whole * 256 + part
}

/// How many states become lines, such that never more than the wanted number is visible at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineQuota {
    /// Rounds and episodes whose lines are visible together.
    pub window: u32,
    /// Lines of an agent in one round.
    pub per_round: u32,
}

/// Lines of the latest 50 episodes are shown together.
const WINDOW: u32 = 50;

impl LineQuota {
    /// For `lines` visible lines an agent.
    #[must_use]
    pub fn of(lines: u32) -> Self {
        let window = lines.clamp(1, WINDOW);
        Self { window, per_round: lines / window }
    }

    /// Lines of the `index`-th of an agent's `episodes` in a round.
    #[must_use]
    pub fn of_episode(self, index: usize, episodes: usize) -> usize {
        let until = |episode: usize| self.per_round as usize * episode / episodes;
        until(index + 1) - until(index)
    }
}

/// Picks `count` of `states` states, in order: one at random from each of `count` parts of the episode. All, if there are fewer.
pub fn pick_states(states: usize, count: usize, random: &mut Stream) -> Vec<usize> {
    if count >= states {
        return (0..states).collect();
    }
    let start = |part: usize| part * states / count;
    (0..count).map(|part| random.random_range(start(part) as u64..start(part + 1) as u64) as usize).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Purpose, stream};

    fn spec(ranges: &[[f32; 2]]) -> Spec {
        let quantity = |(i, &range): (usize, &[f32; 2])| Quantity { name: format!("o{i}"), unit: "m".to_owned(), range };
        Spec {
            name: "task".to_owned(),
            description: String::new(),
            observations: ranges.iter().enumerate().map(quantity).collect(),
            actions: Vec::new(),
            control_step: 0.02,
            time_limit: 200,
            reward_threshold: None,
        }
    }

    fn projected(axes: &Axes, step: usize, observation: &[f32]) -> Vec<f32> {
        let mut fractions = Vec::new();
        axes.project(step, observation, 0.0, &mut fractions);
        fractions
    }

    #[test]
    fn a_state_is_a_line_across_the_axes() {
        let axes = Axes::of(&spec(&[[-2.0, 2.0], [0.0, 10.0], [-1.0, 1.0]]), None);
        assert_eq!((axes.pairs(), axes.width()), (2, 193));
        let fractions = projected(&axes, 0, &[1.0, 2.5, -1.0]);
        assert_eq!(fractions, [0.75, 0.25, 0.0]);
        assert_eq!(axes.line(&fractions).collect::<Vec<_>>(), [[0.5, 16.0], [96.5, 48.0], [192.5, 64.0]]);
    }

    #[test]
    fn values_beyond_the_axes_stop_at_their_ends() {
        let axes = Axes::of(&spec(&[[-1.0, 1.0]; 3]), None);
        assert_eq!(projected(&axes, 0, &[-7.0, f32::INFINITY, f32::NAN]), [0.0, 1.0, 0.0]);
    }

    #[test]
    fn a_single_observation_is_drawn_against_the_step() {
        let axes = Axes::of(&spec(&[[0.0, 4.0]]), None);
        assert_eq!(axes.all()[0].quantity.name, "step");
        assert_eq!(projected(&axes, 50, &[3.0]), [0.25, 0.75]);
    }

    #[test]
    fn many_axes_keep_their_distance() {
        assert_eq!(Axes::of(&spec(&[[0.0, 1.0]; 12]), None).width(), 11 * MIN_GAP + 1);
    }

    #[test]
    fn a_level_line_brightens_the_row_of_its_bin() {
        let axes = Axes::of(&spec(&[[0.0, 1.0]; 2]), None);
        let mut density = Density::new(&axes);
        density.add(&[0.0, 0.0]);
        density.add(&[0.0, 0.0]);
        let width = axes.width();
        let pixels = density.pixels();
        assert!(pixels[..63 * width].iter().all(|&lines| lines == 0));
        assert!(pixels[63 * width..].iter().all(|&lines| lines == 2));
    }

    #[test]
    fn a_rising_line_passes_half_way() {
        let axes = Axes::of(&spec(&[[0.0, 1.0]; 2]), None);
        let mut density = Density::new(&axes);
        density.add(&[0.0, 1.0]);
        let width = axes.width();
        let pixels = density.pixels().to_vec();
        let rows = |column: usize| (0..HEIGHT).filter(|row| pixels[row * width + column] == 1).collect::<Vec<_>>();
        assert_eq!((rows(0), rows(96), rows(192)), (vec![63], vec![32], vec![0]));
        assert_eq!(pixels.iter().sum::<u32>() as usize, width);
    }

    #[test]
    fn drawing_in_between_changes_nothing() {
        let axes = Axes::of(&spec(&[[0.0, 1.0]; 3]), None);
        let states = [[0.1, 0.5, 0.9], [0.3, 0.3, 0.2], [0.1, 0.5, 0.9]];
        let (mut often, mut once) = (Density::new(&axes), Density::new(&axes));
        for state in &states {
            often.add(state);
            often.pixels();
            once.add(state);
        }
        assert_eq!(often.pixels(), once.pixels());
    }

    #[test]
    fn brightness_is_logarithmic() {
        assert_eq!(shade(&[0, 1, 2, 4, 16]), [0, 40, 40 + 53, 40 + 107, 255]);
        assert_eq!(shade(&[0, 0]), [0, 0]);
        assert_eq!((log2(1), log2(3), log2(4), log2(u32::MAX)), (0, 256 + 128, 512, 31 * 256 + 255));
    }

    #[test]
    fn the_quota_never_exceeds_the_wanted_lines() {
        assert_eq!(LineQuota::of(1000), LineQuota { window: 50, per_round: 20 });
        assert_eq!(LineQuota::of(7), LineQuota { window: 7, per_round: 1 });
        assert_eq!(LineQuota::of(0), LineQuota { window: 1, per_round: 0 });
        let shares: Vec<_> = (0..3).map(|index| LineQuota::of(1000).of_episode(index, 3)).collect();
        assert_eq!(shares, [6, 7, 7]);
    }

    #[test]
    fn picked_states_are_spread_over_the_episode() {
        let mut random = stream(1, Purpose::Recording, 0, 0);
        let picked = pick_states(200, 20, &mut random);
        assert!(picked.iter().enumerate().all(|(part, &state)| state / 10 == part), "{picked:?}");
        assert_eq!(pick_states(3, 20, &mut random), [0, 1, 2]);
        assert_eq!(pick_states(3, 0, &mut random), [0_usize; 0]);
    }

    /// A bonus of 0.3 of at most 1.2 crosses the last axis at a quarter of its height.
    #[test]
    fn curious_agents_have_an_axis_for_their_bonus() {
        let axes = Axes::of(&spec(&[[0.0, 1.0]; 2]), Some(1.2));
        assert_eq!(axes.all()[2].quantity.name, "intrinsic reward");
        let mut fractions = vec![];
        axes.project(0, &[0.5, 1.0], 0.3, &mut fractions);
        assert!((fractions[2] - 0.25).abs() < 1e-6, "{fractions:?}");
    }
}
