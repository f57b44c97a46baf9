//! `seedbed explore`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::progress::ReadCounter;
use super::{CliError, open_run, pluralize};
use seedbed::explore::{DEFAULT_MAX_STATES, ExploreError, Explorer};
use seedbed::review::LoadedRun;
use seedbed::storage::files;

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed explore recordings/cartpole                     write recordings/cartpole/seed-0/explore.html
  seedbed explore recordings/cartpole --open              and show it in the browser
  seedbed explore recordings/four recordings/sixteen --out compare.html
                                                          two runs side by side under the same brushes
  seedbed explore recordings/cartpole/seed-0/run.rrd --all

The page needs no network and no program but a browser. Drag along an axis to select states; choose agents, episodes \
and colors above. The address after # holds the selection, so that it can be linked to. Runs in progress are shown as \
far as they have been written.")]
pub(super) struct ExploreArgs {
    /// Run directories or recordings
    #[arg(required = true, value_name = "RUN")]
    runs: Vec<PathBuf>,
    /// Write the page to FILE.html [default: explore.html in the run directory; with several runs,
    /// explore.html in the current directory]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Maximum number of states per run; of more, a sample that is spread over the run
    #[arg(long, value_name = "N", default_value_t = DEFAULT_MAX_STATES, value_parser = clap::value_parser!(u64).range(1..=20_000_000))]
    states: u64,
    /// Keep all states
    #[arg(long, conflicts_with = "states")]
    all: bool,
    /// Open the page in the browser
    #[arg(long)]
    open: bool,
}

pub(super) fn explore(args: &ExploreArgs) -> Result<(), CliError> {
    let mut runs = Vec::with_capacity(args.runs.len());
    for path in &args.runs {
        runs.push((path.clone(), open_run(path)?));
    }
    let out = args.out.clone().unwrap_or_else(|| default_out(&runs));
    let max_states = if args.all { u64::MAX } else { args.states };
    let counter = ReadCounter::new("episodes read");
    let explorer = Explorer::read(&runs, max_states, &mut || counter.count())?;
    drop(counter);
    let page = explorer.page();
    files::remove_abandoned_of(&out);
    files::write_to(&out, page.as_bytes())
        .map_err(|error| CliError::Runtime(format!("cannot write {}: {error}", out.display())))?;
    say!(
        "wrote {}: {}",
        out.display(),
        contents(&explorer, page.len())
    );
    if explorer.state_counts()[1] == 0 {
        note!("warning: no episode has ended yet, so that there are no states to show");
    }
    if args.open {
        open_in_browser(&out)?;
    }
    Ok(())
}

fn default_out(runs: &[(PathBuf, LoadedRun)]) -> PathBuf {
    match runs {
        [(_, run)] => match &run.folder {
            Some(folder) => folder.page_file(),
            None => run.path.with_extension("html"),
        },
        _ => PathBuf::from("explore.html"),
    }
}

/// What is in a page, such as `200,000 of 1,000,000 states, 2.1 MB`.
fn contents(explorer: &Explorer, bytes: usize) -> String {
    let [kept, all] = explorer.state_counts();
    let size = indicatif::BinaryBytes(bytes as u64);
    let states = pluralize(all as usize, "state");
    if kept < all {
        format!("a sample of {kept} of {states} (--all keeps all), {size}")
    } else {
        format!("{states}, {size}")
    }
}

/// Opens a file with the program that the system uses for it.
fn open_in_browser(page: &Path) -> Result<(), CliError> {
    let opener = if cfg!(target_os = "macos") {
        "open"
    } else {
        "xdg-open"
    };
    let status = std::process::Command::new(opener).arg(page).status();
    match status {
        Ok(status) if status.success() => Ok(()),
        _ => Err(CliError::Runtime(format!(
            "cannot open a browser with {opener}; open {} yourself",
            page.display()
        ))),
    }
}

impl From<ExploreError> for CliError {
    fn from(error: ExploreError) -> Self {
        Self::Usage(error.to_string())
    }
}
