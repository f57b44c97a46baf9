//! Random network distillation: the bonus is the error in predicting the outputs of a fixed random
//! network (Burda et al. 2019).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{BonusScale, ModelSharing};
use crate::agent::dynamics::transitions::{Moments, Rows, Targets, TransitionEncoder};
use crate::agent::network::{Descent, LearnedState, Network};
use crate::agent::{AgentContext, Tensor, network_tensors};
use crate::cancellation::cancellation_point;
use crate::experience::Episode;
use crate::nn::{Activations, AdamSettings, Initial, Mlp};
use seedbed_env::TaskSpec;
use seedbed_input::limits::short_list;
use seedbed_input::numbers::{Count, ranged_count};
use seedbed_random::{Purpose, Stream, stream};

/// The configuration of random network distillation. The inputs of both networks are a state and
/// the action in this state; in Burda et al. they are the next state.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Rnd {
    /// Whose experience the predictor learns from.
    pub model: ModelSharing,
    /// How prediction errors are scaled to bonuses.
    pub scale: BonusScale,
    /// Number of gradient steps per update.
    pub minibatches: Count<100_000>,
    /// Number of transitions per gradient step.
    pub minibatch: Count<100_000>,
    /// Number of units of each hidden layer, the same for both networks.
    #[serde(deserialize_with = "short_list")]
    pub hidden: Vec<Count<4096>>,
    /// Number of outputs of both networks.
    pub outputs: Count<4096>,
    /// Optimizer of the predictor.
    pub optimiser: AdamSettings,
}

impl Default for Rnd {
    fn default() -> Self {
        Self {
            model: ModelSharing::Shared,
            scale: BonusScale::default(),
            minibatches: ranged_count(60),
            minibatch: ranged_count(64),
            hidden: vec![ranged_count(32), ranged_count(32)],
            outputs: ranged_count(16),
            optimiser: AdamSettings::default(),
        }
    }
}

/// The fixed random network (target) and the predictor of one agent, or its copy of the team's
/// predictor. Inputs of both are the state and the action of a step.
pub(crate) struct RndModel {
    config: Rnd,
    encoder: TransitionEncoder,
    target: Mlp,
    target_parameters: Vec<f32>,
    predictor: Network,
    rows: Rows,
    activations: Activations,
    gradient: Vec<f32>,
}

#[derive(Serialize, Deserialize)]
struct Saved<L, M> {
    predictor: L,
    moments: M,
}

/// Sizes of the layers of both networks, from their inputs to their outputs.
fn layer_sizes(config: &Rnd, spec: &TaskSpec) -> Vec<usize> {
    let [inputs, _] = TransitionEncoder::widths(spec, Targets::Changes);
    let hidden = config.hidden.iter().map(|units| units.get() as usize);
    let sizes = [inputs].into_iter().chain(hidden);
    sizes.chain([config.outputs.get() as usize]).collect()
}

impl RndModel {
    /// Approximate number of bytes that a model needs: a predictor and a target without an optimizer.
    pub(crate) fn memory(config: &Rnd, spec: &TaskSpec) -> u64 {
        let network = Network::memory(&Mlp::new(&layer_sizes(config, spec)));
        network + network / 8
    }

    pub(crate) fn new(config: &Rnd, owner: u32, context: &AgentContext<'_>) -> Self {
        let sizes = layer_sizes(config, context.spec);
        let mut random = stream(context.run_seed, Purpose::ModelParameters, owner, 0);
        let (target, predictor) = (Mlp::new(&sizes), Mlp::new(&sizes));
        let target_parameters = target.initial_parameters(Initial::Random, &mut random);
        let initial_parameters = predictor.initial_parameters(Initial::Random, &mut random);
        Self {
            predictor: Network::new(predictor, initial_parameters, config.optimiser),
            config: config.clone(),
            encoder: TransitionEncoder::new(context.spec, Targets::Changes),
            target,
            target_parameters,
            rows: Rows::default(),
            activations: Activations::default(),
            gradient: Vec::new(),
        }
    }

