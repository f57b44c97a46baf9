//! `seedbed study verify`: repeats stored or published runs that are drawn at random, and compares their
//! bits.

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use super::arguments::{Amount, VerifyArgs};
use super::error_of;
use super::plans::{Selection, check_same_study};
use crate::cli::execution::{LOCK_IS_INTACT, damage_message, damaged_file, describe_run, jobs};
use crate::cli::interruption::StopRequests;
use crate::cli::progress::StudyProgress;
use crate::cli::{CliError, pluralize, report};
use seedbed::experiment::Outcome;
use seedbed::study::design::cell::PlannedRun;
use seedbed::study::design::plan::StudyPlan;
use seedbed::study::evaluate::agreement;
use seedbed::study::evaluate::completeness;
use seedbed::study::evaluate::published::{self, PublishedRuns};
use seedbed::study::evaluate::results::Results;
use seedbed::study::execute::draw::Draw;
use seedbed::study::execute::runner;
use seedbed::study::store::StudyFolder;

/// Repeats some of the runs of each study.
pub(super) fn verify_all(args: &VerifyArgs) -> Result<(), CliError> {
    let selection = Selection::of_results(&args.studies, &args.results);
    let mut differing = 0;
    for (plan, folder) in selection.load()? {
        differing += verify(args, &plan, &folder, args.runs)?;
    }
    error_of(differing, "not reproduced")
}

/// Repeats some of the stored runs and compares the results; if there are none in `folder`, some of
/// those that are published beside the study. Returns the number of runs whose result differs, is
/// missing or cannot be compared.
///
/// # Errors
/// If the results are not those of the study or of its lock, or cannot be read.
fn verify(
    args: &VerifyArgs,
    plan: &StudyPlan,
    folder: &StudyFolder,
    amount: Amount,
) -> Result<usize, CliError> {
    let folder = &match args.results.place.out {
        Some(_) => folder.clone(),
        None => published::stored_or_beside(&plan.path, folder.clone()),
    };
    check_same_study(plan, folder)?;
    let results = read_results(plan, folder)?;
    let not_comparable =
        print_missing(&results) + print_without_source(plan, &results) + print_not_repeatable(plan);
    let differing = if published::is_published(folder) {
        verify_published(args, plan, folder, results, amount)
    } else {
        verify_stored(args, plan, folder, amount)
    };
    Ok(differing? + not_comparable)
}

/// The results of a study.
///
/// # Errors
/// If there are none, if one is damaged, or if they are described otherwise than the study and its lock
/// say.
fn read_results(plan: &StudyPlan, folder: &StudyFolder) -> Result<Results, CliError> {
    if !folder.has_manifest() {
        return Err(no_runs(folder));
    }
    let runs = plan.distinct_runs();
    if let Some(path) = runs.iter().find_map(|run| damaged_file(run, folder)) {
        return Err(CliError::Usage(damage_message(&path)));
    }
    let results = report::read(folder)?;
    let differences = agreement::differences(plan, &results);
    if differences.is_empty() {
        return Ok(results);
    }
    Err(CliError::Runtime(format!(
        "{}: these are not the results of {}: {}",
        folder.path().join("study.json").display(),
        plan.path.display(),
        differences.join("; ")
    )))
}

fn no_runs(folder: &StudyFolder) -> CliError {
    CliError::Usage(format!(
        "{} contains no runs of this study to verify",
        folder.path().display()
    ))
}

/// Prints how many runs are missing: without them, others are not verified. Returns their number.
fn print_missing(results: &Results) -> usize {
    let [_, _, missing] = results.run_counts();
    if missing > 0 {
        note!("missing    {}", completeness::missing_sentence(results));
    }
    missing
}

/// Prints which runs cannot be made again. Returns their number.
fn print_without_source(plan: &StudyPlan, results: &Results) -> usize {
    let mut total = 0;
    for (cell, runs) in agreement::runs_without_source(plan, results) {
        note!(
            "missing    the files of {} of cell `{cell}`, with which its results would be compared",
            pluralize(runs, "run")
        );
        total += runs;
    }
    total
}

/// Prints of which cells runs cannot be repeated bit for bit, so that they are not compared. Returns the number of
/// these runs.
fn print_not_repeatable(plan: &StudyPlan) -> usize {
    for cell in &plan.cells {
        if let Some(warning) = cell.source.repeatability_warning() {
            note!("unverified cell `{}`: {warning}", cell.name);
        }
    }
    let runs = plan.distinct_runs();
    runs.iter().filter(|run| !is_repeatable(run)).count()
}

fn is_repeatable(run: &PlannedRun<'_>) -> bool {
    run.cell.source.repeatability_warning().is_none()
}

fn verify_stored(
    args: &VerifyArgs,
    plan: &StudyPlan,
    folder: &StudyFolder,
    amount: Amount,
) -> Result<usize, CliError> {
    let is_stored = |run: &PlannedRun<'_>| folder.stored_run(run).is_some();
    let chosen = choose(args, plan.distinct_runs(), is_stored, amount, folder)?;
    let differing = repeat(plan, &chosen.runs, &|runs, stop, on_verified| {
        runner::verify(runs, folder, jobs(&args.execution), stop, on_verified);
    })?;
    chosen.print(plan, "stored", &differing, |run| {
        folder.result_file(&run.cell.digest, run.run_seed)
    });
    if !differing.is_empty() {
        note!(
            "the stored results come from other code or another kind of machine; delete {} to repeat all runs",
            folder.runs_folder().display()
        );
    }
    Ok(differing.len())
}

