//! Execution of planned runs: the options that `seedbed study` and `tune` share, progress, checkpoints,
//! interruption, and messages about runs.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, Once};
use std::time::{Duration, Instant};

use clap::Args;

use super::interruption::StopRequests;
use super::progress::StudyProgress;
use super::study_curves::StudyCurves;
use super::{CliError, pluralize, project_log, warning_without_locks};
use seedbed::experiment::checkpoint::{CheckpointEvent, RunCheckpoints};
use seedbed::experiment::{MeasuredRound, OnRound, RunControl};
use seedbed::run::thread_count;
use seedbed::run_log::RunLog;
use seedbed::storage::file_lock::FileLock;
use seedbed::study::design::cell::PlannedRun;
use seedbed::study::design::plan::StudyPlan;
use seedbed::study::execute::runner;
use seedbed::study::store::{StoredRun, StudyFolder};

/// Options of commands that execute runs in the directory of a study.
#[derive(Debug, Args)]
pub(super) struct ExecutionArgs {
    /// Number of threads; each makes short runs of one cell together, up to eight at once [default: number of cores; in
    /// the tasks of job scripts 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(super) jobs: Option<u16>,
    /// Repeat runs that failed before
    #[arg(long)]
    pub(super) retry: bool,
    /// Start even if the runs seem to need more memory than there is
    #[arg(long)]
    pub(super) ignore_memory: bool,
    /// Write returns and metrics of each run as event files of TensorBoard to DIR/<cell>/seed-<N>, while it
    /// trains
    #[arg(long, value_name = "DIR")]
    pub(super) tensorboard: Option<PathBuf>,
    /// Abort the process when N runs are finished, as a crash would: for tests
    #[arg(long, value_name = "N", hide = true)]
    pub(super) abort_after_runs: Option<usize>,
    /// Write checkpoints of runs as often as this minimum time in milliseconds allows, and at every
    /// interruption: for tests
    #[arg(long, value_name = "MS", hide = true)]
    pub(super) checkpoint_distance: Option<u64>,
}

/// Why locking cannot fail.
pub(super) const LOCK_IS_INTACT: &str = "no thread panics while it holds the lock";

pub(super) fn print_finished(runs: usize, threads: usize, started: Instant) {
    say!(
        "finished   {} in {:.1} s on {}",
        pluralize(runs, "run"),
        started.elapsed().as_secs_f64(),
        pluralize(threads, "thread")
    );
}

