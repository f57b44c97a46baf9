//! What agents experienced: episodes, and the buffer in which a team shares them.
//!
//! Order is by (round, agent), never by arrival. Learning may not enter.

use serde::{Deserialize, Serialize};

use crate::env::{Spec, Status};

/// One finished episode of T steps (thesis §5.1): what the agent saw, did, how likely that was, and what it got.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Episode {
    /// Who acted.
    pub agent: u32,
    /// The agent's own count of episodes, from 0.
    pub episode: u32,
    /// The round in which the episode was played, from 0.
    pub round: u32,
    /// Row t is what was seen before action t; the last row is what was seen at the end. `[(T+1) × observation width]`
    pub observations: Vec<f32>,
    /// `[T × action width]`
    pub actions: Vec<f32>,
    /// `[T]`: entry t is `R_{t+1}`, the environment's own, without seeds or bonus.
    pub rewards: Vec<f32>,
    /// `[T × action width]`: log π(aₜ|sₜ) under the policy that acted, for each component of the action; the sum is the action's.
    pub log_probs: Vec<f32>,
    /// How it ended: [`Status::Terminated`] or [`Status::Truncated`].
    pub outcome: Status,
}

impl Episode {
    /// An episode about to be played, with room for the task's longest.
    #[must_use]
    pub fn start(agent: u32, episode: u32, round: u32, spec: &Spec) -> Self {
        let steps = spec.time_limit.min(10_000) as usize;
        Self {
            agent,
            episode,
            round,
            observations: Vec::with_capacity((steps + 1) * spec.observation_width()),
            actions: Vec::with_capacity(steps * spec.action_width()),
            rewards: Vec::with_capacity(steps),
            log_probs: Vec::with_capacity(steps * spec.action_width()),
            outcome: Status::Running,
        }
    }

    /// T, the number of steps.
    #[must_use]
    pub fn length(&self) -> usize {
        self.rewards.len()
    }

    /// Sum of rewards, undiscounted.
    #[must_use]
    pub fn total_reward(&self) -> f64 {
        self.rewards.iter().map(|&reward| f64::from(reward)).sum()
    }

    /// log π(aₜ|sₜ) of whole actions: `[T]`.
    pub fn action_log_probs(&self) -> impl Iterator<Item = f32> {
        let width = self.log_probs.len() / self.length().max(1);
        self.log_probs.chunks_exact(width.max(1)).map(|components| components.iter().sum())
    }

    /// The observations before each action: `[T × observation width]`, without the last row.
    #[must_use]
    pub fn states(&self) -> &[f32] {
        let width = self.observations.len() / (self.length() + 1);
        &self.observations[..self.length() * width]
    }
}

/// The team's shared experience: the episodes of the latest rounds, ordered by (round, agent).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SharedBuffer {
    rounds_kept: usize,
    rounds: Vec<Vec<Episode>>,
}

impl SharedBuffer {
    /// An empty buffer that will keep the episodes of the latest `rounds_kept` rounds.
    #[must_use]
    pub fn new(rounds_kept: usize) -> Self {
        Self { rounds_kept: rounds_kept.max(1), rounds: Vec::new() }
    }

    /// Adds a round's episodes, in (agent) order, and forgets the oldest round beyond those kept.
    pub fn push_round(&mut self, episodes: Vec<Episode>) {
        debug_assert!(episodes.is_sorted_by_key(|episode| episode.agent), "episodes come in agent order");
        if self.rounds.len() == self.rounds_kept {
            self.rounds.remove(0);
        }
        self.rounds.push(episodes);
    }

    /// The episodes of the newest round, in agent order.
    #[must_use]
    pub fn newest_round(&self) -> &[Episode] {
        self.rounds.last().map_or(&[], Vec::as_slice)
    }
}
