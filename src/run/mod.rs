//! Runs: the training loop of concurrent episodes, shared experience, updates and records (thesis
//! Alg. 3), and the files of a run.
//!
//! [`execute`] is the loop. A [`trainer`] holds environment, team and shared buffer; [`rollout`]
//! plays the episodes of a round, `asynchronous` those without a common start and end;
//! [`shared_world`] plays several runs in the copies of one environment; [`measures`]
//! computes coverage and returns; `round_recorder` passes rounds to the recorders; [`checkpoint`] and
//! [`folder`] store a run, and [`review`] reads its results. [`ranks`] are the processes over which a
//! run may be divided; `shared_episodes` and `remote_steps` are what they exchange. Must not contain
//! formulas of learning.

mod active_run;
mod agreement;
mod asynchronous;
pub mod checkpoint;
pub(crate) mod checkpoint_schedule;
pub mod checksums;
mod episode_slots;
pub mod episode_warning;
pub mod evaluate;
pub mod file_lock;
pub mod files;
pub mod folder;
pub mod incomplete;
pub mod measures;
pub mod memory;
pub mod overview;
pub mod preview;
pub mod ranks;
mod remote_steps;
pub mod replay;
mod replay_file;
pub mod review;
pub mod rollout;
mod round_recorder;
pub(crate) mod sealed;
mod shared_episodes;
pub mod shared_world;
pub(crate) mod stopping;
pub mod summary;
pub mod trainer;
pub mod weights;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use self::active_run::{ActiveRun, AfterRound};
use self::checkpoint::{Checkpoint, CheckpointError, CheckpointWriter};
use self::checkpoint_schedule::CheckpointSchedule;
use self::checksums::{Checksums, DamagedFile, NewChecksums};
use self::folder::RunFolder;
use self::ranks::Ranks;
use self::round_recorder::{CheckpointKind, Recorders, RoundRecorder};
use self::stopping::RoundDurations;
use self::summary::Summary;
use self::trainer::{Diverged, Trainer};

use crate::input_files;
use crate::record::{Focus, RecordError, RecorderFactory, RunInfo};
use crate::scenario::{self, Scenario, overrides};
use crate::text::file_stem;
use seedbed_env::TaskDescription;
use seedbed_input::{Document, InputError};
use seedbed_learn::agent::Tensor;
use seedbed_learn::cancellation::Cancellation;
use seedbed_settings::{Difference, Settings};

/// A scenario and its task, read and checked: all that determines the results of a run.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The scenario's name: its file's stem.
    pub name: String,
    /// The scenario.
    pub scenario: Scenario,
    /// The task.
    pub description: TaskDescription,
    /// The text of the task's file.
    pub environment_text: String,
}

/// How a plan is run. Options never change the results.
#[derive(Clone, Debug)]
pub struct Options {
    /// The directory of the results.
    pub folder: RunFolder,
    /// Whether to resume from the folder's checkpoint.
    pub resume: bool,
    /// Number of threads; 0 is the number of cores.
    pub threads: usize,
    /// Whether the file of the networks also has the agent seeds: reward seeds and initial
    /// parameters.
    pub save_initial: bool,
    /// The processes over which the run is divided.
    pub ranks: Ranks,
}

/// The number of threads that a setting stands for: 0 is the number of cores.
#[must_use]
pub fn thread_count(setting: usize) -> usize {
    match setting {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        threads => threads,
    }
}

/// Factories of a run's recorders. To resume a run, pass the same factories in the same order.
pub type RecorderFactories = Vec<Box<dyn RecorderFactory>>;

/// Receives the progress of a run.
pub trait Observer {
    /// Called before the first round of this process. The progress of a resumed run is not zero.
    fn begun(&mut self, progress: &Progress);

    /// Called after each round; in tabular runs, which have no rounds, after each episode.
    fn round_finished(&mut self, progress: &Progress);

    /// Called with a message that the user should see. No data is lost.
    fn warn(&mut self, _warning: &str) {}
}

/// The progress of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Number of finished episodes: per agent in training, of the whole team in tabular runs.
    pub episodes: usize,
    /// Maximum number of episodes, counted in the same way.
    pub max_episodes: usize,
    /// Mean return over all agents and their latest episodes; 0 before the first episode ends.
    pub recent_return: f64,
    /// Number of environment steps of the whole team.
    pub env_steps: u64,
    /// Number of environment steps of the whole team after which the run ends, if it is set.
    pub max_env_steps: Option<u64>,
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub enum RunOutcome {
    /// The scenario's `stop` was reached.
    Finished(Box<Summary>),
    /// The user interrupted the run, which can be resumed from its checkpoint.
    Interrupted {
        /// Number of finished rounds in the checkpoint; 0 if there may be none.
        rounds: u32,
    },
    /// The run ended; rank 0 knows how.
    Elsewhere,
}

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
    /// An observation, reward or network parameter is not finite.
    #[error(transparent)]
    Diverged(#[from] Diverged),
}

