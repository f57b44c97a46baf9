//! The command line: parses arguments, calls the library, prints results, and sets the exit status.
//!
//! Exit status: 0 success, 1 failure, 2 invalid input, 128 + number of the signal for an
//! interruption. Rules of training must not
//! be implemented here.

/// Prints a line to the standard output. If the reader has closed the pipe (e.g. `head`), ends the
/// process with exit status 0.
macro_rules! say {
    ($($words:tt)*) => { $crate::cli::say_line(format_args!($($words)*)) };
}

/// Prints a line to the standard error. What cannot be written there is lost; it never ends the
/// process.
macro_rules! note {
    ($($words:tt)*) => { $crate::cli::note_line(format_args!($($words)*)) };
}

mod algorithms_page;
mod arguments;
mod bench;
mod check;
mod completions;
mod doctor;
mod evaluate;
mod execution;
mod explore;
mod export;
mod film;
mod floor;
mod forecast;
mod former_names;
mod groups;
mod inspect;
mod interruption;
mod list;
mod memory;
mod new;
mod plot;
mod preview;
mod print;
mod progress;
mod project_log;
mod ranks;
mod replay;
mod report;
mod round_questions;
mod run;
mod runs;
mod salvage;
mod sparkline;
mod study;
mod study_curves;
mod tune;

use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand, ValueEnum};

use seedbed::experiment::LoadError;
use seedbed::record::LiveError;
use seedbed::record::recording::DEFAULT_VIEWER;
use seedbed::review::{LoadRunError, LoadedRun};
use seedbed::run::RunError;
use seedbed::run::folder::RunFolder;
use seedbed::run::folder::checksums::Checksums;
use seedbed::text::{pluralize, terminal};
use seedbed_env::gymnasium::{set_notice, set_python};
use seedbed_input::InputError;

/// Train teams of reinforcement learning agents that explore in coordination, and record every
/// visited state
#[derive(Debug, Parser)]
#[command(name = "seedbed", version, max_term_width = 110)]
#[command(after_help = "Examples:
  seedbed init lab                                         a directory with a task, a scenario and a study
  seedbed run cartpole                                     train; results go to recordings/cartpole/seed-0
  seedbed run cartpole --seed 7 --set agents.count=16
  seedbed inspect recordings/cartpole/seed-0               summarize the run in the terminal
  seedbed plot recordings/cartpole/seed-0 --out run.png    draw visited states and returns
  seedbed film recordings/cartpole/seed-0 --out run.gif    show how they spread during training
  seedbed evaluate recordings/cartpole/seed-0              play the trained policies without learning
  seedbed study scenarios/team_size.ron                    many runs, a report, a verdict on each claim
  seedbed list algorithms                                  parameters and their defaults

To open a recording: rerun recordings/cartpole/seed-0/run.rrd
(Rerun viewer: pip install rerun-sdk==0.36.3)

