//! A team in training: environments, team, shared buffer and measures, from one round to the next.
//!
//! A [`Trainer`] is built from any [`Environment`] and any [`Team`] ([`Trainer::new`]), or from a
//! scenario ([`Trainer::from_scenario`]).

mod from_scenario;
mod saved;

use std::fmt::{self, Display, Formatter};
use std::ops::Range;
use std::path::Path;

use rayon::{ThreadPool, ThreadPoolBuilder};

pub(super) use self::from_scenario::shares_rapier_world;
use super::agreement;
use super::asynchronous::{AsyncConfig, AsyncRollout};
use super::episode_warning::EpisodeWarning;
use super::remote_steps::RemoteRounds;
use super::rollout::{self, CopyGroup, GroupRound, PlayedEpisodes, RoundPlan};
use super::shared_episodes::SharedEpisodes;
use crate::run::facts::BodyTrajectory;
use crate::run::measures::{Measures, RoundRows};
use crate::run::ranks::Ranks;
use crate::scenario::recording::SceneSettings;
use crate::scenario::{Schedule, Stop, Threshold};
use seedbed_env::file::find_field;
use seedbed_env::{Environment, Scene, TaskSpec};
use seedbed_learn::agent::{Tensor, UpdateReport};
use seedbed_learn::experience::replay::Replay;
use seedbed_learn::experience::{Episode, SharedBuffer, StepData};
use seedbed_learn::team::{AgentUpdate, Learner, LearningRequest, Team, Workers};

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
    team: Box<dyn Team>,
    buffer: SharedBuffer,
    /// Number of the team's episodes before the newest round.
    episodes_before_round: u64,
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
    /// The agents that act and learn in this process; `None`: all.
    pub local_agents: Option<Range<u32>>,
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
            local_agents: None,
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
    pub body_trajectories: Vec<BodyTrajectory>,
}

/// Training cannot continue because a number is not finite.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Diverged {
    /// An observation or a reward is not finite.
    #[error(
        "non-finite {what} (agent {agent}, episode {episode}, step {step}): {value}, after the \
         observation {observation}; {place}"
    )]
    Simulation {
        /// The agent.
        agent: u32,
        /// Number of the agent's episode, from 0.
        episode: u32,
        /// Number of the step that leads to it, from 0; that of an episode's first observation is 0,
        /// too.
        step: usize,
        /// The name of the observation, or `reward`.
        what: NonFinite,
        /// The number.
        value: String,
        /// The observation before: each name with its value.
        observation: String,
        /// Where its formula is, or what to check.
        place: String,
    },
    /// A parameter of a network is not finite.
    #[error(
        "non-finite network parameters (agent {agent}, round {round}): the algorithm's step sizes \
         or the deviation of `agents.seeds` are too large"
    )]
    Learning {
        /// The agent that learned.
        agent: u32,
        /// Number of the round, from 0.
        round: u32,
    },
}

/// What is not finite.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NonFinite {
    /// The observation of this name.
    Observation(String),
    /// The reward.
    Reward,
}

impl Display for NonFinite {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Observation(name) => write!(formatter, "observation `{name}`"),
            Self::Reward => formatter.write_str("reward"),
        }
    }
}

