//! `seedbed plot`: draws visited states and returns of one or more runs, or example distributions,
//! as a figure.

use std::ops::Range;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::print::PrintArgs;
use super::progress::ReadCounter;
use super::{CliError, open_run, pluralize};
use seedbed::figures::{
    DEFAULT_WIDTH, FigureError, FigureSettings, Over, Part, RunFigure, distributions,
};
use seedbed::run::folder::run_folder;
use seedbed::scenario::recording;
use seedbed::storage::files;
use seedbed_figure::{Figure, Format, Panel, PrintLayout};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed plot recordings/cartpole/seed-0           one page: visited states, density, returns
  seedbed plot recordings/cartpole/seed-0 --what visitation --agents 3 --episodes 0..50 --out agent3.png
                                                    states agent 3 visited in its first 50 episodes
  seedbed plot recordings/cartpole/seed-0 --what visitation --agents 3 --color episode --axes x,theta
  seedbed plot recordings/cartpole/seed-0 --what visitation --where theta=0.1.. --where return=..100
  seedbed plot results/sigma-0 results/sigma-0.1 results/sigma-1 --what visitation --out sigma.svg
                                                    several runs side by side
  seedbed plot recordings/cartpole/seed-0 --what scatter,returns --size 900x700 --out figure.svg
  seedbed plot recordings/cartpole/seed-0 --what returns --width 8.4cm --height 5cm --font 8pt --no-title --out returns.pdf
                                                    for a column of a paper, with embedded fonts
  seedbed plot recordings/cartpole/seed-0 --what returns --over env-steps --log x --theme talk --out talk.png
  seedbed plot --distributions --out examples.svg   how parallel coordinates show seven distributions
  seedbed plot --distributions ring,parabola --out two.png

If every panel has at most --lines states, each state is drawn as a line. Otherwise all panels show densities \
on a common scale: the number of states per bin or, with several panels, the share of the states of the \
panel. Use --color to always draw single states, and --lines 0 to always draw densities.")]
pub(super) struct PlotArgs {
    /// Run directories or recordings; several are drawn side by side
    #[arg(required_unless_present = "distributions", value_name = "RUN")]
    runs: Vec<PathBuf>,
    /// Write the figure to FILE.svg, FILE.pdf or FILE.png [default: plot.svg in the run directory;
    /// with several runs, plot.svg in the current directory]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Draw these parts, one below the other in this order; separate with commas [default: scatter of two axes,
    /// visitation, difference, density, returns; without a recording returns and curves]
    #[arg(long, value_enum, value_delimiter = ',', value_name = "PART,PART…")]
    what: Vec<PlotPart>,
    /// Draw only these agents, e.g. 0,3 or 0..4, 4 excluded [default: the first 8, one panel each; with several
    /// runs, all agents in one panel per run]
    #[arg(
        help_heading = "Which states, and how",
        long,
        value_delimiter = ',',
        value_name = "N,N…",
        value_parser = parse_agents
    )]
    agents: Vec<Range<u32>>,
    /// Draw only states of these episodes of each agent, B excluded, e.g. 0..50, 150.. or ..50
    /// [default: all]
    #[arg(help_heading = "Which states, and how", long, value_name = "A..B", value_parser = parse_episodes)]
    episodes: Option<Range<u32>>,
    /// Draw only states in this range of an observation, an action, reward, step, return or another
    /// quantity, e.g. theta=-0.1..0.2 or return=150..; can be repeated. If several have a name, write
    /// its kind as well, e.g. action:x=0..
    #[arg(
        help_heading = "Which states, and how",
        long = "where",
        value_name = "NAME=LOW..HIGH"
    )]
    conditions: Vec<String>,
    /// Draw only these axes, in this order, e.g. theta,x [default: all]
    #[arg(
        help_heading = "Which states, and how",
        long,
        value_delimiter = ',',
        value_name = "NAME,NAME…"
    )]
    axes: Vec<String>,
    /// Color states by this quantity; states are then drawn one by one
    #[arg(
        help_heading = "Which states, and how",
        long = "color",
        alias = "colour",
        value_enum,
        value_name = "QUANTITY"
    )]
    color_by: Option<ColorBy>,
    /// Draw returns and curves over this quantity
    #[arg(long, value_enum, value_name = "QUANTITY", default_value = "episodes")]
    over: PlotOver,
    /// Maximum number of states that a panel draws one by one
    #[arg(help_heading = "Which states, and how", long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(0..=100_000))]
    lines: u32,
    /// Page size in CSS pixels, e.g. 760x900; a PNG is rendered at 2× [default: 760 wide, height
    /// fits the content]
    #[arg(long, value_name = "WxH", value_parser = parse_size, conflicts_with_all = ["width", "height", "font"])]
    size: Option<[f64; 2]>,
    #[command(flatten, next_help_heading = "For papers and talks")]
    print: PrintArgs,
    /// Instead of runs, draw 80 points of these example distributions, each as parallel coordinates
    /// and as a scatter plot [default: all]
    #[arg(
        long,
        value_enum,
        num_args = 0..,
        value_delimiter = ',',
        value_name = "NAME,NAME…",
        conflicts_with_all = ["runs", "what", "agents", "episodes", "conditions", "axes", "color_by", "lines", "over"]
    )]
    distributions: Option<Vec<Distribution>>,
}

