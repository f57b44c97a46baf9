//! Figures over the sizes of teams, and over two axes of a grid.

use rayon::prelude::*;

use super::{UnnumberedFigure, capitalized};
use crate::experiment::measure::Measure;
use crate::study::design::file::has_part;
use crate::study::evaluate::comparison::Samples;
use crate::study::evaluate::results::{CellResults, Results, default_horizon};
use crate::study::evaluate::rules::Quantity;
use crate::study::evaluate::scaling::{Method, best_single_agent, methods, replace_part, values};
use seedbed_figure::color::series_color;
use seedbed_figure::{Curves, Figure as Picture, GridNumber, NumberGrid, Panel, Row, Series};
use seedbed_stats::aggregate::mean;
use seedbed_stats::ratios::mean_with_log_interval;
use seedbed_stats::{Estimate, Interval};

/// Gray of the line of perfect efficiency.
const REFERENCE_COLOR: [u8; 3] = [120, 120, 130];

/// Panels in one row of the figure.
const PANELS_PER_ROW: usize = 2;

/// The mean of a measure over the number of agents, one panel per task.
pub(super) fn scaling(
    results: &Results,
    cells: &[&CellResults],
    measure: Measure,
) -> UnnumberedFigure {
    let mut tasks: Vec<&str> = cells
        .iter()
        .map(|cell| cell.description.task.as_str())
        .collect();
    tasks.sort_unstable();
    tasks.dedup();
    let panel = |task: &&str| {
        let of_task = cells.iter().filter(|cell| cell.description.task == **task);
        task_panel(results, &of_task.copied().collect::<Vec<_>>(), measure)
    };
    let mut panels: Vec<Curves> = tasks.iter().map(panel).collect();
    panels.sort_by(|one, other| one.title.cmp(&other.title));
    let caption = format!(
        "{}, mean over runs with 95 % intervals, over the number of agents K. The gray line is that of \
         the best single agent divided by K: on it, K agents are K times as good.",
        capitalized(&measure.title())
    );
    UnnumberedFigure {
        kind: "scaling",
        title: format!(
            "{} over the size of the team",
            capitalized(&measure.title())
        ),
        picture: picture(&panels),
        caption,
    }
}

fn picture(panels: &[Curves]) -> Picture {
    let rows = panels.chunks(PANELS_PER_ROW).map(|curves| Row {
        height: 330.0,
        panels: curves
            .iter()
            .cloned()
            .map(Panel::Curves)
            .chain((curves.len()..PANELS_PER_ROW.min(panels.len())).map(|_| Panel::Blank))
            .collect(),
        key: None,
    });
    Picture {
        title: String::new(),
        description: String::new(),
        width: 960.0,
        rows: rows.collect(),
    }
}

fn task_panel(results: &Results, cells: &[&CellResults], measure: Measure) -> Curves {
    let methods = methods(cells);
    let title = common_parts(&methods);
    let series = |(number, method): (usize, &Method<'_>)| Series {
        name: without_parts(&method.name, &title),
        color: series_color(number),
        ..mean_over_sizes(results, method, measure)
    };
    let reference = cells
        .first()
        .map(|cell| perfect_efficiency(results, cell, cells, measure));
    let series: Vec<Series> = reference
        .into_iter()
        .flatten()
        .chain(methods.iter().enumerate().map(series))
        .collect();
    Curves {
        x_label: "agents K".to_owned(),
        y_label: format!("{} (log scale)", measure.title()),
        x_ticks: size_ticks(cells),
        series,
        y_logarithmic: true,
        has_legend: true,
        title,
        ..Curves::default()
    }
}

/// Positions of the sizes of teams on the axis, ln K, with the sizes as labels.
fn size_ticks(cells: &[&CellResults]) -> Vec<(f64, String)> {
    let mut sizes: Vec<u32> = cells.iter().map(|cell| cell.description.agents).collect();
    sizes.sort_unstable();
    sizes.dedup();
    let tick = |size: u32| (position(size), size.to_string());
    sizes.into_iter().map(tick).collect()
}

