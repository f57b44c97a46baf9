//! `seedbed study verify`: repeats stored or published runs that are drawn at random, and compares their
//! bits.

use std::sync::Mutex;
use std::sync::atomic::Ordering;

use super::arguments::VerifyArgs;
use super::error_of;
use super::plans::{Selection, check_same_study};
use crate::cli::execution::{LOCK_IS_INTACT, damage_message, damaged_file, describe_run, jobs};
use crate::cli::interruption::StopRequests;
use crate::cli::progress::StudyProgress;
use crate::cli::{CliError, pluralize, report};
use seedbed::study::design::cell::PlannedRun;
use seedbed::study::design::plan::StudyPlan;
use seedbed::study::evaluate::agreement;
use seedbed::study::evaluate::completeness;
use seedbed::study::evaluate::published::{self, PublishedRuns};
use seedbed::study::evaluate::results::Results;
use seedbed::study::execute::draw::Draw;
use seedbed::study::execute::runner::{self, ExpectedResults};
use seedbed::study::store::StudyFolder;

/// Repeats some of the runs of each study.
pub(super) fn verify_all(args: &VerifyArgs) -> Result<(), CliError> {
    let selection = Selection::of_results(&args.studies, &args.results);
    let mut differing = 0;
    for (plan, folder) in selection.load()? {
        differing += verify(args, &plan, &folder)?;
    }
    error_of(differing, "not reproduced")
}

/// Repeats some of the stored runs and compares the results; if there are none in `folder`, some of
/// those that are published beside the study. Returns the number of runs whose result differs, is
/// missing or cannot be compared.
///
/// # Errors
/// If the results are not those of the study or of its lock, or cannot be read.
fn verify(args: &VerifyArgs, plan: &StudyPlan, folder: &StudyFolder) -> Result<usize, CliError> {
    let folder = &match args.results.place.out {
        Some(_) => folder.clone(),
        None => published::stored_or_beside(&plan.path, folder.clone()),
    };
    check_same_study(plan, folder)?;
    let results = read_results(plan, folder)?;
    let not_comparable =
        print_missing(&results) + print_without_source(plan, &results) + print_not_repeatable(plan);
    let differing = if published::is_published(folder) {
        let published = PublishedRuns::read(folder, results, plan);
        let published = published.map_err(|error| CliError::Usage(error.to_string()))?;
        verify_some(args, plan, &published, "published", folder)?
    } else {
        verify_some(args, plan, folder, "stored", folder)?
    };
    if differing > 0 && !published::is_published(folder) {
        note!(
            "the stored results come from other code or another kind of machine; delete {} to repeat all runs",
            folder.runs_folder().display()
        );
    }
    Ok(differing + not_comparable)
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

/// Repeats some of the runs that are there, and prints which differ. `state`: `stored` or `published`. Returns the
/// number of those that differ.
fn verify_some(
    args: &VerifyArgs,
    plan: &StudyPlan,
    expected: &dyn ExpectedResults,
    state: &str,
    folder: &StudyFolder,
) -> Result<usize, CliError> {
    let chosen = choose(args, plan.distinct_runs(), expected, folder)?;
    let differing = repeat(plan, &chosen.runs, expected, jobs(&args.execution))?;
    let repeated = chosen.runs.len();
    say!(
        "verified   {}: {} of {repeated} repeated runs are bit-identical ({} {state})",
        plan.name,
        repeated - differing.len(),
        pluralize(chosen.total, "run")
    );
    for run in &differing {
        let location = expected.location(run);
        note!(
            "differs    {}",
            describe_run(run, &location.display().to_string())
        );
    }
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
    expected: &dyn ExpectedResults,
    folder: &StudyFolder,
) -> Result<Chosen<'a>, CliError> {
    let mut there = runs;
    there.retain(|run| expected.contains(run));
    if there.is_empty() {
        return Err(no_runs(folder));
    }
    there.retain(is_repeatable);
    if there.is_empty() {
        let message = "no run of this study can be repeated bit for bit, so that none is verified";
        return Err(CliError::Runtime(message.to_owned()));
    }
    let draw = draw(args.draw)?;
    let count = args.runs.of(there.len());
    let runs = if args.any_cell {
        draw.choose_of_any_cell(&there, count)
    } else {
        draw.choose(&there, count)
    };
    let chosen = Chosen {
        runs,
        total: there.len(),
    };
    say!(
        "draw       {}: {} of {}; to repeat these: --draw={}{}",
        draw.number(),
        chosen.runs.len(),
        pluralize(chosen.total, "run"),
        draw.number(),
        if args.any_cell { " --any-cell" } else { "" }
    );
    Ok(chosen)
}

/// Repeats runs on `jobs` threads. Returns those whose result is not the expected one, in the order of their
/// indices.
pub(super) fn repeat<'a>(
    plan: &StudyPlan,
    runs: &'a [PlannedRun<'a>],
    expected: &dyn ExpectedResults,
    jobs: usize,
) -> Result<Vec<PlannedRun<'a>>, CliError> {
    let stop_requests = StopRequests::listen("stopping; stored results are unchanged");
    let stop = stop_requests.flag();
    let progress = Mutex::new(StudyProgress::new(&plan.name, runs, jobs));
    let differing = Mutex::new(Vec::new());
    runner::verify(runs, expected, jobs, stop, &|run, is_same, seconds| {
        progress
            .lock()
            .expect(LOCK_IS_INTACT)
            .run_finished(run, seconds);
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
