//! A Bayesian network of the dynamics, learned from episodes (thesis §4.2): the model of VIME's
//! bonus, and the model in which Seed-PSRL plans.

pub(crate) mod transitions;

use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use self::transitions::{Moments, OutcomeUnits, Rows, Targets, TransitionEncoder};
use super::network::Network;
use crate::cancellation::cancellation_point;
use crate::experience::Episode;
use crate::nn::bayesian::{BayesianState, PassBuffers};
use crate::nn::{BayesianNetwork, BayesianSettings, Mlp, Tensor, network_tensors};
use seedbed_env::TaskSpec;
use seedbed_input::numbers::Count;
use seedbed_random::Stream;

/// A distribution over networks that predict what follows from a state and an action.
pub(crate) struct DynamicsModel {
    encoder: TransitionEncoder,
    network: BayesianNetwork,
    work: Workspace,
}

/// The shape of a model and its further parameters.
#[derive(Clone, Copy)]
pub(crate) struct ModelShape<'a> {
    /// What the model predicts.
    pub(crate) targets: Targets,
    /// Number of units of each hidden layer.
    pub(crate) hidden: &'a [Count<4096>],
    pub(crate) network: &'a BayesianSettings,
}

/// Buffers that are reused.
#[derive(Default)]
struct Workspace {
    rows: Rows,
    noise: Vec<f32>,
    pass: PassBuffers,
}

/// What a checkpoint holds of a model. If outcomes are targets, their units follow.
#[derive(Serialize, Deserialize)]
struct Saved<S, M> {
    network: S,
    moments: M,
}

impl ModelShape<'_> {
    /// Sizes of the layers of the model, from its inputs to its outputs.
    fn layer_sizes(&self, spec: &TaskSpec) -> Vec<usize> {
        let [inputs, outputs] = TransitionEncoder::widths(spec, self.targets);
        let hidden = self.hidden.iter().map(|units| units.get() as usize);
        let sizes = [inputs].into_iter().chain(hidden);
        sizes.chain([outputs]).collect()
    }

    /// Approximate number of bytes that a model needs: mean and deviation of each weight, each with
    /// the moments of its optimizer, and draws.
    pub(crate) fn memory(&self, spec: &TaskSpec) -> u64 {
        2 * Network::memory(&Mlp::new(&self.layer_sizes(spec)))
    }

    /// Number of weights of the network.
    pub(crate) fn weight_count(&self, spec: &TaskSpec) -> usize {
        Mlp::new(&self.layer_sizes(spec)).parameter_count()
    }
}

impl DynamicsModel {
    /// A model that has not learned yet, whose initial means are drawn from `random`.
    pub(crate) fn new(shape: &ModelShape<'_>, spec: &TaskSpec, random: &mut Stream) -> Self {
        let sizes = shape.layer_sizes(spec);
        Self {
            encoder: TransitionEncoder::new(spec, shape.targets),
            network: BayesianNetwork::new(&sizes, shape.network, random),
            work: Workspace::default(),
        }
    }

    pub(crate) fn encoder(&self) -> &TransitionEncoder {
        &self.encoder
    }

    pub(crate) fn network(&self) -> &BayesianNetwork {
        &self.network
    }

    /// Number of weights P of the network.
    pub(crate) fn weight_count(&self) -> usize {
        self.network.likelihood().weight_count()
    }

    /// Writes every `stride`-th step of an episode to `rows`.
    pub(crate) fn load_episode(&mut self, episode: &Episode, stride: usize, rows: &mut Rows) {
        self.encoder.load_episode(episode, stride, rows);
    }

    /// Updates the scales of inputs and targets with new episodes. Returns the mean squared error of
    /// the network with the mean weights on them, before that.
    pub(crate) fn add_episodes(&mut self, new_episodes: &[&Episode]) -> f32 {
        let error = self.prediction_error(new_episodes);
        for episode in new_episodes {
            self.encoder.update_moments(episode);
        }
        error
    }

