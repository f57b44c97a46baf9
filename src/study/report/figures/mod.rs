//! Figures of a report, drawn from the runs of a study.

mod measures;
mod scaling;

use rayon::prelude::*;

use self::measures::{groups, intervals, profiles, unsolved};
use self::scaling::{Differences, differences, scaling};
use super::ReportFigure;
use crate::plotting::axis_with_outside;
use crate::record::BonusRange;
use crate::record::visitation::{Axes, Density, VisitedState};
use crate::study::figure::{EpisodeWindow, Figure};
use crate::study::measure::{Curve, to_f64, trailing_means};
use crate::study::results::{CellResults, Results};
use crate::study::run_result::VisitedStates;
use crate::text::pluralize;
use seedbed_env::TaskSpec;
use seedbed_figure::color::{AGENT_COLORS, TEAM_COLOR, agent_color, categorical_color};
use seedbed_figure::{
    Curves, DensityImage, DifferenceImage, Figure as Picture, Key, Panel, ParallelCoordinates, Row,
    Series, States, Threshold,
};
use seedbed_stats::aggregate::median;
use seedbed_stats::bootstrap::bootstrap_means;
use seedbed_stats::{Interval, MIN_RUNS};

/// Approximate number of points of a curve at which its band is computed.
const BAND_POINTS: usize = 50;

/// Draws all figures of a study, except figures whose cells have no finished runs.
pub(super) fn draw(results: &Results) -> Vec<ReportFigure> {
    let drawings = results
        .study
        .figures
        .par_iter()
        .map(|figure| draw_figure(results, figure));
    let drawings: Vec<Option<UnnumberedFigure>> = drawings.collect();
    let mut figures = Vec::new();
    for drawing in drawings.into_iter().flatten() {
        figures.push(drawing.with_number(figures.len() + 1));
    }
    figures
}

/// A drawn figure without its number in the report.
struct UnnumberedFigure {
    kind: &'static str,
    title: String,
    caption: String,
    picture: Picture,
}

impl UnnumberedFigure {
    fn with_number(self, number: usize) -> ReportFigure {
        let picture = Picture {
            title: self.title.clone(),
            description: self.caption.clone(),
            ..self.picture
        };
        ReportFigure {
            name: format!("{number}-{}", self.kind),
            title: self.title,
            caption: self.caption,
            picture,
        }
    }
}

fn draw_figure(results: &Results, figure: &Figure) -> Option<UnnumberedFigure> {
    let cells: Vec<&CellResults> = results
        .cells_of_figure(figure)
        .into_iter()
        .filter(|cell| !cell.runs.is_empty())
        .collect();
    if cells.is_empty() {
        return None;
    }
    let main_measure = results.study.main_measure();
    let drawing = match figure {
        Figure::Curves { of, window, .. } => curves(&cells, **of, window.get() as usize),
        Figure::Agents { window, .. } => agents(&cells, window.get() as usize),
        Figure::Visitation { episodes, .. } => visitation(&cells, episodes)?,
        Figure::Intervals { measure, over, .. } => intervals(
            &groups(&cells, over),
            measure.as_ref().map_or(main_measure, |measure| **measure),
        ),
        Figure::Unsolved { .. } => unsolved(&cells),
        Figure::Profiles { measure, over, .. } => profiles(
            &groups(&cells, over),
            measure.as_ref().map_or(main_measure, |measure| **measure),
        ),
        Figure::Scaling { measure, .. } => {
            let measure = measure.as_ref().map_or(main_measure, |measure| **measure);
            scaling(results, &cells, measure)
        }
        Figure::Differences {
            measure,
            compare,
            columns,
            rows,
            ..
        } => {
            let measure = measure.as_ref().map_or(main_measure, |measure| **measure);
            let compared = Differences {
                compare: [&compare.0, &compare.1],
                columns,
                rows,
            };
            differences(results, &cells, measure, &compared)?
        }
    };
    let title = if figure.title().is_empty() {
        drawing.title
    } else {
        figure.title().to_owned()
    };
    Some(UnnumberedFigure { title, ..drawing })
}