/// A part of the page that can be selected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PlotPart {
    /// Visited states as parallel coordinates: one axis per observation, one line per state
    Visitation,
    /// Visited states of all agents together, as a density
    Density,
    /// Difference of each agent from the team: where its share of states is above (orange) or below
    /// (blue) that of all agents; with several runs, of each run from the first; with two --axes, as a map
    Difference,
    /// Returns over episodes
    Returns,
    /// Columns of rounds.csv: coverage, entropy, losses and others
    Curves,
    /// Visited states in the plane of each pair of axes, or of neighboring axes if there are more than five; with two --axes,
    /// one panel per agent
    Scatter,
    /// All of the above
    All,
}

/// The quantity that determines the color of a state.
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

/// What returns and curves are drawn over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PlotOver {
    /// Episodes of each agent, and rounds
    Episodes,
    /// Environment steps of the whole team
    EnvSteps,
}

/// An example distribution of two quantities.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Distribution {
    /// Independent standard normal x and y
    Normal,
    /// Standard normal x and y with correlation 0.95
    PositiveCorrelation,
    /// Standard normal x and y with correlation -0.95
    NegativeCorrelation,
    /// Uniform in the square from -2 to 2
    Square,
    /// Two normal clusters around (-1.5, -1.5) and (1.5, 1.5), standard deviation 0.35
    Clusters,
    /// Uniform angle on a circle of radius 2, normal radius with standard deviation 0.1
    Ring,
    /// Uniform x from -2 to 2, y = x² - 2 plus normal noise with standard deviation 0.1
    Parabola,
}

pub(super) fn plot(args: &PlotArgs) -> Result<(), CliError> {
    let out = args.out.clone().unwrap_or_else(|| default_out(&args.runs));
    let format = format_of(&out)?;
    let layout = args.print.layout()?;
    let mut figure = if let Some(names) = &args.distributions {
        let chosen: Vec<_> = names.iter().map(|&name| name.into()).collect();
        distributions::figure(&chosen)
    } else {
        figure_of_runs(args, &layout)?
    };
    if panel_count(&figure) == 0 {
        let message = "nothing is drawn: these runs have nothing for the chosen panels";
        return Err(CliError::Usage(message.to_owned()));
    }
    let drawn = figure.width * layout.scale();
    layout.apply(&mut figure, drawn);
    if let Some([width, height]) = args.size {
        figure.resize(width, height);
    }
    check_height(&figure)?;
    let bytes = layout
        .encode(&figure, format)
        .map_err(|error| CliError::Usage(error.to_string()))?;
    files::remove_abandoned_of(&out);
    files::write_to(&out, &bytes)
        .map_err(|error| CliError::Runtime(format!("cannot write {}: {error}", out.display())))?;
    let size = size_text(&figure, &layout, format);
    say!("{}: {size}", out.display());
    Ok(())
}

/// Refuses a page on which panels would have no room.
fn check_height(figure: &Figure) -> Result<(), CliError> {
    const MIN_ROW_HEIGHT: f64 = 70.0;
    let heights = || figure.rows_of_panels().map(|row| row.height);
    let lowest = heights().fold(f64::INFINITY, f64::min);
    if lowest >= MIN_ROW_HEIGHT {
        return Ok(());
    }
    let rows = pluralize(heights().count(), "row");
    let message = format!(
        "the page is too low for {rows} of panels; choose a larger height, or fewer parts with --what, e.g. --what returns"
    );
    Err(CliError::Usage(message))
}

