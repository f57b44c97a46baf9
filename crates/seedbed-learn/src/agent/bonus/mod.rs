//! Exploration bonuses: intrinsic rewards for informative or novel steps, added to the rewards that
//! an agent learns from (thesis §4).
//!
//! Every agent has a model of its own to compute bonuses with. If the team shares one model, agent 0
//! trains it, and the others copy what it has learned. Formulas are in [`rl`](crate::rl).

mod rnd;
mod team_entropy;
mod vime;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::rnd::Rnd;
pub use self::team_entropy::TeamEntropy;
pub use self::vime::{Gain, ModelBuffer, ModelSeeds, Vime};

use self::rnd::RndModel;
use self::team_entropy::TeamEntropyModel;
use self::vime::VimeModel;
use super::dynamics::transitions::TransitionEncoder;
use super::network_info::{BonusInfo, setting_text};
use super::{AgentContext, PROBE_STEPS};
use crate::cancellation::cancellation_point;
use crate::experience::replay::Origin;
use crate::experience::{Episode, Experience};
use crate::nn::{MedianScale, Tensor};
use crate::rl::information_gain;
use seedbed_env::TaskSpec;
use seedbed_input::numbers::{Count, NonNegative, Positive, ranged_count, ranged_number};
use seedbed_input::{Located, ValidationError};
use seedbed_random::{Purpose, Stream, stream};

/// Exploration bonus (intrinsic reward) that is added to the rewards of the environment.
#[derive(Clone, Debug, Default, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Bonus {
    /// No bonus.
    #[default]
    None,
    /// Information that a step gives about the dynamics: VIME (Houthooft et al. 2016) and Seed-VIME
    /// (thesis Alg. 2).
    Vime(Vime),
    /// Error in predicting the outputs of a fixed random network: random network distillation
    /// (Burda et al. 2019).
    Rnd(Rnd),
    /// Distance from the state that a step leads to, to other states of the newest round: k-nearest-
    /// neighbor entropy (RE3, Seo et al. 2021; APT, Liu & Abbeel 2021) of the states of a team (De Paola
    /// et al. 2025).
    TeamEntropy(TeamEntropy),
}

/// Whose experience a bonus model learns from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum ModelSharing {
    /// The experience of the team: one model for all agents.
    #[default]
    Shared,
    /// The agent's own experience: one model per agent.
    Independent,
    /// No experience: the model keeps its initial parameters. A control for experiments.
    Frozen,
}

/// How a gain I is scaled to a bonus.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum BonusScale {
    /// η min(c, I / mean of the latest medians): gains decrease by orders of magnitude as a model
    /// learns, and have a heavy tail. There is no bonus in the first round, which has no median
    /// yet.
    Median {
        /// Weight η of the bonus.
        #[serde(default = "default_weight")]
        weight: NonNegative,
        /// Maximal gain c, in units of the median gain.
        #[serde(default = "default_cap")]
        cap: Positive,
        /// Number of latest updates over which the median gain is averaged.
        #[serde(default = "default_medians")]
        medians: Count<10_000>,
    },
    /// η I, as printed in thesis Eq. 28.
    Raw {
        /// Weight η of the bonus.
        #[serde(default = "default_weight")]
        weight: NonNegative,
        /// Upper end of the axis of bonuses in figures.
        #[serde(default = "default_shown")]
        shown: Positive,
    },
}

impl Default for BonusScale {
    fn default() -> Self {
        Self::Median {
            weight: default_weight(),
            cap: default_cap(),
            medians: default_medians(),
        }
    }
}

impl BonusScale {
    /// The bonus of a gain. `median` is the mean of the latest medians, none before the first
    /// update.
    fn bonus(self, gain: f32, median: Option<f32>) -> f32 {
        match self {
            Self::Median { weight, cap, .. } => {
                information_gain::bonus(gain, median, cap.get_f32(), weight.get_f32())
            }
            Self::Raw { weight, .. } => weight.get_f32() * gain,
        }
    }

    /// The largest bonus that figures show: the largest that is possible, if there is one.
    fn largest_shown(self) -> f32 {
        match self {
            Self::Median { weight, cap, .. } => weight.get_f32() * cap.get_f32(),
            Self::Raw { shown, .. } => shown.get_f32(),
        }
    }

    /// Whether bonuses depend on the latest medians.
    fn uses_medians(self) -> bool {
        matches!(self, Self::Median { .. })
    }

