//! Transitions of any episodes as input of bonus models, which take episodes.

use crate::experience::Episode;
use crate::experience::replay::{Origin, Transition};
use seedbed_env::TaskSpec;

/// Transitions as an episode: steps 0, 2, 4, … are the transitions; the steps between them only connect
/// one transition with the next.
pub(crate) struct TransitionPairs {
    pub(super) episode: Episode,
    /// Which steps the transitions were.
    pub(super) origins: Vec<Origin>,
}

impl TransitionPairs {
    pub(crate) fn new(spec: &TaskSpec) -> Self {
        Self {
            episode: Episode::start(0, 0, 0, spec),
            origins: Vec::new(),
        }
    }

    pub(crate) fn clear(&mut self) {
        let Episode {
            observations,
            actions,
            rewards,
            ..
        } = &mut self.episode;
        [observations, actions, rewards]
            .into_iter()
            .for_each(Vec::clear);
        self.origins.clear();
    }

    pub(crate) fn push(&mut self, transition: &Transition<'_>) {
        let Self { episode, origins } = self;
        let connecting_steps = usize::from(!origins.is_empty());
        let observations = transition.state.iter().chain(transition.next_state);
        episode.observations.extend(observations);
        for _ in 0..=connecting_steps {
            episode.actions.extend_from_slice(transition.action);
            episode.rewards.push(transition.reward);
        }
        origins.push(transition.origin);
    }

    /// Which steps the transitions were.
    #[cfg(test)]
    pub(crate) fn origins(&self) -> &[Origin] {
        &self.origins
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::Status;

    /// Transitions 1 → 2 with action 1 and 5 → 6 with action 0 are steps 0 and 2 of the episode.
    #[test]
    fn every_second_step_is_a_transition() {
        let origin = Origin {
            agent: 0,
            episode: 0,
            step: 0,
        };
        let mut pairs = TransitionPairs::new(&TaskSpec::new("test", Vec::new(), Vec::new()));
        for _ in 0..2 {
            pairs.clear();
            for (state, next_state, action) in [([1.0], [2.0], [1.0]), ([5.0], [6.0], [0.0])] {
                pairs.push(&Transition {
                    state: &state,
                    action: &action,
                    reward: 0.0,
                    next_state: &next_state,
                    status: Status::Running,
                    origin,
                });
            }
        }
        let episode = &pairs.episode;
        assert_eq!(
            (&episode.observations[..], episode.length()),
            (&[1.0, 2.0, 5.0, 6.0][..], 3)
        );
        assert_eq!((episode.actions[0], episode.actions[2]), (1.0, 0.0));
        assert_eq!(pairs.origins.len(), 2);
    }
}
