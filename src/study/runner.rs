//! Runs what a study still lacks, or what it has once more, on all cores: whoever is free takes the next run, the longest first.

use std::convert::Infallible;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use super::measured::Measured;
use super::plan::Task;
use super::store::{StoreError, StudyFolder};

/// What is told of a run when it is over.
#[derive(Clone, Copy, Debug)]
pub struct Finished<'a> {
    /// Which.
    pub task: &'a Task<'a>,
    /// Why it failed, if it did.
    pub failure: Option<&'a str>,
}

/// Runs `tasks` on `jobs` threads, each on one, and stores what comes of each as soon as it is over. A run that fails is stored as
/// failed, with its reason, and keeps no other from running. Ends early, without a trace of unfinished runs, if `interrupted`.
///
/// # Errors
/// A result cannot be stored: running on would be in vain.
///
/// # Panics
/// Never: no thread holds the lock when it fails.
pub fn run(
    tasks: &[Task<'_>],
    folder: &StudyFolder,
    jobs: usize,
    interrupted: &AtomicBool,
    told: &(dyn Fn(&Finished<'_>) + Sync),
) -> Result<(), StoreError> {
    each(tasks, jobs, interrupted, &|task| {
        let Some(outcome) = measure(task, task.windows(), interrupted) else {
            return Ok(());
        };
        let stored = folder.store(task, outcome)?;
        told(&Finished {
            task,
            failure: stored.outcome.as_ref().err().map(String::as_str),
        });
        Ok(())
    })
}

/// Runs again what is stored and tells of each task whether the same came of it, to the bit. What is stored stays.
///
/// # Panics
/// Never: no thread holds the lock when it fails.
pub fn verify<'a>(
    tasks: &'a [Task<'a>],
    folder: &StudyFolder,
    jobs: usize,
    interrupted: &AtomicBool,
    told: &(dyn Fn(&'a Task<'a>, bool) + Sync),
) {
    let never: Result<(), Infallible> = each(tasks, jobs, interrupted, &|task| {
        let Some(stored) = folder.stored_task(task) else {
            return Ok(());
        };
        let kept = stored.outcome.iter().flat_map(|run| &run.states);
        let windows: Vec<u32> = kept.map(|states| states.episodes).collect();
        if let Some(outcome) = measure(task, &windows, interrupted) {
            told(task, is_same(&outcome, &stored.outcome));
        }
        Ok(())
    });
    never.unwrap_or_else(|never| match never {});
}

/// Bit by bit, so that what is not a number equals itself.
fn is_same(one: &Result<Measured, String>, other: &Result<Measured, String>) -> bool {
    let bytes = |outcome: &Result<Measured, String>| {
        postcard::to_stdvec(outcome).expect("plain data always serialises")
    };
    bytes(one) == bytes(other)
}

/// Does the work of every task on `jobs` threads, the longest first, until it fails or somebody interrupts.
fn each<'a, E: Send>(
    tasks: &'a [Task<'a>],
    jobs: usize,
    interrupted: &AtomicBool,
    work: &(dyn Fn(&'a Task<'a>) -> Result<(), E> + Sync),
) -> Result<(), E> {
    let mut queue: Vec<&Task<'a>> = tasks.iter().collect();
    queue.sort_by(|a, b| b.cell.course.cost().total_cmp(&a.cell.course.cost()));
    let (next, hopeless) = (AtomicUsize::new(0), AtomicBool::new(false));
    let error: Mutex<Option<E>> = Mutex::new(None);
    let take = || {
        while let Some(task) = queue.get(next.fetch_add(1, Ordering::Relaxed))
            && !interrupted.load(Ordering::Relaxed)
            && !hopeless.load(Ordering::Relaxed)
        {
            if let Err(refused) = work(task) {
                hopeless.store(true, Ordering::Relaxed);
                error
                    .lock()
                    .expect("no thread fails while it holds the lock")
                    .get_or_insert(refused);
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..jobs.clamp(1, queue.len().max(1)) {
            scope.spawn(take);
        }
    });
    error
        .into_inner()
        .expect("no thread fails while it holds the lock")
        .map_or(Ok(()), Err)
}

/// Runs once, whatever happens. `windows`: of which first episodes states are kept. `None` if interrupted.
fn measure(
    task: &Task<'_>,
    windows: &[u32],
    interrupted: &AtomicBool,
) -> Option<Result<Measured, String>> {
    let run = || task.cell.course.run(task.seed, windows, interrupted);
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(None)) => None,
        Ok(Ok(Some(measured))) => Some(Ok(measured)),
        Ok(Err(error)) => Some(Err(error.to_string())),
        Err(panic) => {
            let words = panic.downcast_ref::<&str>().map(|word| (*word).to_owned());
            let words = words.or_else(|| panic.downcast_ref::<String>().cloned());
            Some(Err(format!(
                "broke off: {}",
                words.unwrap_or_else(|| "for an unknown reason".to_owned())
            )))
        }
    }
}
