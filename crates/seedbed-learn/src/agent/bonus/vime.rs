//! VIME and Seed-VIME: the bonus of a step is the information that it gives about the dynamics
//! (thesis §4, Alg. 2; Houthooft et al. 2016).
//!
//! The model of the dynamics is p(s'|s, a; θ) with a Gaussian posterior q(θ; φ) over the weights of
//! a network, learned by Bayes by Backprop (Eq. 27, 33). The bonus of a step is KL(q after the step
//! ‖ q before it), to second order (Eq. 32) or exactly. In Seed-VIME agent k computes bonuses with
//! its own `φ_k`: the shared φ, modified by its seeds `z_k`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{BonusConfig, BonusScale, GainModel, ModelSharing, Steps, TrainingData, same_kind};
use crate::agent::AgentContext;
use crate::agent::dynamics::transitions::{Rows, Targets};
use crate::agent::dynamics::{DynamicsModel, ModelShape, fill_normal};
use crate::nn::bayesian::{DiagonalGaussian, Draws, PassBuffers};
use crate::nn::{BayesianSettings, Tensor, network_tensors};
use crate::rl::information_gain;
use seedbed_env::TaskSpec;
use seedbed_input::limits::short_list;
use seedbed_input::numbers::{Count, Positive, ranged_count, ranged_number};
use seedbed_random::{Purpose, Stream, stream};

/// Information that a step gives about the dynamics: VIME (Houthooft et al. 2016) and Seed-VIME
/// (thesis Alg. 2).
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Vime {
    /// Whose experience the model learns from.
    pub model: ModelSharing,
    /// How an agent's seeds modify the model for its bonuses.
    pub seeds: ModelSeeds,
    /// How information gain is estimated.
    pub gain: Gain,
    /// Size λ of the gradient step whose information gain is measured.
    pub step: Positive,
    /// How information gains are scaled to bonuses.
    pub scale: BonusScale,
    /// Which transitions the model is trained on.
    pub buffer: ModelBuffer,
    /// Number of gradient steps per update.
    pub minibatches: Count<100_000>,
    /// Number of transitions per gradient step.
    pub minibatch: Count<100_000>,
    /// Number of units of each hidden layer of the model.
    #[serde(deserialize_with = "short_list")]
    pub hidden: Vec<Count<4096>>,
    /// Further parameters of the model.
    pub network: BayesianSettings,
}

/// How an agent's seeds `z_k`, drawn once per run, modify the model φ = {μ, σ} for its bonuses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum ModelSeeds {
    /// The model is not modified: all agents compute the same bonuses.
    #[default]
    Off,
    /// σ ← σ |z| (thesis Alg. 2, which prints σ z: a deviation cannot be negative).
    Scale,
    /// The mean of each weight is shifted: μ ← μ + σ z, standard-Gaussian seed sampling (thesis
    /// §2.3).
    Shift,
    /// Weights are always drawn with the agent's own fixed noise, ε = z, instead of the fresh draws
    /// that `gain` sets.
    FixedSample,
}

/// How information gain is estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Gain {
    /// To second order (Eq. 32), from one draw of weights per episode: fast, biased upwards.
    #[default]
    OneDraw,
    /// To second order, from the mean gradient over this number of draws per episode.
    Draws(Count<1000>),
    /// The exact divergence after the gradient step, from this number of draws per episode.
    ExplicitStep(Count<1000>),
}

/// Which transitions the model is trained on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum ModelBuffer {
    /// The newest transitions, old and new ones. Every update has the same prior of the weights.
    Kept {
        /// Minimal number of transitions.
        #[serde(default = "default_transitions")]
        transitions: Count<100_000_000>,
    },
    /// Only transitions since the last update; the posterior becomes the next prior.
    Cleared,
}

