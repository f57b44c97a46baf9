//! Numbers that are drawn during a run: at the start of each episode, in each step, or for each point
//! of a terrain.

use super::Distribution;
use crate::random::Stream;

/// A number that is drawn, such as the place of a target at the start of each episode.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnNumber {
    /// Name, unique among drawn numbers, sensors, observations and actions.
    pub name: String,
    /// Its distribution.
    pub distribution: Distribution,
}

impl DrawnNumber {
    /// Draws the number, in single precision.
    pub(crate) fn draw(&self, random: &mut Stream) -> f32 {
        let value = self.distribution.draw(random);
        value.clamp(f32::MIN.into(), f32::MAX.into()) as f32
    }
}
