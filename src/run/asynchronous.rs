//! Asynchronous rounds (thesis Fig. 5.2): an agent whose episode has ended learns at once from what has reached it, while the others
//! go on. Time is the environments' steps, so the schedule is the same whatever the machine does.

use serde::{Deserialize, Serialize};

use super::rollout::{Room, Seat};
use crate::agent::Agent;
use crate::env::Environment;
use crate::experience::Episode;
use crate::record::{Footage, SceneSettings};

/// The team in the middle of things.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Desk {
    places: Vec<Place>,
    seats: Vec<Seat>,
    #[serde(skip)]
    room: Option<Room>,
}

/// How far one agent has come.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Place {
    /// Episodes begun.
    begun: u32,
    /// Steps for which it still learns and does not act.
    learning: u32,
    /// Episodes of the team that it has learned from.
    learned: u64,
}

/// How episodes follow each other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace<'a> {
    pub(super) run_seed: u64,
    /// Episodes that each agent plays in all.
    pub(super) episodes: u32,
    /// Steps of the others that an update takes.
    pub(super) learning: u32,
    pub(super) camera: Option<&'a SceneSettings>,
}

/// Episodes that ended in the same step, in agent order, and their films.
#[derive(Debug, Default)]
pub(super) struct Ended {
    pub(super) episodes: Vec<Episode>,
    pub(super) footage: Vec<Footage>,
}

impl Desk {
    pub(super) fn new(run_seed: u64, agents: usize) -> Self {
        Self {
            places: vec![
                Place {
                    begun: 0,
                    learning: 0,
                    learned: 0
                };
                agents
            ],
            seats: (0..agents as u32)
                .map(|agent| Seat::new(run_seed, agent, 0))
                .collect(),
            room: None,
        }
    }

    /// Goes on until at least one episode ends; nothing ends any more when every agent has played all of its own.
    pub(super) fn play(
        &mut self,
        environment: &mut dyn Environment,
        agents: &[Box<dyn Agent>],
        pace: &Pace<'_>,
    ) -> Ended {
        let mut ended = Ended::default();
        while ended.episodes.is_empty() && self.goes_on(pace) {
            self.begin_episodes(environment, pace);
            if self.seats.iter().any(Seat::is_playing) {
                self.room
                    .get_or_insert_with(|| Room::new(&*environment))
                    .step(environment, agents, &mut self.seats);
            }
            self.places
                .iter_mut()
                .for_each(|place| place.learning = place.learning.saturating_sub(1));
            for seat in &mut self.seats {
                if let Some(episode) = seat.observe(environment) {
                    ended.episodes.push(episode);
                    ended.footage.extend(seat.footage.take());
                }
            }
        }
        ended
    }

    /// Notes that an agent has learned from the team's first `total` episodes; returns where its fresh ones begin, and how often it
    /// had learned before.
    pub(super) fn learn(&mut self, agent: u32, total: u64, pace: &Pace<'_>) -> (u64, u32) {
        let place = &mut self.places[agent as usize];
        place.learning = pace.learning;
        (
            std::mem::replace(&mut place.learned, total),
            place.begun - 1,
        )
    }

    /// Episodes of the team that every agent has learned from.
    pub(super) fn learned_by_all(&self) -> u64 {
        self.places
            .iter()
            .map(|place| place.learned)
            .min()
            .unwrap_or(u64::MAX)
    }

    fn goes_on(&self, pace: &Pace<'_>) -> bool {
        let mut seats = self.places.iter().zip(&self.seats);
        seats.any(|(place, seat)| place.begun < pace.episodes || seat.is_playing())
    }

    fn begin_episodes(&mut self, environment: &mut dyn Environment, pace: &Pace<'_>) {
        for (agent, (place, seat)) in (0..).zip(self.places.iter_mut().zip(&mut self.seats)) {
            if !seat.is_playing() && place.learning == 0 && place.begun < pace.episodes {
                *seat = Seat::new(pace.run_seed, agent, place.begun);
                seat.start(environment, place.begun, 0, pace.camera);
                place.begun += 1;
            }
        }
    }
}
