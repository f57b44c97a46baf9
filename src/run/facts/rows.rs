//! Rows of the tables of a run, and the recorded bodies.

use seedbed_env::{Force, Pose, Status};
use serde::{Deserialize, Serialize};

/// One row of `episodes.csv`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpisodeRow {
    /// Number of the agent, from 0.
    pub agent: u32,
    /// Number of the agent's episode, from 0.
    pub episode: u32,
    /// Number of the round, from 0.
    pub round: u32,
    /// Number of steps of the whole team, up to and including this episode.
    pub env_steps: u64,
    /// Sum of the environment's rewards, undiscounted.
    pub r#return: f64,
    /// Number of steps.
    pub length: u32,
    /// `terminated` or `truncated`.
    pub outcome: Status,
    /// Share of the state space that the agent has visited so far, 0 to 1.
    pub coverage: f64,
    /// Entropy of the agent's visited states at the end of the round, nats.
    pub visitation_entropy: f64,
    /// Overlap of the agents' visited states at the end of the round, 0 to 1; equal for all agents.
    pub team_overlap: f64,
    /// Effective number of agents at the end of the round: the number of agents without overlap
    /// that would be equally diverse, 1 to K; equal for all agents of a round.
    pub effective_agents: f64,
}

/// What is recorded of an episode and no agent learns from: the poses of all bodies in each state, the
/// forces on them, the ground, and entries of `info` of environments of Gymnasium.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EpisodeDetails {
    /// Number of the agent, from 0.
    pub agent: u32,
    /// Number of the agent's episode, from 0.
    pub episode: u32,
    /// Pose of each body in each state: `[(T+1) × bodies]`
    pub poses: Vec<Pose>,
    /// The forces during the step before each state, state by state. The first state has none.
    pub forces: Vec<Force>,
    /// Number of forces that belong to each state: `[T+1]`
    pub forces_per_row: Vec<usize>,
    /// The lines of the ground of this episode, as points in the world, m: `[lines]` of `[points]`
    pub terrain: Vec<Vec<[f32; 2]>>,
    /// Entries of `info` in each state: `[(T+1) × info width]`
    pub info: Vec<f32>,
}
