//! `seedbed study`: runs what is missing in a study, and prints the verdicts on its claims.

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use super::progress::StudyProgress;
use super::run::interruption;
use super::{CliError, StudyArgs, pluralize, report};
use crate::study::plan::{PlannedRun, StudyPlan};
use crate::study::runner;
use crate::study::store::{StoredRun, StudyFolder, StudyLock};

pub(super) fn study(args: &StudyArgs) -> Result<(), CliError> {
    let plans: Result<Vec<StudyPlan>, _> = args
        .studies
        .iter()
        .map(|path| StudyPlan::load(path, args.quick))
        .collect();
    let plans = plans?;
    check_folders(&plans)?;
    if plans.len() > 1 && (args.out.is_some() || args.index.is_some()) {
        return Err(CliError::Usage(
            "--out and --index can be used with one study only".to_owned(),
        ));
    }
    let mut failed = 0;
    for plan in &plans {
        let folder = StudyFolder::new(args.out.clone().unwrap_or_else(|| plan.default_folder()));
        failed += match (args.index, args.verify) {
            _ if args.list => list(plan, &folder),
            (Some(index), _) => run_one(args, plan, &folder, index)?,
            (None, Some(max)) => verify(args, plan, &folder, max.into())?,
            (None, None) => run_all(args, plan, &folder)?,
        };
    }
    let what = if args.verify.is_some() {
        "not reproduced"
    } else {
        "failed"
    };
    if failed == 0 {
        Ok(())
    } else {
        Err(CliError::Runtime(format!(
            "{} {what}",
            pluralize(failed, "run")
        )))
    }
}

/// Refuses two studies in one directory: each would take the other's runs for its own.
fn check_folders(plans: &[StudyPlan]) -> Result<(), CliError> {
    let twice = plans
        .iter()
        .enumerate()
        .find(|(number, plan)| plans[..*number].iter().any(|other| other.name == plan.name));
    twice.map_or(Ok(()), |(_, plan)| {
        let folder = plan.default_folder();
        Err(CliError::Usage(format!(
            "two studies are named `{}` and would both write to {}; run them one at a time with --out",
            plan.name,
            folder.display()
        )))
    })
}

/// Refuses a directory that belongs to another study, or to this study with another value of `--quick`.
fn check_same_study(plan: &StudyPlan, folder: &StudyFolder) -> Result<(), CliError> {
    let Ok(manifest) = folder.manifest() else {
        return Ok(());
    };
    if (manifest.name.as_str(), manifest.quick) == (plan.name.as_str(), plan.quick) {
        return Ok(());
    }
    let kind = if manifest.quick {
        "quick study"
    } else {
        "study"
    };
    let path = folder.path().display();
    Err(CliError::Usage(format!(
        "{path} contains the {kind} `{}`; choose another directory with --out",
        manifest.name
    )))
}

/// Prints all runs with their indices and states.
fn list(plan: &StudyPlan, folder: &StudyFolder) -> usize {
    for run in plan.runs() {
        let state = match folder.stored_run(&run).map(|stored| stored.outcome) {
            Some(Ok(_)) => "finished",
            Some(Err(_)) => "failed",
            None => "to run",
        };
        say!(
            "{:>6}  {state:<8}  run seed {:<6}  {}",
            run.index,
            run.seed,
            run.cell.name
        );
    }
    0
}

