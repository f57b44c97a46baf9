//! `seedbed salvage`: takes what is whole out of damaged files.

use std::path::{Path, PathBuf};

use clap::Args;

use super::{CliError, pluralize};
use seedbed::salvage::{self, Fate, SalvagedFile};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed salvage recordings/cartpole/seed-0                     write recordings/cartpole/seed-0-salvaged
  seedbed salvage states/agent_0.states --out whole.states

Of files of visited states the whole episodes are kept, of recordings everything before the first damage, of studies \
the runs whose results are whole; all other files only if their checksums are right. If a list of checksums is damaged \
itself, or a recording has no damage that can be found, they are kept, too, but not verified. What is lost or not verified is printed. \
`seedbed study` repeats the runs that a study has lost, and `seedbed run` makes a run again from its scenario.")]
pub(super) struct SalvageArgs {
    /// Recording, file of visited states, directory of a run, or directory of a study
    #[arg(value_name = "PATH")]
    path: PathBuf,
    /// Write to this file or directory, which must not exist [default: PATH-salvaged]
    #[arg(long, value_name = "PATH")]
    out: Option<PathBuf>,
}

pub(super) fn salvage(args: &SalvageArgs) -> Result<(), CliError> {
    let from = &args.path;
    if !from.exists() {
        let message = format!("{}: no such file or directory", from.display());
        return Err(CliError::Usage(message));
    }
    let to = args.out.clone().unwrap_or_else(|| default_target(from));
    check_target(from, &to)?;
    let salvaged = salvage::salvage(from, &to)
        .map_err(|error| CliError::Runtime(format!("{}: {error}", to.display())))?;
    let count = |is: fn(&Fate) -> bool| salvaged.iter().filter(|file| is(&file.fate)).count();
    for file in &salvaged {
        print(file);
    }
    let kept = count(|fate| *fate == Fate::Kept);
    let cut = count(|fate| matches!(fate, Fate::Cut(_)));
    let unverified = count(|fate| matches!(fate, Fate::Unverified(_)));
    let lost = count(|fate| matches!(fate, Fate::Lost(_)));
    let more = if unverified > 0 {
        format!(", {unverified} not verified")
    } else {
        String::new()
    };
    say!(
        "salvaged   {} whole, {cut} in part, {lost} lost{more}",
        pluralize(kept, "file")
    );
    if kept + cut + unverified == 0 {
        let message = format!("nothing in {} is whole", from.display());
        return Err(CliError::Usage(message));
    }
    say!("written    {}", to.display());
    Ok(())
}

fn print(file: &SalvagedFile) {
    match &file.fate {
        Fate::Kept => {}
        Fate::Cut(what) => say!("in part    {}: {what}", file.path.display()),
        Fate::Unverified(why) => say!("unverified {}: {why}", file.path.display()),
        Fate::Lost(why) => say!("lost       {}: {why}", file.path.display()),
    }
}

/// Such as `seed-0-salvaged` and `run-salvaged.rrd`.
fn default_target(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let split = if path.is_dir() {
        None
    } else {
        name.split_once('.')
    };
    path.with_file_name(match split {
        Some((stem, extensions)) => format!("{stem}-salvaged.{extensions}"),
        None => format!("{name}-salvaged"),
    })
}

/// An error if the target exists or is within the source.
fn check_target(from: &Path, to: &Path) -> Result<(), CliError> {
    let message = if to.exists() || to.is_symlink() {
        "exists; expected a new file or directory with --out"
    } else if absolute(to).starts_with(absolute(from)) {
        "is in the damaged directory; expected another place with --out"
    } else {
        return Ok(());
    };
    Err(CliError::Usage(format!("{} {message}", to.display())))
}

fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}
