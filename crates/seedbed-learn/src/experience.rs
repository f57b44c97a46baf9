//! What agents experienced: episodes, and the buffer in which a team shares them.
//!
//! Order is by simulated time and agent, never by what a thread did first. Agents that learn
//! from single transitions share them in a [`replay`] buffer. Nothing here learns.

pub mod replay;

use serde::{Deserialize, Serialize};

use seedbed_env::{Spec, Status};

/// One finished episode of T steps (thesis §5.1): what the agent saw, did, how likely that was, and
/// what it got.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Episode {
    /// Who acted.
    pub agent: u32,
    /// The agent's own count of episodes, from 0.
    pub episode: u32,
    /// The round in which the episode was played, from 0.
    pub round: u32,
    /// Row t is what was seen before action t; the last row is what was seen at the end.
    /// `[(T+1) × observation width]`
    pub observations: Vec<f32>,
    /// `[T × action width]`
    pub actions: Vec<f32>,
    /// `[T]`: entry t is `R_{t+1}`, the environment's own, without seeds or bonus.
    pub rewards: Vec<f32>,
    /// `[T × action width]`: log π(aₜ|sₜ) under the policy that acted, for each component of the
    /// action; the sum is the action's.
    pub log_probs: Vec<f32>,
    /// How it ended: [`Status::Terminated`] or [`Status::Truncated`].
    pub outcome: Status,
}

impl Episode {
    /// An episode about to be played, with room for the task's longest.
    #[must_use]
    pub fn start(agent: u32, episode: u32, round: u32, spec: &Spec) -> Self {
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

    /// T, the number of steps.
    #[must_use]
    pub fn length(&self) -> usize {
        self.rewards.len()
    }

    /// Sum of rewards, undiscounted.
    #[must_use]
    pub fn total_reward(&self) -> f64 {
        self.rewards.iter().map(|&reward| f64::from(reward)).sum()
    }

    /// log π(aₜ|sₜ) of whole actions: `[T]`.
    pub fn action_log_probs(&self) -> impl Iterator<Item = f32> {
        let width = self.log_probs.len() / self.length().max(1);
        self.log_probs
            .chunks_exact(width.max(1))
            .map(|components| components.iter().sum())
    }

    /// What was seen at the end: `[observation width]`.
    #[must_use]
    pub fn last_observation(&self) -> &[f32] {
        &self.observations[self.states().len()..]
    }

    /// The observations before each action: `[T × observation width]`, without the last row.
    #[must_use]
    pub fn states(&self) -> &[f32] {
        let width = self.observations.len() / (self.length() + 1);
        &self.observations[..self.length() * width]
    }
}

/// What an update computed for each of the T steps of one episode. Nothing is learned from it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StepData {
    /// Number of the agent whose episode it is, from 0.
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
    pub fn of(episode: &Episode) -> Self {
        Self {
            agent: episode.agent,
            episode: episode.episode,
            ..Self::default()
        }
    }
}

/// The team's shared experience: episodes in the order in which they were finished, those of one
/// moment in agent order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SharedBuffer {
    /// Episodes that were forgotten.
    forgotten: u64,
    episodes: Vec<Episode>,
}

/// What an agent learns from at one time.
#[derive(Clone, Copy, Debug)]
pub struct Experience<'a> {
    /// The team's episodes that this agent has not learned from before, its own among them.
    pub fresh: &'a [Episode],
    /// The newest episodes of the team that are kept, the fresh ones last.
    pub kept: &'a [Episode],
    /// How often this agent has learned before.
    pub round: u32,
}

impl SharedBuffer {
    /// Adds episodes that were finished at one moment.
    ///
    /// # Panics
    /// If they are not in agent order.
    pub fn push(&mut self, episodes: Vec<Episode>) {
        assert!(
            episodes.is_sorted_by_key(|episode| episode.agent),
            "episodes come in agent order"
        );
        self.episodes.extend(episodes);
    }

    /// Episodes added so far, forgotten ones included.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.forgotten + self.episodes.len() as u64
    }

    /// The episodes after the first `total`, as far as they are kept.
    #[must_use]
    pub fn since(&self, total: u64) -> &[Episode] {
        &self.episodes[total.saturating_sub(self.forgotten) as usize..]
    }

    /// How many of the team's episodes lie before the newest ones that hold at least `transitions`
    /// together.
    #[must_use]
    pub fn before(&self, transitions: u64) -> u64 {
        let mut held = 0;
        let needed = self.episodes.iter().rev().take_while(|episode| {
            let needed = held < transitions;
            held += episode.length() as u64;
            needed
        });
        self.total() - needed.count() as u64
    }

    /// Forgets the first `total` episodes.
    pub fn forget(&mut self, total: u64) {
        let count = total
            .saturating_sub(self.forgotten)
            .min(self.episodes.len() as u64);
        self.episodes.drain(..count as usize);
        self.forgotten += count;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn episode(agent: u32) -> Episode {
        Episode::start(agent, 0, 0, &Spec::new("test", Vec::new(), Vec::new()))
    }

    /// Episodes of 0, 3, 2 steps: 2 transitions need the last one, 3 the last two, 0 none.
    #[test]
    fn the_newest_transitions_are_kept() {
        let mut buffer = SharedBuffer::default();
        let of_length = |length| Episode {
            rewards: vec![0.0; length],
            ..episode(0)
        };
        buffer.push(vec![of_length(0), of_length(3), of_length(2)]);
        assert_eq!(
            [0, 2, 3, 100].map(|transitions| buffer.before(transitions)),
            [3, 2, 1, 0]
        );
    }

    #[test]
    fn what_is_forgotten_still_counts() {
        let mut buffer = SharedBuffer::default();
        buffer.push(vec![episode(0), episode(1)]);
        buffer.push(vec![episode(0), episode(2)]);
        buffer.forget(1);
        let agents = |total| {
            buffer
                .since(total)
                .iter()
                .map(|episode| episode.agent)
                .collect::<Vec<_>>()
        };
        assert_eq!(
            (agents(0), agents(2), agents(4)),
            (vec![1, 0, 2], vec![0, 2], vec![])
        );
        assert_eq!(buffer.total(), 4);
        buffer.forget(9);
        assert_eq!((buffer.total(), buffer.since(0).len()), (4, 0));
    }
}
