//! The configuration of Seed-SAC.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::SoftTeam;
use crate::agent::TeamConfig;
use crate::agent::action_selection::ActionSelection;
use crate::agent::bonus::Bonus;
use crate::agent::critic::Critic;
use crate::agent::network::{Descent, Network};
use crate::agent::network_info::{ModelInfo, NetworkInfo, OutputTerm, ScalingInfo, setting_text};
use crate::agent::squashed_policy;
use crate::algorithms::seed_pg::config::TimeLimit;
use crate::algorithms::value_based::config::{check_bonus, check_replay};
use crate::algorithms::{AlgorithmConfig, ScheduleError, ScheduleKind};
use crate::experience::replay::Replay;
use crate::nn::{Activation, AdamSettings, Mlp};
use crate::rl::soft_actor_critic::Combination;
use crate::scaling::ObservationScaling;
use crate::team::{Team, TeamContext};
use seedbed_env::TaskSpec;
use seedbed_input::numbers::{
    Count, FiniteNumber, Fraction, NonNegative, Positive, PositiveFraction, ranged_count,
    ranged_number,
};
use seedbed_input::{Located, ValidationError, short_located_list};

/// Seed-SAC: soft actor-critic (Haarnoja et al. 2018) for continuous actions, with a fixed seed per
/// agent: each perturbs the rewards of the team's replay buffer by numbers drawn from agents.seeds. Its
/// column `entropy` is that of actions relative to half their ranges.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SeedSac {
    /// Whether each agent has a learner of its own or the team shares one.
    pub learners: Learners,
    /// Share of a minibatch that is drawn from the agent's own transitions; the rest is drawn from those of
    /// the whole team. 1: the agent learns from its own experience only.
    pub own_share: Located<Fraction>,
    /// Number of critics N of a learner.
    pub critics: Count<100>,
    /// Number of critics M, drawn again for each gradient step, whose smallest value is the target (REDQ,
    /// Chen et al. 2021).
    pub target_critics: Located<Count<100>>,
    /// How the values of the critics are combined for the policy.
    pub policy_value: Combination,
    /// Whether the hidden layers of critics are normalized (Ba, Kiros & Hinton 2016).
    pub layer_normalization: bool,
    /// Weight α of the policy's entropy.
    pub temperature: Temperature,
    /// Scale β of the prior: each critic is a learned network plus β times a fixed random network
    /// (Osband, Aslanides & Cassirer 2018).
    pub prior_scale: NonNegative,
    /// Weight λ of the regularization of all networks towards the agent's initial parameters.
    pub regularization: NonNegative,
    /// Discount factor γ.
    pub discount: Fraction,
    /// Number of rewards n in a target, before the value of the state that they lead to. The entropies of
    /// the steps between are left out.
    pub n_step: Count<1000>,
    /// Whether the time limit counts as the end of an episode.
    pub time_limit: TimeLimit,
    /// How observations are scaled for the networks.
    pub observations: ObservationScaling,
    /// How actions are chosen from the policy's distribution.
    pub actions: ActionSelection,
    /// Number of units of each hidden layer, the same for all networks.
    #[serde(deserialize_with = "short_located_list")]
    pub hidden: Located<Vec<Count<4096>>>,
    /// Function between the layers of all networks.
    pub activation: Activation,
    /// Number of the team's first steps in which actions are uniformly random and nothing is learned.
    pub random_steps: Count<1_000_000_000, 0>,
    /// Maximal number of the team's transitions in the replay buffer.
    pub replay: Located<Count<100_000_000>>,
    /// Number of transitions per gradient step.
    pub minibatch: Located<Count<100_000>>,
    /// Number of gradient steps of the critics each time a learner learns; if it learns after whole
    /// episodes, for each step of the longest episode.
    pub updates: Count<100_000>,
    /// Number of gradient steps of the critics for each one of the policy and the temperature.
    pub policy_every: Count<100_000>,
    /// Share τ by which target networks move towards the critics after each gradient step.
    pub target_rate: PositiveFraction,
    /// Maximal Euclidean norm of each network's gradient; `None`: no maximum.
    pub gradient_clip: Option<Positive>,
    /// Optimizer of the policy and of the temperature.
    pub policy_optimizer: AdamSettings,
    /// Optimizer of the critics.
    pub critic_optimizer: AdamSettings,
    /// Exploration bonus (intrinsic reward) that is added to the rewards of the environment.
    pub bonus: Located<Bonus>,
}

