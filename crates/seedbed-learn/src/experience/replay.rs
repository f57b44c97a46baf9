//! The replay buffer: the team's newest transitions in a ring buffer of limited size.

use std::ops::Range;

use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::Episode;
use seedbed_env::{Status, TaskSpec};
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

/// The newest transitions. When the buffer is full, a new transition
/// replaces the oldest. Transitions are numbered from 0 in the order in which they were added; they
/// never change, so that checkpoints need to store each of them only once.
#[derive(Clone, Debug, PartialEq)]
pub struct Replay {
    /// Maximal number of transitions.
    capacity: usize,
    widths: RowWidths,
    /// Number of transitions added so far. Transition n is at index n mod `capacity`.
    added: u64,
    /// Observations before and after each action: `[N × 2 × width]`.
    observations: Vec<f32>,
    /// `[N × action width]`
    actions: Vec<f32>,
    rewards: Vec<f32>,
    statuses: Vec<Status>,
    origins: Vec<Origin>,
}

/// Minimal number of transitions for which a buffer makes room at once.
const MIN_ROOM: usize = 64;

/// Numbers per observation and per action.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RowWidths {
    /// Width of an observation.
    pub observation: usize,
    /// Width of an action.
    pub action: usize,
}

impl From<&TaskSpec> for RowWidths {
    fn from(spec: &TaskSpec) -> Self {
        Self {
            observation: spec.observation_width(),
            action: spec.action_width(),
        }
    }
}

/// One transition of a [`Replay`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition<'a> {
    /// Observation before the action: `[observation width]`.
    pub state: &'a [f32],
    /// The action; a discrete action is the index of its value: `[action width]`.
    pub action: &'a [f32],
    /// Reward of the environment, without seeds and bonuses.
    pub reward: f32,
    /// Observation after the action: `[observation width]`.
    pub next_state: &'a [f32],
    /// Whether the episode continued, and if not, how it ended.
    pub status: Status,
    /// Which step of which episode the transition is.
    pub origin: Origin,
}

impl Replay {
    /// An empty buffer for `capacity` transitions with rows of these widths. Memory is allocated as the
    /// buffer fills.
    ///
    /// # Panics
    /// If `capacity` or a width is 0.
    #[must_use]
    pub fn new(capacity: usize, widths: RowWidths) -> Self {
        assert!(
            capacity > 0 && widths.observation > 0 && widths.action > 0,
            "capacity and widths must be positive"
        );
        Self {
            capacity,
            widths,
            added: 0,
            observations: Vec::new(),
            actions: Vec::new(),
            rewards: Vec::new(),
            statuses: Vec::new(),
            origins: Vec::new(),
        }
    }

