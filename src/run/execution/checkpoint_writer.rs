//! Checkpoints of a trainer: writing them, and going back to them.

use std::path::{Path, PathBuf};

use super::replay_file::ReplayFile;
use super::round_recorder::RecorderStates;
use crate::run::folder::RunFolder;
use crate::run::folder::checkpoint::{Checkpoint, CheckpointError, StoredTransitions};
use crate::run::training::{Trainer, TrainerOnRanks};
use crate::storage::written::{Written, WrittenFile};

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

impl CheckpointWriter {
    /// For a run in this folder that has no checkpoint yet.
    #[must_use]
    pub fn new(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
            replay_file: ReplayFile::new(RunFolder::new(folder).checkpoint_folder()),
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
        trainer: &TrainerOnRanks<'_>,
        recorders: RecorderStates,
    ) -> Result<(), CheckpointError> {
        let saved = self.save(trainer)?;
        self.commit(saved, recorders)
    }

    /// The state of a trainer, to which the run can go back. Its replay buffer is stored already.
    ///
    /// # Errors
    /// The replay buffer cannot be stored.
    pub(super) fn save(
        &mut self,
        trainer: &TrainerOnRanks<'_>,
    ) -> Result<SavedTrainer, CheckpointError> {
        let replay = trainer.local().replay();
        Ok(SavedTrainer {
            rounds: trainer.local().rounds(),
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
        let written = checkpoint.write(&self.folder);
        // Only now does no checkpoint need earlier replay files.
        let written = written.and_then(|()| self.replay_file.committed(saved.replay));
        written.map_err(|error| CheckpointError {
            path: checkpoint_file(&self.folder),
            reason: error.to_string(),
        })?;
        self.newest_rounds = saved.rounds;
        Ok(())
    }
}

impl Checkpoint {
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
                path: checkpoint_file(folder),
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
        let replay_folder = RunFolder::new(folder).checkpoint_folder();
        let replay_file = match (self.replay, trainer.replay_mut()) {
            (Some(stored), Some(replay)) => ReplayFile::read(replay_folder, stored, replay)?,
            (None, None) => ReplayFile::new(replay_folder),
            _ => {
                return Err(CheckpointError {
                    path: checkpoint_file(folder),
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

fn name_and_beginning(file: &WrittenFile) -> (String, Written) {
    let name = file.path.file_name().unwrap_or_default();
    (name.to_string_lossy().into_owned(), file.written)
}

fn checkpoint_file(folder: &Path) -> PathBuf {
    RunFolder::new(folder).checkpoint_file()
}