impl Diverged {
    /// The error with the place of the formula in `text`, the text of the task's file at `path`.
    #[must_use]
    pub fn located_in(mut self, path: &Path, text: &str) -> Self {
        if let Self::Simulation { what, place, .. } = &mut self {
            let (field, entry) = match what {
                NonFinite::Observation(name) => ("observations", Some(name.as_str())),
                NonFinite::Reward => ("reward", None),
            };
            if let Some(found) = find_field(text, field, entry) {
                let path = path.display();
                let (line, column) = (found.line, found.column);
                *place = format!("check `{field}` in {path}:{line}:{column}: {}", found.value);
            }
        }
        self
    }
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
        let local_agents = local_agents(&settings, &*team);
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
            measures: Measures::new(&spec, agents),
            spec,
            scene,
            buffer: SharedBuffer::default(),
            episodes_before_round: 0,
            rollout: None,
            groups: Vec::new(),
            team,
            physics_warning: None,
            round: 0,
            is_done: false,
            pool: needs_pool.then(|| thread_pool(threads)),
            settings,
        };
        trainer.is_done = trainer.measures_say_done();
        trainer
    }

    /// Plays a round of concurrent episodes, lets every agent learn from all of them, and measures
    /// the result.
    ///
    /// An asynchronous round ends when as many episodes have ended as there are agents.
    ///
    /// # Errors
    /// An observation, a reward or a network's parameters are not finite.
    pub fn advance(&mut self) -> Result<Round, Diverged> {
        self.forget_old_episodes();
        let (updates, body_trajectories) = match self.settings.schedule {
            Schedule::Synchronous { .. } | Schedule::Lockstep { .. } => {
                let played = self.play_together(RemoteRounds::new(Ranks::SINGLE));
                self.note_warnings(played.warnings);
                let updates = self.learn_from(played.episodes.into())?;
                (updates, played.body_trajectories)
            }
            Schedule::Asynchronous { training } => {
                self.advance_asynchronously(training.env_steps)?
            }
        };
        Ok(self.finish_measured(updates, body_trajectories))
    }

    /// Begins a round of concurrent episodes in the copies of a shared world from `first_copy` on.
    pub(super) fn begin_round_in(
        &mut self,
        environment: &mut dyn Environment,
        first_copy: usize,
    ) -> GroupRound<'static> {
        self.forget_old_episodes();
        self.team.begin_round(self.round);
        let agents = 0..self.team.agent_count() as u32;
        let plan = RoundPlan {
            run_seed: self.settings.run_seed,
            round: self.round,
            episodes: episodes_per_round(self.settings.schedule),
            scene: None,
        };
        GroupRound::begin(environment, agents, first_copy, plan)
    }

    /// Adds the result of the latest step to a round that began in a shared world. A team that
    /// learns from transitions gets those that are due.
    pub(super) fn observe_in(
        &mut self,
        environment: &mut dyn Environment,
        round: &mut GroupRound<'_>,
    ) {
        let interval = self.team.transition_interval();
        round.observe(environment, interval.is_some());
        let is_due = |interval| round.unreported_steps() >= interval || round.is_over();
        if interval.is_some_and(is_due) {
            let (workers, team) = (Workers::new(self.pool.as_ref()), &mut *self.team);
            let mut remote = RemoteRounds::new(Ranks::SINGLE);
            rollout::report_transitions(&mut [round], &mut remote, team, workers);
        }
    }

    /// Lets every agent learn from a round that was played in a shared world, and measures it.
    ///
    /// # Errors
    /// An observation, a reward or a network's parameters are not finite.
    pub(super) fn finish_round(&mut self, round: GroupRound<'_>) -> Result<Round, Diverged> {
        let played = rollout::collect_episodes([round]);
        self.note_warnings(played.warnings);
        let updates = self.learn_from(played.episodes.into())?;
        Ok(self.finish_measured(updates, played.body_trajectories))
    }

    /// The run seed.
    pub(super) fn run_seed(&self) -> u64 {
        self.settings.run_seed
    }

    /// The team, which acts in a shared world.
    pub(in crate::run::training) fn team(&self) -> &dyn Team {
        &*self.team
    }

    /// Removes the episodes that are not needed any more, before a round.
    pub(super) fn forget_old_episodes(&mut self) {
        self.buffer.remove_first(self.count_old_episodes());
        self.episodes_before_round = self.buffer.episodes_added();
    }

    /// Measures and ends a round of all agents.
    fn finish_measured(
        &mut self,
        updates: Vec<AgentUpdate>,
        body_trajectories: Vec<BodyTrajectory>,
    ) -> Round {
        let agreement = self.bonus_agreement();
        let round = self.measure_round(updates, body_trajectories, agreement);
        self.end_round(self.measures_say_done());
        round
    }

    /// Measures a round. `bonus_agreement`: see [`bonus_agreement`](Self::bonus_agreement)
    pub(super) fn measure_round(
        &mut self,
        updates: Vec<AgentUpdate>,
        body_trajectories: Vec<BodyTrajectory>,
        bonus_agreement: Option<f64>,
    ) -> Round {
        let (mut reports, mut step_data) = (Vec::new(), Vec::new());
        for AgentUpdate { agent, update, .. } in updates {
            let report = UpdateReport {
                bonus_agreement: bonus_agreement.map(|agreement| agreement as f32),
                ..update.report
            };
            reports.push((agent, report));
            step_data.extend(update.step_data);
        }
        step_data.sort_by_key(|data| (data.agent, data.episode));
        let episodes = newest_episodes(&self.buffer, self.episodes_before_round);
        let rows = self
            .measures
            .add_round(&self.spec, self.round, &episodes, &reports);
        Round {
            rows,
            step_data,
            body_trajectories,
        }
    }

    /// Counts a round. `is_done`: whether it was the last one
    pub(super) fn end_round(&mut self, is_done: bool) {
        self.round += 1;
        self.is_done = is_done;
    }

    /// Number of the team's first episodes that are not needed any more: all agents have learned
    /// from them, and they have none of the transitions to keep.
    fn count_old_episodes(&self) -> u64 {
        let learned_by_all = self
            .rollout
            .as_ref()
            .map_or(u64::MAX, AsyncRollout::learned_by_all);
        let before_kept = self
            .buffer
            .count_before_newest(self.settings.transitions_kept);
        learned_by_all.min(before_kept)
    }

    /// Every local agent plays its episodes of the round. A team that learns from transitions gets those of
    /// all agents, in which case all episodes are returned.
    pub(super) fn play_together(&mut self, remote: RemoteRounds) -> PlayedEpisodes {
        let plan = RoundPlan {
            run_seed: self.settings.run_seed,
            round: self.round,
            episodes: episodes_per_round(self.settings.schedule),
            scene: self.settings.scene.as_ref(),
        };
        let workers = Workers::new(self.pool.as_ref());
        let (groups, team) = (&mut self.groups, &mut *self.team);
        if team.transition_interval().is_some() {
            rollout::play_and_report(groups, team, &plan, workers, remote)
        } else {
            rollout::play(groups, team, &plan, workers)
        }
    }

    /// Keeps the first physics warning of the run.
    pub(super) fn note_warnings(&mut self, warnings: Vec<EpisodeWarning>) {
        if self.physics_warning.is_none() {
            self.physics_warning = warnings.into_iter().min();
        }
    }

    /// All agents learn from the episodes of a round.
    fn learn_from(&mut self, episodes: SharedEpisodes) -> Result<Vec<AgentUpdate>, Diverged> {
        let learned_before = self.episodes_added();
        self.add_to_buffer(episodes)?;
        let updates = self.learn_together(learned_before);
        self.check_updates(&updates)?;
        Ok(updates)
    }

    /// All local agents learn from the team's episodes after the first `learned_before`.
    pub(super) fn learn_together(&mut self, learned_before: u64) -> Vec<AgentUpdate> {
        let agents = local_agents(&self.settings, &*self.team);
        let learners: Vec<_> = agents
            .map(|agent| (agent, learned_before, self.round))
            .collect();
        self.learn(&learners)
    }

    /// Number of the team's episodes so far.
    pub(super) fn episodes_added(&self) -> u64 {
        self.buffer.episodes_added()
    }

    /// Whether the agents have intrinsic rewards whose agreement is measured.
    pub(super) fn compares_bonuses(&self) -> bool {
        self.settings.compares_bonuses
    }

    /// Agents whose episodes have ended learn while the others continue to play.
    fn advance_asynchronously(
        &mut self,
        steps_per_update: u32,
    ) -> Result<UpdatesAndBodies, Diverged> {
        let scene = self.settings.scene.clone();
        let config = AsyncConfig {
            run_seed: self.settings.run_seed,
            episodes: self.settings.stop.max_episodes(),
            steps_per_update,
            scene: scene.as_ref(),
        };
        let count = self.team.agent_count();
        let rollout = self.rollout.take();
        let mut rollout = rollout.unwrap_or_else(|| AsyncRollout::new(config.run_seed, count));
        let (mut updates, mut body_trajectories) = (Vec::new(), Vec::new());
        while self.buffer.episodes_added() < self.episodes_before_round + count as u64 {
            let ended = rollout.play(&mut *self.groups[0].environment, &*self.team, &config);
            if ended.episodes.is_empty() {
                break;
            }
            self.note_warnings(ended.warnings);
            let agents: Vec<u32> = ended.episodes.iter().map(|episode| episode.agent).collect();
            self.add_to_buffer(ended.episodes.into())?;
            body_trajectories.extend(ended.body_trajectories);
            let mut learners = Vec::new();
            for agent in agents {
                let total = self.buffer.episodes_added();
                let (learned_before, earlier_updates) = rollout.begin_update(agent, total, &config);
                learners.push((agent, learned_before, earlier_updates));
            }
            let newest = self.learn(&learners);
            self.check_updates(&newest)?;
            updates.extend(newest);
        }
        self.rollout = Some(rollout);
        Ok((updates, body_trajectories))
    }

    /// Checks episodes that ended in the same step, and adds them to the shared buffer.
    pub(super) fn add_to_buffer(&mut self, mut shared: SharedEpisodes) -> Result<(), Diverged> {
        for episode in &mut shared.episodes {
            check_episode(&self.spec, episode)?;
            episode.round = self.round;
        }
        let SharedEpisodes { episodes, lengths } = shared;
        self.buffer.add_episodes_of_lengths(episodes, lengths);
        Ok(())
    }

    /// Some agents learn at the same time. `learners`: (agent, number of the team's episodes that
    /// it has learned from before, number of its earlier updates), in agent order
    fn learn(&mut self, learners: &[(u32, u64, u32)]) -> Vec<AgentUpdate> {
        let episodes = self.buffer.episodes_after(0);
        let removed = self.buffer.episodes_added() - episodes.len() as u64;
        let learners: Vec<Learner> = learners
            .iter()
            .map(|&(agent, learned_before, earlier_updates)| Learner {
                agent,
                first_new_episode: learned_before.saturating_sub(removed) as usize,
                earlier_updates,
            })
            .collect();
        let request = LearningRequest {
            episodes,
            lengths: self.buffer.lengths_after(0),
            learners: &learners,
        };
        self.team.learn(&request, Workers::new(self.pool.as_ref()))
    }

    /// Checks that all agents have learned finite parameters.
    pub(super) fn check_updates(&self, updates: &[AgentUpdate]) -> Result<(), Diverged> {
        let diverged = updates.iter().find(|update| !update.is_finite);
        diverged.map_or(Ok(()), |diverged| {
            let (agent, round) = (diverged.agent, self.round);
            Err(Diverged::Learning { agent, round })
        })
    }

    /// Plays a round without learning and without measuring it. Episodes are in (agent, episode)
    /// order.
    pub fn play_without_learning(&mut self, plan: &RoundPlan<'_>) -> PlayedEpisodes {
        let workers = Workers::new(self.pool.as_ref());
        rollout::play(&mut self.groups, &mut *self.team, plan, workers)
    }

    /// Agreement of the agents' intrinsic rewards for the steps of the round's first episode; see
    /// [`agreement`].
    pub(super) fn bonus_agreement(&mut self) -> Option<f64> {
        if !self.settings.compares_bonuses {
            return None;
        }
        let probe_episode = self
            .buffer
            .episodes_after(self.episodes_before_round)
            .first()?;
        let bonuses = self.team.probe_bonuses(probe_episode, self.round);
        agreement::mean_rank_correlation(&bonuses)
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
        self.team.agent_count()
    }

    /// The parameters of all networks, with names such as `agent_3.policy.layer_0.weight`; the
    /// names of models that agents share begin with `model_3.`, and those of a bonus model that the
    /// whole team shares with `team.`.
    #[must_use]
    pub fn tensors(&self) -> Vec<Tensor<'_>> {
        self.team.tensors()
    }

    /// The agent seeds, with names such as `agent_3.reward_seeds` and
    /// `agent_3.initial.policy.layer_0.weight`.
    #[must_use]
    pub fn initial_tensors(&self) -> Vec<Tensor<'_>> {
        self.team.initial_tensors()
    }

    /// The newest round's episodes, in (agent, episode) order.
    #[must_use]
    pub fn newest_episodes(&self) -> Vec<&Episode> {
        newest_episodes(&self.buffer, self.episodes_before_round)
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
        self.team.replay()
    }

    /// The replay buffer, to restore its transitions.
    pub fn replay_mut(&mut self) -> Option<&mut Replay> {
        self.team.replay_mut()
    }
}

