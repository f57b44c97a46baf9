//! The replay buffer: the team's newest transitions in a ring buffer of limited size.

use std::ops::Range;

use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::Episode;
use seedbed_env::Status;
use seedbed_random::Stream;

/// Which step of which episode a transition is. The order is that of agents, episodes and steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Origin {
    /// Number of the agent, from 0.
    pub agent: u32,
    /// Number of the agent's episode, from 0.
    pub episode: u32,
    /// Number of the step in the episode, from 0.
    pub step: u32,
}

/// The newest transitions, each with one discrete action. When the buffer is full, a new transition
/// replaces the oldest. Transitions are numbered from 0 in the order in which they were added; they
/// never change, so that checkpoints need to store each of them only once.
#[derive(Clone, Debug, PartialEq)]
pub struct Replay {
    /// Maximal number of transitions.
    capacity: usize,
    /// Width of an observation.
    width: usize,
    /// Number of transitions added so far. Transition n is at index n mod `capacity`.
    added: u64,
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
            added: 0,
            observations: Vec::new(),
            actions: Vec::new(),
            rewards: Vec::new(),
            statuses: Vec::new(),
            origins: Vec::new(),
        }
    }

    /// Approximate number of bytes of a buffer with `transitions` transitions. A vector that grows has
    /// room for twice as many.
    pub(crate) fn memory(transitions: u64, width: usize) -> u64 {
        const ACTION_REWARD_STATUS_ORIGIN: u64 = 2 + 4 + 1 + 12;
        let bytes = 2 * size_of::<f32>() as u64 * width as u64 + ACTION_REWARD_STATUS_ORIGIN;
        transitions.saturating_mul(2 * bytes)
    }

    /// Maximal number of transitions.
    #[must_use]
    pub fn capacity(&self) -> usize {
        self.capacity
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

    /// Adds the transition of step number `step` of an episode, which may still be playing.
    ///
    /// # Panics
    /// If the episode has no such step, or observations of another width.
    pub fn push(&mut self, episode: &Episode, step: usize) {
        let width = self.width;
        let is_last = step + 1 == episode.length();
        let status = if is_last {
            episode.outcome
        } else {
            Status::Running
        };
        let observations = &episode.observations[step * width..(step + 2) * width];
        self.add(&Transition {
            state: &observations[..width],
            action: episode.actions[step] as usize,
            reward: episode.rewards[step],
            next_state: &observations[width..],
            status,
            origin: episode.origin(step),
        });
    }

    /// Adds a transition, in place of the oldest if the buffer is full.
    fn add(&mut self, transition: &Transition<'_>) {
        let index = (self.added % self.capacity as u64) as usize;
        self.added += 1;
        if index == self.len() {
            self.observations.extend_from_slice(transition.state);
            self.observations.extend_from_slice(transition.next_state);
            self.actions.push(transition.action as u16);
            self.rewards.push(transition.reward);
            self.statuses.push(transition.status);
            self.origins.push(transition.origin);
            return;
        }
        let pair = &mut self.observations[index * 2 * self.width..(index + 1) * 2 * self.width];
        pair[..self.width].copy_from_slice(transition.state);
        pair[self.width..].copy_from_slice(transition.next_state);
        self.actions[index] = transition.action as u16;
        self.rewards[index] = transition.reward;
        self.statuses[index] = transition.status;
        self.origins[index] = transition.origin;
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

    /// Numbers of the transitions in the buffer.
    #[must_use]
    pub fn numbers(&self) -> Range<u64> {
        self.added - self.len() as u64..self.added
    }

    /// Number of bytes of each transition that [`encode`](Self::encode) writes.
    #[must_use]
    pub fn encoded_length(&self) -> usize {
        // Observations, action, reward, status, origin.
        2 * 4 * self.width + 2 + 4 + 1 + 3 * 4
    }

    /// Appends the transitions with these numbers to `bytes`, all numbers in little-endian order.
    ///
    /// # Panics
    /// If one of them is not in the buffer.
    pub fn encode(&self, numbers: Range<u64>, bytes: &mut Vec<u8>) {
        let present = self.numbers();
        assert!(present.start <= numbers.start && numbers.end <= present.end);
        for number in numbers {
            let transition = self.get((number % self.capacity as u64) as usize);
            for observation in transition.state.iter().chain(transition.next_state) {
                bytes.extend(observation.to_le_bytes());
            }
            bytes.extend((transition.action as u16).to_le_bytes());
            bytes.extend(transition.reward.to_le_bytes());
            bytes.push(encode_status(transition.status));
            let Origin {
                agent,
                episode,
                step,
            } = transition.origin;
            bytes.extend(
                [agent, episode, step]
                    .into_iter()
                    .flat_map(u32::to_le_bytes),
            );
        }
    }

    /// Replaces the contents by encoded transitions, the first of which has number `first`.
    ///
    /// # Errors
    /// If they are not the transitions of a buffer of this capacity and width.
    pub fn restore(&mut self, first: u64, bytes: &[u8]) -> Result<(), String> {
        let transitions = bytes.chunks_exact(self.encoded_length());
        let count = transitions.len() as u64;
        let is_complete = transitions.remainder().is_empty()
            && count <= self.capacity as u64
            && (count == self.capacity as u64 || first == 0);
        if !is_complete {
            return Err("the replay buffer has another size".to_owned());
        }
        let mut restored = Self::new(self.capacity, self.width);
        let mut observations = vec![0.0; 2 * self.width];
        // The first transition may be in the middle of the ring.
        restored.resize(count as usize);
        restored.added = first;
        for transition in transitions {
            restored.add(&decode(transition, &mut observations)?);
        }
        *self = restored;
        Ok(())
    }

    /// Makes room for `count` transitions, which are added later.
    fn resize(&mut self, count: usize) {
        self.observations.resize(count * 2 * self.width, 0.0);
        self.actions.resize(count, 0);
        self.rewards.resize(count, 0.0);
        self.statuses.resize(count, Status::Running);
        let origin = Origin {
            agent: 0,
            episode: 0,
            step: 0,
        };
        self.origins.resize(count, origin);
    }
}

/// Reads an encoded transition; `observations: [2 × width]` is a buffer for its observations.
fn decode<'a>(bytes: &[u8], observations: &'a mut [f32]) -> Result<Transition<'a>, String> {
    let mut rest = bytes;
    for observation in &mut *observations {
        *observation = f32::from_le_bytes(take(&mut rest));
    }
    let action = u16::from_le_bytes(take(&mut rest)).into();
    let reward = f32::from_le_bytes(take(&mut rest));
    let status = decode_status(take(&mut rest))?;
    let [agent, episode, step] = [(); 3].map(|()| u32::from_le_bytes(take(&mut rest)));
    let (state, next_state) = observations.split_at(observations.len() / 2);
    Ok(Transition {
        state,
        action,
        reward,
        next_state,
        status,
        origin: Origin {
            agent,
            episode,
            step,
        },
    })
}

