//! Agents, which act in one copy of an environment and learn from the team's shared experience.
//!
//! [`Agent`] is the trait. The modules are the parts of agents: policies, networks, models of
//! the dynamics, planning in them, exploration bonuses. Implementations are
//! in [`algorithms`](crate::algorithms). This module must not depend on files, threads or
//! recordings.

pub(crate) mod action_random;
pub mod action_selection;
pub mod bonus;
pub(crate) mod critic;
pub(crate) mod dynamics;
pub(crate) mod network;
pub mod network_info;
pub(crate) mod planning;
pub(crate) mod policy;
#[cfg(test)]
mod policy_reference;
pub(crate) mod squashed_policy;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::action_random::ActionRandom;
use self::bonus::BonusModel;
use self::planning::PlanningBuffers;
use crate::experience::{Episode, EpisodeInfo, Experience, StepData};
use crate::nn::{Activations, Initial, Tensor};
use crate::seed::{RewardSeeds, SameInitial};
use seedbed_env::TaskSpec;
use seedbed_input::Located;
use seedbed_input::numbers::{Count, ranged_count, ranged_number};

/// One of K agents. `act` takes `&self` and `update` takes an `&Experience`, so that agents can act
/// in parallel, and can learn in parallel from the same episodes.
pub trait Agent: Send + Sync {
    /// Chooses an action, and writes the log-probability of each of its components.
    /// `observation: [observation width]` → `action`, `log_prob`: `[action width]`
    fn act(
        &self,
        observation: &[f32],
        random: &mut ActionRandom,
        scratch: &mut ActScratch,
        action: &mut [f32],
        log_prob: &mut [f32],
    );

    /// Learns from the team's episodes.
    fn update(&mut self, experience: &Experience<'_>) -> Update;

    /// Indices of the new episodes that the agent will learn from in its update number
    /// `earlier_updates`, in any order; it needs no steps of the others. `None` (the default): all.
    fn choose_episodes(
        &self,
        _new_episodes: &[EpisodeInfo],
        _earlier_updates: u32,
    ) -> Option<Vec<usize>> {
        None
    }

    /// Unscaled bonuses of at most [`PROBE_STEPS`] steps of an episode under the agent's present
    /// bonus model; empty if the agent has no bonus.
    fn probe_bonuses(&mut self, _episode: &Episode, _round: u32) -> Vec<f32> {
        Vec::new()
    }

    /// The agent's bonus model, if the team shares one model. Agent 0 trains it.
    fn shared_bonus_model(&self) -> Option<&BonusModel> {
        None
    }

    /// The same model, to copy what agent 0 has learned.
    fn shared_bonus_model_mut(&mut self) -> Option<&mut BonusModel> {
        None
    }

    /// Whether every learned number is finite.
    fn is_finite(&self) -> bool;

    /// The parameters of the agent's networks, such as `policy.layer_0.weight`.
    fn tensors(&self) -> Vec<Tensor<'_>>;

    /// The tensors of the bonus model, such as `bonus.inputs.mean`, if the team shares one model;
    /// the same for all agents.
    fn shared_tensors(&self) -> Vec<Tensor<'_>> {
        Vec::new()
    }

    /// The agent seed: `reward_seeds` and the initial parameters of networks, such as
    /// `initial.policy.layer_0.weight`. Empty if the agent has none.
    fn initial_tensors(&self) -> Vec<Tensor<'_>> {
        Vec::new()
    }

    /// Everything that learning changed, as bytes.
    fn save(&self) -> Vec<u8>;

    /// Continues from what [`save`](Self::save) wrote.
    ///
    /// # Errors
    /// What is wrong if the bytes are not of such an agent.
    fn restore(&mut self, bytes: &[u8]) -> Result<(), String>;
}

/// Maximal number of steps of an episode for which the bonuses of agents are compared.
pub const PROBE_STEPS: usize = 64;

