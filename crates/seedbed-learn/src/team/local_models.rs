//! Which of the team's models learn in this process, if a run is divided over several.

use std::ops::Range;

use super::TeamContext;

/// The models of one process.
pub(crate) struct LocalModels {
    /// Numbers of the agents that act in this process.
    pub(crate) agents: Range<usize>,
    /// Numbers of the models whose state this process passes on. Each model is passed on by the process
    /// in which the agent of the same number is local, or by the last one if there is no such agent.
    pub(crate) own: Range<usize>,
    /// Whether each model learns in this process: `[models]`.
    learns: Vec<bool>,
    /// Whether this process passes on what all models share.
    pub(crate) has_agent_0: bool,
}

impl LocalModels {
    /// The models of a team of which agent k acts by model k mod `count`. Models learn where agents act
    /// by them, or everywhere if `all_learn`.
    pub(crate) fn new(count: usize, all_learn: bool, context: &TeamContext<'_>) -> Self {
        let agents = context.local_agents();
        let is_last = agents.end == context.config.count.get();
        let end = if is_last { count } else { agents.end as usize };
        let own = (agents.start as usize).min(count)..end.min(count);
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
    pub(crate) fn learns(&self, model: usize) -> bool {
        self.learns[model]
    }
}
