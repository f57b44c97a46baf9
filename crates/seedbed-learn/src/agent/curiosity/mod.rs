//! Curiosity: a bonus for steps from which there is something to learn, added to the rewards that
//! an agent learns from (thesis §4).
//!
//! Every agent holds its own replica of what is shared: trained on the same episodes with the same
//! draws, replicas are the same to the bit, so that episodes are the only communication. Formulas
//! are in [`rl`](crate::rl).

mod rnd;
mod transitions;
mod vime;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::rnd::Rnd;
pub use self::vime::{Gain, ModelBuffer, ModelSeeds, Vime};

use self::rnd::RndModel;
use self::vime::VimeModel;
use super::{AgentContext, PROBE_STEPS};
use crate::experience::{Episode, Experience};
use crate::nn::MedianScale;
use crate::rl::information_gain;
use seedbed_env::input::numbers::{Count, NonNegative, Positive, known, known_count};
use seedbed_env::random::{Purpose, Stream, stream};

/// What is added to rewards.
#[derive(Clone, Debug, Default, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Bonus {
    /// Nothing.
    #[default]
    None,
    /// Information gained about the dynamics: VIME (Houthooft et al. 2016), Seed-VIME (thesis Alg.
    /// 2).
    Vime(Vime),
    /// The error of predicting a random network (Burda et al. 2019).
    Rnd(Rnd),
}

/// Whose experience a model learns from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum ModelSharing {
    /// The team's: one model for all agents.
    #[default]
    Shared,
    /// The agent's own: one model per agent.
    Independent,
    /// None: the model stays as it began. A control.
    Frozen,
}

/// How a gain becomes a reward: η min(c, gain / mean of the latest medians).
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BonusScale {
    /// Weight η of the bonus.
    pub weight: NonNegative,
    /// Cap c of gains in units of their median.
    pub cap: Positive,
    /// Number of latest medians, one per update, by whose mean gains are divided.
    pub medians: Count<10_000>,
}

impl Default for BonusScale {
    fn default() -> Self {
        Self {
            weight: known(1e-3),
            cap: known(10.0),
            medians: known_count(10),
        }
    }
}

impl Bonus {
    /// Transitions that the shared buffer has to keep for it.
    #[must_use]
    pub fn transitions_kept(&self) -> u64 {
        match self {
            Self::Vime(Vime {
                buffer: ModelBuffer::Kept { transitions },
                ..
            }) => transitions.get().into(),
            Self::Vime(_) | Self::Rnd(_) | Self::None => 0,
        }
    }

    /// The largest bonus that a step can have: η c.
    #[must_use]
    pub fn largest(&self) -> Option<f32> {
        let scale = match self {
            Self::None => return None,
            Self::Vime(config) => config.scale,
            Self::Rnd(config) => config.scale,
        };
        Some(scale.weight.get_f32() * scale.cap.get_f32())
    }

    /// Whether agents have to learn at the same time from the same episodes for it.
    #[must_use]
    pub fn is_shared(&self) -> bool {
        self.model() == Some(ModelSharing::Shared)
    }

    /// Whether each agent has a model that learns from its own experience only.
    #[must_use]
    pub fn is_independent(&self) -> bool {
        self.model() == Some(ModelSharing::Independent)
    }

    fn model(&self) -> Option<ModelSharing> {
        match self {
            Self::None => None,
            Self::Vime(config) => Some(config.model),
            Self::Rnd(config) => Some(config.model),
        }
    }
}

/// One agent's curiosity.
pub(crate) struct Curiosity {
    run_seed: u64,
    agent: u32,
    sharing: ModelSharing,
    scale: BonusScale,
    medians: MedianScale,
    model: Model,
    /// Gains of the agent's own steps in the latest update.
    own_gains: Vec<f32>,
}

enum Model {
    Vime(Box<VimeModel>),
    Rnd(Box<RndModel>),
}

#[derive(Serialize, Deserialize)]
struct Saved<M> {
    medians: M,
    model: Vec<u8>,
}

