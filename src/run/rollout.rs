//! Rollouts: every agent acts in its own copy of the environment, all copies one step at a time
//! (thesis Alg. 3).
//!
//! [`play`] plays a round that starts and ends for all agents together. An `EpisodeSlot` holds the
//! current episode of one agent; asynchronous rollouts use it as well.

use serde::{Deserialize, Serialize};

use crate::record::{BodyTrajectory, SceneSettings};
use seedbed_env::random::{Purpose, Stream, stream};
use seedbed_env::{Environment, Pose, Status};
use seedbed_learn::experience::Episode;
use seedbed_learn::team::{ActionRequest, Team, Workers};

/// Settings of one round.
#[derive(Clone, Copy, Debug)]
pub struct RoundPlan<'a> {
    /// The run seed.
    pub run_seed: u64,
    /// Number of the round, from 0.
    pub round: u32,
    /// Number of episodes that each agent plays.
    pub episodes: u32,
    /// Whose bodies are recorded, and in which episodes; `None` records no bodies.
    pub scene: Option<&'a SceneSettings>,
}

/// The episodes of a round or of a part of it.
#[derive(Debug, Default)]
pub struct PlayedEpisodes {
    /// The episodes, in (agent, episode) order.
    pub episodes: Vec<Episode>,
    /// The recorded bodies, in the order in which their episodes ended.
    pub body_trajectories: Vec<BodyTrajectory>,
}

/// Plays one round. Agent k acts in copy k; a copy that has played its episodes waits for the
/// others. With `learning`, the team receives every transition and may learn between steps.
pub fn play(
    environment: &mut dyn Environment,
    team: &mut dyn Team,
    plan: &RoundPlan<'_>,
    learning: Option<Workers<'_>>,
) -> PlayedEpisodes {
    team.begin_round(plan.round);
    let count = team.agent_count();
    let mut slots = EpisodeSlots::new(plan.run_seed, count, plan.round);
    let mut finished_by_agent: Vec<Vec<Episode>> = vec![Vec::new(); count];
    let mut body_trajectories = Vec::new();
    let first_episode = plan.round.wrapping_mul(plan.episodes);
    for slot in &mut slots.slots {
        slot.start(environment, first_episode, plan.round, plan.scene);
    }
    while slots.any_playing() {
        slots.step(environment, team);
        for (slot, finished) in slots.slots.iter_mut().zip(&mut finished_by_agent) {
            let ended = slot.observe(environment);
            if let Some(newest) = ended.as_ref().or(slot.playing.as_ref())
                && learning.is_some()
            {
                team.add_transition(newest);
            }
            let Some(episode) = ended else { continue };
            body_trajectories.extend(slot.body_trajectory.take());
            finished.push(episode);
            if finished.len() < plan.episodes as usize {
                let next = first_episode.wrapping_add(finished.len() as u32);
                slot.start(environment, next, plan.round, plan.scene);
            }
        }
        if let Some(workers) = learning {
            team.end_step(workers);
        }
    }
    PlayedEpisodes {
        episodes: finished_by_agent.into_iter().flatten().collect(),
        body_trajectories,
    }
}

/// The episodes that a team is playing, one slot per agent.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct EpisodeSlots {
    pub(super) slots: Vec<EpisodeSlot>,
    /// The stream from which each agent draws its actions: `[K]`.
    action_streams: Vec<Stream>,
    #[serde(skip)]
    buffers: StepBuffers,
}

/// Memory for one step of all agents, reused from step to step.
#[derive(Debug, Default)]
struct StepBuffers {
    playing: Vec<bool>,
    actions: Vec<f32>,
    log_probs: Vec<f32>,
}

impl EpisodeSlots {
    /// Slots for `count` agents, with the random streams of round number `round`.
    pub(super) fn new(run_seed: u64, count: usize, round: u32) -> Self {
        let agents = 0..count as u32;
        Self {
            slots: agents
                .clone()
                .map(|agent| EpisodeSlot::new(run_seed, agent, round))
                .collect(),
            action_streams: agents
                .map(|agent| stream(run_seed, Purpose::Action, agent, round))
                .collect(),
            buffers: StepBuffers::default(),
        }
    }

    /// Gives an agent a new slot, with the random streams of round number `round`.
    pub(super) fn renew(&mut self, run_seed: u64, agent: u32, round: u32) -> &mut EpisodeSlot {
        self.action_streams[agent as usize] = stream(run_seed, Purpose::Action, agent, round);
        let slot = &mut self.slots[agent as usize];
        *slot = EpisodeSlot::new(run_seed, agent, round);
        slot
    }

