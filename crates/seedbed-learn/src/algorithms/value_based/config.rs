//! The configurations of value-based learners: Q-learning, Seed TD (with seed LSVI and seed
//! ensembles) and bootstrapped DQN.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::exploration::Exploration;
use super::index::IndexSettings;
use super::{ValueTeam, choice_count};
use crate::agent::TeamConfig;
use crate::agent::action_selection::ActionSelection;
use crate::agent::bonus::Bonus;
use crate::agent::network::Network;
use crate::agent::network_info::{self, ModelInfo, NetworkInfo, OutputTerm, ScalingInfo};
use crate::algorithms::seed_pg::config::TimeLimit;
use crate::algorithms::{AlgorithmConfig, RandomActions, ScheduleError, ScheduleKind};
use crate::experience::replay::Replay;
use crate::nn::{Activation, AdamSettings};
use crate::scaling::ObservationScaling;
use crate::team::{Team, TeamContext};
use seedbed_env::TaskSpec;
use seedbed_input::numbers::{
    Count, Fraction, NonNegative, Positive, PositiveFraction, ranged_count, ranged_number,
};
use seedbed_input::{Located, ValidationError, short_located_list};

/// Q-learning from the team's replay buffer (thesis §1.4.1; Mnih et al. 2015).
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct QLearning {
    /// Whether the team shares one network or each agent has its own.
    pub networks: Networks,
    /// How actions are chosen from values.
    pub exploration: Exploration,
    /// Whether the learning network chooses the action that the target network evaluates (van
    /// Hasselt, Guez & Silver 2016).
    pub double: bool,
    /// Parameters that all value-based learners have.
    pub learning: Learning,
    /// Exploration bonus (intrinsic reward) that is added to the rewards of the environment.
    pub bonus: Located<Bonus>,
}

/// Seed TD, seed LSVI and seed ensembles (thesis §2.4; Dimakopoulou, Osband & Van Roy 2018): each
/// model perturbs the reward of each transition of the team's replay buffer by its own fixed seed,
/// drawn from `agents.seeds`.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SeedTd {
    /// Number of models.
    pub models: Models,
    /// How a model is fitted to the transitions of the replay buffer.
    pub fit: Located<Fit>,
    /// Weight λ of the regularization towards the model's initial parameters θ̂.
    pub regularization: NonNegative,
    /// Scale β of the prior: Q is the learned network plus β times a fixed random network (Osband,
    /// Aslanides & Cassirer 2018).
    pub prior_scale: NonNegative,
    /// How actions are chosen from values.
    pub exploration: Exploration,
    /// Whether the learning network chooses the action that the target network evaluates.
    pub double: bool,
    /// Parameters that all value-based learners have.
    pub learning: Learning,
    /// Exploration bonus (intrinsic reward) that is added to the rewards of the environment.
    pub bonus: Located<Bonus>,
}

/// Bootstrapped DQN with randomized prior functions (Osband et al. 2016, 2018): in each round, each
/// agent acts by a model that is drawn from one ensemble.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BootstrappedDqn {
    /// Number of models in the ensemble.
    pub models: Count<1000>,
    /// For whom a model is drawn in each round.
    pub draw: Draw,
    /// Scale β of the prior: Q is the learned network plus β times a fixed random network.
    pub prior_scale: NonNegative,
    /// Share of the transitions that each model learns from, chosen at random once per transition
    /// and model.
    pub mask: PositiveFraction,
    /// How actions are chosen from values.
    pub exploration: Exploration,
    /// Whether the learning network chooses the action that the target network evaluates.
    pub double: bool,
    /// Parameters that all value-based learners have.
    pub learning: Learning,
    /// Exploration bonus (intrinsic reward) that is added to the rewards of the environment.
    pub bonus: Located<Bonus>,
}

/// Whether the team shares one network or each agent has its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum Networks {
    /// One network for the team.
    Shared,
    /// One network per agent.
    Own,
}

/// For whom a model is drawn in each round.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum Draw {
    /// One model for each agent.
    Agent,
    /// One model for the whole team: a control without diversity.
    Team,
}

