//! `seedbed plot`: where the agents of one run or of several went, and what they reached, as a figure.

mod curves;
mod page;
mod states;

use std::ops::Range;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use self::page::Picture;
use super::progress::Counter;
use super::{Failure, counted};
use crate::figure::Figure;
use crate::record::rerun::read::Recording;
use crate::record::visitation::Axes;
use crate::run::files;
use crate::run::review::selection::{PickedStates, Selection};
use crate::run::review::{Review, ReviewError};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed plot recordings/cartpole/seed-0                                 a page: visited states, density, returns
  seedbed plot recordings/cartpole/seed-0 --out where.png --what visitation --agents 3 --episodes 0..50
                                                                          which states did agent 3 visit in its first 50 episodes?
  seedbed plot recordings/cartpole/seed-0 --what visitation --agents 3 --colour episode --axes x,theta
  seedbed plot results/sigma-0 results/sigma-0.1 results/sigma-1 --what visitation --out sigma.svg
                                                                          runs side by side
  seedbed plot recordings/cartpole/seed-0 --what scatter,returns --size 900x700 --out figure.svg

Up to --lines states are drawn one by one; of more, how many pass each point is drawn, or of several panels which share of each panel's
states, on one scale for all.
With --colour, or with --lines 0 for densities, you choose.")]
pub(super) struct PlotArgs {
    /// Runs' folders, or recordings; several are drawn side by side
    #[arg(required = true, value_name = "RUN")]
    runs: Vec<PathBuf>,
    /// The figure: FILE.svg or FILE.png [default: plot.svg in the run's folder; plot.svg here for several runs]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// What to draw; several, one below the other, with commas between [default: visitation,density,returns]
    #[arg(long, value_enum, value_delimiter = ',', hide_default_value = true)]
    what: Vec<What>,
    /// Agents to draw, such as 0,3 [default: the first 8, one panel each; of several runs all, in one panel a run]
    #[arg(long, value_delimiter = ',', value_name = "N,N…")]
    agents: Vec<u32>,
    /// Episodes of each agent whose states are drawn, from the first to before the last: 0..50, 150.., ..50
    #[arg(long, value_name = "A..B", value_parser = episodes)]
    episodes: Option<Range<u32>>,
    /// Axes to draw, in their order, such as theta,x [default: all]
    #[arg(long, value_delimiter = ',', value_name = "NAME,NAME…")]
    axes: Vec<String>,
    /// What the colour of a state means; such states are drawn one by one
    #[arg(long, alias = "color", value_enum)]
    colour: Option<Colour>,
    /// States that a panel shows one by one
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(0..=100_000))]
    lines: u32,
    /// The page's size in CSS pixels, of which a PNG has 2 × 2 of its own for each, such as 760x900 [default: as it needs]
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<[f64; 2]>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum What {
    /// Parallel coordinates: one axis an observation, one line a state
    Visitation,
    /// The same for all agents together, as a density
    Density,
    /// Returns over episodes
    Returns,
    /// The columns of rounds.csv: coverage, entropy, losses and others
    Curves,
    /// Pairs of axes against each other
    Scatter,
    /// All of these
    All,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Colour {
    /// Who was there
    Agent,
    /// When: the agent's episode
    Episode,
    /// The return of the state's episode
    Return,
    /// How the state's episode ended
    Outcome,
    /// The bonus that the step from there earned
    IntrinsicReward,
}

/// A PNG has this many pixels along each CSS pixel.
const PNG_SCALE: f64 = 2.0;

/// Agents that have panels of their own if nobody chose any.
const MOST_AGENTS: u32 = 8;

/// A run with its wanted states.
struct Drawn {
    /// Tells the run from the others.
    label: String,
    review: Review,
    axes: Option<Axes>,
    states: Vec<PickedStates>,
}

pub(super) fn plot(args: &PlotArgs) -> Result<(), Failure> {
    let out = args.out.clone().unwrap_or_else(|| default_out(&args.runs));
    let is_png = kind(&out)?;
    let runs = read(args)?;
    let mut figure = Picture { args, runs: &runs }.figure()?;
    if let Some([width, height]) = args.size {
        figure.fit(width, height);
    }
    let bytes = if is_png {
        figure
            .png(PNG_SCALE)
            .map_err(|error| Failure::Input(error.to_string()))?
    } else {
        figure.svg().into_bytes()
    };
    files::replace(&out, &bytes)
        .map_err(|error| Failure::Work(format!("cannot write {}: {error}", out.display())))?;
    say!("{}: {}", out.display(), described(&figure, is_png));
    Ok(())
}

fn described(figure: &Figure, is_png: bool) -> String {
    let panels = figure.rows.iter().map(|row| row.panels.len()).sum();
    let scale = if is_png { PNG_SCALE } else { 1.0 };
    let [width, height] = [figure.width, figure.height()].map(|side| (side * scale).round());
    format!("{}, {width} × {height} pixels", counted(panels, "panel"))
}

fn default_out(runs: &[PathBuf]) -> PathBuf {
    match runs {
        [run] if run.is_dir() => run.join("plot.svg"),
        [run] => run.with_extension("svg"),
        _ => PathBuf::from("plot.svg"),
    }
}

/// Whether the figure is to be made of pixels.
fn kind(out: &Path) -> Result<bool, Failure> {
    match out.extension().and_then(|extension| extension.to_str()) {
        Some("svg") => Ok(false),
        Some("png") => Ok(true),
        _ => Err(Failure::Input(format!(
            "--out {}: a figure is FILE.svg or FILE.png",
            out.display()
        ))),
    }
}

fn read(args: &PlotArgs) -> Result<Vec<Drawn>, Failure> {
    let counter = Counter::new("episodes read");
    let mut runs: Vec<Drawn> = args
        .runs
        .iter()
        .map(|path| read_run(args, path, &counter))
        .collect::<Result<_, _>>()?;
    let names: Vec<String> = runs.iter().map(|run| run.label.clone()).collect();
    for run in &mut runs {
        // Runs of one name are told apart by their folders.
        if names.iter().filter(|name| **name == run.label).count() > 1 {
            run.label = run.review.path.display().to_string();
        }
    }
    Ok(runs)
}

fn read_run(args: &PlotArgs, path: &Path, counter: &Counter) -> Result<Drawn, Failure> {
    let mut review = Review::open(path)?;
    if review.folder.is_none() {
        review
            .survey(|_| counter.count())
            .map_err(ReviewError::from)?;
    }
    let known = review.agents() as u32;
    if let Some(agent) = args.agents.iter().find(|agent| **agent >= known) {
        let last = known.saturating_sub(1);
        return Err(Failure::Input(format!(
            "--agents: there is no agent {agent} in {}; they are 0 to {last}",
            path.display()
        )));
    }
    let axes = review.recording.as_ref().map(Recording::axes);
    let states = match (&review.recording, &axes) {
        (Some(recording), Some(axes)) if args.shows_states() => {
            let selection = args.selection(axes)?;
            selection
                .pick(recording, |_| counter.count())
                .map_err(ReviewError::from)?
        }
        _ => Vec::new(),
    };
    Ok(Drawn {
        label: review.name(),
        review,
        axes,
        states,
    })
}

impl PlotArgs {
    fn shows(&self, what: What) -> bool {
        let page = [What::Visitation, What::Density, What::Returns];
        let chosen = if self.what.is_empty() {
            &page[..]
        } else {
            &self.what
        };
        chosen.contains(&what) || chosen.contains(&What::All)
    }

    fn shows_states(&self) -> bool {
        [What::Visitation, What::Density, What::Scatter]
            .into_iter()
            .any(|what| self.shows(what))
    }

    /// The wanted axes, by their places among all.
    fn chosen_axes(&self, axes: &Axes) -> Result<Vec<usize>, Failure> {
        let names: Vec<&str> = axes
            .all()
            .iter()
            .map(|axis| axis.quantity.name.as_str())
            .collect();
        if self.axes.is_empty() {
            return Ok((0..names.len()).collect());
        }
        let place = |wanted: &String| {
            let place = names.iter().position(|name| name == wanted);
            place.ok_or_else(|| {
                Failure::Input(format!(
                    "--axes: there is no axis `{wanted}`; there are {}",
                    names.join(", ")
                ))
            })
        };
        let places: Vec<usize> = self.axes.iter().map(place).collect::<Result<_, _>>()?;
        let enough = if places.len() < 2 {
            Err(Failure::Input("--axes takes at least two axes".to_owned()))
        } else {
            Ok(())
        };
        enough.map(|()| places)
    }

    fn selection(&self, axes: &Axes) -> Result<Selection, Failure> {
        let chosen = self.chosen_axes(axes)?;
        Ok(Selection {
            agents: self.agents.clone(),
            episodes: self.episodes.clone().unwrap_or(0..u32::MAX),
            sample: self.lines as usize,
            pairs: states::pairs(&chosen),
            axes: chosen,
        })
    }
}

/// Such as `0..50`, `150..` and `..50`.
fn episodes(text: &str) -> Result<Range<u32>, String> {
    let expected = "expected A..B, such as 0..50 for the first fifty";
    let (from, to) = text.split_once("..").ok_or(expected)?;
    let number = |text: &str, open: u32| {
        if text.is_empty() {
            Ok(open)
        } else {
            text.parse().map_err(|_| expected)
        }
    };
    let range = number(from, 0)?..number(to, u32::MAX)?;
    if range.is_empty() {
        Err("no episode is in this range".to_owned())
    } else {
        Ok(range)
    }
}

/// Such as `760x900`.
fn size(text: &str) -> Result<[f64; 2], String> {
    let expected = "expected WIDTHxHEIGHT, such as 760x900, each from 100 to 10000";
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
        assert_eq!(episodes("5..5").unwrap_err(), "no episode is in this range");
        assert!(episodes("five").unwrap_err().starts_with("expected A..B"));
    }

    #[test]
    fn sizes_have_two_sides() {
        assert_eq!(size("760x900"), Ok([760.0, 900.0]));
        assert!(size("760").is_err() && size("0x5").is_err() && size("1e9x500").is_err());
    }
}