/// Executes a single run; other processes may work in the same directory.
fn run_one(
    args: &StudyArgs,
    plan: &StudyPlan,
    folder: &StudyFolder,
    index: usize,
) -> Result<usize, CliError> {
    let runs = plan.runs();
    let Some(run) = runs.get(index) else {
        let message = format!(
            "--index {index}: expected an index from 0 to {}; --list shows all",
            runs.len() - 1
        );
        return Err(CliError::Usage(message));
    };
    check_same_study(plan, folder)?;
    let _claim = claim(folder, false)?;
    folder
        .write_manifest(plan)
        .map_err(|error| CliError::Runtime(error.to_string()))?;
    let file = folder.file(&run.cell.digest, run.seed);
    let before = folder
        .stored_run(run)
        .filter(|stored| keeps_result(args, stored));
    if before.is_none() {
        print_failures(&run_missing(args, &[*run], folder, &plan.name)?);
    }
    let Some(stored) = folder.stored_run(run) else {
        return Err(interruption_error(&plan.name));
    };
    let status = if before.is_some() {
        "already stored: "
    } else {
        ""
    };
    say!(
        "{}",
        describe_run(run, &format!("{status}{}", file.display()))
    );
    if let (Some(_), Err(reason)) = (&before, &stored.outcome) {
        print_failures(&[describe_run(run, reason)]);
    }
    Ok(usize::from(stored.outcome.is_err()))
}

fn run_all(args: &StudyArgs, plan: &StudyPlan, folder: &StudyFolder) -> Result<usize, CliError> {
    check_same_study(plan, folder)?;
    let _claim = claim(folder, true)?;
    folder
        .write_manifest(plan)
        .map_err(|error| CliError::Runtime(error.to_string()))?;
    let runs = plan.distinct_runs();
    let is_there = |run: &&PlannedRun<'_>| {
        folder
            .stored_run(run)
            .is_some_and(|stored| keeps_result(args, &stored))
    };
    let missing: Vec<PlannedRun<'_>> = runs.iter().filter(|run| !is_there(run)).copied().collect();
    let (cells, runs) = (
        pluralize(plan.cells.len(), "cell"),
        pluralize(plan.repeats() as usize, "run"),
    );
    say!(
        "study      {}: {cells}, {runs} each, {} to run",
        plan.name,
        missing.len()
    );
    let started = Instant::now();
    let failures = run_missing(args, &missing, folder, &plan.name)?;
    if !missing.is_empty() {
        let (done, threads) = (
            pluralize(missing.len(), "run"),
            pluralize(jobs(args), "thread"),
        );
        say!(
            "finished   {done} in {:.1} s on {threads}",
            started.elapsed().as_secs_f64()
        );
    }
    print_failures(&failures);
    report::write_and_print(folder)
}

/// Repeats some of the stored runs and compares the results.
fn verify(
    args: &StudyArgs,
    plan: &StudyPlan,
    folder: &StudyFolder,
    max: usize,
) -> Result<usize, CliError> {
    check_same_study(plan, folder)?;
    let stored: Vec<PlannedRun<'_>> = plan
        .distinct_runs()
        .into_iter()
        .filter(|run| folder.stored_run(run).is_some())
        .collect();
    if stored.is_empty() {
        return Err(CliError::Usage(format!(
            "{} contains no runs of this study to verify",
            folder.path().display()
        )));
    }
    let chosen = evenly_spaced(&stored, max);
    let stop = interruption("stopping; stored results are unchanged");
    let bar = Mutex::new(StudyProgress::new(&plan.name, &chosen));
    let others = Mutex::new(Vec::new());
    runner::verify(&chosen, folder, jobs(args), &stop, &|run, is_same| {
        bar.lock()
            .expect("no thread fails while it holds the lock")
            .finished(run);
        if !is_same {
            others
                .lock()
                .expect("no thread fails while it holds the lock")
                .push(*run);
        }
    });
    drop(bar);
    if stop.load(Ordering::Relaxed) {
        return Err(CliError::Runtime(
            "interrupted; stored results are unchanged".to_owned(),
        ));
    }
    let others = others
        .into_inner()
        .expect("no thread fails while it holds the lock");
    print_verification(plan, folder, [chosen.len(), stored.len()], &others);
    Ok(others.len())
}