/// Whether each agent has a learner of its own or the team shares one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum Learners {
    /// One per agent.
    Own,
    /// One for the team, by whose policy all agents act: a control without diversity.
    Shared,
}

/// The weight α of the policy's entropy.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Temperature {
    /// α does not change.
    Fixed {
        /// Temperature α.
        alpha: NonNegative,
    },
    /// α is adjusted so that the entropy approaches a target (Haarnoja et al. 2018b): for agent k of K
    /// d (h + l k/(K − 1)) nats with d components of an action, entropy h and ladder l; an agent alone
    /// has d h.
    Automatic {
        /// Initial temperature α.
        #[serde(default = "default_temperature")]
        initial: Positive,
        /// Target h per component of an action, nats.
        #[serde(default = "default_entropy")]
        entropy: FiniteNumber,
        /// What the last agent's target has more than the first agent's, per component, nats.
        #[serde(default = "default_ladder")]
        ladder: FiniteNumber,
    },
}

impl AlgorithmConfig for SeedSac {
    fn build(&self, context: &TeamContext<'_>) -> Box<dyn Team> {
        Box::new(SoftTeam::new(self, context))
    }

    fn check(&self) -> Result<(), ValidationError> {
        if self.hidden.is_empty() {
            return Err(self
                .hidden
                .error("has no layer; expected at least one, such as `hidden: [256, 256]`"));
        }
        let critics = self.critics.get();
        if self.target_critics.get() > critics {
            return Err(self
                .target_critics
                .error(format!("expected at most `critics`, which is {critics}")));
        }
        if self.learners == Learners::Shared && self.own_share.get() > 0.0 {
            return Err(self.own_share.error(
                "a learner that the team shares has no transitions of its own; expected 0, or `learners: Own`",
            ));
        }
        check_replay(&self.minibatch, &self.replay)?;
        check_bonus(&self.bonus)
    }

    fn check_schedule(&self, schedule: ScheduleKind) -> Result<(), ScheduleError> {
        match schedule {
            ScheduleKind::Synchronous { .. } | ScheduleKind::Lockstep => Ok(()),
            ScheduleKind::Asynchronous => Err(ScheduleError::Algorithm(
                "all agents learn at the same time from one replay buffer; expected \
                 `schedule: Lockstep(…)` or `Synchronous(…)`",
            )),
        }
    }

    fn check_team(&self, team: &TeamConfig) -> Result<(), ValidationError> {
        if team.seeds.are_numbers() {
            return Ok(());
        }
        Err(team.seeds.error(
            "`SeedSac` draws a number for each transition; expected `Normal`, `Uniform`, `Laplace` or \
             `TwoPoint`",
        ))
    }

    fn check_task(&self, task: &TaskSpec) -> Result<(), String> {
        let fault = squashed_policy::fault_of_actions(task);
        fault.map_or(Ok(()), |fault| {
            Err(format!(
                "`SeedSac` needs continuous actions, but {fault}; expected `SeedPg` or a value-based \
                 learner, or a task with continuous actions only"
            ))
        })
    }

    fn set_action_selection(&mut self, selection: ActionSelection) {
        self.actions = selection;
    }

    fn bonus(&self) -> Option<&Bonus> {
        Some(&self.bonus)
    }

    fn replay(&self) -> Option<&Located<Count<100_000_000>>> {
        Some(&self.replay)
    }