/// What the command prints about the figure.
fn size_text(figure: &Figure, layout: &PrintLayout, format: Format) -> String {
    let sides = [figure.width, figure.height()].map(|side| side * layout.scale() / 96.0);
    let panels = pluralize(panel_count(figure), "panel");
    if layout.width.is_some() || format == Format::Pdf {
        let [width, height] = sides.map(|inches| inches * 2.54);
        return format!("{panels}, {width:.1} × {height:.1} cm");
    }
    let resolution = if format == Format::Png {
        layout.resolution()
    } else {
        96.0
    };
    let [width, height] = sides.map(|inches| (inches * resolution).round());
    format!("{panels}, {width} × {height} pixels")
}

fn panel_count(figure: &Figure) -> usize {
    let panels = figure.rows_of_panels().flat_map(|row| &row.panels);
    panels.filter(|panel| **panel != Panel::Blank).count()
}

fn default_out(runs: &[PathBuf]) -> PathBuf {
    match runs {
        [run] if run.is_dir() => run_folder(run).plot_file(),
        [run] => run.with_extension("svg"),
        _ => PathBuf::from("plot.svg"),
    }
}

/// The format that the extension of the output file names.
fn format_of(out: &Path) -> Result<Format, CliError> {
    match out.extension().and_then(|extension| extension.to_str()) {
        Some("svg") => Ok(Format::Svg),
        Some("png") => Ok(Format::Png),
        Some("pdf") => Ok(Format::Pdf),
        _ => Err(CliError::Usage(format!(
            "--out {}: expected FILE.svg, FILE.pdf or FILE.png",
            out.display()
        ))),
    }
}

/// Reads and draws the runs.
fn figure_of_runs(args: &PlotArgs, layout: &PrintLayout) -> Result<Figure, CliError> {
    let opened = args.runs.iter().map(|path| open_run(path));
    let opened = opened.collect::<Result<Vec<_>, _>>()?;
    let counter = ReadCounter::new("episodes read");
    let figure = RunFigure::read(args.settings(layout), opened, &mut || counter.count());
    let drawn = figure.and_then(|figure| figure.draw());
    let (figure, notes) = drawn.map_err(usage_error)?;
    for text in notes {
        note!("note: {text}");
    }
    Ok(figure)
}

/// The error with the options that it is about.
fn usage_error(error: FigureError) -> CliError {
    let reason = error.to_string();
    CliError::Usage(match error {
        FigureError::NotRecorded(_) => {
            format!("{reason}; use --what returns,curves, which needs only the tables")
        }
        FigureError::OtherAxes(_) => {
            format!("{reason}, or only what has no axes: --what returns,curves")
        }
        FigureError::NoAgent { .. } => format!("--agents: {reason}"),
        FigureError::NoAxis { .. } | FigureError::TooFewAxes => format!("--axes: {reason}"),
        FigureError::Condition { .. } => format!("--where {reason}"),
        FigureError::NoEpisodes(run) => format!(
            "{} has no finished episodes, or none that match --agents and --episodes",
            run.display()
        ),
        FigureError::NoStates(run) => {
            format!("{} has no states that meet --where", run.display())
        }
        FigureError::NoRounds(_) => format!("{reason}, which --what curves needs"),
        FigureError::NoTeam(_) => format!("--what difference: {reason}"),
        FigureError::NoBonus(_) => format!("--color intrinsic-reward: {reason}"),
        FigureError::Run(_) => reason,
    })
}

impl PlotArgs {
    fn settings(&self, layout: &PrintLayout) -> FigureSettings {
        FigureSettings {
            parts: self.what.iter().map(|&part| part.into()).collect(),
            agents: agents_in(&self.agents),
            episodes: self.episodes.clone(),
            conditions: self.conditions.clone(),
            axes: self.axes.clone(),
            color_by: self.color_by.map(Into::into),
            over: match self.over {
                PlotOver::Episodes => Over::Episodes,
                PlotOver::EnvSteps => Over::EnvSteps,
            },
            max_lines: self.lines,
            width: self
                .size
                .map_or(layout.width_within(DEFAULT_WIDTH), |[width, _]| width),
            height: self
                .size
                .map(|[_, height]| height)
                .or(layout.height.map(|height| height / layout.scale())),
        }
    }
}

impl From<PlotPart> for Part {
    fn from(part: PlotPart) -> Self {
        match part {
            PlotPart::Visitation => Self::Visitation,
            PlotPart::Density => Self::Density,
            PlotPart::Difference => Self::Difference,
            PlotPart::Returns => Self::Returns,
            PlotPart::Curves => Self::Curves,
            PlotPart::Scatter => Self::Scatter,
            PlotPart::All => Self::All,
        }
    }
}

