//! Cells of a study and their runs.

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use serde::{Deserialize, Serialize};

use super::run_source::RunSource;
use crate::experiment::measure::Measure;
use crate::input_files;
use crate::plotting::coordinates;
use crate::record::{difference_of_quantities, other_range};
use crate::study::external::{ExternalCell, ExternalRuns};
use seedbed_env::Quantity;
use seedbed_input::quoted_list;
use seedbed_learn::agent::bonus::PaidFor;
use seedbed_learn::algorithms::RandomActions;

/// One cell of a study: a scenario with replaced values, of which there are several runs, or runs
/// that others made.
#[derive(Clone, Debug)]
pub struct Cell {
    /// Name, unique within the study.
    pub name: String,
    /// Path of the scenario, or the source of results of others as in study files.
    pub scenario: String,
    /// Values that are replaced in the scenario, each as `path=value`.
    pub overrides: Vec<String>,
    /// Where its runs come from.
    pub source: Arc<dyn RunSource>,
    /// Its [`digest`](Self::digest), when it is needed.
    pub(in crate::study) digest: OnceLock<String>,
    /// Numbers of first episodes whose visited states are stored, in ascending order.
    pub windows: Vec<u32>,
}

/// Maximum number of cells that a warning names.
const MAX_NAMED_CELLS: usize = 3;

/// Why settings of cells may not do what they seem to do, and what is wrong with files of others. A warning that
/// several cells share is told once.
#[must_use]
pub fn warnings_of(cells: &[Cell]) -> Vec<String> {
    let mut found: Vec<(String, Vec<&str>)> = Vec::new();
    for cell in cells {
        for warning in cell.source.warnings() {
            match found.iter_mut().find(|(known, _)| *known == warning) {
                Some((_, names)) => names.push(&cell.name),
                None => found.push((warning, vec![&cell.name])),
            }
        }
    }
    let with_cells = found
        .iter()
        .map(|(warning, names)| format!("{}: {warning}", named_cells(names)));
    with_cells.collect()
}

/// Such as `cells A, B, C and 4 more`, with each name in backquotes.
fn named_cells(names: &[&str]) -> String {
    let named = quoted_list(names.iter().copied().take(MAX_NAMED_CELLS));
    match names.len() {
        1 => format!("cell {named}"),
        count if count <= MAX_NAMED_CELLS => format!("cells {named}"),
        count => format!("cells {named} and {} more", count - MAX_NAMED_CELLS),
    }
}

/// One run of a study.
#[derive(Clone, Copy, Debug)]
pub struct PlannedRun<'a> {
    /// Index among all runs of the study. Runs are ordered by cell, then by run seed.
    pub index: usize,
    /// Cell of the run.
    pub cell: &'a Cell,
    /// Index among the runs of its cell.
    pub repeat: u64,
    /// Run seed or, of results of others, the id of the run.
    pub run_seed: u64,
    /// Name of the run of others.
    pub name: Option<&'a str>,
}

impl PlannedRun<'_> {
    /// Whether the run is one of the first `runs_per_cell` of its cell. Results of others have no
    /// order, so that all of them are.
    #[must_use]
    pub fn is_among_first(&self, runs_per_cell: u64) -> bool {
        self.name.is_some() || self.repeat < runs_per_cell
    }

    /// The run seed, such as `run seed 1000`, or the name of a run of others.
    #[must_use]
    pub fn label(&self) -> String {
        match self.name {
            Some(name) => format!("run {name}"),
            None => format!("run seed {}", self.run_seed),
        }
    }

    /// Numbers of first episodes whose visited states are stored for this run.
    #[must_use]
    pub fn windows(&self) -> &[u32] {
        &self.cell.windows
    }
}

/// What readers of results are told of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellDescription {
    /// Name of the cell.
    pub name: String,
    /// Hash of everything on which its runs depend, except their run seeds.
    pub digest: String,
    /// Path of its scenario.
    pub scenario: String,
    /// Values that are replaced in the scenario, each as `path=value`.
    pub overrides: Vec<String>,
    /// Number of agents K.
    pub agents: u32,
    /// Maximum number of episodes per agent.
    pub max_episodes: u32,
    /// Name of its task.
    pub task: String,
    /// Observations of its agents: name, unit, and ends of the display range.
    pub observations: Vec<(String, String, [f32; 2])>,
    /// Outlines of bodies that never move, m: `[lines]` of `[points]`, in tasks with the coordinates x and y. Figures show them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub walls: Vec<Vec<[f32; 2]>>,
    /// Which random actions the agents take; `None` if it is not known: in results of others and of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub random_actions: Option<RandomActions>,
    /// What the agents are paid for beside the rewards of the task; `None` if it is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub paid_for: Option<PaidFor>,
    /// Results of others; `None` for a scenario.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub external: Option<ExternalCell>,
}