    /// Number of latest updates over which the median gain is averaged.
    fn medians(self) -> usize {
        match self {
            Self::Median { medians, .. } => medians.get() as usize,
            Self::Raw { .. } => 1,
        }
    }
}

fn default_weight() -> NonNegative {
    ranged_number(1e-3)
}

fn default_cap() -> Positive {
    ranged_number(10.0)
}

fn default_medians() -> Count<10_000> {
    ranged_count(10)
}

fn default_shown() -> Positive {
    ranged_number(1.0)
}

impl Bonus {
    /// Number of the team's newest transitions that the shared buffer must keep for training the
    /// model.
    #[must_use]
    pub fn transitions_kept(&self) -> u64 {
        match self {
            Self::Vime(Vime {
                buffer: ModelBuffer::Kept { transitions },
                ..
            }) => transitions.get().into(),
            Self::Vime(_) | Self::Rnd(_) | Self::TeamEntropy(_) | Self::None => 0,
        }
    }

    /// Approximate number of bytes that the model of one agent needs.
    pub(crate) fn memory(&self, spec: &TaskSpec) -> u64 {
        match self {
            Self::None => 0,
            Self::Vime(config) => VimeModel::memory(config, spec),
            Self::Rnd(config) => RndModel::memory(config, spec),
            Self::TeamEntropy(config) => TeamEntropyModel::memory(config, spec),
        }
    }

    /// The largest bonus that figures show: the largest that a step can have, if there is one. None
    /// without a bonus.
    #[must_use]
    pub fn largest_bonus(&self) -> Option<f32> {
        self.common().map(|common| common.scale.largest_shown())
    }

    /// Checks that the parameters fit together.
    pub(crate) fn check(bonus: &Located<Self>) -> Result<(), ValidationError> {
        let fault = match &**bonus {
            Self::TeamEntropy(config) => config.fault(),
            Self::None | Self::Vime(_) | Self::Rnd(_) => None,
        };
        fault.map_or(Ok(()), |fault| Err(bonus.error(fault)))
    }

    /// Whether all agents must learn at the same time from the same episodes, because they share
    /// one model.
    #[must_use]
    pub fn has_shared_model(&self) -> bool {
        self.sharing() == Some(ModelSharing::Shared)
    }

    /// Whether all agents give the same bonus to the same step, whatever they have learned: they share a
    /// model that has neither seeds nor random draws.
    #[must_use]
    pub fn is_same_for_all_agents(&self) -> bool {
        self.has_shared_model() && matches!(self, Self::Rnd(_) | Self::TeamEntropy(_))
    }

    /// Whether the bonus is the distance to states that the team visited.
    #[must_use]
    pub fn is_team_entropy(&self) -> bool {
        matches!(self, Self::TeamEntropy(_))
    }

    /// Whether each agent has a model that learns from its own experience only.
    #[must_use]
    pub fn has_independent_models(&self) -> bool {
        self.sharing() == Some(ModelSharing::Independent)
    }

    /// How the tensors of the model are used; none without a bonus. `owner` is the first part of the
    /// names of tensors of a model that is not shared, such as `agent_{agent}.`.
    pub(crate) fn info(&self, spec: &TaskSpec, owner: &str) -> Option<BonusInfo> {
        let Common { kind, scale, .. } = self.common()?;
        let (mut inputs, mut formula) = (TransitionEncoder::input_names(spec), String::new());
        match self {
            Self::None => {}
            Self::Vime(_) => VimeModel::FORMULA.clone_into(&mut formula),
            Self::Rnd(_) => RndModel::FORMULA.clone_into(&mut formula),
            Self::TeamEntropy(config) => {
                inputs.truncate(spec.observation_width());
                formula = config.formula();
            }
        }
        let model_owner = if self.has_shared_model() {
            SHARED_OWNER
        } else {
            owner
        };
        Some(BonusInfo {
            kind,
            model: format!("{model_owner}bonus"),
            inputs,
            formula,
            median_scale: scale
                .uses_medians()
                .then(|| format!("{owner}{MEDIAN_SCALE}")),
            scale: setting_text(&scale),
        })
    }

    fn sharing(&self) -> Option<ModelSharing> {
        self.common().map(|common| common.sharing)
    }

    /// The parameters that all bonuses have; none without a bonus.
    fn common(&self) -> Option<Common> {
        let (kind, sharing, scale) = match self {
            Self::None => return None,
            Self::Vime(config) => ("Vime", config.model, config.scale),
            Self::Rnd(config) => ("Rnd", config.model, config.scale),
            Self::TeamEntropy(config) => ("TeamEntropy", config.model, config.scale),
        };
        Some(Common {
            kind,
            sharing,
            scale,
        })
    }
}

