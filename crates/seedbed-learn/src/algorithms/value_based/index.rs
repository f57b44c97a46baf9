//! Models whose values depend on an index ξ: each agent acts by the one model with its own ξ.
//!
//! HyperAgent (Li, Xu, Han & Luo 2024) draws indices ξ from a fixed distribution. The last layer of
//! the network depends linearly on ξ, so Q(s, a; ξ) is a mean plus one deviation per coordinate of
//! ξ: see [`rl::index_conditioned`](crate::rl::index_conditioned). A fixed random network whose mean
//! is 0 is added as a prior. The cost of learning does not depend on the number of agents.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::minibatch::Minibatch;
use crate::nn::Mlp;
use crate::rl::index_conditioned::{self, Indices};
use crate::rl::q_learning;
use seedbed_random::{Purpose, Stream, stream};

/// How values depend on an index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct IndexSettings {
    /// Number of coordinates M.
    pub(super) dimension: usize,
    /// Number of indices J that are drawn for each transition of a minibatch.
    pub(super) samples: usize,
    /// Standard deviation σ of the perturbation of rewards.
    pub(super) sigma: f32,
    pub(super) target: TargetIndex,
    pub(super) owner: IndexOwner,
    pub(super) redraw: IndexDraw,
}

/// For whom an index is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum IndexOwner {
    /// One for each agent.
    Agent,
    /// One for the whole team: a control without diversity.
    Team,
}

/// When an index is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum IndexDraw {
    /// Once per run.
    Once,
    /// Again in each round.
    EveryRound,
}

/// The index ξ⁻ with which the target network evaluates the state after an action.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum TargetIndex {
    /// The index ξ whose values are trained: each ξ has values that are consistent over time.
    Same,
    /// Another one, drawn for each transition and gradient step: deviations are learned from the
    /// perturbation of rewards alone, and the mean of the values is optimistic.
    Independent,
}

impl IndexSettings {
    /// Number of outputs of a network that values `choices`.
    pub(super) fn outputs(&self, choices: usize) -> usize {
        (1 + self.dimension) * choices
    }

    /// Approximate number of bytes of the [samples](IndexSamples) of a minibatch.
    pub(super) fn memory(&self, minibatch: u64, choices: usize) -> u64 {
        // Two indices; values, next values, choosing values and their gradient; reward, discount,
        // weight, action and target.
        let numbers = 2 * self.dimension + 4 * choices + 6;
        let bytes = (size_of::<f32>() * numbers * self.samples) as u64;
        minibatch.saturating_mul(bytes)
    }

    /// The indices by which `agents` act in a round: `[K × M]`.
    pub(super) fn draw_for_agents(&self, run_seed: u64, agents: usize, round: u32) -> Vec<f32> {
        let round = match self.redraw {
            IndexDraw::Once => 0,
            IndexDraw::EveryRound => round,
        };
        let mut indices = Vec::with_capacity(agents * self.dimension);
        for agent in 0..agents as u32 {
            let owner = match self.owner {
                IndexOwner::Agent => agent,
                IndexOwner::Team => 0,
            };
            let mut random = stream(run_seed, Purpose::AgentIndex, owner, round);
            append_direction(self.dimension, &mut random, &mut indices);
        }
        indices
    }
}

/// Appends a point of the unit sphere, drawn uniformly: `M` numbers.
fn append_direction(dimension: usize, random: &mut impl Rng, directions: &mut Vec<f32>) {
    let start = directions.len();
    directions.extend((0..dimension).map(|_| -> f32 { StandardNormal.sample(random) }));
    normalize(&mut directions[start..], 1.0);
}

/// Scales a vector to a Euclidean norm.
pub(super) fn normalize(vector: &mut [f32], norm: f32) {
    let squares: f32 = vector.iter().map(|x| x * x).sum();
    let factor = norm / squares.sqrt().max(f32::MIN_POSITIVE);
    for x in vector {
        *x *= factor;
    }
}

/// Sets the mean over all indices of the values of a network to 0.
pub(super) fn remove_mean(mlp: &Mlp, dimension: usize, parameters: &mut [f32]) {
    let outputs = mlp.outputs();
    let choices = outputs / (1 + dimension);
    let (weight, bias) = mlp.output_layer(parameters);
    for row in weight.chunks_exact_mut(outputs) {
        row[..choices].fill(0.0);
    }
    bias[..choices].fill(0.0);
}

