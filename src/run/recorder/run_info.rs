//! What a recording says about the run that it records.

use seedbed_env::{Scene, TaskSpec};

use super::BonusRange;
use crate::run::ranks::Ranks;

/// What a recording is about, which decides what the viewer shows first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Focus {
    /// How a team learned: visited states, returns, updates.
    Learning,
    /// How bodies moved: scenes.
    Motion,
}

/// The run that is recorded.
#[derive(Clone, Copy, Debug)]
pub struct RunInfo<'a> {
    /// Name of the run, shown by the viewer.
    pub name: &'a str,
    /// What the recording is about.
    pub focus: Focus,
    /// The task.
    pub spec: &'a TaskSpec,
    /// The task's bodies, if it has any.
    pub scene: Option<&'a Scene>,
    /// Number of agents K.
    pub agents: u32,
    /// The processes over which the agents are divided.
    pub ranks: Ranks,
    /// Range of the intrinsic rewards, if the agents have any.
    pub bonus: BonusRange,
    /// Maximum number of episodes per agent.
    pub max_episodes: u32,
    /// The run seed, from which the choice of drawn states is derived.
    pub run_seed: u64,
    /// The resolved scenario, in RON.
    pub scenario: &'a str,
    /// Further properties of the run by name, for queries.
    pub properties: &'a [(&'a str, String)],
}
