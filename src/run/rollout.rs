//! Concurrent episodes: every agent acts in its own copy, all copies in lockstep (thesis Alg. 3).

use crate::agent::{ActScratch, Agent};
use crate::env::{Environment, Pose, Status};
use crate::experience::Episode;
use crate::random::{Purpose, Stream, stream};
use crate::record::Footage;

/// Which episode is filmed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Camera {
    /// Whose.
    pub agent: u32,
    /// Every how many of that agent's episodes.
    pub every: u32,
}

/// A round about to be played.
#[derive(Clone, Copy, Debug)]
pub struct RoundPlan {
    /// The run's seed.
    pub run_seed: u64,
    /// Counts from 0.
    pub round: u32,
    /// Episodes that each agent plays.
    pub episodes: u32,
    /// What is filmed.
    pub camera: Option<Camera>,
}

/// What came of a round.
#[derive(Debug, Default)]
pub struct Played {
    /// In (agent, episode) order.
    pub episodes: Vec<Episode>,
    /// The filmed episode, if the camera was on.
    pub footage: Option<Footage>,
}

/// Plays one round. Agent k acts in copy k; a copy that has played its episodes waits for the others.
pub fn play(environment: &mut dyn Environment, agents: &[Box<dyn Agent>], plan: &RoundPlan) -> Played {
    let mut seats: Vec<Seat> = (0..agents.len() as u32).map(|agent| Seat::new(environment, agent, plan)).collect();
    let mut scratch = ActScratch::default();
    let mut actions = vec![0.0; agents.len() * environment.spec().action_width()];
    let mut log_prob = vec![0.0; environment.spec().action_width()];
    while environment.statuses().contains(&Status::Running) {
        act(environment, agents, &mut seats, &mut scratch, &mut actions, &mut log_prob);
        environment.step(&actions);
        for seat in &mut seats {
            seat.observe(environment, plan);
        }
    }
    let footage = seats.iter_mut().find_map(|seat| seat.footage.take());
    Played { episodes: seats.into_iter().flat_map(|seat| seat.finished).collect(), footage }
}

fn act(
    environment: &dyn Environment,
    agents: &[Box<dyn Agent>],
    seats: &mut [Seat],
    scratch: &mut ActScratch,
    actions: &mut [f32],
    log_prob: &mut [f32],
) {
    let (observed, acted) = (environment.spec().observation_width(), environment.spec().action_width());
    let rows = environment.observations().chunks_exact(observed).zip(actions.chunks_exact_mut(acted));
    for ((agent, seat), (observation, action)) in agents.iter().zip(seats).zip(rows) {
        if let Some(episode) = &mut seat.playing {
            agent.act(observation, &mut seat.actions, scratch, action, log_prob);
            episode.actions.extend_from_slice(action);
            episode.log_probs.extend_from_slice(log_prob);
        }
    }
}

/// One agent's place in the round: its streams and its episodes.
struct Seat {
    agent: u32,
    resets: Stream,
    actions: Stream,
    playing: Option<Episode>,
    filming: bool,
    footage: Option<Footage>,
    finished: Vec<Episode>,
}

impl Seat {
    fn new(environment: &mut dyn Environment, agent: u32, plan: &RoundPlan) -> Self {
        let mut seat = Self {
            agent,
            resets: stream(plan.run_seed, Purpose::Reset, agent, plan.round),
            actions: stream(plan.run_seed, Purpose::Action, agent, plan.round),
            playing: None,
            filming: false,
            footage: None,
            finished: Vec::with_capacity(plan.episodes as usize),
        };
        seat.start_episode(environment, plan);
        seat
    }

    fn start_episode(&mut self, environment: &mut dyn Environment, plan: &RoundPlan) {
        let copy = self.agent as usize;
        environment.reset(copy, &mut self.resets);
        let episode = plan.round * plan.episodes + self.finished.len() as u32;
        let mut started = Episode::start(self.agent, episode, plan.round, environment.spec());
        started.observations.extend_from_slice(row(environment.observations(), copy, environment.spec().observation_width()));
        self.playing = Some(started);
        let due = |camera: Camera| camera.agent == self.agent && episode.is_multiple_of(camera.every);
        self.filming = self.footage.is_none() && plan.camera.is_some_and(due);
        if self.filming {
            self.footage = Some(Footage { agent: self.agent, episode, poses: Vec::new() });
            self.film(environment);
        }
    }

    /// Takes in what the step just made brought to this agent.
    fn observe(&mut self, environment: &mut dyn Environment, plan: &RoundPlan) {
        let Some(mut episode) = self.playing.take() else { return };
        let copy = self.agent as usize;
        episode.rewards.push(environment.rewards()[copy]);
        episode.observations.extend_from_slice(row(environment.observations(), copy, environment.spec().observation_width()));
        if self.filming {
            self.film(environment);
        }
        let status = environment.statuses()[copy];
        if status == Status::Running {
            self.playing = Some(episode);
            return;
        }
        episode.outcome = status;
        self.finished.push(episode);
        if self.finished.len() < plan.episodes as usize {
            self.start_episode(environment, plan);
        }
    }

    fn film(&mut self, environment: &dyn Environment) {
        let (Some(scene), Some(footage)) = (environment.scene(), &mut self.footage) else { return };
        let start = footage.poses.len();
        footage.poses.resize(start + scene.bodies.len(), Pose::default());
        environment.poses(self.agent as usize, &mut footage.poses[start..]);
    }
}

fn row(rows: &[f32], index: usize, width: usize) -> &[f32] {
    &rows[index * width..(index + 1) * width]
}