impl CellDescription {
    /// The description without its path, which depends on the working directory, and without what follows from settings that the
    /// digest has: later versions say more of them.
    pub(in crate::study) fn without_path_and_derived(&self) -> Self {
        Self {
            scenario: String::new(),
            walls: Vec::new(),
            random_actions: None,
            paid_for: None,
            ..self.clone()
        }
    }
}

#[cfg(test)]
impl CellDescription {
    /// A cell of one agent in a task with these observations.
    pub(in crate::study) fn for_test(
        name: &str,
        max_episodes: u32,
        observations: Vec<(String, String, [f32; 2])>,
    ) -> Self {
        Self {
            name: name.to_owned(),
            digest: String::new(),
            scenario: String::new(),
            overrides: Vec::new(),
            agents: 1,
            max_episodes,
            task: String::new(),
            observations,
            walls: Vec::new(),
            random_actions: None,
            paid_for: None,
            external: None,
        }
    }
}

impl Cell {
    /// Hash of everything on which runs of this cell depend, except their run seeds.
    #[must_use]
    pub fn digest(&self) -> &str {
        self.digest.get_or_init(|| self.source.digest())
    }

    /// What readers of its results are told of it.
    pub(in crate::study) fn description(&self) -> CellDescription {
        CellDescription {
            name: self.name.clone(),
            digest: self.digest().to_owned(),
            scenario: shown_path(&self.scenario),
            overrides: self.overrides.clone(),
            agents: self.source.agents(),
            max_episodes: self.source.max_episodes(),
            task: self.source.task().to_owned(),
            observations: self.source.observations().iter().map(observation).collect(),
            walls: walls(&*self.source),
            random_actions: self.source.random_actions(),
            paid_for: self.source.paid_for(),
            external: self.source.found().map(ExternalRuns::description),
        }
    }
}

/// The walls of a task in whose coordinates states can be drawn.
fn walls(source: &dyn RunSource) -> Vec<Vec<[f32; 2]>> {
    let quantities: Vec<&Quantity> = source.observations().iter().collect();
    coordinates(&quantities).map_or(Vec::new(), |_| source.walls())
}

fn observation(quantity: &Quantity) -> (String, String, [f32; 2]) {
    (quantity.name.clone(), quantity.unit.clone(), quantity.range)
}

/// A path as results contain it, which others may read: relative to the working directory, or without
/// its folders, whose names are nobody's business.
pub(in crate::study) fn shown_path(path: &str) -> String {
    let relative = input_files::relative_path(Path::new(path));
    let shown = if relative.is_absolute() {
        relative.file_name().map(PathBuf::from)
    } else {
        Some(relative)
    };
    shown.map_or_else(|| path.to_owned(), |shown| shown.display().to_string())
}

/// Error message for the first two cells that have the same observations, but count visits on other axes.
pub(in crate::study) fn unequal_axes(cells: &[&Cell], measure: Measure) -> Option<String> {
    if !measure.is_of_visits() {
        return None;
    }
    cells.iter().enumerate().find_map(|(index, cell)| {
        let differing = |other: &&Cell| {
            let [one, two] = [cell, other].map(|cell| cell.source.observations());
            let axis = axis_of_other_range(one, two)?;
            Some(format!(
                "visits of the cells `{}` and `{}` are counted on other axes: {axis}; expected equal ranges",
                cell.name, other.name
            ))
        };
        cells[index + 1..].iter().find_map(differing)
    })
}

/// The first observation with another range, if the observations are the same: `x is -1 to 1, and -2 to 2`.
fn axis_of_other_range(one: &[Quantity], two: &[Quantity]) -> Option<String> {
    if difference_of_quantities(one, two).is_some() {
        return None;
    }
    let (one, two) = other_range(one, two)?;
    let [range, other] = [one, two].map(|quantity| {
        let [low, high] = quantity.range;
        format!("{low} to {high}")
    });
    Some(format!("`{}` is {range}, and {other}", one.name))
}

/// Error message for the first cell whose runs do not have a measure; `None` if all cells have it.
pub(in crate::study) fn missing_measure<'a>(
    mut cells: impl Iterator<Item = &'a Cell>,
    measure: Measure,
) -> Option<String> {
    let missing_in = |cell: &Cell| {
        cell.source
            .measure_obstacle(measure)
            .map(|(missing, help)| (cell.name.clone(), missing, help))
    };
    let (name, missing, help) = cells.find_map(missing_in)?;
    Some(format!(
        "cell `{name}` does not have this measure: {missing}; {help}"
    ))
}
