//! Recordings: what a run leaves behind for people to look at and for tools to read.
//!
//! [`Recorder`] is what the loop talks to. [`rerun`] is the sole importer of the Rerun SDK and writes `run.rrd`;
//! [`table`] writes `episodes.csv` and `rounds.csv`. [`visitation`] computes what pictures of visited states show, and
//! [`palette`] gives agents and numbers their colours. Training may not enter.

pub mod palette;
pub mod rerun;
mod settings;
pub mod table;
pub mod visitation;

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

pub use settings::{AxisChoice, Colour, Difference, PairChoice, RecordingSettings, SceneSettings};

use crate::env::{Force, Pose, Status};
use crate::experience::Episode;

/// Takes in rounds as they are finished. Must never change what is learned.
pub trait Recorder {
    /// Records one round.
    ///
    /// # Errors
    /// The file could not be written; what was written before stays readable.
    fn record_round(&mut self, round: &RoundRecord<'_>) -> Result<(), RecordError>;

    /// Brings everything recorded so far to disk and returns what is needed to go on with it after an interruption.
    ///
    /// # Errors
    /// The file could not be written.
    fn checkpoint(&mut self) -> Result<Vec<u8>, RecordError>;

    /// Completes the file. Nothing may be recorded afterwards.
    ///
    /// # Errors
    /// The file could not be completed; what was written before stays readable.
    fn finish(&mut self) -> Result<(), RecordError>;

    /// What people should know since they last asked, though nothing is lost.
    fn warning(&mut self) -> Option<String> {
        None
    }
}

/// One round of the whole team.
#[derive(Clone, Copy, Debug)]
pub struct RoundRecord<'a> {
    /// Counts from 0.
    pub round: u32,
    /// The round's episodes in (agent, episode) order.
    pub episodes: &'a [&'a Episode],
    /// One row an episode, in the same order.
    pub episode_rows: &'a [EpisodeRow],
    /// One row an update, in the order in which agents learned.
    pub round_rows: &'a [RoundRow],
    /// The filmed episodes of this round.
    pub footage: &'a [Footage],
}

/// Where the bodies were throughout one episode, and what pushed them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Footage {
    /// Whose episode.
    pub agent: u32,
    /// Which of the agent's episodes.
    pub episode: u32,
    /// `[(T+1) × bodies]`
    pub poses: Vec<Pose>,
    /// The forces of the steps that led to each row, row by row; none led to the first.
    pub forces: Vec<Force>,
    /// How many of them belong to each row: `[T+1]`
    pub forces_per_row: Vec<usize>,
}

/// One row of `episodes.csv`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpisodeRow {
    /// Who acted.
    pub agent: u32,
    /// The agent's own count, from 0.
    pub episode: u32,
    /// Counts from 0.
    pub round: u32,
    /// Steps of the whole team up to and including this row.
    pub env_steps: u64,
    /// Sum of the environment's rewards.
    pub r#return: f64,
    /// Steps.
    pub length: u32,
    /// `terminated` or `truncated`.
    pub outcome: Status,
    /// Part of the state space that the agent has visited so far, 0 to 1.
    pub coverage: f64,
    /// Entropy of where the agent had been by the end of the round, nats.
    pub visitation_entropy: f64,
    /// How alike the agents' visits were by the end of the round, 0 to 1; the same for all agents.
    pub team_overlap: f64,
    /// How many agents, none of whose visits overlap, would have differed as much, 1 to K; the same for all agents.
    pub effective_agents: f64,
}

/// One row of `rounds.csv`: what one agent's update was like.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoundRow {
    /// Who learned.
    pub agent: u32,
    /// Counts from 0.
    pub round: u32,
    /// Mean squared error of the value function against its (normalised) target, halved.
    pub value_loss: f32,
    /// The policy's surrogate loss.
    pub policy_loss: f32,
    /// Mean |ρ − 1| + 1 (thesis Fig. 5.4).
    pub ratio_deviation: f32,
    /// The largest ρ of all samples.
    pub largest_ratio: f32,
    /// Share of samples with zero policy gradient because of clipping.
    pub clipped_fraction: f32,
    /// Mean entropy of the policy, nats.
    pub entropy: f32,
    /// Mean bonus of a step of the agent's own; 0 without curiosity.
    pub intrinsic_reward: f32,
    /// Mean squared error of the model of the dynamics on fresh episodes, before it learned from them; 0 without curiosity. That of the
    /// first round is in raw units, because nothing is known yet to normalise by.
    pub prediction_error: f32,
    /// The team's: mean rank correlation between agents' judgements of the same steps. None without curiosity, where one
    /// model judges for all, or one agent is alone.
    pub bonus_agreement: Option<f32>,
    /// Part of the state space that the agent has visited so far, 0 to 1.
    pub coverage: f64,
    /// Entropy of where the agent has been so far, nats.
    pub visitation_entropy: f64,
    /// That entropy as a share of the largest one, 0 to 1.
    pub visitation_evenness: f64,
    /// Part of the state space that any agent has visited so far, 0 to 1; the same for all agents of a round.
    pub team_coverage: f64,
    /// How alike the agents' visits are, 0 to 1; the same for all agents of a round.
    pub team_overlap: f64,
    /// How many agents, none of whose visits overlap, would differ as much, 1 to K; the same for all agents of a round.
    pub effective_agents: f64,
}

/// A recording that could not be written, or not be gone on with.
#[derive(Debug, thiserror::Error)]
#[error("cannot {attempt} {path}: {reason}")]
pub struct RecordError {
    /// The file.
    pub path: PathBuf,
    /// What was to be done with it.
    pub attempt: Attempt,
    /// What the system said.
    pub reason: String,
}

/// What a recorder does with its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Attempt {
    /// Begins it or adds to it.
    Write,
    /// Reads how far it had come.
    GoOn,
}

impl std::fmt::Display for Attempt {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Write => "write",
            Self::GoOn => "go on with",
        })
    }
}