impl Plan {
    /// Reads and checks a scenario and its task.
    ///
    /// # Errors
    /// A mistake in either file, with its location.
    pub fn load(path: &Path, overrides: &[String]) -> Result<Self, InputError> {
        let document = overrides::apply_all(folder::read_scenario(path)?, overrides)?;
        Self::from_document(document, path)
    }

    /// Reads the plan of the run in a folder.
    ///
    /// # Errors
    /// The scenario or its task is damaged or was changed after the run began, or has a mistake.
    pub fn of_run(folder: &RunFolder) -> Result<Self, InputError> {
        Checksums::read(folder)?.verify_scenario()?;
        Self::load(&folder.scenario_file(), &[])
    }

    /// Text of the scenario in the folder of a run, which names the copy of the task in this folder.
    #[must_use]
    pub fn stored_scenario(&self) -> String {
        let task = &self.description.spec().name;
        self.scenario.beside_its_task(&self.name, task).resolved()
    }

    /// Checks the scenario that was read from `path`, and reads its task.
    ///
    /// # Errors
    /// A mistake in either file, with its location.
    pub fn from_document(document: Document<Scenario>, path: &Path) -> Result<Self, InputError> {
        let environment = scenario::environment_path(&document, path)?;
        let (description, environment_text) = input_files::read_task(&environment)?;
        check(&document, &description)?;
        let name = document.value.name.as_str();
        Ok(Self {
            name: if name.is_empty() {
                file_stem(path, "run")
            } else {
                name.to_owned()
            },
            environment_text,
            scenario: document.value,
            description,
        })
    }
}

/// Checks what depends on several fields, or on the scenario and its task together.
fn check(document: &Document<Scenario>, description: &TaskDescription) -> Result<(), InputError> {
    let scenario = &document.value;
    scenario.check().map_err(|error| document.locate(error))?;
    scenario
        .recording
        .check_pairs(description.spec())
        .map_err(|error| document.locate(error))?;
    let task_check = scenario.algorithm.config().check_task(description.spec());
    task_check.map_err(|message| document.locate(scenario.algorithm.error(message)))?;
    seedbed_env::build(description, scenario.physics, 1).map(|_| ())
}

/// Trains until the scenario's `stop` is reached or `interrupted` is set. After an interruption, the
/// checkpoint has the last whole round: that which is being played, if it ends within a second, otherwise
/// that before it. If a number is not finite, it has the round before. `recorder_factories` make
/// the recorders. A resumed run continues with the recorders with which it began; further factories
/// are ignored. If a recorder has no factory, the run goes on without it, and what it
/// recorded is kept in another file.
///
/// If the run is divided over ranks, rank 0 records, and the others only play and learn.
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
        return follow(plan, options, interrupted);
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
    let (trainer, recorders, checkpoints) = options.ranks.agree(begun)?;
    let mut run = ActiveRun {
        plan,
        options,
        recorder: RoundRecorder::new(recorders, trainer.agent_count(), options.threads),
        trainer,
        checkpoints,
        schedule: CheckpointSchedule::of(&plan.scenario),
        durations: RoundDurations::new(),
        has_warned: false,
    };
    observer.begun(&progress(plan, &run.trainer));
    while !run.trainer.is_done() {
        let Some(round) = run.play_round(cancellation, observer)? else {
            let rounds = run.checkpoints.newest_rounds();
            return Ok(RunOutcome::Interrupted { rounds });
        };
        let rounds = run.trainer.rounds();
        let episodes = run.trainer.newest_episodes();
        run.recorder.record(rounds - 1, &episodes, round)?;
        report_warnings(&mut run.recorder, observer);
        observer.round_finished(&progress(plan, &run.trainer));
        if run.checkpoint_if_due(interrupted)? {
            return Ok(RunOutcome::Interrupted { rounds });
        }
    }
    let checkpoint = run.write_checkpoint(CheckpointKind::AtEnd);
    let ending = checkpoint.and_then(|()| finish(plan, options, &run.trainer, &mut run.recorder));
    report_warnings(&mut run.recorder, observer);
    ending
}

/// Plays and learns for the agents of a rank that does not record.
fn follow(
    plan: &Plan,
    options: &Options,
    interrupted: &AtomicBool,
) -> Result<RunOutcome, RunError> {
    let mut trainer = options.ranks.agree(begin_to_follow(plan, options))?;
    while !trainer.is_done() {
        trainer.advance()?;
        any_interrupted(options, interrupted);
        let after = options.ranks.broadcast(AfterRound::default());
        if after.is_saved {
            let _own_part = trainer.save();
        }
        if after.is_interrupted {
            return Ok(RunOutcome::Elsewhere);
        }
    }
    let _own_part = trainer.save();
    let _own_part = gather_tensors(options, &trainer);
    Ok(RunOutcome::Elsewhere)
}

