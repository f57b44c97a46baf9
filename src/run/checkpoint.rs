//! Checkpoints: all that is needed to resume a run. A crash at any moment leaves the newest
//! complete checkpoint.
//!
//! `state.bin` is replaced as a whole, and the one before it is kept as `previous.bin`. A checkpoint
//! says which part of which replay file belongs to it, so that transitions are written once.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::files;
use super::replay_file::{ReplayFile, StoredTransitions};
use super::round_recorder::RecorderStates;
use super::sealed::{self, Format, SealError};
use super::trainer::Trainer;
use crate::record::written::{Written, WrittenFile};
use seedbed_input::limits::{MAX_LARGE_FILE_BYTES, read_bytes};

/// The contents of `checkpoint/state.bin`.
#[derive(Serialize, Deserialize)]
pub struct Checkpoint {
    /// The state of the [`Trainer`].
    pub trainer: Vec<u8>,
    /// The states of the recorders, in their order.
    pub recorders: Vec<Vec<u8>>,
    /// The files of the recorders: name and beginning of each.
    files: Vec<(String, Written)>,
    /// The transitions of the replay buffer; `None` if the team has none.
    replay: Option<StoredTransitions>,
}

/// Writes the checkpoints of a run.
pub struct CheckpointWriter {
    folder: PathBuf,
    replay_file: ReplayFile,
    /// Number of rounds in the newest checkpoint.
    newest_rounds: u32,
}

/// The state of a trainer that has not become a checkpoint yet.
pub(super) struct SavedTrainer {
    rounds: u32,
    trainer: Vec<u8>,
    replay: Option<StoredTransitions>,
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
    version: 14,
};

impl CheckpointWriter {
    /// For a run in this folder that has no checkpoint yet.
    #[must_use]
    pub fn new(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
            replay_file: ReplayFile::new(checkpoint_folder(folder)),
            newest_rounds: 0,
        }
    }

    /// Number of rounds in the newest checkpoint; 0 without one.
    pub(super) fn newest_rounds(&self) -> u32 {
        self.newest_rounds
    }

    /// Replaces the checkpoint in the run's folder. `recorders` are the states and files of the
    /// recorders.
    ///
    /// # Errors
    /// A file cannot be written; then the old checkpoint is kept.
    pub(super) fn write(
        &mut self,
        trainer: &Trainer,
        recorders: RecorderStates,
    ) -> Result<(), CheckpointError> {
        let saved = self.save(trainer)?;
        self.commit(saved, recorders)
    }

    /// The state of a trainer, to which the run can go back. Its replay buffer is stored already.
    ///
    /// # Errors
    /// The replay buffer cannot be stored.
    pub(super) fn save(&mut self, trainer: &Trainer) -> Result<SavedTrainer, CheckpointError> {
        let replay = trainer.replay();
        Ok(SavedTrainer {
            rounds: trainer.rounds(),
            trainer: trainer.save(),
            replay: replay
                .map(|replay| self.replay_file.write(replay))
                .transpose()?,
        })
    }

    /// Like [`write`](Self::write), for a state that was saved before.
    ///
    /// # Errors
    /// See [`write`](Self::write).
    ///
    /// # Panics
    /// Never: bytes always serialize.
    pub(super) fn commit(
        &mut self,
        saved: SavedTrainer,
        recorders: RecorderStates,
    ) -> Result<(), CheckpointError> {
        let checkpoint = Checkpoint {
            trainer: saved.trainer,
            recorders: recorders.states,
            files: recorders.files.iter().map(name_and_beginning).collect(),
            replay: saved.replay,
        };
        let path = file(&self.folder);
        let contents = postcard::to_stdvec(&checkpoint).expect("bytes always serialize");
        let kept = if path.is_file() {
            files::keep_as(&path, &previous_file(&self.folder))
        } else {
            Ok(())
        };
        let written = kept.and_then(|()| files::replace(&path, &sealed::seal(FORMAT, &contents)));
        // Only now does no checkpoint need earlier replay files.
        let written = written.and_then(|()| self.replay_file.committed(saved.replay));
        written.map_err(|error| CheckpointError {
            path,
            reason: error.to_string(),
        })?;
        self.newest_rounds = saved.rounds;
        Ok(())
    }
}

