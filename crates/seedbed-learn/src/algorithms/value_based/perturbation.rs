//! What a model makes of a transition: its reward seed z, and whether the model learns from it at
//! all.
//!
//! Both are deterministic functions of (run seed, model, source agent, episode, step), whatever the
//! replay still holds and wherever.

use rand::RngExt;

use crate::experience::replay::Origin;
use crate::seed::SeedDistribution;
use seedbed_env::random::{Purpose, transition_stream};

/// One model's way with transitions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Perturbation {
    pub(super) run_seed: u64,
    pub(super) model: u32,
    /// What z is drawn from; none where rewards stay as they are.
    pub(super) seeds: Option<SeedDistribution>,
    /// Share of transitions that the model learns from.
    pub(super) mask: f32,
}

impl Perturbation {
    /// z of a transition, in units of reward.
    pub(super) fn seed(&self, origin: Origin) -> f32 {
        let Some(seeds) = self.seeds else { return 0.0 };
        seeds.draw_one(&mut transition_stream(
            self.run_seed,
            Purpose::TransitionSeeds,
            self.model,
            name(origin),
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
            name(origin),
        );
        if random.random::<f32>() < self.mask {
            1.0
        } else {
            0.0
        }
    }
}

fn name(origin: Origin) -> (u32, u32, u32) {
    (origin.agent, origin.episode, origin.step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::input::numbers::known;

    fn perturbation(model: u32) -> Perturbation {
        Perturbation {
            run_seed: 7,
            model,
            seeds: Some(SeedDistribution::Normal { sigma: known(0.1) }),
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

    /// 4,000 draws of variance 0.01: mean within 4·0.1/√4000 = 0.0064 of 0, deviation within
    /// 4·0.1/√8000 = 0.0045 of 0.1; half are learned from, within 4·0.5/√4000 = 0.032.
    #[test]
    fn seeds_and_masks_have_their_moments() {
        let count = 4000.0;
        let seeds: Vec<f32> = origins()
            .map(|origin| perturbation(0).seed(origin))
            .collect();
        let mean = seeds.iter().sum::<f32>() / count;
        let deviation = (seeds.iter().map(|z| (z - mean).powi(2)).sum::<f32>() / count).sqrt();
        assert!(
            mean.abs() < 0.0064 && (deviation - 0.1).abs() < 0.0045,
            "{mean} {deviation}"
        );
        let learned = origins()
            .map(|origin| perturbation(0).weight(origin))
            .sum::<f32>()
            / count;
        assert!((learned - 0.5).abs() < 0.032, "{learned}");
    }

    #[test]
    fn seeds_stay_and_belong_to_one_model() {
        let of = |model, place: usize| {
            origins()
                .nth(place)
                .map(|origin| perturbation(model).seed(origin))
        };
        assert_eq!(of(0, 17), of(0, 17));
        assert_ne!(of(0, 17), of(1, 17));
        assert_ne!(of(0, 17), of(0, 18));
    }

    #[test]
    fn without_seeds_or_masks_nothing_changes() {
        let plain = Perturbation {
            seeds: None,
            mask: 1.0,
            ..perturbation(0)
        };
        assert!(origins().all(|origin| (plain.seed(origin), plain.weight(origin)) == (0.0, 1.0)));
    }
}
