//! Numbers that are drawn during a run: at the start of each episode, in each step, or for each point
//! of a terrain.

use super::Distribution;

/// A number that is drawn, such as the place of a target at the start of each episode.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnNumber {
    /// Name, unique among drawn numbers, sensors, observations and actions.
    pub name: String,
    /// Its distribution.
    pub distribution: Distribution,
}
