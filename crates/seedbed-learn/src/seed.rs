//! The agent seed ω_k = (φ̂_k, θ̂_k, `z_{k,1}` … `z_{k,T}`) of agent k (thesis §3.4), which is
//! drawn once and stays the same during training. It is a deterministic function of the run seed
//! and k.
//!
//! Alternatives to the reward seeds z are [`RewardSeeds::Network`] and [`RewardSeeds::Potential`],
//! which depend on states, and as a control [`RewardSeeds::Fresh`], which is not fixed.

mod state_function;

use rand::RngExt;
use rand_distr::{Distribution, Exp1, StandardNormal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub(crate) use self::state_function::StateFunction;
use crate::experience::Episode;
use crate::nn::{Initial, Mlp, Tensor};
use seedbed_env::TaskSpec;
use seedbed_input::numbers::NonNegative;
use seedbed_random::{Purpose, Stream, stream, transition_stream};

/// What each agent adds to rewards, with mean 0 and standard deviation σ in units of reward. With
/// σ = 0 rewards are not perturbed.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum RewardSeeds {
    /// Reward seeds from the normal distribution 𝒩(0, σ²).
    Normal {
        /// Standard deviation σ.
        sigma: NonNegative,
    },
    /// Reward seeds from the uniform distribution within ±√3 σ.
    Uniform {
        /// Standard deviation σ.
        sigma: NonNegative,
    },
    /// Reward seeds from the Laplace (two-sided exponential) distribution of scale σ/√2: mostly
    /// small numbers, sometimes large ones.
    Laplace {
        /// Standard deviation σ.
        sigma: NonNegative,
    },
    /// Reward seeds that are −σ or σ with equal probability.
    TwoPoint {
        /// Standard deviation σ.
        sigma: NonNegative,
    },
    /// No seeds but noise from 𝒩(0, σ²), drawn again for each trajectory: a control that is as
    /// noisy as `Normal`, without commitment.
    Fresh {
        /// Standard deviation σ.
        sigma: NonNegative,
    },
    /// `f_k(sₜ)`: a fixed random function of the state before the action, one per agent.
    Network {
        /// Standard deviation σ over the display ranges of the observations.
        sigma: NonNegative,
    },
    /// γ `Φ_k(sₜ₊₁)` − `Φ_k(sₜ)` with a fixed random potential `Φ_k` per agent, which is 0 after the
    /// end of an episode. Optimal policies stay optimal (Ng, Harada & Russell 1999).
    Potential {
        /// Standard deviation σ of `Φ_k` over the display ranges of the observations.
        sigma: NonNegative,
    },
}

/// Which initial parameters are the same for all agents of a team.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum SameInitial {
    /// None: each agent has its own θ̂ and φ̂.
    #[default]
    Off,
    /// θ̂, the initial parameters of the policy.
    Policy,
    /// φ̂, the initial parameters of the value function.
    Value,
    /// Both.
    Both,
}

impl SameInitial {
    /// Whether all agents have the same initial parameters of the policy.
    #[must_use]
    pub fn includes_policy(self) -> bool {
        matches!(self, Self::Policy | Self::Both)
    }

    /// Whether all agents have the same initial parameters of the value function.
    #[must_use]
    pub fn includes_value(self) -> bool {
        matches!(self, Self::Value | Self::Both)
    }
}

/// What one agent adds to rewards.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum RewardPerturbation {
    /// Reward seeds: entry t is `z_{k,t+1}`, which agent k adds to the reward after step t of any
    /// agent's trajectory: `[T]`.
    Steps(Vec<f32>),
    /// Noise of standard deviation σ, drawn again for each trajectory.
    Fresh {
        run_seed: u64,
        agent: u32,
        sigma: f32,
    },
    /// A function of the state before the action.
    Network(StateFunction),
    /// The difference of a potential between the states after and before the action.
    Potential(StateFunction),
}

/// Initial parameters of an agent's networks.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct InitialParameters {
    /// θ̂_k of the policy: `[P]`.
    pub(crate) policy: Vec<f32>,
    /// φ̂_k of the value function: `[P]`.
    pub(crate) value: Vec<f32>,
}

