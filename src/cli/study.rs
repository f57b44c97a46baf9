//! `seedbed study`: runs what a study lacks, and says what came of its claims.

use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;

use super::progress::StudyBar;
use super::run::interruption;
use super::{Failure, StudyArgs, counted, report};
use crate::study::plan::{StudyPlan, Task};
use crate::study::runner;
use crate::study::store::{StoredRun, StudyClaim, StudyFolder};

pub(super) fn study(args: &StudyArgs) -> Result<(), Failure> {
    let plans: Result<Vec<StudyPlan>, _> = args
        .studies
        .iter()
        .map(|path| StudyPlan::load(path, args.quick))
        .collect();
    let plans = plans?;
    check_folders(&plans)?;
    if plans.len() > 1 && (args.out.is_some() || args.index.is_some()) {
        return Err(Failure::Input(
            "--out and --index take one study at a time".to_owned(),
        ));
    }
    let mut failed = 0;
    for plan in &plans {
        let folder = StudyFolder::new(args.out.clone().unwrap_or_else(|| plan.default_folder()));
        failed += match (args.index, args.verify) {
            _ if args.list => list(plan, &folder),
            (Some(index), _) => run_one(args, plan, &folder, index)?,
            (None, Some(most)) => verify(args, plan, &folder, most.into())?,
            (None, None) => run_all(args, plan, &folder)?,
        };
    }
    let what = if args.verify.is_some() {
        "came out differently"
    } else {
        "failed"
    };
    if failed == 0 {
        Ok(())
    } else {
        Err(Failure::Work(format!("{} {what}", counted(failed, "run"))))
    }
}

/// Two studies in one folder would take each other for their own past.
fn check_folders(plans: &[StudyPlan]) -> Result<(), Failure> {
    let twice = plans
        .iter()
        .enumerate()
        .find(|(number, plan)| plans[..*number].iter().any(|other| other.name == plan.name));
    twice.map_or(Ok(()), |(_, plan)| {
        let folder = plan.default_folder();
        Err(Failure::Input(format!(
            "two studies are named `{}`, and both go to {}; run one with --out",
            plan.name,
            folder.display()
        )))
    })
}

/// A folder belongs to one study, run in full or quickly.
fn check_owner(plan: &StudyPlan, folder: &StudyFolder) -> Result<(), Failure> {
    let Ok(noted) = folder.manifest() else {
        return Ok(());
    };
    if (noted.name.as_str(), noted.quick) == (plan.name.as_str(), plan.quick) {
        return Ok(());
    }
    let kind = if noted.quick { "quick study" } else { "study" };
    let path = folder.path().display();
    Err(Failure::Input(format!(
        "{path} holds the {kind} `{}`; choose another folder with --out",
        noted.name
    )))
}

/// The runs with their indices, and which of them are there.
fn list(plan: &StudyPlan, folder: &StudyFolder) -> usize {
    for task in plan.tasks() {
        let state = match folder.stored_task(&task).map(|stored| stored.outcome) {
            Some(Ok(_)) => "finished",
            Some(Err(_)) => "failed",
            None => "to run",
        };
        say!(
            "{:>6}  {state:<8}  seed {:<6}  {}",
            task.index,
            task.seed,
            task.cell.name
        );
    }
    0
}

/// Runs a single one, whatever other processes do in the same folder.
fn run_one(
    args: &StudyArgs,
    plan: &StudyPlan,
    folder: &StudyFolder,
    index: usize,
) -> Result<usize, Failure> {
    let tasks = plan.tasks();
    let Some(task) = tasks.get(index) else {
        let message = format!(
            "--index {index}: expected an index from 0 to {}, as `--list` shows them",
            tasks.len() - 1
        );
        return Err(Failure::Input(message));
    };
    check_owner(plan, folder)?;
    let _claim = claim(folder, false)?;
    folder
        .note(plan)
        .map_err(|error| Failure::Work(error.to_string()))?;
    let file = folder.file(&task.cell.digest, task.seed);
    let before = folder
        .stored_task(task)
        .filter(|stored| is_wanted(args, stored));
    if before.is_none() {
        say_failures(&run_missing(&[*task], folder, 1, &plan.name)?);
    }
    let Some(stored) = folder.stored_task(task) else {
        return Err(interrupted(&plan.name));
    };
    let is_new = if before.is_some() {
        "was there already: "
    } else {
        ""
    };
    say!(
        "{}",
        described(task, &format!("{is_new}{}", file.display()))
    );
    if let (Some(_), Err(reason)) = (&before, &stored.outcome) {
        say_failures(&[described(task, reason)]);
    }
    Ok(usize::from(stored.outcome.is_err()))
}

fn run_all(args: &StudyArgs, plan: &StudyPlan, folder: &StudyFolder) -> Result<usize, Failure> {
    check_owner(plan, folder)?;
    let _claim = claim(folder, true)?;
    folder
        .note(plan)
        .map_err(|error| Failure::Work(error.to_string()))?;
    let tasks = plan.distinct_tasks();
    let is_there = |task: &&Task<'_>| {
        folder
            .stored_task(task)
            .is_some_and(|stored| is_wanted(args, &stored))
    };
    let missing: Vec<Task<'_>> = tasks
        .iter()
        .filter(|task| !is_there(task))
        .copied()
        .collect();
    let (cells, runs) = (
        counted(plan.cells.len(), "cell"),
        counted(plan.repeats() as usize, "run"),
    );
    say!(
        "study      {}: {cells} of {runs}, {} to run",
        plan.name,
        missing.len()
    );
    let (jobs, started) = (jobs(args), Instant::now());
    let failures = run_missing(&missing, folder, jobs, &plan.name)?;
    if !missing.is_empty() {
        let (done, threads) = (counted(missing.len(), "run"), counted(jobs, "thread"));
        say!(
            "finished   {done} in {:.1} s on {threads}",
            started.elapsed().as_secs_f64()
        );
    }
    say_failures(&failures);
    report::write_and_tell(folder)
}

