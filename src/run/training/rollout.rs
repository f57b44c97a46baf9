//! Synchronous rounds: every agent acts in its own copy of the environment (thesis Alg. 3).
//!
//! Copies and agents are divided into groups, which play on different threads. Agents do not
//! influence each other within a round, except through a team that learns during episodes: it gets
//! the transitions of all groups in the order of steps and agents. So results do not depend on the
//! division.

use std::ops::Range;

use super::episode_slots::EpisodeSlots;
use super::episode_warning::EpisodeWarning;
use super::remote_steps::{PlayedSteps, RemoteRounds};
use crate::run::facts::EpisodeDetails;
use crate::scenario::recording::SceneSettings;
use seedbed_env::Environment;
use seedbed_env::gymnasium::{EnvironmentFailure, catch_failure};
use seedbed_learn::cancellation::cancellation_point;
use seedbed_learn::experience::Episode;
use seedbed_learn::rollout::AgentRound;
use seedbed_learn::team::{Team, Workers};

/// Settings of one round.
#[derive(Clone, Copy, Debug)]
pub struct RoundPlan<'a> {
    /// The run seed.
    pub run_seed: u64,
    /// Number of the round, from 0.
    pub round: u32,
    /// Number of each agent's first episode.
    pub first_episode: u32,
    /// Number of episodes that each agent plays.
    pub episodes: u32,
    /// Which bodies are recorded, if any.
    pub scene: Option<&'a SceneSettings>,
}

/// The episodes of a round or of a part of it.
#[derive(Debug, Default)]
pub struct PlayedEpisodes {
    /// The episodes, in (agent, episode) order.
    pub episodes: Vec<Episode>,
    /// What is recorded beside the episodes, in (agent, episode) order.
    pub details: Vec<EpisodeDetails>,
    /// The physics warnings, at most one per episode.
    pub warnings: Vec<EpisodeWarning>,
}

/// Copies of the environment that one thread steps, and their agents.
pub(super) struct CopyGroup {
    /// Number of the agent that acts in the first copy.
    pub(super) first_agent: u32,
    pub(super) environment: Box<dyn Environment>,
}

/// Plays one round of the local agents. A copy that has played its episodes waits for the others.
pub(super) fn play(
    groups: &mut [CopyGroup],
    team: &mut dyn Team,
    plan: &RoundPlan<'_>,
    workers: Workers<'_>,
) -> PlayedEpisodes {
    team.begin_round(plan.round);
    let mut playing = begin_groups(groups, plan, workers);
    workers.for_each(&mut playing, |group| group.play(team, None));
    collect_episodes(playing.into_iter().map(|group| group.round))
}

/// Plays one round for a team that learns from transitions, possibly between steps. Returns the
/// episodes of all agents, and the bodies that were recorded for local agents.
pub(super) fn play_and_report(
    groups: &mut [CopyGroup],
    team: &mut dyn Team,
    plan: &RoundPlan<'_>,
    workers: Workers<'_>,
    mut remote: RemoteRounds,
) -> PlayedEpisodes {
    team.begin_round(plan.round);
    let mut playing = begin_groups(groups, plan, workers);
    let mut is_over = false;
    while !is_over {
        let (reader, interval): (&dyn Team, _) = (team, team.transition_interval());
        workers.for_each(&mut playing, |group| group.play(reader, interval));
        let mut rounds: Vec<_> = playing.iter_mut().map(|group| &mut group.round).collect();
        is_over = report_transitions(&mut rounds, &mut remote, team, workers);
    }
    let local = collect_episodes(playing.into_iter().map(|group| group.round));
    PlayedEpisodes {
        episodes: remote.with_local(local.episodes),
        ..local
    }
}

fn begin_groups<'a>(
    groups: &'a mut [CopyGroup],
    plan: &RoundPlan<'a>,
    workers: Workers<'_>,
) -> Vec<PlayingGroup<'a>> {
    let groups = groups.iter_mut().collect();
    workers.map(groups, |group| PlayingGroup::new(group, plan))
}

/// Passes the transitions that were played since the last call to the team, in the order of steps
/// and agents. Returns whether all agents have played their episodes.
pub(super) fn report_transitions(
    rounds: &mut [&mut GroupRound<'_>],
    remote: &mut RemoteRounds,
    team: &mut dyn Team,
    workers: Workers<'_>,
) -> bool {
    let exchanged = remote.exchange(played_steps(rounds, remote));
    for _ in 0..exchanged.steps {
        remote.report_step_before(team);
        for round in &mut *rounds {
            round.report_step(team);
        }
        remote.report_step_after(team);
        team.end_step(workers);
    }
    for round in rounds {
        round.unreported_steps = 0;
    }
    exchanged.is_over
}

/// What local agents have played since the last call of [`report_transitions`]. Without other ranks,
/// nobody needs its parts.
fn played_steps(rounds: &[&mut GroupRound<'_>], remote: &RemoteRounds) -> PlayedSteps {
    let steps = rounds.iter().map(|round| round.unreported_steps).max();
    let is_over = rounds.iter().all(|round| round.is_over());
    let mut played = PlayedSteps::new(steps.unwrap_or(0), is_over);
    if !remote.is_empty() {
        for round in rounds {
            for (agent, slot) in round.agents.iter().zip(&round.slots.slots) {
                played.add_agent(agent, slot.playing.as_ref());
            }
        }
    }
    played
}

/// The episodes of rounds that are over, in the order of the groups.
pub(super) fn collect_episodes<'a>(
    rounds: impl IntoIterator<Item = GroupRound<'a>>,
) -> PlayedEpisodes {
    let mut played = PlayedEpisodes::default();
    for round in rounds {
        let agents = round.agents.into_iter();
        played
            .episodes
            .extend(agents.flat_map(|agent| agent.finished));
        played.details.extend(round.details);
        played.warnings.extend(round.warnings);
    }
    played
        .details
        .sort_by_key(|trajectory| (trajectory.agent, trajectory.episode));
    played
}

/// A group with its copies, which no other group shares.
struct PlayingGroup<'a> {
    environment: &'a mut dyn Environment,
    round: GroupRound<'a>,
}