impl Checkpoint {
    /// Reads the checkpoint in a run's folder.
    ///
    /// # Errors
    /// The file is missing, is damaged, or has another version. If it is damaged and the checkpoint
    /// before it is not, the error says how to use that one.
    pub fn read(folder: &Path) -> Result<Self, CheckpointError> {
        Self::read_file(&file(folder)).map_err(|damage| Self::error(folder, &damage))
    }

    fn error(folder: &Path, damage: &Damage) -> CheckpointError {
        CheckpointError {
            path: file(folder),
            reason: format!("{damage}{}", previous_checkpoint_hint(folder, damage)),
        }
    }

    /// The files of the recorders of the run in `folder` as they were at its checkpoint; `None` if
    /// it has no checkpoint, or one of another version.
    ///
    /// # Errors
    /// The checkpoint is damaged or cannot be read.
    pub fn written_files(folder: &Path) -> Result<Option<Vec<WrittenFile>>, CheckpointError> {
        let checkpoint = match Self::read_file(&file(folder)) {
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

    /// Restores the state of a trainer whose team is not going to learn.
    ///
    /// # Errors
    /// The checkpoint is damaged or belongs to another scenario.
    pub fn restore_to_act(
        &self,
        folder: &Path,
        trainer: &mut Trainer,
    ) -> Result<(), CheckpointError> {
        trainer
            .restore(&self.trainer)
            .map_err(|reason| CheckpointError {
                path: file(folder),
                reason,
            })
    }

    /// Restores the state of a trainer that continues the run in a folder, and returns the writer
    /// of its next checkpoints.
    ///
    /// # Errors
    /// The checkpoint or its replay file is damaged or belongs to another scenario.
    pub fn restore(
        &self,
        folder: &Path,
        trainer: &mut Trainer,
    ) -> Result<CheckpointWriter, CheckpointError> {
        self.restore_to_act(folder, trainer)?;
        let replay_folder = checkpoint_folder(folder);
        let replay_file = match (self.replay, trainer.replay_mut()) {
            (Some(stored), Some(replay)) => ReplayFile::read(replay_folder, stored, replay)?,
            (None, None) => ReplayFile::new(replay_folder),
            _ => {
                return Err(CheckpointError {
                    path: file(folder),
                    reason: "is of another algorithm".to_owned(),
                });
            }
        };
        Ok(CheckpointWriter {
            folder: folder.to_owned(),
            replay_file,
            newest_rounds: trainer.rounds(),
        })
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

fn name_and_beginning(file: &WrittenFile) -> (String, Written) {
    let name = file.path.file_name().unwrap_or_default();
    (name.to_string_lossy().into_owned(), file.written)
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
        file(folder).display()
    )
}

/// The path of a run's checkpoint.
#[must_use]
pub fn file(folder: &Path) -> PathBuf {
    checkpoint_folder(folder).join("state.bin")
}

/// Removes the checkpoint of a run: first the file without which none of the others is used.
///
/// # Errors
/// A file cannot be removed.
pub fn remove(folder: &Path) -> std::io::Result<()> {
    files::remove_if_exists(&file(folder))?;
    match fs::remove_dir_all(checkpoint_folder(folder)) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Removes the checkpoints that processes did not complete because they were killed.
pub(super) fn remove_abandoned(folder: &Path) {
    files::remove_abandoned(&checkpoint_folder(folder), |_| true);
}

/// Whether a path is that of a run's checkpoint or of the one before it.
#[must_use]
pub fn is_checkpoint(path: &Path) -> bool {
    let run = path.parent().and_then(Path::parent);
    run.is_some_and(|run| {
        [file(run), previous_file(run)]
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

/// The path of the checkpoint before the newest.
fn previous_file(folder: &Path) -> PathBuf {
    checkpoint_folder(folder).join("previous.bin")
}

fn checkpoint_folder(folder: &Path) -> PathBuf {
    folder.join("checkpoint")
}
