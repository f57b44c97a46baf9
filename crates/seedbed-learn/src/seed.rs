//! The agent seed ω_k = (φ̂_k, θ̂_k, `z_{k,1}` … `z_{k,T}`) of agent k (thesis §3.4), which is
//! drawn once and stays the same during training. It is a deterministic function of the run seed
//! and k.

use rand::RngExt;
use rand_distr::{Distribution, Exp1, StandardNormal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::nn::{Initial, Mlp};
use seedbed_env::input::numbers::NonNegative;
use seedbed_env::random::{Purpose, Stream, stream};

/// Distribution of the reward seeds `z_{k,j}`, with mean 0 and standard deviation σ in units of
/// reward. With σ = 0 rewards are not perturbed.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum SeedDistribution {
    /// Normal distribution 𝒩(0, σ²).
    Normal {
        /// Standard deviation σ.
        sigma: NonNegative,
    },
    /// Uniform distribution within ±√3 σ.
    Uniform {
        /// Standard deviation σ.
        sigma: NonNegative,
    },
    /// Laplace (two-sided exponential) distribution of scale σ/√2: mostly small numbers, sometimes
    /// large ones.
    Laplace {
        /// Standard deviation σ.
        sigma: NonNegative,
    },
    /// −σ or σ with equal probability.
    TwoPoint {
        /// Standard deviation σ.
        sigma: NonNegative,
    },
}

/// The agent seed of one agent.
#[derive(Clone, Debug, PartialEq)]
pub struct AgentSeed {
    /// Reward seeds: entry t is `z_{k,t+1}`, which agent k adds to the reward after step t of any
    /// agent's trajectory: `[T]`.
    pub reward_seeds: Vec<f32>,
    /// Initial parameters θ̂_k of the policy: `[P]`.
    pub policy_parameters: Vec<f32>,
    /// Initial parameters φ̂_k of the value function: `[P]`.
    pub value_parameters: Vec<f32>,
}

impl AgentSeed {
    /// The agent seed of `agent` in the run with `run_seed`, for episodes of at most `time_limit`
    /// steps.   `(policy, value)`: the shapes of the networks
    #[must_use]
    pub fn draw(
        run_seed: u64,
        agent: u32,
        distribution: SeedDistribution,
        initial: Initial,
        (policy, value): (&Mlp, &Mlp),
        time_limit: u32,
    ) -> Self {
        let mut random = stream(run_seed, Purpose::InitialParameters, agent, 0);
        let policy_parameters = policy.initial_parameters(initial, &mut random);
        let value_parameters = value.initial_parameters(initial, &mut random);
        Self {
            reward_seeds: distribution.draw(run_seed, agent, time_limit),
            policy_parameters,
            value_parameters,
        }
    }
}

impl SeedDistribution {
    /// Standard deviation σ.
    #[must_use]
    pub fn sigma(self) -> f64 {
        match self {
            Self::Normal { sigma }
            | Self::Uniform { sigma }
            | Self::Laplace { sigma }
            | Self::TwoPoint { sigma } => sigma.get(),
        }
    }

    /// The reward seeds of one agent: `[T]`. Reward seeds with different σ are multiples of the
    /// same draws, so that runs can be compared in pairs.
    fn draw(self, run_seed: u64, agent: u32, time_limit: u32) -> Vec<f32> {
        let mut random = stream(run_seed, Purpose::RewardSeeds, agent, 0);
        (0..time_limit)
            .map(|_| self.draw_one(&mut random) as f32)
            .collect()
    }