impl From<ColorBy> for recording::ColorBy {
    fn from(color_by: ColorBy) -> Self {
        match color_by {
            ColorBy::Agent => Self::Agent,
            ColorBy::Episode => Self::Episode,
            ColorBy::Return => Self::Return,
            ColorBy::Outcome => Self::Outcome,
            ColorBy::IntrinsicReward => Self::IntrinsicReward,
        }
    }
}

impl From<Distribution> for distributions::Distribution {
    fn from(distribution: Distribution) -> Self {
        match distribution {
            Distribution::Normal => Self::Normal,
            Distribution::PositiveCorrelation => Self::PositiveCorrelation,
            Distribution::NegativeCorrelation => Self::NegativeCorrelation,
            Distribution::Square => Self::Square,
            Distribution::Clusters => Self::Clusters,
            Distribution::Ring => Self::Ring,
            Distribution::Parabola => Self::Parabola,
        }
    }
}

/// Parses an agent or a range of agents, e.g. `3` and `0..4`.
pub(super) fn parse_agents(text: &str) -> Result<Range<u32>, String> {
    let expected = "expected an agent, e.g. 3, or A..B, e.g. 0..4 for the first 4 agents";
    let parse = |text: &str| {
        text.parse::<u32>()
            .ok()
            .filter(|agent| *agent <= 1_000_000)
            .ok_or(expected)
    };
    let Some((from, to)) = text.split_once("..") else {
        let agent = parse(text)?;
        return Ok(agent..agent + 1);
    };
    not_empty(parse(from)?..parse(to)?)
}

/// All agents of the given ranges.
pub(super) fn agents_in(ranges: &[Range<u32>]) -> Vec<u32> {
    ranges.iter().cloned().flatten().collect()
}

fn not_empty(range: Range<u32>) -> Result<Range<u32>, String> {
    if range.is_empty() {
        return Err("the range is empty; expected A below B".to_owned());
    }
    Ok(range)
}

/// Parses a range of episodes, e.g. `0..50`, `150..` and `..50`.
pub(super) fn parse_episodes(text: &str) -> Result<Range<u32>, String> {
    let expected = "expected A..B, e.g. 0..50 for the first 50 episodes";
    let (from, to) = text.split_once("..").ok_or(expected)?;
    let parse_end = |text: &str, default: u32| {
        if text.is_empty() {
            Ok(default)
        } else {
            text.parse().map_err(|_| expected)
        }
    };
    not_empty(parse_end(from, 0)?..parse_end(to, u32::MAX)?)
}

/// Parses a size, e.g. `760x900`.
fn parse_size(text: &str) -> Result<[f64; 2], String> {
    let expected = "expected WIDTHxHEIGHT, e.g. 760x900, each from 100 to 10000";
    let (width, height) = text.split_once(['x', '×']).ok_or(expected)?;
    let parse_side = |text: &str| {
        text.parse::<f64>()
            .ok()
            .filter(|side| (100.0..=10_000.0).contains(side))
            .ok_or(expected)
    };
    Ok([parse_side(width)?, parse_side(height)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agents_are_parsed_as_numbers_and_ranges() {
        assert_eq!(
            (parse_agents("3"), parse_agents("0..4")),
            (Ok(3..4), Ok(0..4))
        );
        assert_eq!(
            parse_agents("4..4").unwrap_err(),
            "the range is empty; expected A below B"
        );
        for wrong in ["0-3", "a", "", "2..", "..2", "-1", "0..4000000000"] {
            assert!(
                parse_agents(wrong)
                    .unwrap_err()
                    .starts_with("expected an agent"),
                "{wrong}"
            );
        }
    }

    #[test]
    fn episodes_are_parsed_as_a_range_with_optional_ends() {
        assert_eq!(
            (
                parse_episodes("0..50"),
                parse_episodes("..7"),
                parse_episodes("9..")
            ),
            (Ok(0..50), Ok(0..7), Ok(9..u32::MAX))
        );
        assert_eq!(
            parse_episodes("5..5").unwrap_err(),
            "the range is empty; expected A below B"
        );
        assert!(
            parse_episodes("five")
                .unwrap_err()
                .starts_with("expected A..B")
        );
    }

    #[test]
    fn sizes_are_parsed_as_width_and_height() {
        assert_eq!(parse_size("760x900"), Ok([760.0, 900.0]));
        assert!(
            parse_size("760").is_err()
                && parse_size("0x5").is_err()
                && parse_size("1e9x500").is_err()
        );
    }
}
