//! Random network distillation: the bonus is the error in predicting the outputs of a fixed random
//! network (Burda et al. 2019).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{BonusConfig, BonusScale, GainModel, ModelSharing, Steps, TrainingData, same_kind};
use crate::agent::AgentContext;
use crate::agent::dynamics::transitions::{Moments, Rows, Targets, TransitionEncoder};
use crate::agent::network::{Descent, LearnedState, Network};
use crate::cancellation::cancellation_point;
use crate::experience::Episode;
use crate::nn::{Activations, AdamSettings, Initial, Mlp, Tensor, network_tensors};
use seedbed_env::TaskSpec;
use seedbed_input::limits::short_list;
use seedbed_input::numbers::{Count, ranged_count};
use seedbed_random::{Purpose, Stream, stream};

/// Error in predicting the outputs of a fixed random network: random network distillation
/// (Burda et al. 2019).
///
/// The inputs of both networks are a state and the action in this state; in Burda et al. they are the
/// next state.
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
    pub optimizer: AdamSettings,
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
            optimizer: AdamSettings::default(),
        }
    }
}

impl BonusConfig for Rnd {
    fn sharing(&self) -> ModelSharing {
        self.model
    }

    fn scale(&self) -> BonusScale {
        self.scale
    }

    fn build(&self, owner: u32, context: &AgentContext<'_>) -> Box<dyn GainModel> {
        Box::new(RndModel::new(self, owner, context))
    }

    /// A predictor and a target without an optimizer.
    fn memory(&self, spec: &TaskSpec) -> u64 {
        let network = Network::memory(&Mlp::new(&layer_sizes(self, spec)));
        network + network / 8
    }

    fn formula(&self) -> String {
        FORMULA.to_owned()
    }

    fn is_deterministic(&self) -> bool {
        true
    }
}

/// Formula of the gains, for readers of the tensors.
const FORMULA: &str = "inputs: a continuous action is first scaled to its range, \
    clip((a - center) / half_range, -1, 1); then x = clip((input - inputs.mean) / inputs.deviation, \
    -10, 10). Networks: tanh between the layers. Gain: mean over outputs of \
    (predictor(x) - target(x))^2.";

/// The fixed random network (target) and the predictor of one agent, or its copy of the team's
/// predictor. Inputs of both are the state and the action of a step.
struct RndModel {
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
    fn new(config: &Rnd, owner: u32, context: &AgentContext<'_>) -> Self {
        let sizes = layer_sizes(config, context.spec);
        let mut random = stream(context.run_seed, Purpose::ModelParameters, owner, 0);
        let (target, predictor) = (Mlp::new(&sizes), Mlp::new(&sizes));
        let target_parameters = target.initial_parameters(Initial::Random, &mut random);
        let initial_parameters = predictor.initial_parameters(Initial::Random, &mut random);
        Self {
            predictor: Network::new(predictor, initial_parameters, config.optimizer),
            config: config.clone(),
            encoder: TransitionEncoder::new(context.spec, Targets::Changes),
            target,
            target_parameters,
            rows: Rows::default(),
            activations: Activations::default(),
            gradient: Vec::new(),
        }
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
}

impl GainModel for RndModel {
    /// Mean squared error of the prediction at each step.
    fn compute_gains(&mut self, steps: &Steps<'_>, _: &mut Stream, gains: &mut Vec<f32>) {
        self.encoder
            .load_episode(steps.episode, steps.stride, &mut self.rows);
        self.compute_errors();
        let width = self.target.outputs();
        let mean_square =
            |row: &[f32]| row.iter().map(|error| error * error).sum::<f32>() / width as f32;
        gains.clear();
        gains.extend(self.gradient.chunks_exact(width).map(mean_square));
    }

    /// Trains on minibatches of the new episodes.
    fn learn(&mut self, data: &TrainingData<'_>, random: &mut Stream) -> Option<f32> {
        let new_episodes = data.new_episodes;
        let error = self.prediction_error(new_episodes);
        for episode in new_episodes {
            self.encoder.update_moments(episode);
        }
        if data.is_frozen || new_episodes.iter().all(|episode| episode.length() == 0) {
            return Some(error);
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
        Some(error)
    }

    fn copy_learned(&mut self, trained: &dyn GainModel) {
        let trained: &Self = same_kind(trained);
        self.predictor.copy_parameters(&trained.predictor);
        self.encoder.copy_moments(&trained.encoder);
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        let [mean, deviation, _] = self.encoder.tensors();
        network_tensors(&self.target, &self.target_parameters, "target")
            .chain(self.predictor.tensors("predictor"))
            .chain([mean, deviation])
            .collect()
    }

    fn is_finite(&self) -> bool {
        self.predictor.is_finite()
    }

    fn save(&self) -> Vec<u8> {
        let saved = Saved {
            predictor: self.predictor.learned_state(),
            moments: self.encoder.moments(),
        };
        postcard::to_stdvec(&saved).expect("plain numbers always serialize")
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Saved<LearnedState, Moments> =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        self.predictor.restore(saved.predictor)?;
        self.encoder.restore(saved.moments)?;
        Ok(())
    }
}