/// The parameters of a network whose outputs are the values for one index: those of the output layer
/// are combined like the outputs.   `parameters`: of a network with the outputs of all heads
pub(super) fn fold(mlp: &Mlp, parameters: &[f32], index: &[f32]) -> Vec<f32> {
    let mut all = parameters.to_vec();
    let (weight, bias) = mlp.output_layer(&mut all);
    let mut output_layer = Vec::new();
    for row in weight.chunks_exact(mlp.outputs()).chain([&*bias]) {
        index_conditioned::append_values(row, index, &mut output_layer);
    }
    let hidden = parameters.len() - weight.len() - bias.len();
    all.truncate(hidden);
    all.extend(output_layer);
    all
}

/// Outputs of the networks for the states of a minibatch: `[B × (1 + M) n]` each.
#[derive(Clone, Copy)]
pub(super) struct Heads<'a> {
    /// By the trained network, before the actions.
    pub(super) present: &'a [f32],
    /// By the target network, after the actions.
    pub(super) next: &'a [f32],
    /// By the network that chooses the next actions, after the actions.
    pub(super) choosing: &'a [f32],
}

/// Buffers for the J samples of each of B transitions.
#[derive(Default)]
pub(super) struct IndexSamples {
    /// Fixed random vectors z of the transitions: `[B × M]`.
    pub(super) noise: Vec<f32>,
    /// Indices ξ: `[B × J × M]`.
    indices: Vec<f32>,
    /// Indices ξ⁻ if they are not the same: `[B × J × M]`.
    target_indices: Vec<f32>,
    /// `[B × J × n]`
    pub(super) values: Vec<f32>,
    next_values: Vec<f32>,
    choosing_values: Vec<f32>,
    value_gradient: Vec<f32>,
    /// `[B × J]`
    rewards: Vec<f32>,
    discounts: Vec<f32>,
    weights: Vec<f32>,
    actions: Vec<usize>,
    targets: Vec<f32>,
}

impl IndexSamples {
    /// Draws the indices for `transitions` transitions from the stream of the round.
    pub(super) fn draw(
        &mut self,
        settings: &IndexSettings,
        transitions: usize,
        random: &mut Stream,
    ) {
        self.indices.clear();
        self.target_indices.clear();
        for _ in 0..transitions {
            for _ in 0..settings.samples {
                append_direction(settings.dimension, random, &mut self.indices);
            }
            if settings.target == TargetIndex::Independent {
                let start = self.target_indices.len();
                append_direction(settings.dimension, random, &mut self.target_indices);
                for _ in 1..settings.samples {
                    self.target_indices
                        .extend_from_within(start..start + settings.dimension);
                }
            }
        }
    }

    /// Computes the loss ½ mean (r + σ zᵀξ + γ Q′(s′, b; ξ⁻) − Q(s, a; ξ))² over transitions and their
    /// indices ξ, where b is the best choice at ξ⁻, and its gradient with respect to the heads of the
    /// trained network; returns the loss.   `gradient: [B × (1 + M) n]`, overwritten
    pub(super) fn compute_gradient(
        &mut self,
        settings: &IndexSettings,
        minibatch: &Minibatch,
        heads: Heads<'_>,
        gradient: &mut Vec<f32>,
    ) -> f32 {
        let samples = settings.samples;
        let indices = |coordinates| Indices {
            coordinates,
            dimension: settings.dimension,
            per_row: samples,
        };
        let own = indices(self.indices.as_slice());
        let target = match settings.target {
            TargetIndex::Same => own,
            TargetIndex::Independent => indices(self.target_indices.as_slice()),
        };
        index_conditioned::values(heads.present, own, &mut self.values);
        index_conditioned::values(heads.next, target, &mut self.next_values);
        index_conditioned::values(heads.choosing, target, &mut self.choosing_values);
        index_conditioned::perturbed_rewards(
            &minibatch.rewards,
            &self.noise,
            settings.sigma,
            own,
            &mut self.rewards,
        );
        repeat(&minibatch.discounts, samples, &mut self.discounts);
        repeat(&minibatch.weights, samples, &mut self.weights);
        repeat(&minibatch.actions, samples, &mut self.actions);
        q_learning::targets(
            &self.rewards,
            &self.discounts,
            &self.next_values,
            &self.choosing_values,
            &mut self.targets,
        );
        let loss = q_learning::squared_error(
            &self.values,
            &self.actions,
            &self.targets,
            &self.weights,
            &mut self.value_gradient,
        );
        index_conditioned::heads_gradient(&self.value_gradient, own, gradient);
        loss
    }
}

/// Repeats each entry `count` times.   `[B]` → `[B × count]`, overwritten
fn repeat<T: Copy>(entries: &[T], count: usize, repeated: &mut Vec<T>) {
    repeated.clear();
    for entry in entries {
        repeated.extend(std::iter::repeat_n(*entry, count));
    }
}
