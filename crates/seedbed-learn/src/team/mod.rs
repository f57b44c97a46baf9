//! Teams: K agents that act concurrently, each in its own copy of an environment, and learn from
//! shared experience.
//!
//! [`Team`] is the interface for training loops. [`IndependentLearners`] is a team of K
//! [`Agent`](crate::agent::Agent)s with their own networks; learners that share models implement
//! the trait themselves. [`LearningTeam`] is a team with the buffer of its episodes. [`Workers`] are
//! the threads that a team may use.

mod agreement;
mod bonuses;
mod independent;
mod learning_clock;
mod learning_team;
mod local_models;
mod workers;

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::agent::{ActScratch, ActionRandom, AgentContext, TeamConfig, Update};
use crate::experience::replay::Replay;
use crate::experience::{Episode, EpisodeInfo, Experience};
use crate::nn::Tensor;
use seedbed_env::TaskSpec;

pub(crate) use bonuses::{HasBonusModel, copy_shared_bonus_model, mean_bonus, update_bonus_models};
pub use independent::IndependentLearners;
pub(crate) use independent::{act_one_by_one, tensors_of_agents};
pub(crate) use learning_clock::{LearningClock, SavedProgress};
pub use learning_team::LearningTeam;
pub(crate) use local_models::LocalModels;
pub use workers::Workers;

/// K agents that act concurrently and learn from shared experience.
///
/// In each round, a training loop calls [`begin_round`](Self::begin_round); then
/// [`act`](Self::act) for every step, possibly for groups of agents on several threads; and finally
/// [`learn`](Self::learn). If the team learns from single transitions, the loop calls
/// [`add_transition`](Self::add_transition) once per playing agent and
/// [`end_step`](Self::end_step) for every step, at the latest when
/// [`transition_interval`](Self::transition_interval) steps have been played. To evaluate a team, it
/// calls [`begin_round`](Self::begin_round) and [`act`](Self::act) only. Results must not depend on
/// the number of [`Workers`], to the bit.
///
/// A run may be divided over processes: each has a team that acts and learns for consecutive agents,
/// its *local* agents ([`TeamContext::local_agents`]). What local agents share with others is either
/// learned in every process from the same experience, with the same bits, or passed on by
/// [`shared_model`](Self::shared_model). A team in a single process has local agents only.
pub trait Team: Send + Sync {
    /// Number of agents K, in all processes together.
    fn agent_count(&self) -> usize;

    /// Prepares for the round with this number, which is played next.
    fn begin_round(&mut self, _round: u32) {}

    /// Chooses the next action of every agent of a group that plays.
    fn act(&self, request: &mut ActionRequest<'_>, scratch: &mut ActScratch);

    /// For a team that learns from single transitions: the number of steps that may be played
    /// before it gets their transitions. `None` (the default): the team needs no transitions.
    fn transition_interval(&self) -> Option<u32> {
        None
    }

    /// Adds the transition of step number `step` of an agent's episode. Called in the order of
    /// steps, and in agent order within a step. Steps after this one may have been played already.
    fn add_transition(&mut self, _episode: &Episode, _step: usize) {}

    /// Called when the transitions of a step of all agents have been added. Teams that learn during
    /// episodes ([`LearningTiming::EverySteps`]) do so here.
    fn end_step(&mut self, _workers: Workers<'_>) {}

    /// Lets the agents of `request.learners`, which are local, learn; returns one update per
    /// learner, in the same order.
    fn learn(&mut self, request: &LearningRequest<'_>, workers: Workers<'_>) -> Vec<AgentUpdate>;

    /// Which of the team's new episodes the local agents will learn from in their next update, number
    /// `earlier_updates`; [`learn`](Self::learn) gets the others without their steps. `None` (the
    /// default): all of them.
    fn choose_episodes(
        &self,
        _new_episodes: &[EpisodeInfo],
        _earlier_updates: u32,
    ) -> Option<Vec<usize>> {
        None
    }

    /// A model that one agent trains for the whole team, as bytes, after that agent has learned.
    /// `None` (the default) if there is no such model, or if the agent is not local.
    fn shared_model(&self) -> Option<Vec<u8>> {
        None
    }

    /// Copies the [shared model](Self::shared_model) of another process to all local agents.
    ///
    /// # Errors
    /// What is wrong if the bytes are not of such a model.
    fn set_shared_model(&mut self, _bytes: &[u8], _workers: Workers<'_>) -> Result<(), String> {
        Ok(())
    }

    /// Unscaled bonuses of at most [`PROBE_STEPS`](crate::agent::PROBE_STEPS) steps of an episode:
    /// one list per bonus model of the local agents. Lists are empty without a bonus.
    fn probe_bonuses(&mut self, _episode: &Episode, _round: u32) -> Vec<Vec<f32>> {
        Vec::new()
    }

    /// The parameters of the networks of all local agents, with names such as
    /// `agent_3.policy.layer_0.weight`, and of what agents share if agent 0 is local: names of
    /// models that several agents share begin with `model_3.` instead, and those of a bonus model
    /// that the whole team shares with `team.`. See [`NetworkInfo`](crate::agent::network_info).
    fn tensors(&self) -> Vec<Tensor<'_>>;

    /// The agent seeds, with names such as `agent_3.reward_seeds` and
    /// `agent_3.initial.policy.layer_0.weight`, of the same agents and models as
    /// [`tensors`](Self::tensors). Empty if the team has none.
    fn initial_tensors(&self) -> Vec<Tensor<'_>> {
        Vec::new()
    }

    /// The transitions that the team learns from, if it has a replay buffer.
    fn replay(&self) -> Option<&Replay> {
        None
    }

    /// The replay buffer, to restore its transitions.
    fn replay_mut(&mut self) -> Option<&mut Replay> {
        None
    }

    /// Everything that learning changed, without the [replay buffer](Self::replay), and without the
    /// parts of other processes.
    fn save(&self) -> SavedTeam;

    /// Continues from what [`save`](Self::save) wrote, with the parts of all processes.
    ///
    /// # Errors
    /// What is wrong if the bytes are not of such a team.
    fn restore(&mut self, saved: &SavedTeam) -> Result<(), String>;
}

/// What learning changed in a team, as bytes.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SavedTeam {
    /// The state of each agent, or of each model that agents act by, in their order. Each is part of
    /// what one process saves, in the order of the processes.
    pub parts: Vec<Vec<u8>>,
    /// The same in every process.
    pub shared: Vec<u8>,
}

