//! Runs: the loop of concurrent episodes, exchange, updates and records (thesis Alg. 3), and what
//! surrounds it.
//!
//! [`execute`] is the loop. [`trainer`] holds all that learns, [`rollout`] plays a round
//! (`asynchronous` one in which nobody waits, `lockstep` one in which shared models learn
//! meanwhile), [`exchange`] shares its episodes, [`measures`] judges it, [`checkpoint`] and
//! [`folder`] keep it, [`review`] reads it back. Formulas of learning may not enter.

mod agreement;
mod asynchronous;
pub mod checkpoint;
pub mod evaluate;
pub mod files;
pub mod folder;
pub mod measures;
pub mod preview;
pub mod replay;
pub mod review;
pub mod rollout;
pub mod summary;
pub mod trainer;
pub mod weights;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use self::checkpoint::{Checkpoint, CheckpointError};
use self::folder::RunFolder;
use self::measures::RoundRows;
use self::summary::{FINAL_WINDOW, Summary};
use self::trainer::{Diverged, Round, Trainer};
use crate::record::rerun::{Focus, LiveTarget, RerunRecorder, RunInfo};
use crate::record::table::TableRecorder;
use crate::record::{RecordError, Recorder, RoundRecord};
use crate::scenario::{self, Scenario};
use seedbed_env::TaskDescription;
use seedbed_env::input::{self, Document, InputError};

/// A scenario with its task, read and checked: what will run.
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

/// How a plan is run; never what comes of it.
#[derive(Clone, Debug)]
pub struct Options {
    /// Where results go.
    pub folder: RunFolder,
    /// Go on from the folder's checkpoint.
    pub resume: bool,
    /// Threads for updates; 0 is one a core.
    pub threads: usize,
    /// Whether to write `run.rrd`. A resumed run goes on as it began.
    pub recording: bool,
}

/// Told how far a run has come.
pub trait Observer {
    /// The first round begins; a resumed run has come some way already.
    fn begun(&mut self, progress: &Progress);

    /// A round is finished.
    fn round_finished(&mut self, progress: &Progress);

    /// Something happened that people should know, though nothing is lost.
    fn warn(&mut self, _warning: &str) {}
}

/// How far a run has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Episodes of each agent.
    pub episodes_per_agent: usize,
    /// Episodes of each agent after which the run ends at the latest.
    pub at_most: usize,
    /// The team's mean return over the last episodes.
    pub recent_return: f64,
    /// Steps of the whole team.
    pub env_steps: u64,
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Ending {
    /// It reached the scenario's end.
    Finished(Box<Summary>),
    /// It was asked to stop, and can be resumed.
    Interrupted {
        /// Rounds finished.
        rounds: u32,
    },
}

/// What keeps a run from going on.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// What the user wrote is wrong.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A recording or table could not be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// A checkpoint could not be written or read.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// Another file of the run could not be written.
    #[error("cannot write {path}: {error}")]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        error: std::io::Error,
    },
    /// The folder holds another run than the one to resume.
    #[error("{0}")]
    AnotherRun(String),
    /// Numbers ceased to be finite.
    #[error(transparent)]
    Diverged(#[from] Diverged),
}

impl Plan {
    /// Reads and checks a scenario and its task.
    ///
    /// # Errors
    /// Whatever is wrong with either, with its place.
    pub fn load(path: &Path, overrides: &[String]) -> Result<Self, InputError> {
        Self::of(scenario::load(path, overrides)?, path)
    }

    /// Checks a scenario that stands at `path`, and reads its task.
    ///
    /// # Errors
    /// Whatever is wrong with either, with its place.
    pub fn of(document: Document<Scenario>, path: &Path) -> Result<Self, InputError> {
        let environment = scenario::environment_path(&document, path)?;
        let (description, environment_text) = seedbed_env::load_with_text(&environment)?;
        check(&document, &description)?;
        Ok(Self {
            name: path
                .file_stem()
                .map_or_else(|| "run".into(), |stem| stem.to_string_lossy().into_owned()),
            environment_text,
            scenario: document.value,
            description,
        })
    }

    /// The default folder of its results.
    #[must_use]
    pub fn default_folder(&self) -> RunFolder {
        RunFolder::new(
            Path::new("recordings")
                .join(&self.name)
                .join(format!("seed-{}", self.scenario.seed)),
        )
    }
}

