//! Minibatches of transitions for gradient steps.

use crate::agent::bonus::TransitionPairs;
use crate::algorithms::seed_pg::config::TimeLimit;
use crate::experience::replay::Transition;
use seedbed_env::{Status, TaskSpec};

/// B transitions, stored column by column.
#[derive(Default)]
pub(super) struct Minibatch {
    /// Observations before the actions: `[B × width]`.
    pub(super) states: Vec<f32>,
    /// Indices of the chosen actions: `[B]`.
    pub(super) actions: Vec<usize>,
    /// Rewards with seeds and bonuses: `[B]`.
    pub(super) rewards: Vec<f32>,
    /// Observations after the actions: `[B × width]`.
    pub(super) next_states: Vec<f32>,
    /// γ, or 0 after the end of an episode: `[B]`.
    pub(super) discounts: Vec<f32>,
    /// Weights of the transitions in the loss: `[B]`.
    pub(super) weights: Vec<f32>,
    /// The same transitions as input of a bonus model. None without a bonus model.
    pub(super) pairs: Option<TransitionPairs>,
}

impl Minibatch {
    /// An empty minibatch whose transitions will be passed to a bonus model.
    pub(super) fn for_bonus_model(spec: &TaskSpec) -> Self {
        Self {
            pairs: Some(TransitionPairs::new(spec)),
            ..Self::default()
        }
    }

    pub(super) fn clear(&mut self) {
        let Self {
            states,
            rewards,
            next_states,
            discounts,
            weights,
            ..
        } = self;
        [states, rewards, next_states, discounts, weights]
            .into_iter()
            .for_each(Vec::clear);
        self.actions.clear();
        if let Some(pairs) = &mut self.pairs {
            pairs.clear();
        }
    }

    /// Adds a transition.   `reward`: with its seed, `discount`: γ or 0, `weight`: in the loss
    pub(super) fn push(
        &mut self,
        transition: &Transition<'_>,
        reward: f32,
        discount: f32,
        weight: f32,
    ) {
        self.states.extend_from_slice(transition.state);
        self.actions.push(transition.action[0] as usize);
        self.rewards.push(reward);
        self.next_states.extend_from_slice(transition.next_state);
        self.discounts.push(discount);
        self.weights.push(weight);
        if let Some(pairs) = &mut self.pairs {
            pairs.push(transition);
        }
    }
}

/// The discount factor of the value of the next state: γ, or 0 if the episode ended.
pub(in crate::algorithms) fn discount_after(
    discount: f32,
    status: Status,
    time_limit: TimeLimit,
) -> f32 {
    let has_ended = status == Status::Terminated
        || (status == Status::Truncated && time_limit == TimeLimit::Ends);
    if has_ended { 0.0 } else { discount }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_value_after_an_end_is_not_used() {
        let discount = |status, time_limit| discount_after(0.9, status, time_limit);
        assert_eq!(discount(Status::Running, TimeLimit::Ends), 0.9);
        assert_eq!(discount(Status::Terminated, TimeLimit::Bootstraps), 0.0);
        assert_eq!(discount(Status::Truncated, TimeLimit::Bootstraps), 0.9);
        assert_eq!(discount(Status::Truncated, TimeLimit::Ends), 0.0);
    }
}
