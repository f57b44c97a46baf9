//! A team in training: environments, team, shared buffer and measures, from one round to the next.
//!
//! A [`Trainer`] is built from any [`Environment`] and any [`Team`] ([`Trainer::new`]), or from a
//! scenario ([`Trainer::from_scenario`]).

mod from_scenario;
mod round_failure;
mod rounds;
mod saved;

use std::ops::Range;

use rayon::ThreadPool;

pub(super) use self::from_scenario::shares_rapier_world;
pub use self::round_failure::{NonFinite, RoundFailure};
use super::asynchronous::AsyncRollout;
use super::episode_warning::EpisodeWarning;
use super::rollout::CopyGroup;
use super::thread_pool;
use crate::run::facts::EpisodeDetails;
use crate::run::measures::{Division, Measures, RoundRows, VisitStatistics};
use crate::run::ranks::Ranks;
use crate::scenario::recording::SceneSettings;
use crate::scenario::{Schedule, Stop, Threshold};
use seedbed_env::{Environment, Scene, TaskSpec};
use seedbed_learn::experience::replay::Replay;
use seedbed_learn::experience::{Episode, StepData};
use seedbed_learn::nn::Tensor;
use seedbed_learn::team::{LearningTeam, Team, Workers};

/// The environments, team, shared buffer and measures of a run.
///
/// If the run is divided over ranks, each has a trainer with the environments of its local agents, which
/// is advanced by a [`TrainerOnRanks`](super::trainer_on_ranks::TrainerOnRanks).
pub struct Trainer {
    settings: TrainingSettings,
    spec: TaskSpec,
    scene: Option<Scene>,
    /// Empty in a [`SharedWorld`](super::shared_world::SharedWorld), which owns the copies.
    groups: Vec<CopyGroup>,
    learning: LearningTeam,
    /// State of the rollout with `Asynchronous`; `None` with other schedules, and before the first
    /// round.
    rollout: Option<AsyncRollout>,
    measures: Measures,
    /// The first physics warning of the run.
    physics_warning: Option<EpisodeWarning>,
    round: u32,
    is_done: bool,
    /// `None` with a single thread: a pool of one thread would only pass work back and forth, and a
    /// caller that waits for it could start other work meanwhile.
    pool: Option<ThreadPool>,
}

/// How a team is trained.
#[derive(Clone, Debug)]
pub struct TrainingSettings {
    /// The run seed, from which the streams of start states and actions derive.
    pub run_seed: u64,
    /// When agents learn.
    pub schedule: Schedule,
    /// When training ends.
    pub stop: Stop,
    /// Whose bodies are recorded, and in which episodes; `None` records no bodies.
    pub scene: Option<SceneSettings>,
    /// Number of the team's transitions that are kept after all agents have learned from them.
    pub transitions_kept: u64,
    /// Whether the agents have intrinsic rewards that can differ, whose agreement is measured.
    pub compares_bonuses: bool,
    /// Number of threads for updates; 0 is the number of cores. Results do not depend on it.
    pub threads: usize,
    /// The processes over which the agents are divided.
    pub ranks: Ranks,
}

impl Default for TrainingSettings {
    fn default() -> Self {
        Self {
            run_seed: 0,
            schedule: Schedule::default(),
            stop: Stop::default(),
            scene: None,
            transitions_kept: 0,
            compares_bonuses: false,
            threads: 1,
            ranks: Ranks::SINGLE,
        }
    }
}

/// The result of a round.
#[derive(Debug, Default)]
pub struct Round {
    /// The rows that the round adds to the tables.
    pub rows: RoundRows,
    /// What updates computed for the steps of the round's episodes, in (agent, episode) order.
    /// Episodes for which nothing was computed may be missing.
    pub step_data: Vec<StepData>,
    /// The recorded bodies.
    pub details: Vec<EpisodeDetails>,
}

impl Trainer {
    /// A team that has not learned yet, one local agent per copy of the environment.
    ///
    /// # Panics
    /// If there are not as many copies as local agents, or if the system refuses to start threads.
    #[must_use]
    pub fn new(
        environment: Box<dyn Environment>,
        team: Box<dyn Team>,
        settings: TrainingSettings,
    ) -> Self {
        Self::with_groups(vec![environment], team, settings)
    }

    /// Like [`new`](Self::new), with the copies of the environment in several groups, which are
    /// stepped on different threads. The bits of a run do not depend on the division, if those of a
    /// copy do not depend on the copies beside it.
    ///
    /// # Panics
    /// If there are not as many copies as local agents, if there are several groups although the schedule
    /// is asynchronous, or if the system refuses to start threads.
    #[must_use]
    pub fn with_groups(
        environments: Vec<Box<dyn Environment>>,
        team: Box<dyn Team>,
        settings: TrainingSettings,
    ) -> Self {
        let local_agents = settings.ranks.local_agents(team.agent_count() as u32);
        let copies: usize = environments.iter().map(|group| group.copies()).sum();
        assert_eq!(copies, local_agents.len(), "each agent has one copy");
        let (spec, scene) = (environments[0].spec(), environments[0].scene());
        let without_copies = Self::without_copies(spec.clone(), scene.cloned(), team, settings);
        let groups = number_agents(environments, local_agents.start);
        let schedule = without_copies.settings.schedule;
        let is_asynchronous = matches!(schedule, Schedule::Asynchronous { .. });
        assert!(
            groups.len() == 1 || !is_asynchronous,
            "copies that are stepped in an asynchronous schedule are one group"
        );
        Self {
            groups,
            ..without_copies
        }
    }

