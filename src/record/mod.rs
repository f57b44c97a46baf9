//! Recordings: the files of a run that show its course, for viewers and for other tools.
//!
//! The training loop gets one [`RecorderFactory`] per file, and passes each round to the
//! [`Recorder`] that the factory makes. [`recording`] writes `run.rrd`; in builds with the feature
//! `rerun` it is the module `rerun`, and only that module imports the Rerun SDK. [`table`] writes
//! `episodes.csv` and `rounds.csv`, whose columns are the [`metrics`]. [`state_files`] reads visited
//! states that other programs recorded; [`RecordedStates`] are those or a recording. [`visitation`] computes what
//! images of visited states show. These modules must not depend on training.

mod bonus;
mod common_axes;
mod live_error;
pub mod metrics;
mod recorded_episode;
mod recorded_states;
#[cfg(not(feature = "rerun"))]
pub mod recording;
#[cfg(feature = "rerun")]
pub mod rerun;
mod run_info;
mod settings;
pub mod state_files;
pub mod table;
pub mod visitation;
pub mod written;

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// The module that writes and reads recordings. In builds without the feature `rerun`, another
/// module has the same interface, and its calls return errors.
#[cfg(feature = "rerun")]
pub use self::rerun as recording;
use self::written::WrittenFile;
pub use bonus::BonusRange;
pub use common_axes::common_axes;
pub(crate) use common_axes::{difference as difference_of_quantities, widen};
pub use live_error::LiveError;
pub use metrics::RoundRow;
pub use recorded_episode::{ReadError, RecordedEpisode, RecordedScene};
pub use recorded_states::RecordedStates;
pub use run_info::{Focus, RunInfo};
pub use settings::{AxisChoice, ColorBy, Difference, PairChoice, RecordingSettings, SceneSettings};

use seedbed_env::{Force, Pose, Status};
use seedbed_learn::experience::{Episode, StepData};

/// Error message of builds without the feature `rerun` when a recording is requested.
pub(crate) const UNAVAILABLE: &str = "this build of seedbed cannot write, show or read recordings: build it with the feature `rerun`, which is on by default";

/// Records each round after it is finished. Must not change what is learned. A run calls its
/// recorders in a thread of their own if it has more than one thread.
pub trait Recorder: Send {
    /// Records one round.
    ///
    /// # Errors
    /// If the file cannot be written. Everything written before stays readable.
    fn record_round(&mut self, round: &RoundRecord<'_>) -> Result<(), RecordError>;

    /// Writes everything recorded so far to the file, before the run ends or is interrupted. Without
    /// this call, [`checkpoint`](Self::checkpoint) may keep the newest rows for larger blocks.
    ///
    /// # Errors
    /// The file could not be written.
    fn flush(&mut self) -> Result<(), RecordError> {
        Ok(())
    }

    /// Writes the file to disk, and returns what is needed to resume after an interruption.
    ///
    /// # Errors
    /// The file could not be written.
    fn checkpoint(&mut self) -> Result<Vec<u8>, RecordError>;

    /// The files with what was written of them at the latest [`checkpoint`](Self::checkpoint), so
    /// that damage to it is noticed.
    fn written_files(&self) -> Vec<WrittenFile> {
        Vec::new()
    }

    /// Completes the file. Nothing may be recorded afterwards.
    ///
    /// # Errors
    /// The file could not be completed; what was written before stays readable.
    fn finish(&mut self) -> Result<(), RecordError>;

    /// Takes the latest warning since the last call. A warning does not mean that
    /// data is lost.
    fn take_warning(&mut self) -> Option<String> {
        None
    }
}

/// Makes one recorder of a run, when the run begins or is resumed.
pub trait RecorderFactory {
    /// Starts recording a run from its first round.
    ///
    /// # Errors
    /// A file could not be created.
    fn create(
        self: Box<Self>,
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
    ) -> Result<Box<dyn Recorder>, RecordError>;

    /// Resumes recording a run from where [`Recorder::checkpoint`] returned `checkpoint`.
    ///
    /// # Errors
    /// The checkpoint belongs to another recorder or run, or a file could not be read or written.
    fn resume(
        self: Box<Self>,
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
        checkpoint: &[u8],
    ) -> Result<Box<dyn Recorder>, RecordError>;
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
    /// Values that updates computed for the steps of episodes, in (agent, episode) order. An
    /// episode for which nothing was computed has no entry.
    pub step_data: &'a [StepData],
    /// Trajectories of the bodies, in the episodes of this round whose scene is recorded.
    pub body_trajectories: &'a [BodyTrajectory],
}

impl RoundRecord<'_> {
    /// Intrinsic rewards and advantages that an update computed for the steps of an episode; `None`
    /// if it computed none.
    #[must_use]
    pub fn step_data_of(&self, episode: &Episode) -> Option<&StepData> {
        let key = (episode.agent, episode.episode);
        let data_key = |data: &StepData| (data.agent, data.episode);
        let index = self.step_data.binary_search_by_key(&key, data_key).ok()?;
        Some(&self.step_data[index])
    }
}

/// The poses of all bodies in each state of an episode, the forces on them, and the ground.
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
    /// The lines of the ground of this episode, as points in the world, m: `[lines]` of `[points]`
    pub terrain: Vec<Vec<[f32; 2]>>,
}

/// One row of `episodes.csv`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpisodeRow {
    /// Number of the agent, from 0.
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