    fn network_info(&self, task: &TaskSpec, agents: usize) -> Option<NetworkInfo> {
        Some(NetworkInfo {
            models: Some(ModelInfo {
                count: self.learner_count(agents),
                model_of_agent: "agent % models",
            }),
            outputs: vec![OutputTerm {
                network: "model_{model}.policy",
                factor: 1.0,
                skip_connection: false,
            }],
            activation: self.activation,
            heads: squashed_policy::heads(task),
            action_selection: setting_text(&self.actions),
            observation_scaling: ScalingInfo::new(self.observations, ""),
            value: None,
            bonus: self.bonus.info(task, "model_{model}."),
        })
    }

    fn memory(&self, task: &TaskSpec, agents: u32, steps: u64) -> u64 {
        let (policy, critic) = (self.policy_shape(task), self.critic_shape(task));
        let critics = u64::from(self.critics.get());
        let units: u64 = self.hidden.iter().map(|units| u64::from(units.get())).sum();
        // Outputs of hidden layers: of the policy before and after each step, and of critics.
        let outputs = 4 * u64::from(self.minibatch.get()) * units * (critics + 4);
        let networks = Network::memory(&policy) + critics * Critic::memory(&critic);
        let learner = networks + outputs + self.bonus.memory(task);
        let stored = steps.min(self.replay.get().into());
        (self.learner_count(agents as usize) as u64)
            .saturating_mul(learner)
            .saturating_add(Replay::memory(stored, task.into()))
    }

    fn cost_per_step(&self, _: u32) -> f64 {
        300.0
    }
}

impl SeedSac {
    pub(super) fn learner_count(&self, agents: usize) -> usize {
        match self.learners {
            Learners::Own => agents,
            Learners::Shared => 1,
        }
    }

    fn hidden_units(&self) -> Vec<usize> {
        let units = self.hidden.iter();
        units.map(|units| units.get() as usize).collect()
    }

    pub(super) fn policy_shape(&self, task: &TaskSpec) -> Mlp {
        squashed_policy::network_shape(task, &self.hidden_units(), self.activation)
    }

    pub(super) fn critic_shape(&self, task: &TaskSpec) -> Mlp {
        let mut sizes = vec![task.observation_width() + task.action_width()];
        sizes.extend(self.hidden_units());
        sizes.push(1);
        let mlp = Mlp::new(&sizes).with_activation(self.activation);
        if self.layer_normalization {
            mlp.with_layer_normalization()
        } else {
            mlp
        }
    }

    pub(super) fn descent(&self) -> Descent {
        Descent {
            regularization: self.regularization.get_f32(),
            gradient_clip: self.gradient_clip.map(Positive::get_f32),
            step_size_factor: 1.0,
        }
    }
}

impl Default for SeedSac {
    fn default() -> Self {
        let optimizer = AdamSettings {
            step_size: ranged_number(3e-4),
            ..AdamSettings::default()
        };
        Self {
            learners: Learners::Own,
            own_share: ranged_number::<Fraction>(0.0).into(),
            critics: ranged_count(2),
            target_critics: ranged_count(2).into(),
            policy_value: Combination::Min,
            layer_normalization: false,
            temperature: Temperature::Automatic {
                initial: default_temperature(),
                entropy: default_entropy(),
                ladder: default_ladder(),
            },
            prior_scale: ranged_number(0.0),
            regularization: ranged_number(0.0),
            discount: ranged_number(0.99),
            n_step: ranged_count(1),
            time_limit: TimeLimit::Bootstraps,
            observations: ObservationScaling::Range,
            actions: ActionSelection::Sampled,
            hidden: vec![ranged_count(256); 2].into(),
            activation: Activation::Relu,
            random_steps: ranged_count(1000),
            replay: ranged_count(1_000_000).into(),
            minibatch: ranged_count(256).into(),
            updates: ranged_count(1),
            policy_every: ranged_count(1),
            target_rate: ranged_number(0.005),
            gradient_clip: None,
            policy_optimizer: optimizer,
            critic_optimizer: optimizer,
            bonus: Bonus::None.into(),
        }
    }
}

fn default_temperature() -> Positive {
    ranged_number(1.0)
}

fn default_entropy() -> FiniteNumber {
    ranged_number(-1.0)
}

fn default_ladder() -> FiniteNumber {
    ranged_number(0.0)
}