impl InitialParameters {
    /// The initial parameters of `agent` in the run with `run_seed`.   `(policy, value)`: the shapes
    /// of the networks
    pub(crate) fn draw(
        (run_seed, agent): (u64, u32),
        initial: Initial,
        same: SameInitial,
        (policy, value): (&Mlp, &Mlp),
    ) -> Self {
        let draw = |agent| {
            let mut random = stream(run_seed, Purpose::InitialParameters, agent, 0);
            Self {
                policy: policy.initial_parameters(initial, &mut random),
                value: value.initial_parameters(initial, &mut random),
            }
        };
        let (own, first) = (draw(agent), draw(0));
        Self {
            policy: if same.includes_policy() {
                first.policy
            } else {
                own.policy
            },
            value: if same.includes_value() {
                first.value
            } else {
                own.value
            },
        }
    }
}

impl RewardSeeds {
    /// Standard deviation σ.
    #[must_use]
    pub fn sigma(self) -> f64 {
        match self {
            Self::Normal { sigma }
            | Self::Uniform { sigma }
            | Self::Laplace { sigma }
            | Self::TwoPoint { sigma }
            | Self::Fresh { sigma }
            | Self::Network { sigma }
            | Self::Potential { sigma } => sigma.get(),
        }
    }

    /// Whether seeds are numbers that depend neither on states nor on anything that is drawn later.
    #[must_use]
    pub fn are_numbers(self) -> bool {
        !matches!(
            self,
            Self::Fresh { .. } | Self::Network { .. } | Self::Potential { .. }
        )
    }

    /// What `agent` adds to rewards in the run with `run_seed`.   `hidden`: units of the hidden
    /// layers of functions of the state
    ///
    /// Perturbations with different σ are multiples of the same draws, so that runs can be compared
    /// in pairs.
    pub(crate) fn perturbation(
        self,
        (run_seed, agent): (u64, u32),
        spec: &TaskSpec,
        hidden: &[usize],
    ) -> RewardPerturbation {
        let mut random = stream(run_seed, Purpose::RewardSeeds, agent, 0);
        let sigma = self.sigma() as f32;
        match self {
            Self::Fresh { .. } => RewardPerturbation::Fresh {
                run_seed,
                agent,
                sigma,
            },
            Self::Network { .. } => {
                RewardPerturbation::Network(StateFunction::draw(spec, hidden, sigma, &mut random))
            }
            Self::Potential { .. } => {
                RewardPerturbation::Potential(StateFunction::draw(spec, hidden, sigma, &mut random))
            }
            _ => RewardPerturbation::Steps(
                (0..spec.time_limit)
                    .map(|_| self.draw_one(&mut random) as f32)
                    .collect(),
            ),
        }
    }

    /// Draws one number.
    ///
    /// # Panics
    /// If seeds [are not numbers](Self::are_numbers).
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
            Self::Fresh { .. } | Self::Network { .. } | Self::Potential { .. } => {
                unreachable!("checked: these seeds are not numbers")
            }
        }
    }
}

impl RewardPerturbation {
    /// Its fixed numbers; none of noise.
    pub(crate) fn tensors(&self) -> Vec<Tensor<'_>> {
        match self {
            Self::Steps(seeds) => vec![Tensor::list("reward_seeds", seeds.as_slice())],
            Self::Fresh { .. } => Vec::new(),
            Self::Network(function) | Self::Potential(function) => function.tensors(),
        }
    }

    /// Adds the perturbation to the rewards of a trajectory.   `ends`: whether the potential is 0
    /// after the last step, `rewards: [T]`
    pub(crate) fn add_to(
        &mut self,
        episode: &Episode,
        discount: f32,
        ends: bool,
        rewards: &mut [f32],
    ) {
        match self {
            Self::Steps(seeds) => add(rewards, seeds),
            Self::Fresh {
                run_seed,
                agent,
                sigma,
            } => {
                let key = (episode.agent, episode.episode, 0);
                let purpose = Purpose::FreshRewardNoise;
                let mut random = transition_stream(*run_seed, purpose, *agent, key);
                for reward in rewards {
                    let unit: f32 = StandardNormal.sample(&mut random);
                    *reward += *sigma * unit;
                }
            }
            Self::Network(function) => add(rewards, function.values(episode.states())),
            Self::Potential(function) => {
                let potentials = function.values(&episode.observations);
                for (step, reward) in rewards.iter_mut().enumerate() {
                    let is_end = ends && step + 1 == episode.length();
                    let next = if is_end { 0.0 } else { potentials[step + 1] };
                    *reward += discount * next - potentials[step];
                }
            }
        }
    }
}

