//! `seedbed export`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::progress::ReadCounter;
use super::{CliError, pluralize, print_warnings, warn_if_unverified};
use seedbed::export::{self, Content, ExportError, Format, tensorboard};
use seedbed::review::LoadedRun;
use seedbed::run::folder::run_folder;
use seedbed::run::policies;

#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("target").required(true).args(["to", "tensorboard"]))]
#[command(after_help = "Examples:
  seedbed export recordings/cartpole/seed-0 --to states.parquet
  seedbed export recordings/cartpole/seed-0 --to states.npz          numpy.load(\"states.npz\")[\"theta\"]
  seedbed export recordings/cartpole/seed-0 --to episodes.csv --content episodes
  seedbed export recordings/cartpole/seed-0 --tensorboard logs       tensorboard --logdir logs
  seedbed export recordings/lander --to run.rrd                      a run of another program, for the Rerun viewer
  seedbed export recordings/cartpole/seed-0 --to now.safetensors     networks of a run that may not have ended

A row of `states` has agent, episode, round and step, all observations, the action that the policy chose (before \
the actuator limits it), its reward, \
for agents with a bonus the intrinsic reward, and how its episode ended. The last state of an episode has no action and no reward: these cells \
are empty (CSV), null (Parquet) or NaN (NumPy). A value that was recorded as NaN is NaN in all formats.

Rows of `states` are sorted by agent, episode and step, those of `episodes` by round and agent, and those of `rounds` by \
round. Parquet files have the units of their columns in the metadata `units`. In CSV, names that a spreadsheet would take for a \
formula begin with an apostrophe. Curves of an earlier export to the same TensorBoard directory are removed.")]
pub(super) struct ExportArgs {
    /// Run directory, or a recording
    run: PathBuf,
    /// Write this file: .csv, .parquet or .npz; .rrd, a recording for the Rerun viewer, of a run that another
    /// program recorded; or .safetensors, the networks of the newest checkpoint
    #[arg(long, value_name = "FILE")]
    to: Option<PathBuf>,
    /// What the file contains
    #[arg(
        long,
        value_enum,
        default_value = "states",
        conflicts_with = "tensorboard"
    )]
    content: ContentArg,
    /// Write returns and metrics as event files of TensorBoard to this directory
    #[arg(long, value_name = "DIR")]
    tensorboard: Option<PathBuf>,
}

/// What a file contains.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ContentArg {
    /// One row per visited state, from the recording
    States,
    /// One row per episode
    Episodes,
    /// One row per update of an agent
    Rounds,
}

pub(super) fn export(args: &ExportArgs) -> Result<(), CliError> {
    let is_of_policies = |path: &&PathBuf| path.extension().is_some_and(|it| it == "safetensors");
    if let Some(path) = args.to.as_ref().filter(is_of_policies) {
        return export_policies(args, path);
    }
    let is_of_states = args.tensorboard.is_none() && args.content == ContentArg::States;
    let run = if is_of_states {
        LoadedRun::open(&args.run)?
    } else {
        LoadedRun::open_tables(&args.run)?
    };
    print_warnings(&run);
    match (&args.to, &args.tensorboard) {
        (Some(path), _) => export_file(&run, args, path),
        (None, Some(folder)) => export_events(&run, folder),
        (None, None) => unreachable!("one of both options is required"),
    }
}

fn export_file(run: &LoadedRun, args: &ExportArgs, path: &Path) -> Result<(), CliError> {
    if path.extension().is_some_and(|extension| extension == "rrd") {
        return export_recording(run, args, path);
    }
    let format = Format::of(path).ok_or_else(|| {
        CliError::Usage(format!(
            "--to {}: expected a file that ends in .csv, .parquet, .npz, .rrd or .safetensors",
            path.display()
        ))
    })?;
    let content = match args.content {
        ContentArg::States => Content::States,
        ContentArg::Episodes => Content::Episodes,
        ContentArg::Rounds => Content::Rounds,
    };
    let counter = ReadCounter::new("episodes read");
    let rows = export::export(run, content, format, path, &mut || counter.count())?;
    drop(counter);
    say!(
        "wrote {}: {}",
        path.display(),
        pluralize(rows as usize, "row")
    );
    Ok(())
}

fn export_policies(args: &ExportArgs, path: &Path) -> Result<(), CliError> {
    if args.content != ContentArg::States {
        let message = "--content: a file of networks (.safetensors) has no rows";
        return Err(CliError::Usage(message.to_owned()));
    }
    let folder = run_folder(&args.run);
    warn_if_unverified(&folder)?;
    let episodes = policies::write(&folder, path)?;
    let episodes = pluralize(episodes, "episode");
    say!(
        "wrote {}: networks after {episodes} per agent",
        path.display()
    );
    Ok(())
}

fn export_recording(run: &LoadedRun, args: &ExportArgs, path: &Path) -> Result<(), CliError> {
    if args.content != ContentArg::States {
        let message = "--content: a recording (.rrd) has everything; expected states, the default";
        return Err(CliError::Usage(message.to_owned()));
    }
    let counter = ReadCounter::new("episodes read");
    let states = export::export_recording(run, path, &mut || counter.count())?;
    drop(counter);
    say!(
        "wrote {0}: {1}; open it with\n  rerun {0}",
        path.display(),
        pluralize(states as usize, "state")
    );
    Ok(())
}

fn export_events(run: &LoadedRun, folder: &Path) -> Result<(), CliError> {
    if run.folder.is_none() {
        return Err(CliError::Usage(format!(
            "{} has no tables, from which curves are exported",
            run.path.display()
        )));
    }
    let values = tensorboard::export(run, folder).map_err(|error| {
        CliError::Runtime(format!("cannot write to {}: {error}", folder.display()))
    })?;
    say!(
        "wrote {}: {}; show them with\n  tensorboard --logdir {}",
        folder.display(),
        pluralize(values, "value"),
        folder.display()
    );
    Ok(())
}

impl From<ExportError> for CliError {
    fn from(error: ExportError) -> Self {
        match error {
            ExportError::Write { .. } | ExportError::Record(_) => Self::Runtime(error.to_string()),
            ExportError::Missing { .. }
            | ExportError::IsRecorded(_)
            | ExportError::Table(_)
            | ExportError::Recording(_) => Self::Usage(error.to_string()),
        }
    }
}
