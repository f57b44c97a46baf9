//! Concurrent episodes: every agent acts in its own copy, all copies in lockstep (thesis Alg. 3).
//!
//! [`play`] plays a synchronous round of agents that each act for themselves. What one agent does in its copy is its `Seat`, which
//! asynchronous rounds use as well.

use serde::{Deserialize, Serialize};

use crate::agent::{ActScratch, Agent};
use crate::env::{Environment, Pose, Status};
use crate::experience::Episode;
use crate::random::{Purpose, Stream, stream};
use crate::record::{Footage, SceneSettings};

/// A round about to be played.
#[derive(Clone, Copy, Debug)]
pub struct RoundPlan<'a> {
    /// The run's seed.
    pub run_seed: u64,
    /// Counts from 0.
    pub round: u32,
    /// Episodes that each agent plays.
    pub episodes: u32,
    /// What is filmed.
    pub camera: Option<&'a SceneSettings>,
}

/// What came of a round.
#[derive(Debug, Default)]
pub struct Played {
    /// In (agent, episode) order.
    pub episodes: Vec<Episode>,
    /// The filmed episodes, in the order in which they ended.
    pub footage: Vec<Footage>,
}

/// Those who act in the copies, one a copy.
pub(super) trait Players {
    /// Everyone who plays acts, and time goes on by a step.
    fn step(&mut self, environment: &mut dyn Environment, seats: &mut [Seat]);

    /// The step just made is the newest of an episode.
    fn experience(&mut self, _episode: &Episode) {}

    /// Everyone has experienced the step just made.
    fn step_ended(&mut self) {}
}

/// Plays one round. Agent k acts in copy k; a copy that has played its episodes waits for the others.
pub fn play(
    environment: &mut dyn Environment,
    agents: &[Box<dyn Agent>],
    plan: &RoundPlan<'_>,
) -> Played {
    let mut individuals = Individuals {
        agents,
        room: Room::new(&*environment),
    };
    play_by(environment, &mut individuals, agents.len(), plan)
}

/// Plays one round of whatever `count` players there are.
pub(super) fn play_by(
    environment: &mut dyn Environment,
    players: &mut dyn Players,
    count: usize,
    plan: &RoundPlan<'_>,
) -> Played {
    let mut seats: Vec<Seat> = (0..count as u32)
        .map(|agent| Seat::new(plan.run_seed, agent, plan.round))
        .collect();
    let mut finished: Vec<Vec<Episode>> = vec![Vec::with_capacity(plan.episodes as usize); count];
    let mut footage = Vec::new();
    let first = plan.round.wrapping_mul(plan.episodes);
    for seat in &mut seats {
        seat.start(environment, first, plan.round, plan.camera);
    }
    while seats.iter().any(Seat::is_playing) {
        players.step(environment, &mut seats);
        for (seat, finished) in seats.iter_mut().zip(&mut finished) {
            let ended = seat.observe(environment);
            ended
                .as_ref()
                .or(seat.playing.as_ref())
                .into_iter()
                .for_each(|episode| players.experience(episode));
            let Some(episode) = ended else { continue };
            footage.extend(seat.footage.take());
            finished.push(episode);
            if finished.len() < plan.episodes as usize {
                seat.start(
                    environment,
                    first.wrapping_add(finished.len() as u32),
                    plan.round,
                    plan.camera,
                );
            }
        }
        players.step_ended();
    }
    Played {
        episodes: finished.into_iter().flatten().collect(),
        footage,
    }
}

/// Agents that each act for themselves.
struct Individuals<'a> {
    agents: &'a [Box<dyn Agent>],
    room: Room,
}

impl Players for Individuals<'_> {
    fn step(&mut self, environment: &mut dyn Environment, seats: &mut [Seat]) {
        self.room.step(environment, self.agents, seats);
    }
}

/// Room for the actions of all agents, reused from step to step.
#[derive(Debug, Default)]
pub(super) struct Room {
    scratch: ActScratch,
    actions: Vec<f32>,
    log_prob: Vec<f32>,
}

impl Room {
    pub(super) fn new(environment: &dyn Environment) -> Self {
        let width = environment.spec().action_width();
        let copies = environment.statuses().len();
        Self {
            scratch: ActScratch::default(),
            actions: vec![0.0; copies * width],
            log_prob: vec![0.0; width],
        }
    }