    /// Draws one reward seed.
    pub fn draw_one(self, random: &mut Stream) -> f64 {
        let sign = |random: &mut Stream| if random.random() { 1.0 } else { -1.0 };
        match self {
            Self::Normal { sigma } => {
                let unit: f64 = StandardNormal.sample(random);
                sigma.get() * unit
            }
            Self::Uniform { sigma } => {
                sigma.get() * 3.0_f64.sqrt() * random.random_range(-1.0..=1.0)
            }
            Self::Laplace { sigma } => {
                let size: f64 = Exp1.sample(random);
                sigma.get() * 0.5_f64.sqrt() * size * sign(random)
            }
            Self::TwoPoint { sigma } => sigma.get() * sign(random),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::input::numbers::ranged_number;

    fn agent_seed(run_seed: u64, agent: u32, sigma: f64) -> AgentSeed {
        let (policy, value) = (Mlp::new(&[4, 8, 2]), Mlp::new(&[4, 8, 1]));
        let distribution = SeedDistribution::Normal {
            sigma: NonNegative::try_from(sigma).unwrap(),
        };
        AgentSeed::draw(
            run_seed,
            agent,
            distribution,
            Initial::Random,
            (&policy, &value),
            2000,
        )
    }

    /// With 2,000 draws of standard deviation 0.1, the standard error of the mean is 0.0022. The
    /// standard error of the deviation is σ √((κ − 1)/4n) with kurtosis κ = 3, 1.8, 6, 1, so at
    /// most 0.0025 (Laplace). Tolerances are four standard errors.
    #[test]
    fn reward_seeds_have_the_given_mean_and_deviation() {
        let sigma = ranged_number(0.1);
        for distribution in [
            SeedDistribution::Normal { sigma },
            SeedDistribution::Uniform { sigma },
            SeedDistribution::Laplace { sigma },
            SeedDistribution::TwoPoint { sigma },
        ] {
            let draws = distribution.draw(7, 0, 2000);
            let mean = draws.iter().sum::<f32>() / 2000.0;
            let deviation = (draws.iter().map(|z| (z - mean).powi(2)).sum::<f32>() / 2000.0).sqrt();
            assert!(
                mean.abs() < 0.009 && (deviation - 0.1).abs() < 0.01,
                "{distribution:?}: {mean} {deviation}"
            );
        }
    }

    /// The largest of 2,000 draws, in units of σ, is 1 (two-point), just below √3 = 1.732
    /// (uniform), between 2.8 and 4.5 (normal), or above 4.5 (Laplace).
    #[test]
    fn largest_draws_match_the_distribution() {
        let sigma = ranged_number(1.0);
        let largest = |distribution: SeedDistribution| {
            distribution
                .draw(7, 0, 2000)
                .iter()
                .fold(0.0_f32, |largest, z| largest.max(z.abs()))
        };
        assert_eq!(largest(SeedDistribution::TwoPoint { sigma }), 1.0);
        assert!((1.7..=1.733).contains(&largest(SeedDistribution::Uniform { sigma })));
        assert!((2.8..4.5).contains(&largest(SeedDistribution::Normal { sigma })));
        assert!(largest(SeedDistribution::Laplace { sigma }) > 4.5);
    }

    #[test]
    fn agent_seeds_depend_on_agent_and_run_seed_only() {
        assert_eq!(agent_seed(7, 0, 0.1), agent_seed(7, 0, 0.1));
        assert_ne!(
            agent_seed(7, 0, 0.1).reward_seeds,
            agent_seed(7, 1, 0.1).reward_seeds
        );
        assert_ne!(
            agent_seed(7, 0, 0.1).policy_parameters,
            agent_seed(7, 1, 0.1).policy_parameters
        );
        assert_ne!(
            agent_seed(7, 0, 0.1).policy_parameters,
            agent_seed(8, 0, 0.1).policy_parameters
        );
        assert!(agent_seed(7, 0, 0.0).reward_seeds.iter().all(|&z| z == 0.0));
    }

    #[test]
    fn sigma_scales_the_same_draws() {
        let (small, large) = (agent_seed(7, 3, 0.1), agent_seed(7, 3, 10.0));
        assert_eq!(small.policy_parameters, large.policy_parameters);
        assert!(
            small
                .reward_seeds
                .iter()
                .zip(&large.reward_seeds)
                .all(|(a, b)| (100.0 * a - b).abs() < 1e-4 * (1.0 + b.abs()))
        );
    }
}
