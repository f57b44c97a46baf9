//! Perturbations of transitions by a model: reward seeds z, and masks that say whether the model
//! learns from a transition.
//!
//! Both are deterministic functions of (run seed, model, acting agent, episode, step). They do not
//! depend on the contents of the replay buffer.

use rand::RngExt;

use crate::experience::replay::Origin;
use crate::seed::RewardSeeds;
use seedbed_env::random::{Purpose, transition_stream};

/// How one model perturbs transitions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Perturbation {
    pub(super) run_seed: u64,
    pub(super) model: u32,
    /// Distribution of z; none if rewards are not perturbed.
    pub(super) seed_distribution: Option<RewardSeeds>,
    /// Share of transitions that the model learns from.
    pub(super) mask: f32,
}

impl Perturbation {
    /// Reward seed z of a transition, in units of reward.
    pub(super) fn reward_seed(&self, origin: Origin) -> f32 {
        let Some(distribution) = self.seed_distribution else {
            return 0.0;
        };
        distribution.draw_one(&mut transition_stream(
            self.run_seed,
            Purpose::TransitionSeeds,
            self.model,
            stream_key(origin),
        )) as f32
    }

    /// 1 for a transition that the model learns from, otherwise 0.
    pub(super) fn weight(&self, origin: Origin) -> f32 {
        if self.mask >= 1.0 {
            return 1.0;
        }
        let mut random = transition_stream(
            self.run_seed,
            Purpose::TransitionMasks,
            self.model,
            stream_key(origin),
        );
        if random.random::<f32>() < self.mask {
            1.0
        } else {
            0.0
        }
    }
}

/// The numbers that identify the random streams of a transition.
fn stream_key(origin: Origin) -> (u32, u32, u32) {
    (origin.agent, origin.episode, origin.step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::input::numbers::ranged_number;

    fn perturbation(model: u32) -> Perturbation {
        Perturbation {
            run_seed: 7,
            model,
            seed_distribution: Some(RewardSeeds::Normal {
                sigma: ranged_number(0.1),
            }),
            mask: 0.5,
        }
    }

    fn origins() -> impl Iterator<Item = Origin> {
        (0..10).flat_map(|agent| {
            (0..20).flat_map(move |episode| {
                (0..20).map(move |step| Origin {
                    agent,
                    episode,
                    step,
                })
            })
        })
    }

    /// 4,000 draws of variance 0.01: the mean is within 4·0.1/√4000 = 0.0064 of 0, the standard
    /// deviation within 4·0.1/√8000 = 0.0045 of 0.1, and the share of transitions that the model
    /// learns from within 4·0.5/√4000 = 0.032 of ½.
    #[test]
    fn seeds_and_masks_have_the_expected_moments() {
        let count = 4000.0;
        let seeds: Vec<f32> = origins()
            .map(|origin| perturbation(0).reward_seed(origin))
            .collect();
        let mean = seeds.iter().sum::<f32>() / count;
        let deviation = (seeds.iter().map(|z| (z - mean).powi(2)).sum::<f32>() / count).sqrt();
        assert!(
            mean.abs() < 0.0064 && (deviation - 0.1).abs() < 0.0045,
            "{mean} {deviation}"
        );
        let share = origins()
            .map(|origin| perturbation(0).weight(origin))
            .sum::<f32>()
            / count;
        assert!((share - 0.5).abs() < 0.032, "{share}");
    }

    #[test]
    fn seeds_are_fixed_and_differ_between_models_and_transitions() {
        let reward_seed = |model, position: usize| {
            origins()
                .nth(position)
                .map(|origin| perturbation(model).reward_seed(origin))
        };
        assert_eq!(reward_seed(0, 17), reward_seed(0, 17));
        assert_ne!(reward_seed(0, 17), reward_seed(1, 17));
        assert_ne!(reward_seed(0, 17), reward_seed(0, 18));
    }

    #[test]
    fn without_seeds_and_masks_transitions_are_not_perturbed() {
        let plain = Perturbation {
            seed_distribution: None,
            mask: 1.0,
            ..perturbation(0)
        };
        assert!(
            origins().all(|origin| (plain.reward_seed(origin), plain.weight(origin)) == (0.0, 1.0))
        );
    }
}