/// Runs some of what is there once more: does it still come out the same?
fn verify(
    args: &StudyArgs,
    plan: &StudyPlan,
    folder: &StudyFolder,
    most: usize,
) -> Result<usize, Failure> {
    check_owner(plan, folder)?;
    let stored: Vec<Task<'_>> = plan
        .distinct_tasks()
        .into_iter()
        .filter(|task| folder.stored_task(task).is_some())
        .collect();
    if stored.is_empty() {
        return Err(Failure::Input(format!(
            "{} holds no runs of this study to verify",
            folder.path().display()
        )));
    }
    let chosen = spread(&stored, most);
    let stop = interruption("stopping; nothing was changed");
    let bar = Mutex::new(StudyBar::new(&plan.name, &chosen));
    let others = Mutex::new(Vec::new());
    runner::verify(&chosen, folder, jobs(args), &stop, &|task, is_same| {
        bar.lock()
            .expect("no thread fails while it holds the lock")
            .finished(task);
        if !is_same {
            others
                .lock()
                .expect("no thread fails while it holds the lock")
                .push(*task);
        }
    });
    drop(bar);
    if stop.load(std::sync::atomic::Ordering::Relaxed) {
        return Err(Failure::Work("interrupted; nothing was changed".to_owned()));
    }
    let others = others
        .into_inner()
        .expect("no thread fails while it holds the lock");
    tell_verified(plan, folder, [chosen.len(), stored.len()], &others);
    Ok(others.len())
}

fn tell_verified(
    plan: &StudyPlan,
    folder: &StudyFolder,
    [chosen, stored]: [usize; 2],
    others: &[Task<'_>],
) {
    let same = chosen - others.len();
    say!(
        "verified   {}: {same} of {chosen} came out the same to the bit; {} stored",
        plan.name,
        counted(stored, "run")
    );
    let mut others: Vec<&Task<'_>> = others.iter().collect();
    others.sort_by_key(|task| task.index);
    for task in &others {
        let file = folder.file(&task.cell.digest, task.seed);
        eprintln!(
            "differs    {}",
            described(task, &file.display().to_string())
        );
    }
    if !others.is_empty() {
        eprintln!(
            "they were made by other code or on another kind of machine; without {} all runs start anew",
            folder.runs().display()
        );
    }
}

/// At most so many, from all over the study.
fn spread<'a>(tasks: &[Task<'a>], most: usize) -> Vec<Task<'a>> {
    let count = most.min(tasks.len());
    (0..count)
        .map(|number| tasks[number * tasks.len() / count])
        .collect()
}

/// Whether a run that is there may stay.
fn is_wanted(args: &StudyArgs, stored: &StoredRun) -> bool {
    !(args.retry && stored.outcome.is_err())
}

/// What failed, as `cell with seed N: reason`.
fn run_missing(
    tasks: &[Task<'_>],
    folder: &StudyFolder,
    jobs: usize,
    name: &str,
) -> Result<Vec<String>, Failure> {
    let stop =
        interruption("stopping; what is finished is kept, and the same command goes on from there");
    let bar = Mutex::new(StudyBar::new(name, tasks));
    let failures = Mutex::new(Vec::new());
    let told = |finished: &runner::Finished<'_>| {
        bar.lock()
            .expect("no thread fails while it holds the lock")
            .finished(finished.task);
        if let Some(reason) = finished.failure {
            failures
                .lock()
                .expect("no thread fails while it holds the lock")
                .push(described(finished.task, reason));
        }
    };
    let result = runner::run(tasks, folder, jobs, &stop, &told);
    drop(bar);
    result.map_err(|error| Failure::Work(format!("cannot write {error}")))?;
    if stop.load(std::sync::atomic::Ordering::Relaxed) {
        return Err(interrupted(name));
    }
    let mut failures = failures
        .into_inner()
        .expect("no thread fails while it holds the lock");
    failures.sort();
    Ok(failures)
}

fn say_failures(failures: &[String]) {
    const SHOWN: usize = 10;
    for failure in failures.iter().take(SHOWN) {
        eprintln!("failed     {failure}");
    }
    if failures.len() > SHOWN {
        eprintln!("failed     and {} more", failures.len() - SHOWN);
    }
}

/// What there is to say of a run.
fn described(task: &Task<'_>, words: &str) -> String {
    format!("{} with seed {}: {words}", task.cell.name, task.seed)
}

fn interrupted(name: &str) -> Failure {
    Failure::Work(format!(
        "interrupted; the same command goes on with what {name} still lacks"
    ))
}

fn claim(folder: &StudyFolder, alone: bool) -> Result<StudyClaim, Failure> {
    let path: &Path = folder.path();
    let claimed = folder
        .claim(alone)
        .map_err(|error| Failure::Work(format!("cannot write {}: {error}", path.display())))?;
    claimed.ok_or_else(|| {
        Failure::Input(format!(
            "another process is running a study in {}",
            path.display()
        ))
    })
}

fn jobs(args: &StudyArgs) -> usize {
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    args.jobs.map_or_else(cores, usize::from)
}
