//! The recorders of a run that begins, and of one that is resumed from its checkpoint.

use std::fs;
use std::path::PathBuf;

use super::checkpoint_writer::CheckpointWriter;
use super::ending::{replace_file, write_checksums};
use super::round_recorder::Recorders;
use super::same_run::check_same_run;
use super::{Observer, Options, RecorderFactories};
use crate::input_files;
use crate::run::error::RunError;
use crate::run::folder::RunFolder;
use crate::run::folder::checkpoint::{Checkpoint, CheckpointError};
use crate::run::folder::checksums::{Checksums, NewChecksums};
use crate::run::plan::Plan;
use crate::run::recorder::{Focus, RecorderFactory, RunInfo};
use crate::run::training::{RoundFailure, Trainer};
use crate::storage::files;
use seedbed_env::gymnasium::GymnasiumTask;
use seedbed_input::InputError;

/// The recorders of a run before they begin, which all ranks do together.
pub(super) struct RecordersToBegin {
    pub(super) factories: RecorderFactories,
    /// The states of recorders of a run to resume, in their order.
    pub(super) states: Option<Vec<Vec<u8>>>,
}

impl RecordersToBegin {
    /// The recorders of rank 0, or of the only process.
    pub(super) fn begin(
        self,
        plan: &Plan,
        options: &Options,
        trainer: &Trainer,
    ) -> Result<Recorders, RunError> {
        let settings = &plan.scenario.recording;
        with_run_info(plan, options, trainer, |info| {
            let begin = |(factory, state): (Box<dyn RecorderFactory>, Option<Vec<u8>>)| {
                Ok(match state {
                    Some(state) => factory.resume(info, settings, &state)?,
                    None => factory.create(info, settings)?,
                })
            };
            self.with_states().map(begin).collect()
        })
    }

    /// The recorders of another rank.
    pub(super) fn follow(
        self,
        plan: &Plan,
        options: &Options,
        trainer: &Trainer,
    ) -> Result<Recorders, RunError> {
        let settings = &plan.scenario.recording;
        with_run_info(plan, options, trainer, |info| {
            let mut recorders = Recorders::new();
            for (factory, state) in self.with_states() {
                recorders.extend(factory.follow(info, settings, state.as_deref())?);
            }
            Ok(recorders)
        })
    }

    /// Factories with the states of their recorders. A recorder of a run to resume that has no factory is left out.
    fn with_states(self) -> impl Iterator<Item = (Box<dyn RecorderFactory>, Option<Vec<u8>>)> {
        let states = match self.states {
            Some(states) => states.into_iter().map(Some).collect(),
            None => vec![None; self.factories.len()],
        };
        self.factories.into_iter().zip(states)
    }
}

/// Writes what a new run begins with.
pub(super) fn begin_new_run(
    plan: &Plan,
    options: &Options,
    factories: RecorderFactories,
) -> Result<RecordersToBegin, RunError> {
    write_scenario(plan, &options.folder)?;
    Ok(RecordersToBegin {
        factories,
        states: None,
    })
}

pub(super) fn resume_run(
    plan: &Plan,
    options: &Options,
    recorder_factories: RecorderFactories,
    trainer: &mut Trainer,
    observer: &mut dyn Observer,
) -> Result<(RecordersToBegin, CheckpointWriter), RunError> {
    let folder = &options.folder;
    Checksums::read(folder)?.verify_scenario()?;
    check_same_run(plan, options)?;
    let checkpoint = Checkpoint::read(folder.path()).map_err(RunError::UnusableCheckpoint)?;
    let checkpoints = checkpoint
        .restore(folder.path(), trainer)
        .map_err(RunError::UnusableCheckpoint)?;
    let states = &checkpoint.recorders;
    if states.is_empty() {
        let reason = "it has the states of no recorders".to_owned();
        let path = folder.checkpoint_file();
        return Err(RunError::UnusableCheckpoint(CheckpointError {
            path,
            reason,
        }));
    }
    check_max_episodes(plan, options, trainer)?;
    check_versions(plan, options, observer)?;
    rewrite_scenario(plan, folder)?;
    if states.len() > recorder_factories.len() {
        give_up_recording(folder, observer)?;
    }
    let recorders = RecordersToBegin {
        factories: recorder_factories,
        states: Some(checkpoint.recorders),
    };
    Ok((recorders, checkpoints))
}

