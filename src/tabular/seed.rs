//! Agent seeds of tabular runs: random numbers, drawn once per agent, that turn any belief into one
//! MDP (arXiv 1802.01282 §3).
//!
//! The MDP is a deterministic function of (belief, agent seed). So an agent adapts to the
//! observations of all agents, keeps its plan as long as the belief does not change, and differs
//! from other agents. Over agent seeds, the MDP is distributed as the posterior.

use rand::RngExt;
use rand_distr::{Distribution, Gamma, StandardNormal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::belief::{Belief, Posterior, from_gaussian_scale};
use seedbed_env::tabular::{Mdp, Model, Prior};
use seedbed_random::{Purpose, Stream, stream};

/// How an agent seed samples a parameter from a Gaussian posterior.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum RewardSeeds {
    /// Standard-Gaussian: θ̂ = μ + σ z, with z ~ N(0, 1) drawn once.
    #[default]
    StandardGaussian,
    /// Martingalean-Gaussian: θ̂ is what the posterior mean would be if the prior mean were θ̂₀ ~
    /// N(μ₀, σ₀²) and the agent's own noise wₙ ~ N(0, s²) were added to each observation n.
    MartingaleGaussian,
}

/// Seed of one agent.
#[derive(Clone, Debug)]
pub struct AgentSeed {
    run_seed: u64,
    agent: u32,
    /// Standard normal number z of each parameter: `[parameters]`.
    normals: Vec<f64>,
    /// Sum of the first n noises wₙ / s of each parameter: `[parameters]`.
    noise_sums: Vec<StreamSum>,
    /// Gamma-distributed number for the prior of each outcome, plus the sum of its first n
    /// exponential numbers: `[outcomes]`; empty if transitions are deterministic.
    weights: Vec<StreamSum>,
}

/// Sum of the first `count` numbers of a random stream. Since `count` only grows, the sum is
/// extended without drawing the first numbers again.
#[derive(Clone, Copy, Debug, Default)]
struct StreamSum {
    count: u32,
    total: f64,
}

/// Position in an outcome's random stream at which its exponential numbers begin, in words of the
/// stream. The Gamma-distributed number before them takes an unknown number of words, but far fewer
/// than this.
const FIRST_EXPONENTIAL: u128 = 1 << 20;

impl AgentSeed {
    /// Draws the seed of an agent.
    #[must_use]
    pub fn new(model: &Model, run_seed: u64, agent: u32) -> Self {
        let random = stream(run_seed, Purpose::TabularSeeds, agent, 0);
        let is_deterministic = model.outcomes().len() == model.pair_count();
        Self {
            run_seed,
            agent,
            normals: StandardNormal
                .sample_iter(random)
                .take(model.parameters.len())
                .collect(),
            noise_sums: vec![StreamSum::default(); model.parameters.len()],
            weights: if is_deterministic {
                Vec::new()
            } else {
                prior_weights(model, run_seed, agent)
            },
        }
    }

    /// Sets `mdp` to the MDP that this agent seed samples from `belief`.
    pub fn sample(&mut self, model: &Model, belief: &Belief, rewards: RewardSeeds, mdp: &mut Mdp) {
        for parameter in 0..model.parameters.len() {
            let (prior, posterior) = (model.parameters[parameter], belief.posterior(parameter));
            mdp.values[parameter] = match (rewards, posterior) {
                (RewardSeeds::MartingaleGaussian, Posterior::Gaussian { mean, variance }) => {
                    from_gaussian_scale(
                        prior,
                        mean + variance
                            * self.martingale(parameter, prior, belief.parameter_count(parameter)),
                    )
                }
                _ => posterior.quantile(prior, self.normals[parameter]),
            };
        }
        if !self.weights.is_empty() {
            self.sample_transitions(model, belief, mdp);
        }
    }

    /// Distance of the martingale from the posterior mean after `count` observations, divided by
    /// the posterior variance: (θ̂₀ − μ₀) / σ₀² + Σ wₙ / s².
    fn martingale(&mut self, parameter: usize, prior: Prior, count: u32) -> f64 {
        let (Prior::Normal {
            deviation, noise, ..
        }
        | Prior::LogNormal {
            deviation, noise, ..
        }) = prior
        else {
            return 0.0;
        };
        let start = self.normals[parameter] / deviation;
        if count == 0 {
            // The sum is empty, and `noise` may be 0.
            return start;
        }
        let sum = &mut self.noise_sums[parameter];
        if sum.count < count {
            let mut random = stream(
                self.run_seed,
                Purpose::TabularNoise,
                self.agent,
                parameter as u32,
            );
            random.set_word_pos(u128::from(sum.count) * WORDS_PER_NORMAL);
            sum.extend(count, || box_muller(&mut random));
        }
        start + sum.total / noise
    }

