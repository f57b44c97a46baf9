//! The figure of visited states in the plane of two observations, with the walls of the task: one panel per cell.

use super::visitation::{ShareScale, not_shown};
use super::{UnnumberedFigure, names_without_common_parts, with_common_ranges};
use crate::experiment::run_result::VisitedStates;
use crate::plotting::{are_coordinates, axis, map_axes};
use crate::review::selection::GRID_CELLS;
use crate::study::design::figure::EpisodeWindow;
use crate::study::evaluate::results::CellResults;
use crate::text::pluralize;
use seedbed_env::Quantity;
use seedbed_figure::{Axis, Cells, Figure as Picture, HeatMap, Panel, Row};

/// Maximum number of panels side by side, and their width, in CSS pixels.
const MAX_COLUMNS: usize = 3;
const PANEL_WIDTH: f64 = 250.0;

/// Width of the color key beside a row, and minimum height of a row.
const WIDTH_OF_KEY: f64 = 90.0;
const MIN_HEIGHT: f64 = 148.0;

/// Visited states of one cell.
struct CellMap<'a> {
    cell: &'a CellResults,
    title: String,
    /// Numbers of states and runs, with the title.
    counted: String,
    axes: [Axis; 2],
    /// Share of the states in each cell of the grid, row by row from below: `[GRID_CELLS × GRID_CELLS]`
    shares: Vec<f64>,
}

/// `names`: those of the two observations; `None` chooses them. `None` if no states of any cell were stored.
pub(super) fn scatter(
    cells: &[&CellResults],
    names: Option<[&str; 2]>,
    window: EpisodeWindow,
) -> Option<UnnumberedFigure> {
    let panel_names = names_without_common_parts(cells);
    let named = cells.iter().zip(&panel_names);
    let maps: Vec<CellMap<'_>> = named
        .filter_map(|(cell, name)| CellMap::new(cell, name, cells, names, window))
        .collect();
    let scale = ShareScale::of(maps.iter().map(|map| map.shares.as_slice()));
    let first = maps.first()?.panel(&scale);
    let columns = maps.len().min(MAX_COLUMNS);
    let height_of_map = first.height_of_map(PANEL_WIDTH);
    let height = height_of_map.map_or(PANEL_WIDTH, |height| height.max(MIN_HEIGHT));
    let rows = maps.chunks(columns).map(|maps| {
        let mut panels: Vec<Panel> = maps.iter().map(|map| map.panel(&scale)).collect();
        panels.resize(columns, Panel::Blank);
        Row {
            height,
            panels,
            key: Some(scale.key("share of states per cell")),
        }
    });
    let caption = format!(
        "States visited in all runs, in the plane of two observations: shares of the states of each cell on one scale, from a \
         uniform sample of each run, weighted by its number of states ({}).{}",
        maps.iter()
            .map(|map| map.counted.as_str())
            .collect::<Vec<_>>()
            .join("; "),
        not_shown(cells)
    );
    Some(UnnumberedFigure {
        kind: "scatter",
        title: "Where agents went".to_owned(),
        caption,
        picture: Picture {
            title: String::new(),
            description: String::new(),
            width: PANEL_WIDTH * columns as f64 + WIDTH_OF_KEY,
            rows: rows.collect(),
        },
    })
}

impl<'a> CellMap<'a> {
    /// `None` without states, or if the task has fewer than two observations.
    fn new(
        cell: &'a CellResults,
        name: &str,
        cells: &[&CellResults],
        names: Option<[&str; 2]>,
        window: EpisodeWindow,
    ) -> Option<Self> {
        let observations = with_common_ranges(cell, cells);
        let indices = indices_of(&observations, names)?;
        let runs = cell.states(window);
        let visited: u64 = runs.iter().map(|(_, states)| states.visited).sum();
        if visited == 0 {
            return None;
        }
        let mut map = Self {
            cell,
            title: name.to_owned(),
            counted: format!(
                "{name}: {} of {}",
                indicatif::HumanCount(visited),
                pluralize(runs.len(), "run")
            ),
            axes: indices.map(|index| axis(&observations[index])),
            shares: vec![0.0; GRID_CELLS * GRID_CELLS],
        };
        for (_, states) in &runs {
            map.add_run(states, indices, observations.len(), visited);
        }
        Some(map)
    }

