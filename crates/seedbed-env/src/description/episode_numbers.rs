//! Numbers that are drawn at the start of each episode.

use super::Distribution;

/// A number that is drawn at the start of each episode, such as the place of a target.
#[derive(Clone, Debug, PartialEq)]
pub struct EpisodeNumber {
    /// Name, unique among drawn numbers, sensors, observations and actions.
    pub name: String,
    /// Distribution over episodes.
    pub distribution: Distribution,
}