fn picture_of_curves(curves: Curves) -> Picture {
    picture_of_one_panel(360.0, Panel::Curves(curves))
}

fn picture_of_one_panel(height: f64, panel: Panel) -> Picture {
    let row = Row {
        height,
        panels: vec![panel],
        key: None,
    };
    Picture {
        title: String::new(),
        description: String::new(),
        width: 760.0,
        rows: vec![row],
    }
}

/// Color of a cell, by the number of the cell in its figure.
fn color(number: usize) -> [u8; 3] {
    categorical_color(
        COLOR_INDICES[number % COLOR_INDICES.len()] + 8 * (number / COLOR_INDICES.len()) as u32,
    )
}

/// Indices of categorical colors, in an order in which the first ones differ most.
const COLOR_INDICES: [u32; 8] = [4, 5, 2, 6, 0, 1, 7, 3];

fn curves(cells: &[&CellResults], of: Curve, window: usize) -> UnnumberedFigure {
    let series: Vec<Series> = cells
        .par_iter()
        .enumerate()
        .map(|(number, cell)| mean_curve(cell, of, window, number))
        .collect();
    let label = of.metric().label();
    let title = format!("{}, mean of all runs", capitalized(&label));
    let has_bands = series.iter().any(|series| series.band.is_some());
    let caption = caption_of_curves(cells, &label, window, has_bands);
    let y_logarithmic = differ_by_orders_of_magnitude(&series);
    let curves = Curves {
        x_label: "episodes of each agent".to_owned(),
        y_label: format!("{label}{}", if y_logarithmic { " (log scale)" } else { "" }),
        y_logarithmic,
        thresholds: if of == Curve::Return {
            thresholds(cells)
        } else {
            Vec::new()
        },
        series,
        has_legend: true,
        ..Curves::default()
    };
    UnnumberedFigure {
        kind: "curves",
        title,
        caption,
        picture: picture_of_curves(curves),
    }
}

fn caption_of_curves(
    cells: &[&CellResults],
    label: &str,
    window: usize,
    has_bands: bool,
) -> String {
    let caption = format!(
        "{}{}, mean over runs{}. {}",
        capitalized(label),
        if window > 1 {
            format!(", moving average over {window} values or, at the beginning, all values so far")
        } else {
            String::new()
        },
        if has_bands {
            ", with 95 % bootstrap bands"
        } else {
            ""
        },
        sentence_about_early_ends(cells)
    );
    caption.trim().to_owned()
}

/// Maximum ratio between the medians of two curves on a linear axis. With a larger ratio, the lower
/// curve would look flat.
const MAX_RATIO_ON_LINEAR_AXIS: f64 = 100.0;

/// Whether the medians of two curves differ by more than the factor [`MAX_RATIO_ON_LINEAR_AXIS`],
/// and all values are above 0.
fn differ_by_orders_of_magnitude(series: &[Series]) -> bool {
    let y_values = |series: &Series| {
        series
            .points
            .iter()
            .map(|point| point[1])
            .collect::<Vec<f64>>()
    };
    let bands = series
        .iter()
        .flat_map(|series| series.band.iter().flatten().map(|band| band[1]));
    if bands
        .chain(series.iter().flat_map(y_values))
        .any(|value| value <= 0.0)
    {
        return false;
    }
    let medians = series
        .iter()
        .map(y_values)
        .filter(|y_values| !y_values.is_empty())
        .map(|y_values| median(&y_values));
    let [low, high] = medians.fold([f64::INFINITY, 0.0], |[low, high], value| {
        [low.min(value), high.max(value)]
    });
    high > MAX_RATIO_ON_LINEAR_AXIS * low
}

/// Sentence for the caption if some runs ended earlier than others; otherwise empty.
fn sentence_about_early_ends(cells: &[&CellResults]) -> &'static str {
    let lengths = |cell: &&CellResults| {
        cell.runs
            .iter()
            .map(|(_, run)| run.episodes_per_agent())
            .collect::<Vec<_>>()
    };
    let lengths_differ = cells
        .iter()
        .map(lengths)
        .any(|lengths| lengths.iter().min() != lengths.iter().max());
    if lengths_differ {
        "Runs that ended early, for example by solving their task, keep their last value."
    } else {
        ""
    }
}

