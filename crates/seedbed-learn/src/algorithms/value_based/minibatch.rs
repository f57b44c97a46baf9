//! Minibatches of transitions for gradient steps.

use crate::algorithms::seed_pg::config::TimeLimit;
use crate::experience::Episode;
use crate::experience::replay::{Origin, Transition};
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
    /// Which steps the transitions were: `[B]`.
    pub(super) origins: Vec<Origin>,
    /// The same transitions as input of a bonus model: see [`pairs`](Self::pairs). None without a
    /// bonus model.
    pairs: Option<Episode>,
}

impl Minibatch {
    /// An empty minibatch whose transitions will be passed to a bonus model.
    pub(super) fn for_bonus_model(spec: &TaskSpec) -> Self {
        Self {
            pairs: Some(Episode::start(0, 0, 0, spec)),
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
        self.origins.clear();
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
        self.origins.push(transition.origin);
        if let Some(pairs) = &mut self.pairs {
            push_pair(pairs, transition);
        }
    }

    /// The transitions as an episode, for bonus models, which take episodes: steps 0, 2, 4, … are
    /// the transitions; the steps between them only connect one transition with the next. Names of
    /// these steps are in `origins`.
    pub(super) fn pairs(&self) -> Option<&Episode> {
        self.pairs.as_ref()
    }
}

fn push_pair(pairs: &mut Episode, transition: &Transition<'_>) {
    let connecting_steps = usize::from(!pairs.observations.is_empty());
    pairs
        .observations
        .extend(transition.state.iter().chain(transition.next_state));
    for _ in 0..=connecting_steps {
        pairs.actions.extend_from_slice(transition.action);
    }
    pairs
        .rewards
        .extend(std::iter::repeat_n(transition.reward, 1 + connecting_steps));
}

/// The discount factor of the value of the next state: γ, or 0 if the episode ended.
pub(super) fn discount_after(discount: f32, status: Status, time_limit: TimeLimit) -> f32 {
    let has_ended = status == Status::Terminated
        || (status == Status::Truncated && time_limit == TimeLimit::Ends);
    if has_ended { 0.0 } else { discount }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experience::replay::Origin;

    /// Transitions 1 → 2 with action 1 and 5 → 6 with action 0 are steps 0 and 2 of the episode.
    #[test]
    fn every_second_step_is_a_transition() {
        let origin = Origin {
            agent: 0,
            episode: 0,
            step: 0,
        };
        let mut minibatch =
            Minibatch::for_bonus_model(&TaskSpec::new("test", Vec::new(), Vec::new()));
        for _ in 0..2 {
            minibatch.clear();
            for (state, next_state, action) in [([1.0], [2.0], [1.0]), ([5.0], [6.0], [0.0])] {
                let transition = Transition {
                    state: &state,
                    action: &action,
                    reward: 0.0,
                    next_state: &next_state,
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
            (&minibatch.states[..], &minibatch.next_states[..]),
            (&[1.0, 5.0][..], &[2.0, 6.0][..])
        );
    }

    #[test]
    fn the_value_after_an_end_is_not_used() {
        let discount = |status, time_limit| discount_after(0.9, status, time_limit);
        assert_eq!(discount(Status::Running, TimeLimit::Ends), 0.9);
        assert_eq!(discount(Status::Terminated, TimeLimit::Bootstraps), 0.0);
        assert_eq!(discount(Status::Truncated, TimeLimit::Bootstraps), 0.9);
        assert_eq!(discount(Status::Truncated, TimeLimit::Ends), 0.0);
    }
}