    /// Exponential-Dirichlet: the weight of an outcome that was observed n times is a Gamma(α₀)
    /// number plus the sum of its first n exponential numbers, and p̂ is its share of the weights
    /// of its pair. A sum of n exponential numbers is Gamma(n), and shares of Gamma-distributed
    /// weights are Dirichlet-distributed, as the posterior is.
    fn sample_transitions(&mut self, model: &Model, belief: &Belief, mdp: &mut Mdp) {
        for pair in 0..model.pair_count() {
            for outcome in model.outcomes_of(pair) {
                mdp.probabilities[outcome] = self.weight(outcome, belief.outcome_count(outcome));
            }
        }
        normalize(model, mdp);
    }

    /// Weight of an outcome after `count` observations.
    fn weight(&mut self, outcome: usize, count: u32) -> f64 {
        let sum = &mut self.weights[outcome];
        if sum.count < count {
            let mut random = stream(
                self.run_seed,
                Purpose::TabularTransitions,
                self.agent,
                outcome as u32,
            );
            random.set_word_pos(FIRST_EXPONENTIAL + u128::from(sum.count) * WORDS_PER_UNIFORM);
            sum.extend(count, || -libm::log(uniform(&mut random)));
        }
        sum.total
    }
}

impl StreamSum {
    /// Adds the next numbers, until the sum has the first `count` numbers of the stream.
    fn extend(&mut self, count: u32, mut next: impl FnMut() -> f64) {
        for _ in self.count..count {
            self.total += next();
        }
        self.count = count;
    }
}

/// The agent's Gamma-distributed number for the prior of each outcome, with which the sum of its
/// weights begins: `[outcomes]`.
fn prior_weights(model: &Model, run_seed: u64, agent: u32) -> Vec<StreamSum> {
    let gamma = gamma_distribution(model.outcome_weight);
    let weight = |outcome| {
        gamma.sample(&mut stream(
            run_seed,
            Purpose::TabularTransitions,
            agent,
            outcome as u32,
        ))
    };
    (0..model.outcomes().len())
        .map(|outcome| StreamSum {
            count: 0,
            total: weight(outcome),
        })
        .collect()
}

fn gamma_distribution(shape: f64) -> Gamma<f64> {
    Gamma::new(shape, 1.0).expect("the shape is above 0")
}

/// Sets `mdp` to an independent sample of the belief.
pub fn sample_posterior(model: &Model, belief: &Belief, random: &mut Stream, mdp: &mut Mdp) {
    for parameter in 0..model.parameters.len() {
        let normal = StandardNormal.sample(random);
        mdp.values[parameter] = belief
            .posterior(parameter)
            .quantile(model.parameters[parameter], normal);
    }
    if model.outcomes().len() > model.pair_count() {
        for outcome in 0..model.outcomes().len() {
            mdp.probabilities[outcome] =
                gamma_distribution(model.outcome_weight + f64::from(belief.outcome_count(outcome)))
                    .sample(random);
        }
        normalize(model, mdp);
    }
}

/// Divides the weights of each pair's outcomes by their sum. If all weights of a pair are 0, its
/// outcomes get equal probabilities.
fn normalize(model: &Model, mdp: &mut Mdp) {
    for pair in 0..model.pair_count() {
        let weights = &mut mdp.probabilities[model.outcomes_of(pair)];
        let (total, equal) = (weights.iter().sum::<f64>(), 1.0 / weights.len() as f64);
        for weight in weights {
            *weight = if total > 0.0 { *weight / total } else { equal };
        }
    }
}

/// Number of words of a stream that [`uniform`] takes.
const WORDS_PER_UNIFORM: u128 = 2;

/// Number of words of a stream that [`box_muller`] takes.
const WORDS_PER_NORMAL: u128 = 2 * WORDS_PER_UNIFORM;

/// A number above 0 and at most 1.
fn uniform(random: &mut Stream) -> f64 {
    1.0 - random.random::<f64>()
}

/// A standard normal number. Unlike faster methods, Box and Muller's takes the same number of words
/// each time, so that the position of the n-th number in a stream is known.
fn box_muller(random: &mut Stream) -> f64 {
    let radius = (-2.0 * libm::log(uniform(random))).sqrt();
    radius * libm::cos(std::f64::consts::TAU * uniform(random))
}