pub(super) fn warn_of_damaged_files(to_run: &[PlannedRun<'_>], folder: &StudyFolder) {
    for path in to_run.iter().filter_map(|run| damaged_file(run, folder)) {
        note!("warning: {}: its run is repeated", damage_message(&path));
    }
}

/// Path of the result file of a run, if it is damaged, was edited or has another layout.
pub(super) fn damaged_file(run: &PlannedRun<'_>, folder: &StudyFolder) -> Option<PathBuf> {
    folder.damaged_file(run.cell.digest(), run.run_seed)
}

pub(super) fn damage_message(path: &Path) -> String {
    format!(
        "{} is damaged, was changed, or is of another version of seedbed",
        path.display()
    )
}

/// Whether the result of a stored run is kept. With `--retry`, runs that failed are repeated
/// instead.
pub(super) fn keeps_result(args: &ExecutionArgs, stored: &StoredRun) -> bool {
    !(args.retry && stored.outcome.is_err())
}

/// Executes runs and stores their results. Returns the failures as `cell, run seed N: reason`.
pub(super) fn execute_runs(
    args: &ExecutionArgs,
    runs: &[PlannedRun<'_>],
    folder: &StudyFolder,
    study: &StudyPlan,
) -> Result<Vec<String>, CliError> {
    let stop_requests = StopRequests::listen(
        "stopping; finished runs are kept, and the same command resumes the study",
    );
    let stop = stop_requests.flag();
    let progress = Mutex::new(StudyProgress::new(&study.name, runs, jobs(args)));
    let failures = Mutex::new(Vec::new());
    let finished_runs = AtomicUsize::new(0);
    let curves = args
        .tensorboard
        .as_ref()
        .map(|folder| StudyCurves::new(folder, runs));
    let log = RunLog::of_file(&study.path);
    let warning_of_log = Once::new();
    let report_finished = |finished: &runner::FinishedRun<'_>| {
        if let Some(curves) = &curves {
            curves.end(finished.run);
        }
        progress
            .lock()
            .expect(LOCK_IS_INTACT)
            .run_finished(finished.run, finished.seconds);
        if let Some(reason) = finished.failure {
            failures
                .lock()
                .expect(LOCK_IS_INTACT)
                .push(describe_run(finished.run, reason));
        }
        if finished.run.name.is_none() {
            let added = log.add_run(&project_log::run_of_study(finished.run));
            if added.is_err() {
                warning_of_log.call_once(|| project_log::warn_if_failed(added));
            }
        }
        if Some(finished_runs.fetch_add(1, Ordering::Relaxed) + 1) == args.abort_after_runs {
            std::process::abort();
        }
    };
    let notify = |event: &CheckpointEvent<'_>| {
        let label = if event.is_warning() {
            "warning: "
        } else {
            "resumed    "
        };
        let progress = progress.lock().expect(LOCK_IS_INTACT);
        progress.print(&format!("{label}{event}"));
    };
    let runs_folder = folder.runs_folder();
    let mut checkpoints = RunCheckpoints::new(&runs_folder, &notify);
    if let Some(distance) = args.checkpoint_distance {
        checkpoints = checkpoints.with_min_distance(Duration::from_millis(distance));
    }
    let add_round = curves
        .as_ref()
        .map(|curves| |round: &MeasuredRound<'_>| curves.add(round));
    let control = RunControl {
        interrupted: stop,
        checkpoints: Some(&checkpoints),
        digest: "",
        on_round: add_round.as_ref().map(|add| add as OnRound<'_>),
    };
    let result = runner::run(runs, folder, jobs(args), control, &report_finished);
    drop(progress);
    result.map_err(|error| CliError::Runtime(format!("cannot write {error}")))?;
    if stop.load(Ordering::Relaxed) {
        return Err(interruption_error(&study.name));
    }
    let mut failures = failures.into_inner().expect(LOCK_IS_INTACT);
    failures.sort();
    Ok(failures)
}

pub(super) fn print_failures(failures: &[String]) {
    const MAX_PRINTED: usize = 10;
    for failure in failures.iter().take(MAX_PRINTED) {
        note!("failed     {failure}");
    }
    if failures.len() > MAX_PRINTED {
        note!("failed     and {} more", failures.len() - MAX_PRINTED);
    }
}

/// A run with a message, e.g. `σ 0.1, run seed 1000: message`.
pub(super) fn describe_run(run: &PlannedRun<'_>, message: &str) -> String {
    format!("{}, {}: {message}", run.cell.name, run.label())
}

pub(super) fn interruption_error(study_name: &str) -> CliError {
    CliError::Interrupted(format!(
        "interrupted; repeat the command to resume {study_name}"
    ))
}

/// Locks the directory of a study for this process alone if `is_exclusive`, otherwise together with
/// other processes that each execute some of its runs.
pub(super) fn lock_folder(folder: &StudyFolder, is_exclusive: bool) -> Result<FileLock, CliError> {
    let path: &Path = folder.path();
    let lock = folder
        .lock(is_exclusive)
        .map_err(|error| CliError::Runtime(format!("cannot write {}: {error}", path.display())))?;
    let lock = lock.ok_or_else(|| {
        CliError::Usage(format!(
            "another process is running a study in {}; wait for it, or choose another directory with --out",
            path.display()
        ))
    })?;
    if is_exclusive && !lock.is_effective() {
        note!("{}", warning_without_locks(path));
    }
    Ok(lock)
}

/// Number of simultaneous runs.
pub(super) fn jobs(args: &ExecutionArgs) -> usize {
    thread_count(args.jobs.map_or(0, usize::from))
}