/// What can only be said of a scenario and its task together, or of several fields.
fn check(document: &Document<Scenario>, description: &TaskDescription) -> Result<(), InputError> {
    let scenario = &document.value;
    scenario.check().map_err(|error| document.locate(error))?;
    scenario
        .recording
        .check_task(description.spec())
        .map_err(|error| document.locate(error))?;
    let fits = scenario.algorithm.config().check_task(description.spec());
    fits.map_err(|message| document.locate(scenario.algorithm.error(message)))?;
    seedbed_env::build(description, scenario.physics, 1).map(|_| ())
}

/// Runs a plan to its end, or until `interrupted` is set. An `audience` is shown the recording
/// while it is made.
///
/// # Errors
/// Something could not be read or written; what was written before stays readable.
pub fn execute(
    plan: &Plan,
    options: &Options,
    audience: Option<LiveTarget>,
    observer: &mut dyn Observer,
    interrupted: &AtomicBool,
) -> Result<Ending, RunError> {
    let mut trainer = Trainer::from_scenario(&plan.scenario, &plan.description, options.threads)?;
    let mut recorders = if options.resume {
        resume(plan, options, audience, &mut trainer)?
    } else {
        begin(plan, options, audience, &trainer)?
    };
    observer.begun(&progress(plan, &trainer));
    while !trainer.is_done() {
        play_round(&mut trainer, &mut recorders)?;
        warn(&mut recorders, observer);
        observer.round_finished(&progress(plan, &trainer));
        let interrupted = interrupted.load(Ordering::Relaxed) && !trainer.is_done();
        if interrupted
            || trainer
                .rounds()
                .is_multiple_of(plan.scenario.checkpoint_every.get())
        {
            write_checkpoint(options, &trainer, &mut recorders)?;
        }
        if interrupted {
            return Ok(Ending::Interrupted {
                rounds: trainer.rounds(),
            });
        }
    }
    let ending = finish(plan, options, &trainer, &mut recorders);
    warn(&mut recorders, observer);
    ending
}

type Recorders = Vec<Box<dyn Recorder>>;

/// Plays a round, learns from it, and records it.
fn play_round(
    trainer: &mut Trainer,
    recorders: &mut [Box<dyn Recorder>],
) -> Result<RoundRows, RunError> {
    let Round {
        rows,
        step_data,
        body_trajectories,
    } = trainer.advance()?;
    let round = RoundRecord {
        round: trainer.rounds() - 1,
        episodes: &trainer.newest_episodes(),
        episode_rows: &rows.episodes,
        round_rows: &rows.updates,
        step_data: &step_data,
        body_trajectories: &body_trajectories,
    };
    recorders
        .iter_mut()
        .try_for_each(|recorder| recorder.record_round(&round))?;
    Ok(rows)
}

fn warn(recorders: &mut Recorders, observer: &mut dyn Observer) {
    recorders
        .iter_mut()
        .filter_map(|recorder| recorder.warning())
        .for_each(|warning| observer.warn(&warning));
}

fn begin(
    plan: &Plan,
    options: &Options,
    audience: Option<LiveTarget>,
    trainer: &Trainer,
) -> Result<Recorders, RunError> {
    let folder = &options.folder;
    write(&folder.scenario(), plan.scenario.resolved().as_bytes())?;
    write(
        &folder.task(&plan.description.spec().name),
        plan.environment_text.as_bytes(),
    )?;
    let mut recorders: Recorders = vec![Box::new(TableRecorder::create(folder.path())?)];
    if options.recording {
        let settings = &plan.scenario.recording;
        let create =
            |about: &RunInfo<'_>| RerunRecorder::create(&folder.recording(), about, settings);
        recorders.push(Box::new(shown(
            with_about(plan, trainer, create)?,
            audience,
        )));
    }
    Ok(recorders)
}

fn shown(mut recorder: RerunRecorder, audience: Option<LiveTarget>) -> RerunRecorder {
    if let Some(audience) = audience {
        recorder.stream_to(audience);
    }
    recorder
}

fn resume(
    plan: &Plan,
    options: &Options,
    audience: Option<LiveTarget>,
    trainer: &mut Trainer,
) -> Result<Recorders, RunError> {
    let folder = &options.folder;
    same_run(plan, options)?;
    let checkpoint = Checkpoint::read(folder.path())?;
    let damaged = |reason| CheckpointError {
        path: checkpoint::file(folder.path()),
        reason,
    };
    trainer.restore(&checkpoint.trainer).map_err(damaged)?;
    let [table, recording @ ..] = checkpoint.recorders.as_slice() else {
        return Err(damaged("holds no tables".to_owned()).into());
    };
    if trainer.measures().episodes_per_agent() > plan.scenario.max_episodes() as usize {
        return Err(RunError::AnotherRun(format!(
            "the run in {} has {} episodes per agent already; it cannot end after {}",
            folder.path().display(),
            trainer.measures().episodes_per_agent(),
            plan.scenario.max_episodes()
        )));
    }
    write(&folder.scenario(), plan.scenario.resolved().as_bytes())?;
    let mut recorders: Recorders = vec![Box::new(TableRecorder::resume(folder.path(), table)?)];
    if let [bytes] = recording {
        let settings = &plan.scenario.recording;
        let resume = |about: &RunInfo<'_>| {
            RerunRecorder::resume(&folder.recording(), about, settings, bytes)
        };
        recorders.push(Box::new(shown(
            with_about(plan, trainer, resume)?,
            audience,
        )));
    }
    Ok(recorders)
}