    /// Takes `minibatches` gradient steps, each on `minibatch` transitions. Does nothing without
    /// transitions.
    pub(crate) fn train(
        &mut self,
        episodes: &[&Episode],
        minibatches: u32,
        minibatch: usize,
        random: &mut Stream,
    ) {
        let transition_count: usize = episodes.iter().map(|episode| episode.length()).sum();
        if transition_count == 0 {
            return;
        }
        let weight_count = self.weight_count();
        for _ in 0..minibatches {
            cancellation_point();
            let Workspace { rows, noise, .. } = &mut self.work;
            self.encoder.sample(episodes, minibatch, random, rows);
            fill_normal(noise, weight_count, random);
            self.network
                .descend(&rows.inputs, &rows.targets, noise, transition_count);
        }
    }

    /// Replaces the prior by the present posterior.
    pub(crate) fn make_posterior_the_prior(&mut self) {
        self.network.make_posterior_the_prior();
    }

    fn prediction_error(&mut self, episodes: &[&Episode]) -> f32 {
        let (mut sum, mut count) = (0.0_f64, 0_usize);
        for episode in episodes {
            cancellation_point();
            let Workspace { rows, pass, .. } = &mut self.work;
            self.encoder.load_episode(episode, 1, rows);
            let predicted = self.network.likelihood().forward(
                &self.network.posterior().mean,
                &rows.inputs,
                pass,
            );
            sum += predicted
                .iter()
                .zip(&rows.targets)
                .map(|(predicted, target)| f64::from(predicted - target).powi(2))
                .sum::<f64>();
            count += rows.targets.len();
        }
        (sum / count.max(1) as f64) as f32
    }

    /// Copies what another model has learned, as far as predictions depend on it.
    pub(crate) fn copy_learned(&mut self, trained: &Self) {
        self.network.copy_posterior(&trained.network);
        self.encoder.copy_moments(&trained.encoder);
    }

    pub(crate) fn is_finite(&self) -> bool {
        let mut means = self.network.posterior().mean.iter();
        means.all(|mean| mean.is_finite())
    }

    /// Means and standard deviations of the weights, the moments of inputs and changes, and the units
    /// of outcomes if they are predicted.
    pub(crate) fn tensors(&self) -> Vec<Tensor<'_>> {
        let units = self.encoder.outcome_units();
        let units = units.map(|outcomes| Tensor::list("outcomes.unit", outcomes.units().to_vec()));
        let (mlp, weights) = (self.network.likelihood().mlp(), self.network.posterior());
        network_tensors(mlp, &weights.mean, "mean")
            .chain(network_tensors(mlp, &weights.deviation, "deviation"))
            .chain(self.encoder.tensors())
            .chain(units)
            .collect()
    }

    pub(crate) fn save(&self) -> Vec<u8> {
        let saved = Saved {
            network: self.network.state(),
            moments: self.encoder.moments(),
        };
        let mut bytes = postcard::to_stdvec(&saved).expect("plain numbers always serialize");
        if let Some(units) = self.encoder.outcome_units() {
            let units = postcard::to_stdvec(units);
            bytes.extend(units.expect("plain numbers always serialize"));
        }
        bytes
    }

    /// Continues from what [`save`](Self::save) wrote. `name` of the model for messages, such as
    /// `a bonus model`
    ///
    /// # Errors
    /// What is wrong if the bytes are not of such a model.
    pub(crate) fn restore(&mut self, bytes: &[u8], name: &str) -> Result<(), String> {
        let (saved, rest): (Saved<BayesianState, Moments>, &[u8]) =
            postcard::take_from_bytes(bytes).map_err(|error| error.to_string())?;
        let (stored, expected) = (saved.network.weight_count(), self.weight_count());
        if stored != expected {
            return Err(format!(
                "the checkpoint has {stored} weights of {name}; expected {expected}"
            ));
        }
        self.encoder.restore(saved.moments)?;
        if self.encoder.outcome_units().is_some() {
            let units: OutcomeUnits =
                postcard::from_bytes(rest).map_err(|error| error.to_string())?;
            self.encoder.restore_outcome_units(units)?;
        }
        self.network.restore(saved.network);
        Ok(())
    }
}

/// Replaces `numbers` by `count` standard-normal ones.
pub(crate) fn fill_normal(numbers: &mut Vec<f32>, count: usize, random: &mut Stream) {
    numbers.clear();
    numbers.extend((0..count).map(|_| -> f32 { StandardNormal.sample(random) }));
}
