//! Drafts of cells: the combinations of a grid and the named cells of a study file, before their scenarios are read.

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use super::cell::Cell;
use super::figure::Figure;
use super::file::{Axis, NamedCell, Study};
use super::run_source::{self, ScenarioRuns};
use crate::experiment::{self, LoadError, LoadStep};
use crate::input_files::{self, Directory};
use crate::study::external::Problem;
use seedbed_input::limits::{MAX_CELLS, MAX_RUNS};
use seedbed_input::{InputError, Located, ValidationError};

/// A value that is replaced in a scenario, as `path=value`, and its place in the study, for errors.
pub(in crate::study) type Override<'a> = (&'a Located<String>, String);

/// A cell before its scenario is read.
#[derive(Clone, Default)]
pub(in crate::study) struct CellDraft<'a> {
    name_parts: Vec<String>,
    /// The cell in the study file, if it is a named one.
    named: Option<(&'a Study, &'a NamedCell)>,
    scenario: Option<Override<'a>>,
    overrides: Vec<Override<'a>>,
}

/// Cells of the grid, and named cells. A study with neither has one cell with the name `all`.
fn cell_drafts(study: &Study) -> Result<Vec<CellDraft<'_>>, ValidationError> {
    let shared_settings = CellDraft {
        scenario: study.scenario.as_ref().map(located_text),
        ..CellDraft::default()
    };
    let shared_settings = shared_settings.with_overrides(study.set.iter().map(located_text));
    check_sizes(study)?;
    let mut drafts = if study.grid.is_empty() {
        Vec::new()
    } else {
        grid_drafts(&shared_settings, &study.grid)?
    };
    drafts.extend(
        study
            .cells
            .iter()
            .map(|cell| named_cell_draft(&shared_settings, study, cell)),
    );
    if drafts.is_empty() {
        drafts.push(CellDraft {
            name_parts: vec!["all".to_owned()],
            ..shared_settings
        });
    }
    Ok(drafts)
}

/// Checks the numbers of cells and runs before any of them is made.
fn check_sizes(study: &Study) -> Result<(), ValidationError> {
    let mut cells = u64::from(!study.grid.is_empty());
    for axis in &study.grid {
        cells = cells.saturating_mul(axis.values.len() as u64);
        if cells > MAX_CELLS {
            return Err(axis.values.error(format!(
                "with this axis, the grid has more than {MAX_CELLS} cells; expected at most {MAX_CELLS}"
            )));
        }
    }
    cells += study.cells.len() as u64;
    if cells > MAX_CELLS {
        return Err(study.cells[0].name.error(format!(
            "the study has {cells} cells; expected at most {MAX_CELLS}"
        )));
    }
    let runs = cells.saturating_mul(study.repeats.get().into());
    if runs > MAX_RUNS {
        return Err(study.repeats.error(format!(
            "the study has {cells} cells, {runs} runs in all; expected at most {MAX_RUNS}"
        )));
    }
    Ok(())
}

/// All cells of a study: those of the grid, then the named ones.
pub(super) fn cells(study: &Study, path: &Path, quick: bool) -> Result<Vec<Cell>, Problem> {
    study.check_results()?;
    let drafts = cell_drafts(study)?;
    let quick_overrides = if quick {
        study.quick.set.as_slice()
    } else {
        &[]
    };
    let folder = input_files::folder_of(path);
    let mut cells_so_far: Vec<Cell> = Vec::with_capacity(drafts.len());
    for (number, draft) in drafts.into_iter().enumerate() {
        let error_place = error_place(study, number, &draft);
        let cell = draft
            .with_overrides(quick_overrides.iter().map(located_text))
            .build(&folder, &study.figures, error_place)?;
        if cells_so_far.iter().any(|other| other.name == cell.name) {
            return Err(cell_error(
                error_place,
                study,
                &format!("there are two cells named `{}`", cell.name),
            )
            .into());
        }
        cells_so_far.push(cell);
    }
    name_tasks_of_external_cells(study, &mut cells_so_far)?;
    share_windows(&mut cells_so_far);
    Ok(cells_so_far)
}

/// Name of the task of results of others, in studies that name no task.
const UNNAMED_TASK: &str = "unnamed";

