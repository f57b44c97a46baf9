//! Runs the missing runs of a study, or verifies its stored runs, on several threads. Each free
//! thread takes the longest of the remaining runs.

use std::any::Any;
use std::convert::Infallible;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use super::plan::PlannedRun;
use super::run_result::RunResult;
use super::store::{StoreError, StudyFolder};

/// A run that has ended.
#[derive(Clone, Copy, Debug)]
pub struct FinishedRun<'a> {
    /// The run.
    pub run: &'a PlannedRun<'a>,
    /// Why the run failed; `None` if it did not fail.
    pub failure: Option<&'a str>,
}

/// Executes `runs` on `jobs` threads, one thread per run, and stores each result when its run has
/// ended. A run that fails is stored with the reason of its failure, and does not stop other runs.
/// If `interrupted` is set, unfinished runs are stopped, and nothing of them is stored.
///
/// # Errors
/// If a result cannot be stored. After such an error, no further runs are started.
pub fn run(
    runs: &[PlannedRun<'_>],
    folder: &StudyFolder,
    jobs: usize,
    interrupted: &AtomicBool,
    on_finished: &(dyn Fn(&FinishedRun<'_>) + Sync),
) -> Result<(), StoreError> {
    for_each(runs, jobs, interrupted, &|run| {
        let Some(outcome) = execute(run, run.windows(), interrupted) else {
            return Ok(());
        };
        let stored = folder.store(run, outcome)?;
        on_finished(&FinishedRun {
            run,
            failure: stored.outcome.as_ref().err().map(String::as_str),
        });
        Ok(())
    })
}

/// Repeats stored runs, and calls `on_verified` for each run with whether its result is
/// bit-identical. Stored results are not changed.
pub fn verify<'a>(
    runs: &'a [PlannedRun<'a>],
    folder: &StudyFolder,
    jobs: usize,
    interrupted: &AtomicBool,
    on_verified: &(dyn Fn(&'a PlannedRun<'a>, bool) + Sync),
) {
    let never: Result<(), Infallible> = for_each(runs, jobs, interrupted, &|run| {
        let Some(stored) = folder.stored_run(run) else {
            return Ok(());
        };
        let stored_states = stored.outcome.iter().flat_map(|run| &run.states);
        let windows: Vec<u32> = stored_states.map(|states| states.episodes).collect();
        if let Some(outcome) = execute(run, &windows, interrupted) {
            on_verified(run, stored.is_reproduced_by(&outcome));
        }
        Ok(())
    });
    never.unwrap_or_else(|never| match never {});
}

/// Calls `work` for each run on `jobs` threads, the longest run first, until a call fails
/// or `interrupted` is set. Returns the first error.
fn for_each<'a, E: Send>(
    runs: &'a [PlannedRun<'a>],
    jobs: usize,
    interrupted: &AtomicBool,
    work: &(dyn Fn(&'a PlannedRun<'a>) -> Result<(), E> + Sync),
) -> Result<(), E> {
    let mut queue: Vec<&PlannedRun<'a>> = runs.iter().collect();
    queue.sort_by(|a, b| {
        let (a, b) = (a.cell.source.cost(), b.cell.source.cost());
        b.total_cmp(&a)
    });
    let (next_index, failed) = (AtomicUsize::new(0), AtomicBool::new(false));
    let first_error: Mutex<Option<E>> = Mutex::new(None);
    let work_through_queue = || {
        while let Some(run) = queue.get(next_index.fetch_add(1, Ordering::Relaxed))
            && !interrupted.load(Ordering::Relaxed)
            && !failed.load(Ordering::Relaxed)
        {
            if let Err(error) = work(run) {
                failed.store(true, Ordering::Relaxed);
                let mut first_error = first_error.lock().unwrap_or_else(PoisonError::into_inner);
                first_error.get_or_insert(error);
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..jobs.clamp(1, queue.len().max(1)) {
            scope.spawn(work_through_queue);
        }
    });
    let first_error = first_error
        .into_inner()
        .unwrap_or_else(PoisonError::into_inner);
    first_error.map_or(Ok(()), Err)
}

/// Executes a run. An error or a panic becomes the reason of its failure. `windows` are those of
/// [`result`](super::run_source::RunSource::result). `None` if interrupted.
fn execute(
    run: &PlannedRun<'_>,
    windows: &[u32],
    interrupted: &AtomicBool,
) -> Option<Result<RunResult, String>> {
    let execute = || run.cell.source.result(run.run_seed, windows, interrupted);
    match catch_unwind(AssertUnwindSafe(execute)) {
        Ok(Ok(None)) => None,
        Ok(Ok(Some(result))) => Some(Ok(result)),
        Ok(Err(reason)) => Some(Err(reason)),
        Err(panic) => Some(Err(format!("panicked: {}", panic_message(&*panic)))),
    }
}

/// Message of a panic, which is either a constant or a formatted string.
fn panic_message(panic: &(dyn Any + Send)) -> &str {
    let constant = panic.downcast_ref::<&str>().copied();
    let formatted = panic.downcast_ref::<String>().map(String::as_str);
    constant.or(formatted).unwrap_or("no message")
}