/// The number of agents, and how they differ from each other at the start.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TeamConfig {
    /// Number of agents K.
    pub count: Count<100_000>,
    /// What each agent adds to rewards: by default numbers that are drawn once per run.
    pub seeds: Located<RewardSeeds>,
    /// How networks are initialized.
    pub initial: Initial,
    /// Which initial parameters are the same for all agents.
    pub same_initial: Located<SameInitial>,
}

impl Default for TeamConfig {
    fn default() -> Self {
        Self {
            count: ranged_count(4),
            seeds: RewardSeeds::Normal {
                sigma: ranged_number(0.1),
            }
            .into(),
            initial: Initial::Random,
            same_initial: SameInitial::Off.into(),
        }
    }
}

/// What an agent of a team is built from.
#[derive(Clone, Copy, Debug)]
pub struct AgentContext<'a> {
    /// The run seed.
    pub run_seed: u64,
    /// The agent's number, from 0.
    pub agent: u32,
    /// The configuration of its team.
    pub team: &'a TeamConfig,
    /// The task.
    pub spec: &'a TaskSpec,
    /// Whether updates return [advantages](crate::experience::StepData::advantages). Must not
    /// change what is learned.
    pub record_advantages: bool,
}

/// Buffers for one forward pass, reused from step to step; one per thread that acts.
#[derive(Debug, Default)]
pub struct ActScratch {
    pub(crate) state: Vec<f32>,
    pub(crate) activations: Activations,
    pub(crate) outputs: Vec<f32>,
    pub(crate) values: ValueScratch,
    pub(crate) planning: PlanningBuffers,
}

/// Buffers for the values of the agents that act by one value model.
#[derive(Debug, Default)]
pub(crate) struct ValueScratch {
    /// Observations of the agents.
    pub(crate) observations: Vec<f32>,
    /// The same, scaled.
    pub(crate) scaled: Vec<f32>,
    /// Values of all choices of each agent of a group: `[agents × choices]`.
    pub(crate) values: Vec<f32>,
    /// Values of all choices of one agent.
    pub(crate) row: Vec<f32>,
    pub(crate) model: ValueBuffers,
}

/// Buffers for the values of many states.
#[derive(Debug, Default)]
pub(crate) struct ValueBuffers {
    pub(crate) activations: Activations,
    pub(crate) values: Vec<f32>,
}

/// The result of one agent's update.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Update {
    /// Statistics of the update.
    pub report: UpdateReport,
    /// Intrinsic rewards and advantages of the steps of the agent's own new episodes. Episodes
    /// that have neither may be missing.
    pub step_data: Vec<StepData>,
}

impl From<UpdateReport> for Update {
    fn from(report: UpdateReport) -> Self {
        Self {
            report,
            ..Self::default()
        }
    }
}

/// Statistics of one update: means over all samples that were trained on. `None` if the algorithm
/// does not have the quantity, or if the update trained on no sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct UpdateReport {
    /// ½ mean squared error of the value function against its normalized targets.
    pub value_loss: Option<f32>,
    /// Number of gradient steps of the agent's networks. Steps of networks that agents share are
    /// counted for agent 0 only.
    pub gradient_steps: Option<u32>,
    /// Mean surrogate loss of the policy.
    pub policy_loss: Option<f32>,
    /// Mean deviation of importance ratios from 1, plus 1: mean |ρ − 1| + 1.
    pub ratio_deviation: Option<f32>,
    /// The largest importance ratio ρ.
    pub largest_ratio: Option<f32>,
    /// Share of samples whose policy gradient is 0 because of clipping.
    pub clipped_fraction: Option<f32>,
    /// Mean entropy of the policy, nats.
    pub entropy: Option<f32>,
    /// Mean bonus per step of the agent's own episodes.
    pub intrinsic_reward: Option<f32>,
    /// Mean squared error of the bonus model on new episodes, before it learned from them.
    pub prediction_error: Option<f32>,
    /// Mean rank correlation between the bonuses that pairs of agents compute for the same steps;
    /// the same for the whole team. None if fewer than two agents compute bonuses.
    pub bonus_agreement: Option<f32>,
}