/// Number of models.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Models {
    /// One per agent.
    Own,
    /// One per agent, but at most `most`: agent k acts by model k mod `most`.
    Ensemble {
        /// Maximal number of models.
        #[serde(default = "default_ensemble")]
        most: Count<10_000>,
    },
}

/// How a model is fitted to the transitions of the replay buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Fit {
    /// By gradient steps towards the targets of a target network.
    Td,
    /// Least-squares value iteration at the end of every round, starting from θ̂: a sequence of
    /// regressions, the first on rewards alone, each further one on the values of the one before.
    Lsvi {
        /// Number of regressions, each of `learning.minibatches` gradient steps.
        iterations: Count<10_000>,
    },
}

/// Parameters that all value-based learners have.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Learning {
    /// Discount factor γ.
    pub discount: Fraction,
    /// Whether the time limit counts as the end of an episode.
    pub time_limit: TimeLimit,
    /// How observations are scaled for the networks.
    pub observations: ObservationScaling,
    /// Number of units of each hidden layer.
    #[serde(deserialize_with = "short_located_list")]
    pub hidden: Located<Vec<Count<4096>>>,
    /// Whether the observations are appended to the inputs of the output layer.
    pub skip_connection: bool,
    /// Maximal number of the team's transitions in the replay buffer.
    pub replay: Located<Count<100_000_000>>,
    /// Number of transitions per gradient step.
    pub minibatch: Located<Count<100_000>>,
    /// Number of gradient steps of each model each time it learns.
    pub minibatches: Count<1_000_000>,
    /// Number of gradient steps after which the learning network is copied to the target network.
    pub target_every: Count<100_000_000>,
    /// Maximal Euclidean norm of the gradient; `None`: no maximum.
    pub gradient_clip: Option<Positive>,
    /// Optimizer of the networks.
    pub optimizer: AdamSettings,
}

/// The settings of a [`ValueTeam`], which every configuration of a value-based learner provides.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Composition {
    /// Number of models.
    pub(super) models: usize,
    pub(super) assignment: ModelAssignment,
    /// Whether rewards are perturbed by reward seeds.
    pub(super) has_reward_seeds: bool,
    /// Share of the transitions that each model learns from.
    pub(super) mask: f32,
    /// Scale β of the fixed random network that is added to Q; 0 for none.
    pub(super) prior_scale: f32,
    pub(super) regularization: f32,
    pub(super) fit: Fit,
    /// How values depend on an index; `None`: not at all.
    pub(super) index: Option<IndexSettings>,
    pub(super) double: bool,
    pub(super) exploration: Exploration,
    pub(super) learning: Learning,
    pub(super) bonus: Bonus,
}

/// Which model an agent acts by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ModelAssignment {
    /// Agent k always acts by model k mod the number of models.
    Fixed,
    /// A model drawn at random for each agent and round.
    DrawnForAgent,
    /// A model drawn at random for each round, the same for all agents.
    DrawnForTeam,
}

impl ModelAssignment {
    /// The number of the model of an agent, for readers of the tensors.
    fn description(self) -> &'static str {
        match self {
            Self::Fixed => "agent % models",
            Self::DrawnForAgent => "drawn uniformly for each agent and round",
            Self::DrawnForTeam => "drawn uniformly for each round, the same for all agents",
        }
    }
}

/// The fields that the configurations of all value-based learners have.
pub(super) trait CommonFields {
    /// How actions are chosen from values.
    fn exploration(&self) -> Exploration;
    /// The same, to be replaced.
    fn exploration_mut(&mut self) -> &mut Exploration;
    /// Whether the learning network chooses the action that the target network evaluates.
    fn double(&self) -> bool;
    /// Parameters that all value-based learners have.
    fn learning(&self) -> &Learning;
    /// Exploration bonus.
    fn located_bonus(&self) -> &Located<Bonus>;
}

