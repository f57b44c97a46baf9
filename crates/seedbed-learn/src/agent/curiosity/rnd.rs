//! Random network distillation: a state is worth the error of predicting what a fixed random
//! network makes of it (Burda et al. 2019).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::transitions::{Moments, Rows, Transitions};
use super::{BonusScale, ModelSharing};
use crate::agent::AgentContext;
use crate::agent::network::{Descent, Learned, Network};
use crate::experience::Episode;
use crate::nn::{Activations, AdamSettings, Initial, Mlp};
use seedbed_env::input::numbers::{Count, known_count};
use seedbed_env::random::{Purpose, Stream, stream};

/// The configuration of random network distillation. The bonus is for a state and the action in it;
/// that of Burda et al. is for the next state.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Rnd {
    /// Whose experience the predictor learns from.
    pub model: ModelSharing,
    /// How errors become rewards.
    pub scale: BonusScale,
    /// Number of gradient steps per update.
    pub minibatches: Count<100_000>,
    /// Number of transitions per gradient step.
    pub minibatch: Count<100_000>,
    /// Numbers of units of the hidden layers of both networks.
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
            minibatches: known_count(60),
            minibatch: known_count(64),
            hidden: vec![known_count(32), known_count(32)],
            outputs: known_count(16),
            optimiser: AdamSettings::default(),
        }
    }
}

/// An agent's predictor, or its replica of the team's. Both networks see what a step started from
/// and did.
pub(crate) struct RndModel {
    config: Rnd,
    transitions: Transitions,
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

impl RndModel {
    pub(crate) fn new(config: &Rnd, owner: u32, member: &AgentContext<'_>) -> Self {
        let [inputs, _] = Transitions::widths(member.spec);
        let hidden = config.hidden.iter().map(|units| units.get() as usize);
        let sizes: Vec<usize> = [inputs]
            .into_iter()
            .chain(hidden)
            .chain([config.outputs.get() as usize])
            .collect();
        let mut random = stream(member.run_seed, Purpose::ModelParameters, owner, 0);
        let (target, predictor) = (Mlp::new(&sizes), Mlp::new(&sizes));
        let target_parameters = target.initial(Initial::Random, &mut random);
        let seed = predictor.initial(Initial::Random, &mut random);
        Self {
            predictor: Network::new(predictor, seed, config.optimiser),
            config: config.clone(),
            transitions: Transitions::new(member.spec),
            target,
            target_parameters,
            rows: Rows::default(),
            activations: Activations::default(),
            gradient: Vec::new(),
        }
    }

    /// Mean squared error of the prediction at every `stride`-th step.   `gains: [⌈T/stride⌉]`,
    /// overwritten
    pub(crate) fn gains(&mut self, episode: &Episode, stride: usize, gains: &mut Vec<f32>) {
        self.transitions.of_episode(episode, stride, &mut self.rows);
        self.errors();
        let width = self.target.outputs();
        let mean_square =
            |row: &[f32]| row.iter().map(|error| error * error).sum::<f32>() / width as f32;
        gains.clear();
        gains.extend(self.gradient.chunks_exact(width).map(mean_square));
    }

    /// Trains on minibatches of the fresh episodes, unless frozen; returns the mean squared error
    /// on them before that.
    pub(crate) fn learn(&mut self, fresh: &[&Episode], frozen: bool, random: &mut Stream) -> f32 {
        let error = self.prediction_error(fresh);
        for episode in fresh {
            self.transitions.take_in(episode);
        }
        if frozen || fresh.iter().all(|episode| episode.length() == 0) {
            return error;
        }
        let descent = Descent {
            regularisation: 0.0,
            gradient_clip: None,
            step_size_factor: 1.0,
        };
        for _ in 0..self.config.minibatches.get() {
            self.transitions.sample(
                fresh,
                self.config.minibatch.get() as usize,
                random,
                &mut self.rows,
            );
            self.errors();
            let share = 2.0 / self.gradient.len() as f32;
            for slope in &mut self.gradient {
                *slope *= share;
            }
            self.predictor
                .descend(&self.rows.inputs, &self.gradient, &descent);
        }
        error
    }

    /// Prediction minus target of the rows at hand, as `gradient`: `[N × outputs]`.
    fn errors(&mut self) {
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
                .map(|(ours, target)| ours - target),
        );
    }

    fn prediction_error(&mut self, episodes: &[&Episode]) -> f32 {
        let (mut sum, mut count) = (0.0_f64, 0_usize);
        for episode in episodes {
            self.transitions.of_episode(episode, 1, &mut self.rows);
            self.errors();
            sum += self
                .gradient
                .iter()
                .map(|error| f64::from(*error).powi(2))
                .sum::<f64>();
            count += self.gradient.len();
        }
        (sum / count.max(1) as f64) as f32
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.predictor.is_finite()
    }

    pub(crate) fn save(&self) -> Vec<u8> {
        let saved = Saved {
            predictor: self.predictor.learned(),
            moments: self.transitions.moments(),
        };
        postcard::to_stdvec(&saved).expect("plain numbers always serialise")
    }

    pub(crate) fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Saved<Learned, Moments> =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        self.predictor.restore(saved.predictor)?;
        self.transitions.restore(saved.moments);
        Ok(())
    }
}