    /// A team whose copies of the environment are elsewhere.
    fn without_copies(
        spec: TaskSpec,
        scene: Option<Scene>,
        team: Box<dyn Team>,
        settings: TrainingSettings,
    ) -> Self {
        let agents = team.agent_count();
        let (threads, needs_pool) = (settings.threads, settings.threads != 1 && agents > 1);
        let mut trainer = Self {
            measures: Measures::on_ranks(&spec, agents, settings.ranks),
            spec,
            scene,
            rollout: None,
            groups: Vec::new(),
            learning: LearningTeam::new(team, settings.transitions_kept),
            physics_warning: None,
            round: 0,
            is_done: false,
            pool: needs_pool.then(|| thread_pool(threads, "agents")),
            settings,
        };
        trainer.is_done = trainer.measures_say_done();
        trainer
    }

    /// The run seed.
    pub(super) fn run_seed(&self) -> u64 {
        self.settings.run_seed
    }

    /// The team, which acts in a shared world.
    pub(in crate::run::training) fn team(&self) -> &dyn Team {
        self.learning.team()
    }

    /// Whether the scenario's `stop` is reached.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.is_done
    }

    pub(super) fn measures_say_done(&self) -> bool {
        let stop = &self.settings.stop;
        let ends_when_solved = matches!(stop, Stop::Solved { .. });
        self.has_played_enough() || (ends_when_solved && self.is_solved())
    }

    /// Whether the episodes or environment steps after which `stop` ends the run, solved or not,
    /// have been played.
    #[must_use]
    pub fn has_played_enough(&self) -> bool {
        let stop = &self.settings.stop;
        let max_steps = stop.max_env_steps();
        self.measures.episodes_per_agent() >= stop.max_episodes() as usize
            || max_steps.is_some_and(|max| self.measures.env_steps() >= max)
    }

    /// Whether the newest full window of episodes counts as solving the task.
    #[must_use]
    pub fn is_solved(&self) -> bool {
        self.threshold()
            .is_some_and(|threshold| self.measures.reaches(threshold))
    }

    /// The threshold at which the task counts as solved; `None` if none is set.
    #[must_use]
    pub fn threshold(&self) -> Option<Threshold> {
        self.settings.stop.threshold(self.spec())
    }

    /// The task.
    #[must_use]
    pub fn spec(&self) -> &TaskSpec {
        &self.spec
    }

    /// The bodies of the task, if it has any to draw.
    #[must_use]
    pub fn scene(&self) -> Option<&Scene> {
        self.scene.as_ref()
    }

    /// Number of agents K.
    #[must_use]
    pub fn agent_count(&self) -> usize {
        self.team().agent_count()
    }

    /// The agents that act and learn in this process.
    pub(in crate::run::training) fn local_agents(&self) -> Range<u32> {
        self.settings.ranks.local_agents(self.agent_count() as u32)
    }

    /// Statistics of the states that the team has visited so far, on rank 0.
    #[must_use]
    pub fn visit_statistics(&self) -> VisitStatistics {
        self.measures
            .visit_statistics(division(self.pool.as_ref(), &self.settings))
    }

    /// The parameters of all networks, with names such as `agent_3.policy.layer_0.weight`; the
    /// names of models that agents share begin with `model_3.`, and those of a bonus model that the
    /// whole team shares with `team.`.
    #[must_use]
    pub fn tensors(&self) -> Vec<Tensor<'_>> {
        self.team().tensors()
    }

    /// The agent seeds, with names such as `agent_3.reward_seeds` and
    /// `agent_3.initial.policy.layer_0.weight`.
    #[must_use]
    pub fn initial_tensors(&self) -> Vec<Tensor<'_>> {
        self.team().initial_tensors()
    }

    /// The newest round's episodes of the agents of this process, in (agent, episode) order.
    #[must_use]
    pub fn newest_episodes(&self) -> Vec<&Episode> {
        newest_episodes_of(&self.learning, self.local_agents())
    }

    /// The first thing in the run that the physics of its task cannot have computed well.
    #[must_use]
    pub fn physics_warning(&self) -> Option<&EpisodeWarning> {
        self.physics_warning.as_ref()
    }

    /// The measures of the run so far.
    #[must_use]
    pub fn measures(&self) -> &Measures {
        &self.measures
    }

    /// Number of finished rounds.
    #[must_use]
    pub fn rounds(&self) -> u32 {
        self.round
    }

    /// The transitions that the team learns from, if it has a replay buffer.
    #[must_use]
    pub fn replay(&self) -> Option<&Replay> {
        self.team().replay()
    }

    /// The replay buffer, to restore its transitions.
    pub fn replay_mut(&mut self) -> Option<&mut Replay> {
        self.learning.team_mut().replay_mut()
    }
}

/// The threads of this process, and the processes of the run.
fn division<'a>(pool: Option<&'a ThreadPool>, settings: &TrainingSettings) -> Division<'a> {
    Division {
        workers: Workers::new(pool),
        ranks: settings.ranks,
    }
}

/// The newest round's episodes of these agents, in (agent, episode) order.
fn newest_episodes_of(learning: &LearningTeam, agents: Range<u32>) -> Vec<&Episode> {
    let mut episodes = learning.newest_episodes();
    episodes.retain(|episode| agents.contains(&episode.agent));
    episodes
}

/// Groups whose agents are numbered consecutively from `first_agent` on.
pub(super) fn number_agents(
    environments: Vec<Box<dyn Environment>>,
    mut first_agent: u32,
) -> Vec<CopyGroup> {
    let number = |environment: Box<dyn Environment>| {
        let group = CopyGroup {
            first_agent,
            environment,
        };
        first_agent += group.environment.copies() as u32;
        group
    };
    environments.into_iter().map(number).collect()
}
