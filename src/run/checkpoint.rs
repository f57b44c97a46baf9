//! Checkpoints: all that is needed to resume a run. A crash at any moment leaves the newest
//! complete checkpoint.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::files;

/// The contents of `checkpoint/state.bin`.
#[derive(Serialize, Deserialize)]
pub struct Checkpoint {
    /// Version of the format; files of other versions cannot be read.
    version: u32,
    /// The state of the [`Trainer`](super::trainer::Trainer).
    pub trainer: Vec<u8>,
    /// The states of the recorders, in their order.
    pub recorders: Vec<Vec<u8>>,
}

/// A checkpoint could not be written or read.
#[derive(Debug, thiserror::Error)]
#[error("checkpoint {path}: {reason}")]
pub struct CheckpointError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong.
    pub reason: String,
}

/// Version of the format that this program reads and writes.
const VERSION: u32 = 6;

impl Checkpoint {
    /// A checkpoint in the version of the format that this program writes.
    #[must_use]
    pub fn new(trainer: Vec<u8>, recorders: Vec<Vec<u8>>) -> Self {
        Self {
            version: VERSION,
            trainer,
            recorders,
        }
    }

    /// Replaces the checkpoint in a run's folder.
    ///
    /// # Errors
    /// The file cannot be written; then the old checkpoint is kept.
    ///
    /// # Panics
    /// Never: bytes always serialize.
    pub fn write(&self, folder: &Path) -> Result<(), CheckpointError> {
        let path = file(folder);
        let bytes = postcard::to_stdvec(self).expect("bytes always serialize");
        files::replace(&path, &bytes).map_err(|error| CheckpointError {
            path,
            reason: error.to_string(),
        })
    }

    /// Reads the checkpoint in a run's folder.
    ///
    /// # Errors
    /// The file is missing, is damaged, or has another version.
    pub fn read(folder: &Path) -> Result<Self, CheckpointError> {
        let path = file(folder);
        let error_with = |reason: String| CheckpointError {
            path: path.clone(),
            reason,
        };
        let bytes = fs::read(&path).map_err(|error| error_with(error.to_string()))?;
        let (version, _) = postcard::take_from_bytes::<u32>(&bytes)
            .map_err(|error| error_with(error.to_string()))?;
        if version != VERSION {
            return Err(error_with(format!(
                "is of format {version}; this seedbed reads format {VERSION}"
            )));
        }
        postcard::from_bytes(&bytes).map_err(|error| error_with(format!("is damaged: {error}")))
    }
}

/// The path of a run's checkpoint.
#[must_use]
pub fn file(folder: &Path) -> PathBuf {
    folder.join("checkpoint").join("state.bin")
}
