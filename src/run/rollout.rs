//! Synchronous rounds: every agent acts in its own copy of the environment (thesis Alg. 3).
//!
//! Copies and agents are divided into groups, which play on different threads. Agents do not
//! influence each other within a round, except through a team that learns during episodes: it gets
//! the transitions of all groups in the order of steps and agents. So results do not depend on the
//! division.

use super::episode_slots::EpisodeSlots;
use crate::record::{BodyTrajectory, SceneSettings};
use seedbed_env::Environment;
use seedbed_learn::experience::Episode;
use seedbed_learn::team::{Team, Workers};

/// Settings of one round.
#[derive(Clone, Copy, Debug)]
pub struct RoundPlan<'a> {
    /// The run seed.
    pub run_seed: u64,
    /// Number of the round, from 0.
    pub round: u32,
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
    /// The recorded bodies, in (agent, episode) order.
    pub body_trajectories: Vec<BodyTrajectory>,
}

/// Copies of the environment that one thread steps, and their agents.
pub(super) struct CopyGroup {
    /// Number of the agent that acts in the first copy.
    pub(super) first_agent: u32,
    pub(super) environment: Box<dyn Environment>,
}

/// Plays one round. A copy that has played its episodes waits for the others. With `learning`, the
/// team gets transitions if it learns from them, and may learn between steps.
pub(super) fn play(
    groups: &mut [CopyGroup],
    team: &mut dyn Team,
    plan: &RoundPlan<'_>,
    learning: bool,
    workers: Workers<'_>,
) -> PlayedEpisodes {
    team.begin_round(plan.round);
    let mut rounds: Vec<GroupRound<'_>> = groups
        .iter_mut()
        .map(|group| GroupRound::new(group, plan))
        .collect();
    while rounds.iter().any(|round| round.slots.any_playing()) {
        let interval = team.transition_interval().filter(|_| learning);
        let reader: &dyn Team = team;
        workers.for_each(&mut rounds, |round| round.play(reader, interval));
        if interval.is_some() {
            report_transitions(&mut rounds, team, workers);
        }
    }
    collect_episodes(rounds)
}

/// Passes the transitions that were played since the last call to the team, in the order of steps
/// and agents.
fn report_transitions(rounds: &mut [GroupRound<'_>], team: &mut dyn Team, workers: Workers<'_>) {
    let steps = rounds.iter().map(|round| round.unreported_steps).max();
    for _ in 0..steps.unwrap_or(0) {
        for round in &mut *rounds {
            round.report_step(team);
        }
        team.end_step(workers);
    }
    for round in rounds {
        round.unreported_steps = 0;
    }
}

fn collect_episodes(rounds: Vec<GroupRound<'_>>) -> PlayedEpisodes {
    let mut played = PlayedEpisodes::default();
    for round in rounds {
        let agents = round.agents.into_iter();
        played
            .episodes
            .extend(agents.flat_map(|agent| agent.finished));
        played.body_trajectories.extend(round.body_trajectories);
    }
    played
        .body_trajectories
        .sort_by_key(|trajectory| (trajectory.agent, trajectory.episode));
    played
}

/// The round of one group.
struct GroupRound<'a> {
    environment: &'a mut dyn Environment,
    plan: &'a RoundPlan<'a>,
    slots: EpisodeSlots,
    agents: Vec<AgentRound>,
    body_trajectories: Vec<BodyTrajectory>,
    /// Number of steps whose transitions the team has not got yet.
    unreported_steps: u32,
}

/// The round of one agent.
#[derive(Default)]
struct AgentRound {
    /// The episodes that have ended.
    finished: Vec<Episode>,
    /// The next transition for the team: index of its episode in this round, and its step.
    unreported: (usize, usize),
}

impl<'a> GroupRound<'a> {
    /// Starts the first episode of each agent.
    fn new(group: &'a mut CopyGroup, plan: &'a RoundPlan<'a>) -> Self {
        let count = group.environment.copies();
        let agents = group.first_agent..group.first_agent + count as u32;
        let mut round = Self {
            environment: &mut *group.environment,
            plan,
            slots: EpisodeSlots::new(plan.run_seed, agents, plan.round),
            agents: Vec::new(),
            body_trajectories: Vec::new(),
            unreported_steps: 0,
        };
        round.agents.resize_with(count, AgentRound::default);
        (0..count).for_each(|copy| round.start_episode(copy));
        round
    }

    /// Starts the next episode of an agent.
    fn start_episode(&mut self, copy: usize) {
        let plan = self.plan;
        let first_episode = plan.round.wrapping_mul(plan.episodes);
        let episode = first_episode.wrapping_add(self.agents[copy].finished.len() as u32);
        self.slots.slots[copy].start(&mut *self.environment, episode, plan.round, plan.scene);
    }

    /// Plays to the end of the round, or at most `max_steps` steps.
    fn play(&mut self, team: &dyn Team, max_steps: Option<u32>) {
        while self.slots.any_playing() && max_steps.is_none_or(|max| self.unreported_steps < max) {
            self.slots
                .step(&mut *self.environment, team, self.unreported_steps);
            (0..self.agents.len()).for_each(|copy| self.observe(copy));
            if max_steps.is_some() {
                self.unreported_steps += 1;
            }
        }
    }

    /// Adds the result of the latest step to an agent's episode. If it has ended, the next begins.
    fn observe(&mut self, copy: usize) {
        let slot = &mut self.slots.slots[copy];
        let Some(episode) = slot.observe(&*self.environment) else {
            return;
        };
        self.body_trajectories.extend(slot.body_trajectory.take());
        let finished = &mut self.agents[copy].finished;
        finished.push(episode);
        if finished.len() < self.plan.episodes as usize {
            self.start_episode(copy);
        }
    }

    /// Passes the next transition of each agent that has one to the team.
    fn report_step(&mut self, team: &mut dyn Team) {
        for (agent, slot) in self.agents.iter_mut().zip(&self.slots.slots) {
            let (index, step) = agent.unreported;
            let finished = agent.finished.get(index);
            let Some(episode) = finished.or(slot.playing.as_ref()) else {
                continue;
            };
            if step == episode.length() {
                continue;
            }
            team.add_transition(episode, step);
            let is_complete = finished.is_some() && step + 1 == episode.length();
            agent.unreported = if is_complete {
                (index + 1, 0)
            } else {
                (index, step + 1)
            };
        }
    }
}
