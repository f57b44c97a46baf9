//! `seedbed bench`: several runs of each scenario, and comparisons with the first scenario.

use std::sync::Arc;

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::memory;
use super::{BenchArgs, CliError, former_names, pluralize, project_log};
use seedbed::experiment::{self, Experiment};
use seedbed::input_files::{self, Directory};
use seedbed::run::thread_count;
use seedbed::study::bench::{self, Bench, BenchReport, BenchTable, Column};
use seedbed_stats::MIN_RUNS;

pub(super) fn bench(args: &BenchArgs) -> Result<(), CliError> {
    let experiments = load_scenarios(args)?;
    let Some(first) = experiments.first() else {
        return Ok(());
    };
    if !args.ignore_memory {
        check_memory(args, &experiments)?;
    }
    let report = bench::report_of(&**first);
    let printer = TablePrinter::new(&experiments);
    let benches = run_all(&printer, report, &experiments, args)?;
    if args.whole {
        printer.print(report.exploration(&benches));
    }
    printer.print(report.comparison(&benches));
    if (args.seeds as usize) < MIN_RUNS {
        say!(
            "\nNo intervals: {MIN_RUNS} run seeds are needed, found {}.",
            args.seeds
        );
    }
    Ok(())
}

/// Loads all scenarios; an error unless all are compared by the same measure.
fn load_scenarios(args: &BenchArgs) -> Result<Vec<Arc<dyn Experiment>>, CliError> {
    let mut experiments = Vec::new();
    for argument in &args.scenarios {
        let path = input_files::find_argument(argument, &[Directory::Scenarios])?;
        let loaded = experiment::load(&path, &args.overrides)?;
        former_names::warn(&path, &loaded.former_names, &args.overrides);
        experiments.push(loaded.experiment);
    }
    let measures: Vec<&str> = experiments
        .iter()
        .map(|experiment| bench::report_of(&**experiment).measure())
        .collect();
    if let Some(differing) = measures.iter().position(|measure| *measure != measures[0]) {
        return Err(CliError::Usage(format!(
            "cannot compare {}, which is measured by {}, with {}, which is measured by {}",
            args.scenarios[0].display(),
            measures[0],
            args.scenarios[differing].display(),
            measures[differing],
        )));
    }
    Ok(experiments)
}

/// An error if the runs, as many at once as there are threads, need more memory than there is.
fn check_memory(args: &BenchArgs, experiments: &[Arc<dyn Experiment>]) -> Result<(), CliError> {
    let jobs = thread_count(args.jobs.map_or(0, usize::from));
    let at_once = jobs.min(args.seeds as usize);
    memory::check_runs(
        experiments.iter().map(|experiment| experiment.memory()),
        at_once,
        "",
    )
}

/// Runs one scenario after the other and prints the results of each as soon as it is finished.
fn run_all(
    printer: &TablePrinter,
    report: &dyn BenchReport,
    experiments: &[Arc<dyn Experiment>],
    args: &BenchArgs,
) -> Result<Vec<Bench>, CliError> {
    let pool = thread_pool(args)?;
    let seed_count = pluralize(args.seeds as usize, "run seed");
    for line in report.introduction(&format!("{seed_count} from {}", args.first_seed)) {
        say!("{line}");
    }
    say!("");
    printer.print_header(report.columns());
    let run_seeds = args.first_seed..args.first_seed.saturating_add(args.seeds);
    let mut benches = Vec::with_capacity(experiments.len());
    for (experiment, file) in experiments.iter().zip(&args.scenarios) {
        project_log::add_runs(file, &**experiment, run_seeds.clone());
        let bench = Bench::run(&**experiment, run_seeds.clone(), args.whole, &pool)?;
        printer.print_row(report.columns(), &bench.name, &report.table_row(&bench));
        benches.push(bench);
    }
    Ok(benches)
}

fn thread_pool(args: &BenchArgs) -> Result<ThreadPool, CliError> {
    ThreadPoolBuilder::new()
        .num_threads(args.jobs.map_or(0, usize::from))
        .build()
        .map_err(|error| CliError::Runtime(error.to_string()))
}

/// Prints tables with the scenario's name in the first column.
struct TablePrinter {
    name_width: usize,
}

impl TablePrinter {
    fn new(experiments: &[Arc<dyn Experiment>]) -> Self {
        let widths = experiments
            .iter()
            .map(|experiment| experiment.name().chars().count());
        Self {
            name_width: widths.fold("scenario".len(), usize::max),
        }
    }

    fn print(&self, table: Option<BenchTable>) {
        let Some(table) = table else {
            return;
        };
        say!("");
        for line in &table.above {
            say!("{line}");
        }
        say!("");
        self.print_header(table.columns);
        for (name, cells) in &table.rows {
            self.print_row(table.columns, name, cells);
        }
        if !table.below.is_empty() {
            say!("");
        }
        for line in &table.below {
            say!("{line}");
        }
    }

    fn print_header(&self, columns: &[Column]) {
        let titles: Vec<String> = columns
            .iter()
            .map(|(title, _)| (*title).to_owned())
            .collect();
        self.print_row(columns, "scenario", &titles);
        let separators: Vec<String> = columns
            .iter()
            .map(|(_, width)| format!("{}:|", "-".repeat(width + 1)))
            .collect();
        say!(
            "|{}|{}",
            "-".repeat(self.name_width + 2),
            separators.concat()
        );
    }

    fn print_row(&self, columns: &[Column], name: &str, cells: &[String]) {
        let cells: Vec<String> = cells
            .iter()
            .zip(columns)
            .map(|(cell, (_, width))| format!(" {cell:>width$} |"))
            .collect();
        say!("| {name:<0$} |{1}", self.name_width, cells.concat());
    }
}