/// Takes the first N bytes.
fn take<const N: usize>(bytes: &mut &[u8]) -> [u8; N] {
    let (first, rest) = bytes
        .split_first_chunk()
        .expect("an encoded transition has all its bytes");
    *bytes = rest;
    *first
}

fn encode_status(status: Status) -> u8 {
    match status {
        Status::Idle => 0,
        Status::Running => 1,
        Status::Terminated => 2,
        Status::Truncated => 3,
    }
}

fn decode_status([byte]: [u8; 1]) -> Result<Status, String> {
    match byte {
        0 => Ok(Status::Idle),
        1 => Ok(Status::Running),
        2 => Ok(Status::Terminated),
        3 => Ok(Status::Truncated),
        _ => Err(format!(
            "a transition of the replay buffer has status {byte}"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::TaskSpec;
    use seedbed_random::{Purpose, stream};

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
        let episode = episode(steps, Status::Terminated);
        (0..episode.length()).for_each(|step| replay.push(&episode, step));
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

    /// After three, four and six steps, a buffer of four is not full, full, and has replaced
    /// steps. A restored buffer has the same transitions at the same indices, and replaces the same
    /// ones.
    #[test]
    fn a_restored_buffer_equals_the_original() {
        for (steps, numbers) in [(3, 0..3), (4, 0..4), (6, 2..6)] {
            let (mut original, mut bytes) = (replay_after(steps), Vec::new());
            assert_eq!(original.numbers(), numbers);
            original.encode(numbers.clone(), &mut bytes);
            assert_eq!(bytes.len(), original.len() * original.encoded_length());
            let mut restored = replay_after(1);
            restored.restore(numbers.start, &bytes).unwrap();
            assert_eq!(restored, original);
            for replay in [&mut original, &mut restored] {
                replay.push(&episode(2, Status::Truncated), 1);
            }
            assert_eq!(restored, original);
        }
    }

    /// Step 2 of agent 3's episode 5 leads from state 2 (0x40000000) to state 3 (0x40400000) with
    /// action 0 and reward 20 (0x41a00000), and ends the episode.
    #[test]
    fn transitions_are_encoded_in_little_endian_order() {
        let mut bytes = Vec::new();
        replay_after(3).encode(2..3, &mut bytes);
        let expected = [
            &[0, 0, 0, 0x40, 0, 0, 0x40, 0x40][..],
            &[0, 0],
            &[0, 0, 0xa0, 0x41],
            &[2],
            &[3, 0, 0, 0, 5, 0, 0, 0, 2, 0, 0, 0],
        ];
        assert_eq!(bytes, expected.concat());
    }

    #[test]
    fn transitions_of_another_buffer_are_refused() {
        let mut bytes = Vec::new();
        replay_after(6).encode(2..6, &mut bytes);
        let mut other_capacity = Replay::new(5, 1);
        assert!(other_capacity.restore(2, &bytes).is_err());
        assert!(Replay::new(4, 2).restore(2, &bytes).is_err());
        assert!(Replay::new(4, 1).restore(2, &bytes[1..]).is_err());
        let status = 2 * 4 + 2 + 4;
        bytes[status] = 9;
        assert!(Replay::new(4, 1).restore(2, &bytes).is_err());
    }
}
