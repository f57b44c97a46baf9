//! The command line: what the user typed becomes a call, what came of it becomes words and an exit code.
//!
//! Exit codes: 0 done, 1 the work failed, 2 the input is wrong. Science may not enter.

/// Prints a line; a reader who has seen enough, such as `head`, ends the command quietly.
macro_rules! say {
    ($($words:tt)*) => { $crate::cli::say_line(format_args!($($words)*)) };
}

mod bench;
mod check;
mod evaluate;
mod inspect;
mod list;
mod plot;
mod preview;
mod progress;
mod replay;
mod report;
mod run;
mod spark;
mod study;
mod tabular;

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::input::InputError;
use crate::record::rerun::{DEFAULT_VIEWER, ServeError, ViewerError};
use crate::run::RunError;
use crate::run::review::ReviewError;
use crate::study::report::counted;

/// Coordinated exploration in concurrent reinforcement learning, with every visited state on record.
#[derive(Debug, Parser)]
#[command(name = "seedbed", version, about, max_term_width = 110)]
#[command(after_help = "Examples:
  seedbed run scenarios/cartpole.ron                      train, and record to recordings/cartpole/seed-0/
  seedbed run scenarios/cartpole.ron --seed 7 --set agents.count=16
  seedbed check scenarios/*.ron envs/*.ron                validate files without running
  seedbed preview cartpole                                record a few random episodes of a task
  seedbed evaluate recordings/cartpole/seed-0 --actions greedy
  seedbed study scenarios/thesis/fig_6_4a.ron             many runs, with a report and a verdict on each claim
  seedbed replay recordings/cartpole/seed-0               film what the trained policies do
  seedbed inspect recordings/cartpole/seed-0              what came of a run
  seedbed plot recordings/cartpole/seed-0 --out run.png   where its agents went
  seedbed list algorithms                                 what can be set, and the defaults
  rerun recordings/cartpole/seed-0/run.rrd                look at a recording (the viewer: pip install rerun-sdk==0.36.3)")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Train a team as a scenario file says, and record it
    Run(RunArgs),
    /// Validate scenario, environment and study files without running them
    Check {
        /// Files in RON, of any kind
        #[arg(required = true)]
        files: Vec<PathBuf>,
    },
    /// Show what there is: environments, scenarios, algorithms with their parameters and defaults
    List {
        /// One of them only
        #[arg(value_enum)]
        what: Option<Listed>,
    },
    /// Record a few episodes of random actions in a task, to see what it is
    Preview(PreviewArgs),
    /// Train scenarios with several seeds and print when each solved its task, and how fast; in finite tasks, their regret
    Bench(BenchArgs),
    /// Run many settings with many seeds as a study file says, and judge its claims
    Study(StudyArgs),
    /// Write the report of a study's runs, as far as they are there
    Report(ReportArgs),
    /// Play the policies of a run without learning, and print what they reach
    Evaluate(EvaluateArgs),
    /// Record episodes of the policies of a run, with the bodies in motion
    Replay(ReplayArgs),
    /// Tell what came of a run: returns, coverage, how far agents differ, what they saw
    Inspect(inspect::InspectArgs),
    /// Draw where the agents of a run went, and what they reached, as SVG or PNG
    Plot(plot::PlotArgs),
}

#[derive(Debug, Args)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a switch on the command line"
)]
#[command(after_help = "Examples:
  seedbed run scenarios/cartpole.ron --seed 3
  seedbed run scenarios/cartpole.ron --set agents.count=16 --set 'agents.seeds=Normal(sigma: 0)' --out results/unseeded
  seedbed run scenarios/cartpole.ron --live               watch it in a viewer that runs already (rerun)
  seedbed run scenarios/cartpole.ron --serve              let viewers come and go: rerun --connect
  seedbed run scenarios/cartpole.ron --resume             go on after an interruption, to the same bits")]
struct RunArgs {
    /// A scenario file
    scenario: PathBuf,
    /// The run's seed, in place of the scenario's
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Where results go [default: recordings/<scenario>/seed-<N>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Threads for updates; the results do not depend on it [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Replace one value of the scenario, such as agents.count=16; may be repeated
    #[arg(long = "set", value_name = "PATH=VALUE")]
    overrides: Vec<String>,
    /// Write no run.rrd
    #[arg(long)]
    no_recording: bool,
    /// Show the recording in a running viewer while it is made [default URL: that of a viewer on this machine]
    #[arg(long, value_name = "URL", num_args = 0..=1, require_equals = true, default_missing_value = DEFAULT_VIEWER)]
    #[arg(conflicts_with = "no_recording")]
    live: Option<String>,
    /// Let viewers on this machine connect while the run lasts (`rerun --connect`), however many and whenever they come: each
    /// sees all that was recorded so far, read from the file, and what follows [default PORT: 9876; 0 is any that is free]
    #[arg(long, value_name = "PORT", num_args = 0..=1, require_equals = true, default_missing_value = "9876")]
    #[arg(conflicts_with_all = ["no_recording", "live"])]
    serve: Option<u16>,
    /// Say nothing but errors
    #[arg(long, short)]
    quiet: bool,
    /// Go on with the interrupted run in the output folder
    #[arg(long, conflicts_with = "overwrite")]
    resume: bool,
    /// Replace the run in the output folder
    #[arg(long)]
    overwrite: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed preview cartpole                                to recordings/preview/cartpole.rrd
  seedbed preview envs/mine.ron --episodes 10 --seed 3")]
struct PreviewArgs {
    /// A task in `envs/`, or a task file
    #[arg(value_name = "ENV")]
    environment: String,
    /// How many episodes
    #[arg(long, value_name = "N", default_value_t = 3)]
    episodes: u64,
    /// Seed of the starts and actions
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Move by the task's closed-form twin
    #[arg(long)]
    analytic: bool,
    /// The recording [default: recordings/preview/<env>.rrd]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed bench scenarios/cartpole_1.ron scenarios/cartpole.ron scenarios/cartpole_16.ron
  seedbed bench scenarios/cartpole.ron --seeds 5 --set 'agents.seeds=Normal(sigma: 0)'")]
struct BenchArgs {
    /// Scenario files
    #[arg(required = true)]
    scenarios: Vec<PathBuf>,
    /// How many seeds
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    seeds: u64,
    /// The first of them
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=u64::MAX - 100_000))]
    first_seed: u64,
    /// Runs at once, each on one thread [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Go on after a task is solved, to the scenario's end
    #[arg(long)]
    whole: bool,
    /// Replace one value of every scenario, such as agents.count=16; may be repeated
    #[arg(long = "set", value_name = "PATH=VALUE")]
    overrides: Vec<String>,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed evaluate recordings/cartpole/seed-0                          as in training
  seedbed evaluate recordings/cartpole/seed-0 --actions greedy --episodes 100
  seedbed evaluate recordings/cartpole/seed-0/run.rrd --temperature 0.5")]
struct EvaluateArgs {
    /// A run's folder, or the recording in it
    run: PathBuf,
    /// Episodes of each agent
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    episodes: u32,
    #[command(flatten)]
    play: PlayArgs,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed study scenarios/thesis/fig_6_4a.ron             all runs that are missing, then the report
  seedbed study scenarios/thesis/*.ron --quick            every study with few and short runs, to see that all is as meant
  seedbed study scenarios/thesis/fig_6_4a.ron --list      all runs with their indices
  seedbed study scenarios/thesis/fig_6_4a.ron --index $SLURM_ARRAY_TASK_ID    one of them, as a job of its own
  seedbed study scenarios/thesis/fig_6_4a.ron --verify    whether ten of its runs still come out the same
A study that was interrupted goes on where it was; one that was changed runs what its change concerns.")]
struct StudyArgs {
    /// Study files
    #[arg(required = true)]
    studies: Vec<PathBuf>,
    /// Runs at once, each on one thread [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Where results go [default: recordings/studies/<study>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Run it as the study's `quick` says, into a folder of its own
    #[arg(long)]
    quick: bool,
    /// Show all runs with their indices, and which are finished
    #[arg(long)]
    list: bool,
    /// Run this one alone, without a report; many may do so at once in one folder
    #[arg(long, value_name = "I", conflicts_with = "list")]
    index: Option<usize>,
    /// Run again what failed before
    #[arg(long)]
    retry: bool,
    /// Run N of the finished runs once more, change nothing, and tell whether the same came out, to the bit [default: 10]
    #[arg(long, value_name = "N", num_args = 0..=1, require_equals = true, default_missing_value = "10")]
    #[arg(value_parser = clap::value_parser!(u16).range(1..), conflicts_with_all = ["list", "index", "retry"])]
    verify: Option<u16>,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed report recordings/studies/fig_6_4a              report.html, tables.md, results.csv and figures/ in that folder")]
struct ReportArgs {
    /// Folders of studies
    #[arg(required = true, value_name = "DIR")]
    folders: Vec<PathBuf>,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed replay recordings/cartpole/seed-0                            to recordings/cartpole/seed-0/replay.rrd
  seedbed replay recordings/cartpole/seed-0 --agents 0,3 --actions greedy
  seedbed replay recordings/cartpole/seed-0/run.rrd --episodes 20 --seed 7 --out look.rrd")]
struct ReplayArgs {
    /// A run's folder, or the recording in it
    run: PathBuf,
    /// Episodes of each agent
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    episodes: u32,
    /// Agents whose bodies are drawn, such as 0,3 [default: those that the scenario draws]
    #[arg(long, value_name = "K,…", value_delimiter = ',')]
    agents: Vec<u32>,
    #[command(flatten)]
    play: PlayArgs,
    /// The recording [default: replay.rrd in the run's folder]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[derive(Debug, Args)]
struct PlayArgs {
    /// How actions are chosen [default: as in training]
    #[arg(long, value_enum)]
    actions: Option<ActionsArg>,
    /// Sample from the policy to the power 1/T: below 1 is greedier
    #[arg(
        long,
        value_name = "T",
        conflicts_with = "actions",
        allow_negative_numbers = true
    )]
    temperature: Option<f64>,
    /// Seed of the starts and the actions
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ActionsArg {
    /// Drawn from the policy
    Sampled,
    /// The likeliest, or the mean
    Greedy,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Listed {
    /// Tasks in `envs/`
    #[value(alias = "envs")]
    Environments,
    /// Files in `scenarios/`
    Scenarios,
    /// Learners, with their parameters and defaults
    Algorithms,
}

/// Why a command did not do what was asked.
#[derive(Debug, thiserror::Error)]
enum Failure {
    /// The input is wrong.
    #[error("{0}")]
    Input(String),
    /// So many files are wrong; each was complained about already.
    #[error("{} cannot be used", counted(*.0, "file"))]
    Files(usize),
    /// The work failed.
    #[error("{0}")]
    Work(String),
}

/// Runs the command line of this process.
#[must_use]
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let done = match cli.command {
        Command::Run(args) => run::run(&args),
        Command::Check { files } => check::check(&files),
        Command::List { what } => {
            list::list(what);
            Ok(())
        }
        Command::Preview(args) => preview::preview(&args),
        Command::Bench(args) => bench::bench(&args),
        Command::Evaluate(args) => evaluate::evaluate(&args),
        Command::Study(args) => study::study(&args),
        Command::Report(args) => report::report(&args),
        Command::Replay(args) => replay::replay(&args),
        Command::Inspect(args) => inspect::inspect(&args),
        Command::Plot(args) => plot::plot(&args),
    };
    let Err(failure) = done else {
        return ExitCode::SUCCESS;
    };
    if !matches!(failure, Failure::Files(1)) {
        eprintln!("error: {failure}");
    }
    match failure {
        Failure::Input(_) | Failure::Files(_) => ExitCode::from(2),
        Failure::Work(_) => ExitCode::from(1),
    }
}

impl From<ReviewError> for Failure {
    fn from(error: ReviewError) -> Self {
        Self::Input(error.to_string())
    }
}

fn say_line(line: std::fmt::Arguments<'_>) {
    if let Err(error) = writeln!(std::io::stdout(), "{line}") {
        if error.kind() == std::io::ErrorKind::BrokenPipe {
            std::process::exit(0);
        }
        eprintln!("error: cannot write to the standard output: {error}");
        std::process::exit(1);
    }
}

impl From<InputError> for Failure {
    fn from(error: InputError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<ViewerError> for Failure {
    fn from(error: ViewerError) -> Self {
        match error {
            ViewerError::Address(_) => Self::Input(error.to_string()),
            ViewerError::Absent(_) => Self::Work(error.to_string()),
        }
    }
}

impl From<ServeError> for Failure {
    fn from(error: ServeError) -> Self {
        Self::Work(error.to_string())
    }
}

impl From<RunError> for Failure {
    fn from(error: RunError) -> Self {
        match error {
            RunError::Input(_) | RunError::AnotherRun(_) => Self::Input(error.to_string()),
            RunError::Record(_)
            | RunError::Checkpoint(_)
            | RunError::File { .. }
            | RunError::Diverged(_) => Self::Work(error.to_string()),
        }
    }
}