/// Implements [`CommonFields`] for a configuration.
macro_rules! has_common_fields {
    ($config:ty) => {
        impl CommonFields for $config {
            fn exploration(&self) -> Exploration {
                self.exploration
            }

            fn exploration_mut(&mut self) -> &mut Exploration {
                &mut self.exploration
            }

            fn double(&self) -> bool {
                self.double
            }

            fn learning(&self) -> &Learning {
                &self.learning
            }

            fn located_bonus(&self) -> &Located<Bonus> {
                &self.bonus
            }
        }
    };
}
pub(super) use has_common_fields;

has_common_fields!(QLearning);
has_common_fields!(SeedTd);
has_common_fields!(BootstrappedDqn);

/// The configuration of a value-based learner.
pub(super) trait ValueBased: CommonFields {
    /// The settings for a team of `agents`.
    fn compose(&self, agents: usize) -> Composition;

    /// Checks that models can learn during a round.
    fn check_lockstep(&self) -> Result<(), ValidationError> {
        Ok(())
    }

    /// Whether rewards are perturbed by reward seeds.
    fn has_reward_seeds(&self) -> bool {
        false
    }
}

impl<T: ValueBased> AlgorithmConfig for T {
    fn build(&self, context: &TeamContext<'_>) -> Box<dyn Team> {
        let agents = context.config.count.get() as usize;
        Box::new(ValueTeam::new(self.compose(agents), context))
    }

    fn check(&self) -> Result<(), ValidationError> {
        check_parameters(self.learning(), self.located_bonus())
    }

    fn check_schedule(&self, schedule: ScheduleKind) -> Result<(), ScheduleError> {
        match schedule {
            ScheduleKind::Synchronous { .. } => Ok(()),
            ScheduleKind::Lockstep => self.check_lockstep().map_err(ScheduleError::Parameter),
            ScheduleKind::Asynchronous => Err(ScheduleError::Algorithm(
                "value-based learners learn all at the same time; expected `schedule: Lockstep(…)` \
                 or `Synchronous(…)`, or `algorithm: SeedPg(…)`",
            )),
        }
    }

    fn random_actions(&self) -> RandomActions {
        RandomActions {
            are_correlated: matches!(self.exploration(), Exploration::EpsilonZGreedy { .. }),
            are_open_loop: false,
        }
    }

    fn check_team(&self, team: &TeamConfig) -> Result<(), ValidationError> {
        if self.has_reward_seeds() && !team.seeds.are_numbers() {
            return Err(team.seeds.error(
                "value-based learners draw a number for each transition; expected `Normal`, \
                 `Uniform`, `Laplace` or `TwoPoint`",
            ));
        }
        if team.same_initial.includes_policy() {
            return Err(team
                .same_initial
                .error("value-based learners have no policy network; expected `Off` or `Value`"));
        }
        Ok(())
    }

    fn check_task(&self, task: &TaskSpec) -> Result<(), String> {
        let message = |problem| {
            format!(
                "value-based learners need one discrete action, but {problem}; expected `SeedPg`, \
                 or a task with one discrete action"
            )
        };
        choice_count(task).map(|_| ()).map_err(message)
    }

    fn set_action_selection(&mut self, selection: ActionSelection) {
        let exploration = self.exploration_mut();
        *exploration = exploration.with_actions(selection);
    }

    fn bonus(&self) -> Option<&Bonus> {
        Some(self.located_bonus())
    }

    fn replay(&self) -> Option<&Located<Count<100_000_000>>> {
        Some(&self.learning().replay)
    }

    fn network_info(&self, task: &TaskSpec, agents: usize) -> Option<NetworkInfo> {
        let composition = self.compose(agents);
        let term = |network, factor| OutputTerm {
            network,
            factor,
            skip_connection: composition.learning.skip_connection,
        };
        let [value, prior] = match composition.index {
            None => ["model_{model}.value", "model_{model}.prior"],
            Some(_) => ["agent_{agent}.value", "agent_{agent}.prior"],
        };
        let terms = [term(value, 1.0), term(prior, composition.prior_scale)].into_iter();
        let models = ModelInfo {
            count: composition.models,
            model_of_agent: composition.assignment.description(),
        };
        Some(NetworkInfo {
            models: composition.index.is_none().then_some(models),
            outputs: terms.filter(|term| term.factor > 0.0).collect(),
            activation: Activation::Tanh,
            heads: network_info::action_value_heads(task),
            action_selection: network_info::setting_text(&composition.exploration),
            observation_scaling: ScalingInfo::new(composition.learning.observations, ""),
            value: None,
            bonus: composition.bonus.info(task, "model_{model}."),
        })
    }

