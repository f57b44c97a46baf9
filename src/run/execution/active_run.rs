//! A run between its rounds: playing the next one, checkpoints, and going back to the last whole round.

use std::time::{Duration, Instant};

use super::build_trainer;
use super::checkpoint_schedule::CheckpointSchedule;
use super::checkpoint_writer::{CheckpointWriter, SavedTrainer};
use super::round_recorder::{CheckpointKind, RoundRecorder};
use super::stopping::{MAX_REPETITION, RoundDurations};
use super::{Observer, Options};
use crate::run::error::RunError;
use crate::run::folder::RunFolder;
use crate::run::folder::checkpoint::Checkpoint;
use crate::run::plan::Plan;
use crate::run::training::{RecordingOrder, Round, TrainerOnRanks};
use seedbed_learn::cancellation::Cancellation;

/// A run on rank 0, or in the only process.
pub(super) struct ActiveRun<'a> {
    pub(super) plan: &'a Plan,
    pub(super) options: &'a Options,
    pub(super) trainer: TrainerOnRanks<'a>,
    pub(super) recorder: RoundRecorder,
    pub(super) checkpoints: CheckpointWriter,
    pub(super) schedule: CheckpointSchedule,
    pub(super) durations: RoundDurations,
    /// Whether the observer knows that physics left the range in which it computes well.
    pub(super) has_warned: bool,
}

impl ActiveRun<'_> {
    /// Plays a round. `None` if it was cancelled: then the checkpoint is that of the round before. So it
    /// is after an error that a number is not finite.
    pub(super) fn play_round(
        &mut self,
        cancellation: &Cancellation,
        observer: &mut dyn Observer,
    ) -> Result<Option<Round>, RunError> {
        let (rounds, start) = (self.trainer.local().rounds(), Instant::now());
        let goes_back = self.trainer.can_go_back();
        let saved = if goes_back && self.durations.may_be_long() {
            Some(self.checkpoints.save(&self.trainer)?)
        } else {
            None
        };
        let played = cancellation.run(|| self.trainer.advance());
        self.warn_of_physics(observer);
        match played {
            Some(Ok(round)) => {
                self.durations.ended(start);
                Ok(Some(round))
            }
            Some(Err(diverged)) => {
                if goes_back {
                    self.go_back_to(rounds, saved, Duration::MAX)?;
                }
                let folder = &self.options.folder;
                let task_file = folder.task_file(&self.plan.description.spec().name);
                let text = &self.plan.environment_text;
                Err(diverged.located_in(&task_file, text).into())
            }
            None => {
                self.go_back_to(rounds, saved, MAX_REPETITION)?;
                Ok(None)
            }
        }
    }

    fn warn_of_physics(&mut self, observer: &mut dyn Observer) {
        if let (Some(warning), false) = (self.trainer.local().physics_warning(), self.has_warned) {
            observer.warn(&warning.to_string());
            self.has_warned = true;
        }
    }

    /// Writes the checkpoint of the state after this number of rounds. If it was not saved, the rounds
    /// since the newest checkpoint are repeated, which gives the same bits; but if that takes longer than
    /// `max_duration`, the newest checkpoint is kept.
    fn go_back_to(
        &mut self,
        rounds: u32,
        saved: Option<SavedTrainer>,
        max_duration: Duration,
    ) -> Result<(), RunError> {
        if let Some(saved) = saved {
            let recorders = self.recorder.checkpoint(CheckpointKind::AtEnd)?;
            return Ok(self.checkpoints.commit(saved, recorders)?);
        }
        let (start, folder) = (Instant::now(), self.options.folder.path());
        let mut trainer = build_trainer(self.plan, self.options)?;
        if RunFolder::new(folder).checkpoint_file().is_file() {
            self.checkpoints = Checkpoint::read(folder)?.restore(folder, &mut trainer)?;
        }
        self.trainer.go_back_to(trainer);
        while self.trainer.local().rounds() < rounds {
            if start.elapsed() >= max_duration {
                return Ok(());
            }
            self.trainer.advance()?;
        }
        self.write_checkpoint(CheckpointKind::AtEnd)
    }

    /// Writes a checkpoint if it is time or if the run is interrupted; returns whether it is interrupted.
    pub(super) fn checkpoint_if_due(&mut self) -> Result<bool, RunError> {
        let trainer = self.trainer.local();
        let is_interrupted = self.trainer.is_interrupted() && !trainer.is_done();
        let start = Instant::now();
        if is_interrupted {
            self.write_checkpoint(CheckpointKind::AtEnd)?;
        } else if self.schedule.is_due(trainer.rounds(), start) {
            self.write_checkpoint(CheckpointKind::Meanwhile)?;
            self.schedule.written(start);
        }
        Ok(is_interrupted)
    }

    pub(super) fn write_checkpoint(&mut self, kind: CheckpointKind) -> Result<(), RunError> {
        let at_end = kind == CheckpointKind::AtEnd;
        self.trainer
            .order_recorders(RecordingOrder::Checkpoint { at_end });
        let states = self.recorder.checkpoint(kind)?;
        Ok(self.checkpoints.write(&self.trainer, states)?)
    }
}
