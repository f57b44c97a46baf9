//! Experiments: what `run`, `bench` and studies run. An [`Experiment`] is the plan of a training or
//! of a tabular run; [`load()`] is the only place that distinguishes them.

pub mod checkpoint;
mod load;
pub mod measure;
pub mod run_result;
mod tabular;
mod training;

use std::fmt::Debug;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

pub use self::load::{LoadError, LoadStep, Loaded, error_at_replay, files_read, load};
pub use self::training::NO_THRESHOLD;
use crate::experiment::checkpoint::RunCheckpoints;
use crate::experiment::measure::Measure;
use crate::experiment::run_result::RunResult;
use crate::run::measures::RoundRows;
use crate::run::ranks::Ranks;
use crate::run::recorder::RecorderFactory;
use crate::run::{Observer, Options, Progress, RunError};
use seedbed_env::TaskSpec;
use seedbed_input::FORMER_NAMES;
use seedbed_learn::agent::bonus::PaidFor;
use seedbed_learn::algorithms::RandomActions;
use seedbed_settings::Settings;

/// Cost of runs that take about a minute on one core, in environment steps of a random agent. The
/// cost of a run is that of all its episodes at full length, so that many runs take less.
pub const COST_PER_MINUTE: f64 = 3e7;

/// Result of a run, or why it failed.
pub type Outcome = Result<RunResult, String>;

/// A scenario that was read and checked, and can be run with any run seed.
pub trait Experiment: Debug + Send + Sync {
    /// Name of the scenario: the stem of its file.
    fn name(&self) -> &str;

    /// Run seed of the scenario.
    fn run_seed(&self) -> u64;

    /// The task: name, observations, actions, time limit.
    fn spec(&self) -> &TaskSpec;

    /// The outlines of bodies that never move, m: `[lines]` of `[points]`; empty if there are none.
    fn walls(&self) -> Vec<Vec<[f32; 2]>> {
        Vec::new()
    }

    /// Everything that defines the task, as text: experiments with equal texts have the same task.
    fn task_definition(&self) -> String;

    /// Number of agents K.
    fn agents(&self) -> u32;

    /// Which random actions the agents take.
    fn random_actions(&self) -> RandomActions {
        RandomActions::default()
    }

    /// What the agents are paid for beside the rewards of the task.
    fn paid_for(&self) -> PaidFor {
        PaidFor::Nothing
    }

    /// Maximum number of episodes per agent.
    fn max_episodes(&self) -> u32;

    /// Everything on which runs depend, except their run seeds: the settings of the scenario and of its task that
    /// differ from their defaults.
    fn settings(&self) -> Settings;

    /// SHA-256 (64 hexadecimal digits) of the [`settings`](Self::settings).
    fn digest(&self) -> String {
        self.settings().digest(&FORMER_NAMES)
    }

    /// Rough estimate of the work of learning per environment step, as a multiple of the work of
    /// acting.
    fn learning_cost(&self) -> f64;

    /// Why runs of this experiment do not have `measure`, and what to use instead; `None` if they
    /// have it.
    fn measure_obstacle(&self, measure: Measure) -> Option<(&'static str, &'static str)>;

    /// Approximate number of bytes of memory that a run needs.
    fn memory(&self) -> u64;

    /// Why these valid settings may not do what they seem to do; empty if nothing is known.
    fn warnings(&self) -> Vec<String> {
        Vec::new()
    }

    /// Why a run cannot be repeated bit for bit; `None` if it can.
    fn repeatability_warning(&self) -> Option<String> {
        None
    }

    /// Whether runs can begin, as far as it depends on other programs.
    ///
    /// # Errors
    /// An environment of Gymnasium cannot be made.
    fn check_start(&self) -> Result<(), RunError> {
        Ok(())
    }

    /// Whether its agents have networks, which are saved at the end of a run.
    fn has_networks(&self) -> bool {
        true
    }

    /// Why runs of this experiment cannot be recorded; `None` if they can.
    fn recording_obstacle(&self) -> Option<String> {
        None
    }

    /// Runs once with this run seed, on one thread and without writing files other than its
    /// checkpoint. For each number n in `windows`, the result has a sample of the states visited in the
    /// first n episodes of each agent. `None` if interrupted.
    ///
    /// # Errors
    /// If the task cannot be built, or if a number is not finite.
    fn measure_once(
        &self,
        run_seed: u64,
        stop_rule: StopRule,
        windows: &[u32],
        control: RunControl<'_>,
    ) -> Result<Option<RunResult>, RunError>;

    /// Number of runs that take the least time if they are measured
    /// [together](Self::measure_together).
    fn runs_together(&self) -> usize {
        1
    }

    /// Measures runs of `queue`, at most `places` at once, until it is empty or they are interrupted.
    /// Each result has the bits of [`measure_once`](Self::measure_once).
    fn measure_together(
        &self,
        places: usize,
        stop_rule: StopRule,
        queue: &mut dyn RunQueue,
        control: RunControl<'_>,
    ) {
        let _ = places;
        measure_one_by_one(self, stop_rule, queue, control);
    }

    /// Runs once with the scenario's run seed, and writes all results into a run directory. If
    /// `recording` is given, the recorder that it makes is used in addition to the tables.
    ///
    /// # Errors
    /// If something cannot be read or written, or if a number is not finite. Files that were
    /// written before remain readable.
    fn run_in_folder(
        &self,
        options: &Options,
        recording: Option<Box<dyn RecorderFactory>>,
        observer: &mut dyn Observer,
        interrupted: &AtomicBool,
    ) -> Result<RunEnding, RunError>;

