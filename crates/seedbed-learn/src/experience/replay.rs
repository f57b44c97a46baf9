//! Replay: the team's newest transitions in a ring, which bounds the memory however long a run is.

use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::Episode;
use seedbed_env::Status;
use seedbed_env::random::Stream;

/// Where a transition comes from: who made it, and when.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Origin {
    /// Who acted.
    pub agent: u32,
    /// The agent's own count of episodes.
    pub episode: u32,
    /// Steps of the episode before it.
    pub step: u32,
}

/// The newest transitions, each with one discrete action. The oldest make room for the next.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Replay {
    capacity: usize,
    /// Numbers in an observation.
    width: usize,
    /// The place that is written next, once all are taken.
    oldest: usize,
    /// What was seen before and after: `[N × 2 × width]`.
    observations: Vec<f32>,
    actions: Vec<u16>,
    rewards: Vec<f32>,
    statuses: Vec<Status>,
    origins: Vec<Origin>,
}

/// One transition of a [`Replay`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition<'a> {
    /// What was seen before. `[width]`
    pub state: &'a [f32],
    /// The choice made.
    pub action: usize,
    /// The environment's own, without seeds or bonus.
    pub reward: f32,
    /// What was seen after. `[width]`
    pub next: &'a [f32],
    /// Whether the episode went on, and if not, how it ended.
    pub status: Status,
    /// Where it comes from.
    pub origin: Origin,
}

impl Replay {
    /// A ring of `capacity` transitions with observations of `width` numbers. It grows as it fills.
    ///
    /// # Panics
    /// If it could hold none.
    #[must_use]
    pub fn new(capacity: usize, width: usize) -> Self {
        assert!(
            capacity > 0 && width > 0,
            "room for a transition with something to see"
        );
        Self {
            capacity,
            width,
            oldest: 0,
            observations: Vec::new(),
            actions: Vec::new(),
            rewards: Vec::new(),
            statuses: Vec::new(),
            origins: Vec::new(),
        }
    }

    /// Transitions held.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rewards.len()
    }

    /// Whether none is held.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rewards.is_empty()
    }

    /// Adds the newest step of an episode that is being played or was just ended.
    ///
    /// # Panics
    /// If the episode has no step, or another width.
    pub fn push_newest(&mut self, episode: &Episode) {
        let (width, step) = (self.width, episode.length() - 1);
        let observations = &episode.observations[step * width..(step + 2) * width];
        let origin = Origin {
            agent: episode.agent,
            episode: episode.episode,
            step: step as u32,
        };
        let (action, reward) = (episode.actions[step] as u16, episode.rewards[step]);
        if self.len() < self.capacity {
            self.observations.extend_from_slice(observations);
            self.actions.push(action);
            self.rewards.push(reward);
            self.statuses.push(episode.outcome);
            self.origins.push(origin);
            return;
        }
        let place = self.oldest;
        self.observations[place * 2 * width..(place + 1) * 2 * width].copy_from_slice(observations);
        (self.actions[place], self.rewards[place]) = (action, reward);
        (self.statuses[place], self.origins[place]) = (episode.outcome, origin);
        self.oldest = (place + 1) % self.capacity;
    }

    /// One of the held transitions, each equally likely.
    ///
    /// # Panics
    /// If none is held.
    #[must_use]
    pub fn draw(&self, random: &mut Stream) -> Transition<'_> {
        self.get(random.random_range(0..self.len()))
    }

    /// The transition at `place`.
    ///
    /// # Panics
    /// If there is none.
    #[must_use]
    pub fn get(&self, place: usize) -> Transition<'_> {
        let pair = &self.observations[place * 2 * self.width..(place + 1) * 2 * self.width];
        let (state, next) = pair.split_at(self.width);
        Transition {
            state,
            action: self.actions[place].into(),
            reward: self.rewards[place],
            next,
            status: self.statuses[place],
            origin: self.origins[place],
        }
    }

    /// Whether a stored ring can stand in for this one.
    #[must_use]
    pub fn is_like(&self, other: &Self) -> bool {
        (self.capacity, self.width) == (other.capacity, other.width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::Spec;
    use seedbed_env::random::{Purpose, stream};

    /// Step t of agent 3's episode 5 goes from t to t + 1 with action t mod 2 and reward 10 t.
    fn episode(steps: u8, outcome: Status) -> Episode {
        Episode {
            observations: (0..=steps).map(f32::from).collect(),
            actions: (0..steps).map(|step| f32::from(step % 2)).collect(),
            rewards: (0..steps).map(|step| 10.0 * f32::from(step)).collect(),
            outcome,
            ..Episode::start(3, 5, 0, &Spec::new("test", Vec::new(), Vec::new()))
        }
    }

    fn filled(steps: u8) -> Replay {
        let mut replay = Replay::new(4, 1);
        (1..steps).for_each(|length| replay.push_newest(&episode(length, Status::Running)));
        replay.push_newest(&episode(steps, Status::Terminated));
        replay
    }

    #[test]
    fn a_transition_is_the_newest_step() {
        let replay = filled(3);
        let origin = Origin {
            agent: 3,
            episode: 5,
            step: 2,
        };
        let expected = Transition {
            state: &[2.0],
            action: 0,
            reward: 20.0,
            next: &[3.0],
            status: Status::Terminated,
            origin,
        };
        assert_eq!((replay.len(), replay.get(2)), (3, expected));
        assert_eq!(replay.get(1).status, Status::Running);
    }

    /// Six steps in a ring of four: steps 4 and 5 take the places of 0 and 1.
    #[test]
    fn the_oldest_make_room() {
        let replay = filled(6);
        let steps: Vec<u32> = (0..replay.len())
            .map(|place| replay.get(place).origin.step)
            .collect();
        assert_eq!(steps, [4, 5, 2, 3]);
        assert_eq!(replay.get(1).next, [6.0]);
    }

    /// 4,000 draws of four: each 1,000 times, four standard errors being 4 √(4000 · 3/16) = 110.
    #[test]
    fn every_transition_is_equally_likely() {
        let (replay, mut random, mut counts) =
            (filled(6), stream(0, Purpose::Shuffle, 0, 0), [0; 6]);
        for _ in 0..4000 {
            counts[replay.draw(&mut random).origin.step as usize] += 1_i32;
        }
        assert!(
            counts[..2] == [0, 0] && counts[2..].iter().all(|count| (count - 1000).abs() < 110),
            "{counts:?}"
        );
    }
}
