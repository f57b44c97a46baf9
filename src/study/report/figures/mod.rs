//! Figures of a report, drawn from the runs of a study.

mod measures;

use rayon::prelude::*;

use self::measures::{groups, intervals, profiles, unsolved};
use super::ReportFigure;
use crate::plotting::axis;
use crate::record::BonusRange;
use crate::record::visitation::{Axes, Density, VisitedState};
use crate::study::figure::{EpisodeWindow, Figure};
use crate::study::measure::{Curve, moving_average, widened};
use crate::study::results::{CellResults, Results};
use seedbed_env::{Quantity, Spec};
use seedbed_figure::color::categorical_color;
use seedbed_figure::{
    Curves, DensityImage, Figure as Picture, Key, Panel, ParallelCoordinates, Row, Series, States,
    Threshold,
};
use seedbed_stats::aggregate::median;
use seedbed_stats::bootstrap::bootstrap_statistics;
use seedbed_stats::{Interval, MIN_RUNS};

/// Approximate number of places along a curve at which its band is computed.
const BAND_PLACES: usize = 50;

/// All figures of a study, except those without any finished run.
pub(super) fn draw(results: &Results) -> Vec<ReportFigure> {
    let drawn = results
        .study
        .figures
        .par_iter()
        .map(|figure| draw_figure(results, figure));
    let drawn: Vec<Option<Drawing>> = drawn.collect();
    let mut figures = Vec::new();
    for drawing in drawn.into_iter().flatten() {
        figures.push(drawing.numbered(figures.len() + 1));
    }
    figures
}

/// A figure before it has a number.
struct Drawing {
    kind: &'static str,
    title: String,
    caption: String,
    picture: Picture,
}