fn add(rewards: &mut [f32], perturbations: &[f32]) {
    for (reward, perturbation) in rewards.iter_mut().zip(perturbations) {
        *reward += perturbation;
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;
    use seedbed_env::{Quantity, Status};
    use seedbed_input::numbers::ranged_number;

    /// A task with one observation between −1 and 1.
    pub(super) fn spec(time_limit: u32) -> TaskSpec {
        let observation = Quantity {
            name: "x".to_owned(),
            unit: String::new(),
            range: [-1.0, 1.0],
        };
        TaskSpec {
            observations: vec![observation],
            time_limit,
            ..TaskSpec::new("test", Vec::new(), Vec::new())
        }
    }

    fn reward_seeds(seeds: RewardSeeds, run_seed: u64, agent: u32) -> Vec<f32> {
        match seeds.perturbation((run_seed, agent), &spec(2000), &[8]) {
            RewardPerturbation::Steps(seeds) => seeds,
            other => panic!("{other:?}"),
        }
    }

    fn normal(sigma: f64) -> RewardSeeds {
        RewardSeeds::Normal {
            sigma: NonNegative::try_from(sigma).unwrap(),
        }
    }

    fn initial_parameters(run_seed: u64, agent: u32, same: SameInitial) -> InitialParameters {
        let (policy, value) = (Mlp::new(&[4, 8, 2]), Mlp::new(&[4, 8, 1]));
        InitialParameters::draw((run_seed, agent), Initial::Random, same, (&policy, &value))
    }

    /// With 2,000 draws of standard deviation 0.1, the standard error of the mean is 0.0022. The
    /// standard error of the deviation is σ √((κ − 1)/4n) with kurtosis κ = 3, 1.8, 6, 1, so at
    /// most 0.0025 (Laplace). Tolerances are four standard errors.
    #[test]
    fn reward_seeds_have_the_given_mean_and_deviation() {
        let sigma = ranged_number(0.1);
        for seeds in [
            RewardSeeds::Normal { sigma },
            RewardSeeds::Uniform { sigma },
            RewardSeeds::Laplace { sigma },
            RewardSeeds::TwoPoint { sigma },
        ] {
            let draws = reward_seeds(seeds, 7, 0);
            let mean = draws.iter().sum::<f32>() / 2000.0;
            let deviation = (draws.iter().map(|z| (z - mean).powi(2)).sum::<f32>() / 2000.0).sqrt();
            assert!(
                mean.abs() < 0.009 && (deviation - 0.1).abs() < 0.01,
                "{seeds:?}: {mean} {deviation}"
            );
        }
    }

    /// The largest of 2,000 draws, in units of σ, is 1 (two-point), just below √3 = 1.732
    /// (uniform), between 2.8 and 4.5 (normal), or above 4.5 (Laplace).
    #[test]
    fn largest_draws_match_the_distribution() {
        let sigma = ranged_number(1.0);
        let largest = |seeds: RewardSeeds| {
            reward_seeds(seeds, 7, 0)
                .iter()
                .fold(0.0_f32, |largest, z| largest.max(z.abs()))
        };
        assert_eq!(largest(RewardSeeds::TwoPoint { sigma }), 1.0);
        assert!((1.7..=1.733).contains(&largest(RewardSeeds::Uniform { sigma })));
        assert!((2.8..4.5).contains(&largest(RewardSeeds::Normal { sigma })));
        assert!(largest(RewardSeeds::Laplace { sigma }) > 4.5);
    }

    #[test]
    fn agent_seeds_depend_on_agent_and_run_seed_only() {
        let seeds = |run_seed, agent| reward_seeds(normal(0.1), run_seed, agent);
        assert_eq!(seeds(7, 0), seeds(7, 0));
        assert_ne!(seeds(7, 0), seeds(7, 1));
        assert_ne!(seeds(7, 0), seeds(8, 0));
        assert!(reward_seeds(normal(0.0), 7, 0).iter().all(|&z| z == 0.0));
        let initial = |run_seed, agent| initial_parameters(run_seed, agent, SameInitial::Off);
        assert_eq!(initial(7, 0), initial(7, 0));
        assert_ne!(initial(7, 0).policy, initial(7, 1).policy);
        assert_ne!(initial(7, 0).policy, initial(8, 0).policy);
    }

    #[test]
    fn sigma_scales_the_same_draws() {
        let (small, large) = (
            reward_seeds(normal(0.1), 7, 3),
            reward_seeds(normal(10.0), 7, 3),
        );
        assert!(
            small
                .iter()
                .zip(&large)
                .all(|(a, b)| (100.0 * a - b).abs() < 1e-4 * (1.0 + b.abs()))
        );
    }

    #[test]
    fn same_initial_parameters_are_those_of_the_first_agent() {
        let first = initial_parameters(7, 0, SameInitial::Off);
        let own = initial_parameters(7, 3, SameInitial::Off);
        for (same, policy, value) in [
            (SameInitial::Policy, &first.policy, &own.value),
            (SameInitial::Value, &own.policy, &first.value),
            (SameInitial::Both, &first.policy, &first.value),
        ] {
            let drawn = initial_parameters(7, 3, same);
            assert_eq!((&drawn.policy, &drawn.value), (policy, value), "{same:?}");
        }
    }

    /// An episode of agent 1 with one observation per entry of `states`.
    fn episode(number: u32, states: &[f32]) -> Episode {
        let mut episode = Episode::start(1, number, 0, &spec(20));
        episode.observations = states.to_vec();
        episode.rewards = vec![0.0; states.len() - 1];
        episode.outcome = Status::Truncated;
        episode
    }

    /// 𝒩(0, 4) drawn 400 times: the mean is within 4·2/√400 = 0.4 of 0, the deviation within
    /// 4·2/√800 = 0.29 of 2.
    #[test]
    fn fresh_noise_differs_between_trajectories() {
        let sigma = ranged_number(2.0);
        let mut noise = RewardSeeds::Fresh { sigma }.perturbation((7, 0), &spec(400), &[8]);
        let mut draw = |number| {
            let mut rewards = vec![0.0; 400];
            noise.add_to(&episode(number, &[0.0; 401]), 0.9, false, &mut rewards);
            rewards
        };
        let (first, again, second) = (draw(0), draw(0), draw(1));
        assert_eq!(first, again);
        assert_ne!(first, second);
        let mean = first.iter().sum::<f32>() / 400.0;
        let deviation = (first.iter().map(|z| (z - mean).powi(2)).sum::<f32>() / 400.0).sqrt();
        assert!(mean.abs() < 0.4 && (deviation - 2.0).abs() < 0.29);
    }

    #[test]
    fn network_seeds_depend_on_the_state_before_the_action() {
        let sigma = ranged_number(0.5);
        let mut network = RewardSeeds::Network { sigma }.perturbation((7, 0), &spec(3), &[8]);
        let mut rewards = vec![1.0; 3];
        network.add_to(&episode(0, &[0.3, -0.2, 0.3, 0.9]), 0.9, true, &mut rewards);
        assert_eq!(rewards[0], rewards[2]);
        assert_ne!(rewards[0], rewards[1]);
    }

    proptest! {
        /// The discounted sum of γ Φ(s′) − Φ(s) telescopes: it is γᵀ Φ(`s_T`) − Φ(s₀), or −Φ(s₀) if
        /// the episode ends. Hence potentials favor no way from s₀ over another one.
        #[test]
        fn potential_seeds_telescope(
            states in prop::collection::vec(-1.0_f32..1.0, 2..20), ends in any::<bool>(),
        ) {
            let discount = 0.9_f32;
            let sigma = ranged_number(1.0);
            let mut perturbation =
                RewardSeeds::Potential { sigma }.perturbation((7, 0), &spec(20), &[8]);
            let mut rewards = vec![0.0; states.len() - 1];
            perturbation.add_to(&episode(0, &states), discount, ends, &mut rewards);
            let RewardPerturbation::Potential(mut potential) = perturbation else { panic!() };
            let potentials = potential.values(&states);
            let sum: f32 =
                rewards.iter().enumerate().map(|(t, reward)| discount.powi(t as i32) * reward).sum();
            let last = if ends { 0.0 } else { potentials[states.len() - 1] };
            let expected = discount.powi(states.len() as i32 - 1) * last - potentials[0];
            prop_assert!((sum - expected).abs() < 1e-4, "{} {}", sum, expected);
        }
    }
}
