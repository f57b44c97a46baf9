//! Checkpoints: all that a run needs to go on, written so that a crash at any moment leaves the
//! newest complete one.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::files;

/// What `checkpoint/state.bin` holds.
#[derive(Serialize, Deserialize)]
pub struct Checkpoint {
    /// The format, so that a file of another version is refused rather than misread.
    version: u32,
    /// What the [`Trainer`](super::trainer::Trainer) goes on from.
    pub trainer: Vec<u8>,
    /// What each recorder goes on from, in their order.
    pub recorders: Vec<Vec<u8>>,
}

/// A checkpoint that cannot be written or read.
#[derive(Debug, thiserror::Error)]
#[error("checkpoint {path}: {reason}")]
pub struct CheckpointError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong.
    pub reason: String,
}

const VERSION: u32 = 6;

impl Checkpoint {
    /// A checkpoint of this version.
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
    /// The file cannot be written; the old one stays.
    ///
    /// # Panics
    /// Never: bytes always serialise.
    pub fn write(&self, folder: &Path) -> Result<(), CheckpointError> {
        let path = file(folder);
        let bytes = postcard::to_stdvec(self).expect("bytes always serialise");
        files::replace(&path, &bytes).map_err(|error| CheckpointError {
            path,
            reason: error.to_string(),
        })
    }

    /// Reads the checkpoint in a run's folder.
    ///
    /// # Errors
    /// There is none, or it is unreadable.
    pub fn read(folder: &Path) -> Result<Self, CheckpointError> {
        let path = file(folder);
        let fault = |reason: String| CheckpointError {
            path: path.clone(),
            reason,
        };
        let bytes = fs::read(&path).map_err(|error| fault(error.to_string()))?;
        let (version, _) =
            postcard::take_from_bytes::<u32>(&bytes).map_err(|error| fault(error.to_string()))?;
        if version != VERSION {
            return Err(fault(format!(
                "is of format {version}; this seedbed reads format {VERSION}"
            )));
        }
        postcard::from_bytes(&bytes).map_err(|error| fault(format!("is damaged: {error}")))
    }
}

/// Where a run's checkpoint lies.
#[must_use]
pub fn file(folder: &Path) -> PathBuf {
    folder.join("checkpoint").join("state.bin")
}