Exit status: 0 success; 1 failure; 2 invalid input; 130 (Ctrl-C), 143 (TERM) or 128 + number of another signal: interruption.")]
struct Cli {
    /// Python that runs environments of Gymnasium [default: SEEDBED_PYTHON, the active virtual environment, or
    /// python3]
    #[arg(
        long,
        global = true,
        value_name = "FILE",
        help_heading = "Environments of Gymnasium"
    )]
    python: Option<PathBuf>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Train a team of agents on a scenario and record the run
    Run(RunArgs),
    /// Validate scenario, environment, study and tuning files without running them
    #[command(after_help = "Examples:
  seedbed check scenarios/*.ron envs/*.ron
  seedbed check cartpole
  seedbed check scenarios/thesis/fig_6_4a.ron
  sed 's/0.5/0.6/' envs/cartpole.ron | seedbed check -")]
    Check {
        /// RON files: scenarios, environments, studies or tuning files; names of scenarios and environments; or `-` for
        /// the standard input
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
    },
    /// List environments, scenarios and algorithms with their parameters
    #[command(after_help = "Examples:
  seedbed list
  seedbed list algorithms SeedPg
  seedbed list environments hooks               those whose name contains this text
  seedbed list --show cartpole                  print the file of an environment
  seedbed list scenarios --show cartpole > scenarios/mine.ron")]
    List {
        /// List only this kind [default: all]
        #[arg(value_enum, value_name = "KIND")]
        kind: Option<ListKind>,
        /// List only those whose name contains this text [default: all]
        #[arg(value_name = "TEXT", default_value = "", hide_default_value = true, conflicts_with_all = ["show", "markdown"])]
        part_of_name: String,
        /// Print the file of this environment or scenario
        #[arg(long, value_name = "NAME")]
        show: Option<PathBuf>,
        /// Print algorithms as a Markdown page
        #[arg(long, conflicts_with = "show")]
        markdown: bool,
    },
    /// Make a directory to work in: a task, a scenario, a study and a README
    #[command(after_help = "Examples:
  seedbed init                                  in the working directory
  seedbed init my_experiments

Existing files are never overwritten.")]
    Init {
        /// Directory; it is made if it does not exist
        #[arg(value_name = "DIR", default_value = ".")]
        folder: PathBuf,
    },
    /// Write a task, scenario or study to start from
    New(NewArgs),
    /// Print a script that completes commands in a shell
    #[command(after_help = "Examples:
  seedbed completions bash > ~/.local/share/bash-completion/completions/seedbed
  seedbed completions zsh > ~/.zfunc/_seedbed
  seedbed completions fish > ~/.config/fish/completions/seedbed.fish")]
    Completions {
        /// Shell
        #[arg(value_enum)]
        shell: clap_complete::Shell,
    },
    /// See what is installed: Python, Gymnasium, viewer, MPI, Slurm
    #[command(after_help = "Examples:
  seedbed doctor
  seedbed doctor --python ~/other/bin/python

What is missing is needed for some commands only; each line says for which, and how to get it.")]
    Doctor,
    /// Write the manual pages of all commands to a directory
    #[command(hide = true)]
    Manual {
        /// Directory
        folder: PathBuf,
    },
    /// Record a few episodes of random actions in an environment
    Preview(PreviewArgs),
    /// See how often random actions reach the goal of a task, before anything is trained
    Floor(FloorArgs),
    /// Train scenarios with several run seeds and compare how fast they solve their task
    Bench(BenchArgs),
    /// Run every setting of a study file with many run seeds and judge its claims
    Study(study::StudyArgs),
    /// Search for the parameters of methods, each with the same number of runs
    Tune(tune::TuneArgs),
    /// Write the report for all finished runs of a study
    Report(ReportArgs),
    /// Pack a registered study with its results, for others to check
    Submit(study::SubmitArgs),
    /// Play the trained policies of a run without learning and print their returns
    Evaluate(EvaluateArgs),
    /// Record episodes of the trained policies of a run, including the moving bodies
    Replay(ReplayArgs),
    /// Take what is whole out of a damaged recording, run or study
    Salvage(salvage::SalvageArgs),
    /// List runs with their main results
    Runs(runs::RunsArgs),
    /// Summarize a run: returns, coverage, differences between agents, observed ranges
    Inspect(inspect::InspectArgs),
    /// Write visited states, episodes or rounds as CSV, Parquet or NumPy arrays, or for TensorBoard
    Export(export::ExportArgs),
    /// Film a run: moving bodies, visited states and returns, as GIF, PNG or MP4
    Film(film::FilmArgs),
    /// Draw visited states and returns of one or more runs as SVG, PDF or PNG
    Plot(plot::PlotArgs),
    /// Write a page in which visited states are selected by brushes
    Explore(explore::ExploreArgs),
}

#[derive(Debug, Args)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a switch on the command line"
)]
#[command(after_help = "Examples:
  seedbed run cartpole --seed 3                  a scenario by its name (`seedbed list scenarios`)
  seedbed run scenarios/mine.ron --set agents.count=16 --set 'agents.seeds=Normal(sigma: 0)'
  seedbed run cartpole --seed 3 --resume         continue an interrupted run; results are bit-identical
  seedbed run cartpole --tensorboard logs/cartpole
                                                 write curves during training (`tensorboard --logdir logs`)
  seedbed run cartpole --set 'stop=Episodes(20000)' --serve
                                                 let viewers connect at any time (`rerun --connect`)
  seedbed run cartpole --set 'stop=Episodes(20000)' --live
                                                 show it in a viewer that is already running (`rerun`)")]
struct RunArgs {
    /// Scenario file, the name of a scenario (`seedbed list scenarios`), or `-` for the standard input
    scenario: PathBuf,
    /// Use this run seed instead of the scenario's
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Write results to this directory [default: recordings/<scenario>/seed-<N>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Start even if the run seems to need more memory than there is
    #[arg(long)]
    ignore_memory: bool,
    /// Number of threads; results do not depend on it [default: number of cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Replace one value of the scenario, e.g. agents.count=16; may be repeated
    #[arg(long = "set", value_name = "PATH=VALUE")]
    overrides: Vec<String>,
    /// Do not write run.rrd; with --resume, continue the run without its recording
    #[arg(long)]
    no_recording: bool,
    /// Also save reward seeds and initial parameters in policies.safetensors; repeat it with --resume
    #[arg(long)]
    save_initial: bool,
    /// Show the recording in a running viewer during training [default URL: viewer on this machine]
    #[arg(long, value_name = "URL", num_args = 0..=1, require_equals = true, default_missing_value = DEFAULT_VIEWER)]
    #[arg(conflicts_with = "no_recording")]
    live: Option<String>,
    /// Let any number of viewers on this machine connect during the run (`rerun --connect`). Each
    /// receives everything recorded so far, then all new data [default PORT: 9876; 0: any free
    /// port]
    #[arg(long, value_name = "PORT", num_args = 0..=1, require_equals = true, default_missing_value = "9876")]
    #[arg(conflicts_with_all = ["no_recording", "live"])]
    serve: Option<u16>,
    /// Print nothing but errors and warnings
    #[arg(long, short)]
    quiet: bool,
    /// Write returns and metrics as event files of TensorBoard to this directory during training
    #[arg(long, value_name = "DIR")]
    tensorboard: Option<PathBuf>,
    /// After each round print it as a line of JSON, and wait for a line on the standard input: `continue`, or `stop`
    /// to interrupt the run
    #[arg(long, conflicts_with = "mpi")]
    ask_after_rounds: bool,
    /// Divide the run over the processes that `mpirun` or `srun` has started; results do not depend on
    /// their number (docs/mpi.md)
    #[arg(long)]
    mpi: bool,
    /// Resume the interrupted run in the output directory
    #[arg(long, conflicts_with = "overwrite")]
    resume: bool,
    /// With --resume: continue an environment of Gymnasium with other versions of Python packages
    #[arg(long, requires = "resume")]
    other_versions: bool,
    /// Replace the existing run in the output directory
    #[arg(long)]
    overwrite: bool,
    /// Abort the process when N rounds are finished, as a crash would: for tests
    #[arg(long, value_name = "N", hide = true)]
    abort_after_rounds: Option<u32>,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed new task my_task                      write envs/my_task.ron: a short pole on a cart
  seedbed new scenario my_task --env my_task    write scenarios/my_task.ron
  seedbed new study team_size --scenario my_task
  seedbed new scenario pole --env gymnasium:CartPole-v1
  seedbed new task maze --env gymnasium:my_maze.py:make_maze

Files go to the nearest directory `envs` or `scenarios` in the working directory or above it. Existing \
files are never overwritten.")]
struct NewArgs {
    /// What to write
    #[arg(value_enum)]
    kind: NewKind,
    /// Name of the file, without `.ron`
    name: String,
    /// Environment of a new scenario [default: cartpole], or `gymnasium:ID` for a scenario or a task
    #[arg(long = "env", value_name = "ENV")]
    environment: Option<String>,
    /// Scenario of a new study [default: cartpole_team]
    #[arg(long, value_name = "SCENARIO")]
    scenario: Option<String>,
}

/// What `seedbed new` writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum NewKind {
    /// An environment file
    #[value(alias = "env", alias = "environment")]
    Task,
    /// A scenario file
    Scenario,
    /// A study file
    Study,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed preview cartpole                                 write recordings/preview/cartpole.rrd
  seedbed preview lander --film                            and recordings/preview/lander.gif
  seedbed preview envs/lander.ron --episodes 10 --seed 3")]
struct PreviewArgs {
    /// Name of an environment, an environment file, a scenario, or gymnasium:ID
    #[arg(value_name = "ENV")]
    environment: PathBuf,
    /// Number of episodes
    #[arg(long, value_name = "N", default_value_t = 3)]
    episodes: u64,
    /// Run seed for initial states and actions
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        allow_negative_numbers = true
    )]
    seed: u64,
    /// Use the task's analytic model instead of the physics engine (Rapier)
    #[arg(long)]
    analytic: bool,
    /// Also write an animated GIF, beside the recording
    #[arg(long)]
    film: bool,
    /// Write the recording to this file [default: recordings/preview/<ENV>.rrd]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed floor corridors_drawn --goal 1 --attempts 160    16 agents with 10 episodes each
  seedbed floor mine.ron --goal 0.5 --runs 20 --csv floor.csv
  seedbed floor gymnasium/envs/CartPole-v0.ron --goal 195

Plays episodes whose actions do not depend on what is seen: uniform, white, pink and slower noise, and one action for the \
whole episode. If one of them finds the goal about as often as an algorithm, the task does not show that the \
algorithm explores.")]
struct FloorArgs {
    /// Name of an environment, or an environment file
    #[arg(value_name = "ENV")]
    environment: PathBuf,
    /// Return of an episode at the goal [default: the task's reward threshold]
    #[arg(long, value_name = "RETURN", allow_negative_numbers = true)]
    goal: Option<f64>,
    /// Number of episodes that a whole team plays: agents times episodes of each
    #[arg(long, value_name = "N", num_args = 1.., value_delimiter = ',', default_values_t = [160], value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    attempts: Vec<u32>,
    /// Number of run seeds, which draw what is hidden in the task
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    runs: u32,
    /// Number of episodes for each run seed [default: the largest of the attempts, and 1000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    episodes: Option<u32>,
    /// First run seed
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        allow_negative_numbers = true
    )]
    seed: u64,
    /// Also write the numbers of each run to this file
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed bench scenarios/cartpole_1.ron scenarios/cartpole.ron scenarios/cartpole_16.ron
  seedbed bench scenarios/cartpole.ron --seeds 5 --set 'agents.seeds=Normal(sigma: 0)'

Prints the Kaplan–Meier median of episodes until solved with its 95 % interval (tabular scenarios: \
the mean regret), and compares each scenario with the first, without correction for their number. \
Use a study for claims.")]
struct BenchArgs {
    /// Scenario files or names of scenarios; the others are compared with the first
    #[arg(required = true, value_name = "SCENARIO")]
    scenarios: Vec<PathBuf>,
    /// Number of run seeds per scenario
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    seeds: u64,
    /// First of the consecutive run seeds
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=u64::MAX - 100_000))]
    first_seed: u64,
    /// Number of simultaneous runs, one thread each [default: number of cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Continue each run after its task is solved, to the scenario's maximum number of episodes
    #[arg(long)]
    whole: bool,
    /// Start even if the runs seem to need more memory than there is
    #[arg(long)]
    ignore_memory: bool,
    /// Replace one value of every scenario, e.g. agents.count=16; may be repeated
    #[arg(long = "set", value_name = "PATH=VALUE")]
    overrides: Vec<String>,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed evaluate recordings/cartpole/seed-0                          choose actions as in training
  seedbed evaluate recordings/cartpole/seed-0 --actions greedy --episodes 100
  seedbed evaluate recordings/cartpole/seed-0/run.rrd --temperature 0.5")]
struct EvaluateArgs {
    /// Run directory, or the recording in it
    run: PathBuf,
    /// Number of episodes per agent
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    episodes: u32,
    #[command(flatten)]
    play: PlayArgs,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed report recordings/studies/fig_6_4a

  seedbed report recordings/studies/fig_6_4a-3f00a91c5e7d --publish results     write results/fig_6_4a
  seedbed report results/fig_6_4a                                               write its tables again
  seedbed report recordings/studies/fig_6_4a --width 8.4cm --font 8pt --no-title
                                                                                figures for a column of a paper

Writes report.html, tables.md, claims.md, results.csv and figures/ (SVG, PDF and PNG) to that directory. Published results are one row per run and
the registration; the tables and verdicts are computed from them.")]
struct ReportArgs {
    /// Study directories, or directories with published results
    #[arg(required = true, value_name = "DIR")]
    folders: Vec<PathBuf>,
    /// Write one row per run with its measures, small enough for a repository, to a directory in DIR
    #[arg(long, value_name = "DIR", conflicts_with_all = ["theme", "width", "height", "font", "no_title", "no_legend", "x_range", "y_range", "log"])]
    publish: Option<PathBuf>,
    #[command(flatten, next_help_heading = "Figures for papers (files in figures/)")]
    print: print::PrintArgs,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed replay recordings/cartpole/seed-0               write recordings/cartpole/seed-0/replay.rrd
  seedbed replay recordings/cartpole/seed-0 --agents 0,3 --actions greedy
  seedbed replay recordings/cartpole/seed-0/run.rrd --episodes 20 --seed 7 --out replay.rrd")]
struct ReplayArgs {
    /// Run directory, or the recording in it
    run: PathBuf,
    /// Number of episodes per agent
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    episodes: u32,
    /// Agents whose bodies are drawn, e.g. 0,3 or 0..4, 4 excluded [default: as in the scenario, otherwise agent 0]
    #[arg(long, value_name = "N,N…", value_delimiter = ',', value_parser = plot::parse_agents)]
    agents: Vec<Range<u32>>,
    #[command(flatten)]
    play: PlayArgs,
    /// Write the recording to this file [default: replay.rrd in the run directory]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[derive(Debug, Args)]
struct PlayArgs {
    /// How actions are chosen [default: as in training]
    #[arg(long, value_enum)]
    actions: Option<ActionsArg>,
    /// Sample from the policy raised to the power 1/T; below 1 is greedier
    #[arg(
        long,
        value_name = "T",
        conflicts_with = "actions",
        allow_negative_numbers = true
    )]
    temperature: Option<f64>,
    /// Play in another task with the same observations and actions: a name, a file, or `Gymnasium(id: "…")`
    #[arg(long, value_name = "TASK")]
    environment: Option<String>,
    /// Run seed for initial states and actions
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        allow_negative_numbers = true
    )]
    seed: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ActionsArg {
    /// Sampled from the policy
    Sampled,
    /// The most likely action, or the mean of a Gaussian policy
    Greedy,
}

/// What `seedbed list` lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ListKind {
    /// Environments, built in and in `envs/`
    #[value(alias = "envs")]
    Environments,
    /// Scenarios and studies, built in and in `scenarios/`
    Scenarios,
    /// Learning algorithms with their parameters and defaults
    Algorithms,
}

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
enum CliError {
    /// Invalid option, file or setting.
    #[error("{0}")]
    Usage(String),
    /// Number of invalid files, each of which was reported already.
    #[error("{} invalid", pluralize(*.0, "file"))]
    InvalidFiles(usize),
    /// The command failed while it ran.
    #[error("{0}")]
    Runtime(String),
    /// The run was interrupted; its files are complete.
    #[error("{0}")]
    Interrupted(String),
}

/// Runs the command line of this process.
#[must_use]
pub(crate) fn main() -> ExitCode {
    let cli = arguments::parse();
    interruption::handle();
    set_notice(|text| note!("note       {text}"));
    if let Some(python) = &cli.python {
        set_python(python);
    }
    let result = match cli.command {
        Command::Run(args) => run::run(&args),
        Command::Check { files } => check::check(&files),
        Command::List {
            kind,
            show: Some(name),
            ..
        } => list::show(&name, kind),
        Command::List {
            markdown: true,
            kind,
            ..
        } => list::print_markdown(kind),
        Command::List {
            kind, part_of_name, ..
        } => list::list(kind, &part_of_name),
        Command::Init { folder } => new::init(&folder),
        Command::New(args) => new::new(&args),
        Command::Completions { shell } => {
            completions::print(shell);
            Ok(())
        }
        Command::Doctor => {
            doctor::doctor();
            Ok(())
        }
        Command::Manual { folder } => completions::write_manual(&folder),
        Command::Preview(args) => preview::preview(&args),
        Command::Floor(args) => floor::floor(&args),
        Command::Bench(args) => bench::bench(&args),
        Command::Evaluate(args) => evaluate::evaluate(&args),
        Command::Study(args) => study::study(&args),
        Command::Tune(args) => tune::tune(&args),
        Command::Report(args) => report::report(&args),
        Command::Submit(args) => study::submit(&args),
        Command::Salvage(args) => salvage::salvage(&args),
        Command::Runs(args) => runs::runs(&args),
        Command::Replay(args) => replay::replay(&args),
        Command::Inspect(args) => inspect::inspect(&args),
        Command::Export(args) => export::export(&args),
        Command::Film(args) => film::film(&args),
        Command::Plot(args) => plot::plot(&args),
        Command::Explore(args) => explore::explore(&args),
    };
    let Err(error) = result else {
        return ExitCode::SUCCESS;
    };
    // The error of a single invalid file was printed already; a count would add nothing.
    if !matches!(error, CliError::InvalidFiles(1)) {
        note!("error: {error}");
    }
    ExitCode::from(error.exit_code())
}

impl CliError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) | Self::InvalidFiles(_) => 2,
            Self::Runtime(_) => 1,
            Self::Interrupted(_) => interruption::exit_code(),
        }
    }
}

impl From<LoadRunError> for CliError {
    fn from(error: LoadRunError) -> Self {
        Self::Usage(error.to_string())
    }
}

/// Opens a run, and prints what is incomplete in its files.
fn open_run(path: &Path) -> Result<LoadedRun, CliError> {
    let run = LoadedRun::open(path).map_err(with_place_of_run)?;
    print_warnings(&run);
    Ok(run)
}

/// Names the directory that is meant if a run is called by its name alone.
fn with_place_of_run(error: LoadRunError) -> CliError {
    let LoadRunError::Missing(path) = &error else {
        return error.into();
    };
    let place = Path::new("recordings").join(path);
    if path.is_relative() && place.is_dir() {
        return CliError::Usage(format!("{error}; did you mean `{}`?", place.display()));
    }
    error.into()
}

/// Prints what is incomplete in the files of a run.
fn print_warnings(run: &LoadedRun) {
    for warning in &run.warnings {
        note!("warning: {warning}");
    }
}

/// Warning that nothing keeps two processes from writing to `folder`.
fn warning_without_locks(folder: &Path) -> String {
    format!(
        "warning: the file system of {} has no locks; let no other process write to this directory",
        folder.display()
    )
}

/// Warns if the files of the run in a folder cannot be verified.
fn warn_if_unverified(folder: &RunFolder) -> Result<(), CliError> {
    let checksums = Checksums::read(folder).map_err(RunError::from)?;
    if let Some(warning) = checksums.warning() {
        note!("warning: {warning}");
    }
    Ok(())
}

fn say_line(line: std::fmt::Arguments<'_>) {
    let styled = with_styles(&terminal(&line.to_string()));
    if let Err(error) = writeln!(std::io::stdout(), "{styled}") {
        if error.kind() == std::io::ErrorKind::BrokenPipe {
            std::process::exit(0);
        }
        note!("error: cannot write to standard output: {error}");
        std::process::exit(1);
    }
}

/// Characters that have no other use, in place of the control sequences of styles: [`terminal`] escapes
/// those that are in names.
const STYLES: [(char, &str); 3] = [
    ('\u{fdd0}', "\u{1b}[1m"),
    ('\u{fdd1}', "\u{1b}[32m"),
    ('\u{fdd2}', "\u{1b}[0m"),
];

/// A text that `say!` prints in bold.
fn bold(text: &str) -> String {
    format!("{}{text}{}", STYLES[0].0, STYLES[2].0)
}

/// A text that `say!` prints in green.
fn green(text: &str) -> String {
    format!("{}{text}{}", STYLES[1].0, STYLES[2].0)
}

/// The text with the styles of a terminal, or without styles in files and pipes.
fn with_styles(text: &str) -> String {
    STYLES
        .iter()
        .fold(text.to_owned(), |text, (mark, sequence)| {
            let has_styles = console::colors_enabled();
            text.replace(*mark, if has_styles { sequence } else { "" })
        })
}

fn note_line(line: std::fmt::Arguments<'_>) {
    let _ = writeln!(std::io::stderr(), "{}", terminal(&line.to_string()));
}

impl From<InputError> for CliError {
    fn from(error: InputError) -> Self {
        Self::Usage(error.to_string())
    }
}

impl From<LoadError> for CliError {
    fn from(error: LoadError) -> Self {
        error.error.into()
    }
}

impl From<LiveError> for CliError {
    fn from(error: LiveError) -> Self {
        match error {
            LiveError::InvalidAddress(_) | LiveError::Unavailable => Self::Usage(error.to_string()),
            LiveError::NoViewer(_) | LiveError::Port { .. } => Self::Runtime(error.to_string()),
        }
    }
}

impl From<RunError> for CliError {
    fn from(error: RunError) -> Self {
        match error {
            RunError::Input(_)
            | RunError::Damaged(_)
            | RunError::UnusableCheckpoint(_)
            | RunError::CannotResume(_) => Self::Usage(error.to_string()),
            RunError::Record(_)
            | RunError::Checkpoint(_)
            | RunError::File { .. }
            | RunError::Round(_) => Self::Runtime(error.to_string()),
        }
    }
}
