//! Recordings: the files of a run that show its course, for viewers and for other tools.
//!
//! The training loop calls a [`Recorder`]. [`rerun`] writes `run.rrd` and is the sole importer of
//! the Rerun SDK; [`table`] writes `episodes.csv` and `rounds.csv`, whose columns are the
//! [`metrics`]. [`visitation`] computes what images of visited states show. Must not depend on
//! training.

mod bonus;
pub mod metrics;
pub mod rerun;
mod settings;
pub mod table;
pub mod visitation;

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

pub use bonus::BonusRange;
pub use metrics::RoundRow;
pub use settings::{AxisChoice, ColorBy, Difference, PairChoice, RecordingSettings, SceneSettings};

use seedbed_env::{Force, Pose, Status};
use seedbed_learn::experience::Episode;

/// Records each round after it is finished. Must not change what is learned.
pub trait Recorder {
    /// Records one round.
    ///
    /// # Errors
    /// If the file cannot be written. Everything written before stays readable.
    fn record_round(&mut self, round: &RoundRecord<'_>) -> Result<(), RecordError>;

    /// Writes everything recorded so far to disk, and returns what is needed to resume after an
    /// interruption.
    ///
    /// # Errors
    /// The file could not be written.
    fn checkpoint(&mut self) -> Result<Vec<u8>, RecordError>;

    /// Completes the file. Nothing may be recorded afterwards.
    ///
    /// # Errors
    /// The file could not be completed; what was written before stays readable.
    fn finish(&mut self) -> Result<(), RecordError>;

    /// The latest warning since the last call. A warning concerns users, but no data is lost.
    fn warning(&mut self) -> Option<String> {
        None
    }
}

/// One round of the whole team.
#[derive(Clone, Copy, Debug)]
pub struct RoundRecord<'a> {
    /// Number of the round, from 0.
    pub round: u32,
    /// The round's episodes in (agent, episode) order.
    pub episodes: &'a [&'a Episode],
    /// One row per episode, in the same order.
    pub episode_rows: &'a [EpisodeRow],
    /// One row per update, in the order in which agents learned.
    pub round_rows: &'a [RoundRow],
    /// Trajectories of the bodies, for those episodes of the round whose scene is recorded.
    pub body_trajectories: &'a [BodyTrajectory],
}

/// The poses of all bodies in each state of an episode, and the forces on them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BodyTrajectory {
    /// Number of the agent, from 0.
    pub agent: u32,
    /// Number of the agent's episode, from 0.
    pub episode: u32,
    /// Pose of each body in each state: `[(T+1) × bodies]`
    pub poses: Vec<Pose>,
    /// The forces during the step before each state, state by state. The first state has none.
    pub forces: Vec<Force>,
    /// Number of forces that belong to each state: `[T+1]`
    pub forces_per_row: Vec<usize>,
}

/// One row of `episodes.csv`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpisodeRow {
    /// The agent.
    pub agent: u32,
    /// Number of the agent's episode, from 0.
    pub episode: u32,
    /// Number of the round, from 0.
    pub round: u32,
    /// Number of steps of the whole team, up to and including this episode.
    pub env_steps: u64,
    /// Sum of the environment's rewards, undiscounted.
    pub r#return: f64,
    /// Number of steps.
    pub length: u32,
    /// `terminated` or `truncated`.
    pub outcome: Status,
    /// Share of the state space that the agent has visited so far, 0 to 1.
    pub coverage: f64,
    /// Entropy of the agent's visited states at the end of the round, nats.
    pub visitation_entropy: f64,
    /// Overlap of the agents' visited states at the end of the round, 0 to 1; equal for all agents.
    pub team_overlap: f64,
    /// Effective number of agents at the end of the round: the number of agents without overlap
    /// that would be equally diverse, 1 to K; equal for all agents of a round.
    pub effective_agents: f64,
}

/// Error: a file of a recording cannot be written or resumed.
#[derive(Debug, thiserror::Error)]
#[error("cannot {attempt} {path}: {reason}")]
pub struct RecordError {
    /// The file.
    pub path: PathBuf,
    /// The operation that failed.
    pub attempt: Attempt,
    /// Reason of the failure.
    pub reason: String,
}

/// An operation of a recorder on its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Attempt {
    /// Create the file or add to it.
    Write,
    /// Resume the file from a checkpoint.
    Resume,
}

impl std::fmt::Display for Attempt {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Write => "write",
            Self::Resume => "resume",
        })
    }
}
