//! Exploration bonuses: intrinsic rewards for informative or novel steps, added to the rewards that
//! an agent learns from (thesis §4).
//!
//! A bonus is one file with its configuration, which implements `BonusConfig`, and its model, which
//! implements `GainModel`, and one line in the list [below](Bonus). Every agent has a model of its
//! own to compute bonuses with ([`BonusModel`]). If the team shares one model, agent 0 trains it, and
//! the others copy what it has learned. Formulas are in [`rl`](crate::rl).

mod discriminator;
mod model;
mod pairs;
mod regions;
mod rnd;
mod scale;
mod scaled_states;
mod team_entropy;
mod vime;

use std::any::Any;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::discriminator::Discriminator;
pub use self::model::BonusModel;
pub(crate) use self::pairs::TransitionPairs;
pub use self::regions::Regions;
pub use self::rnd::Rnd;
pub use self::scale::{BonusScale, ModelSharing};
pub use self::team_entropy::TeamEntropy;
pub use self::vime::{Gain, ModelBuffer, ModelSeeds, Vime};

use self::model::MEDIAN_SCALE;
use super::AgentContext;
use super::dynamics::transitions::TransitionEncoder;
use super::network_info::{BonusInfo, setting_text};
use crate::experience::Episode;
use crate::experience::replay::Origin;
use crate::nn::Tensor;
use seedbed_env::TaskSpec;
use seedbed_input::{Located, ValidationError};
use seedbed_random::Stream;

/// What the configuration of a bonus provides. Its parameters are documented by the doc comments of
/// its fields.
pub(crate) trait BonusConfig {
    /// Whose experience the model learns from.
    fn sharing(&self) -> ModelSharing;

    /// How gains are scaled to bonuses.
    fn scale(&self) -> BonusScale;

    /// The model of one agent, which has not learned yet. What agents share is drawn from the random
    /// streams of agent `owner`.
    fn build(&self, owner: u32, context: &AgentContext<'_>) -> Box<dyn GainModel>;

    /// Approximate number of bytes that the model of one agent needs.
    fn memory(&self, spec: &TaskSpec) -> u64;

    /// How gains are computed from the [tensors](GainModel::tensors) of the model, for their readers.
    fn formula(&self) -> String;

    /// Names of the inputs of the model, for readers of its tensors.
    fn inputs(&self, spec: &TaskSpec) -> Vec<String> {
        TransitionEncoder::input_names(spec)
    }

    /// What is wrong with the parameters, if they do not fit together.
    fn fault(&self) -> Option<&'static str> {
        None
    }

    /// Whether gains depend on nothing but the model and the step: neither on seeds of the agent nor
    /// on random draws.
    fn is_deterministic(&self) -> bool {
        false
    }

    /// Whether the model could be [frozen](ModelSharing::Frozen).
    fn can_be_frozen(&self) -> bool {
        true
    }

    /// Number of the team's newest transitions that the shared buffer must keep for training the
    /// model.
    fn transitions_kept(&self) -> u64 {
        0
    }
}

/// The model of a bonus, from which one agent computes gains.
pub(crate) trait GainModel: Any + Send + Sync {
    /// Prepares to compute the gains of a round: `new_episodes` are its episodes that the model depends
    /// on. Models that agents share draw from the same random stream.
    fn begin_round(&mut self, _new_episodes: &[&Episode], _random: &mut Stream) {}

    /// Computes the unscaled gains of steps.   `gains: [⌈T/stride⌉]`, overwritten
    fn compute_gains(&mut self, steps: &Steps<'_>, random: &mut Stream, gains: &mut Vec<f32>);

    /// Trains the model, unless it is frozen. Returns its mean squared error on the new episodes
    /// before training, in the units of its targets; `None` (the default) without targets.
    fn learn(&mut self, _data: &TrainingData<'_>, _random: &mut Stream) -> Option<f32> {
        None
    }

    /// Whether copies of a shared model need all new episodes, too: see
    /// [`begin_round`](Self::begin_round).
    fn compares_new_episodes(&self) -> bool {
        false
    }

    /// Copies what a model of the same kind has learned, as far as gains depend on it.
    fn copy_learned(&mut self, trained: &dyn GainModel);

    /// The tensors of the model, named e.g. `inputs.mean`.
    fn tensors(&self) -> Vec<Tensor<'_>>;

    /// The agent's seeds of the model, named e.g. `seeds.layer_0.weight`, if there are any.
    fn seed_tensors(&self) -> Vec<Tensor<'_>> {
        Vec::new()
    }

    /// Whether every learned number is finite.
    fn is_finite(&self) -> bool;

    /// What the model has learned, as bytes.
    fn save(&self) -> Vec<u8>;

    /// Continues from what [`save`](Self::save) wrote.
    ///
    /// # Errors
    /// What is wrong if the bytes are not of such a model.
    fn restore(&mut self, bytes: &[u8]) -> Result<(), String>;
}

/// Every `stride`-th step of an episode.
pub(crate) struct Steps<'a> {
    pub(crate) episode: &'a Episode,
    pub(crate) stride: usize,
    /// Which step of which episode a step of `episode` was.
    pub(crate) origin: &'a dyn Fn(usize) -> Origin,
}