impl Drawing {
    fn numbered(self, number: usize) -> ReportFigure {
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

fn draw_figure(results: &Results, figure: &Figure) -> Option<Drawing> {
    let cells: Vec<&CellResults> = results
        .shown_by(figure)
        .into_iter()
        .filter(|cell| !cell.runs.is_empty())
        .collect();
    if cells.is_empty() {
        return None;
    }
    let main = results.study.main_measure();
    let drawing = match figure {
        Figure::Curves { of, window, .. } => curves(&cells, **of, window.get() as usize),
        Figure::Agents { window, .. } => agents(&cells, window.get() as usize),
        Figure::Visitation { episodes, .. } => visitation(&cells, episodes)?,
        Figure::Intervals { measure, over, .. } => intervals(
            &groups(&cells, over),
            measure.as_ref().map_or(main, |measure| **measure),
        ),
        Figure::Unsolved { .. } => unsolved(&cells),
        Figure::Profiles { measure, over, .. } => profiles(
            &groups(&cells, over),
            measure.as_ref().map_or(main, |measure| **measure),
        ),
    };
    let title = if figure.title().is_empty() {
        drawing.title
    } else {
        figure.title().to_owned()
    };
    Some(Drawing { title, ..drawing })
}

fn in_one_panel(curves: Curves) -> Picture {
    let row = Row {
        height: 360.0,
        panels: vec![Panel::Curves(curves)],
        key: None,
    };
    Picture {
        title: String::new(),
        description: String::new(),
        width: 760.0,
        rows: vec![row],
    }
}

/// Color of the cell with this number in a figure.
fn color(number: usize) -> [u8; 3] {
    categorical_color(COLORS[number % COLORS.len()] + 8 * (number / COLORS.len()) as u32)
}

/// Indices of agents' colors, starting with those that differ most.
const COLORS: [u32; 8] = [4, 5, 2, 6, 0, 1, 7, 3];

fn curves(cells: &[&CellResults], of: Curve, window: usize) -> Drawing {
    let series: Vec<Series> = cells
        .par_iter()
        .enumerate()
        .map(|(number, cell)| mean_curve(cell, of, window, number))
        .collect();
    let label = of.metric().label();
    let title = format!("{}, mean of all runs", capitalized(&label));
    let caption = format!(
        "{}{}, mean over runs{}. {}",
        capitalized(&label),
        if window > 1 {
            format!(", moving average over {window} values")
        } else {
            String::new()
        },
        if series.iter().any(|series| series.band.is_some()) {
            ", with 95 % bootstrap bands"
        } else {
            ""
        },
        ended_early(cells)
    );
    let y_logarithmic = are_far_apart(&series);
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
        legend: true,
        ..Curves::default()
    };
    Drawing {
        kind: "curves",
        title,
        caption: caption.trim().to_owned(),
        picture: in_one_panel(curves),
    }
}

/// Ratio between curves from which a linear axis would flatten the lower one.
const FAR_APART: f64 = 100.0;

/// Whether all values are above 0, and the medians of two curves differ by more than that ratio.
fn are_far_apart(series: &[Series]) -> bool {
    let heights = |series: &Series| {
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
        .chain(series.iter().flat_map(heights))
        .any(|value| value <= 0.0)
    {
        return false;
    }
    let medians = series
        .iter()
        .map(heights)
        .filter(|heights| !heights.is_empty())
        .map(|heights| median(&heights));
    let [low, high] = medians.fold([f64::INFINITY, 0.0], |[low, high], value| {
        [low.min(value), high.max(value)]
    });
    high > FAR_APART * low
}

/// Sentence about runs that ended earlier than others, if there are any.
fn ended_early(cells: &[&CellResults]) -> &'static str {
    let lengths = |cell: &&CellResults| {
        cell.runs
            .iter()
            .map(|(_, run)| run.episodes_per_agent())
            .collect::<Vec<_>>()
    };
    let uneven = cells
        .iter()
        .map(lengths)
        .any(|lengths| lengths.iter().min() != lengths.iter().max());
    if uneven {
        "Runs that ended early, for example by solving their task, keep their last value."
    } else {
        ""
    }
}

/// Return from which the task counts as solved, if it is the same for all runs.
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
        .map(|run| run.curve_episodes(of))
        .unwrap_or_default();
    let window = window.clamp(1, episodes.len().max(1));
    let mut smooth: Vec<Vec<f64>> = cell
        .runs
        .iter()
        .map(|(_, run)| moving_average(&run.curve(of), window))
        .collect();
    let length = smooth.iter().map(Vec::len).max().unwrap_or(0);
    smooth.retain(|run| !run.is_empty());
    for run in &mut smooth {
        run.resize(length, run.last().copied().unwrap_or_default());
    }
    let x = |place: usize| f64::from(episodes[place + window - 1]);
    let mean =
        |place: usize| smooth.iter().map(|run| run[place]).sum::<f64>() / smooth.len() as f64;
    let points = (0..length).map(|place| [x(place), mean(place)]).collect();
    let band = (smooth.len() >= MIN_RUNS).then(|| band(&smooth, x));
    Series {
        name: cell.about.name.clone(),
        color: color(number),
        points,
        band,
        ..Series::default()
    }
}

/// 95 % bootstrap intervals of the mean over runs.   `smooth: [runs][places]` → (x, low, high)
fn band(smooth: &[Vec<f64>], x: impl Fn(usize) -> f64) -> Vec<[f64; 3]> {
    let last = smooth[0].len() - 1;
    let parts = BAND_PLACES.min(last).max(1);
    let places: Vec<usize> = (0..=parts).map(|part| part * last / parts).collect();
    let runs: Vec<f64> = (0..smooth.len()).map(|run| run as f64).collect();
    let means = |redrawn: &[Vec<f64>], means: &mut [f64]| {
        for (mean, &place) in means.iter_mut().zip(&places) {
            *mean = redrawn[0]
                .iter()
                .map(|&run| smooth[run as usize][place])
                .sum::<f64>()
                / redrawn[0].len() as f64;
        }
    };
    let found = bootstrap_statistics(&[runs], places.len(), means);
    let known = |(place, interval): (&usize, Interval)| match interval {
        Interval::Known { low, high } => Some([x(*place), low, high]),
        Interval::TooFewRuns { .. } => None,
    };
    places
        .iter()
        .zip(found.into_iter().map(|estimate| estimate.interval))
        .filter_map(known)
        .collect()
}

