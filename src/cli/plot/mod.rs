//! `seedbed plot`: draws visited states and returns of one or more runs as a figure.

mod curves;
mod page;
mod states;

use std::ops::Range;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use self::page::PlotPage;
use super::progress::ReadCounter;
use super::{CliError, pluralize};
use crate::record::recording::Recording;
use crate::record::visitation::Axes;
use crate::run::files;
use crate::run::review::selection::{SelectedStates, StateSelection};
use crate::run::review::{LoadRunError, LoadedRun};
use seedbed_figure::Figure;

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed plot recordings/cartpole/seed-0           one page: visited states, density, returns
  seedbed plot recordings/cartpole/seed-0 --what visitation --agents 3 --episodes 0..50 --out agent3.png
                                                    states agent 3 visited in its first 50 episodes
  seedbed plot recordings/cartpole/seed-0 --what visitation --agents 3 --colour episode --axes x,theta
  seedbed plot results/sigma-0 results/sigma-0.1 results/sigma-1 --what visitation --out sigma.svg
                                                    several runs side by side
  seedbed plot recordings/cartpole/seed-0 --what scatter,returns --size 900x700 --out figure.svg

If every panel has at most --lines states, each state is drawn as a line. Otherwise all panels show densities \
on a common scale: the number of states per pixel or, with several panels, the share of the states of the \
panel. Use --colour to always draw single states, and --lines 0 to always draw densities.")]
pub(super) struct PlotArgs {
    /// Run directories or recordings; several are drawn side by side
    #[arg(required = true, value_name = "RUN")]
    runs: Vec<PathBuf>,
    /// Write the figure to FILE.svg or FILE.png [default: plot.svg in the run directory; with
    /// several runs, plot.svg in the current directory]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Draw these parts, one below the other; separate with commas [default:
    /// visitation,density,returns]
    #[arg(long, value_enum, value_delimiter = ',', value_name = "PART,PART…")]
    what: Vec<What>,
    /// Draw only these agents, e.g. 0,3 [default: the first 8, one panel each; with several runs,
    /// all agents in one panel per run]
    #[arg(long, value_delimiter = ',', value_name = "N,N…")]
    agents: Vec<u32>,
    /// Draw only states of these episodes of each agent, B excluded, e.g. 0..50, 150.. or ..50
    /// [default: all]
    #[arg(long, value_name = "A..B", value_parser = episodes)]
    episodes: Option<Range<u32>>,
    /// Draw only these axes, in this order, e.g. theta,x [default: all]
    #[arg(long, value_delimiter = ',', value_name = "NAME,NAME…")]
    axes: Vec<String>,
    /// Color states by this quantity; states are then drawn one by one
    #[arg(long = "colour", alias = "color", value_enum, value_name = "QUANTITY")]
    color_by: Option<ColorBy>,
    /// Maximum number of states that a panel draws one by one
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(0..=100_000))]
    lines: u32,
    /// Page size in CSS pixels, e.g. 760x900; a PNG is rendered at 2× [default: 760 wide, height
    /// fits the content]
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<[f64; 2]>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum What {
    /// Visited states as parallel coordinates: one axis per observation, one line per state
    Visitation,
    /// Visited states of all agents together, as a density
    Density,
    /// Returns over episodes
    Returns,
    /// Columns of rounds.csv: coverage, entropy, losses and others
    Curves,
    /// Visited states in the plane of each pair of axes
    Scatter,
    /// All of the above
    All,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ColorBy {
    /// The agent
    Agent,
    /// The number of the agent's episode
    Episode,
    /// The return of the episode
    Return,
    /// How the episode ended
    Outcome,
    /// The intrinsic reward of the action taken in the state
    IntrinsicReward,
}

/// Number of PNG pixels per CSS pixel, along each side.
const PNG_SCALE: f64 = 2.0;

/// Maximum number of agents with their own panels, unless `--agents` is given.
const MAX_AGENTS: u32 = 8;

/// A run with the selected states.
struct PlottedRun {
    /// Name of the run in the figure.
    label: String,
    review: LoadedRun,
    axes: Option<Axes>,
    states: Vec<SelectedStates>,
}

pub(super) fn plot(args: &PlotArgs) -> Result<(), CliError> {
    let out = args.out.clone().unwrap_or_else(|| default_out(&args.runs));
    let is_png = is_png(&out)?;
    let runs = read(args)?;
    let mut figure = PlotPage { args, runs: &runs }.figure()?;
    if let Some([width, height]) = args.size {
        figure.resize(width, height);
    }
    let bytes = if is_png {
        figure
            .png(PNG_SCALE)
            .map_err(|error| CliError::Usage(error.to_string()))?
    } else {
        figure.svg().into_bytes()
    };
    files::replace(&out, &bytes)
        .map_err(|error| CliError::Runtime(format!("cannot write {}: {error}", out.display())))?;
    say!("{}: {}", out.display(), size_text(&figure, is_png));
    Ok(())
}

fn size_text(figure: &Figure, is_png: bool) -> String {
    let panels = figure.rows.iter().map(|row| row.panels.len()).sum();
    let scale = if is_png { PNG_SCALE } else { 1.0 };
    let [width, height] = [figure.width, figure.height()].map(|side| (side * scale).round());
    format!("{}, {width} × {height} pixels", pluralize(panels, "panel"))
}

fn default_out(runs: &[PathBuf]) -> PathBuf {
    match runs {
        [run] if run.is_dir() => run.join("plot.svg"),
        [run] => run.with_extension("svg"),
        _ => PathBuf::from("plot.svg"),
    }
}

/// Whether the extension of the output file is `.png`; an error unless it is `.png` or `.svg`.
fn is_png(out: &Path) -> Result<bool, CliError> {
    match out.extension().and_then(|extension| extension.to_str()) {
        Some("svg") => Ok(false),
        Some("png") => Ok(true),
        _ => Err(CliError::Usage(format!(
            "--out {}: expected FILE.svg or FILE.png",
            out.display()
        ))),
    }
}

fn read(args: &PlotArgs) -> Result<Vec<PlottedRun>, CliError> {
    let counter = ReadCounter::new("episodes read");
    let mut runs: Vec<PlottedRun> = args
        .runs
        .iter()
        .map(|path| read_run(args, path, &counter))
        .collect::<Result<_, _>>()?;
    let names: Vec<String> = runs.iter().map(|run| run.label.clone()).collect();
    for run in &mut runs {
        // Runs with the same name are labeled with their paths.
        if names.iter().filter(|name| **name == run.label).count() > 1 {
            run.label = run.review.path.display().to_string();
        }
    }
    Ok(runs)
}

fn read_run(args: &PlotArgs, path: &Path, counter: &ReadCounter) -> Result<PlottedRun, CliError> {
    let mut review = LoadedRun::open(path)?;
    if review.folder.is_none() {
        review
            .compute_stats(|_| counter.count())
            .map_err(LoadRunError::from)?;
    }
    let agent_count = review.agents() as u32;
    if let Some(agent) = args.agents.iter().find(|agent| **agent >= agent_count) {
        let last = agent_count.saturating_sub(1);
        return Err(CliError::Usage(format!(
            "--agents: no agent {agent} in {}; expected 0 to {last}",
            path.display()
        )));
    }
    let axes = review.recording.as_ref().map(Recording::axes);
    let states = match (&review.recording, &axes) {
        (Some(recording), Some(axes)) if args.shows_states() => {
            let selection = args.selection(axes)?;
            selection
                .select(recording, |_| counter.count())
                .map_err(LoadRunError::from)?
        }
        _ => Vec::new(),
    };
    Ok(PlottedRun {
        label: review.name(),
        review,
        axes,
        states,
    })
}

impl PlotArgs {
    fn shows(&self, what: What) -> bool {
        let default_parts = [What::Visitation, What::Density, What::Returns];
        let parts = if self.what.is_empty() {
            &default_parts[..]
        } else {
            &self.what
        };
        parts.contains(&what) || parts.contains(&What::All)
    }

    fn shows_states(&self) -> bool {
        [What::Visitation, What::Density, What::Scatter]
            .into_iter()
            .any(|what| self.shows(what))
    }

    /// Indices of the selected axes.
    fn chosen_axes(&self, axes: &Axes) -> Result<Vec<usize>, CliError> {
        let names: Vec<&str> = axes
            .all()
            .iter()
            .map(|axis| axis.quantity.name.as_str())
            .collect();
        if self.axes.is_empty() {
            return Ok((0..names.len()).collect());
        }
        let axis_index = |name: &String| {
            let axis_index = names.iter().position(|axis_name| axis_name == name);
            axis_index.ok_or_else(|| {
                CliError::Usage(format!(
                    "--axes: no axis `{name}`; expected {}",
                    names.join(", ")
                ))
            })
        };
        let axis_indices: Vec<usize> =
            self.axes.iter().map(axis_index).collect::<Result<_, _>>()?;
        let has_enough_axes = if axis_indices.len() < 2 {
            Err(CliError::Usage(
                "--axes: expected at least two axes".to_owned(),
            ))
        } else {
            Ok(())
        };
        has_enough_axes.map(|()| axis_indices)
    }

    fn selection(&self, axes: &Axes) -> Result<StateSelection, CliError> {
        let axes = self.chosen_axes(axes)?;
        Ok(StateSelection {
            agents: self.agents.clone(),
            episodes: self.episodes.clone().unwrap_or(0..u32::MAX),
            sample: self.lines as usize,
            pairs: states::pairs(&axes),
            axes,
        })
    }
}

/// Parses a range of episodes, e.g. `0..50`, `150..` and `..50`.
fn episodes(text: &str) -> Result<Range<u32>, String> {
    let expected = "expected A..B, e.g. 0..50 for the first 50 episodes";
    let (from, to) = text.split_once("..").ok_or(expected)?;
    let number = |text: &str, default: u32| {
        if text.is_empty() {
            Ok(default)
        } else {
            text.parse().map_err(|_| expected)
        }
    };
    let range = number(from, 0)?..number(to, u32::MAX)?;
    if range.is_empty() {
        Err("the range is empty; expected A below B".to_owned())
    } else {
        Ok(range)
    }
}

/// Parses a size, e.g. `760x900`.
fn size(text: &str) -> Result<[f64; 2], String> {
    let expected = "expected WIDTHxHEIGHT, e.g. 760x900, each from 100 to 10000";
    let (width, height) = text.split_once(['x', '×']).ok_or(expected)?;
    let side = |text: &str| {
        text.parse::<f64>()
            .ok()
            .filter(|side| (100.0..=10_000.0).contains(side))
            .ok_or(expected)
    };
    Ok([side(width)?, side(height)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn episodes_are_ranges() {
        assert_eq!(
            (episodes("0..50"), episodes("..7"), episodes("9..")),
            (Ok(0..50), Ok(0..7), Ok(9..u32::MAX))
        );
        assert_eq!(
            episodes("5..5").unwrap_err(),
            "the range is empty; expected A below B"
        );
        assert!(episodes("five").unwrap_err().starts_with("expected A..B"));
    }

    #[test]
    fn sizes_have_two_sides() {
        assert_eq!(size("760x900"), Ok([760.0, 900.0]));
        assert!(size("760").is_err() && size("0x5").is_err() && size("1e9x500").is_err());
    }
}