/// Line at the return at which the task counts as solved; empty unless this return is equal for all
/// runs.
fn thresholds(cells: &[&CellResults]) -> Vec<Threshold> {
    let mut values: Vec<f64> = cells
        .iter()
        .flat_map(|cell| &cell.runs)
        .filter_map(|(_, run)| Some(run.threshold?.0))
        .collect();
    values.dedup();
    let [value] = values[..] else {
        return Vec::new();
    };
    vec![Threshold {
        name: "solved".to_owned(),
        value,
    }]
}

fn mean_curve(cell: &CellResults, of: Curve, window: usize, number: usize) -> Series {
    let longest = cell
        .runs
        .iter()
        .map(|(_, run)| run)
        .max_by_key(|run| run.curve(of).len());
    let episodes = longest
        .map(|run| run.episodes_of_curve(of))
        .unwrap_or_default();
    let mut moving_averages: Vec<Vec<f64>> = cell
        .runs
        .iter()
        .map(|(_, run)| trailing_means(&run.curve(of), window))
        .collect();
    let length = moving_averages.iter().map(Vec::len).max().unwrap_or(0);
    moving_averages.retain(|run| !run.is_empty());
    for run in &mut moving_averages {
        run.resize(length, run.last().copied().unwrap_or_default());
    }
    let x = |position: usize| f64::from(episodes[position]);
    let mean = |position: usize| {
        moving_averages.iter().map(|run| run[position]).sum::<f64>() / moving_averages.len() as f64
    };
    let points = (0..length)
        .map(|position| [x(position), mean(position)])
        .collect();
    let band = (moving_averages.len() >= MIN_RUNS).then(|| band(&moving_averages, x));
    Series {
        name: cell.description.name.clone(),
        color: color(number),
        points,
        band,
        ..Series::default()
    }
}

/// 95 % bootstrap intervals of the mean over runs.   `moving_averages: [runs][positions]` → (x,
/// low, high)
fn band(moving_averages: &[Vec<f64>], x: impl Fn(usize) -> f64) -> Vec<[f64; 3]> {
    let last = moving_averages[0].len() - 1;
    let sections = BAND_POINTS.min(last).max(1);
    let positions: Vec<usize> = (0..=sections)
        .map(|section| section * last / sections)
        .collect();
    let values_of_run =
        |run: &Vec<f64>| -> Vec<f64> { positions.iter().map(|&position| run[position]).collect() };
    let runs: Vec<Vec<f64>> = moving_averages.iter().map(values_of_run).collect();
    let estimates = bootstrap_means(&runs);
    let band_point = |(position, interval): (&usize, Interval)| match interval {
        Interval::Known { low, high } => Some([x(*position), low, high]),
        Interval::TooFewRuns { .. } => None,
    };
    positions
        .iter()
        .zip(estimates.into_iter().map(|estimate| estimate.interval))
        .filter_map(band_point)
        .collect()
}

fn agents(cells: &[&CellResults], window: usize) -> UnnumberedFigure {
    let full_names: Vec<String> = cells
        .iter()
        .map(|cell| cell.description.name.clone())
        .collect();
    let names = if full_names
        .iter()
        .all(|name| name.chars().count() <= MAX_PANEL_TITLE)
    {
        full_names
    } else {
        names_without_common_parts(cells)
    };
    let mut panels: Vec<Curves> = cells
        .iter()
        .zip(names)
        .map(|(cell, name)| panel_of_agents(cell, name, window))
        .collect();
    if let Some(last) = panels.last_mut() {
        last.has_legend = true;
    }
    let columns = panels.len().min(3);
    let (title, seed) = ("Single agents".to_owned(), cells[0].runs[0].0);
    let caption = format!(
        "Returns of each agent and their mean (black) in the run with seed {seed}, moving average over \
         {window} episodes or, at the beginning, all episodes so far."
    );
    UnnumberedFigure {
        kind: "agents",
        title,
        caption,
        picture: Picture::from_curves("", "", panels, columns),
    }
}