fn agents(cells: &[&CellResults], window: usize) -> Drawing {
    let full: Vec<String> = cells.iter().map(|cell| cell.about.name.clone()).collect();
    let names = if full
        .iter()
        .all(|name| name.chars().count() <= MAX_PANEL_TITLE)
    {
        full
    } else {
        short_names(cells)
    };
    let panels: Vec<Curves> = cells
        .iter()
        .zip(names)
        .map(|(cell, name)| panel_of_agents(cell, name, window))
        .collect();
    let columns = panels.len().min(3);
    let (title, seed) = ("Single agents".to_owned(), cells[0].runs[0].0);
    let caption = format!(
        "Returns of each agent and their mean (black) in the run with seed {seed}, moving average over \
         {window} episodes."
    );
    Drawing {
        kind: "agents",
        title,
        caption,
        picture: Picture::from_curves("", "", panels, columns),
    }
}

/// Max number of letters of a cell's name that is a panel's title without being shortened.
const MAX_PANEL_TITLE: usize = 30;

fn panel_of_agents(cell: &CellResults, title: String, window: usize) -> Curves {
    let run = &cell.runs[0].1;
    let curve = |values: &[f64]| -> Vec<[f64; 2]> {
        let window = window.clamp(1, values.len().max(1));
        moving_average(values, window)
            .iter()
            .enumerate()
            .map(|(place, &mean)| [(place + window) as f64, mean])
            .collect()
    };
    let of_agent = |(agent, returns): (u32, &Vec<f32>)| Series {
        color: categorical_color(agent),
        points: curve(&widened(returns)),
        ..Series::default()
    };
    let mean = Series {
        color: [35, 35, 40],
        points: curve(&run.team_returns()),
        ..Series::default()
    };
    Curves {
        title,
        x_label: "episodes".to_owned(),
        y_label: "return".to_owned(),
        series: (0..)
            .zip(&run.returns)
            .map(of_agent)
            .chain([mean])
            .collect(),
        ..Curves::default()
    }
}

/// Names of cells for narrow panels, without the parts that all of them have.
fn short_names(cells: &[&CellResults]) -> Vec<String> {
    let words = |cell: &&CellResults| {
        cell.about
            .name
            .split(", ")
            .map(str::to_owned)
            .collect::<Vec<String>>()
    };
    let is_shared =
        |word: &String| cells.len() > 1 && cells.iter().all(|cell| words(cell).contains(word));
    let own = |cell| {
        words(cell)
            .into_iter()
            .filter(|word| !is_shared(word))
            .collect::<Vec<String>>()
            .join(", ")
    };
    cells
        .iter()
        .map(|cell| {
            Some(own(cell))
                .filter(|name| !name.is_empty())
                .unwrap_or(cell.about.name.clone())
        })
        .collect()
}

/// Width of panels that are side by side.
const PANEL_WIDTH: f64 = 300.0;

fn visitation(cells: &[&CellResults], windows: &[EpisodeWindow]) -> Option<Drawing> {
    let rows: Vec<Vec<Dense>> = windows.iter().map(|&upto| densities(cells, upto)).collect();
    let columns = rows
        .iter()
        .map(Vec::len)
        .max()
        .filter(|&columns| columns > 0)?;
    let seed = cells[0].runs[0].0;
    let caption = format!(
        "States visited in the run with seed {seed}: one axis per observation, one line per state; \
         darker where more lines cross. Each panel shows a uniform sample of at most \
         {} states of all agents{}.",
        crate::study::run_result::STATES,
        if windows.len() > 1 {
            "; rows show increasing parts of training"
        } else {
            ""
        }
    );
    let picture = Picture {
        title: String::new(),
        description: String::new(),
        width: PANEL_WIDTH * columns as f64 + 90.0,
        rows: rows
            .into_iter()
            .filter(|row| !row.is_empty())
            .map(row_of_densities)
            .collect(),
    };
    Some(Drawing {
        kind: "visitation",
        title: "Visited states".to_owned(),
        caption,
        picture,
    })
}

