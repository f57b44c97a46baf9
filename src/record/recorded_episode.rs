//! Episodes that are read from a recording, and errors of reading it.

use std::path::PathBuf;

use crate::run::facts::StateQuantity;
use seedbed_env::{Pose, Status};

/// One episode as it was recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedEpisode {
    /// Number of the agent, from 0.
    pub agent: u32,
    /// Number of the agent's episode, from 0.
    pub episode: u32,
    /// Number of the round, from 0.
    pub round: u32,
    /// Observations: row t is the observation before action t, the last row is the observation at
    /// the end of the episode.
    /// `[(T+1) × observation width]`
    pub observations: Vec<f32>,
    /// Actions. Discrete actions are stored as values, not as indices: `[T × action width]`
    pub actions: Vec<f32>,
    /// Entries of `info` in each state: `[(T+1) × info width]`
    pub info: Vec<f32>,
    /// Rewards of the environment: `[T]`
    pub rewards: Vec<f32>,
    /// Bonuses: `[T]`; empty for agents without a bonus.
    pub intrinsic_rewards: Vec<f32>,
    /// Advantages: `[T]`; empty unless an axis of the recording shows them.
    pub advantages: Vec<f32>,
    /// How the episode ended.
    pub outcome: Status,
}

/// The bodies of an agent in one recorded episode.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedScene {
    /// Number of the agent's episode, from 0.
    pub episode: u32,
    /// Pose of each body in each state: `[(T+1) × bodies]`
    pub poses: Vec<Pose>,
    /// The lines of the ground of this episode, as points in the world, m: `[lines]` of `[points]`
    pub terrain: Vec<Vec<[f32; 2]>>,
}

impl RecordedScene {
    /// The poses and the lines of the ground, as cameras take them.
    pub(crate) fn motion(&self) -> (&[Pose], &[Vec<[f32; 2]>]) {
        (&self.poses, &self.terrain)
    }
}

/// Error: a recording cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be opened or read, is damaged, or was written by another version of Rerun.
    #[error("cannot read {path}: {reason}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why it cannot be read.
        reason: String,
    },
    /// A part of the file has a wrong checksum or impossible contents.
    #[error("{path} is damaged at offset {offset}: {reason}")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Position of the damaged part, in bytes.
        offset: u64,
        /// What is wrong there.
        reason: String,
    },
    /// Rerun can read the file, but it was not written by this version of seedbed.
    #[error(
        "{path} is not a recording that this version of seedbed can read: it has no entity `{missing}`"
    )]
    NotARun {
        /// The file.
        path: PathBuf,
        /// Name of the missing entity, which every recording of this version has.
        missing: String,
    },
}

impl RecordedEpisode {
    /// Number of steps T.
    #[must_use]
    pub fn length(&self) -> usize {
        self.rewards.len()
    }

    /// Number of all numbers, which determines the memory that the episode takes.
    #[must_use]
    pub fn numbers(&self) -> usize {
        let others = self.intrinsic_rewards.len() + self.advantages.len() + self.info.len();
        self.observations.len() + self.actions.len() + self.rewards.len() + others
    }

    /// Sum of rewards, undiscounted.
    #[must_use]
    pub fn total_reward(&self) -> f64 {
        self.rewards.iter().map(|&reward| f64::from(reward)).sum()
    }

    /// The value of a quantity at a step, 0 to T. `None` if it is not recorded, or if it belongs to actions
    /// and the step is the last state, in which no action is taken.
    #[must_use]
    pub fn value(&self, quantity: StateQuantity, step: usize) -> Option<f64> {
        let length = self.length();
        let single = match quantity {
            StateQuantity::Observation(index) => {
                let width = self.observations.len() / (length + 1);
                self.observations.get(step * width + index)
            }
            StateQuantity::Action(index) => {
                let width = self.actions.len() / length.max(1);
                self.actions.get(step * width + index)
            }
            StateQuantity::Info(index) => {
                let width = self.info.len() / (length + 1);
                self.info.get(step * width + index)
            }
            StateQuantity::Reward => self.rewards.get(step),
            StateQuantity::IntrinsicReward => self.intrinsic_rewards.get(step),
            StateQuantity::Advantage => self.advantages.get(step),
            StateQuantity::Step => return Some(step as f64),
            StateQuantity::Episode => return Some(f64::from(self.episode)),
            // In single precision, as in the page of `seedbed explore`.
            StateQuantity::Return => return Some(f64::from(self.total_reward() as f32)),
        };
        single.map(|&value| f64::from(value))
    }

    /// The observations state by state, including the last one: `[T+1]` of `[observation width]`.
    pub fn states(&self) -> impl Iterator<Item = &[f32]> {
        self.observations
            .chunks_exact((self.observations.len() / (self.length() + 1)).max(1))
    }

    /// The bonus of step `step`; 0 at the last state, which has no step, and for agents without a
    /// bonus.
    #[must_use]
    pub fn bonus(&self, step: usize) -> f32 {
        self.intrinsic_rewards.get(step).copied().unwrap_or(0.0)
    }
}
