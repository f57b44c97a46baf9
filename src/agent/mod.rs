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
pub mod q_learning;
pub mod random;
pub mod scaling;
pub mod seed_pg;

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use self::curiosity::Bonus;
use self::policy::ActionSelection;
use crate::env::Spec;
use crate::experience::{Episode, Experience};
use crate::input::numbers::{Count, known, known_count};
use crate::input::{Complaint, Located};
use crate::nn::{Activations, Initial};
use crate::random::Stream;
use crate::seed::SeedDistribution;

/// One of K agents. `act` takes `&self` and `update` takes an `&Experience`: agents may act at once, and may learn at once
/// from episodes that nobody changes meanwhile.
pub trait Agent: Send + Sync {
    /// Chooses an action, and says how likely each of its components was.   `observation: [observation width]` →
    /// `action`, `log_prob`: `[action width]`
    fn act(
        &self,
        observation: &[f32],
        random: &mut Stream,
        scratch: &mut ActScratch,
        action: &mut [f32],
        log_prob: &mut [f32],
    );

    /// Learns from what the team has experienced.
    fn update(&mut self, experience: &Experience<'_>) -> UpdateReport;

    /// Bonuses that the latest update gave to the steps of the agent's own fresh episodes, one after the other; none without
    /// curiosity.
    fn intrinsic_rewards(&self) -> &[f32] {
        &[]
    }

    /// What the latest update took the advantage of each step of the agent's own fresh episodes for, one after the other: under the policy
    /// and the value function before that update, not standardised. None where [`Membership::notes_advantages`] is off, or where the
    /// algorithm estimates none.
    fn advantages(&self) -> &[f32] {
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
    /// Q-learning on the team's replay (thesis §1.4.1).
    QLearning(Box<q_learning::config::QLearning>),
    /// Seed TD, seed LSVI and seed ensembles (thesis §2.4).
    SeedTd(Box<q_learning::config::SeedTd>),
    /// Bootstrapped DQN with randomised priors.
    BootstrappedDqn(Box<q_learning::config::BootstrappedDqn>),
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
        Self {
            count: known_count(4),
            seeds: SeedDistribution::Normal { sigma: known(0.1) },
            initial: Initial::Random,
        }
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
    /// Whether [`Agent::advantages`] are wanted. What is learned is the same.
    pub notes_advantages: bool,
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
    /// The team's: mean rank correlation between agents' judgements of the same steps. None where no two of them judge.
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

impl Algorithm {
    /// Builds one agent; none where agents act by models that they share: see [`build_shared`](Self::build_shared).
    #[must_use]
    pub fn build(&self, member: &Membership<'_>) -> Option<Box<dyn Agent>> {
        match self {
            Self::SeedPg(config) => Some(Box::new(seed_pg::SeedPgAgent::new(config, member))),
            Self::Random => Some(Box::new(random::RandomAgent::new(member.spec))),
            Self::QLearning(_) | Self::SeedTd(_) | Self::BootstrappedDqn(_) => None,
        }
    }

    /// Builds a whole team of agents that act by models of state-action values; none where each agent learns for itself.
    ///
    /// # Panics
    /// If an action of the task is not one discrete choice: see [`check_task`](Self::check_task).
    #[must_use]
    pub fn build_shared(
        &self,
        run_seed: u64,
        team: &Team,
        spec: &Spec,
    ) -> Option<q_learning::ValueTeam> {
        q_learning::config::composition(self, team.count.get() as usize)
            .map(|composition| q_learning::ValueTeam::new(composition, run_seed, team, spec))
    }

    /// The same with actions chosen in another way.
    #[must_use]
    pub fn with_actions(mut self, actions: ActionSelection) -> Self {
        match &mut self {
            Self::SeedPg(config) => config.actions = actions.into(),
            Self::QLearning(config) => {
                config.exploration = config.exploration.with_actions(actions)
            }
            Self::SeedTd(config) => config.exploration = config.exploration.with_actions(actions),
            Self::BootstrappedDqn(config) => {
                config.exploration = config.exploration.with_actions(actions)
            }
            Self::Random => {}
        }
        self
    }

    /// What is added to rewards; none where nothing ever is.
    fn bonus(&self) -> Option<&Located<Bonus>> {
        match self {
            Self::SeedPg(config) => Some(&config.bonus),
            Self::QLearning(config) => Some(&config.bonus),
            Self::SeedTd(config) => Some(&config.bonus),
            Self::BootstrappedDqn(config) => Some(&config.bonus),
            Self::Random => None,
        }
    }

    /// The largest bonus that a step can have; none without curiosity.
    #[must_use]
    pub fn largest_intrinsic_reward(&self) -> Option<f32> {
        self.bonus()?.largest()
    }

    /// Whether agents estimate how much better than expected their actions were.
    #[must_use]
    pub fn estimates_advantages(&self) -> bool {
        matches!(self, Self::SeedPg(_))
    }

    /// Transitions of the team that the shared buffer has to keep after all have learned from them.
    #[must_use]
    pub fn transitions_kept(&self) -> u64 {
        self.bonus().map_or(0, |bonus| bonus.transitions_kept())
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
            _ => Ok(()),
        }
    }

    /// Whether agents learn step by step, from single transitions.
    #[must_use]
    pub fn learns_from_transitions(&self) -> bool {
        matches!(
            self,
            Self::QLearning(_) | Self::SeedTd(_) | Self::BootstrappedDqn(_)
        )
    }

    /// Says what in a configuration keeps agents from learning in the middle of a round.
    ///
    /// # Errors
    /// The parameter to blame, and why.
    pub fn check_lockstep(&self) -> Result<(), Complaint> {
        match self {
            Self::SeedTd(config) => config.check_lockstep(),
            _ => Ok(()),
        }
    }

    /// Says what is wrong with a configuration that no single field can tell.
    ///
    /// # Errors
    /// The parameter to blame, and why.
    pub fn check(&self) -> Result<(), Complaint> {
        match self {
            Self::SeedPg(config) => config.check(),
            Self::QLearning(config) => q_learning::config::check(&config.learning, &config.bonus),
            Self::SeedTd(config) => q_learning::config::check(&config.learning, &config.bonus),
            Self::BootstrappedDqn(config) => {
                q_learning::config::check(&config.learning, &config.bonus)
            }
            Self::Random => Ok(()),
        }
    }

    /// Says why the algorithm cannot act in a task.
    ///
    /// # Errors
    /// What the task's actions are, and what was expected.
    pub fn check_task(&self, spec: &Spec) -> Result<(), String> {
        if !self.learns_from_transitions() {
            return Ok(());
        }
        let found = |what| {
            format!(
                "value-based learners choose among values of discrete actions, but {what}; expected `SeedPg`, or a task \
                                    with one discrete action"
            )
        };
        q_learning::one_choice(spec).map(|_| ()).map_err(found)
    }
}
