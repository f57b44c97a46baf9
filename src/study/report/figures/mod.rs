//! Figures of a report, drawn from the runs of a study.

mod measures;
mod scaling;
mod visitation;

use rayon::prelude::*;

use self::measures::{groups, intervals, profiles, unsolved};
use self::scaling::{Differences, differences, scaling};
use self::visitation::visitation;
use super::ReportFigure;
use crate::experiment::measure::{Curve, trailing_means};
use crate::study::design::figure::Figure;
use crate::study::evaluate::results::{CellResults, Results};
use seedbed_figure::color::{AGENT_COLORS, TEAM_COLOR, agent_color, categorical_color};
use seedbed_figure::{Curves, Figure as Picture, Panel, Row, Series, Threshold};
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
    let window = if of.metric().is_cumulative { 1 } else { window };
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
    let agent_series = |(agent, returns): (u32, &Vec<f64>)| Series {
        name: match agent {
            0..AGENT_COLORS => format!("agent {agent}"),
            AGENT_COLORS => "other agents".to_owned(),
            _ => String::new(),
        },
        color: agent_color(agent),
        points: curve(returns),
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

fn capitalized(text: &str) -> String {
    let mut characters = text.chars();
    characters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(characters).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::run_result::RunResult;
    use crate::study::design::cell::CellDescription;

    fn constant_series(height: f64) -> Series {
        Series {
            points: vec![[0.0, 2.0], [1.0, height], [2.0, height]],
            ..Series::default()
        }
    }

    /// One run with the values 0.1, 0.2 and 0.6 of a curve after 10, 20 and 30 episodes.
    fn cell_with(curve: Curve) -> CellResults {
        let curves = Curve::WITH_ROUND_VALUES.iter().map(|other| {
            let values = if *other == curve {
                &[0.1, 0.2, 0.6][..]
            } else {
                &[]
            };
            values.to_vec()
        });
        let run = RunResult {
            episodes: vec![10, 20, 30],
            curves: curves.collect(),
            ..RunResult::default()
        };
        let mut cell = CellResults::without_runs(CellDescription {
            name: "cell".to_owned(),
            digest: String::new(),
            scenario: String::new(),
            overrides: Vec::new(),
            agents: 1,
            max_episodes: 30,
            task: String::new(),
            observations: Vec::new(),
            external: None,
        });
        cell.runs = vec![(0, run)];
        cell
    }

    /// A curve of what was measured in each round is averaged; one of everything so far has its own values,
    /// because an average would be of an earlier time.
    #[test]
    fn cumulative_curves_are_not_averaged() {
        for (curve, last, is_averaged) in [
            (Curve::TeamCoverage, 0.6, false),
            (Curve::Coverage, 0.6, false),
            (Curve::EffectiveAgents, 0.6, false),
            (Curve::FirstCoverage, 0.6, false),
            (Curve::VisitationEntropy, 0.6, false),
            (Curve::NewCoverage, 0.3, true),
            (Curve::ValueLoss, 0.3, true),
        ] {
            let cell = cell_with(curve);
            let figure = curves(&[&cell], curve, 25);
            let Panel::Curves(panel) = &figure.picture.rows[0].panels[0] else {
                panic!("{curve:?} has curves");
            };
            let [_, _, [episodes, value]] = panel.series[0].points[..] else {
                panic!("{curve:?} has three points");
            };
            assert!(
                episodes == 30.0 && (value - last).abs() < 1e-6,
                "{curve:?}: {value}"
            );
            assert_eq!(figure.caption.contains("moving average"), is_averaged);
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
