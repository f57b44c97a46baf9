//! Why a run failed.

use std::path::PathBuf;

use super::folder::checkpoint::CheckpointError;
use super::folder::checksums::DamagedFile;
use super::recorder::RecordError;
use super::training::RoundFailure;
use seedbed_input::InputError;

/// Why a run failed.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A scenario, task or option is invalid.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A recording or table could not be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// A checkpoint could not be written.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The checkpoint from which a run is continued is missing, damaged, or of another run or version.
    #[error(transparent)]
    UnusableCheckpoint(CheckpointError),
    /// Another file of the run could not be written.
    #[error("cannot write {path}: {error}")]
    File {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        error: std::io::Error,
    },
    /// A file of the run is damaged, or was changed after it was written.
    #[error(transparent)]
    Damaged(#[from] DamagedFile),
    /// The run in the folder cannot be resumed with this plan.
    #[error("{0}")]
    CannotResume(String),
    /// A round could not be played, or a number in it is not finite.
    #[error(transparent)]
    Round(#[from] RoundFailure),
}
