//! The figure of visited states: parallel coordinates of each cell, and differences from the first
//! cell.

use super::{UnnumberedFigure, names_without_common_parts, with_common_ranges};
use crate::experiment::run_result::VisitedStates;
use crate::plotting::axis_with_shares;
use crate::record::visitation::{AXIS_HEIGHT, Axes, Density, Unplaced, VisitedState};
use crate::run::recorder::BonusRange;
use crate::study::design::figure::EpisodeWindow;
use crate::study::evaluate::results::CellResults;
use crate::text::pluralize;
use seedbed_figure::{
    DensityImage, DifferenceImage, Figure as Picture, Key, Panel, ParallelCoordinates, Row, States,
};

/// Width of panels of visited states, in CSS pixels.
const PANEL_WIDTH: f64 = 300.0;

/// Height of rows of visited states, in CSS pixels.
const ROW_HEIGHT: f64 = 250.0;

/// What colors of panels show.
const SHARE_LABEL: &str = "share of states per bin";

/// Maximum number of cells side by side.
const MAX_COLUMNS: usize = 6;

pub(super) fn visitation(
    cells: &[&CellResults],
    windows: &[EpisodeWindow],
) -> Option<UnnumberedFigure> {
    let rows: Vec<Vec<CellDensity>> = windows
        .iter()
        .map(|&window| densities(cells, window))
        .filter(|row| !row.is_empty())
        .collect();
    let columns = rows.iter().map(Vec::len).max()?;
    let caption = format!(
        "States visited in all runs: one axis per observation, one line per state; darker where more lines cross. Panels show \
         shares of the states of their cell on one scale, from a uniform sample of each run, weighted by its number of \
         states{}.{}{}",
        if windows.len() > 1 {
            "; rows show increasing parts of training"
        } else {
            ""
        },
        if columns > 1 {
            " Below: where the share of a cell is above (orange) or below (blue) that of the first cell with the same observations."
        } else {
            ""
        },
        not_shown(cells)
    );
    let scale = ShareScale::of(rows.iter().flatten().map(|cell| cell.shares.as_slice()));
    let columns = columns.min(MAX_COLUMNS);
    let picture = Picture {
        title: String::new(),
        description: String::new(),
        width: PANEL_WIDTH * columns as f64 + 90.0,
        rows: rows
            .iter()
            .flat_map(|cells| picture_rows(cells, &scale, columns))
            .collect(),
    };
    Some(UnnumberedFigure {
        kind: "visitation",
        title: "Visited states".to_owned(),
        caption,
        picture,
    })
}

/// Sentence about cells with results of others, of which studies keep no states.
pub(super) fn not_shown(cells: &[&CellResults]) -> String {
    let of_others = cells
        .iter()
        .filter(|cell| cell.description.external.is_some());
    let names: Vec<String> = of_others
        .map(|cell| format!("“{}”", cell.description.name))
        .collect();
    if names.is_empty() {
        return String::new();
    }
    let names = names.join(", ");
    format!(" Not shown: {names}, whose runs others made; “seedbed plot” draws their recordings.")
}

/// Visited states of one cell.
struct CellDensity {
    name: String,
    title: String,
    axes: Axes,
    /// Shares of states that each axis cannot show at their place: `[axes]`
    unplaced: Vec<Unplaced<f64>>,
    /// Share of the states whose lines cross each pixel: `[height × width]`.
    shares: Vec<f64>,
}