/// The parameters that all bonuses have.
#[derive(Clone, Copy)]
struct Common {
    /// The kind of bonus, as in a scenario.
    kind: &'static str,
    sharing: ModelSharing,
    scale: BonusScale,
}

/// First part of the names of the tensors of a model that the team shares.
pub(crate) const SHARED_OWNER: &str = "team.";

/// Name of the mean of the latest median gains.
const MEDIAN_SCALE: &str = "bonus.median_scale";

/// Computes the bonuses of one agent, and learns from its experience.
pub struct BonusModel {
    run_seed: u64,
    agent: u32,
    sharing: ModelSharing,
    scale: BonusScale,
    medians: MedianScale,
    model: Model,
    /// Gains of the agent's own steps in the latest update.
    own_gains: Vec<f32>,
}

/// The model that gains are computed from.
enum Model {
    Vime(Box<VimeModel>),
    Rnd(Box<RndModel>),
    TeamEntropy(Box<TeamEntropyModel>),
}

/// What a checkpoint holds of a bonus model. The rest derives from the scenario.
#[derive(Serialize, Deserialize)]
struct Saved<M> {
    medians: M,
    model: Vec<u8>,
}

impl BonusModel {
    /// The model of one agent; none if the configuration has no bonus.
    pub(crate) fn new(bonus: &Bonus, context: &AgentContext<'_>) -> Option<Self> {
        let Common { sharing, scale, .. } = bonus.common()?;
        let owner = stream_owner(sharing, context.agent);
        let model = match bonus {
            Bonus::Rnd(config) => Model::Rnd(Box::new(RndModel::new(config, owner, context))),
            Bonus::Vime(config) => Model::Vime(Box::new(VimeModel::new(config, owner, context))),
            Bonus::TeamEntropy(config) => {
                Model::TeamEntropy(Box::new(TeamEntropyModel::new(config, context)))
            }
            Bonus::None => return None,
        };
        let medians = MedianScale::new(scale.medians());
        let (run_seed, agent) = (context.run_seed, context.agent);
        Some(Self {
            run_seed,
            agent,
            sharing,
            scale,
            medians,
            model,
            own_gains: Vec::new(),
        })
    }

    /// Computes the bonus of every step of the chosen new episodes, before the model learns from
    /// them, and then adds the median of the agent's own gains to the scale.
    ///
    /// `chosen_episodes` are indices of new episodes; `bonuses` gets one list per new episode,
    /// which is empty for episodes that are not chosen.
    pub(crate) fn compute_bonuses(
        &mut self,
        experience: &Experience<'_>,
        chosen_episodes: &[usize],
        bonuses: &mut Vec<Vec<f32>>,
    ) {
        let agent = self.agent;
        self.compute_bonuses_where(experience, chosen_episodes, bonuses, |episode| {
            episode.agent == agent
        });
    }

    /// Like [`compute_bonuses`](Self::compute_bonuses), but all chosen episodes count as the
    /// agent's own.
    pub(crate) fn compute_own_bonuses(
        &mut self,
        experience: &Experience<'_>,
        own_episodes: &[usize],
        bonuses: &mut Vec<Vec<f32>>,
    ) {
        self.compute_bonuses_where(experience, own_episodes, bonuses, |_| true);
    }

    /// Computes the bonuses of transitions from any episodes with the present model and scale.
    /// `pairs` has transition i as step 2i; `origins` are the steps that the transitions were.
    pub(crate) fn compute_bonuses_of_pairs(
        &mut self,
        pairs: &Episode,
        origins: &[Origin],
        random: &mut Stream,
        bonuses: &mut Vec<f32>,
    ) {
        let origin = |step: usize| origins[step / 2];
        self.compute_gains_of(pairs, 2, origin, random, bonuses);
        self.scale_gains(bonuses);
    }