fn begin_to_follow(plan: &Plan, options: &Options) -> Result<Trainer, RunError> {
    let mut trainer = build_trainer(plan, options)?;
    if options.resume {
        let folder = options.folder.path();
        let checkpoint = Checkpoint::read(folder);
        let restored = checkpoint.and_then(|read| read.restore(folder, &mut trainer));
        restored.map_err(RunError::UnusableCheckpoint)?;
    }
    Ok(trainer)
}

/// Whether any rank was asked to stop.
fn any_interrupted(options: &Options, interrupted: &AtomicBool) -> bool {
    let interrupted = options
        .ranks
        .all_gather(interrupted.load(Ordering::Relaxed));
    interrupted.contains(&true)
}

fn build_trainer(plan: &Plan, options: &Options) -> Result<Trainer, InputError> {
    let Options { threads, ranks, .. } = options;
    Trainer::on_ranks(&plan.scenario, &plan.description, *threads, *ranks)
}

/// The trainer, the recorders and the writer of checkpoints of a new run or a run to resume.
fn begin(
    plan: &Plan,
    options: &Options,
    recorder_factories: RecorderFactories,
    observer: &mut dyn Observer,
) -> Result<(Trainer, Recorders, CheckpointWriter), RunError> {
    let mut trainer = build_trainer(plan, options)?;
    let (recorders, checkpoints) = if options.resume {
        resume_run(plan, options, recorder_factories, &mut trainer, observer)?
    } else {
        let recorders = create_recorders(plan, options, recorder_factories, &trainer)?;
        (recorders, CheckpointWriter::new(options.folder.path()))
    };
    Ok((trainer, recorders, checkpoints))
}

fn report_warnings(recorder: &mut RoundRecorder, observer: &mut dyn Observer) {
    for warning in recorder.take_warnings() {
        observer.warn(&warning);
    }
}

fn create_recorders(
    plan: &Plan,
    options: &Options,
    recorder_factories: RecorderFactories,
    trainer: &Trainer,
) -> Result<Recorders, RunError> {
    write_scenario(plan, &options.folder)?;
    with_run_info(plan, trainer, |info| {
        let create =
            |factory: Box<dyn RecorderFactory>| Ok(factory.create(info, &plan.scenario.recording)?);
        recorder_factories.into_iter().map(create).collect()
    })
}

fn resume_run(
    plan: &Plan,
    options: &Options,
    recorder_factories: RecorderFactories,
    trainer: &mut Trainer,
    observer: &mut dyn Observer,
) -> Result<(Recorders, CheckpointWriter), RunError> {
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
        let path = checkpoint::file(folder.path());
        return Err(RunError::UnusableCheckpoint(CheckpointError {
            path,
            reason,
        }));
    }
    check_max_episodes(plan, options, trainer)?;
    write_scenario(plan, folder)?;
    if states.len() > recorder_factories.len() {
        give_up_recording(folder, observer)?;
    }
    let recorders = with_run_info(plan, trainer, |info| {
        let resume = |(factory, state): (Box<dyn RecorderFactory>, &Vec<u8>)| {
            Ok(factory.resume(info, &plan.scenario.recording, state)?)
        };
        recorder_factories
            .into_iter()
            .zip(states)
            .map(resume)
            .collect::<Result<Recorders, RunError>>()
    })?;
    Ok((recorders, checkpoints))
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
    let mut sums = NewChecksums::default();
    for (path, text) in [scenario, (task_file, plan.environment_text.clone())] {
        replace_file(&path, text.as_bytes())?;
        sums.add(folder, &path, text.as_bytes());
    }
    write_checksums(&sums, folder)
}

