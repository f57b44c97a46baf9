//! The first thing in a run that the physics of its task cannot have computed well.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A physics warning of an episode. The least of several is that of the first episode, in it the
/// first step, and of agents with both in common the first.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct EpisodeWarning {
    /// Number of the agent's episode, from 0.
    pub episode: u32,
    /// Number of the step in the episode: 1 is the first.
    pub step: u32,
    /// The agent.
    pub agent: u32,
    /// What is wrong, and what to do.
    pub message: String,
}

impl fmt::Display for EpisodeWarning {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            episode,
            step,
            agent,
            message,
        } = self;
        write!(
            formatter,
            "agent {agent}, episode {episode}, step {step}: {message}"
        )
    }
}
