//! `seedbed study run` and `seedbed study confirm`: execute what is missing, and print the verdicts on claims.

use std::time::Instant;

use super::arguments::RunArgs;
use super::plans::check_same_study;
use crate::cli::execution::{
    describe_run, execute_runs, interruption_error, jobs, keeps_result, lock_folder,
    print_failures, print_finished, warn_of_damaged_files,
};
use crate::cli::{CliError, memory, pluralize, report};
use seedbed::study::design::plan::StudyPlan;
use seedbed::study::execute::shard::Shard;
use seedbed::study::store::StudyFolder;
use seedbed::text::terminal_line;
use seedbed_figure::PrintLayout;

/// Executes a single run; other processes may work in the same directory. Returns the number of
/// failed runs, 0 or 1.
pub(super) fn run_one(
    args: &RunArgs,
    plan: &StudyPlan,
    folder: &StudyFolder,
    index: usize,
) -> Result<usize, CliError> {
    let runs = plan.runs();
    let Some(run) = runs.get(index) else {
        let message = format!(
            "--index {index}: expected an index from 0 to {}; `seedbed study list` shows all",
            runs.len() - 1
        );
        return Err(CliError::Usage(message));
    };
    check_same_study(plan, folder)?;
    let _lock = lock_folder(folder, false)?;
    folder
        .write_manifest(plan)
        .map_err(|error| CliError::Runtime(error.to_string()))?;
    folder.remove_checkpoints_of_finished(&[*run]);
    let file = folder.result_file(run.cell.digest(), run.run_seed);
    let was_stored = folder
        .stored_run(run)
        .is_some_and(|stored| keeps_result(&args.execution, &stored));
    if !was_stored {
        print_failures(&execute_runs(&args.execution, &[*run], folder, plan)?);
    }
    let Some(stored) = folder.stored_run(run) else {
        return Err(interruption_error(&plan.name));
    };
    let status = if was_stored { "already stored: " } else { "" };
    say!(
        "{}",
        describe_run(run, &format!("{status}{}", file.display()))
    );
    if let (true, Err(reason)) = (was_stored, &stored.outcome) {
        print_failures(&[describe_run(run, reason)]);
    }
    Ok(usize::from(stored.outcome.is_err()))
}

/// Executes the runs of a shard that have no stored result; other processes may work in the same
/// directory. Returns the number of failed runs of the shard.
pub(super) fn run_shard(
    args: &RunArgs,
    plan: &StudyPlan,
    folder: &StudyFolder,
    shard: Shard,
) -> Result<usize, CliError> {
    check_same_study(plan, folder)?;
    let _lock = lock_folder(folder, false)?;
    folder
        .write_manifest(plan)
        .map_err(|error| CliError::Runtime(error.to_string()))?;
    let runs = shard.runs_of(&plan.distinct_runs());
    folder.remove_checkpoints_of_finished(&runs);
    let mut missing = runs.clone();
    missing.retain(|run| {
        let stored = folder.stored_run(run);
        !stored.is_some_and(|stored| keeps_result(&args.execution, &stored))
    });
    warn_of_damaged_files(&missing, folder);
    say!(
        "study      {}: shard {shard}: {}, {} to run",
        plan.name,
        pluralize(runs.len(), "run"),
        missing.len()
    );
    say!("results    {}", folder.runs_folder().display());
    let started = Instant::now();
    execute_runs(&args.execution, &missing, folder, plan)?;
    if !missing.is_empty() {
        print_finished(missing.len(), jobs(&args.execution), started);
    }
    let failures: Vec<String> = runs
        .iter()
        .filter_map(|run| {
            let failure = folder.stored_run(run)?.outcome.err()?;
            Some(describe_run(run, &failure))
        })
        .collect();
    print_failures(&failures);
    Ok(failures.len())
}

/// Executes all runs that have no stored result, and writes the report. Returns the number of
/// failed runs. A registered study stops at the first look at which all confirmatory claims are
/// decided.
pub(super) fn run_all(
    args: &RunArgs,
    plan: &StudyPlan,
    folder: &StudyFolder,
) -> Result<usize, CliError> {
    check_same_study(plan, folder)?;
    let _lock = lock_folder(folder, true)?;
    folder
        .write_manifest(plan)
        .map_err(|error| CliError::Runtime(error.to_string()))?;
    let looks = match &plan.lock {
        Some(lock) => lock.registered.looks.clone(),
        None => vec![plan.repeats()],
    };
    let mut warnings = plan.warnings();
    for (number, &runs_per_cell) in (1..).zip(&looks) {
        if looks.len() > 1 {
            say!(
                "look       {number} of {}: {runs_per_cell} runs per cell",
                looks.len()
            );
        }
        let new_warnings = std::mem::take(&mut warnings);
        run_missing(args, plan, folder, runs_per_cell, &new_warnings)?;
        if number < looks.len() && report::all_claims_are_decided(folder)? {
            say!(
                "decided    all confirmatory claims, at look {number} of {}",
                looks.len()
            );
            break;
        }
    }
    folder.remove_checkpoints_of_finished(&plan.distinct_runs());
    folder.remove_leftovers();
    report::write_and_print(folder, &PrintLayout::default())
}

/// Executes the first `runs_per_cell` runs of each cell that have no stored result, after it has printed the warnings.
fn run_missing(
    args: &RunArgs,
    plan: &StudyPlan,
    folder: &StudyFolder,
    runs_per_cell: u64,
    warnings: &[String],
) -> Result<(), CliError> {
    let mut missing = plan.distinct_runs();
    missing.retain(|run| {
        let stored = folder.stored_run(run);
        run.is_among_first(runs_per_cell)
            && !stored.is_some_and(|stored| keeps_result(&args.execution, &stored))
    });
    let (cells, runs) = (
        pluralize(plan.cells.len(), "cell"),
        pluralize(runs_per_cell as usize, "run"),
    );
    warn_of_damaged_files(&missing, folder);
    let to_read = missing.iter().filter(|run| run.name.is_some()).count();
    let to_run = missing.len() - to_read;
    if plan.cells.iter().any(|cell| cell.source.found().is_none()) {
        say!(
            "study      {}: {cells}, {runs} each, {to_run} to run",
            plan.name
        );
    } else {
        say!("study      {}: {cells}", plan.name);
    }
    print_results_of_others(plan);
    for warning in warnings {
        note!("warning: {}", terminal_line(warning));
    }
    let started = Instant::now();
    let failures = execute_runs(&args.execution, &missing, folder, plan)?;
    if to_run > 0 {
        print_finished(to_run, jobs(&args.execution), started);
    }
    print_failures(&failures);
    Ok(())
}

/// Prints how many runs of others were found.
fn print_results_of_others(plan: &StudyPlan) {
    for cell in &plan.cells {
        let Some(external) = cell.source.found() else {
            continue;
        };
        say!(
            "of others  {}: {} in {}",
            terminal_line(&cell.name),
            pluralize(external.runs().count(), "run"),
            terminal_line(external.pattern())
        );
    }
}

/// An error if the runs, as many at once as there are threads, need more memory than there is.
pub(super) fn check_memory(args: &RunArgs, plan: &StudyPlan) -> Result<(), CliError> {
    let at_once = if args.index.is_some() {
        1
    } else {
        jobs(&args.execution)
    };
    let runs = plan.cells.iter().map(|cell| cell.source.memory());
    memory::check_runs(runs, at_once, &format!(" of `{}`", plan.name))
}