impl Default for Vime {
    fn default() -> Self {
        Self {
            model: ModelSharing::Shared,
            seeds: ModelSeeds::Off,
            gain: Gain::OneDraw,
            step: ranged_number(0.01),
            scale: BonusScale::default(),
            buffer: ModelBuffer::Kept {
                transitions: default_transitions(),
            },
            minibatches: ranged_count(60),
            minibatch: ranged_count(64),
            hidden: vec![ranged_count(32)],
            network: BayesianSettings::default(),
        }
    }
}

fn default_transitions() -> Count<100_000_000> {
    ranged_count(1_000_000)
}

impl BonusConfig for Vime {
    fn sharing(&self) -> ModelSharing {
        self.model
    }

    fn scale(&self) -> BonusScale {
        self.scale
    }

    fn build(&self, owner: u32, context: &AgentContext<'_>) -> Box<dyn GainModel> {
        Box::new(VimeModel::new(self, owner, context))
    }

    fn memory(&self, spec: &TaskSpec) -> u64 {
        self.shape().memory(spec)
    }

    fn formula(&self) -> String {
        FORMULA.to_owned()
    }

    fn transitions_kept(&self) -> u64 {
        match self.buffer {
            ModelBuffer::Kept { transitions } => transitions.get().into(),
            ModelBuffer::Cleared => 0,
        }
    }
}

/// Formula of the gains, for readers of the tensors.
const FORMULA: &str = "inputs: a continuous action is first scaled to its range, \
    clip((a - center) / half_range, -1, 1); then x = clip((input - inputs.mean) / inputs.deviation, \
    -10, 10). Network: weights w ~ N(mean, deviation^2), relu between the layers; its outputs predict \
    the change of each observation, clip(change / changes.root_mean_square, -10, 10). Gain: \
    information that the step gives about w, nats.";

/// The model of one agent, or its copy of the team's model.
struct VimeModel {
    config: Vime,
    dynamics: DynamicsModel,
    /// Seeds `z_k` of the model: `[P]`.
    seeds: Vec<f32>,
    work: Workspace,
}

/// Buffers that are reused.
#[derive(Default)]
struct Workspace {
    rows: Rows,
    noise: Vec<f32>,
    perturbed: DiagonalGaussian,
    weights: Vec<f32>,
    coefficients: Vec<f32>,
    pass: PassBuffers,
    draws: Draws,
}

impl Vime {
    fn shape(&self) -> ModelShape<'_> {
        ModelShape {
            targets: Targets::Changes,
            hidden: &self.hidden,
            network: &self.network,
        }
    }
}

impl VimeModel {
    /// A model that draws from the random streams of agent `owner`; its seeds are those of the
    /// agent in `context`.
    fn new(config: &Vime, owner: u32, context: &AgentContext<'_>) -> Self {
        let mut random = stream(context.run_seed, Purpose::ModelParameters, owner, 0);
        let dynamics = DynamicsModel::new(&config.shape(), context.spec, &mut random);
        let mut seeds = Vec::new();
        fill_normal(
            &mut seeds,
            dynamics.weight_count(),
            &mut stream(context.run_seed, Purpose::ModelSeeds, context.agent, 0),
        );
        Self {
            config: config.clone(),
            dynamics,
            seeds,
            work: Workspace::default(),
        }
    }

    /// Sets `φ_k`, the agent's own posterior; with `FixedSample`, replaces the noise by the seeds.
    fn perturb(&mut self) {
        let Workspace {
            perturbed, noise, ..
        } = &mut self.work;
        let posterior = self.dynamics.network().posterior();
        match self.config.seeds {
            ModelSeeds::Off => perturbed.clone_from(posterior),
            ModelSeeds::Scale => perturbed.copy_scaled(posterior, &self.seeds),
            ModelSeeds::Shift => perturbed.copy_shifted(posterior, &self.seeds),
            ModelSeeds::FixedSample => {
                perturbed.clone_from(posterior);
                noise.clone_from(&self.seeds);
            }
        }
    }