    fn compute_bonuses_where(
        &mut self,
        experience: &Experience<'_>,
        chosen_episodes: &[usize],
        bonuses: &mut Vec<Vec<f32>>,
        is_own: impl Fn(&Episode) -> bool,
    ) {
        self.draw_references(experience);
        let mut random = stream(
            self.run_seed,
            Purpose::BonusNoise,
            self.agent,
            experience.earlier_updates,
        );
        bonuses.resize_with(experience.new_episodes.len().max(bonuses.len()), Vec::new);
        bonuses.iter_mut().for_each(Vec::clear);
        self.own_gains.clear();
        for &index in chosen_episodes {
            cancellation_point();
            let (episode, bonuses) = (&experience.new_episodes[index], &mut bonuses[index]);
            self.compute_gains(episode, 1, &mut random, bonuses);
            if is_own(episode) {
                self.own_gains.extend_from_slice(bonuses);
            }
            self.scale_gains(bonuses);
        }
        self.medians.update(&mut self.own_gains);
    }

    /// Draws the states of new episodes that other states are compared with, if the bonus compares
    /// states. Agents that share a model draw the same ones.
    fn draw_references(&mut self, experience: &Experience<'_>) {
        let episodes = self.episodes_of_model(experience.new_episodes);
        let owner = stream_owner(self.sharing, self.agent);
        if let Model::TeamEntropy(model) = &mut self.model {
            let (purpose, round) = (Purpose::ReferenceStates, experience.earlier_updates);
            model.draw_references(&episodes, &mut stream(self.run_seed, purpose, owner, round));
        }
    }

