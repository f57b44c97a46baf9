//! Agents: what acts in one copy of an environment and learns from the team's shared experience.
//!
//! [`Agent`] is the trait; the other modules are what agents are made of: policies, networks,
//! the scaling of observations, curiosity. Which agents there are is in
//! [`algorithms`](crate::algorithms). Must not depend on files, threads or recordings.

pub mod curiosity;
pub(crate) mod network;
pub mod policy;
#[cfg(test)]
mod policy_reference;
pub mod scaling;

use std::borrow::Cow;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experience::{Episode, Experience, StepData};
use crate::nn::{Activations, Initial};
use crate::seed::SeedDistribution;
use seedbed_env::Spec;
use seedbed_env::input::numbers::{Count, known, known_count};
use seedbed_env::random::Stream;

/// One of K agents. `act` takes `&self` and `update` takes an `&Experience`: agents may act at
/// once, and may learn at once from episodes that nobody changes meanwhile.
pub trait Agent: Send + Sync {
    /// Chooses an action, and says how likely each of its components was.
    /// `observation: [observation width]` → `action`, `log_prob`: `[action width]`
    fn act(
        &self,
        observation: &[f32],
        random: &mut Stream,
        scratch: &mut ActScratch,
        action: &mut [f32],
        log_prob: &mut [f32],
    );

    /// Learns from what the team has experienced.
    fn update(&mut self, experience: &Experience<'_>) -> Update;

    /// Unscaled bonuses of at most [`PROBE_STEPS`] steps of an episode, as the agent's curiosity
    /// gives them now; empty without curiosity.
    fn probe_bonuses(&mut self, _episode: &Episode, _round: u32) -> Vec<f32> {
        Vec::new()
    }

    /// Whether every learned number is finite.
    fn is_finite(&self) -> bool;

    /// The parameters of the agent's networks, named.
    fn tensors(&self) -> Vec<Tensor<'_>>;

    /// Everything that learning changed, as bytes.
    fn save(&self) -> Vec<u8>;

    /// Continues from what [`save`](Self::save) wrote.
    ///
    /// # Errors
    /// What is wrong if the bytes are not of such an agent.
    fn restore(&mut self, bytes: &[u8]) -> Result<(), String>;
}

/// Maximal number of steps of an episode for which agents compute bonuses to compare them.
pub const PROBE_STEPS: usize = 64;

/// The team: how many agents, and how they differ from the start.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TeamConfig {
    /// Number of agents K.
    pub count: Count<10_000>,
    /// Distribution of each agent's own perturbations of rewards, drawn once.
    pub seeds: SeedDistribution,
    /// Initial parameters of networks.
    pub initial: Initial,
}

impl Default for TeamConfig {
    fn default() -> Self {
        Self {
            count: known_count(4),
            seeds: SeedDistribution::Normal { sigma: known(0.1) },
            initial: Initial::Random,
        }
    }
}

/// Who is being built: one agent of a team in one run.
#[derive(Clone, Copy, Debug)]
pub struct AgentContext<'a> {
    /// The run's seed.
    pub run_seed: u64,
    /// The agent's number, from 0.
    pub agent: u32,
    /// The team it belongs to.
    pub team: &'a TeamConfig,
    /// The task.
    pub spec: &'a Spec,
    /// Whether updates return [advantages](StepData::advantages). What is learned is the same.
    pub record_advantages: bool,
}

/// Room for one forward pass at a time; one for each thread that acts.
#[derive(Debug, Default)]
pub struct ActScratch {
    pub(crate) state: Vec<f32>,
    pub(crate) activations: Activations,
    pub(crate) outputs: Vec<f32>,
}

/// The result of one agent's update.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Update {
    /// What it was like.
    pub report: UpdateReport,
    /// What it computed for the steps of the agent's own fresh episodes; episodes for which it
    /// computed nothing may be missing.
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

/// What one update was like: means over all that was trained on. `None` is what the algorithm does
/// not have, or what this update trained nothing of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UpdateReport {
    /// ½ mean squared error against the normalized target.
    pub value_loss: Option<f32>,
    /// Mean surrogate loss.
    pub policy_loss: Option<f32>,
    /// Mean |ρ − 1| + 1.
    pub ratio_deviation: Option<f32>,
    /// The largest ρ.
    pub largest_ratio: Option<f32>,
    /// Share of samples whose policy gradient clipping took away.
    pub clipped_fraction: Option<f32>,
    /// Mean entropy, nats.
    pub entropy: Option<f32>,
    /// Mean bonus per step of the agent's own.
    pub intrinsic_reward: Option<f32>,
    /// Mean squared error of the model of the dynamics on fresh episodes, before it learned from
    /// them.
    pub prediction_error: Option<f32>,
    /// The team's: mean rank correlation between agents' judgements of the same steps. None where
    /// no two of them give bonuses.
    pub bonus_agreement: Option<f32>,
}

/// A named block of parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor<'a> {
    /// Such as `policy.layer_0.weight`.
    pub name: String,
    /// Row-major.
    pub shape: Vec<usize>,
    /// The numbers.
    pub values: Cow<'a, [f32]>,
}
