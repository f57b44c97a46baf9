//! Experience of agents: episodes, and the buffer in which a team shares them.
//!
//! Episodes are ordered by simulated time and agent and never depend on the timing of threads.
//! Agents that learn from single transitions share them in a [`replay`] buffer.

mod float_bytes;
pub mod replay;

use serde::{Deserialize, Serialize};

use self::replay::Origin;
use seedbed_env::{Status, TaskSpec};

/// One episode of T steps (thesis §5.1): observations, actions with their log-probabilities, and
/// rewards.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Episode {
    /// Number of the agent, from 0.
    pub agent: u32,
    /// Number of the agent's episode, from 0.
    pub episode: u32,
    /// Number of the round in which the episode was played, from 0.
    pub round: u32,
    /// Row t is the observation before action t; the last row is the observation at the end:
    /// `[(T+1) × observation width]`.
    #[serde(with = "float_bytes")]
    pub observations: Vec<f32>,
    /// Row t is action t; a discrete action is the index of its value: `[T × action width]`.
    #[serde(with = "float_bytes")]
    pub actions: Vec<f32>,
    /// Entry t is `R_{t+1}`, the reward of the environment, without seeds and bonuses: `[T]`.
    #[serde(with = "float_bytes")]
    pub rewards: Vec<f32>,
    /// log π(aₜ|sₜ) of each component of each action, under the policy that acted; their sum is the
    /// log-probability of the action: `[T × action width]`.
    #[serde(with = "float_bytes")]
    pub log_probs: Vec<f32>,
    /// How the episode ended: [`Status::Terminated`] or [`Status::Truncated`]; [`Status::Running`]
    /// before its end.
    pub outcome: Status,
}

impl Episode {
    /// An empty episode, with memory for as many steps as the task's time limit (at most 10,000).
    #[must_use]
    pub fn start(agent: u32, episode: u32, round: u32, spec: &TaskSpec) -> Self {
        let steps = spec.time_limit.min(10_000) as usize;
        Self {
            agent,
            episode,
            round,
            observations: Vec::with_capacity((steps + 1) * spec.observation_width()),
            actions: Vec::with_capacity(steps * spec.action_width()),
            rewards: Vec::with_capacity(steps),
            log_probs: Vec::with_capacity(steps * spec.action_width()),
            outcome: Status::Running,
        }
    }

    /// Adds the result of the latest action.   `observation: [observation width]`
    pub fn add_result(&mut self, reward: f32, observation: &[f32], status: Status) {
        self.rewards.push(reward);
        self.observations.extend_from_slice(observation);
        self.outcome = status;
    }

    /// Number of steps T.
    #[must_use]
    pub fn length(&self) -> usize {
        self.rewards.len()
    }

    /// The name of step number `step` of this episode.
    #[must_use]
    pub fn origin(&self, step: usize) -> Origin {
        Origin {
            agent: self.agent,
            episode: self.episode,
            step: step as u32,
        }
    }

    /// Undiscounted sum of the rewards.
    #[must_use]
    pub fn total_reward(&self) -> f64 {
        self.rewards.iter().map(|&reward| f64::from(reward)).sum()
    }

    /// log π(aₜ|sₜ) of each action: `[T]`.
    pub fn action_log_probs(&self) -> impl Iterator<Item = f32> {
        let width = self.log_probs.len() / self.length().max(1);
        self.log_probs
            .chunks_exact(width.max(1))
            .map(|components| components.iter().sum())
    }

    /// The observation at the end: `[observation width]`.
    #[must_use]
    pub fn last_observation(&self) -> &[f32] {
        &self.observations[self.states().len()..]
    }

    /// The observation before each action, without the last one: `[T × observation width]`.
    #[must_use]
    pub fn states(&self) -> &[f32] {
        let width = self.observations.len() / (self.length() + 1);
        &self.observations[..self.length() * width]
    }
}

/// An episode without its steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct EpisodeInfo {
    /// Number of the agent, from 0.
    pub agent: u32,
    /// Number of the agent's episode, from 0.
    pub episode: u32,
    /// Number of steps T.
    pub length: u32,
}

impl From<&Episode> for EpisodeInfo {
    fn from(episode: &Episode) -> Self {
        Self {
            agent: episode.agent,
            episode: episode.episode,
            length: episode.length() as u32,
        }
    }
}

/// Results of an update for each of the T steps of one episode, for recordings. Agents do not learn
/// from them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StepData {
    /// Number of the agent that played the episode, from 0.
    pub agent: u32,
    /// Number of the agent's episode, from 0.
    pub episode: u32,
    /// Intrinsic reward of each step; empty if the agent has no bonus: `[T]`.
    pub intrinsic_rewards: Vec<f32>,
    /// Advantage of each action under the policy and the value function before the update, not
    /// standardized; empty if advantages are not recorded, or if the algorithm estimates none:
    /// `[T]`.
    pub advantages: Vec<f32>,
}

impl StepData {
    /// Data of `episode` without intrinsic rewards and advantages.
    #[must_use]
    pub fn empty_for(episode: &Episode) -> Self {
        Self {
            agent: episode.agent,
            episode: episode.episode,
            ..Self::default()
        }
    }
}

/// The team's shared episodes in the order in which they ended; episodes that ended at the same
/// time are in agent order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SharedBuffer {
    /// Number of episodes that were removed.
    removed: u64,
    /// Episodes that nobody learns from here may have no steps.
    episodes: Vec<Episode>,
    /// Length of each episode, with all its steps.
    lengths: Vec<u32>,
}