    /// The episodes that the model depends on: the agent's own if the team does not share it.
    fn episodes_of_model<'a>(&self, episodes: &'a [Episode]) -> Vec<&'a Episode> {
        let is_used = |episode: &&Episode| {
            self.sharing != ModelSharing::Independent || episode.agent == self.agent
        };
        episodes.iter().filter(is_used).collect()
    }

    /// Replaces gains by bonuses.
    fn scale_gains(&self, gains: &mut [f32]) {
        let median = self.medians.scale();
        for gain in gains {
            *gain = self.scale.bonus(*gain, median);
        }
    }

    /// Unscaled gains of at most [`PROBE_STEPS`] steps, evenly spread over an episode. Draws from a
    /// stream of its own, so that learning is not affected.
    pub(crate) fn probe_bonuses(&mut self, episode: &Episode, round: u32) -> Vec<f32> {
        let (mut random, mut gains) = (
            stream(self.run_seed, Purpose::BonusProbe, self.agent, round),
            Vec::new(),
        );
        self.compute_gains(
            episode,
            episode.length().div_ceil(PROBE_STEPS).max(1),
            &mut random,
            &mut gains,
        );
        gains
    }

    /// Whether the team shares one model, which agent 0 trains.
    pub(crate) fn is_shared(&self) -> bool {
        self.sharing == ModelSharing::Shared
    }

    /// Whether the agent learns from, measures errors on, or compares states with all new episodes of
    /// the team.
    pub(crate) fn needs_all_episodes(&self) -> bool {
        match self.sharing {
            ModelSharing::Shared => self.agent == 0 || matches!(self.model, Model::TeamEntropy(_)),
            ModelSharing::Independent => false,
            ModelSharing::Frozen => true,
        }
    }

    /// Trains the model, unless it is frozen, or a copy of a shared model that another agent trains.
    /// Returns its mean squared error on the new episodes before training, in the units of its
    /// targets; `None` for a copy, or without targets.
    pub(crate) fn learn(&mut self, experience: &Experience<'_>) -> Option<f32> {
        if self.is_shared() && self.agent != 0 {
            return None;
        }
        let owner = stream_owner(self.sharing, self.agent);
        let mut random = stream(
            self.run_seed,
            Purpose::ModelTraining,
            owner,
            experience.earlier_updates,
        );
        let new_episodes = self.episodes_of_model(experience.new_episodes);
        let all_episodes = self.episodes_of_model(experience.all_episodes);
        let is_frozen = self.sharing == ModelSharing::Frozen;
        let error = match &mut self.model {
            Model::Vime(model) => model.learn(&all_episodes, &new_episodes, is_frozen, &mut random),
            Model::Rnd(model) => model.learn(&new_episodes, is_frozen, &mut random),
            Model::TeamEntropy(_) => return None,
        };
        Some(error)
    }

    /// Copies what the model of another agent has learned, as far as bonuses depend on it.
    pub(crate) fn copy_learned(&mut self, trained: &Self) {
        match (&mut self.model, &trained.model) {
            (Model::Vime(model), Model::Vime(trained)) => model.copy_learned(trained),
            (Model::Rnd(model), Model::Rnd(trained)) => model.copy_learned(trained),
            (Model::TeamEntropy(model), Model::TeamEntropy(trained)) => model.copy_learned(trained),
            _ => unreachable!("all agents of a team have the same kind of model"),
        }
    }

    /// The tensors of the model, named e.g. `bonus.inputs.mean`.
    fn model_tensors(&self) -> impl Iterator<Item = Tensor<'_>> {
        let tensors = match &self.model {
            Model::Vime(model) => model.tensors(),
            Model::Rnd(model) => model.tensors(),
            Model::TeamEntropy(model) => model.tensors(),
        };
        tensors.into_iter().map(|tensor| tensor.prefixed("bonus."))
    }

    /// The tensors of the agent: the mean of its latest median gains, if bonuses are scaled by it
    /// and there is a median; and the model, unless it is shared.
    pub(crate) fn own_tensors(&self) -> impl Iterator<Item = Tensor<'_>> {
        let median = self.medians.scale().filter(|_| self.scale.uses_medians());
        let median = median.map(|median| Tensor::list(MEDIAN_SCALE, vec![median]));
        let is_own = !self.is_shared();
        let model = is_own.then(|| self.model_tensors());
        median.into_iter().chain(model.into_iter().flatten())
    }

    /// The tensors of the model, if the team shares it.
    pub(crate) fn shared_tensors(&self) -> impl Iterator<Item = Tensor<'_>> {
        let model = self.is_shared().then(|| self.model_tensors());
        model.into_iter().flatten()
    }

    /// The agent's seeds of the model, named e.g. `bonus.seeds.layer_0.weight`, if there are any.
    pub(crate) fn seed_tensors(&self) -> impl Iterator<Item = Tensor<'_>> {
        let tensors = match &self.model {
            Model::Vime(model) => model.seed_tensors(),
            Model::Rnd(_) | Model::TeamEntropy(_) => Vec::new(),
        };
        tensors.into_iter().map(|tensor| tensor.prefixed("bonus."))
    }

    pub(crate) fn is_finite(&self) -> bool {
        match &self.model {
            Model::Vime(model) => model.is_finite(),
            Model::Rnd(model) => model.is_finite(),
            Model::TeamEntropy(_) => true,
        }
    }

    pub(crate) fn save(&self) -> Vec<u8> {
        postcard::to_stdvec(&Saved {
            medians: &self.medians,
            model: self.save_model(),
        })
        .expect("plain numbers always serialize")
    }

    /// What the model has learned, without what belongs to the agent.
    pub(crate) fn save_model(&self) -> Vec<u8> {
        match &self.model {
            Model::Vime(model) => model.save(),
            Model::Rnd(model) => model.save(),
            Model::TeamEntropy(model) => model.save(),
        }
    }

    pub(crate) fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Saved<MedianScale> =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        self.medians = saved.medians;
        self.restore_model(&saved.model)
    }

    /// Continues from what [`save_model`](Self::save_model) wrote.
    pub(crate) fn restore_model(&mut self, bytes: &[u8]) -> Result<(), String> {
        match &mut self.model {
            Model::Vime(model) => model.restore(bytes),
            Model::Rnd(model) => model.restore(bytes),
            Model::TeamEntropy(model) => model.restore(bytes),
        }
    }

    /// Unscaled gain of every `stride`-th step of an episode.   `gains: [⌈T/stride⌉]`, overwritten
    fn compute_gains(
        &mut self,
        episode: &Episode,
        stride: usize,
        random: &mut Stream,
        gains: &mut Vec<f32>,
    ) {
        let origin = |step| episode.origin(step);
        self.compute_gains_of(episode, stride, origin, random, gains);
    }

    /// Like [`compute_gains`](Self::compute_gains), but the steps have other names than those of the
    /// episode.
    fn compute_gains_of(
        &mut self,
        episode: &Episode,
        stride: usize,
        origin: impl Fn(usize) -> Origin,
        random: &mut Stream,
        gains: &mut Vec<f32>,
    ) {
        match &mut self.model {
            Model::Vime(model) => model.compute_gains(episode, stride, random, gains),
            Model::Rnd(model) => model.compute_gains(episode, stride, gains),
            Model::TeamEntropy(model) => model.compute_gains(episode, stride, origin, gains),
        }
    }
}

/// Number of the agent whose random streams a model draws from; a shared model uses the streams of
/// agent 0.
fn stream_owner(sharing: ModelSharing, agent: u32) -> u32 {
    if sharing == ModelSharing::Shared {
        0
    } else {
        agent
    }
}

#[cfg(test)]
mod tests;