/// Density of the states of one cell, with a title and its axes.
struct Dense {
    title: String,
    axes: Vec<Quantity>,
    density: Density,
}

/// Densities of all cells whose states were kept.
fn densities(cells: &[&CellResults], upto: EpisodeWindow) -> Vec<Dense> {
    let of_cell = |(cell, name): (&&CellResults, String)| {
        let (visited, states) = cell.states(upto)?;
        let spec = spec(cell);
        let axes = axes(&spec);
        let mut density = Density::new(&axes);
        let mut fractions = Vec::new();
        for state in states.chunks_exact(spec.observation_width()) {
            axes.project(&VisitedState::state(0, state, 0.0), &mut fractions);
            density.add(&fractions);
        }
        let part = match upto {
            EpisodeWindow::First(episodes) if episodes.get() == 1 => "first episode".to_owned(),
            EpisodeWindow::First(episodes) => format!("first {} episodes", episodes.get()),
            EpisodeWindow::All => "all episodes".to_owned(),
        };
        let title = format!("{name}: {part}, {visited} states");
        Some(Dense {
            title,
            axes: axes
                .all()
                .iter()
                .map(|axis| axis.quantity.clone())
                .collect(),
            density,
        })
    };
    cells
        .iter()
        .zip(short_names(cells))
        .filter_map(of_cell)
        .collect()
}

fn row_of_densities(mut row: Vec<Dense>) -> Row {
    let drawn: Vec<Vec<u32>> = row
        .iter_mut()
        .map(|dense| dense.density.draw_all().clone())
        .collect();
    let most = drawn.iter().flatten().copied().max().unwrap_or(1).max(1);
    let panel = |(Dense { title, axes, .. }, pixels): (Dense, Vec<u32>)| {
        let width = pixels.len() / crate::record::visitation::HEIGHT;
        let states = States::Density(DensityImage {
            pixels,
            width,
            max_count: most,
        });
        Panel::ParallelCoordinates(ParallelCoordinates {
            title,
            axes: axes.iter().map(axis).collect(),
            states,
        })
    };
    let key = Some(Key::Counts {
        label: "lines".to_owned(),
        max_count: most,
    });
    Row {
        height: 250.0,
        panels: row.into_iter().zip(drawn).map(panel).collect(),
        key,
    }
}

fn axes(spec: &Spec) -> Axes {
    Axes::of_quantities(&spec.observations, spec.time_limit, BonusRange::None)
}

/// Description of a task as far as its axes need it.
fn spec(cell: &CellResults) -> Spec {
    let quantity = |(name, unit, range): &(String, String, [f32; 2])| Quantity {
        name: name.clone(),
        unit: unit.clone(),
        range: *range,
    };
    Spec {
        name: cell.about.task.clone(),
        description: String::new(),
        observations: cell.about.observations.iter().map(quantity).collect(),
        actions: Vec::new(),
        control_step: 1.0,
        time_limit: 1,
        reward_threshold: None,
    }
}

fn capitalized(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(height: f64) -> Series {
        Series {
            points: vec![[0.0, 2.0], [1.0, height], [2.0, height]],
            ..Series::default()
        }
    }

    /// The first value of each, 2, is not the median.
    #[test]
    fn curves_far_apart_have_a_logarithmic_axis() {
        assert!(are_far_apart(&[level(200.0), level(1.0)]));
        assert!(
            !are_far_apart(&[level(200.0), level(3.0)]),
            "all can be seen"
        );
        assert!(
            !are_far_apart(&[level(200.0), level(0.0)]),
            "0 has no logarithm"
        );
        let below = Series {
            band: Some(vec![[0.0, -1.0, 3.0]]),
            ..level(1.0)
        };
        assert!(!are_far_apart(&[level(200.0), below]));
        assert!(!are_far_apart(&[]));
    }
}