impl Curiosity {
    pub(crate) fn new(bonus: &Bonus, member: &AgentContext<'_>) -> Option<Self> {
        let (sharing, scale) = match bonus {
            Bonus::None => return None,
            Bonus::Vime(config) => (config.model, config.scale),
            Bonus::Rnd(config) => (config.model, config.scale),
        };
        let owner = owner(sharing, member.agent);
        let model = match bonus {
            Bonus::Rnd(config) => Model::Rnd(Box::new(RndModel::new(config, owner, member))),
            Bonus::Vime(config) => Model::Vime(Box::new(VimeModel::new(config, owner, member))),
            Bonus::None => return None,
        };
        let medians = MedianScale::new(scale.medians.get() as usize);
        let (run_seed, agent) = (member.run_seed, member.agent);
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

    /// The bonus of every step of each chosen episode, as the model has it before it learns from
    /// them. Then the scale moves by the agent's own gains. `bonuses` has a list for each of the
    /// fresh episodes, empty for those that are not chosen.
    pub(crate) fn reward(
        &mut self,
        experience: &Experience<'_>,
        chosen: &[usize],
        bonuses: &mut Vec<Vec<f32>>,
    ) {
        let agent = self.agent;
        self.reward_where(experience, chosen, bonuses, |episode| {
            episode.agent == agent
        });
    }

    /// The same where all chosen episodes count as the agent's own.
    pub(crate) fn reward_own(
        &mut self,
        experience: &Experience<'_>,
        own: &[usize],
        bonuses: &mut Vec<Vec<f32>>,
    ) {
        self.reward_where(experience, own, bonuses, |_| true);
    }

    /// The bonus of every second step of `pairs`, as the model and the scale are now.
    pub(crate) fn bonuses_of_pairs(
        &mut self,
        pairs: &Episode,
        random: &mut Stream,
        bonuses: &mut Vec<f32>,
    ) {
        self.gains(pairs, 2, random, bonuses);
        self.scale_gains(bonuses);
    }

    fn reward_where(
        &mut self,
        experience: &Experience<'_>,
        chosen: &[usize],
        bonuses: &mut Vec<Vec<f32>>,
        is_own: impl Fn(&Episode) -> bool,
    ) {
        let mut random = stream(
            self.run_seed,
            Purpose::BonusNoise,
            self.agent,
            experience.round,
        );
        bonuses.resize_with(experience.fresh.len().max(bonuses.len()), Vec::new);
        bonuses.iter_mut().for_each(Vec::clear);
        self.own_gains.clear();
        for &place in chosen {
            let (episode, bonuses) = (&experience.fresh[place], &mut bonuses[place]);
            self.gains(episode, 1, &mut random, bonuses);
            if is_own(episode) {
                self.own_gains.extend_from_slice(bonuses);
            }
            self.scale_gains(bonuses);
        }
        self.medians.update(&mut self.own_gains);
    }

    /// Gains become bonuses, in place.
    fn scale_gains(&self, gains: &mut [f32]) {
        let (scale, cap, weight) = (
            self.medians.scale(),
            self.scale.cap.get_f32(),
            self.scale.weight.get_f32(),
        );
        for gain in gains {
            *gain = information_gain::bonus(*gain, scale, cap, weight);
        }
    }

    /// Raw gains of steps spread over an episode. Draws from a stream of its own, so that learning
    /// does not notice.
    pub(crate) fn probe_bonuses(&mut self, episode: &Episode, round: u32) -> Vec<f32> {
        let (mut random, mut gains) = (
            stream(self.run_seed, Purpose::BonusProbe, self.agent, round),
            Vec::new(),
        );
        self.gains(
            episode,
            episode.length().div_ceil(PROBE_STEPS).max(1),
            &mut random,
            &mut gains,
        );
        gains
    }

    /// The model learns, where it does; returns its mean squared error on the fresh episodes before
    /// that, in its own units.
    pub(crate) fn learn(&mut self, experience: &Experience<'_>) -> f32 {
        let owner = owner(self.sharing, self.agent);
        let mut random = stream(
            self.run_seed,
            Purpose::ModelTraining,
            owner,
            experience.round,
        );
        let mine = |episode: &&Episode| {
            self.sharing != ModelSharing::Independent || episode.agent == self.agent
        };
        let fresh: Vec<&Episode> = experience.fresh.iter().filter(mine).collect();
        let kept: Vec<&Episode> = experience.kept.iter().filter(mine).collect();
        let frozen = self.sharing == ModelSharing::Frozen;
        match &mut self.model {
            Model::Vime(model) => model.learn(&kept, &fresh, frozen, &mut random),
            Model::Rnd(model) => model.learn(&fresh, frozen, &mut random),
        }
    }

    pub(crate) fn is_finite(&self) -> bool {
        match &self.model {
            Model::Vime(model) => model.is_finite(),
            Model::Rnd(model) => model.is_finite(),
        }
    }

    pub(crate) fn save(&self) -> Vec<u8> {
        let model = match &self.model {
            Model::Vime(model) => model.save(),
            Model::Rnd(model) => model.save(),
        };
        postcard::to_stdvec(&Saved {
            medians: &self.medians,
            model,
        })
        .expect("plain numbers always serialise")
    }

    pub(crate) fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Saved<MedianScale> =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        self.medians = saved.medians;
        match &mut self.model {
            Model::Vime(model) => model.restore(&saved.model),
            Model::Rnd(model) => model.restore(&saved.model),
        }
    }

