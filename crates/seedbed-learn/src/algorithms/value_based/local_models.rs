//! Which of the team's models learn in this process, if a run is divided over several.

use std::ops::Range;

use super::config::{Composition, ModelAssignment};
use crate::agent::bonus::Bonus;
use crate::team::TeamContext;

/// The models of one process.
pub(super) struct LocalModels {
    /// Numbers of the agents that act in this process.
    pub(super) agents: Range<usize>,
    /// Numbers of the models whose state this process passes on. Each model is passed on by the process
    /// in which the agent of the same number is local, or by the last one if there is no such agent.
    pub(super) own: Range<usize>,
    /// Whether each model learns in this process: `[models]`.
    learns: Vec<bool>,
    /// Whether this process passes on what all models share.
    pub(super) has_agent_0: bool,
}

impl LocalModels {
    /// Models learn where agents may act by them. All learn everywhere if models are drawn for every
    /// round, or if the bonus model of one is copied to the others.
    pub(super) fn new(composition: &Composition, context: &TeamContext<'_>) -> Self {
        let count = composition.models;
        let agents = context.local_agents();
        let is_last = agents.end == context.config.count.get();
        let end = if is_last { count } else { agents.end as usize };
        let own = (agents.start as usize).min(count)..end.min(count);
        let all_learn =
            composition.assignment != ModelAssignment::Fixed || composition.bonus != Bonus::None;
        let mut learns = vec![all_learn; count];
        learns[own.clone()].fill(true);
        for agent in agents.clone() {
            learns[agent as usize % count] = true;
        }
        Self {
            agents: agents.start as usize..agents.end as usize,
            own,
            learns,
            has_agent_0: agents.start == 0,
        }
    }

    /// Whether a model learns in this process.
    pub(super) fn learns(&self, model: usize) -> bool {
        self.learns[model]
    }
}