/// Maximum number of characters of the name of a cell that is used as the title of a panel without
/// shortening.
const MAX_PANEL_TITLE: usize = 30;

fn panel_of_agents(cell: &CellResults, title: String, window: usize) -> Curves {
    let run = &cell.runs[0].1;
    let curve = |values: &[f64]| -> Vec<[f64; 2]> {
        let means = trailing_means(values, window);
        (1..)
            .map(f64::from)
            .zip(means)
            .map(<[f64; 2]>::from)
            .collect()
    };
    let agent_series = |(agent, returns): (u32, &Vec<f32>)| Series {
        name: match agent {
            0..AGENT_COLORS => format!("agent {agent}"),
            AGENT_COLORS => "other agents".to_owned(),
            _ => String::new(),
        },
        color: agent_color(agent),
        points: curve(&to_f64(returns)),
        ..Series::default()
    };
    let mean = Series {
        name: "mean of all agents".to_owned(),
        color: TEAM_COLOR,
        points: curve(&run.team_returns()),
        ..Series::default()
    };
    Curves {
        title,
        x_label: "episodes".to_owned(),
        y_label: "return".to_owned(),
        series: (0..)
            .zip(&run.returns)
            .map(agent_series)
            .chain([mean])
            .collect(),
        ..Curves::default()
    }
}

/// Names of cells for narrow panels, without the parts that all names have in common.
fn names_without_common_parts(cells: &[&CellResults]) -> Vec<String> {
    let name_parts = |cell: &&CellResults| {
        cell.description
            .name
            .split(", ")
            .map(str::to_owned)
            .collect::<Vec<String>>()
    };
    let is_in_all_names =
        |part: &String| cells.len() > 1 && cells.iter().all(|cell| name_parts(cell).contains(part));
    let distinct_parts = |cell| {
        name_parts(cell)
            .into_iter()
            .filter(|part| !is_in_all_names(part))
            .collect::<Vec<String>>()
            .join(", ")
    };
    cells
        .iter()
        .map(|cell| {
            Some(distinct_parts(cell))
                .filter(|name| !name.is_empty())
                .unwrap_or(cell.description.name.clone())
        })
        .collect()
}

/// Width of panels of visited states, in CSS pixels.
const PANEL_WIDTH: f64 = 300.0;

fn visitation(cells: &[&CellResults], windows: &[EpisodeWindow]) -> Option<UnnumberedFigure> {
    let rows: Vec<Vec<CellDensity>> = windows
        .iter()
        .map(|&window| densities(cells, window))
        .filter(|row| !row.is_empty())
        .collect();
    let columns = rows.iter().map(Vec::len).max()?;
    let caption = format!(
        "States visited in all runs: one axis per observation, one line per state; darker where more lines cross. Panels show \
         shares of the states of their cell on one scale, from a uniform sample of each run, weighted by its number of \
         states{}.{}",
        if windows.len() > 1 {
            "; rows show increasing parts of training"
        } else {
            ""
        },
        if columns > 1 {
            " Below: where the share of a cell is above (orange) or below (blue) that of the first cell."
        } else {
            ""
        }
    );
    let scale = ShareScale::of(rows.iter().flatten());
    let mut picture_rows = Vec::new();
    for row in rows {
        let differences = (row.len() > 1).then(|| row_of_differences(&row));
        picture_rows.push(row_of_densities(row, &scale));
        picture_rows.extend(differences);
    }
    let picture = Picture {
        title: String::new(),
        description: String::new(),
        width: PANEL_WIDTH * columns as f64 + 90.0,
        rows: picture_rows,
    };
    Some(UnnumberedFigure {
        kind: "visitation",
        title: "Visited states".to_owned(),
        caption,
        picture,
    })
}

