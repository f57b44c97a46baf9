//! Figures of a report, drawn from the runs of a study.

mod claims;
mod curves;
mod measures;
mod scaling;
mod scatter;
mod visitation;

use rayon::prelude::*;

pub(super) use self::claims::claims;
use self::curves::curves;
use self::measures::{groups, intervals, profiles, unsolved};
use self::scaling::{Differences, differences, scaling};
use self::scatter::scatter;
use self::visitation::visitation;
use super::ReportFigure;
use crate::experiment::measure::trailing_means;
use crate::record::{difference_of_quantities, widen};
use crate::study::design::figure::Figure;
use crate::study::evaluate::results::{CellResults, Results};
use seedbed_env::Quantity;
use seedbed_figure::color::{AGENT_COLORS, TEAM_COLOR, agent_color};
use seedbed_figure::{Curves, Figure as Picture, Panel, Row, Series};

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
        Figure::Curves { of, window, x, .. } => curves(&cells, **of, *x, window.get() as usize)?,
        Figure::Agents { window, .. } => agents(&cells, window.get() as usize),
        Figure::Visitation { episodes, .. } => visitation(&cells, episodes)?,
        Figure::Scatter { axes, episodes, .. } => {
            let axes = axes.as_ref().map(|(x, y)| [x.as_str(), y.as_str()]);
            scatter(&cells, axes, *episodes)?
        }
        Figure::Intervals { measure, over, .. } => intervals(
            &groups(&cells, over),
            measure.as_ref().map_or(main_measure, |measure| **measure),
            figure.line().and_then(|name| results.cell(name)),
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

/// The observations of a cell, with ranges that contain those of all cells with the same observations.
fn with_common_ranges(cell: &CellResults, cells: &[&CellResults]) -> Vec<Quantity> {
    let mut common = cell.observations();
    for other in cells.iter().map(|cell| cell.observations()) {
        if difference_of_quantities(&common, &other).is_none() {
            widen(&mut common, &other);
        }
    }
    common
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