fn print_verification(
    plan: &StudyPlan,
    folder: &StudyFolder,
    [chosen, stored]: [usize; 2],
    others: &[PlannedRun<'_>],
) {
    let same = chosen - others.len();
    say!(
        "verified   {}: {same} of {chosen} repeated runs are bit-identical ({} stored)",
        plan.name,
        pluralize(stored, "run")
    );
    let mut others: Vec<&PlannedRun<'_>> = others.iter().collect();
    others.sort_by_key(|run| run.index);
    for run in &others {
        let file = folder.file(&run.cell.digest, run.seed);
        eprintln!(
            "differs    {}",
            describe_run(run, &file.display().to_string())
        );
    }
    if !others.is_empty() {
        eprintln!(
            "the stored results come from other code or another kind of machine; delete {} to repeat all runs",
            folder.runs_folder().display()
        );
    }
}

/// At most `max` runs, evenly spaced over the study.
fn evenly_spaced<'a>(runs: &[PlannedRun<'a>], max: usize) -> Vec<PlannedRun<'a>> {
    let count = max.min(runs.len());
    (0..count)
        .map(|number| runs[number * runs.len() / count])
        .collect()
}

/// Whether a stored run is kept: with `--retry`, failed runs are repeated.
fn keeps_result(args: &StudyArgs, stored: &StoredRun) -> bool {
    !(args.retry && stored.outcome.is_err())
}

/// Runs `runs`; returns the failures as `cell, run seed N: reason`.
fn run_missing(
    args: &StudyArgs,
    runs: &[PlannedRun<'_>],
    folder: &StudyFolder,
    name: &str,
) -> Result<Vec<String>, CliError> {
    let stop =
        interruption("stopping; finished runs are kept, and the same command resumes the study");
    let bar = Mutex::new(StudyProgress::new(name, runs));
    let failures = Mutex::new(Vec::new());
    let finished_runs = AtomicUsize::new(0);
    let report_finished = |finished: &runner::Finished<'_>| {
        bar.lock()
            .expect("no thread fails while it holds the lock")
            .finished(finished.run);
        if let Some(reason) = finished.failure {
            failures
                .lock()
                .expect("no thread fails while it holds the lock")
                .push(describe_run(finished.run, reason));
        }
        if Some(finished_runs.fetch_add(1, Ordering::Relaxed) + 1) == args.abort_after_runs {
            std::process::abort();
        }
    };
    let result = runner::run(runs, folder, jobs(args), &stop, &report_finished);
    drop(bar);
    result.map_err(|error| CliError::Runtime(format!("cannot write {error}")))?;
    if stop.load(Ordering::Relaxed) {
        return Err(interruption_error(name));
    }
    let mut failures = failures
        .into_inner()
        .expect("no thread fails while it holds the lock");
    failures.sort();
    Ok(failures)
}

fn print_failures(failures: &[String]) {
    const SHOWN: usize = 10;
    for failure in failures.iter().take(SHOWN) {
        eprintln!("failed     {failure}");
    }
    if failures.len() > SHOWN {
        eprintln!("failed     and {} more", failures.len() - SHOWN);
    }
}

/// A run with a message, e.g. `σ 0.1, run seed 1000: message`.
fn describe_run(run: &PlannedRun<'_>, message: &str) -> String {
    format!("{}, run seed {}: {message}", run.cell.name, run.seed)
}

fn interruption_error(name: &str) -> CliError {
    CliError::Runtime(format!("interrupted; repeat the command to resume {name}"))
}

fn claim(folder: &StudyFolder, alone: bool) -> Result<StudyLock, CliError> {
    let path: &Path = folder.path();
    let claimed = folder
        .lock(alone)
        .map_err(|error| CliError::Runtime(format!("cannot write {}: {error}", path.display())))?;
    claimed.ok_or_else(|| {
        CliError::Usage(format!(
            "another process is running a study in {}; wait for it, or choose another directory with --out",
            path.display()
        ))
    })
}

fn jobs(args: &StudyArgs) -> usize {
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    args.jobs.map_or_else(cores, usize::from)
}
