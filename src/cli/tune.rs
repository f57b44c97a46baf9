//! `seedbed tune`: searches for the parameters of methods, each with the same number of runs.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;

use super::execution::{
    ExecutionArgs, execute_runs, jobs, keeps_result, lock_folder, print_failures, print_finished,
    warn_of_damaged_files,
};
use super::study::check_same_study;
use super::{CliError, memory, pluralize};
use seedbed::input_files::{self, Directory};
use seedbed::study::store::StudyFolder;
use seedbed::study::tuning::output::described_values;
use seedbed::study::tuning::plan::{TuningError, TuningFile, TuningPlan, configuration_name};
use seedbed::study::tuning::search::Search;

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed tune scenarios/tuning/cartpole_q.ron --budget 12          twelve runs of each method
  seedbed tune scenarios/tuning/cartpole_q.ron --budget 12 --list   print rungs and configurations only
  seedbed tune mine.ron --budget 200 --seed 1                       draw other configurations
  seedbed check mine.ron                                            validate the file

Random search with successive halving: all configurations of a method have a few runs, and the best have more.
Writes tuning.csv (one row per run) and best.ron (cells to put into a study). Repeat the same command to resume an
interrupted search. Runs are kept for other budgets and search seeds.")]
pub(super) struct TuneArgs {
    /// Tuning file
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Number of runs of each method
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    budget: u64,
    /// Search seed, from which configurations are drawn
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    execution: ExecutionArgs,
    /// Write results to this directory [default: recordings/tuning/<file>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the rungs and all configurations, and run nothing
    #[arg(long)]
    list: bool,
}

pub(super) fn tune(args: &TuneArgs) -> Result<(), CliError> {
    let path = input_files::find_argument(&args.file, &[Directory::Scenarios])?;
    let plan = TuningFile::load(&path)?.plan(args.budget, args.seed)?;
    if args.list {
        print_plan(&plan);
        return Ok(());
    }
    if !args.execution.ignore_memory {
        let runs = plan.study.cells.iter().map(|cell| cell.source.memory());
        let name = format!(" of `{}`", plan.study.name);
        memory::check_runs(runs, jobs(&args.execution), &name)?;
    }
    let folder = StudyFolder::new(args.out.clone().unwrap_or_else(|| plan.default_folder()));
    run(args, &plan, &folder)
}

impl From<TuningError> for CliError {
    fn from(error: TuningError) -> Self {
        Self::Usage(error.to_string())
    }
}

fn runtime_error(error: &dyn std::error::Error) -> CliError {
    CliError::Runtime(error.to_string())
}

/// Runs all rungs, and writes and prints what was found.
fn run(args: &TuneArgs, plan: &TuningPlan, folder: &StudyFolder) -> Result<(), CliError> {
    check_same_study(&plan.study, folder)?;
    let _lock = lock_folder(folder, true)?;
    folder
        .write_manifest(&plan.study)
        .map_err(|error| runtime_error(&error))?;
    say!(
        "tuning     {}: {}, {} each",
        plan.study.name,
        pluralize(plan.methods.len(), "method"),
        pluralize(plan.budget as usize, "run")
    );
    let mut search = Search::new(plan);
    for rung in 0..plan.rungs() {
        run_rung(args, &search, rung, folder)?;
        search
            .finish_rung(folder)
            .map_err(|error| runtime_error(&error))?;
    }
    folder.remove_leftovers();
    finish(&search, folder)
}

/// Executes the runs of the next rung that have no stored result.
fn run_rung(
    args: &TuneArgs,
    search: &Search<'_>,
    rung: usize,
    folder: &StudyFolder,
) -> Result<(), CliError> {
    let all = search.next_distinct_runs();
    folder.remove_checkpoints_of_finished(&all);
    let mut missing = all.clone();
    missing.retain(|run| {
        let stored = folder.stored_run(run);
        !stored.is_some_and(|stored| keeps_result(&args.execution, &stored))
    });
    warn_of_damaged_files(&missing, folder);
    say!(
        "rung {rung}     {}, {} to run",
        pluralize(all.len(), "run"),
        missing.len()
    );
    let started = Instant::now();
    let failures = execute_runs(&args.execution, &missing, folder, &search.plan.study)?;
    if !missing.is_empty() {
        print_finished(missing.len(), jobs(&args.execution), started);
    }
    print_failures(&failures);
    Ok(())
}

/// Writes the files and prints the tables. An error if all runs of a best configuration failed.
fn finish(search: &Search<'_>, folder: &StudyFolder) -> Result<(), CliError> {
    for (index, method) in search.plan.methods.iter().enumerate() {
        say!("\n{}", method.name);
        for line in search.table(index) {
            say!("  {line}");
        }
    }
    for (index, method) in search.plan.methods.iter().enumerate() {
        let values = search.values_at_edges(index);
        if !values.is_empty() {
            note!(
                "warning: the best configuration of `{}` is at the edge of a range: {}; a wider one may have a better value",
                method.name,
                values.join(", ")
            );
        }
    }
    say!(
        "\nMeans of chosen configurations are optimistic: evaluate them in a study, with other run seeds."
    );
    if search.builds.len() > 1 {
        note!(
            "warning: the stored runs are of {} builds",
            search.builds.len()
        );
    }
    let [table, best] = search.write(folder.path()).map_err(|(path, error)| {
        CliError::Runtime(format!("cannot write {}: {error}", path.display()))
    })?;
    say!("runs       {}", table.display());
    say!("best       {}: put its cells into a study", best.display());
    let failed = search.plan.methods.iter().enumerate().find(|(index, _)| {
        let best = &search.configurations[search.best(*index)];
        best.values().is_empty()
    });
    failed.map_or(Ok(()), |(_, method)| {
        Err(CliError::Runtime(format!(
            "all runs of the best configuration of `{}` failed",
            method.name
        )))
    })
}

/// Prints the rungs and configurations of each method.
fn print_plan(plan: &TuningPlan) {
    for method in &plan.methods {
        say!(
            "{}: {}",
            method.name,
            pluralize(plan.budget as usize, "run")
        );
        for (number, rung) in method.schedule.rungs.iter().enumerate() {
            let more = match rung.with_one_more {
                0 => String::new(),
                best => format!(", one more for the best {best}"),
            };
            say!(
                "  rung {number}: {}, {} each{more}",
                pluralize(rung.configurations, "configuration"),
                pluralize(rung.runs as usize, "run")
            );
        }
        for configuration in 0..method.configurations.len() {
            let values = described_values(method, configuration);
            say!(
                "{}",
                format!("  {}  {values}", configuration_name(configuration)).trim_end()
            );
        }
    }
}
