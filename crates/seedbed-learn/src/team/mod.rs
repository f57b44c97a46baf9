//! Teams: K agents that act at once, each in its own copy of one environment, and learn from what
//! all of them experienced.
//!
//! [`Team`] is all that a training loop sees. [`IndependentLearners`] makes a team of K
//! [`Agent`](crate::agent::Agent)s that each have networks of their own; learners that share models
//! implement the trait themselves. [`Workers`] is where work is done that may be done at once.

mod independent;
mod workers;

use crate::agent::{AgentContext, TeamConfig, Tensor, Update};
use crate::experience::{Episode, StepData};
use seedbed_env::Spec;
use seedbed_env::random::Stream;

pub use independent::IndependentLearners;
pub use workers::Workers;

/// K agents that act at once and learn from shared experience.
///
/// A round goes: [`begin_round`](Self::begin_round); for every step of the environments one
/// [`act`](Self::act), one [`add_transition`](Self::add_transition) per playing agent and one
/// [`end_step`](Self::end_step); then [`learn`](Self::learn). A round that is only evaluated
/// has neither of the last three. The bits must not depend on the number of [`Workers`].
pub trait Team: Send {
    /// Number of agents K.
    fn agent_count(&self) -> usize;

    /// A round is about to be played.
    fn begin_round(&mut self, _round: u32) {}

    /// Every agent that plays chooses its next action.
    fn act(&mut self, request: &mut ActionRequest<'_>);

    /// Takes in the newest transition of an agent's episode, for teams that learn from single
    /// transitions. Called in agent order.
    fn add_transition(&mut self, _episode: &Episode) {}

    /// Every agent that plays has made a step. Teams that learn in the middle of episodes
    /// ([`LearningTiming::EverySteps`]) do so here.
    fn end_step(&mut self, _workers: Workers<'_>) {}

    /// The agents of `lesson.learners` learn; returns one update per learner, in their order.
    fn learn(&mut self, lesson: &Lesson<'_>, workers: Workers<'_>) -> Vec<AgentUpdate>;

    /// Bonuses that each of the team's models of curiosity would give to at most
    /// [`PROBE_STEPS`](crate::agent::PROBE_STEPS) steps of an episode: one list per model; lists
    /// are empty without curiosity.
    fn probe_bonuses(&mut self, _episode: &Episode, _round: u32) -> Vec<Vec<f32>> {
        Vec::new()
    }

    /// The parameters of all networks, named `agent_3.policy.layer_0.weight` and the like; those of
    /// models that agents share, `model_3.…`.
    fn tensors(&self) -> Vec<Tensor<'_>>;

    /// Everything that learning changed, as bytes.
    fn save(&self) -> Vec<u8>;

    /// Continues from what [`save`](Self::save) wrote.
    ///
    /// # Errors
    /// What is wrong if the bytes are not of such a team.
    fn restore(&mut self, bytes: &[u8]) -> Result<(), String>;
}

/// What agents see in one step, and where their actions go. Rows are by agent.
#[derive(Debug)]
pub struct ActionRequest<'a> {
    /// `[K × observation width]`
    pub observations: &'a [f32],
    /// Whether each agent plays; rows of the others are ignored: `[K]`.
    pub playing: &'a [bool],
    /// The stream from which each agent draws its actions: `[K]`.
    pub random: &'a mut [Stream],
    /// Filled for agents that play; a discrete action is the index of its value.
    /// `[K × action width]`
    pub actions: &'a mut [f32],
    /// log π of each component of the actions, filled for agents that play: `[K × action width]`.
    pub log_probs: &'a mut [f32],
}

/// Who learns now, and from what.
#[derive(Clone, Copy, Debug)]
pub struct Lesson<'a> {
    /// The newest episodes of the team that are kept.
    pub kept: &'a [Episode],
    /// In agent order.
    pub learners: &'a [Learner],
}

/// An agent that is about to learn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Learner {
    /// The agent's number, from 0.
    pub agent: u32,
    /// Index into [`Lesson::kept`] of the first episode that this agent has not learned from.
    pub first_fresh: usize,
    /// How often it has learned before.
    pub round: u32,
}

/// The result of learning for one agent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AgentUpdate {
    /// The agent's number, from 0.
    pub agent: u32,
    /// What it learned.
    pub update: Update,
    /// Whether all numbers that it has learned are finite.
    pub is_finite: bool,
}

/// What a team is built from.
#[derive(Clone, Copy, Debug)]
pub struct TeamContext<'a> {
    /// The run seed.
    pub run_seed: u64,
    /// How many agents, and how they differ.
    pub config: &'a TeamConfig,
    /// The task.
    pub spec: &'a Spec,
    /// When the team learns.
    pub timing: LearningTiming,
    /// Whether updates return [advantages](StepData::advantages). What is learned is the same.
    pub record_advantages: bool,
}

/// When a team learns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LearningTiming {
    /// When episodes have ended.
    AfterEpisodes,
    /// After this many steps of each agent, in the middle of episodes.
    EverySteps(u32),
}

impl<'a> TeamContext<'a> {
    /// What agent number `agent` is built from.
    #[must_use]
    pub fn agent(&self, agent: u32) -> AgentContext<'a> {
        AgentContext {
            run_seed: self.run_seed,
            agent,
            team: self.config,
            spec: self.spec,
            record_advantages: self.record_advantages,
        }
    }

    /// The numbers of all agents, from 0.
    pub fn agents(&self) -> impl Iterator<Item = u32> + use<> {
        0..self.config.count.get()
    }
}