    fn memory(&self, task: &TaskSpec, agents: u32, steps: u64) -> u64 {
        let composition = self.compose(agents as usize);
        let learning = &composition.learning;
        let choices = choice_count(task).unwrap_or(1);
        let outputs = composition.outputs(choices);
        let network = Network::memory(&super::network_shape(learning, task, outputs));
        // A target network, a prior and an initial state in addition.
        let model = network + network / 2 + composition.bonus.memory(task);
        let stored = steps.min(learning.replay.get().into());
        let replay = Replay::memory(stored, task.into());
        let indices = composition.index.map_or(0, |index| {
            // The value network and the prior for the index of each agent, as numbers and as bytes.
            let folded = super::network_shape(learning, task, choices).parameter_count() as u64;
            let saved = u64::from(agents).saturating_mul(2 * 8 * folded);
            saved.saturating_add(index.memory(learning.minibatch.get().into(), choices))
        });
        (composition.models as u64)
            .saturating_mul(model)
            .saturating_add(replay)
            .saturating_add(indices)
    }

    fn cost_per_step(&self, _: u32) -> f64 {
        30.0
    }
}

/// Checks that the parameters of a value-based learner fit together.
fn check_parameters(learning: &Learning, bonus: &Located<Bonus>) -> Result<(), ValidationError> {
    if learning.hidden.is_empty() {
        return Err(learning
            .hidden
            .error("has no layer; expected at least one, such as `hidden: [50, 50]`"));
    }
    check_replay(&learning.minibatch, &learning.replay)?;
    check_bonus(bonus)
}

/// Checks that a bonus suits agents which share all transitions.
pub(in crate::algorithms) fn check_bonus(bonus: &Located<Bonus>) -> Result<(), ValidationError> {
    if !bonus.can_be_frozen() && !bonus.has_shared_model() {
        return Err(bonus.error(format!(
            "value-based learners share all transitions, and `{}` has no model that could be frozen; expected \
             `model: Shared`",
            bonus.name()
        )));
    }
    Bonus::check(bonus)?;
    if bonus.has_independent_models() {
        return Err(bonus.error(
            "value-based learners share all transitions; expected `model: Shared` or `Frozen`",
        ));
    }
    Ok(())
}

/// Checks that a minibatch fits in the replay buffer. The error is at the one of both that is in the
/// file.
pub(in crate::algorithms) fn check_replay<const BATCH: u32, const CAPACITY: u32>(
    minibatch: &Located<Count<BATCH>>,
    replay: &Located<Count<CAPACITY>>,
) -> Result<(), ValidationError> {
    let (count, capacity) = (minibatch.get(), replay.get());
    if count <= capacity {
        return Ok(());
    }
    if minibatch.has_place() {
        return Err(minibatch.error(format!(
            "is larger than `replay`, which is {capacity}, so nothing would be learned; expected at most {capacity}"
        )));
    }
    Err(replay.error(format!(
        "is smaller than `minibatch`, which is {count} by default, so nothing would be learned; expected at least \
         {count}"
    )))
}

impl ValueBased for QLearning {
    fn compose(&self, agents: usize) -> Composition {
        Composition {
            models: if self.networks == Networks::Shared {
                1
            } else {
                agents
            },
            ..Composition::of_fields(self)
        }
    }
}

impl ValueBased for SeedTd {
    fn compose(&self, agents: usize) -> Composition {
        let max_models = match self.models {
            Models::Own => agents,
            Models::Ensemble { most } => most.get() as usize,
        };
        Composition {
            models: max_models.min(agents),
            has_reward_seeds: self.has_reward_seeds(),
            prior_scale: self.prior_scale.get_f32(),
            regularization: self.regularization.get_f32(),
            fit: *self.fit,
            ..Composition::of_fields(self)
        }
    }