    /// Approximate number of bytes of a buffer with `transitions` transitions, with the room that it
    /// makes for more.
    pub(crate) fn memory(transitions: u64, widths: RowWidths) -> u64 {
        let with_room = transitions.saturating_add(transitions / 4);
        with_room.saturating_mul(widths.bytes() as u64)
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
    /// If the episode has no such step, or observations or actions of another width.
    pub fn push(&mut self, episode: &Episode, step: usize) {
        let RowWidths {
            observation: width,
            action,
        } = self.widths;
        let is_last = step + 1 == episode.length();
        let status = if is_last {
            episode.outcome
        } else {
            Status::Running
        };
        let observations = &episode.observations[step * width..(step + 2) * width];
        self.add(&Transition {
            state: &observations[..width],
            action: &episode.actions[step * action..(step + 1) * action],
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
            self.reserve();
            self.observations.extend_from_slice(transition.state);
            self.observations.extend_from_slice(transition.next_state);
            self.actions.extend_from_slice(transition.action);
            self.rewards.push(transition.reward);
            self.statuses.push(transition.status);
            self.origins.push(transition.origin);
            return;
        }
        let RowWidths {
            observation,
            action,
        } = self.widths;
        let pair = &mut self.observations[index * 2 * observation..(index + 1) * 2 * observation];
        pair[..observation].copy_from_slice(transition.state);
        pair[observation..].copy_from_slice(transition.next_state);
        self.actions[index * action..(index + 1) * action].copy_from_slice(transition.action);
        self.rewards[index] = transition.reward;
        self.statuses[index] = transition.status;
        self.origins[index] = transition.origin;
    }

    /// Makes room for more transitions if there is none: for a fourth of those that there are, but not for
    /// more than the buffer may have.
    fn reserve(&mut self) {
        let count = self.len();
        if count < self.rewards.capacity() {
            return;
        }
        let more = (count / 4).max(MIN_ROOM).min(self.capacity - count);
        let RowWidths {
            observation,
            action,
        } = self.widths;
        self.observations.reserve_exact(more * 2 * observation);
        self.actions.reserve_exact(more * action);
        self.rewards.reserve_exact(more);
        self.statuses.reserve_exact(more);
        self.origins.reserve_exact(more);
    }

    /// Index of a transition drawn uniformly from the buffer.
    ///
    /// # Panics
    /// If the buffer is empty.
    #[must_use]
    pub fn draw_index(&self, random: &mut Stream) -> usize {
        random.random_range(0..self.len())
    }

    /// Which step the transition at an index of the ring buffer was.
    ///
    /// # Panics
    /// If the index is out of range.
    #[must_use]
    pub fn origin(&self, index: usize) -> Origin {
        self.origins[index]
    }

    /// Index of the transition that follows another one in its episode; none if the episode ended, or
    /// if the next step has not been added yet.
    ///
    /// # Panics
    /// If the index is out of range.
    #[must_use]
    pub fn successor(&self, index: usize) -> Option<usize> {
        if self.statuses[index] != Status::Running {
            return None;
        }
        let Origin {
            agent,
            episode,
            step,
        } = self.origins[index];
        // Between two steps of an agent there are only steps of others, one of each at most.
        let newest = (self.added - 1) % self.capacity as u64;
        let mut later = index;
        while later != newest as usize {
            later = (later + 1) % self.len();
            let origin = self.origins[later];
            if origin.agent == agent {
                let is_next = (origin.episode, origin.step) == (episode, step + 1);
                return is_next.then_some(later);
            }
        }
        None
    }

    /// A transition drawn uniformly from the buffer.
    ///
    /// # Panics
    /// If the buffer is empty.
    #[must_use]
    pub fn draw(&self, random: &mut Stream) -> Transition<'_> {
        self.get(self.draw_index(random))
    }

    /// The transition at an index of the ring buffer.
    ///
    /// # Panics
    /// If the index is out of range.
    #[must_use]
    pub fn get(&self, index: usize) -> Transition<'_> {
        let RowWidths {
            observation,
            action,
        } = self.widths;
        let pair = &self.observations[index * 2 * observation..(index + 1) * 2 * observation];
        let (state, next_state) = pair.split_at(observation);
        Transition {
            state,
            action: &self.actions[index * action..(index + 1) * action],
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
        self.widths.bytes()
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
            let observations = transition.state.iter().chain(transition.next_state);
            for number in observations.chain(transition.action) {
                bytes.extend(number.to_le_bytes());
            }
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
        let mut restored = Self::new(self.capacity, self.widths);
        let mut rows = vec![0.0; 2 * self.widths.observation + self.widths.action];
        // The first transition may be in the middle of the ring.
        restored.resize(count as usize);
        restored.added = first;
        for transition in transitions {
            restored.add(&decode(transition, self.widths, &mut rows)?);
        }
        *self = restored;
        Ok(())
    }

    /// Makes room for `count` transitions, which are added later.
    fn resize(&mut self, count: usize) {
        let RowWidths {
            observation,
            action,
        } = self.widths;
        self.observations.resize(count * 2 * observation, 0.0);
        self.actions.resize(count * action, 0.0);
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

impl RowWidths {
    /// Number of bytes of a transition: observations before and after, action, reward, status, origin.
    #[must_use]
    pub fn bytes(self) -> usize {
        4 * (2 * self.observation + self.action) + 4 + 1 + 3 * 4
    }
}

/// Reads an encoded transition.
///
/// `rows: [2 × observation width + action width]` is a buffer for its observations and its action.
fn decode<'a>(
    bytes: &[u8],
    widths: RowWidths,
    rows: &'a mut [f32],
) -> Result<Transition<'a>, String> {
    let mut rest = bytes;
    for number in &mut *rows {
        *number = f32::from_le_bytes(take(&mut rest));
    }
    let reward = f32::from_le_bytes(take(&mut rest));
    let status = decode_status(take(&mut rest))?;
    let [agent, episode, step] = [(); 3].map(|()| u32::from_le_bytes(take(&mut rest)));
    let (state, rest) = rows.split_at(widths.observation);
    let (next_state, action) = rest.split_at(widths.observation);
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

    const ONE_NUMBER: RowWidths = RowWidths {
        observation: 1,
        action: 1,
    };

    /// A buffer of capacity 4 after one episode of `steps` steps.
    fn replay_after(steps: u8) -> Replay {
        let mut replay = Replay::new(4, ONE_NUMBER);
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
            action: &[0.0],
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

    /// Steps of two agents in turn: each is followed by the next of the same agent, also past the end of
    /// the ring. The steps of the episode that ended, and the newest ones, are followed by none.
    #[test]
    fn a_transition_is_followed_by_the_next_step_of_its_episode() {
        let mut replay = Replay::new(5, ONE_NUMBER);
        let (ended, running) = (episode(3, Status::Terminated), episode(4, Status::Running));
        let other = Episode {
            agent: 4,
            ..running
        };
        for step in 0..4 {
            if step < 3 {
                replay.push(&ended, step);
            }
            replay.push(&other, step);
        }
        // Seven were added; the first two were replaced by step 2 of agent 4 and its step 3.
        let followed = (0..5).map(|index| replay.successor(index));
        let steps = |index: usize| (replay.origins[index].agent, replay.origins[index].step);
        let found: Vec<_> = (0..5)
            .map(steps)
            .zip(followed.map(|next| next.map(steps)))
            .collect();
        assert_eq!(
            found,
            [
                ((4, 2), Some((4, 3))),
                ((4, 3), None),
                ((3, 1), Some((3, 2))),
                ((4, 1), Some((4, 2))),
                ((3, 2), None),
            ]
        );
    }

    /// A buffer never has room for more transitions than its capacity.
    #[test]
    fn room_is_made_for_no_more_than_the_capacity() {
        let mut replay = Replay::new(100, ONE_NUMBER);
        let episode = episode(3, Status::Running);
        for _ in 0..400 {
            replay.push(&episode, 0);
            assert!(
                replay.rewards.capacity() <= 100,
                "{}",
                replay.rewards.capacity()
            );
        }
        assert_eq!(
            (replay.rewards.capacity(), replay.observations.capacity()),
            (100, 200)
        );
    }

    /// Step 2 of agent 3's episode 5 leads from state 2 (0x40000000) to state 3 (0x40400000) with
    /// action 0 and reward 20 (0x41a00000), and ends the episode.
    #[test]
    fn transitions_are_encoded_in_little_endian_order() {
        let mut bytes = Vec::new();
        replay_after(3).encode(2..3, &mut bytes);
        let expected = [
            &[0, 0, 0, 0x40, 0, 0, 0x40, 0x40][..],
            &[0, 0, 0, 0],
            &[0, 0, 0xa0, 0x41],
            &[2],
            &[3, 0, 0, 0, 5, 0, 0, 0, 2, 0, 0, 0],
        ];
        assert_eq!(bytes, expected.concat());
    }

    /// Step 1 of an episode with actions of two numbers, and the same transition in a restored buffer.
    #[test]
    fn actions_may_have_several_numbers() {
        let widths = RowWidths {
            observation: 1,
            action: 2,
        };
        let episode = Episode {
            actions: vec![0.1, 0.2, 0.3, -0.4],
            ..episode(2, Status::Truncated)
        };
        let (mut replay, mut bytes) = (Replay::new(4, widths), Vec::new());
        (0..2).for_each(|step| replay.push(&episode, step));
        assert_eq!(replay.get(1).action, [0.3, -0.4]);
        replay.encode(0..2, &mut bytes);
        let mut restored = Replay::new(4, widths);
        restored.restore(0, &bytes).unwrap();
        assert_eq!(restored, replay);
    }

    #[test]
    fn transitions_of_another_buffer_are_refused() {
        let mut bytes = Vec::new();
        replay_after(6).encode(2..6, &mut bytes);
        let mut other_capacity = Replay::new(5, ONE_NUMBER);
        assert!(other_capacity.restore(2, &bytes).is_err());
        let wider = RowWidths {
            observation: 2,
            ..ONE_NUMBER
        };
        assert!(Replay::new(4, wider).restore(2, &bytes).is_err());
        let mut replay = Replay::new(4, ONE_NUMBER);
        assert!(replay.restore(2, &bytes[1..]).is_err());
        let status = 2 * 4 + 4 + 4;
        bytes[status] = 9;
        assert!(replay.restore(2, &bytes).is_err());
    }
}