fn verify_published(
    args: &VerifyArgs,
    plan: &StudyPlan,
    folder: &StudyFolder,
    results: Results,
    amount: Amount,
) -> Result<usize, CliError> {
    let published = PublishedRuns::read(folder, results, plan);
    let published = published.map_err(|error| CliError::Usage(error.to_string()))?;
    let is_published = |run: &PlannedRun<'_>| published.contains(run);
    let chosen = choose(args, plan.distinct_runs(), is_published, amount, folder)?;
    let differing = repeat(plan, &chosen.runs, &|runs, stop, on_verified| {
        let is_reproduced =
            |run: &PlannedRun<'_>, outcome: &Outcome| published.is_reproduced_by(run, outcome);
        let jobs = jobs(&args.execution);
        runner::verify_published(runs, &is_reproduced, jobs, stop, on_verified);
    })?;
    chosen.print(plan, "published", &differing, |_| folder.path().to_owned());
    Ok(differing.len())
}

/// The runs that are repeated, of all that are there.
struct Chosen<'a> {
    runs: Vec<PlannedRun<'a>>,
    total: usize,
}

/// The choice that `--draw` repeats, or a new one.
pub(super) fn draw(number: Option<u64>) -> Result<Draw, CliError> {
    let fresh = || {
        Draw::fresh().map_err(|error| {
            CliError::Runtime(format!(
                "no random numbers from the operating system: {error}; choose a number with --draw"
            ))
        })
    };
    number.map(Draw::with_number).map_or_else(fresh, Ok)
}

fn choose<'a>(
    args: &VerifyArgs,
    runs: Vec<PlannedRun<'a>>,
    is_there: impl Fn(&PlannedRun<'_>) -> bool,
    amount: Amount,
    folder: &StudyFolder,
) -> Result<Chosen<'a>, CliError> {
    let mut there: Vec<PlannedRun<'a>> = runs.into_iter().filter(|run| is_there(run)).collect();
    if there.is_empty() {
        return Err(no_runs(folder));
    }
    there.retain(is_repeatable);
    if there.is_empty() {
        let message = "no run of this study can be repeated bit for bit, so that none is verified";
        return Err(CliError::Runtime(message.to_owned()));
    }
    let draw = draw(args.draw)?;
    let chosen = Chosen {
        runs: draw.choose(&there, amount.of(there.len())),
        total: there.len(),
    };
    say!(
        "draw       {}: {} of {}; to repeat these: --draw={}",
        draw.number(),
        chosen.runs.len(),
        pluralize(chosen.total, "run"),
        draw.number()
    );
    Ok(chosen)
}

/// Repeats the given runs until the flag is set, and calls the function with whether each is the same.
pub(super) type Repeat<'a, 'f> =
    &'f dyn Fn(&'a [PlannedRun<'a>], &AtomicBool, &(dyn Fn(&'a PlannedRun<'a>, bool) + Sync));

/// Repeats runs. Returns those whose result differs, in the order of their indices.
pub(super) fn repeat<'a>(
    plan: &StudyPlan,
    runs: &'a [PlannedRun<'a>],
    repeat: Repeat<'a, '_>,
) -> Result<Vec<PlannedRun<'a>>, CliError> {
    let stop_requests = StopRequests::listen("stopping; stored results are unchanged");
    let stop = stop_requests.flag();
    let progress = Mutex::new(StudyProgress::new(&plan.name, runs));
    let differing = Mutex::new(Vec::new());
    repeat(runs, stop, &|run, is_same| {
        progress.lock().expect(LOCK_IS_INTACT).run_finished(run);
        if !is_same {
            differing.lock().expect(LOCK_IS_INTACT).push(*run);
        }
    });
    drop(progress);
    if stop.load(Ordering::Relaxed) {
        return Err(CliError::Interrupted(
            "interrupted; stored results are unchanged".to_owned(),
        ));
    }
    let mut differing = differing.into_inner().expect(LOCK_IS_INTACT);
    differing.sort_by_key(|run| run.index);
    Ok(differing)
}

impl Chosen<'_> {
    /// Prints how many runs are the same, and each that differs with the file that says otherwise.
    fn print(
        &self,
        plan: &StudyPlan,
        state: &str,
        differing: &[PlannedRun<'_>],
        file: impl Fn(&PlannedRun<'_>) -> PathBuf,
    ) {
        let repeated = self.runs.len();
        say!(
            "verified   {}: {} of {repeated} repeated runs are bit-identical ({} {state})",
            plan.name,
            repeated - differing.len(),
            pluralize(self.total, "run")
        );
        for run in differing {
            note!(
                "differs    {}",
                describe_run(run, &file(run).display().to_string())
            );
        }
    }
}