    pub(super) fn any_playing(&self) -> bool {
        self.slots.iter().any(EpisodeSlot::is_playing)
    }

    /// All playing agents act, and all environments advance by one step.
    pub(super) fn step(&mut self, environment: &mut dyn Environment, team: &mut dyn Team) {
        let width = environment.spec().action_width();
        let buffers = &mut self.buffers;
        buffers.playing.clear();
        buffers
            .playing
            .extend(self.slots.iter().map(EpisodeSlot::is_playing));
        buffers.actions.resize(self.slots.len() * width, 0.0);
        buffers.log_probs.resize(self.slots.len() * width, 0.0);
        team.act(&mut ActionRequest {
            observations: environment.observations(),
            playing: &buffers.playing,
            random: &mut self.action_streams,
            actions: &mut buffers.actions,
            log_probs: &mut buffers.log_probs,
        });
        let rows = buffers.actions.chunks_exact(width);
        let rows = rows.zip(buffers.log_probs.chunks_exact(width));
        for (slot, (action, log_prob)) in self.slots.iter_mut().zip(rows) {
            if let Some(episode) = &mut slot.playing {
                episode.actions.extend_from_slice(action);
                episode.log_probs.extend_from_slice(log_prob);
            }
        }
        environment.step(&buffers.actions);
    }
}

/// The episode that one agent is playing, if any.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct EpisodeSlot {
    agent: u32,
    resets: Stream,
    playing: Option<Episode>,
    /// The bodies during the episode that is playing or has just ended, if they are recorded.
    pub(super) body_trajectory: Option<BodyTrajectory>,
}

impl EpisodeSlot {
    /// A slot that draws start states from the random stream of (run seed, agent, `round`).
    fn new(run_seed: u64, agent: u32, round: u32) -> Self {
        Self {
            agent,
            resets: stream(run_seed, Purpose::Reset, agent, round),
            playing: None,
            body_trajectory: None,
        }
    }

    pub(super) fn is_playing(&self) -> bool {
        self.playing.is_some()
    }

    /// Starts the agent's episode number `episode`.
    pub(super) fn start(
        &mut self,
        environment: &mut dyn Environment,
        episode: u32,
        round: u32,
        scene: Option<&SceneSettings>,
    ) {
        environment.reset(self.agent as usize, &mut self.resets);
        let mut started = Episode::start(self.agent, episode, round, environment.spec());
        let observation = self.observation(environment);
        started.observations.extend_from_slice(observation);
        self.playing = Some(started);
        let recorded = scene.is_some_and(|scene| scene.records(self.agent, episode));
        self.body_trajectory = recorded.then(|| BodyTrajectory {
            agent: self.agent,
            episode,
            ..BodyTrajectory::default()
        });
        self.record_bodies(environment);
    }

    /// Adds the result of the latest step to the episode; returns the episode if it has ended.
    pub(super) fn observe(&mut self, environment: &dyn Environment) -> Option<Episode> {
        let mut episode = self.playing.take()?;
        let copy = self.agent as usize;
        episode.rewards.push(environment.rewards()[copy]);
        let observation = self.observation(environment);
        episode.observations.extend_from_slice(observation);
        self.record_bodies(environment);
        episode.outcome = environment.statuses()[copy];
        if episode.outcome == Status::Running {
            self.playing = Some(episode);
            return None;
        }
        Some(episode)
    }

    /// Observation of the agent's copy of the environment.
    fn observation<'a>(&self, environment: &'a dyn Environment) -> &'a [f32] {
        let width = environment.spec().observation_width();
        let copy = self.agent as usize;
        &environment.observations()[copy * width..(copy + 1) * width]
    }

    fn record_bodies(&mut self, environment: &dyn Environment) {
        let (Some(scene), Some(trajectory)) = (environment.scene(), &mut self.body_trajectory)
        else {
            return;
        };
        let copy = self.agent as usize;
        let first_pose = trajectory.poses.len();
        let body_count = scene.bodies.len();
        trajectory
            .poses
            .resize(first_pose + body_count, Pose::default());
        environment.poses(copy, &mut trajectory.poses[first_pose..]);
        let forces_before = trajectory.forces.len();
        environment.forces(
            copy,
            &trajectory.poses[first_pose..],
            &mut trajectory.forces,
        );
        let added_forces = trajectory.forces.len() - forces_before;
        trajectory.forces_per_row.push(added_forces);
    }
}
