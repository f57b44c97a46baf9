//! The bonus model of one agent: computes bonuses, learns, and copies what a shared model has learned.

use serde::{Deserialize, Serialize};

use super::{Bonus, BonusScale, GainModel, ModelSharing, Steps, TrainingData, TransitionPairs};
use crate::agent::{AgentContext, PROBE_STEPS};
use crate::cancellation::cancellation_point;
use crate::experience::{Episode, Experience};
use crate::nn::{MedianScale, Tensor};
use seedbed_random::{Purpose, Stream, stream};

/// Name of the mean of the latest median gains.
pub(super) const MEDIAN_SCALE: &str = "bonus.median_scale";

/// Computes the bonuses of one agent, and learns from its experience.
pub struct BonusModel {
    run_seed: u64,
    agent: u32,
    sharing: ModelSharing,
    scale: BonusScale,
    /// Factor on bonuses: the agent's place in a ladder of weights.
    weight_share: f32,
    medians: MedianScale,
    model: Box<dyn GainModel>,
    /// Gains of the agent's own steps in the latest update.
    own_gains: Vec<f32>,
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
        let config = bonus.config()?;
        let (sharing, scale) = (config.sharing(), config.scale());
        let model = config.build(stream_owner(sharing, context.agent), context);
        let medians = MedianScale::new(scale.medians());
        let (run_seed, agent) = (context.run_seed, context.agent);
        let weight_share = scale.weight_share(agent, context.team.count.get());
        Some(Self {
            run_seed,
            agent,
            sharing,
            scale,
            weight_share,
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
    pub(crate) fn compute_bonuses_of_pairs(
        &mut self,
        pairs: &TransitionPairs,
        random: &mut Stream,
        bonuses: &mut Vec<f32>,
    ) {
        let steps = Steps {
            episode: &pairs.episode,
            stride: 2,
            origin: &|step| pairs.origins[step / 2],
        };
        self.model.compute_gains(&steps, random, bonuses);
        self.scale_gains(bonuses);
    }

    fn compute_bonuses_where(
        &mut self,
        experience: &Experience<'_>,
        chosen_episodes: &[usize],
        bonuses: &mut Vec<Vec<f32>>,
        is_own: impl Fn(&Episode) -> bool,
    ) {
        self.begin_round(experience);
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

    /// Shows the model the new episodes that it depends on. Agents that share a model draw from the
    /// same random stream.
    fn begin_round(&mut self, experience: &Experience<'_>) {
        let episodes = self.episodes_of_model(experience.new_episodes);
        let owner = stream_owner(self.sharing, self.agent);
        let (purpose, round) = (Purpose::ReferenceStates, experience.earlier_updates);
        let mut random = stream(self.run_seed, purpose, owner, round);
        self.model.begin_round(&episodes, &mut random);
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
            *gain = self.weight_share * self.scale.bonus(*gain, median);
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

    /// Unscaled gain of every `stride`-th step of an episode.   `gains: [⌈T/stride⌉]`, overwritten
    pub(super) fn compute_gains(
        &mut self,
        episode: &Episode,
        stride: usize,
        random: &mut Stream,
        gains: &mut Vec<f32>,
    ) {
        let steps = Steps {
            episode,
            stride,
            origin: &|step| episode.origin(step),
        };
        self.model.compute_gains(&steps, random, gains);
    }

    /// Whether the team shares one model, which agent 0 trains.
    pub(crate) fn is_shared(&self) -> bool {
        self.sharing == ModelSharing::Shared
    }

    /// Whether the agent learns from, measures errors on, or compares states with all new episodes of
    /// the team.
    pub(crate) fn needs_all_episodes(&self) -> bool {
        match self.sharing {
            ModelSharing::Shared => self.agent == 0 || self.model.compares_new_episodes(),
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
        let data = TrainingData {
            all_episodes: &all_episodes,
            new_episodes: &new_episodes,
            is_frozen: self.sharing == ModelSharing::Frozen,
        };
        self.model.learn(&data, &mut random)
    }

    /// Copies what the model of another agent has learned, as far as bonuses depend on it.
    pub(crate) fn copy_learned(&mut self, trained: &Self) {
        self.model.copy_learned(&*trained.model);
    }

    /// The tensors of the model, named e.g. `bonus.inputs.mean`.
    fn model_tensors(&self) -> impl Iterator<Item = Tensor<'_>> {
        let tensors = self.model.tensors().into_iter();
        tensors.map(|tensor| tensor.prefixed("bonus."))
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
        let tensors = self.model.seed_tensors().into_iter();
        tensors.map(|tensor| tensor.prefixed("bonus."))
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.model.is_finite()
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
        self.model.save()
    }

    pub(crate) fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Saved<MedianScale> =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        self.medians = saved.medians;
        self.restore_model(&saved.model)
    }

    /// Continues from what [`save_model`](Self::save_model) wrote.
    pub(crate) fn restore_model(&mut self, bytes: &[u8]) -> Result<(), String> {
        self.model.restore(bytes)
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