/// Gives each cell of results of others the task that it names or, if it names none, the task of all
/// other cells.
fn name_tasks_of_external_cells(study: &Study, cells: &mut [Cell]) -> Result<(), ValidationError> {
    let own_cells = cells.iter().filter(|cell| cell.source.found().is_none());
    let mut own_tasks: Vec<String> = own_cells
        .map(|cell| cell.source.task().to_owned())
        .collect();
    own_tasks.sort();
    own_tasks.dedup();
    for cell in cells {
        let (Some(runs), Some(named_cell)) = (cell.source.found(), study.external_cell(&cell.name))
        else {
            continue;
        };
        let task = match (&named_cell.task, &own_tasks[..]) {
            (Some(task), _) => task.value().clone(),
            (None, []) => UNNAMED_TASK.to_owned(),
            (None, [task]) => task.clone(),
            (None, _) => {
                return Err(named_cell.name.error(format!(
                    "the study has several tasks; expected `task: \"…\"` in this cell, one of {}",
                    seedbed_input::quoted_list(own_tasks.iter().map(String::as_str))
                )));
            }
        };
        cell.source = Arc::new(runs.clone().with_task(task));
    }
    Ok(())
}

/// Gives each cell the windows of all cells with equal settings, because these cells share their
/// runs.
fn share_windows(cells: &mut [Cell]) {
    // Most studies have none, and need no digests here.
    if cells.iter().all(|cell| cell.windows.is_empty()) {
        return;
    }
    let windows_by_digest: Vec<(String, Vec<u32>)> = cells
        .iter()
        .map(|cell| (cell.digest().to_owned(), cell.windows.clone()))
        .collect();
    for cell in cells {
        let shared = windows_by_digest
            .iter()
            .filter(|(digest, _)| *digest == cell.digest());
        cell.windows = shared.flat_map(|(_, windows)| windows).copied().collect();
        cell.windows.sort_unstable();
        cell.windows.dedup();
    }
}

pub(in crate::study) fn located_text(text: &Located<String>) -> (&Located<String>, String) {
    (text, text.value().clone())
}

/// Drafts of all combinations of values of the axes, with the last axis varying fastest.
fn grid_drafts<'a>(
    shared_settings: &CellDraft<'a>,
    axes: &'a [Axis],
) -> Result<Vec<CellDraft<'a>>, ValidationError> {
    let mut drafts = vec![shared_settings.clone()];
    for axis in axes {
        let labels = labels(axis)?;
        check_lists_of_with(axis)?;
        let values = || (0..labels.len()).map(|number| (number, labels[number].as_str()));
        drafts = drafts
            .iter()
            .flat_map(|draft| {
                values().map(|(number, label)| draft.with_axis_value(axis, number, label))
            })
            .collect();
    }
    Ok(drafts)
}

fn labels(axis: &Axis) -> Result<Vec<String>, ValidationError> {
    let values: Vec<String> = axis
        .values
        .iter()
        .map(|value| value.value().clone())
        .collect();
    if values.is_empty() {
        return Err(axis.values.error("expected at least one value"));
    }
    let templates = axis.scenario.iter().chain(&axis.set);
    if !templates.clone().any(|template| template.contains("{}")) {
        return Err(axis.values.error(
            "neither `scenario` nor `set` of this axis contains `{}`; expected `{}` where its \
                 values go",
        ));
    }
    match &axis.labels {
        Some(labels) if labels.len() != values.len() => Err(labels.error(format!(
            "expected {} labels, one for each value, found {}",
            values.len(),
            labels.len()
        ))),
        Some(labels) => Ok(labels.value().clone()),
        None => Ok(values),
    }
}

fn check_lists_of_with(axis: &Axis) -> Result<(), ValidationError> {
    let (values, lists) = (axis.values.len(), axis.with.len());
    if lists == 0 || lists == values {
        return Ok(());
    }
    Err(axis.with.error(format!(
        "expected {values} lists, one for each value, found {lists}"
    )))
}

fn named_cell_draft<'a>(
    shared_settings: &CellDraft<'a>,
    study: &'a Study,
    cell: &'a NamedCell,
) -> CellDraft<'a> {
    let scenario = cell
        .scenario
        .as_ref()
        .map(located_text)
        .or_else(|| shared_settings.scenario.clone());
    let draft = CellDraft {
        name_parts: vec![cell.name.value().clone()],
        named: Some((study, cell)),
        scenario,
        ..shared_settings.clone()
    };
    draft.with_overrides(cell.set.iter().map(located_text))
}

/// Place in the study file for errors that concern a whole cell: the name of a named cell, the last
/// override of a cell of the grid, or the scenario of the study.
fn error_place<'a>(
    study: &'a Study,
    number: usize,
    draft: &CellDraft<'a>,
) -> Option<&'a Located<String>> {
    let named_cell = number
        .checked_sub(study.grid_cell_count())
        .and_then(|number| study.cells.get(number));
    named_cell
        .map(|cell| &cell.name)
        .or_else(|| draft.overrides.last().map(|(place, _)| *place))
        .or(study.scenario.as_ref())
}

