//! Runs the missing runs of a study, or verifies its stored runs, on several threads. Each free
//! thread takes the longest of the remaining runs, and with it others of the same cell if they are
//! faster together. Before all others, one run of each cell is taken, so that times are known.

use std::any::Any;
use std::collections::{HashSet, VecDeque};
use std::convert::Infallible;
use std::hash::Hash;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use crate::experiment::COST_PER_MINUTE;
use crate::experiment::{Outcome, RunControl, RunQueue, RunRequest};
use crate::study::FileError;
use crate::study::design::cell::PlannedRun;
use crate::study::store::StudyFolder;
use crate::study::store::run_marks::RunMarks;

/// A run that has ended.
#[derive(Clone, Copy, Debug)]
pub struct FinishedRun<'a> {
    /// The run.
    pub run: &'a PlannedRun<'a>,
    /// Why the run failed; `None` if it did not fail.
    pub failure: Option<&'a str>,
    /// Seconds for which a thread worked on it.
    pub seconds: f64,
}

/// Executes `runs` on `jobs` threads, and stores each result when its run has ended. A run that
/// fails is stored with the reason of its failure, and does not stop other runs. If they are
/// interrupted, unfinished runs are stopped, and nothing of them is stored but their checkpoints.
///
/// # Errors
/// If a result cannot be stored. After such an error, no further runs are started.
pub fn run(
    runs: &[PlannedRun<'_>],
    folder: &StudyFolder,
    jobs: usize,
    control: RunControl<'_>,
    on_finished: &(dyn Fn(&FinishedRun<'_>) + Sync),
) -> Result<(), FileError> {
    let runs = runs.iter().map(|run| (run, run.windows().to_vec()));
    let marks = RunMarks::new();
    let on_begun = |run: &PlannedRun<'_>| marks.begin(folder.mark_file(run));
    measure_all(runs, jobs, control, &on_begun, &|run, outcome, seconds| {
        let stored = folder.store(run, outcome)?;
        marks.end(&folder.mark_file(run));
        folder.remove_checkpoint(run);
        on_finished(&FinishedRun {
            run,
            failure: stored.outcome.as_ref().err().map(String::as_str),
            seconds,
        });
        Ok(())
    })
}

/// Results of runs with which repeated runs are compared.
pub trait ExpectedResults: Sync {
    /// Whether the results have this run.
    fn contains(&self, run: &PlannedRun<'_>) -> bool;

    /// Numbers of first episodes whose visited states the results have of a run.
    fn windows(&self, run: &PlannedRun<'_>) -> Vec<u32>;

    /// Whether a repeated run has the values of the results, to the bit.
    fn is_reproduced_by(&self, run: &PlannedRun<'_>, outcome: &Outcome) -> bool;

    /// The file or folder with the result of a run.
    fn location(&self, run: &PlannedRun<'_>) -> PathBuf;
}

impl ExpectedResults for StudyFolder {
    fn contains(&self, run: &PlannedRun<'_>) -> bool {
        self.stored_run(run).is_some()
    }

    fn windows(&self, run: &PlannedRun<'_>) -> Vec<u32> {
        let stored = self.stored_run(run).map(|stored| stored.outcome);
        let states = stored.iter().flatten().flat_map(|result| &result.states);
        states.map(|states| states.episodes).collect()
    }

    fn is_reproduced_by(&self, run: &PlannedRun<'_>, outcome: &Outcome) -> bool {
        let stored = self.stored_run(run);
        stored.is_some_and(|stored| stored.is_reproduced_by(outcome))
    }

    fn location(&self, run: &PlannedRun<'_>) -> PathBuf {
        self.result_file(run.cell.digest(), run.run_seed)
    }
}

/// Repeats runs from their beginning, without storing anything, and calls `on_verified` for each run with
/// whether its result is the `expected` one, and the seconds for which a thread worked on it.
pub fn verify<'a>(
    runs: &'a [PlannedRun<'a>],
    expected: &dyn ExpectedResults,
    jobs: usize,
    interrupted: &AtomicBool,
    on_verified: &(dyn Fn(&'a PlannedRun<'a>, bool, f64) + Sync),
) {
    let runs = runs.iter().map(|run| (run, expected.windows(run)));
    let on_begun = |_: &PlannedRun<'_>| {};
    let on_outcome = |run: &'a PlannedRun<'a>, outcome, seconds| {
        on_verified(run, expected.is_reproduced_by(run, &outcome), seconds);
        Ok(())
    };
    let control = RunControl::without_checkpoints(interrupted);
    let never: Result<(), Infallible> = measure_all(runs, jobs, control, &on_begun, &on_outcome);
    never.unwrap_or_else(|never| match never {});
}

/// Maximum cost of the runs that a thread measures together. A crash loses all of them.
const MAX_COST_TOGETHER: f64 = COST_PER_MINUTE;

/// What is done when a run begins.
type OnBegun<'f> = &'f (dyn Fn(&PlannedRun<'_>) + Sync);

/// What is done with the outcome of a run, for which a thread worked so many seconds.
type OnOutcome<'a, 'f, E> = &'f (dyn Fn(&'a PlannedRun<'a>, Outcome, f64) -> Result<(), E> + Sync);

/// Measures `runs`, each with its windows of episodes, on `jobs` threads, and calls `on_begun` and
/// `on_outcome` for each, until a call fails or they are interrupted. Returns the first error.
fn measure_all<'a, E: Send>(
    runs: impl Iterator<Item = (&'a PlannedRun<'a>, Vec<u32>)>,
    jobs: usize,
    control: RunControl<'_>,
    on_begun: OnBegun<'_>,
    on_outcome: OnOutcome<'a, '_, E>,
) -> Result<(), E> {
    let queue = SharedQueue::new(runs, on_begun);
    let jobs = jobs.clamp(1, queue.length().max(1));
    std::thread::scope(|scope| {
        for _ in 0..jobs {
            scope.spawn(|| queue.work_through(jobs, control, on_outcome));
        }
    });
    let error = queue.first_error.into_inner();
    error
        .unwrap_or_else(PoisonError::into_inner)
        .map_or(Ok(()), Err)
}

/// The runs that no thread has taken yet: one of each cell, then the others, in both parts the longest first.
struct SharedQueue<'a, 'f, E> {
    on_begun: OnBegun<'f>,
    waiting: Mutex<VecDeque<(&'a PlannedRun<'a>, Vec<u32>)>>,
    /// The first error of a call of `on_outcome`, after which no further runs are taken.
    first_error: Mutex<Option<E>>,
}

/// One run of each cell, then the others, in both parts the longest first.
fn in_order<T, C: Eq + Hash>(
    mut runs: Vec<T>,
    cell: impl Fn(&T) -> C,
    cost: impl Fn(&T) -> f64,
) -> VecDeque<T> {
    runs.sort_by(|a, b| cost(b).total_cmp(&cost(a)));
    let mut cells = HashSet::new();
    let (mut first, mut others) = (VecDeque::new(), VecDeque::new());
    for run in runs {
        let part = if cells.insert(cell(&run)) {
            &mut first
        } else {
            &mut others
        };
        part.push_back(run);
    }
    first.append(&mut others);
    first
}

impl<'a, 'f, E: Send> SharedQueue<'a, 'f, E> {
    fn new(
        runs: impl Iterator<Item = (&'a PlannedRun<'a>, Vec<u32>)>,
        on_begun: OnBegun<'f>,
    ) -> Self {
        Self {
            on_begun,
            waiting: Mutex::new(in_order(
                runs.collect(),
                |&(run, _)| run.cell.digest(),
                |(run, _)| run.cell.source.cost(),
            )),
            first_error: Mutex::new(None),
        }
    }

    fn length(&self) -> usize {
        lock(&self.waiting).len()
    }

    /// Takes runs, and measures those of one cell together if that is faster, until none is left.
    fn work_through(&self, jobs: usize, control: RunControl<'_>, on_outcome: OnOutcome<'a, '_, E>) {
        while !control.is_interrupted()
            && let Some(first) = self.take(None)
        {
            // At the end, the other threads get their share.
            let share = (self.length() + 1).div_ceil(jobs);
            let (source, digest) = (&first.0.cell.source, first.0.cell.digest());
            let control = RunControl { digest, ..control };
            let mut queue = CellQueue {
                shared: self,
                on_outcome,
                digest,
                first: Some(first.clone()),
                unfinished: Vec::new(),
                since: Instant::now(),
            };
            let affordable = (MAX_COST_TOGETHER / source.cost()) as usize;
            let places = source.runs_together().min(share).min(affordable.max(1));
            let measure = || source.measure_together(places, &mut queue, control);
            if catch_unwind(AssertUnwindSafe(measure)).is_err() {
                queue.measure_unfinished_alone(control);
            }
        }
    }

    /// Takes the next run, or the next run of the cell with this digest.
    fn take(&self, digest: Option<&str>) -> Option<(&'a PlannedRun<'a>, Vec<u32>)> {
        if lock(&self.first_error).is_some() {
            return None;
        }
        let mut waiting = lock(&self.waiting);
        let is_wanted =
            |run: &PlannedRun<'_>| digest.is_none_or(|digest| run.cell.digest() == digest);
        let index = waiting.iter().position(|(run, _)| is_wanted(run))?;
        waiting.remove(index)
    }
}

/// The runs of one cell that one thread takes.
struct CellQueue<'a, 'q, E> {
    shared: &'q SharedQueue<'a, 'q, E>,
    on_outcome: OnOutcome<'a, 'q, E>,
    digest: &'a str,
    /// The run that was taken already.
    first: Option<(&'a PlannedRun<'a>, Vec<u32>)>,
    unfinished: Vec<(&'a PlannedRun<'a>, RunRequest)>,
    /// When a run finished last, or when the first began.
    since: Instant,
}

impl<E: Send> RunQueue for CellQueue<'_, '_, E> {
    fn next(&mut self) -> Option<RunRequest> {
        let taken = self.first.take();
        let (run, windows) = taken.or_else(|| self.shared.take(Some(self.digest)))?;
        (self.shared.on_begun)(run);
        let request = RunRequest {
            index: run.index,
            run_seed: run.run_seed,
            windows,
        };
        self.unfinished.push((run, request.clone()));
        Some(request)
    }

    fn finish(&mut self, request: &RunRequest, outcome: Outcome) {
        let is_finished = |(run, _): &(&PlannedRun<'_>, RunRequest)| run.index == request.index;
        if let Some(index) = self.unfinished.iter().position(is_finished) {
            let (run, _) = self.unfinished.swap_remove(index);
            self.report(run, outcome);
        }
    }
}

impl<'a, E: Send> CellQueue<'a, '_, E> {
    /// The thread works on runs that it measures together one after the other, as far as times can tell.
    fn report(&mut self, run: &'a PlannedRun<'a>, outcome: Outcome) {
        let seconds = self.since.elapsed().as_secs_f64();
        self.since = Instant::now();
        if let Err(error) = (self.on_outcome)(run, outcome, seconds) {
            lock(&self.shared.first_error).get_or_insert(error);
        }
    }

    /// Measures each run that was begun with others by itself, so that a panic concerns the run that
    /// causes it only.
    fn measure_unfinished_alone(&mut self, control: RunControl<'_>) {
        for (run, request) in std::mem::take(&mut self.unfinished) {
            let measure = || {
                let source = &run.cell.source;
                source.result(run.run_seed, &request.windows, control)
            };
            let outcome = match catch_unwind(AssertUnwindSafe(measure)) {
                Ok(Ok(None)) => return,
                Ok(Ok(Some(result))) => Ok(result),
                Ok(Err(reason)) => Err(reason),
                Err(panic) => Err(format!("panicked: {}", panic_message(&*panic))),
            };
            self.report(run, outcome);
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Message of a panic, which is either a constant or a formatted string.
fn panic_message(panic: &(dyn Any + Send)) -> &str {
    let constant = panic.downcast_ref::<&str>().copied();
    let formatted = panic.downcast_ref::<String>().map(String::as_str);
    constant.or(formatted).unwrap_or("no message")
}

#[cfg(test)]
mod tests {
    use super::in_order;

    #[test]
    fn one_run_of_each_cell_comes_first_and_then_the_longest() {
        let runs = vec![
            ("a", 1.0, 0),
            ("a", 1.0, 1),
            ("b", 3.0, 0),
            ("b", 3.0, 1),
            ("c", 2.0, 0),
        ];
        let ordered = in_order(runs, |run| run.0, |run| run.1);
        let names: Vec<String> = ordered
            .iter()
            .map(|(cell, _, repeat)| format!("{cell}{repeat}"))
            .collect();
        assert_eq!(names, ["b0", "c0", "a0", "b1", "a1"]);
    }
}
