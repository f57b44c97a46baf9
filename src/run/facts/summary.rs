//! The results of a run in a few numbers: `summary.json`.

use serde::{Deserialize, Serialize};

/// The results of a run in a few numbers. What is not known of a run that another program recorded
/// is `None` or empty.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// The scenario's name.
    pub scenario: String,
    /// The task's name.
    pub environment: String,
    /// The run seed.
    #[serde(default)]
    pub seed: Option<u64>,
    /// Number of agents K.
    pub agents: usize,
    /// Number of rounds.
    pub rounds: u32,
    /// Number of episodes per agent.
    pub episodes_per_agent: usize,
    /// Number of environment steps of the whole team.
    pub env_steps: u64,
    /// The threshold at which the task counts as solved, if there is one.
    pub solved_at: Option<SolvedAt>,
    /// Number of episodes per agent until the threshold was reached; `None` if it was not.
    pub episodes_until_solved: Option<usize>,
    /// Mean return over agents and over the last [`FINAL_WINDOW`](super::FINAL_WINDOW) episodes of each agent; `None` if an
    /// agent has finished none.
    pub final_return: Option<f64>,
    /// Share of the state space that each agent visited, 0 to 1: `[K]`.
    #[serde(default)]
    pub coverage: Vec<f64>,
    /// Share of the state space that the team visited, 0 to 1.
    #[serde(default)]
    pub team_coverage: Option<f64>,
    /// Entropy of each agent's visits, nats: `[K]`.
    #[serde(default)]
    pub visitation_entropy: Vec<f64>,
    /// `visitation_entropy` divided by its maximum, 0 to 1: `[K]`.
    #[serde(default)]
    pub visitation_evenness: Vec<f64>,
    /// Overlap of the agents' visited states, 0 to 1.
    #[serde(default)]
    pub team_overlap: Option<f64>,
    /// Effective number of agents, 1 to K: the number of agents without overlap that would be as
    /// diverse as the team.
    #[serde(default)]
    pub effective_agents: Option<f64>,
    /// Why results cannot be repeated bit for bit, if an environment of Gymnasium does not allow it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub repeatability_warning: Option<String>,
    /// What the physics of the task could not compute well: the first place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub physics_warning: Option<String>,
}

/// The threshold at which a task counts as solved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SolvedAt {
    /// Mean return over all agents and the window.
    pub r#return: f64,
    /// Number of episodes per agent.
    pub window: usize,
}