fn write_checksums(sums: &NewChecksums, folder: &RunFolder) -> Result<(), RunError> {
    sums.write(folder).map_err(|error| RunError::File {
        path: folder.checksums_file(),
        error,
    })
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

/// Checks that the folder contains a run of this plan. `stop` may differ, so that a run can be
/// extended.
fn check_same_run(plan: &Plan, options: &Options) -> Result<(), RunError> {
    let folder = &options.folder;
    let mut stored = folder::read_scenario(&folder.scenario_file())?;
    stored.value.stop = plan.scenario.stop.clone();
    let task = scenario::task_name(&stored.value.environment);
    let task_text = seedbed_input::read_text(&folder.task_file(task))?;
    let stored_text = stored.value.beside_its_task(&plan.name, task).resolved();
    if let Some(difference) = first_difference(
        &scenario_settings(&stored_text),
        &scenario_settings(&plan.stored_scenario()),
    ) {
        return Err(RunError::CannotResume(format!(
            "the run in {} cannot be resumed with this scenario: the run has {}, the scenario has {}",
            folder.path().display(),
            shown(&difference.path, difference.first),
            shown(&difference.path, difference.second)
        )));
    }
    let settings = seedbed_env::task_settings;
    if let Some(difference) =
        first_difference(&settings(&task_text), &settings(&plan.environment_text))
    {
        return Err(RunError::CannotResume(format!(
            "the task `{}` has changed since the run in {} began: it had {}, it has {}",
            plan.description.spec().name,
            folder.path().display(),
            shown(&difference.path, difference.first),
            shown(&difference.path, difference.second)
        )));
    }
    Ok(())
}

/// All values of the text of a scenario with all defaults.
fn scenario_settings(text: &str) -> Settings {
    Settings::of(text).expect("a resolved scenario is RON")
}

fn first_difference(stored: &Settings, planned: &Settings) -> Option<Difference> {
    stored.differences(planned).into_iter().next()
}

/// A setting as it is written in files.
fn shown(path: &str, value: Option<String>) -> String {
    match value {
        Some(value) => format!("`{path}: {value}`"),
        None => format!("no `{path}`"),
    }
}

/// Calls `f` with the information about the run that recordings contain.
fn with_run_info<R>(plan: &Plan, trainer: &Trainer, f: impl FnOnce(&RunInfo<'_>) -> R) -> R {
    let scenario = plan.stored_scenario();
    f(&RunInfo {
        name: &format!("{}-seed-{}", plan.name, plan.scenario.seed),
        focus: Focus::Learning,
        spec: trainer.spec(),
        scene: trainer.scene(),
        agents: trainer.agent_count() as u32,
        bonus: plan.scenario.algorithm.largest_intrinsic_reward().into(),
        max_episodes: plan.scenario.max_episodes(),
        run_seed: plan.scenario.seed,
        scenario: &scenario,
        properties: &[("seedbed_version", env!("CARGO_PKG_VERSION").to_owned())],
    })
}

/// Completes the files of a finished run, whose checkpoint has been written. The summary is written
/// last, because its presence marks a finished run, whose checksums are known.
fn finish(
    plan: &Plan,
    options: &Options,
    trainer: &Trainer,
    recorder: &mut RoundRecorder,
) -> Result<RunOutcome, RunError> {
    recorder.finish()?;
    write_policies(plan, options, trainer)?;
    let summary = Summary::of(&plan.name, plan.scenario.seed, trainer);
    let text = serde_json::to_string_pretty(&summary).map_err(std::io::Error::other);
    let path = options.folder.summary_file();
    let text = text.map_err(|error| RunError::File {
        path: path.clone(),
        error,
    })?;
    let text = format!("{text}\n");
    write_checksums_of_results(&options.folder, &text)?;
    replace_file(&path, text.as_bytes())?;
    Ok(RunOutcome::Finished(Box::new(summary)))
}

/// Writes the checksums of the files of a finished run, whose summary will have this text.
pub(crate) fn write_checksums_of_results(
    folder: &RunFolder,
    summary: &str,
) -> Result<(), RunError> {
    let mut sums = NewChecksums::default();
    sums.add(folder, &folder.summary_file(), summary.as_bytes());
    for path in folder.result_files() {
        sums.add_file(folder, &path)
            .map_err(|error| RunError::File { path, error })?;
    }
    write_checksums(&sums, folder)
}

fn write_policies(plan: &Plan, options: &Options, trainer: &Trainer) -> Result<(), RunError> {
    let path = options.folder.policies_file();
    let tensors = gather_tensors(options, trainer);
    weights::write(&path, &tensors, &weights::metadata(plan, trainer.spec()))
        .map_err(|error| RunError::File { path, error })
}

/// The tensors that are saved at the end of a run.
fn gather_tensors<'a>(options: &Options, trainer: &'a Trainer) -> Vec<Tensor<'a>> {
    let mut tensors = trainer.tensors();
    if options.save_initial {
        tensors.extend(trainer.initial_tensors());
    }
    tensors
}

fn replace_file(path: &Path, bytes: &[u8]) -> Result<(), RunError> {
    files::replace(path, bytes).map_err(|error| RunError::File {
        path: path.to_owned(),
        error,
    })
}

fn progress(plan: &Plan, trainer: &Trainer) -> Progress {
    Progress {
        episodes: trainer.measures().episodes_per_agent(),
        max_episodes: plan.scenario.max_episodes() as usize,
        recent_return: trainer.measures().final_return().unwrap_or(0.0),
        env_steps: trainer.measures().env_steps(),
        max_env_steps: plan.scenario.stop.max_env_steps(),
    }
}