fn cell_error(place: Option<&Located<String>>, study: &Study, message: &str) -> ValidationError {
    place.map_or_else(
        || study.repeats.error(message),
        |place| place.error(message),
    )
}

impl<'a> CellDraft<'a> {
    /// A cell of a scenario.
    pub(in crate::study) fn of_scenario(name_parts: Vec<String>, scenario: Override<'a>) -> Self {
        Self {
            name_parts,
            scenario: Some(scenario),
            ..Self::default()
        }
    }

    pub(in crate::study) fn with_overrides(
        mut self,
        overrides: impl Iterator<Item = (&'a Located<String>, String)>,
    ) -> Self {
        self.overrides
            .extend(overrides.filter(|(_, text)| !text.trim().is_empty()));
        self
    }

    /// The draft with one value of an axis added.
    fn with_axis_value(&self, axis: &'a Axis, number: usize, label: &str) -> Self {
        let (mut draft, value) = (self.clone(), &axis.values[number]);
        draft
            .name_parts
            .push(format!("{} {label}", axis.name).trim().to_owned());
        if let Some(template) = &axis.scenario {
            draft.scenario = Some((value, template.replace("{}", value)));
        }
        let set = axis
            .set
            .iter()
            .map(|template| (value, template.replace("{}", value)));
        let extra_templates = axis.with.get(number).into_iter().flatten();
        draft.with_overrides(set).with_overrides(
            extra_templates.map(|template| (template, template.replace("{}", value))),
        )
    }

    pub(in crate::study) fn build(
        self,
        folder: &Path,
        figures: &[Figure],
        error_place: Option<&Located<String>>,
    ) -> Result<Cell, Problem> {
        let name = self.name_parts.join(", ");
        if let Some((study, cell)) = self.named
            && let Some((scenario, source)) = run_source::of_named_cell(folder, study, cell)?
        {
            return Ok(Cell {
                name,
                scenario,
                overrides: Vec::new(),
                digest: OnceLock::new(),
                source,
                windows: Vec::new(),
            });
        }
        let Some((place, scenario)) = &self.scenario else {
            let place = error_place.cloned().unwrap_or_default();
            return Err(place.error(
                "this cell has no scenario; expected `scenario: \"….ron\"` in the study or in the \
                 cell",
            )
            .into());
        };
        let path = scenario_path(folder, place, scenario)?;
        let (places, overrides): (Vec<&Located<String>>, Vec<String>) =
            self.overrides.into_iter().unzip();
        let loaded = experiment::load(&path, &overrides).map_err(|LoadError { step, error }| {
            let place = match step {
                LoadStep::Read => *place,
                LoadStep::Override(index) => places[index],
                LoadStep::Check => error_place.unwrap_or(place),
            };
            error_at(place, &error)
        })?;
        Ok(Cell {
            digest: OnceLock::new(),
            windows: windows(figures, &name),
            scenario: path.display().to_string(),
            overrides,
            source: Arc::new(ScenarioRuns::new(loaded.experiment)),
            name,
        })
    }
}

/// Path of the scenario that a study in `folder` names. A path is relative to the study; a name is
/// looked up in the nearest directory `scenarios` above the study, then above the working directory,
/// and then among the built-in scenarios.
fn scenario_path(
    folder: &Path,
    place: &Located<String>,
    scenario: &str,
) -> Result<PathBuf, ValidationError> {
    if seedbed_input::is_ron(Path::new(scenario)) {
        return Ok(folder.join(scenario));
    }
    let start_folders = input_files::start_folders(folder);
    input_files::find(scenario, Directory::Scenarios, &start_folders)
        .map_err(|known| place.unknown_name("scenario", known.iter().map(String::as_str)))
}

/// An error of a scenario, reported at a place of the study.
fn error_at(place: &Located<String>, error: &InputError) -> ValidationError {
    let without_place = InputError {
        position: None,
        help: None,
        ..error.clone()
    };
    let moved = place.error(without_place.to_string());
    match &error.help {
        Some(help) => moved.with_help(help.clone()),
        None => moved,
    }
}

/// Numbers of first episodes in all figures of visited states that show a cell.
fn windows(figures: &[Figure], cell: &str) -> Vec<u32> {
    let of_cell = figures.iter().filter(|figure| figure.shows(cell));
    let windows = of_cell.flat_map(Figure::windows);
    windows.map(|window| window.episodes()).collect()
}