    /// Adds the sampled states of a run, which have a share of the `visited` states of all runs. `width`: number of observations
    fn add_run(&mut self, states: &VisitedStates, indices: [usize; 2], width: usize, visited: u64) {
        let sampled = states.visits.len().max(1);
        let weight = states.visited as f64 / sampled as f64 / visited as f64;
        for state in states.states.chunks_exact(width) {
            let values = indices.map(|index| state[index]);
            if values.iter().any(|value| value.is_nan()) {
                continue;
            }
            let [column, row] = [0, 1].map(|side| grid_cell(values[side], self.axes[side].range));
            self.shares[row * GRID_CELLS + column] += weight;
        }
    }

    fn walls(&self) -> Vec<Vec<[f32; 2]>> {
        let [x, y] = &self.axes;
        if are_coordinates([x, y]) {
            self.cell.description.walls.clone()
        } else {
            Vec::new()
        }
    }

    fn panel(&self, scale: &ShareScale) -> Panel {
        let [x, y] = self.axes.clone();
        Panel::HeatMap(HeatMap {
            title: self.title.clone(),
            x,
            y,
            cells: Cells::Counts {
                counts: self
                    .shares
                    .iter()
                    .map(|share| scale.count(*share))
                    .collect(),
                max_count: scale.max_count(),
            },
            columns: GRID_CELLS,
            lines: self.walls(),
        })
    }
}

/// The column or row of a value. Values outside the range are in the first or the last one.
fn grid_cell(value: f32, [low, high]: [f32; 2]) -> usize {
    let position = ((value - low) / (high - low)).clamp(0.0, 1.0);
    ((position * GRID_CELLS as f32) as usize).min(GRID_CELLS - 1)
}

fn indices_of(observations: &[Quantity], names: Option<[&str; 2]>) -> Option<[usize; 2]> {
    let Some(names) = names else {
        return map_axes(&observations.iter().collect::<Vec<_>>());
    };
    let index = |name: &str| {
        observations
            .iter()
            .position(|quantity| quantity.name == name)
    };
    Some([index(names[0])?, index(names[1])?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::design::cell::CellDescription;

    /// Two runs with 30 and 10 visited states, of which two and one were sampled: the sampled states have shares of 3/8, 3/8 and
    /// 2/8. A NaN has no place.
    #[test]
    fn runs_count_by_their_visited_states() {
        let states = |visited, states: &[[f32; 2]]| VisitedStates {
            episodes: u32::MAX,
            visited,
            states: states.concat(),
            visits: vec![(0, 0); states.len()],
        };
        let cell = cell();
        let mut map = CellMap {
            cell: &cell,
            title: String::new(),
            counted: String::new(),
            axes: [0, 1].map(|side| axis(&cell.observations()[side])),
            shares: vec![0.0; GRID_CELLS * GRID_CELLS],
        };
        map.add_run(&states(30, &[[-1.0, -1.0], [1.0, 1.0]]), [0, 1], 2, 40);
        map.add_run(&states(10, &[[-1.0, 1.0]]), [0, 1], 2, 40);
        let last = GRID_CELLS - 1;
        let at = |row: usize, column: usize| map.shares[row * GRID_CELLS + column];
        assert_eq!(
            [at(0, 0), at(last, last), at(last, 0)],
            [0.375, 0.375, 0.25]
        );
        assert_eq!(map.walls(), cell.description.walls);
        // 190 pixels wide and half as high, with labels.
        let scale = ShareScale::of([map.shares.as_slice()].into_iter());
        let height = map.panel(&scale).height_of_map(PANEL_WIDTH).unwrap();
        assert!((height - (95.0 + 68.0)).abs() < 1e-9);
        map.add_run(&states(40, &[[f32::NAN, 0.0]]), [0, 1], 2, 40);
        assert!((map.shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }

    /// A cell of a task with the coordinates x from −1 to 1 and y from −0.5 to 0.5, and one wall.
    fn cell() -> CellResults {
        let observation = |name: &str, range| (name.to_owned(), "m".to_owned(), range);
        CellResults::without_runs(CellDescription {
            walls: vec![vec![[0.0, -0.5], [0.0, 0.5]]],
            ..CellDescription::for_test(
                "cell",
                1,
                vec![observation("x", [-1.0, 1.0]), observation("y", [-0.5, 0.5])],
            )
        })
    }

    #[test]
    fn values_at_and_beyond_the_ends_are_in_the_outer_cells() {
        let cells = [-9.0, -1.0, 0.0, 0.99, 1.0, 9.0].map(|value| grid_cell(value, [-1.0, 1.0]));
        assert_eq!(cells, [0, 0, 20, 39, 39, 39]);
    }
}