/// What a checkpoint stores of a [`SharedBuffer`], in the same encoding.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct StoredBuffer<'a> {
    removed: u64,
    episodes: &'a [Episode],
    lengths: &'a [u32],
}

/// The episodes that an agent learns from in one update.
#[derive(Clone, Copy, Debug)]
pub struct Experience<'a> {
    /// The team's episodes that this agent has not learned from before, including its own. Episodes
    /// that the agent did not [choose](crate::agent::Agent::choose_episodes) may have no steps.
    pub new_episodes: &'a [Episode],
    /// Lengths of these episodes, with all their steps.
    pub new_lengths: &'a [u32],
    /// All episodes of the team that are still in the buffer; the new ones are the last.
    pub all_episodes: &'a [Episode],
    /// Number of this agent's earlier updates.
    pub earlier_updates: u32,
}

impl SharedBuffer {
    /// Adds episodes that ended at the same time.
    ///
    /// # Panics
    /// If the episodes are not in agent order.
    pub fn add_episodes(&mut self, episodes: Vec<Episode>) {
        let lengths = episodes.iter().map(|episode| episode.length() as u32);
        let lengths = lengths.collect();
        self.add_episodes_of_lengths(episodes, lengths);
    }

    /// Like [`add_episodes`](Self::add_episodes), but some of the episodes may have no steps here;
    /// `lengths` are those with all their steps.
    ///
    /// # Panics
    /// If the episodes are not in agent order, or if there are not as many lengths.
    pub fn add_episodes_of_lengths(&mut self, episodes: Vec<Episode>, lengths: Vec<u32>) {
        assert!(
            episodes.is_sorted_by_key(|episode| episode.agent),
            "episodes must be in agent order"
        );
        assert_eq!(episodes.len(), lengths.len(), "an episode has one length");
        self.episodes.extend(episodes);
        self.lengths.extend(lengths);
    }

    /// Number of episodes added so far, including removed ones.
    #[must_use]
    pub fn episodes_added(&self) -> u64 {
        self.removed + self.episodes.len() as u64
    }

    /// The episodes after the first `count` of all episodes added so far, except removed ones.
    #[must_use]
    pub fn episodes_after(&self, count: u64) -> &[Episode] {
        &self.episodes[count.saturating_sub(self.removed) as usize..]
    }

    /// The lengths of [these](Self::episodes_after) episodes.
    #[must_use]
    pub fn lengths_after(&self, count: u64) -> &[u32] {
        &self.lengths[count.saturating_sub(self.removed) as usize..]
    }

    /// The buffer after the first `count` of all episodes added so far are
    /// [removed](Self::remove_first).
    #[must_use]
    pub fn without_first(&self, count: u64) -> StoredBuffer<'_> {
        let removed = count.clamp(self.removed, self.episodes_added());
        StoredBuffer {
            removed,
            episodes: self.episodes_after(removed),
            lengths: self.lengths_after(removed),
        }
    }

    /// Number of episodes before the newest ones, where the newest ones are as few as together have
    /// at least `transitions` transitions.
    #[must_use]
    pub fn count_before_newest(&self, transitions: u64) -> u64 {
        let mut newest_transitions = 0;
        let newest = self.lengths.iter().rev().take_while(|&&length| {
            let is_needed = newest_transitions < transitions;
            newest_transitions += u64::from(length);
            is_needed
        });
        self.episodes_added() - newest.count() as u64
    }

    /// Removes the first `count` of all episodes added so far, as far as they are still there.
    pub fn remove_first(&mut self, count: u64) {
        let present_count = self.episodes.len() as u64;
        let newly_removed = count.saturating_sub(self.removed).min(present_count);
        self.episodes.drain(..newly_removed as usize);
        self.lengths.drain(..newly_removed as usize);
        self.removed += newly_removed;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn episode(agent: u32) -> Episode {
        Episode::start(agent, 0, 0, &TaskSpec::new("test", Vec::new(), Vec::new()))
    }

    /// The episodes have 0, 3 and 2 steps. The newest 2 transitions are in the last episode, the
    /// newest 3 in the last two episodes, and 100 transitions would need all three.
    #[test]
    fn episodes_before_the_newest_transitions_are_counted() {
        let mut buffer = SharedBuffer::default();
        let of_length = |length| Episode {
            rewards: vec![0.0; length],
            ..episode(0)
        };
        buffer.add_episodes(vec![of_length(0), of_length(3), of_length(2)]);
        assert_eq!(
            [0, 2, 3, 100].map(|transitions| buffer.count_before_newest(transitions)),
            [3, 2, 1, 0]
        );
    }

    #[test]
    fn removed_episodes_are_counted() {
        let mut buffer = SharedBuffer::default();
        buffer.add_episodes(vec![episode(0), episode(1)]);
        buffer.add_episodes(vec![episode(0), episode(2)]);
        buffer.remove_first(1);
        let agents = |count| {
            buffer
                .episodes_after(count)
                .iter()
                .map(|episode| episode.agent)
                .collect::<Vec<_>>()
        };
        assert_eq!(
            (agents(0), agents(2), agents(4)),
            (vec![1, 0, 2], vec![0, 2], vec![])
        );
        assert_eq!(buffer.episodes_added(), 4);
        for count in [0, 2, 9] {
            let stored = buffer.without_first(count);
            let mut removed = buffer.clone();
            removed.remove_first(count);
            assert_eq!(
                (stored.removed, stored.episodes),
                (removed.removed, &removed.episodes[..])
            );
        }
        buffer.remove_first(9);
        assert_eq!(
            (buffer.episodes_added(), buffer.episodes_after(0).len()),
            (4, 0)
        );
    }
}