impl<'a> PlayingGroup<'a> {
    fn new(group: &'a mut CopyGroup, plan: &RoundPlan<'a>) -> Self {
        let environment = &mut *group.environment;
        let agents = group.first_agent..group.first_agent + environment.copies() as u32;
        let begun = catch_failure(|| GroupRound::begin(environment, agents, 0, *plan));
        let round = begun.unwrap_or_else(|failure| {
            let episode = plan.first_episode;
            let agent = |copy| group.first_agent + copy as u32;
            let place = |copy| format!("agent {}, episode {episode}", agent(copy));
            located(failure, place).unwind()
        });
        Self { environment, round }
    }

    /// Plays to the end of the round, or at most `max_steps` steps.
    fn play(&mut self, team: &dyn Team, max_steps: Option<u32>) {
        let Self { environment, round } = self;
        while !round.is_over() && max_steps.is_none_or(|max| round.unreported_steps < max) {
            cancellation_point();
            let stepped = catch_failure(|| {
                let unreported_steps = round.unreported_steps;
                round.slots.step(&mut **environment, team, unreported_steps);
                round.observe(&mut **environment, max_steps.is_some());
            });
            stepped.unwrap_or_else(|failure| {
                located(failure, |copy| round.slots.place_of(copy)).unwind()
            });
        }
    }
}

/// The failure with agent and episode, if it is of one copy.
pub(super) fn located(
    mut failure: EnvironmentFailure,
    place: impl Fn(usize) -> String,
) -> EnvironmentFailure {
    failure.place = failure.copy.map(place).unwrap_or_default();
    failure
}

/// The round of a group of consecutive agents, which act in consecutive copies of an environment.
pub(super) struct GroupRound<'a> {
    plan: RoundPlan<'a>,
    slots: EpisodeSlots,
    agents: Vec<AgentRound>,
    details: Vec<EpisodeDetails>,
    warnings: Vec<EpisodeWarning>,
    /// Number of steps whose transitions the team has not got yet.
    unreported_steps: u32,
}

impl<'a> GroupRound<'a> {
    /// Starts the first episode of each agent, in the copies from `first_copy` on.
    pub(super) fn begin(
        environment: &mut dyn Environment,
        agents: Range<u32>,
        first_copy: usize,
        plan: RoundPlan<'a>,
    ) -> Self {
        let count = agents.len();
        let mut round = Self {
            plan,
            slots: EpisodeSlots::new(plan.run_seed, agents, first_copy, plan.round),
            agents: Vec::new(),
            details: Vec::new(),
            warnings: Vec::new(),
            unreported_steps: 0,
        };
        round.agents.resize_with(count, AgentRound::default);
        for slot in &mut round.slots.slots {
            slot.begin_reset(environment);
        }
        round.start_episodes(environment);
        round
    }

    /// Whether all agents have played their episodes.
    pub(super) fn is_over(&self) -> bool {
        !self.slots.any_playing()
    }

    /// Number of steps whose transitions the team has not got yet.
    pub(super) fn unreported_steps(&self) -> u32 {
        self.unreported_steps
    }

    /// All playing agents choose their next actions; see [`EpisodeSlots::act`].
    pub(super) fn act(&mut self, environment: &dyn Environment, team: &dyn Team) -> &[f32] {
        self.slots.act(environment, team, self.unreported_steps)
    }

    /// Adds the result of the latest step to all episodes. With `is_reported`, the team will get the
    /// transitions.
    pub(super) fn observe(&mut self, environment: &mut dyn Environment, is_reported: bool) {
        let mut resets = false;
        for index in 0..self.agents.len() {
            resets |= self.observe_agent(index, environment);
        }
        if resets {
            self.start_episodes(environment);
        }
        self.unreported_steps += u32::from(is_reported);
    }

    /// Starts the next episode of all agents whose reset has begun.
    fn start_episodes(&mut self, environment: &mut dyn Environment) {
        environment.finish_resets();
        let plan = self.plan;
        for (slot, agent) in self.slots.slots.iter_mut().zip(&self.agents) {
            let played = agent.finished.len() as u32;
            if !slot.is_playing() && played < plan.episodes {
                let episode = plan.first_episode.wrapping_add(played);
                slot.start(environment, episode, plan.round, plan.scene);
            }
        }
    }

    /// Adds the result of the latest step to an agent's episode. If it has ended and is followed by another one, begins
    /// the reset and returns true.
    fn observe_agent(&mut self, index: usize, environment: &mut dyn Environment) -> bool {
        let slot = &mut self.slots.slots[index];
        let Some(episode) = slot.observe(environment) else {
            return false;
        };
        self.details.extend(slot.details.take());
        self.warnings.extend(slot.warning.take());
        let finished = &mut self.agents[index].finished;
        finished.push(episode);
        let continues = finished.len() < self.plan.episodes as usize;
        if continues {
            slot.begin_reset(environment);
        }
        continues
    }

    /// Passes the next transition of each agent that has one to the team.
    fn report_step(&mut self, team: &mut dyn Team) {
        for (agent, slot) in self.agents.iter_mut().zip(&self.slots.slots) {
            agent.report_step(slot.playing.as_ref(), team);
        }
    }
}