    fn gains_from_one_draw(&mut self, gains: &mut [f32]) {
        let Workspace {
            rows,
            noise,
            perturbed,
            weights,
            coefficients,
            pass,
            ..
        } = &mut self.work;
        perturbed.draw(noise, weights);
        information_gain::one_draw_coefficients(
            &perturbed.deviation,
            noise,
            self.config.step.get_f32(),
            coefficients,
        );
        self.dynamics.network().likelihood().weighted_squares(
            (weights, coefficients),
            (&rows.inputs, &rows.targets),
            pass,
            gains,
        );
    }

    fn gains_from_draws(
        &mut self,
        gains: &mut [f32],
        gain: impl Fn(&[f32], &[f32], &[f32], f32) -> f32,
    ) {
        let Workspace {
            rows,
            noise,
            perturbed,
            draws,
            ..
        } = &mut self.work;
        let (step, mut gains) = (self.config.step.get_f32(), gains.iter_mut());
        let set_next_gain = |mean_gradient: &[f32], deviation_gradient: &[f32]| {
            if let Some(next) = gains.next() {
                *next = gain(
                    &perturbed.deviation,
                    mean_gradient,
                    deviation_gradient,
                    step,
                );
            }
        };
        self.dynamics.network().likelihood().expected_gradients(
            (perturbed, noise),
            (&rows.inputs, &rows.targets),
            draws,
            set_next_gain,
        );
    }
}

impl GainModel for VimeModel {
    /// The information gain of each step.
    fn compute_gains(&mut self, steps: &Steps<'_>, random: &mut Stream, gains: &mut Vec<f32>) {
        let (episode, stride) = (steps.episode, steps.stride);
        let count = self.dynamics.weight_count();
        self.dynamics
            .load_episode(episode, stride, &mut self.work.rows);
        let draws = match self.config.gain {
            Gain::OneDraw => 1,
            Gain::Draws(draws) | Gain::ExplicitStep(draws) => draws.get() as usize,
        };
        fill_normal(&mut self.work.noise, draws * count, random);
        self.perturb();
        gains.clear();
        gains.resize(episode.length().div_ceil(stride), 0.0);
        match self.config.gain {
            Gain::OneDraw => self.gains_from_one_draw(gains),
            Gain::Draws(_) => self.gains_from_draws(gains, information_gain::second_order),
            Gain::ExplicitStep(_) => {
                self.gains_from_draws(gains, |sigma, mean, deviation, step| {
                    information_gain::explicit_step(sigma, mean, deviation, step) as f32
                });
            }
        }
    }

    /// Trains on minibatches. The error is that of the network with the mean weights.
    fn learn(&mut self, data: &TrainingData<'_>, random: &mut Stream) -> Option<f32> {
        let error = self.dynamics.add_episodes(data.new_episodes);
        let is_cleared = self.config.buffer == ModelBuffer::Cleared;
        let training_episodes = if is_cleared {
            data.new_episodes
        } else {
            data.all_episodes
        };
        let mut lengths = training_episodes.iter().map(|episode| episode.length());
        if data.is_frozen || lengths.all(|length| length == 0) {
            return Some(error);
        }
        let (minibatches, minibatch) = (&self.config.minibatches, &self.config.minibatch);
        self.dynamics.train(
            training_episodes,
            minibatches.get(),
            minibatch.get() as usize,
            random,
        );
        if is_cleared {
            self.dynamics.make_posterior_the_prior();
        }
        Some(error)
    }

    fn copy_learned(&mut self, trained: &dyn GainModel) {
        let trained: &Self = same_kind(trained);
        self.dynamics.copy_learned(&trained.dynamics);
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        self.dynamics.tensors()
    }

    fn seed_tensors(&self) -> Vec<Tensor<'_>> {
        if self.config.seeds == ModelSeeds::Off {
            return Vec::new();
        }
        let mlp = self.dynamics.network().likelihood().mlp();
        network_tensors(mlp, &self.seeds, "seeds").collect()
    }

    fn is_finite(&self) -> bool {
        self.dynamics.is_finite()
    }

    fn save(&self) -> Vec<u8> {
        self.dynamics.save()
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        self.dynamics.restore(bytes, "a bonus model")
    }
}
