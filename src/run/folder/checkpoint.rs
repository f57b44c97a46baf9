//! Checkpoints: all that is needed to resume a run. A crash at any moment leaves the newest
//! complete checkpoint.
//!
//! `state.bin` is replaced as a whole, and the one before it is kept as `previous.bin`. A checkpoint
//! says which part of which replay file belongs to it, so that transitions are written once.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::RunFolder;
use crate::storage::files;
use crate::storage::sealed::{self, Format, SealError};
use crate::storage::written::{Written, WrittenFile};
use seedbed_input::limits::{MAX_LARGE_FILE_BYTES, read_bytes};

/// The contents of `checkpoint/state.bin`.
#[derive(Serialize, Deserialize)]
pub struct Checkpoint {
    /// The state of the trainer.
    pub trainer: Vec<u8>,
    /// The states of the recorders, in their order.
    pub recorders: Vec<Vec<u8>>,
    /// The files of the recorders: name and beginning of each.
    pub(crate) files: Vec<(String, Written)>,
    /// The transitions of the replay buffer; `None` if the team has none.
    pub(crate) replay: Option<StoredTransitions>,
}

/// Which transitions in which file belong to a checkpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct StoredTransitions {
    /// Number of the file; files of a run are numbered from 1.
    pub(crate) file: u64,
    /// Number of the first transition in the file.
    pub(crate) first: u64,
    /// Number of transitions in the file.
    pub(crate) count: u64,
    /// XXH64 of these transitions.
    pub(crate) checksum: u64,
}

impl StoredTransitions {
    /// Number of the transition after the last.
    pub(crate) fn end(&self) -> u64 {
        self.first + self.count
    }
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

const FORMAT: Format = Format {
    kind: *b"ckpt",
    version: 16,
};

impl Checkpoint {
    /// Reads the checkpoint in a run's folder.
    ///
    /// # Errors
    /// The file is missing, is damaged, or has another version. If it is damaged and the checkpoint
    /// before it is not, the error says how to use that one.
    pub fn read(folder: &Path) -> Result<Self, CheckpointError> {
        Self::read_file(&checkpoint_file(folder)).map_err(|damage| Self::error(folder, &damage))
    }

    fn error(folder: &Path, damage: &Damage) -> CheckpointError {
        CheckpointError {
            path: checkpoint_file(folder),
            reason: format!("{damage}{}", previous_checkpoint_hint(folder, damage)),
        }
    }

    /// The files of the recorders of the run in `folder` as they were at its checkpoint; `None` if
    /// it has no checkpoint, or one of another version.
    ///
    /// # Errors
    /// The checkpoint is damaged or cannot be read.
    pub fn written_files(folder: &Path) -> Result<Option<Vec<WrittenFile>>, CheckpointError> {
        let checkpoint = match Self::read_file(&checkpoint_file(folder)) {
            Ok(checkpoint) => checkpoint,
            Err(Damage::Unreadable(error)) if error.kind() == ErrorKind::NotFound => {
                return Ok(None);
            }
            Err(Damage::Seal(SealError::OtherVersion { .. })) => return Ok(None),
            Err(damage) => return Err(Self::error(folder, &damage)),
        };
        let files = checkpoint.files.into_iter();
        let written_file = |(name, written)| WrittenFile {
            path: folder.join(name),
            written,
        };
        Ok(Some(files.map(written_file).collect()))
    }

    fn read_file(path: &Path) -> Result<Self, Damage> {
        let bytes = read_bytes(path, MAX_LARGE_FILE_BYTES)?;
        let contents = sealed::unseal(FORMAT, &bytes)?;
        Ok(postcard::from_bytes(contents)?)
    }

    /// Replaces the checkpoint in a run's folder, and keeps the one before it.
    ///
    /// # Errors
    /// The operating system reports an error; then the old checkpoint is kept.
    ///
    /// # Panics
    /// Never: bytes always serialize.
    pub(crate) fn write(&self, folder: &Path) -> io::Result<()> {
        let path = checkpoint_file(folder);
        if path.is_file() {
            files::keep_as(&path, &previous_file(folder))?;
        }
        let contents = postcard::to_stdvec(self).expect("bytes always serialize");
        files::replace(&path, &sealed::seal(FORMAT, &contents))
    }
}

/// Why a checkpoint cannot be read.
#[derive(Debug, thiserror::Error)]
enum Damage {
    #[error(transparent)]
    Unreadable(#[from] std::io::Error),
    #[error(transparent)]
    Seal(#[from] SealError),
    #[error("is damaged: {0}")]
    Contents(#[from] postcard::Error),
}

/// How to use the checkpoint before a damaged one; empty if it cannot be used either.
fn previous_checkpoint_hint(folder: &Path, damage: &Damage) -> String {
    let previous = previous_file(folder);
    let is_of_other_version = matches!(damage, Damage::Seal(SealError::OtherVersion { .. }));
    if is_of_other_version || Checkpoint::read_file(&previous).is_err() {
        return String::new();
    }
    format!(
        "; the checkpoint before it is intact: to use that one, rename {} to {}",
        previous.display(),
        checkpoint_file(folder).display()
    )
}

/// Whether a path is that of a run's checkpoint or of the one before it.
#[must_use]
pub fn is_checkpoint(path: &Path) -> bool {
    let run = path.parent().and_then(Path::parent);
    run.is_some_and(|run| {
        [checkpoint_file(run), previous_file(run)]
            .iter()
            .any(|name| name == path)
    })
}

/// Why the bytes of a checkpoint are damaged; `None` if they are not, also in another version.
#[must_use]
pub fn damage(bytes: &[u8]) -> Option<String> {
    match sealed::unseal(FORMAT, bytes) {
        Ok(_) | Err(SealError::OtherVersion { .. }) => None,
        Err(error) => Some(error.to_string()),
    }
}

fn checkpoint_file(folder: &Path) -> PathBuf {
    RunFolder::new(folder).checkpoint_file()
}

fn previous_file(folder: &Path) -> PathBuf {
    RunFolder::new(folder).previous_checkpoint_file()
}
