//! Planning in a learned model: a search for the sequence of actions with the highest imagined
//! return, executed step by step (model-predictive control; Chua et al. 2018, "PETS").

pub(crate) mod imagination;
pub(crate) mod search;

use self::imagination::{Imagination, ImaginationBuffers};
use self::search::{Search, SearchBuffers};
use seedbed_random::Stream;

/// Buffers for planning, reused from step to step; one per thread that acts.
#[derive(Debug, Default)]
pub(crate) struct PlanningBuffers {
    search: SearchBuffers,
    imagination: ImaginationBuffers,
}

/// The plan that one agent executes.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Plan {
    /// The planned actions as inputs of the model: `[horizon × width]`; empty before the first plan
    /// of an episode.
    actions: Vec<f32>,
    /// Number of steps since the plan was made.
    steps: usize,
}

impl Plan {
    /// Forgets the plan of the last episode.
    pub(crate) fn clear(&mut self) {
        self.actions.clear();
        self.steps = 0;
    }

    /// The next action as inputs of the model: `[width]`. Searches for a new plan if there is none,
    /// or if `replan_every` of its actions have been executed. The new search starts with the rest of
    /// the old plan, at whose end the last action is repeated.
    pub(crate) fn next_action(
        &mut self,
        (search, imagination): (&Search, &Imagination<'_>),
        (observation, replan_every): (&[f32], usize),
        random: &mut Stream,
        buffers: &mut PlanningBuffers,
    ) -> &[f32] {
        let (width, hold) = (search.width(), imagination.hold);
        if self.actions.is_empty() || self.steps == replan_every * hold {
            self.drop_executed(replan_every, width);
            let PlanningBuffers {
                search: candidates,
                imagination: passes,
            } = buffers;
            search.improve(
                &mut self.actions,
                random,
                candidates,
                |sequences, returns| {
                    imagination.compute_returns(observation, sequences, passes, returns);
                },
            );
            self.steps = 0;
        }
        let action = self.steps / hold;
        self.steps += 1;
        &self.actions[action * width..][..width]
    }

    /// Removes the executed actions, and repeats the last one at the end.
    fn drop_executed(&mut self, count: usize, width: usize) {
        if self.actions.is_empty() {
            return;
        }
        let last = self.actions.len() - width;
        for _ in 0..count {
            self.actions.extend_from_within(last..last + width);
        }
        self.actions.drain(..count * width);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn executed_actions_are_dropped_and_the_last_one_is_repeated() {
        let mut plan = Plan {
            actions: vec![1.0, 10.0, 2.0, 20.0, 3.0, 30.0],
            steps: 2,
        };
        plan.drop_executed(2, 2);
        assert_eq!(plan.actions, [3.0, 30.0, 3.0, 30.0, 3.0, 30.0]);
        plan.drop_executed(1, 2);
        assert_eq!(plan.actions, [3.0, 30.0, 3.0, 30.0, 3.0, 30.0]);
    }
}
