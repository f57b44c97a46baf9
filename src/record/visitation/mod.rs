//! Computes the contents of images of visited states. This module must not depend on any drawing
//! library.
//!
//! Two kinds of images show states. In parallel coordinates ([`Axes`]) a state is one polyline
//! across vertical axes, and [`Density`] counts the lines over each pixel. In plots of pairs
//! ([`Pairs`]) a state is one point in each panel, and [`BonusMap`] averages the bonuses in each
//! cell. [`RoundWindow`] restricts both to the latest rounds. Coordinates are in pixels of the
//! images, to the right and downward.

mod agent_visits;
mod axes;
mod bonus_map;
mod cell_counts;
mod coloring;
mod density;
mod density_delta;
mod difference;
mod pairs;
mod round_window;
mod sampling;
mod unplaced;

pub use agent_visits::AgentVisits;
pub use axes::{AXIS_HEIGHT, Axes, Axis, VisitedState};
pub use bonus_map::{BonusMap, CellBonus};
pub use coloring::{Coloring, outcome_color};
pub use density::{Density, MIN_BRIGHTNESS, brightness_of_pixels};
pub use density_delta::DensityDelta;
pub use difference::{line_count, most_different, share_difference};
pub use pairs::{CELLS_PER_SIDE, Pairs};
pub use round_window::{RoundWindow, first_round};
pub use sampling::{LineQuota, sample_states};
pub use unplaced::Unplaced;

/// Number of equal bins into which the range of each axis is divided.
pub const BINS: usize = 64;

/// The position of `value` in a range, from 0 (low end) to 1 (high end). Values outside are clamped
/// to the ends; NaN has no position, which is NaN.
fn fraction(value: f32, [low, high]: [f32; 2]) -> f32 {
    clamped((value - low) / (high - low))
}

/// `fraction` from 0 to 1, or NaN.
fn clamped(fraction: f32) -> f32 {
    fraction.clamp(0.0, 1.0)
}
