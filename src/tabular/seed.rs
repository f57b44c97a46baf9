//! An agent's seed: numbers drawn once, by which it makes of any belief one MDP (arXiv 1802.01282
//! §3).
//!
//! The MDP is a deterministic function of (belief, seed). So an agent adapts to what anybody sees,
//! keeps its intent while nothing is seen, and differs from others; over seeds, the MDP is
//! distributed as the posterior.

use rand::RngExt;
use rand_distr::{Distribution, Gamma, StandardNormal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::belief::{Belief, Posterior, from_scale};
use seedbed_env::random::{Purpose, Stream, stream};
use seedbed_env::tabular::{Mdp, Model, Prior};

/// How seeds turn a Gaussian belief into one number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum RewardSeeds {
    /// Standard-Gaussian: θ̂ = μ + σ z, with z ~ N(0, 1) drawn once.
    #[default]
    StandardGaussian,
    /// Martingalean-Gaussian: θ̂ is what the belief's mean would be if the prior mean were θ̂₀ ~
    /// N(μ₀, σ₀²) and each observation n bore the agent's own noise wₙ ~ N(0, s²).
    MartingaleGaussian,
}

/// One agent's seed.
#[derive(Clone, Debug)]
pub struct Seed {
    run: u64,
    agent: u32,
    /// z of each parameter: `[parameters]`.
    normals: Vec<f64>,
    /// Σ of the first n own noises of each parameter, in units of s: `[parameters]`.
    walks: Vec<Sum>,
    /// Σ of the first n own exponentials of each outcome, and what stands for its prior weight:
    /// `[outcomes]`.
    weights: Vec<Sum>,
}

/// A sum over the first `count` numbers of a stream.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    count: u32,
    total: f64,
}

/// Where in an outcome's stream its exponentials begin, in words; before that stands what its prior
/// weight draws.
const FIRST_EXPONENTIAL: u128 = 1 << 20;

impl Seed {
    /// The seed of an agent.
    #[must_use]
    pub fn new(model: &Model, run_seed: u64, agent: u32) -> Self {
        let random = stream(run_seed, Purpose::TabularSeeds, agent, 0);
        let certain = model.outcomes().len() == model.pair_count();
        Self {
            run: run_seed,
            agent,
            normals: StandardNormal
                .sample_iter(random)
                .take(model.parameters.len())
                .collect(),
            walks: vec![Sum::default(); model.parameters.len()],
            weights: if certain {
                Vec::new()
            } else {
                prior_weights(model, run_seed, agent)
            },
        }
    }

    /// The agent's MDP where its team believes `belief`.
    pub fn sample(&mut self, model: &Model, belief: &Belief, rewards: RewardSeeds, mdp: &mut Mdp) {
        for parameter in 0..model.parameters.len() {
            let (prior, posterior) = (model.parameters[parameter], belief.posterior(parameter));
            mdp.values[parameter] = match (rewards, posterior) {
                (RewardSeeds::MartingaleGaussian, Posterior::Gaussian { mean, variance }) => {
                    from_scale(
                        prior,
                        mean + variance * self.pull(parameter, prior, belief.sightings(parameter)),
                    )
                }
                _ => posterior.quantile(prior, self.normals[parameter]),
            };
        }
        if !self.weights.is_empty() {
            self.sample_transitions(model, belief, mdp);
        }
    }

    /// How far the seed pulls a martingale from the posterior mean, in units of its variance: (θ̂₀
    /// − μ₀) / σ₀² + Σ wₙ / s².
    fn pull(&mut self, parameter: usize, prior: Prior, sightings: u32) -> f64 {
        let (Prior::Normal {
            deviation, noise, ..
        }
        | Prior::LogNormal {
            deviation, noise, ..
        }) = prior
        else {
            return 0.0;
        };
        let (start, walk) = (
            self.normals[parameter] / deviation,
            &mut self.walks[parameter],
        );
        if sightings == 0 {
            return start;
        }
        if walk.count < sightings {
            let mut random = stream(
                self.run,
                Purpose::TabularNoise,
                self.agent,
                parameter as u32,
            );
            random.set_word_pos(u128::from(walk.count) * 4);
            walk.extend(sightings, || box_muller(&mut random));
        }
        start + walk.total / noise
    }