    /// Why a run of this experiment cannot be divided over these ranks; `None` if it can.
    fn ranks_obstacle(&self, ranks: Ranks) -> Option<String> {
        let _ = ranks;
        Some("it has no networks that learn, and runs in one process".to_owned())
    }

    /// Whether the optimal policy of the task is known, so that runs have regrets.
    fn knows_regret(&self) -> bool {
        false
    }

    /// Rough estimate of the work of a run, in environment steps of a random agent: used to order
    /// runs and to estimate the remaining time.
    fn cost(&self) -> f64 {
        let steps = f64::from(self.max_episodes())
            * f64::from(self.spec().time_limit)
            * f64::from(self.agents());
        steps * (1.0 + self.learning_cost())
    }

    /// What to know before a run whose rounds may take minutes; `None` if they do not.
    fn round_cost_note(&self) -> Option<String> {
        None
    }

    /// Default run directory: `recordings/NAME/seed-N`.
    fn default_folder(&self) -> PathBuf {
        Path::new("recordings")
            .join(self.name())
            .join(format!("seed-{}", self.run_seed()))
    }
}

/// What stops runs, and where they keep their checkpoints.
#[derive(Clone, Copy)]
pub struct RunControl<'a> {
    /// Becomes true when runs are to stop before their end.
    pub interrupted: &'a AtomicBool,
    /// Checkpoints from which runs continue, and which they write; `None` if each run starts from its
    /// beginning and leaves nothing.
    pub checkpoints: Option<&'a RunCheckpoints<'a>>,
    /// Digest of the experiment, by which checkpoints are found.
    pub digest: &'a str,
    /// Called with each round of training runs, from the thread that makes the run.
    pub on_round: Option<OnRound<'a>>,
}

/// What is done with a round of a run.
pub type OnRound<'a> = &'a (dyn Fn(&MeasuredRound<'_>) + Sync);

/// A round of a run that is measured.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredRound<'a> {
    /// Digest of the experiment.
    pub digest: &'a str,
    /// Run seed.
    pub run_seed: u64,
    /// The progress of the run.
    pub progress: &'a Progress,
    /// The rows that the round adds to the tables.
    pub rows: &'a RoundRows,
}

impl<'a> RunControl<'a> {
    /// Runs that have no checkpoints.
    #[must_use]
    pub fn without_checkpoints(interrupted: &'a AtomicBool) -> Self {
        Self {
            interrupted,
            checkpoints: None,
            digest: "",
            on_round: None,
        }
    }

    /// Whether runs are to stop.
    #[must_use]
    pub fn is_interrupted(&self) -> bool {
        self.interrupted.load(Ordering::Relaxed)
    }
}

/// Runs of one experiment that wait to be measured.
pub trait RunQueue {
    /// Takes the next run; `None` if there is none.
    fn next(&mut self) -> Option<RunRequest>;

    /// Receives the result of a run that was taken, or why it failed.
    fn finish(&mut self, request: &RunRequest, outcome: Result<RunResult, String>);
}

/// A run that is to be measured.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunRequest {
    /// Index of the run in its study.
    pub index: usize,
    /// Run seed.
    pub run_seed: u64,
    /// Numbers of first episodes of which visited states are sampled; see
    /// [`Experiment::measure_once`].
    pub windows: Vec<u32>,
}

/// Measures the runs of `queue`, each by itself.
fn measure_one_by_one<E: Experiment + ?Sized>(
    experiment: &E,
    stop_rule: StopRule,
    queue: &mut dyn RunQueue,
    control: RunControl<'_>,
) {
    while let Some(request) = queue.next() {
        let (run_seed, windows) = (request.run_seed, &request.windows);
        match experiment.measure_once(run_seed, stop_rule, windows, control) {
            Ok(None) => return,
            Ok(Some(result)) => queue.finish(&request, Ok(result)),
            Err(error) => queue.finish(&request, Err(error.to_string())),
        }
    }
}

/// When a run of [`Experiment::measure_once`] stops. Tabular runs ignore it: they always play all
/// episodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopRule {
    /// As the stopping rule of the scenario says.
    Scenario,
    /// After the scenario's maximum number of episodes or environment steps, solved or not.
    Maximum,
    /// When the task is solved, or after the scenario's maximum number of episodes or steps.
    Solved,
}

/// How a run in a run directory ended.
#[derive(Clone, Debug, PartialEq)]
pub enum RunEnding {
    /// The run is finished.
    Finished(RunReport),
    /// The run was interrupted.
    Interrupted {
        /// What was finished before the interruption, e.g. `3 rounds`.
        after: String,
        /// Whether it can be resumed from a checkpoint.
        can_resume: bool,
    },
    /// The run ended; rank 0 knows how.
    Elsewhere,
}

/// Results of a finished run, to be printed.
#[derive(Clone, Debug, PartialEq)]
pub struct RunReport {
    /// Number of episodes per agent.
    pub episodes_per_agent: usize,
    /// Number of environment steps of the team.
    pub env_steps: u64,
    /// Results that only this kind of run has, each as a short label and a text.
    pub lines: Vec<(&'static str, String)>,
}
