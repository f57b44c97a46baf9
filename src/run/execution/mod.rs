//! The training loop, from the first round to the files of a finished run.
//!
//! [`execute`] is the loop; `resume` begins it from a checkpoint, `ending` completes the files.
//! `round_recorder` passes rounds to the recorders, `checkpoint_writer` and `replay_file` store
//! checkpoints, `stopping` ends rounds after an interruption.

mod active_run;
pub(crate) mod checkpoint_schedule;
mod checkpoint_writer;
mod ending;
mod progress;
mod replay_file;
mod resume;
mod round_recorder;
mod same_run;
pub(crate) mod stopping;

use std::sync::atomic::AtomicBool;

use self::active_run::ActiveRun;
use self::checkpoint_schedule::CheckpointSchedule;
use self::checkpoint_writer::CheckpointWriter;
use self::ending::finish;
pub(crate) use self::ending::write_checksums_of_results;
pub use self::progress::{Observer, Options, Progress, RecorderFactories, RunOutcome};
use self::resume::{RecordersToBegin, begin_new_run, resume_run};
use self::round_recorder::CheckpointKind;
pub(super) use self::round_recorder::RoundRecorder;
use self::stopping::RoundDurations;
use crate::run::error::RunError;
use crate::run::folder::checkpoint::Checkpoint;
use crate::run::plan::Plan;
use crate::run::training::{FollowingRecorders, RecordingOrder, Round, Trainer, TrainerOnRanks};
use seedbed_input::InputError;
use seedbed_learn::cancellation::Cancellation;

/// Trains until the scenario's `stop` is reached or `interrupted` is set. After an interruption, the
/// checkpoint has the last whole round: that which is being played, if it ends within a second, otherwise
/// that before it. If a number is not finite, it has the round before. `recorder_factories` make
/// the recorders. A resumed run continues with the recorders with which it began; further factories
/// are ignored. If a recorder has no factory, the run goes on without it, and what it
/// recorded is kept in another file.
///
/// If the run is divided over ranks, rank 0 writes the results, and each plays, learns and records for its agents.
///
/// # Errors
/// A file could not be read or written, or a number is not finite. Files that were written before
/// the error can still be read. If the run is divided over ranks, the others wait until this process
/// ends them.
pub fn execute(
    plan: &Plan,
    options: &Options,
    recorder_factories: RecorderFactories,
    observer: &mut dyn Observer,
    interrupted: &AtomicBool,
) -> Result<RunOutcome, RunError> {
    if !options.ranks.is_first() {
        return follow(plan, options, recorder_factories, interrupted);
    }
    if !options.ranks.is_single() {
        // A rank that abandons its round would let the others wait.
        let never = Cancellation::default();
        return lead(
            plan,
            options,
            recorder_factories,
            observer,
            interrupted,
            &never,
        );
    }
    stopping::with_grace(interrupted, |cancellation| {
        lead(
            plan,
            options,
            recorder_factories,
            observer,
            interrupted,
            cancellation,
        )
    })
}

/// What rank 0 does, or the only process. `cancellation` ends a round that lasts long after the
/// interruption.
fn lead(
    plan: &Plan,
    options: &Options,
    recorder_factories: RecorderFactories,
    observer: &mut dyn Observer,
    interrupted: &AtomicBool,
    cancellation: &Cancellation,
) -> Result<RunOutcome, RunError> {
    let begin = || begin(plan, options, recorder_factories, observer);
    let Some(begun) = cancellation.run(begin) else {
        return Ok(RunOutcome::Interrupted { rounds: 0 });
    };
    let (trainer, (recorders, checkpoints)) =
        TrainerOnRanks::begin(begun, options.ranks, interrupted)?;
    let recorders = recorders.begin(plan, options, trainer.local())?;
    let mut run = ActiveRun {
        plan,
        options,
        recorder: RoundRecorder::of_run(recorders, trainer.local().agent_count(), options),
        trainer,
        checkpoints,
        schedule: CheckpointSchedule::of(&plan.scenario),
        durations: RoundDurations::new(),
        has_warned: false,
    };
    observer.begun(&Progress::of(plan, run.trainer.local()));
    while !run.trainer.local().is_done() {
        let Some(round) = run.play_round(cancellation, observer)? else {
            let rounds = run.checkpoints.newest_rounds();
            return Ok(RunOutcome::Interrupted { rounds });
        };
        let trainer = run.trainer.local();
        observer.round_finished(&Progress::of(plan, trainer), &round.rows);
        let (rounds, episodes) = (trainer.rounds(), trainer.newest_episodes());
        run.recorder.record(rounds - 1, &episodes, round)?;
        report_warnings(&mut run.recorder, observer);
        if run.checkpoint_if_due()? {
            run.trainer.end();
            return Ok(RunOutcome::Interrupted { rounds });
        }
    }
    let checkpoint = run.write_checkpoint(CheckpointKind::AtEnd);
    let ending = checkpoint.and_then(|()| finish(plan, options, &run.trainer, &mut run.recorder));
    report_warnings(&mut run.recorder, observer);
    let outcome = ending?;
    run.trainer.end();
    Ok(outcome)
}