fn position(agents: u32) -> f64 {
    f64::from(agents).ln()
}

fn mean_over_sizes(results: &Results, method: &Method<'_>, measure: Measure) -> Series {
    let mut cells = method.cells.clone();
    cells.sort_by_key(|cell| cell.description.agents);
    let estimates = cells.iter().filter_map(|cell| {
        let values = values(results, cell, measure);
        let mean = (!values.is_empty()).then(|| mean_with_log_interval(&values));
        Some((position(cell.description.agents), mean??))
    });
    let estimates: Vec<(f64, Estimate)> = estimates.collect();
    let band = estimates.iter().filter_map(|(x, estimate)| {
        let [low, high] = estimate.interval.ends()?;
        Some([*x, low, high])
    });
    let band: Vec<[f64; 3]> = band.collect();
    Series {
        points: estimates.iter().map(|(x, mean)| [*x, mean.value]).collect(),
        band: (band.len() > 1).then_some(band),
        ..Series::default()
    }
}

/// m*(1) / K; `None` without a single agent in the task.
fn perfect_efficiency(
    results: &Results,
    cell: &CellResults,
    cells: &[&CellResults],
    measure: Measure,
) -> Option<Series> {
    let alone = mean(&values(
        results,
        best_single_agent(results, cell, measure)?,
        measure,
    ));
    let agents = || cells.iter().map(|cell| cell.description.agents);
    let ends = [agents().min()?, agents().max()?];
    (alone > 0.0).then(|| Series {
        name: "best single agent / K".to_owned(),
        color: REFERENCE_COLOR,
        points: ends
            .map(|agents| [position(agents), alone / f64::from(agents)])
            .to_vec(),
        is_faint: true,
        ..Series::default()
    })
}