/// A run may be resumed to a later end, but not as another run.
fn same_run(plan: &Plan, options: &Options) -> Result<(), RunError> {
    let path = options.folder.scenario();
    let mut stored: Document<Scenario> = input::read(&path)?;
    stored.value.stop = plan.scenario.stop.clone();
    let (stored, wanted) = (stored.value.resolved(), plan.scenario.resolved());
    let differs = stored
        .lines()
        .zip(wanted.lines())
        .find(|(stored, wanted)| stored != wanted);
    let task = input::read_text(&options.folder.task(&plan.description.spec().name))?
        != plan.environment_text;
    match differs {
        Some((stored, wanted)) => Err(RunError::AnotherRun(format!(
            "{} holds another run, which cannot be resumed as this one: it has `{}`, this one has `{}`",
            options.folder.path().display(),
            stored.trim().trim_end_matches(','),
            wanted.trim().trim_end_matches(',')
        ))),
        None if task => Err(RunError::AnotherRun(format!(
            "the task `{}` has changed since the run in {} began",
            plan.description.spec().name,
            options.folder.path().display()
        ))),
        None => Ok(()),
    }
}

fn with_about<R>(plan: &Plan, trainer: &Trainer, record: impl FnOnce(&RunInfo<'_>) -> R) -> R {
    let scenario = plan.scenario.resolved();
    record(&RunInfo {
        name: &format!("{}-seed-{}", plan.name, plan.scenario.seed),
        focus: Focus::Learning,
        spec: trainer.spec(),
        scene: trainer.environment().scene(),
        agents: trainer.agent_count() as u32,
        bonus: plan.scenario.algorithm.largest_intrinsic_reward().into(),
        episodes: plan.scenario.max_episodes(),
        run_seed: plan.scenario.seed,
        scenario: &scenario,
        properties: &[("seedbed_version", env!("CARGO_PKG_VERSION").to_owned())],
    })
}

fn write_checkpoint(
    options: &Options,
    trainer: &Trainer,
    recorders: &mut Recorders,
) -> Result<(), RunError> {
    let states: Result<Vec<Vec<u8>>, RecordError> = recorders
        .iter_mut()
        .map(|recorder| recorder.checkpoint())
        .collect();
    Ok(Checkpoint::new(trainer.save(), states?).write(options.folder.path())?)
}

/// Writes what only a finished run has; the summary comes last, because it says that the rest is
/// there.
fn finish(
    plan: &Plan,
    options: &Options,
    trainer: &Trainer,
    recorders: &mut Recorders,
) -> Result<Ending, RunError> {
    write_checkpoint(options, trainer, recorders)?;
    recorders
        .iter_mut()
        .try_for_each(|recorder| recorder.finish())?;
    let policies = options.folder.policies();
    weights::write(&policies, &trainer.tensors()).map_err(|error| RunError::File {
        path: policies,
        error,
    })?;
    let summary = Summary::of(&plan.name, plan.scenario.seed, trainer);
    let text = serde_json::to_string_pretty(&summary).map_err(std::io::Error::other);
    let path = options.folder.summary();
    let text = text.map_err(|error| RunError::File {
        path: path.clone(),
        error,
    })?;
    write(&path, format!("{text}\n").as_bytes())?;
    Ok(Ending::Finished(Box::new(summary)))
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), RunError> {
    files::replace(path, bytes).map_err(|error| RunError::File {
        path: path.to_owned(),
        error,
    })
}

fn progress(plan: &Plan, trainer: &Trainer) -> Progress {
    Progress {
        episodes_per_agent: trainer.measures().episodes_per_agent(),
        at_most: plan.scenario.max_episodes() as usize,
        recent_return: trainer
            .measures()
            .recent_return(FINAL_WINDOW)
            .unwrap_or(0.0),
        env_steps: trainer.measures().env_steps(),
    }
}