/// Plays, learns and records for the agents of a rank that does not write the results.
fn follow(
    plan: &Plan,
    options: &Options,
    recorder_factories: RecorderFactories,
    interrupted: &AtomicBool,
) -> Result<RunOutcome, RunError> {
    let begun = begin_to_follow(plan, options, recorder_factories);
    let (trainer, recorders) = TrainerOnRanks::begin(begun, options.ranks, interrupted)?;
    let recorders = recorders.follow(plan, options, trainer.local())?;
    let agents = trainer.local().agent_count();
    trainer.follow(&mut RoundRecorder::of_run(recorders, agents, options))?;
    Ok(RunOutcome::Elsewhere)
}

impl FollowingRecorders for RoundRecorder {
    type Error = RunError;

    fn record(&mut self, trainer: &Trainer, round: Round) -> Result<(), RunError> {
        let (rounds, episodes) = (trainer.rounds(), trainer.newest_episodes());
        Ok(self.record(rounds - 1, &episodes, round)?)
    }

    fn obey(&mut self, order: RecordingOrder) -> Result<(), RunError> {
        match order {
            RecordingOrder::Checkpoint { at_end: true } => {
                drop(self.checkpoint(CheckpointKind::AtEnd)?);
            }
            RecordingOrder::Checkpoint { at_end: false } => {
                drop(self.checkpoint(CheckpointKind::Meanwhile)?);
            }
            RecordingOrder::Finish => self.finish()?,
        }
        Ok(())
    }
}

fn begin_to_follow(
    plan: &Plan,
    options: &Options,
    factories: RecorderFactories,
) -> Result<(Trainer, RecordersToBegin), RunError> {
    let mut trainer = build_trainer(plan, options)?;
    let mut recorders = RecordersToBegin {
        factories,
        states: None,
    };
    if options.resume {
        let folder = options.folder.path();
        let unusable = RunError::UnusableCheckpoint;
        let checkpoint = Checkpoint::read(folder).map_err(unusable)?;
        checkpoint.restore(folder, &mut trainer).map_err(unusable)?;
        recorders.states = Some(checkpoint.recorders);
    }
    Ok((trainer, recorders))
}

fn build_trainer(plan: &Plan, options: &Options) -> Result<Trainer, InputError> {
    let Options { threads, ranks, .. } = options;
    Trainer::on_ranks(&plan.scenario, &plan.description, *threads, *ranks)
}

/// The trainer, and the recorders and the writer of checkpoints of a new run or a run to resume.
fn begin(
    plan: &Plan,
    options: &Options,
    recorder_factories: RecorderFactories,
    observer: &mut dyn Observer,
) -> Result<(Trainer, (RecordersToBegin, CheckpointWriter)), RunError> {
    let mut trainer = build_trainer(plan, options)?;
    let begun = if options.resume {
        resume_run(plan, options, recorder_factories, &mut trainer, observer)?
    } else {
        let recorders = begin_new_run(plan, options, recorder_factories)?;
        (recorders, CheckpointWriter::new(options.folder.path()))
    };
    Ok((trainer, begun))
}

fn report_warnings(recorder: &mut RoundRecorder, observer: &mut dyn Observer) {
    for warning in recorder.take_warnings() {
        observer.warn(&warning);
    }
}