/// The observations of one step of a group of consecutive agents, and buffers for the actions. There
/// is one row per agent of the group.
#[derive(Debug)]
pub struct ActionRequest<'a> {
    /// Number of the group's first agent.
    pub first_agent: usize,
    /// Number of steps that have been played since the last [`Team::end_step`]; 0 in evaluation.
    pub unreported_steps: u32,
    /// Number of steps that each agent's episode has so far; 0 at its beginning: `[agents]`.
    pub steps: &'a [u32],
    /// Observations of the group: `[agents × observation width]`.
    pub observations: &'a [f32],
    /// Whether each agent plays; rows of other agents are ignored: `[agents]`.
    pub playing: &'a [bool],
    /// What the agents draw their actions from: `[agents]`.
    pub random: &'a mut [ActionRandom],
    /// Output: the actions of the agents for which `playing` is true. A discrete action is the index
    /// of its value: `[agents × action width]`.
    pub actions: &'a mut [f32],
    /// Output: the log-probability of each component of these actions: `[agents × action width]`.
    pub log_probs: &'a mut [f32],
}

/// The agents that learn next, and the episodes that they learn from.
#[derive(Clone, Copy, Debug)]
pub struct LearningRequest<'a> {
    /// All episodes of the team that are still in the buffer. If the agents
    /// [chose](Team::choose_episodes) some, others may have no steps.
    pub episodes: &'a [Episode],
    /// Lengths of these episodes, with all their steps.
    pub lengths: &'a [u32],
    /// The agents that learn, in agent order.
    pub learners: &'a [Learner],
}

/// An agent that learns next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Learner {
    /// The agent's number, from 0.
    pub agent: u32,
    /// Index in [`LearningRequest::episodes`] of the first episode that this agent has not learned
    /// from.
    pub first_new_episode: usize,
    /// Number of the agent's earlier updates.
    pub earlier_updates: u32,
}

impl Learner {
    /// What this agent learns from.
    pub(crate) fn experience<'a>(&self, request: &LearningRequest<'a>) -> Experience<'a> {
        Experience {
            new_episodes: &request.episodes[self.first_new_episode..],
            new_lengths: &request.lengths[self.first_new_episode..],
            all_episodes: request.episodes,
            earlier_updates: self.earlier_updates,
        }
    }
}

/// The update of one agent of a team.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AgentUpdate {
    /// The agent's number, from 0.
    pub agent: u32,
    /// The result of the update.
    pub update: Update,
    /// Whether all learned parameters are finite.
    pub is_finite: bool,
}

/// What a team is built from.
#[derive(Clone, Copy, Debug)]
pub struct TeamContext<'a> {
    /// The run seed.
    pub run_seed: u64,
    /// The number of agents, and how they differ from each other.
    pub config: &'a TeamConfig,
    /// First and last (exclusive) of the agents that act and learn in this process; `None`: all.
    pub local_agents: Option<(u32, u32)>,
    /// The task.
    pub spec: &'a TaskSpec,
    /// When the team learns.
    pub timing: LearningTiming,
    /// Whether updates return [advantages](crate::experience::StepData::advantages). Must not
    /// change what is learned.
    pub record_advantages: bool,
}

/// When a team learns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LearningTiming {
    /// After episodes have ended.
    AfterEpisodes,
    /// Each time after this number of steps of each agent, during episodes.
    EverySteps(u32),
    /// Once for this number of transitions of the whole team, during episodes: possibly several
    /// times after a step.
    EveryTransitions(u32),
}

impl<'a> TeamContext<'a> {
    /// The context of agent number `agent`.
    #[must_use]
    pub fn agent_context(&self, agent: u32) -> AgentContext<'a> {
        AgentContext {
            run_seed: self.run_seed,
            agent,
            team: self.config,
            spec: self.spec,
            record_advantages: self.record_advantages,
        }
    }

    /// The numbers of the agents that act and learn in this process.
    #[must_use]
    pub fn local_agents(&self) -> Range<u32> {
        let (first, end) = self.local_agents.unwrap_or((0, self.config.count.get()));
        first..end
    }
}