/// Checks that an environment of Gymnasium is that with which the run began: the same versions of Python
/// and its packages.
fn check_versions(
    plan: &Plan,
    options: &Options,
    observer: &mut dyn Observer,
) -> Result<(), RunError> {
    let name = &plan.description.spec().name;
    let stored = input_files::read_task(&options.folder.task_file(name))?.0;
    let Some(task) = stored.gymnasium() else {
        return Ok(());
    };
    if let Some(warning) = task.repeatability_warning() {
        observer.warn(&warning);
    }
    let difference = task.version_difference().map_err(RoundFailure::from)?;
    let Some(difference) = difference else {
        return Ok(());
    };
    let reason = format!(
        "the run in {} began with {difference}",
        options.folder.path().display()
    );
    if options.other_versions {
        observer.warn(&reason);
        return Ok(());
    }
    Err(RunError::CannotResume(format!(
        "{reason}; resume it anyway with `--other-versions`"
    )))
}

/// Sets the recording of a run aside that is continued without it.
fn give_up_recording(folder: &RunFolder, observer: &mut dyn Observer) -> Result<(), RunError> {
    let aside = folder
        .set_recording_aside()
        .map_err(|error| RunError::File {
            path: folder.unfinished_recording_file(),
            error,
        })?;
    let kept = aside.map_or_else(
        || "its file is gone".to_owned(),
        |path| format!("what was recorded so far is kept in {}", path.display()),
    );
    observer.warn(&format!("the run continues without a recording: {kept}"));
    Ok(())
}

/// Checks that the run to resume does not have more episodes than the plan allows.
fn check_max_episodes(plan: &Plan, options: &Options, trainer: &Trainer) -> Result<(), RunError> {
    let episodes = trainer.measures().episodes_per_agent();
    let max_episodes = plan.scenario.max_episodes();
    if episodes <= max_episodes as usize {
        return Ok(());
    }
    Err(RunError::CannotResume(format!(
        "the run in {} has {episodes} episodes per agent already; it cannot end after {max_episodes}",
        options.folder.path().display(),
    )))
}

/// Calls `f` with the information about the run that recordings contain.
fn with_run_info<R>(
    plan: &Plan,
    options: &Options,
    trainer: &Trainer,
    f: impl FnOnce(&RunInfo<'_>) -> R,
) -> R {
    let scenario = plan.stored_scenario();
    f(&RunInfo {
        name: &format!("{}-seed-{}", plan.name, plan.scenario.seed),
        focus: Focus::Learning,
        spec: trainer.spec(),
        scene: trainer.scene(),
        agents: trainer.agent_count() as u32,
        ranks: options.ranks,
        bonus: plan.scenario.algorithm.largest_intrinsic_reward().into(),
        max_episodes: plan.scenario.max_episodes(),
        run_seed: plan.scenario.seed,
        scenario: &scenario,
        properties: &[("seedbed_version", env!("CARGO_PKG_VERSION").to_owned())],
    })
}

/// Writes the scenario, the copy of the task and their checksums. Checksums of earlier files are
/// removed first: a run that is stopped in between has none instead of wrong ones.
fn write_scenario(plan: &Plan, folder: &RunFolder) -> Result<(), RunError> {
    let checksums = folder.checksums_file();
    files::remove_if_exists(&checksums).map_err(|error| RunError::File {
        path: checksums.clone(),
        error,
    })?;
    let scenario = (folder.scenario_file(), plan.stored_scenario());
    let task_file = folder.task_file(&plan.description.spec().name);
    let task = (task_file, plan.environment_text.clone());
    let mut sums = NewChecksums::default();
    for (path, text) in [scenario, task]
        .into_iter()
        .chain(python_file(plan, folder)?)
    {
        replace_file(&path, text.as_bytes())?;
        sums.add(folder, &path, text.as_bytes());
    }
    write_checksums(&sums, folder)
}

/// Writes the scenario of a run that goes on. The file keeps its time, which is that of the run's beginning.
fn rewrite_scenario(plan: &Plan, folder: &RunFolder) -> Result<(), RunError> {
    let path = folder.scenario_file();
    let began = fs::metadata(&path).and_then(|metadata| metadata.modified());
    write_scenario(plan, folder)?;
    let kept = began.and_then(|began| {
        fs::File::options()
            .append(true)
            .open(&path)?
            .set_modified(began)
    });
    kept.map_err(|error| RunError::File { path, error })
}

/// The copy of the Python file that makes the environment, if the task names one.
fn python_file(plan: &Plan, folder: &RunFolder) -> Result<Option<(PathBuf, String)>, InputError> {
    let Some(path) = plan
        .description
        .gymnasium()
        .and_then(GymnasiumTask::python_file)
    else {
        return Ok(None);
    };
    let text = seedbed_input::read_text(&path)?;
    Ok(Some((folder.python_file(&path), text)))
}