/// Visited states of one cell.
struct CellDensity {
    name: String,
    title: String,
    axes: Axes,
    /// Shares of states below and above the range of each axis: `[axes]`
    outside: Vec<[f64; 2]>,
    /// Share of the states whose lines cross each pixel: `[height × width]`.
    shares: Vec<f64>,
}

impl CellDensity {
    fn new(name: String, title: String, spec: &TaskSpec) -> Self {
        let axes = axes(spec);
        Self {
            name,
            title,
            outside: vec![[0.0; 2]; axes.all().len()],
            shares: Vec::new(),
            axes,
        }
    }

    /// Adds the sampled states of a run, which have a share of the `visited` states of all runs.
    fn add_run(&mut self, states: &VisitedStates, visited: u64) {
        let sampled = states.visits.len().max(1);
        let weight = states.visited as f64 / sampled as f64 / visited as f64;
        let mut density = Density::new(&self.axes);
        let mut axis_positions = Vec::new();
        let mut outside = vec![[0; 2]; self.outside.len()];
        for state in states
            .states
            .chunks_exact((states.states.len() / sampled).max(1))
        {
            let state = VisitedState::without_action(0, state, 0.0);
            self.axes.project(&state, &mut axis_positions);
            self.axes.count_outside(&state, &mut outside);
            density.add(&axis_positions);
        }
        for (shares, counts) in self.outside.iter_mut().zip(outside) {
            for (share, count) in shares.iter_mut().zip(counts) {
                *share += weight * count as f64;
            }
        }
        let lines = density.draw_all();
        self.shares.resize(lines.len(), 0.0);
        for (share, lines) in self.shares.iter_mut().zip(lines) {
            *share += weight * f64::from(*lines);
        }
    }

    fn panel(&self, title: String, states: States) -> Panel {
        Panel::ParallelCoordinates(ParallelCoordinates {
            title,
            axes: self
                .axes
                .all()
                .iter()
                .zip(&self.outside)
                .map(|(axis, &outside)| axis_with_outside(&axis.quantity, outside))
                .collect(),
            states,
        })
    }

    fn width(&self) -> usize {
        self.shares.len() / crate::record::visitation::AXIS_HEIGHT
    }
}

/// Visited states of all cells for which they were stored.
fn densities(cells: &[&CellResults], window: EpisodeWindow) -> Vec<CellDensity> {
    let names = names_without_common_parts(cells);
    let mut densities = Vec::new();
    for (cell, name) in cells.iter().zip(names) {
        let runs = cell.states(window);
        let visited: u64 = runs.iter().map(|(_, states)| states.visited).sum();
        if visited == 0 {
            continue;
        }
        let title = format!(
            "{name}: {}, {} states of {}",
            episodes_text(window),
            indicatif::HumanCount(visited),
            pluralize(runs.len(), "run")
        );
        let mut density = CellDensity::new(name, title, &spec(cell));
        for (_, states) in &runs {
            density.add_run(states, visited);
        }
        densities.push(density);
    }
    densities
}

fn episodes_text(window: EpisodeWindow) -> String {
    match window {
        EpisodeWindow::First(episodes) if episodes.get() == 1 => "first episode".to_owned(),
        EpisodeWindow::First(episodes) => format!("first {} episodes", episodes.get()),
        EpisodeWindow::All => "all episodes".to_owned(),
    }
}

/// One logarithmic scale of shares for all panels: from the smallest share of any pixel, which is
/// counted as 1, to the largest.
struct ShareScale {
    smallest: f64,
    largest: f64,
}

impl ShareScale {
    fn of<'a>(cells: impl Iterator<Item = &'a CellDensity>) -> Self {
        let mut scale = Self {
            smallest: 1.0,
            largest: 0.0,
        };
        for &share in cells.flat_map(|cell| &cell.shares) {
            scale.largest = share.max(scale.largest);
            if share > 0.0 {
                scale.smallest = share.min(scale.smallest);
            }
        }
        scale
    }

    fn count(&self, share: f64) -> u32 {
        (share / self.smallest).round() as u32
    }

    fn key(&self) -> Key {
        Key::Shares {
            label: "share of states per pixel".to_owned(),
            max_count: self.count(self.largest).max(1),
            total: (1.0 / self.smallest).round() as u64,
        }
    }
}