    fn has_reward_seeds(&self) -> bool {
        true
    }

    fn check_lockstep(&self) -> Result<(), ValidationError> {
        match *self.fit {
            Fit::Lsvi { .. } => Err(self
                .fit
                .error("`Lsvi` learns at the end of a round; expected `schedule: Synchronous(…)`, or `fit: Td`")),
            Fit::Td => Ok(()),
        }
    }
}

impl ValueBased for BootstrappedDqn {
    fn compose(&self, _: usize) -> Composition {
        Composition {
            models: self.models.get() as usize,
            assignment: match self.draw {
                Draw::Agent => ModelAssignment::DrawnForAgent,
                Draw::Team => ModelAssignment::DrawnForTeam,
            },
            mask: self.mask.get_f32(),
            prior_scale: self.prior_scale.get_f32(),
            ..Composition::of_fields(self)
        }
    }
}

impl Composition {
    /// Number of outputs of a network that values `choices`.
    pub(super) fn outputs(&self, choices: usize) -> usize {
        let index = self.index.as_ref();
        index.map_or(choices, |index| index.outputs(choices))
    }

    /// One model without seeds, masks and priors, with the common fields of a configuration.
    pub(super) fn of_fields(config: &impl CommonFields) -> Self {
        Self {
            models: 1,
            assignment: ModelAssignment::Fixed,
            has_reward_seeds: false,
            mask: 1.0,
            prior_scale: 0.0,
            regularization: 0.0,
            fit: Fit::Td,
            index: None,
            double: config.double(),
            exploration: config.exploration(),
            learning: config.learning().clone(),
            bonus: config.located_bonus().value().clone(),
        }
    }
}

impl Exploration {
    /// The same exploration with another selection of actions.
    #[must_use]
    pub(super) fn with_actions(self, actions: ActionSelection) -> Self {
        match actions {
            ActionSelection::Sampled | ActionSelection::Correlated { .. } => self,
            ActionSelection::Tempered { temperature } => Self::Gibbs { temperature },
            ActionSelection::Greedy => Self::Greedy,
        }
    }
}

impl Default for QLearning {
    fn default() -> Self {
        Self {
            networks: Networks::Shared,
            exploration: Exploration::EpsilonGreedy {
                from: ranged_number(1.0),
                to: ranged_number(0.05),
                steps: ranged_count(10_000),
            },
            double: true,
            learning: Learning::default(),
            bonus: Bonus::None.into(),
        }
    }
}

impl Default for SeedTd {
    fn default() -> Self {
        Self {
            models: Models::Ensemble {
                most: default_ensemble(),
            },
            fit: Fit::Td.into(),
            regularization: ranged_number(0.0),
            prior_scale: ranged_number(3.0),
            exploration: Exploration::Greedy,
            double: false,
            learning: Learning::default(),
            bonus: Bonus::None.into(),
        }
    }
}

impl Default for BootstrappedDqn {
    fn default() -> Self {
        Self {
            models: ranged_count(10),
            draw: Draw::Agent,
            prior_scale: ranged_number(3.0),
            mask: ranged_number(0.5),
            exploration: Exploration::Greedy,
            double: true,
            learning: Learning::default(),
            bonus: Bonus::None.into(),
        }
    }
}

impl Default for Learning {
    fn default() -> Self {
        Self {
            discount: ranged_number(0.99),
            time_limit: TimeLimit::Bootstraps,
            observations: ObservationScaling::Range,
            hidden: vec![ranged_count(50); 2].into(),
            skip_connection: false,
            replay: ranged_count(1_000_000).into(),
            minibatch: ranged_count(16).into(),
            minibatches: ranged_count(1),
            target_every: ranged_count(100),
            gradient_clip: None,
            optimizer: AdamSettings::default(),
        }
    }
}

fn default_ensemble() -> Count<10_000> {
    ranged_count(30)
}