/// Parts that the names of all methods have, separated by commas.
fn common_parts(methods: &[Method<'_>]) -> String {
    let Some((first, others)) = methods.split_first() else {
        return String::new();
    };
    let is_common = |part: &&str| others.iter().all(|method| has_part(&method.name, part));
    let parts: Vec<&str> = first.name.split(", ").filter(is_common).collect();
    if others.is_empty() {
        return String::new();
    }
    parts.join(", ")
}

fn without_parts(name: &str, common: &str) -> String {
    let is_own = |part: &&str| !has_part(common, part);
    let parts: Vec<&str> = name.split(", ").filter(is_own).collect();
    parts.join(", ")
}

/// What a figure of differences compares: parts of names, and the axes whose values are columns and
/// rows.
pub(super) struct Differences<'a> {
    pub(super) compare: [&'a str; 2],
    pub(super) columns: &'a str,
    pub(super) rows: &'a str,
}

/// A difference at its place in the figure.
struct Difference {
    /// What is left of the names of the cells: the panel.
    panel: String,
    column: String,
    row: String,
    number: GridNumber,
}

/// Differences between pairs of cells; `None` without pairs.
pub(super) fn differences(
    results: &Results,
    cells: &[&CellResults],
    measure: Measure,
    figure: &Differences<'_>,
) -> Option<UnnumberedFigure> {
    let found: Vec<Difference> = cells
        .par_iter()
        .filter_map(|cell| difference(results, cell, measure, figure))
        .collect();
    let max = found
        .iter()
        .map(|difference| difference.number.value.abs())
        .fold(f64::MIN_POSITIVE, f64::max);
    let mut panels: Vec<&str> = Vec::new();
    for difference in &found {
        if !panels.contains(&difference.panel.as_str()) {
            panels.push(&difference.panel);
        }
    }
    let panel = |title: &&str| {
        let of_panel = found
            .iter()
            .filter(|difference| difference.panel == **title);
        Panel::NumberGrid(grid(title, &of_panel.collect::<Vec<_>>(), max, figure))
    };
    let [first, second] = figure.compare;
    let caption = format!(
        "{}: {first} minus {second}, mean over runs. Orange: {second} is lower. In parentheses: the 95 % interval of the \
         single comparison contains 0. Colors show square roots.",
        capitalized(&measure.title())
    );
    let panels: Vec<Panel> = panels.iter().map(panel).collect();
    (!panels.is_empty()).then(|| UnnumberedFigure {
        kind: "differences",
        title: format!("{}: {first} minus {second}", capitalized(&measure.title())),
        picture: picture_of_grids(panels),
        caption,
    })
}

fn picture_of_grids(panels: Vec<Panel>) -> Picture {
    Picture {
        title: String::new(),
        description: String::new(),
        width: 320.0 * panels.len() as f64,
        rows: vec![Row {
            height: 300.0,
            panels,
            key: None,
        }],
    }
}

/// The difference between this cell and its partner; `None` if its name has not the first compared
/// part, or if the partner has no runs.
fn difference(
    results: &Results,
    cell: &CellResults,
    measure: Measure,
    figure: &Differences<'_>,
) -> Option<Difference> {
    let name = &cell.description.name;
    let [first, second] = figure.compare;
    let partner = results.cell(&replace_part(name, first, second)?)?;
    let scores = [cell, partner].map(|cell| cell.scores(measure));
    let quantity = Quantity::of(measure, default_horizon(&[cell, partner], measure));
    let paired = !results.study.pairs_share.is_empty() && quantity != Quantity::Share;
    let names = [cell, partner].map(|cell| cell.description.name.as_str());
    let is_reversed = results
        .study
        .compares_in_reverse(measure, names[0], names[1]);
    let samples = Samples::in_direction(is_reversed, scores[0], scores[1], quantity, paired)?;
    let effect = samples.compare(&*samples.test()).effect;
    let value_on = |axis: &str| {
        name.split(", ")
            .find_map(|part| part.strip_prefix(axis)?.strip_prefix(' '))
    };
    let (column, row) = (value_on(figure.columns)?, value_on(figure.rows)?);
    let is_left = |part: &&str| {
        let is_of = |axis: &str, value: &str| **part == format!("{axis} {value}");
        *part != first && !is_of(figure.columns, column) && !is_of(figure.rows, row)
    };
    let left: Vec<&str> = name.split(", ").filter(is_left).collect();
    Some(Difference {
        panel: left.join(", "),
        column: column.to_owned(),
        row: row.to_owned(),
        number: GridNumber {
            value: effect.value,
            is_uncertain: contains_zero(effect.interval),
        },
    })
}

/// Whether an interval contains 0; too few runs leave it open.
fn contains_zero(interval: Interval) -> bool {
    interval
        .ends()
        .is_none_or(|[low, high]| low <= 0.0 && 0.0 <= high)
}

fn grid(
    title: &str,
    differences: &[&Difference],
    max: f64,
    figure: &Differences<'_>,
) -> NumberGrid {
    let columns = in_order(
        differences
            .iter()
            .map(|difference| difference.column.as_str()),
    );
    let rows = in_order(differences.iter().map(|difference| difference.row.as_str()));
    let at = |row: &String, column: &String| {
        let is_here = |each: &&&Difference| each.row == *row && each.column == *column;
        differences
            .iter()
            .find(is_here)
            .map(|difference| difference.number)
    };
    let numbers = rows
        .iter()
        .flat_map(|row| columns.iter().map(move |column| at(row, column)));
    NumberGrid {
        title: title.to_owned(),
        x_label: figure.columns.to_owned(),
        y_label: figure.rows.to_owned(),
        numbers: numbers.collect(),
        columns,
        rows,
        max,
    }
}

/// Distinct values in the order in which they come.
fn in_order<'a>(values: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut distinct: Vec<String> = Vec::new();
    for value in values {
        if !distinct.iter().any(|other| other == value) {
            distinct.push(value.to_owned());
        }
    }
    distinct
}