fn row_of_densities(row: Vec<CellDensity>, scale: &ShareScale) -> Row {
    let panel = |cell: CellDensity| {
        let states = States::Density(DensityImage {
            pixels: cell
                .shares
                .iter()
                .map(|&share| scale.count(share))
                .collect(),
            width: cell.width(),
            max_count: scale.count(scale.largest).max(1),
        });
        cell.panel(cell.title.clone(), states)
    };
    Row {
        height: 250.0,
        panels: row.into_iter().map(panel).collect(),
        key: Some(scale.key()),
    }
}

/// Differences of all cells but the first from the first.
fn row_of_differences(row: &[CellDensity]) -> Row {
    let first = &row[0];
    let difference = |cell: &CellDensity| -> Vec<f64> {
        let pairs = cell.shares.iter().zip(&first.shares);
        pairs.map(|(share, of_first)| share - of_first).collect()
    };
    let comparable = |cell: &&CellDensity| cell.shares.len() == first.shares.len();
    let compared: Vec<(&CellDensity, Vec<f64>)> = row[1..]
        .iter()
        .filter(comparable)
        .map(|cell| (cell, difference(cell)))
        .collect();
    let all = compared.iter().flat_map(|(_, differences)| differences);
    let max = all.fold(0.0_f64, |max, difference| max.max(difference.abs()));
    let scaled = |difference: &f64| {
        let root = (difference.abs() / max.max(f64::MIN_POSITIVE)).sqrt();
        root.copysign(*difference) as f32
    };
    let panel = |(cell, differences): &(&CellDensity, Vec<f64>)| {
        let states = States::Difference(DifferenceImage {
            pixels: differences.iter().map(scaled).collect(),
            width: cell.width(),
        });
        cell.panel(format!("{} − {}", cell.name, first.name), states)
    };
    let mut panels = vec![Panel::Blank];
    panels.extend(compared.iter().map(panel));
    panels.resize(row.len(), Panel::Blank);
    Row {
        height: 250.0,
        panels,
        key: Some(Key::Differences {
            label: "difference of shares, √ scale".to_owned(),
            max,
        }),
    }
}

fn axes(spec: &TaskSpec) -> Axes {
    Axes::of_quantities(&spec.observations, spec.time_limit, BonusRange::None)
}

/// Specification of a task, with the fields that its axes need.
fn spec(cell: &CellResults) -> TaskSpec {
    TaskSpec {
        name: cell.description.task.clone(),
        description: String::new(),
        observations: cell.observations(),
        actions: Vec::new(),
        control_step: 1.0,
        time_limit: 1,
        reward_threshold: None,
    }
}

fn capitalized(text: &str) -> String {
    let mut characters = text.chars();
    characters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(characters).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn constant_series(height: f64) -> Series {
        Series {
            points: vec![[0.0, 2.0], [1.0, height], [2.0, height]],
            ..Series::default()
        }
    }

    /// Each curve has a constant value after its first point, and the first point does not change
    /// the median.
    #[test]
    fn curves_that_differ_by_orders_of_magnitude_have_a_logarithmic_axis() {
        assert!(differ_by_orders_of_magnitude(&[
            constant_series(200.0),
            constant_series(1.0)
        ]));
        assert!(
            !differ_by_orders_of_magnitude(&[constant_series(200.0), constant_series(3.0)]),
            "both curves are visible on a linear axis"
        );
        assert!(
            !differ_by_orders_of_magnitude(&[constant_series(200.0), constant_series(0.0)]),
            "0 has no logarithm"
        );
        let band_below_zero = Series {
            band: Some(vec![[0.0, -1.0, 3.0]]),
            ..constant_series(1.0)
        };
        assert!(!differ_by_orders_of_magnitude(&[
            constant_series(200.0),
            band_below_zero
        ]));
        assert!(!differ_by_orders_of_magnitude(&[]));
    }
}
