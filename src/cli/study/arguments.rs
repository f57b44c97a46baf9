//! The arguments of `seedbed study`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, Subcommand, ValueEnum};

use crate::cli::execution::ExecutionArgs;
use seedbed::study::execute::shard::Shard;

#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(disable_help_subcommand = true)]
#[command(after_help = "Examples:
  seedbed study scenarios/thesis/fig_6_4a.ron                 run what is missing, then write the report
  seedbed study scenarios/thesis/*.ron --quick                a short trial of every study
  seedbed study list scenarios/thesis/fig_6_4a.ron            all runs with their indices and states
  seedbed study verify scenarios/thesis/fig_6_4a.ron          repeat ten stored runs and compare bits
  seedbed study power mine.ron                                how many runs each confirmatory claim needs
  seedbed study register mine.ron                             fix claims, cells and numbers of runs in mine.ron.lock
  seedbed study confirm mine.ron                              run what is registered, with run seeds of its own
  seedbed study script mine.ron > mine.sbatch                 a job script for a cluster
  seedbed study merge mine.ron --from ~/other_cluster/mine    unite results

Results of other libraries, as cells of mine.ron beside cells with a scenario:
  (name: \"SB3 PPO\", results: Monitor(\"sb3/ppo-*/\"))
  (name: \"CleanRL\", results: TensorBoard(runs: \"cleanrl/*/\", tag: \"charts/episodic_return\"))

Repeat the same command to resume an interrupted study. After an edit of the study file only \
affected runs are repeated.")]
pub(in crate::cli) struct StudyArgs {
    #[command(subcommand)]
    pub(super) action: Option<Action>,
    #[command(flatten)]
    pub(super) run: RunArgs,
}

/// What is done with studies.
#[derive(Debug, Subcommand)]
pub(super) enum Action {
    /// Run what is missing, then write the report; `run` may be left out
    #[command(after_help = "Examples:
  seedbed study run scenarios/team_size.ron --quick                               few runs, to try it
  seedbed study run scenarios/team_size.ron --jobs 8")]
    Run(RunArgs),
    /// List all runs with their indices and states (finished, running, failed, interrupted, damaged, to run)
    #[command(after_help = "Example:
  seedbed study list scenarios/team_size.ron")]
    List(ListArgs),
    /// Print the number of runs that each confirmatory claim needs
    #[command(after_help = "Example:
  seedbed study power scenarios/team_size.ron")]
    Power(PowerArgs),
    /// Fix claims, cells and numbers of runs in STUDY.lock, from which run seeds are derived
    #[command(after_help = "Example:
  seedbed study register mine.ron && git add mine.ron.lock && seedbed study confirm mine.ron")]
    Register(RegisterArgs),
    /// Run what STUDY.lock registers, look by look, until all confirmatory claims are decided
    #[command(after_help = "Example:
  seedbed study confirm mine.ron --jobs 8")]
    Confirm(RunArgs),
    /// Repeat stored or published runs that are drawn at random, and check that results are bit-identical
    #[command(after_help = "Examples:
  seedbed study verify scenarios/thesis/fig_6_4a.ron                              ten stored runs
  seedbed study verify scenarios/thesis/*.ron --registered --runs 2%              2 % of the published runs
  seedbed study verify mine.ron --draw 2210193157                                 the same runs once more

Stored results are not changed. At least one run of each cell is repeated, unless `--any-cell` draws from all.")]
    Verify(VerifyArgs),
    /// Copy the stored runs of a study from other directories, such as those of other clusters
    #[command(after_help = "Example:
  seedbed study merge scenarios/thesis/fig_6_4a.ron --from ~/other_cluster/fig_6_4a

One run of each directory, drawn at random, is repeated before. If a file is damaged or results differ, nothing is copied.")]
    Merge(MergeArgs),
    /// Print a job script that executes a study as an array of shards and then writes the report
    #[command(after_help = "Example:
  seedbed study script scenarios/thesis/fig_6_4a.ron > fig.sbatch; sbatch fig.sbatch")]
    Script(ScriptArgs),
    /// Pack a registered study with its results, for others to check; the same as `seedbed submit`
    Submit(SubmitArgs),
}

/// Where the results of a study are, and of which version of it.
#[derive(Debug, Args)]
pub(super) struct PlaceArgs {
    /// Directory of the results [default: recordings/studies/<study>]
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Use the study's `quick` settings, in a separate directory
    #[arg(long)]
    pub(super) quick: bool,
}

/// As [`PlaceArgs`], for runs that may be registered.
#[derive(Debug, Args)]
pub(super) struct ResultsArgs {
    #[command(flatten)]
    pub(super) place: PlaceArgs,
    /// The runs that STUDY.lock registers
    #[arg(long, conflicts_with = "quick")]
    pub(super) registered: bool,
}

#[derive(Debug, Args)]
pub(super) struct RunArgs {
    /// Study files
    #[arg(required = true, value_name = "STUDY")]
    pub(super) studies: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) execution: ExecutionArgs,
    #[command(flatten)]
    pub(super) place: PlaceArgs,
    /// Execute only the run with this index, without a report; safe to use from many processes at
    /// once
    #[arg(long, value_name = "I")]
    pub(super) index: Option<usize>,
    /// Execute only the runs of shard I of N, counted from 0, without a report; safe to use from many
    /// processes at once. Shards have about equal work
    #[arg(
        long,
        value_name = "I/N",
        allow_hyphen_values = true,
        conflicts_with = "index"
    )]
    pub(super) shard: Option<Shard>,
}

#[derive(Debug, Args)]
pub(super) struct ListArgs {
    /// Study files
    #[arg(required = true, value_name = "STUDY")]
    pub(super) studies: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) results: ResultsArgs,
}

#[derive(Debug, Args)]
pub(super) struct PowerArgs {
    /// Study files
    #[arg(required = true, value_name = "STUDY")]
    pub(super) studies: Vec<PathBuf>,
    /// Directory of the results, which are not read
    #[arg(long, value_name = "DIR", hide = true)]
    pub(super) out: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct RegisterArgs {
    /// Study files
    #[arg(required = true, value_name = "STUDY")]
    pub(super) studies: Vec<PathBuf>,
    /// Directory with runs that were made before [default: recordings/studies/<study>]
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct VerifyArgs {
    /// Study files
    #[arg(required = true, value_name = "STUDY")]
    pub(super) studies: Vec<PathBuf>,
    /// Number of runs to repeat, or a share such as 2%
    #[arg(long, value_name = "N", default_value = "10")]
    pub(super) runs: Amount,
    /// Draw from the runs of all cells, instead of at least one of each: quick checks of large studies
    #[arg(long)]
    pub(super) any_cell: bool,
    /// Repeat the random choice of runs with this number [default: a new choice]
    #[arg(long, value_name = "NUMBER")]
    pub(super) draw: Option<u64>,
    #[command(flatten)]
    pub(super) results: ResultsArgs,
    #[command(flatten)]
    pub(super) execution: ExecutionArgs,
}

#[derive(Debug, Args)]
pub(super) struct MergeArgs {
    /// Study file
    #[arg(value_name = "STUDY")]
    pub(super) study: PathBuf,
    /// Directories with stored runs
    #[arg(long, value_name = "DIR", num_args = 1.., required = true)]
    pub(super) from: Vec<PathBuf>,
    /// Repeat no run before
    #[arg(long)]
    pub(super) unverified: bool,
    /// Repeat the random choice of runs with this number [default: a new choice]
    #[arg(long, value_name = "NUMBER")]
    pub(super) draw: Option<u64>,
    #[command(flatten)]
    pub(super) results: ResultsArgs,
    #[command(flatten)]
    pub(super) execution: ExecutionArgs,
}

#[derive(Debug, Args)]
pub(super) struct ScriptArgs {
    /// Study file
    #[arg(value_name = "STUDY")]
    pub(super) study: PathBuf,
    /// Scheduler of the cluster
    #[arg(long, value_enum, default_value_t = Scheduler::Slurm)]
    pub(super) scheduler: Scheduler,
    /// Maximum number of tasks: the `MaxArraySize` of the cluster
    #[arg(long, value_name = "N", default_value_t = 1001)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=4_000_001))]
    pub(super) max_tasks: u32,
    #[command(flatten)]
    pub(super) results: ResultsArgs,
    #[command(flatten)]
    pub(super) execution: ExecutionArgs,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed submit scenarios/thesis/fig_6_1.ron                    write recordings/submissions/fig_6_1-LOCK.zip
  seedbed submit scenarios/mine.ron --results results/mine --out mine.zip

  unzip mine.zip && cd mine-*                                    what others do with it: its README.md
  seedbed study verify scenarios/mine.ron --registered --runs 2% has the commands

The file has the study, its lock, its scenarios and tasks, one row per run, and what made them. It is written only if the results of
all runs are there and confirm what was registered.")]
pub(in crate::cli) struct SubmitArgs {
    /// Study file, which must be registered
    #[arg(value_name = "STUDY")]
    pub(super) study: PathBuf,
    /// Directory with runs or published results [default: that of the study, or else `results/STUDY` beside its file]
    #[arg(long, value_name = "DIR")]
    pub(super) results: Option<PathBuf>,
    /// Write the ZIP file here [default: recordings/submissions/STUDY-LOCK.zip]
    #[arg(long, value_name = "FILE")]
    pub(super) out: Option<PathBuf>,
}

/// Schedulers for which scripts are printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Scheduler {
    /// Slurm: a file for `sbatch`
    Slurm,
}

/// How many of the stored runs are repeated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Amount {
    /// A number of runs.
    Runs(usize),
    /// A share of the runs, from 0 to 1, but at least one run.
    Share(f64),
}

impl FromStr for Amount {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || "expected a number of runs from 1, or a share such as 2%".to_owned();
        let Some(percent) = text.strip_suffix('%') else {
            let runs = text.parse().ok().filter(|runs| *runs > 0);
            return runs.map(Self::Runs).ok_or_else(expected);
        };
        let percent: Option<f64> = percent.trim_end().parse().ok();
        let share = percent.filter(|percent| 0.0 < *percent && *percent <= 100.0);
        share
            .map(|percent| Self::Share(percent / 100.0))
            .ok_or_else(expected)
    }
}

impl Amount {
    /// Number of runs of `stored`.
    pub(super) fn of(self, stored: usize) -> usize {
        match self {
            Self::Runs(runs) => runs.min(stored),
            Self::Share(share) => {
                seedbed_input::numbers::share_of_count(share, stored).clamp(1, stored)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_are_runs_or_shares() {
        assert_eq!("10".parse(), Ok(Amount::Runs(10)));
        assert_eq!("2%".parse(), Ok(Amount::Share(0.02)));
        for text in ["0", "-1", "0%", "101%", "x", "1e9999%", ""] {
            assert!(text.parse::<Amount>().is_err(), "{text}");
        }
        assert_eq!(Amount::Runs(10).of(4), 4);
        assert_eq!(Amount::Share(0.02).of(3), 1);
        assert_eq!(Amount::Share(0.02).of(101), 3);
    }
}