    /// Of every `stride`-th step.
    fn gains(
        &mut self,
        episode: &Episode,
        stride: usize,
        random: &mut Stream,
        gains: &mut Vec<f32>,
    ) {
        match &mut self.model {
            Model::Vime(model) => model.gains(episode, stride, random, gains),
            Model::Rnd(model) => model.gains(episode, stride, gains),
        }
    }
}

/// Whose streams a model draws from: the team's are agent 0's.
fn owner(sharing: ModelSharing, agent: u32) -> u32 {
    if sharing == ModelSharing::Shared {
        0
    } else {
        agent
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::TeamConfig;
    use seedbed_env::{Action, Choice, Quantity, Spec, Status};

    fn spec() -> Spec {
        let quantity = |name: &str| Quantity {
            name: name.to_owned(),
            unit: String::new(),
            range: [-1.0, 1.0],
        };
        Spec {
            observations: vec![quantity("x"), quantity("v")],
            actions: vec![Action {
                quantity: quantity("push"),
                choice: Choice::Continuous,
            }],
            ..Spec::new("test", Vec::new(), Vec::new())
        }
    }

    fn curiosity(bonus: &Bonus, agent: u32) -> Curiosity {
        let (team, spec) = (TeamConfig::default(), spec());
        let member = AgentContext {
            run_seed: 1,
            agent,
            team: &team,
            spec: &spec,
            record_advantages: false,
        };
        Curiosity::new(bonus, &member).unwrap()
    }

    fn vime(model: ModelSharing, seeds: ModelSeeds) -> Bonus {
        Bonus::Vime(Vime {
            model,
            seeds,
            ..Vime::default()
        })
    }

    /// A body pushed to and fro: x' = x + 0.1 v, v' = 0.9 v + a, with a sine of the agent's own for
    /// a.
    fn episode(agent: u32) -> Episode {
        let mut episode = Episode {
            outcome: Status::Truncated,
            ..Episode::start(agent, 0, 0, &spec())
        };
        let (mut x, mut v) = (0.0_f32, 0.0_f32);
        episode.observations.extend([x, v]);
        for step in 0..50 {
            let a = (step as f32 * (0.3 + 0.1 * agent as f32)).sin();
            (x, v) = (x + 0.1 * v, 0.9 * v + a);
            episode.observations.extend([x, v]);
            episode.actions.push(a);
            episode.rewards.push(0.0);
        }
        episode
    }

    fn learn(curiosity: &mut Curiosity, fresh: &[Episode], rounds: u32) -> Vec<f32> {
        (0..rounds)
            .map(|round| {
                curiosity.learn(&Experience {
                    fresh,
                    kept: fresh,
                    round,
                })
            })
            .collect()
    }

    fn gains(curiosity: &mut Curiosity, noise: u32) -> Vec<f32> {
        let mut gains = vec![];
        curiosity.gains(
            &episode(0),
            1,
            &mut stream(9, Purpose::BonusNoise, 0, noise),
            &mut gains,
        );
        gains
    }

    /// Replicas of a shared model stay the same to the bit; models of one's own do not.
    #[test]
    fn a_shared_model_is_the_same_for_all() {
        let fresh = [episode(0), episode(1)];
        for (sharing, same) in [
            (ModelSharing::Shared, true),
            (ModelSharing::Independent, false),
        ] {
            let [mut one, mut other] =
                [0, 1].map(|agent| curiosity(&vime(sharing, ModelSeeds::Off), agent));
            learn(&mut one, &fresh, 2);
            learn(&mut other, &fresh, 2);
            assert_eq!(
                gains(&mut one, 0) == gains(&mut other, 0),
                same,
                "{sharing:?}"
            );
        }
    }

    /// Under the same draws, seeds make agents give different bonuses. A fixed sample does not
    /// depend on the draw at all.
    #[test]
    fn seeds_make_agents_judge_differently() {
        for seeds in [
            ModelSeeds::Off,
            ModelSeeds::Scale,
            ModelSeeds::Shift,
            ModelSeeds::FixedSample,
        ] {
            let [mut one, mut other] =
                [0, 1].map(|agent| curiosity(&vime(ModelSharing::Shared, seeds), agent));
            assert_eq!(
                gains(&mut one, 0) == gains(&mut other, 0),
                seeds == ModelSeeds::Off,
                "{seeds:?}"
            );
            assert_eq!(
                gains(&mut one, 0) == gains(&mut one, 1),
                seeds == ModelSeeds::FixedSample,
                "{seeds:?}"
            );
        }
    }

    #[test]
    fn models_come_to_predict_unless_frozen() {
        let fresh = [episode(0), episode(1)];
        for (bonus, learns) in [
            (vime(ModelSharing::Shared, ModelSeeds::Off), true),
            (vime(ModelSharing::Frozen, ModelSeeds::Off), false),
            (
                Bonus::Vime(Vime {
                    buffer: ModelBuffer::Cleared,
                    ..Vime::default()
                }),
                true,
            ),
            (Bonus::Rnd(Rnd::default()), true),
            (
                Bonus::Rnd(Rnd {
                    model: ModelSharing::Frozen,
                    ..Rnd::default()
                }),
                false,
            ),
        ] {
            let errors = learn(&mut curiosity(&bonus, 0), &fresh, 20);
            // The first error is in the units before any moments.
            assert_eq!(
                errors[19] < 0.5 * errors[1],
                learns,
                "{bonus:?}: {errors:?}"
            );
        }
    }

    /// No bonus before there is a scale; afterwards the median gain is worth about η.
    #[test]
    fn bonuses_are_scaled_by_earlier_medians() {
        let mut curious = curiosity(&vime(ModelSharing::Shared, ModelSeeds::Off), 0);
        let fresh = [episode(0), episode(1)];
        let mut bonuses = vec![];
        let experience = |round| Experience {
            fresh: &fresh,
            kept: &fresh,
            round,
        };
        curious.reward(&experience(0), &[0, 1], &mut bonuses);
        assert!(
            bonuses
                .iter()
                .all(|bonuses| bonuses.len() == 50 && bonuses.iter().all(|&bonus| bonus == 0.0))
        );
        curious.reward(&experience(1), &[0], &mut bonuses);
        let mut sorted = bonuses[0].clone();
        sorted.sort_by(f32::total_cmp);
        assert!((2e-4..5e-3).contains(&sorted[25]), "{}", sorted[25]);
        assert!(sorted[49] <= 10.0 * 1e-3 && bonuses[1].is_empty());
    }

    #[test]
    fn a_restored_curiosity_goes_on_to_the_same_bits() {
        let fresh = [episode(0), episode(1)];
        for bonus in [
            vime(ModelSharing::Shared, ModelSeeds::Shift),
            Bonus::Rnd(Rnd::default()),
        ] {
            let [mut original, mut restored] = [0, 0].map(|agent| curiosity(&bonus, agent));
            original.reward(
                &Experience {
                    fresh: &fresh,
                    kept: &fresh,
                    round: 0,
                },
                &[0],
                &mut vec![],
            );
            learn(&mut original, &fresh, 2);
            restored.restore(&original.save()).unwrap();
            assert_eq!(restored.save(), original.save());
            assert_eq!(
                learn(&mut restored, &fresh, 3),
                learn(&mut original, &fresh, 3)
            );
            assert_eq!(gains(&mut restored, 0), gains(&mut original, 0));
            assert!(restored.restore(&[7]).is_err());
        }
    }
}