    /// Mean squared error of the prediction at every `stride`-th step.   `gains: [⌈T/stride⌉]`,
    /// overwritten
    pub(crate) fn compute_gains(&mut self, episode: &Episode, stride: usize, gains: &mut Vec<f32>) {
        self.encoder.load_episode(episode, stride, &mut self.rows);
        self.compute_errors();
        let width = self.target.outputs();
        let mean_square =
            |row: &[f32]| row.iter().map(|error| error * error).sum::<f32>() / width as f32;
        gains.clear();
        gains.extend(self.gradient.chunks_exact(width).map(mean_square));
    }

    /// Trains on minibatches of the new episodes, unless `is_frozen`. Returns the mean squared
    /// error on the new episodes before training.
    pub(crate) fn learn(
        &mut self,
        new_episodes: &[&Episode],
        is_frozen: bool,
        random: &mut Stream,
    ) -> f32 {
        let error = self.prediction_error(new_episodes);
        for episode in new_episodes {
            self.encoder.update_moments(episode);
        }
        if is_frozen || new_episodes.iter().all(|episode| episode.length() == 0) {
            return error;
        }
        let descent = Descent {
            regularization: 0.0,
            gradient_clip: None,
            step_size_factor: 1.0,
        };
        for _ in 0..self.config.minibatches.get() {
            cancellation_point();
            self.encoder.sample(
                new_episodes,
                self.config.minibatch.get() as usize,
                random,
                &mut self.rows,
            );
            self.compute_errors();
            let share = 2.0 / self.gradient.len() as f32;
            for slope in &mut self.gradient {
                *slope *= share;
            }
            self.predictor
                .descend(&self.rows.inputs, &self.gradient, &descent);
        }
        error
    }

    /// Writes prediction minus target of the loaded rows to `gradient`: `[N × outputs]`.
    fn compute_errors(&mut self) {
        let target = self.target.forward(
            &self.target_parameters,
            &self.rows.inputs,
            &mut self.activations,
        );
        let predicted = self.predictor.forward(&self.rows.inputs);
        self.gradient.clear();
        self.gradient.extend(
            predicted
                .iter()
                .zip(target)
                .map(|(predicted, target)| predicted - target),
        );
    }

    /// Mean squared error of the predictor on all steps of `episodes`.
    fn prediction_error(&mut self, episodes: &[&Episode]) -> f32 {
        let (mut sum, mut count) = (0.0_f64, 0_usize);
        for episode in episodes {
            self.encoder.load_episode(episode, 1, &mut self.rows);
            self.compute_errors();
            sum += self
                .gradient
                .iter()
                .map(|error| f64::from(*error).powi(2))
                .sum::<f64>();
            count += self.gradient.len();
        }
        (sum / count.max(1) as f64) as f32
    }

    /// Copies what another model has learned, as far as gains depend on it.
    pub(crate) fn copy_learned(&mut self, trained: &Self) {
        self.predictor.copy_parameters(&trained.predictor);
        self.encoder.copy_moments(&trained.encoder);
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.predictor.is_finite()
    }

    /// Formula of the gains, for readers of the tensors.
    pub(super) const FORMULA: &'static str = "inputs: a continuous action is first scaled to its \
        range, clip((a - center) / half_range, -1, 1); then x = clip((input - inputs.mean) / \
        inputs.deviation, -10, 10). Networks: tanh between the layers. Gain: mean over outputs of \
        (predictor(x) - target(x))^2.";

    /// The fixed random network, the predictor, and the moments of the inputs.
    pub(super) fn tensors(&self) -> Vec<Tensor<'_>> {
        let [mean, deviation, _] = self.encoder.tensors();
        network_tensors(&self.target, &self.target_parameters, "target")
            .chain(self.predictor.tensors("predictor"))
            .chain([mean, deviation])
            .collect()
    }

    pub(crate) fn save(&self) -> Vec<u8> {
        let saved = Saved {
            predictor: self.predictor.learned_state(),
            moments: self.encoder.moments(),
        };
        postcard::to_stdvec(&saved).expect("plain numbers always serialize")
    }

    pub(crate) fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Saved<LearnedState, Moments> =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        self.predictor.restore(saved.predictor)?;
        self.encoder.restore(saved.moments)?;
        Ok(())
    }
}
