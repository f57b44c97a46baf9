//! Perturbations of transitions by a model: reward seeds z, masks that say whether the model learns
//! from a transition, and random vectors z that are multiplied by an index.
//!
//! All are deterministic functions of (run seed, model, acting agent, episode, step). They do not
//! depend on the contents of the replay buffer.

use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

use super::index;
use crate::experience::replay::Origin;
use crate::seed::RewardSeeds;
use seedbed_random::{Purpose, transition_stream};

/// How one model perturbs transitions.
#[derive(Clone, Copy, Debug)]
pub(in crate::algorithms) struct Perturbation {
    pub(in crate::algorithms) run_seed: u64,
    pub(in crate::algorithms) model: u32,
    /// Distribution of z; none if rewards are not perturbed.
    pub(in crate::algorithms) seed_distribution: Option<RewardSeeds>,
    /// Share of transitions that the model learns from.
    pub(in crate::algorithms) mask: f32,
}

impl Perturbation {
    /// Reward seed z of a transition, in units of reward.
    pub(in crate::algorithms) fn reward_seed(&self, origin: Origin) -> f32 {
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

    /// Appends the random vector z of a transition, drawn uniformly from the sphere of radius √M: zᵀξ
    /// has mean 0 and standard deviation 1 for every ξ of norm 1.   `M` numbers
    pub(super) fn append_noise(&self, origin: Origin, dimension: usize, noise: &mut Vec<f32>) {
        let start = noise.len();
        for block in 0..dimension.div_ceil(NORMALS_PER_BLOCK) {
            let mut random = transition_stream(
                self.run_seed,
                Purpose::TransitionNoise,
                block as u32,
                stream_key(origin),
            );
            let count = (dimension - block * NORMALS_PER_BLOCK).min(NORMALS_PER_BLOCK);
            noise.extend((0..count).map(|_| -> f32 { StandardNormal.sample(&mut random) }));
        }
        index::normalize(&mut noise[start..], (dimension as f32).sqrt());
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

/// Number of normal numbers that are drawn from the stream of one step. Each needs two words, rarely
/// more, and the stream of the next step begins sixteen words later.
const NORMALS_PER_BLOCK: usize = 4;

/// The numbers that identify the random streams of a transition.
fn stream_key(origin: Origin) -> (u32, u32, u32) {
    (origin.agent, origin.episode, origin.step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_input::numbers::ranged_number;

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

    /// 4,000 vectors of norm √6: means are within 4/√4000 = 0.063 of 0, and so are mean products of
    /// different coordinates, also of those of consecutive steps; mean squares are near 1, with
    /// variance below 2 each: within 4 √(2/4000) = 0.09.
    #[test]
    fn noise_has_independent_coordinates() {
        let vectors: Vec<Vec<f32>> = origins()
            .map(|origin| {
                let mut noise = vec![7.0];
                perturbation(0).append_noise(origin, 6, &mut noise);
                noise[1..].to_vec()
            })
            .collect();
        let mean_of = |product: &dyn Fn(&[f32], &[f32]) -> f32| {
            let pairs = vectors.iter().zip(vectors.iter().cycle().skip(1));
            pairs.map(|(a, b)| product(a, b)).sum::<f32>() / 4000.0
        };
        for vector in &vectors {
            assert_eq!(vector.len(), 6);
            let squares: f32 = vector.iter().map(|x| x * x).sum();
            assert!((squares - 6.0).abs() < 1e-4, "{squares}");
        }
        for i in 0..6 {
            assert!(mean_of(&|a, _| a[i]).abs() < 0.063, "{i}");
            for j in 0..6 {
                let expected = if i == j { 1.0 } else { 0.0 };
                let product = mean_of(&|a, _| a[i] * a[j]);
                assert!((product - expected).abs() < 0.09, "{i} {j}: {product}");
                let next = mean_of(&|a, b| a[i] * b[j]);
                assert!(next.abs() < 0.063, "{i} {j}: {next}");
            }
        }
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