/// The updates of a round in the order in which agents learned, and the recorded bodies.
type UpdatesAndBodies = (Vec<AgentUpdate>, Vec<BodyTrajectory>);

/// The agents that act and learn in this process.
fn local_agents(settings: &TrainingSettings, team: &dyn Team) -> Range<u32> {
    let local = settings.local_agents.clone();
    local.unwrap_or(0..team.agent_count() as u32)
}

/// Number of episodes that each agent plays in a round in which all agents begin together.
fn episodes_per_round(schedule: Schedule) -> u32 {
    match schedule {
        Schedule::Synchronous { episodes } => episodes.get(),
        Schedule::Lockstep { .. } | Schedule::Asynchronous { .. } => 1,
    }
}

fn thread_pool(threads: usize) -> ThreadPool {
    ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|index| format!("agents-{index}"))
        .build()
        .expect("the system starts threads")
}

/// Groups whose agents are numbered consecutively from `first_agent` on.
fn number_agents(environments: Vec<Box<dyn Environment>>, mut first_agent: u32) -> Vec<CopyGroup> {
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

/// Checks that all numbers of an episode are finite.
fn check_episode(spec: &TaskSpec, episode: &Episode) -> Result<(), Diverged> {
    let width = spec.observation_width();
    let observations = &episode.observations;
    let reward = episode.rewards.iter().position(|x| !x.is_finite());
    let observation = observations.iter().position(|x| !x.is_finite());
    // The first step with such a number. An observation that is not finite may be the reason why the
    // reward of its step is not.
    let row = observation.map(|index| index / width);
    let (step, what, value) = match (row, reward) {
        (Some(row), reward) if reward.is_none_or(|step| row <= step + 1) => {
            let index = observation.unwrap_or_default();
            let name = spec.observations[index % width].name.clone();
            let step = row.saturating_sub(1);
            (step, NonFinite::Observation(name), observations[index])
        }
        (_, Some(step)) => (step, NonFinite::Reward, episode.rewards[step]),
        (_, None) => return Ok(()),
    };
    let names = spec.observations.iter().map(|quantity| &quantity.name);
    let before = observations[step * width..][..width].iter();
    let before = names.zip(before).map(|(name, x)| format!("{name} = {x}"));
    Err(Diverged::Simulation {
        agent: episode.agent,
        episode: episode.episode,
        step,
        what,
        value: value.to_string(),
        observation: before.collect::<Vec<_>>().join(", "),
        place: "check the task's parameters".to_owned(),
    })
}

/// The team's episodes after the first `episodes_before_round`, in (agent, episode) order.
fn newest_episodes(buffer: &SharedBuffer, episodes_before_round: u64) -> Vec<&Episode> {
    let mut episodes: Vec<&Episode> = buffer
        .episodes_after(episodes_before_round)
        .iter()
        .collect();
    episodes.sort_by_key(|episode| (episode.agent, episode.episode));
    episodes
}