/// The episodes that a model learns from.
pub(crate) struct TrainingData<'a> {
    /// All that are still in the buffer.
    pub(crate) all_episodes: &'a [&'a Episode],
    /// Those that the model has not learned from.
    pub(crate) new_episodes: &'a [&'a Episode],
    /// Whether the model keeps its initial parameters.
    pub(crate) is_frozen: bool,
}

/// The model of another agent, as the type that it has.
fn same_kind<M: GainModel>(other: &dyn GainModel) -> &M {
    let other: &dyn Any = other;
    let other = other.downcast_ref();
    other.expect("all agents of a team have the same kind of model")
}

/// Defines the enum of all bonuses, with the only `match` over them.
macro_rules! bonuses {
    ($($name:ident,)*) => {
        /// Exploration bonus (intrinsic reward) that is added to the rewards of the environment.
        #[derive(Clone, Debug, Default, PartialEq, JsonSchema, Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub enum Bonus {
            /// No bonus.
            #[default]
            None,
            $(
                #[allow(missing_docs, reason = "`seedbed list` shows the text of the configuration")]
                $name($name),
            )*
        }

        impl Bonus {
            /// The configuration; none without a bonus.
            fn config(&self) -> Option<&dyn BonusConfig> {
                match self {
                    Self::None => None,
                    $(Self::$name(config) => Some(config),)*
                }
            }

            /// The name of the bonus in scenarios.
            pub(crate) fn name(&self) -> &'static str {
                match self {
                    Self::None => "None",
                    $(Self::$name(_) => stringify!($name),)*
                }
            }
        }
    };
}

bonuses! {
    Vime,
    Rnd,
    TeamEntropy,
    Regions,
    Discriminator,
}

/// Whether an algorithm pays for more than rewards of the environment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum PaidFor {
    /// Nothing more.
    #[default]
    Nothing,
    /// A bonus of a model that learns what is new.
    New,
    /// A bonus of a model that never learns: what is new pays as much as what is known, and so does acting on.
    Any,
}

impl Bonus {
    /// What the bonus pays for.
    #[must_use]
    pub fn paid_for(&self) -> PaidFor {
        match self.sharing() {
            None => PaidFor::Nothing,
            Some(ModelSharing::Frozen) => PaidFor::Any,
            Some(ModelSharing::Shared | ModelSharing::Independent) => PaidFor::New,
        }
    }

    /// Number of the team's newest transitions that the shared buffer must keep for training the
    /// model.
    #[must_use]
    pub fn transitions_kept(&self) -> u64 {
        self.config().map_or(0, BonusConfig::transitions_kept)
    }

    /// Approximate number of bytes that the model of one agent needs.
    pub(crate) fn memory(&self, spec: &TaskSpec) -> u64 {
        self.config().map_or(0, |config| config.memory(spec))
    }

    /// The largest bonus that figures show: the largest that a step can have, if there is one. None
    /// without a bonus.
    #[must_use]
    pub fn largest_bonus(&self) -> Option<f32> {
        self.config().map(|config| config.scale().largest_shown())
    }

    /// Checks that the parameters fit together.
    pub(crate) fn check(bonus: &Located<Self>) -> Result<(), ValidationError> {
        let fault = bonus.config().and_then(BonusConfig::fault);
        fault.map_or(Ok(()), |fault| Err(bonus.error(fault)))
    }

    /// Whether all agents must learn at the same time from the same episodes, because they share
    /// one model.
    #[must_use]
    pub fn has_shared_model(&self) -> bool {
        self.sharing() == Some(ModelSharing::Shared)
    }

    /// Whether all agents give the same bonus to the same step, apart from its weight, whatever they have learned: they share a
    /// model that has neither seeds nor random draws.
    #[must_use]
    pub fn is_same_for_all_agents(&self) -> bool {
        self.has_shared_model() && self.config().is_some_and(BonusConfig::is_deterministic)
    }

    /// Whether the model could be [frozen](ModelSharing::Frozen); true without a bonus.
    pub(crate) fn can_be_frozen(&self) -> bool {
        self.config().is_none_or(BonusConfig::can_be_frozen)
    }

    /// Whether each agent has a model that learns from its own experience only.
    #[must_use]
    pub fn has_independent_models(&self) -> bool {
        self.sharing() == Some(ModelSharing::Independent)
    }

    /// How the tensors of the model are used; none without a bonus. `owner` is the first part of the
    /// names of tensors of a model that is not shared, such as `agent_{agent}.`.
    pub(crate) fn info(&self, spec: &TaskSpec, owner: &str) -> Option<BonusInfo> {
        let config = self.config()?;
        let model_owner = if self.has_shared_model() {
            SHARED_OWNER
        } else {
            owner
        };
        let scale = config.scale();
        let median_scale = scale.uses_medians();
        Some(BonusInfo {
            kind: self.name(),
            model: format!("{model_owner}bonus"),
            inputs: config.inputs(spec),
            formula: config.formula(),
            median_scale: median_scale.then(|| format!("{owner}{MEDIAN_SCALE}")),
            scale: setting_text(&scale),
        })
    }

    fn sharing(&self) -> Option<ModelSharing> {
        self.config().map(BonusConfig::sharing)
    }
}

/// First part of the names of the tensors of a model that the team shares.
pub(crate) const SHARED_OWNER: &str = "team.";

#[cfg(test)]
mod tests;