    /// Every agent that plays acts, and time goes on by a step.
    pub(super) fn step(
        &mut self,
        environment: &mut dyn Environment,
        agents: &[Box<dyn Agent>],
        seats: &mut [Seat],
    ) {
        let (observed, acted) = (
            environment.spec().observation_width(),
            environment.spec().action_width(),
        );
        let rows = environment
            .observations()
            .chunks_exact(observed)
            .zip(self.actions.chunks_exact_mut(acted));
        for ((agent, seat), (observation, action)) in agents.iter().zip(seats).zip(rows) {
            if let Some(episode) = &mut seat.playing {
                agent.act(
                    observation,
                    &mut seat.actions,
                    &mut self.scratch,
                    action,
                    &mut self.log_prob,
                );
                episode.actions.extend_from_slice(action);
                episode.log_probs.extend_from_slice(&self.log_prob);
            }
        }
        environment.step(&self.actions);
    }
}

/// One agent's place: its streams, and the episode that it plays.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Seat {
    agent: u32,
    resets: Stream,
    actions: Stream,
    playing: Option<Episode>,
    /// Of the episode that plays, or has just ended, if it is filmed.
    pub(super) footage: Option<Footage>,
}

impl Seat {
    /// A seat whose starts and actions are those of (run seed, agent, `round`).
    pub(super) fn new(run_seed: u64, agent: u32, round: u32) -> Self {
        Self {
            agent,
            resets: stream(run_seed, Purpose::Reset, agent, round),
            actions: stream(run_seed, Purpose::Action, agent, round),
            playing: None,
            footage: None,
        }
    }

    pub(super) fn is_playing(&self) -> bool {
        self.playing.is_some()
    }

    /// The agent chooses its next action by `choose`, which is given the agent's stream; nothing where it does not play.
    pub(super) fn act(&mut self, choose: impl FnOnce(&mut Stream) -> (f32, f32)) -> Option<f32> {
        let episode = self.playing.as_mut()?;
        let (action, log_prob) = choose(&mut self.actions);
        episode.actions.push(action);
        episode.log_probs.push(log_prob);
        Some(action)
    }

    /// Starts the agent's episode number `episode`.
    pub(super) fn start(
        &mut self,
        environment: &mut dyn Environment,
        episode: u32,
        round: u32,
        camera: Option<&SceneSettings>,
    ) {
        environment.reset(self.agent as usize, &mut self.resets);
        let mut started = Episode::start(self.agent, episode, round, environment.spec());
        started
            .observations
            .extend_from_slice(self.observation(environment));
        self.playing = Some(started);
        let filming = camera.is_some_and(|camera| camera.films(self.agent, episode));
        self.footage = filming.then(|| Footage {
            agent: self.agent,
            episode,
            ..Footage::default()
        });
        self.film(environment);
    }

    /// Takes in what the step just made brought to this agent; returns the episode if that was its end.
    pub(super) fn observe(&mut self, environment: &dyn Environment) -> Option<Episode> {
        let mut episode = self.playing.take()?;
        let copy = self.agent as usize;
        episode.rewards.push(environment.rewards()[copy]);
        episode
            .observations
            .extend_from_slice(self.observation(environment));
        self.film(environment);
        episode.outcome = environment.statuses()[copy];
        if episode.outcome == Status::Running {
            self.playing = Some(episode);
            return None;
        }
        Some(episode)
    }

    fn observation<'a>(&self, environment: &'a dyn Environment) -> &'a [f32] {
        let (copy, width) = (self.agent as usize, environment.spec().observation_width());
        &environment.observations()[copy * width..(copy + 1) * width]
    }

    fn film(&mut self, environment: &dyn Environment) {
        let (Some(scene), Some(footage)) = (environment.scene(), &mut self.footage) else {
            return;
        };
        let start = footage.poses.len();
        footage
            .poses
            .resize(start + scene.bodies.len(), Pose::default());
        environment.poses(self.agent as usize, &mut footage.poses[start..]);
        let before = footage.forces.len();
        environment.forces(
            self.agent as usize,
            &footage.poses[start..],
            &mut footage.forces,
        );
        footage.forces_per_row.push(footage.forces.len() - before);
    }
}
