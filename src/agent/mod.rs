//! Agents: what acts in one copy of an environment and learns from the team's shared experience.
//!
//! One algorithm a file: its configuration, its agent, its references, its tests. [`Algorithm`] lists them. Files, threads and
//! recordings may not enter.

pub mod catalogue;
pub mod curiosity;
mod network;
pub mod policy;
#[cfg(test)]
mod policy_reference;
pub mod random;
pub mod scaling;
pub mod seed_pg;

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use self::policy::ActionSelection;
use crate::env::Spec;
use crate::experience::{Episode, Experience};
use crate::input::Complaint;
use crate::input::numbers::{Count, known, known_count};
use crate::nn::{Activations, Initial};
use crate::random::Stream;
use crate::seed::SeedDistribution;

/// One of K agents. `act` takes `&self` and `update` takes an `&Experience`: agents may act at once, and may learn at once
/// from episodes that nobody changes meanwhile.
pub trait Agent: Send + Sync {
    /// Chooses an action, and says how likely each of its components was.   `observation: [observation width]` →
    /// `action`, `log_prob`: `[action width]`
    fn act(&self, observation: &[f32], random: &mut Stream, scratch: &mut ActScratch, action: &mut [f32], log_prob: &mut [f32]);

    /// Learns from what the team has experienced.
    fn update(&mut self, experience: &Experience<'_>) -> UpdateReport;

    /// Bonuses that the latest update gave to the steps of the agent's own fresh episodes, one after the other; none without
    /// curiosity.
    fn intrinsic_rewards(&self) -> &[f32] {
        &[]
    }

    /// How much there is to learn from about [`JUDGED`] steps of an episode, as the agent's curiosity has it now; none without curiosity.
    fn judge(&mut self, _episode: &Episode, _round: u32) -> Vec<f32> {
        Vec::new()
    }

    /// Whether every learned number is finite.
    fn is_finite(&self) -> bool;

    /// The parameters of the agent's networks, named.
    fn tensors(&self) -> Vec<Tensor<'_>>;

    /// Everything that learning changed, as bytes.
    fn save(&self) -> Vec<u8>;

    /// Takes up what [`save`](Self::save) wrote.
    ///
    /// # Errors
    /// Says what is wrong where the bytes are not of such an agent.
    fn restore(&mut self, bytes: &[u8]) -> Result<(), String>;
}

/// Steps of an episode that agents judge, at most.
pub const JUDGED: usize = 64;

/// The algorithms, each with its configuration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Algorithm {
    /// Seed policy gradient (thesis §3.4).
    SeedPg(Box<seed_pg::config::SeedPg>),
    /// Uniformly random actions: the control that every claim of learning has to beat.
    Random,
}

/// The team: how many agents, and how they differ from the start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Team {
    /// K.
    pub count: Count<10_000>,
    /// What an agent's own perturbations of the rewards are drawn from.
    pub seeds: SeedDistribution,
    /// How networks start.
    pub initial: Initial,
}

impl Default for Team {
    fn default() -> Self {
        Self { count: known_count(4), seeds: SeedDistribution::Normal { sigma: known(0.1) }, initial: Initial::Random }
    }
}

/// Who is being built: one agent of a team in one run.
#[derive(Clone, Copy, Debug)]
pub struct Membership<'a> {
    /// The run's seed.
    pub run_seed: u64,
    /// The agent's number, from 0.
    pub agent: u32,
    /// The team it belongs to.
    pub team: &'a Team,
    /// The task.
    pub spec: &'a Spec,
}

/// Room for one forward pass at a time; one for each thread that acts.
#[derive(Debug, Default)]
pub struct ActScratch {
    state: Vec<f32>,
    activations: Activations,
    outputs: Vec<f32>,
}

/// What one update was like: means over all that was trained on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UpdateReport {
    /// ½ mean squared error against the normalised target.
    pub value_loss: f32,
    /// Mean surrogate loss.
    pub policy_loss: f32,
    /// Mean |ρ − 1| + 1.
    pub ratio_deviation: f32,
    /// The largest ρ.
    pub largest_ratio: f32,
    /// Share of samples whose policy gradient clipping took away.
    pub clipped_fraction: f32,
    /// Mean entropy, nats.
    pub entropy: f32,
    /// Mean bonus of a step of the agent's own.
    pub intrinsic_reward: f32,
    /// Mean squared error of the model of the dynamics on fresh episodes, before it learned from them.
    pub prediction_error: f32,
    /// The team's: mean rank correlation between agents' judgements of the same steps.
    pub bonus_agreement: f32,
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

impl Algorithm {
    /// Builds one agent.
    #[must_use]
    pub fn build(&self, member: &Membership<'_>) -> Box<dyn Agent> {
        match self {
            Self::SeedPg(config) => Box::new(seed_pg::SeedPgAgent::new(config, member)),
            Self::Random => Box::new(random::RandomAgent::new(member.spec)),
        }
    }

    /// The same with actions chosen in another way.
    #[must_use]
    pub fn with_actions(mut self, actions: ActionSelection) -> Self {
        match &mut self {
            Self::SeedPg(config) => config.actions = actions.into(),
            Self::Random => {}
        }
        self
    }

    /// The largest bonus that a step can have; none without curiosity.
    #[must_use]
    pub fn largest_intrinsic_reward(&self) -> Option<f32> {
        match self {
            Self::SeedPg(config) => config.bonus.largest(),
            Self::Random => None,
        }
    }

    /// Transitions of the team that the shared buffer has to keep after all have learned from them.
    #[must_use]
    pub fn transitions_kept(&self) -> u64 {
        match self {
            Self::SeedPg(config) => config.bonus.transitions_kept(),
            Self::Random => 0,
        }
    }

    /// Says what in a configuration needs agents that learn at the same time.
    ///
    /// # Errors
    /// The parameter to blame, and why.
    pub fn check_asynchronous(&self) -> Result<(), Complaint> {
        match self {
            Self::SeedPg(config) if config.bonus.is_shared() => Err(config.bonus.complain(
                "a shared model is the same for all agents only where all learn at the same time; expected `schedule: Synchronous(…)`, or \
                 `model: Independent`",
            )),
            Self::SeedPg(_) | Self::Random => Ok(()),
        }
    }

    /// Says what is wrong with a configuration that no single field can tell.
    ///
    /// # Errors
    /// The parameter to blame, and why.
    pub fn check(&self) -> Result<(), Complaint> {
        match self {
            Self::SeedPg(config) => config.check(),
            Self::Random => Ok(()),
        }
    }
}