impl CellDensity {
    fn new(name: String, title: String, axes: Axes) -> Self {
        Self {
            name,
            title,
            unplaced: vec![Unplaced::default(); axes.all().len()],
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
        let mut unplaced = vec![Unplaced::default(); self.unplaced.len()];
        for state in states
            .states
            .chunks_exact((states.states.len() / sampled).max(1))
        {
            let state = VisitedState::without_action(0, state, 0.0);
            self.axes.project(&state, &mut axis_positions);
            self.axes.count_unplaced(&state, &mut unplaced);
            density.add(&axis_positions);
        }
        for (shares, counts) in self.unplaced.iter_mut().zip(unplaced) {
            shares.add_weighted(&counts.shares(1), weight);
        }
        let lines = density.pixels();
        self.shares.resize(lines.len(), 0.0);
        for (share, lines) in self.shares.iter_mut().zip(lines) {
            *share += weight * f64::from(lines);
        }
    }

    fn panel(&self, title: String, states: States) -> Panel {
        Panel::ParallelCoordinates(ParallelCoordinates {
            title,
            axes: self
                .axes
                .all()
                .iter()
                .zip(&self.unplaced)
                .map(|(axis, unplaced)| axis_with_shares(&axis.quantity, unplaced.to_array()))
                .collect(),
            states,
        })
    }

    fn width(&self) -> usize {
        self.shares.len() / AXIS_HEIGHT
    }
}

/// Visited states of all cells for which they were stored.
fn densities(cells: &[&CellResults], window: EpisodeWindow) -> Vec<CellDensity> {
    let names = names_without_common_parts(cells);
    let mut densities = Vec::new();
    for ((cell, name), axes) in cells.iter().zip(names).zip(axes_of_cells(cells)) {
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
        let mut density = CellDensity::new(name, title, axes);
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
pub(super) struct ShareScale {
    smallest: f64,
    largest: f64,
}

impl ShareScale {
    /// The scale of panels with these shares.
    pub(super) fn of<'a>(panels: impl Iterator<Item = &'a [f64]>) -> Self {
        let mut scale = Self {
            smallest: 1.0,
            largest: 0.0,
        };
        for &share in panels.flatten() {
            scale.largest = share.max(scale.largest);
            if share > 0.0 {
                scale.smallest = share.min(scale.smallest);
            }
        }
        scale
    }

    pub(super) fn count(&self, share: f64) -> u32 {
        (share / self.smallest).round() as u32
    }

    /// The count of the largest share.
    pub(super) fn max_count(&self) -> u32 {
        self.count(self.largest).max(1)
    }

    pub(super) fn key(&self, label: &str) -> Key {
        Key::Shares {
            label: label.to_owned(),
            max_count: self.max_count(),
            total: (1.0 / self.smallest).round() as u64,
        }
    }
}

/// Rows of at most `columns` panels, each above the row of its differences from the first cell.
fn picture_rows(cells: &[CellDensity], scale: &ShareScale, columns: usize) -> Vec<Row> {
    let differences = ShareDifferences::from_first(cells);
    let mut rows = Vec::new();
    for (cells, differences_of_cells) in cells
        .chunks(columns)
        .zip(differences.of_cells.chunks(columns))
    {
        let panels = cells.iter().map(|cell| density_panel(cell, scale));
        rows.push(row(panels.collect(), columns, scale.key(SHARE_LABEL)));
        if differences_of_cells.iter().any(Option::is_some) {
            let panels = cells.iter().zip(differences_of_cells);
            let panels = panels.map(|(cell, values)| differences.panel(cell, values.as_ref()));
            rows.push(row(panels.collect(), columns, differences.key()));
        }
    }
    rows
}

fn row(mut panels: Vec<Panel>, columns: usize, key: Key) -> Row {
    panels.resize(columns, Panel::Blank);
    Row {
        height: ROW_HEIGHT,
        panels,
        key: Some(key),
    }
}

fn density_panel(cell: &CellDensity, scale: &ShareScale) -> Panel {
    let count = |&share: &f64| scale.count(share);
    let states = States::Density(DensityImage {
        pixels: cell.shares.iter().map(count).collect(),
        width: cell.width(),
        max_count: scale.max_count(),
    });
    cell.panel(cell.title.clone(), states)
}

/// Differences of the shares of cells from those of the first cell with the same axes.
struct ShareDifferences<'a> {
    /// For each cell the differences of all pixels: `[height × width]`, and the name of the cell from
    /// which they are; none for cells that are the first with their axes.
    of_cells: Vec<Option<(Vec<f64>, &'a str)>>,
    /// Largest magnitude of all differences.
    max: f64,
}

impl<'a> ShareDifferences<'a> {
    fn from_first(cells: &'a [CellDensity]) -> Self {
        let difference_of = |(index, cell): (usize, &CellDensity)| {
            let first = cells[..index]
                .iter()
                .find(|first| first.axes == cell.axes)?;
            let pairs = cell.shares.iter().zip(&first.shares);
            let differences: Vec<f64> = pairs.map(|(own, of_first)| own - of_first).collect();
            Some((differences, first.name.as_str()))
        };
        let of_cells: Vec<_> = cells.iter().enumerate().map(difference_of).collect();
        let all = of_cells.iter().flatten().flat_map(|(values, _)| values);
        let max = all.fold(0.0_f64, |max, difference: &f64| max.max(difference.abs()));
        Self { of_cells, max }
    }

    fn panel(&self, cell: &CellDensity, differences: Option<&(Vec<f64>, &str)>) -> Panel {
        let Some((differences, name_of_first)) = differences else {
            return Panel::Blank;
        };
        let scaled = |difference: &f64| {
            let root = (difference.abs() / self.max.max(f64::MIN_POSITIVE)).sqrt();
            root.copysign(*difference) as f32
        };
        let states = States::Difference(DifferenceImage {
            pixels: differences.iter().map(scaled).collect(),
            width: cell.width(),
        });
        cell.panel(format!("{} − {name_of_first}", cell.name), states)
    }

    fn key(&self) -> Key {
        Key::Differences {
            label: "difference of shares, √ scale".to_owned(),
            max: self.max,
        }
    }
}

/// The axes of each cell: those of its observations. Cells with the same observations have the same axes,
/// whose ranges contain those of all of them.
fn axes_of_cells(cells: &[&CellResults]) -> Vec<Axes> {
    let axes = |cell: &&CellResults| {
        Axes::of_quantities(&with_common_ranges(cell, cells), 1, BonusRange::None)
    };
    cells.iter().map(axes).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::design::cell::CellDescription;

    fn cell(name: usize, time_limit: u32) -> CellDensity {
        let axes = Axes::of_quantities(&[], time_limit, BonusRange::None);
        CellDensity {
            shares: vec![0.5; AXIS_HEIGHT],
            ..CellDensity::new(name.to_string(), name.to_string(), axes)
        }
    }

    fn scale_of(cells: &[CellDensity]) -> ShareScale {
        ShareScale::of(cells.iter().map(|cell| cell.shares.as_slice()))
    }

    fn title(panel: &Panel) -> &str {
        match panel {
            Panel::ParallelCoordinates(panel) => &panel.title,
            _ => "",
        }
    }

    fn titles(rows: &[Row]) -> Vec<Vec<&str>> {
        rows.iter()
            .map(|row| row.panels.iter().map(title).collect())
            .collect()
    }

    /// Five cells in rows of three. The second cell has other axes, so that it has no differences.
    #[test]
    fn many_cells_are_drawn_in_rows_of_equal_width_above_their_differences() {
        let time_limit = |number| if number == 1 { 2 } else { 1 };
        let cells: Vec<CellDensity> = (0..5)
            .map(|number| cell(number, time_limit(number)))
            .collect();
        let rows = picture_rows(&cells, &scale_of(&cells), 3);
        assert_eq!(
            titles(&rows),
            [
                ["0", "1", "2"],
                ["", "", "2 − 0"],
                ["3", "4", ""],
                ["3 − 0", "4 − 0", ""]
            ]
        );
    }

    fn cell_of_task(name: &str, unit: &str, range: [f32; 2]) -> CellResults {
        CellResults::without_runs(CellDescription::for_test(
            name,
            1,
            vec![(name.to_owned(), unit.to_owned(), range)],
        ))
    }

    /// Two tasks have the same observation with ranges of ±1 and −10 to 2, of which −10 to 2 contains both.
    /// Others have another name or unit, so that they have axes of their own.
    #[test]
    fn cells_with_the_same_observations_have_common_axes() {
        let cells = [
            cell_of_task("x", "m", [-1.0, 1.0]),
            cell_of_task("y", "m", [-1.0, 1.0]),
            cell_of_task("x", "m", [-10.0, 2.0]),
            cell_of_task("x", "cm", [-3.0, 3.0]),
        ];
        let axes = axes_of_cells(&cells.iter().collect::<Vec<_>>());
        assert_eq!(axes[0], axes[2]);
        let ranges = axes.iter().map(|axes| axes.all()[1].quantity.range);
        let expected = [[-10.0, 2.0], [-1.0, 1.0], [-10.0, 2.0], [-3.0, 3.0]];
        assert_eq!(ranges.collect::<Vec<_>>(), expected);
    }

    #[test]
    fn one_cell_has_no_row_of_differences() {
        let cells = [cell(0, 1)];
        let rows = picture_rows(&cells, &scale_of(&cells), 1);
        assert_eq!(titles(&rows), [["0"]]);
    }
}
