//! Transitions that one gradient step sees.

use crate::algorithms::seed_pg::config::TimeLimit;
use crate::experience::Episode;
use crate::experience::replay::Transition;
use seedbed_env::{Spec, Status};

/// B transitions, column by column.
#[derive(Default)]
pub(super) struct Minibatch {
    /// `[B × width]`
    pub(super) states: Vec<f32>,
    pub(super) actions: Vec<usize>,
    /// With seeds and bonuses.
    pub(super) rewards: Vec<f32>,
    /// `[B × width]`
    pub(super) next: Vec<f32>,
    /// γ, or 0 where nothing follows.
    pub(super) discounts: Vec<f32>,
    pub(super) weights: Vec<f32>,
    /// The same transitions as curiosity wants them, where there is any: every second step of this.
    pairs: Option<Episode>,
}

impl Minibatch {
    /// Room for transitions that curiosity will see.
    pub(super) fn for_curiosity(spec: &Spec) -> Self {
        Self {
            pairs: Some(Episode::start(0, 0, 0, spec)),
            ..Self::default()
        }
    }

    pub(super) fn clear(&mut self) {
        let Self {
            states,
            rewards,
            next,
            discounts,
            weights,
            ..
        } = self;
        [states, rewards, next, discounts, weights]
            .into_iter()
            .for_each(Vec::clear);
        self.actions.clear();
        if let Some(pairs) = &mut self.pairs {
            [
                &mut pairs.observations,
                &mut pairs.actions,
                &mut pairs.rewards,
            ]
            .into_iter()
            .for_each(Vec::clear);
        }
    }

    /// Adds a transition with its reward as the model has it, γ, and how much it counts.
    pub(super) fn push(
        &mut self,
        transition: &Transition<'_>,
        reward: f32,
        discount: f32,
        weight: f32,
    ) {
        self.states.extend_from_slice(transition.state);
        self.actions.push(transition.action);
        self.rewards.push(reward);
        self.next.extend_from_slice(transition.next);
        self.discounts.push(discount);
        self.weights.push(weight);
        if let Some(pairs) = &mut self.pairs {
            push_pair(pairs, transition);
        }
    }

    /// An episode every second step of which is one of the transitions; the steps between lead from
    /// one to the next.
    pub(super) fn pairs(&self) -> Option<&Episode> {
        self.pairs.as_ref()
    }
}

fn push_pair(pairs: &mut Episode, transition: &Transition<'_>) {
    let between = usize::from(!pairs.observations.is_empty());
    pairs
        .observations
        .extend(transition.state.iter().chain(transition.next));
    pairs
        .actions
        .extend(std::iter::repeat_n(transition.action as f32, 1 + between));
    pairs
        .rewards
        .extend(std::iter::repeat_n(transition.reward, 1 + between));
}

/// What is left of γ after a step.
pub(super) fn remaining(discount: f32, status: Status, time_limit: TimeLimit) -> f32 {
    let ends = status == Status::Terminated
        || (status == Status::Truncated && time_limit == TimeLimit::Ends);
    if ends { 0.0 } else { discount }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experience::replay::Origin;

    /// Transitions 1 → 2 with action 1 and 5 → 6 with action 0 are steps 0 and 2 of the pairs.
    #[test]
    fn every_second_step_is_a_transition() {
        let origin = Origin {
            agent: 0,
            episode: 0,
            step: 0,
        };
        let mut minibatch = Minibatch::for_curiosity(&Spec::new("test", Vec::new(), Vec::new()));
        for _ in 0..2 {
            minibatch.clear();
            for (state, next, action) in [([1.0], [2.0], 1), ([5.0], [6.0], 0)] {
                let transition = Transition {
                    state: &state,
                    action,
                    reward: 0.0,
                    next: &next,
                    status: Status::Running,
                    origin,
                };
                minibatch.push(&transition, 0.0, 0.9, 1.0);
            }
        }
        let pairs = minibatch.pairs().unwrap();
        assert_eq!(
            (&pairs.observations[..], pairs.length()),
            (&[1.0, 2.0, 5.0, 6.0][..], 3)
        );
        assert_eq!((pairs.actions[0], pairs.actions[2]), (1.0, 0.0));
        assert_eq!(
            (&minibatch.states[..], &minibatch.next[..]),
            (&[1.0, 5.0][..], &[2.0, 6.0][..])
        );
    }

    #[test]
    fn nothing_follows_an_end() {
        let remaining = |status, time_limit| remaining(0.9, status, time_limit);
        assert_eq!(remaining(Status::Running, TimeLimit::Ends), 0.9);
        assert_eq!(remaining(Status::Terminated, TimeLimit::Bootstraps), 0.0);
        assert_eq!(remaining(Status::Truncated, TimeLimit::Bootstraps), 0.9);
        assert_eq!(remaining(Status::Truncated, TimeLimit::Ends), 0.0);
    }
}