    /// Exponential-Dirichlet: p̂ of an outcome seen n times is the share of its Gamma(α₀) + Σ of
    /// its first n exponentials. A sum of n exponentials is Gamma(n), and shares of Gammas are
    /// Dirichlet, as the posterior is.
    fn sample_transitions(&mut self, model: &Model, belief: &Belief, mdp: &mut Mdp) {
        for pair in 0..model.pair_count() {
            let outcomes = model.outcomes_of(pair);
            outcomes
                .clone()
                .for_each(|outcome| self.weigh(outcome, belief.count(outcome)));
            let weights = self.weights[outcomes.clone()].iter().map(|sum| sum.total);
            mdp.probabilities[outcomes]
                .iter_mut()
                .zip(weights)
                .for_each(|(probability, weight)| *probability = weight);
        }
        normalise(model, mdp);
    }

    fn weigh(&mut self, outcome: usize, count: u32) {
        let sum = &mut self.weights[outcome];
        if sum.count < count {
            let mut random = stream(
                self.run,
                Purpose::TabularTransitions,
                self.agent,
                outcome as u32,
            );
            random.set_word_pos(FIRST_EXPONENTIAL + u128::from(sum.count) * 2);
            sum.extend(count, || -libm::log(uniform(&mut random)));
        }
    }
}

impl Sum {
    /// Goes on to the first `count` numbers.
    fn extend(&mut self, count: u32, mut next: impl FnMut() -> f64) {
        (self.count..count).for_each(|_| self.total += next());
        self.count = count;
    }
}

fn prior_weights(model: &Model, run_seed: u64, agent: u32) -> Vec<Sum> {
    let gamma = gamma(model.outcome_weight);
    let weight = |outcome| {
        gamma.sample(&mut stream(
            run_seed,
            Purpose::TabularTransitions,
            agent,
            outcome as u32,
        ))
    };
    (0..model.outcomes().len())
        .map(|outcome| Sum {
            count: 0,
            total: weight(outcome),
        })
        .collect()
}

fn gamma(shape: f64) -> Gamma<f64> {
    Gamma::new(shape, 1.0).expect("weights are above 0")
}

/// An MDP drawn from the belief, independent of all that was drawn before.
pub fn draw_posterior(model: &Model, belief: &Belief, random: &mut Stream, mdp: &mut Mdp) {
    for parameter in 0..model.parameters.len() {
        let normal = StandardNormal.sample(random);
        mdp.values[parameter] = belief
            .posterior(parameter)
            .quantile(model.parameters[parameter], normal);
    }
    if model.outcomes().len() > model.pair_count() {
        for outcome in 0..model.outcomes().len() {
            mdp.probabilities[outcome] =
                gamma(model.outcome_weight + f64::from(belief.count(outcome))).sample(random);
        }
        normalise(model, mdp);
    }
}

/// Makes of weights probabilities, pair by pair; equal ones where all weights are 0.
fn normalise(model: &Model, mdp: &mut Mdp) {
    for pair in 0..model.pair_count() {
        let weights = &mut mdp.probabilities[model.outcomes_of(pair)];
        let (total, equal) = (weights.iter().sum::<f64>(), 1.0 / weights.len() as f64);
        for weight in weights {
            *weight = if total > 0.0 { *weight / total } else { equal };
        }
    }
}

/// Above 0 and at most 1; takes two words of the stream.
fn uniform(random: &mut Stream) -> f64 {
    1.0 - random.random::<f64>()
}

/// A standard normal number of exactly four words, so that the n-th of a stream can be found.
fn box_muller(random: &mut Stream) -> f64 {
    let radius = (-2.0 * libm::log(uniform(random))).sqrt();
    radius * libm::cos(std::f64::consts::TAU * uniform(random))
}
