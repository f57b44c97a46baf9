//! What the pictures of visited states are computed from. Any drawing library may draw this; none may enter.
//!
//! Two kinds of pictures show states. In parallel coordinates ([`Axes`]) a state is one polyline across upright axes, and
//! [`Density`] counts lines. In plots of pairs ([`Pairs`]) a state is one point in each panel, and [`Novelty`] averages bonuses.
//! [`Latest`] restricts both to the latest rounds. Coordinates are in pixels of the pictures, to the right and downwards.

mod axes;
mod colouring;
mod density;
mod difference;
mod gains;
mod novelty;
mod pairs;
mod sample;
mod visited;
mod window;

pub use axes::{Axes, Axis, HEIGHT, Seen};
pub use colouring::Colouring;
pub use density::{DIMMEST, Density, shade};
pub use difference::{differing, most_different};
pub use gains::Gains;
pub use novelty::{Earned, Novelty};
pub use pairs::{CELLS, Pairs};
pub use sample::{LineQuota, pick_states};
pub use visited::Visited;
pub use window::{Latest, first_of};

/// Equal parts into which the range of each axis is divided.
pub const BINS: usize = 64;

/// The part of a range below `value`, 0 to 1; what lies beyond an end counts as at the end, and what is not a number as low.
fn fraction(value: f32, [low, high]: [f32; 2]) -> f32 {
    let fraction = (value - low) / (high - low);
    if fraction > 0.0 {
        fraction.min(1.0)
    } else {
        0.0
    }
}
