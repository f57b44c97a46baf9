//! The replay buffer: the team's newest transitions in a ring buffer of limited size.

use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::Episode;
use seedbed_env::Status;
use seedbed_env::random::Stream;

/// Which step of which episode a transition is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Origin {
    /// Number of the agent, from 0.
    pub agent: u32,
    /// Number of the agent's episode, from 0.
    pub episode: u32,
    /// Number of the step in the episode, from 0.
    pub step: u32,
}

/// The newest transitions, each with one discrete action. When the buffer is full, a new transition
/// replaces the oldest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Replay {
    /// Maximal number of transitions.
    capacity: usize,
    /// Width of an observation.
    width: usize,
    /// Index of the oldest transition, which is replaced next when the buffer is full.
    oldest: usize,
    /// Observations before and after each action: `[N × 2 × width]`.
    observations: Vec<f32>,
    actions: Vec<u16>,
    rewards: Vec<f32>,
    statuses: Vec<Status>,
    origins: Vec<Origin>,
}

/// One transition of a [`Replay`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition<'a> {
    /// Observation before the action: `[width]`.
    pub state: &'a [f32],
    /// Index of the chosen value of the action.
    pub action: usize,
    /// Reward of the environment, without seeds and bonuses.
    pub reward: f32,
    /// Observation after the action: `[width]`.
    pub next_state: &'a [f32],
    /// Whether the episode continued, and if not, how it ended.
    pub status: Status,
    /// Which step of which episode the transition is.
    pub origin: Origin,
}

impl Replay {
    /// An empty buffer for `capacity` transitions with observations of `width` numbers. Memory is
    /// allocated as the buffer fills.
    ///
    /// # Panics
    /// If `capacity` or `width` is 0.
    #[must_use]
    pub fn new(capacity: usize, width: usize) -> Self {
        assert!(
            capacity > 0 && width > 0,
            "capacity and width must be positive"
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

    /// Number of transitions in the buffer.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rewards.len()
    }

    /// Whether the buffer has no transitions.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rewards.is_empty()
    }

    /// Adds the last step of an episode that is being played or has just ended.
    ///
    /// # Panics
    /// If the episode has no step, or observations of another width.
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
        let index = self.oldest;
        self.observations[index * 2 * width..(index + 1) * 2 * width].copy_from_slice(observations);
        self.actions[index] = action;
        self.rewards[index] = reward;
        self.statuses[index] = episode.outcome;
        self.origins[index] = origin;
        self.oldest = (index + 1) % self.capacity;
    }

    /// A transition drawn uniformly from the buffer.
    ///
    /// # Panics
    /// If the buffer is empty.
    #[must_use]
    pub fn draw(&self, random: &mut Stream) -> Transition<'_> {
        self.get(random.random_range(0..self.len()))
    }

    /// The transition at an index of the ring buffer.
    ///
    /// # Panics
    /// If the index is out of range.
    #[must_use]
    pub fn get(&self, index: usize) -> Transition<'_> {
        let pair = &self.observations[index * 2 * self.width..(index + 1) * 2 * self.width];
        let (state, next_state) = pair.split_at(self.width);
        Transition {
            state,
            action: self.actions[index].into(),
            reward: self.rewards[index],
            next_state,
            status: self.statuses[index],
            origin: self.origins[index],
        }
    }

    /// Whether another buffer has the same capacity and width of observations.
    #[must_use]
    pub fn has_same_shape(&self, other: &Self) -> bool {
        (self.capacity, self.width) == (other.capacity, other.width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::TaskSpec;
    use seedbed_env::random::{Purpose, stream};

    /// Episode 5 of agent 3. Step t leads from state t to state t + 1, with action t mod 2 and
    /// reward 10 t.
    fn episode(steps: u8, outcome: Status) -> Episode {
        Episode {
            observations: (0..=steps).map(f32::from).collect(),
            actions: (0..steps).map(|step| f32::from(step % 2)).collect(),
            rewards: (0..steps).map(|step| 10.0 * f32::from(step)).collect(),
            outcome,
            ..Episode::start(3, 5, 0, &TaskSpec::new("test", Vec::new(), Vec::new()))
        }
    }

    /// A buffer of capacity 4 after one episode of `steps` steps.
    fn replay_after(steps: u8) -> Replay {
        let mut replay = Replay::new(4, 1);
        (1..steps).for_each(|length| replay.push_newest(&episode(length, Status::Running)));
        replay.push_newest(&episode(steps, Status::Terminated));
        replay
    }

    #[test]
    fn the_last_step_of_the_episode_is_added() {
        let replay = replay_after(3);
        let origin = Origin {
            agent: 3,
            episode: 5,
            step: 2,
        };
        let expected = Transition {
            state: &[2.0],
            action: 0,
            reward: 20.0,
            next_state: &[3.0],
            status: Status::Terminated,
            origin,
        };
        assert_eq!((replay.len(), replay.get(2)), (3, expected));
        assert_eq!(replay.get(1).status, Status::Running);
    }

    /// Of six steps in a buffer of four, steps 4 and 5 replace steps 0 and 1.
    #[test]
    fn the_oldest_transitions_are_replaced() {
        let replay = replay_after(6);
        let steps: Vec<u32> = (0..replay.len())
            .map(|index| replay.get(index).origin.step)
            .collect();
        assert_eq!(steps, [4, 5, 2, 3]);
        assert_eq!(replay.get(1).next_state, [6.0]);
    }

    /// In 4,000 draws each of four transitions is drawn about 1,000 times; the tolerance is four
    /// standard errors, 4 √(4000 · 3/16) = 110.
    #[test]
    fn every_transition_is_equally_likely() {
        let (replay, mut random, mut counts) =
            (replay_after(6), stream(0, Purpose::Shuffle, 0, 0), [0; 6]);
        for _ in 0..4000 {
            counts[replay.draw(&mut random).origin.step as usize] += 1_i32;
        }
        assert!(
            counts[..2] == [0, 0] && counts[2..].iter().all(|count| (count - 1000).abs() < 110),
            "{counts:?}"
        );
    }
}
