//! What a run passes to its recorders: finished rounds, and what a recording says about its run.
//!
//! The training loop gets one [`RecorderFactory`] per file, and passes each round to the [`Recorder`]
//! that the factory makes. The module `record` has recorders.

mod bonus;
mod run_info;

use std::path::PathBuf;

pub use self::bonus::BonusRange;
pub use self::run_info::{Focus, RunInfo};
use super::facts::{EpisodeDetails, EpisodeRow, RoundRow};
use crate::scenario::recording::RecordingSettings;
use crate::storage::written::WrittenFile;
use seedbed_learn::experience::{Episode, StepData};
use seedbed_learn::team::Workers;

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

    /// The part of the recorder that belongs to a rank other than 0; `None` if rank 0 needs no help, as by default. `checkpoint`
    /// is that of the recorder on rank 0, if the run is resumed. All ranks then make the same calls of their parts.
    ///
    /// # Errors
    /// The checkpoint belongs to another recorder or run.
    fn follow(
        self: Box<Self>,
        _info: &RunInfo<'_>,
        _settings: &RecordingSettings,
        _checkpoint: Option<&[u8]>,
    ) -> Result<Option<Box<dyn Recorder>>, RecordError> {
        Ok(None)
    }
}

/// One round of the whole team. On one of several ranks, episodes and what belongs to them are those of the local agents, and
/// only rank 0 has all rows.
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
    /// Bodies and entries of `info` of the episodes of this round that have any to record, in (agent,
    /// episode) order. Rank 0 has the bodies of all agents.
    pub details: &'a [EpisodeDetails],
    /// The threads among which a recorder may divide its work. What it records does not depend on them.
    pub workers: Workers<'a>,
}

impl RoundRecord<'_> {
    /// Bodies and entries of `info` of an episode; `None` if it has none to record.
    #[must_use]
    pub fn details_of(&self, agent: u32, episode: u32) -> Option<&EpisodeDetails> {
        let key = (agent, episode);
        let details_key = |details: &EpisodeDetails| (details.agent, details.episode);
        let index = self.details.binary_search_by_key(&key, details_key).ok()?;
        self.details.get(index)
    }

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
