//! A study plan: a checked study file with its cells, their scenarios, and their runs.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::experiment::{self, LoadError, LoadStep};
use super::external::{ExternalRuns, ExternalSpec, Problem, SeenFiles};
use super::figure::{EpisodeWindow, Figure};
use super::file::{Axis, NamedCell, Study};
use super::measure::Measure;
use super::registration::{Lock, RegistrationError};
use super::run_source::RunSource;
use crate::input_files::{self, Directory};
use crate::scenario::synonyms;
use crate::text::file_stem;
use seedbed_input::limits::{MAX_CELLS, MAX_RUNS};
use seedbed_input::{Document, InputError, Located, ValidationError};

/// A checked study that can be run.
#[derive(Clone, Debug)]
pub struct StudyPlan {
    /// Name of the study: the name of its file without `.ron`.
    pub name: String,
    /// Path of the file.
    pub path: PathBuf,
    /// Contents of the file.
    pub document: Document<Study>,
    /// Whether the study is run with the settings of `quick`.
    pub quick: bool,
    /// Cells: first the cells of the grid, with the last axis varying fastest, then the named
    /// cells.
    pub cells: Vec<Cell>,
    /// Lock from which run seeds are derived; `None` for runs that are not registered.
    pub lock: Option<Lock>,
}

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
    pub source: RunSource,
    /// Hash of everything on which runs of this cell depend, except their run seeds.
    pub digest: String,
    /// Numbers of first episodes whose visited states are stored, in ascending order.
    pub windows: Vec<u32>,
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

impl StudyPlan {
    /// Reads and checks a study, all its scenarios and their tasks, and all results of others.
    ///
    /// # Errors
    /// The first error in any of these files. If it is not in a file of results, it is located in the
    /// study file.
    pub fn load(path: &Path, quick: bool) -> Result<Self, InputError> {
        let plan = Self::load_before_results(path, quick)?;
        for cell in &plan.cells {
            if let Some(runs) = cell.source.external() {
                runs.check_number(runs.repeats())
                    .map_err(|error| plan.document.locate(error))?;
            }
        }
        Ok(plan)
    }

    /// As [`load`](Self::load), but results of others need not exist yet.
    ///
    /// # Errors
    /// See [`load`](Self::load).
    pub fn load_before_results(path: &Path, quick: bool) -> Result<Self, InputError> {
        let document = input_files::read(path).map_err(synonyms::explain_in_study);
        let document: Document<Study> = document?;
        let cells = cells(&document.value, path, quick).map_err(|problem| match problem {
            Problem::Study(error) => document.locate(error),
            Problem::Data(error) => error,
        })?;
        let names: Vec<&str> = cells.iter().map(|cell| cell.name.as_str()).collect();
        document
            .value
            .check(&names)
            .map_err(|error| document.locate(error))?;
        check_measures(&document.value, &cells).map_err(|error| document.locate(error))?;
        let name = file_stem(path, "study");
        Ok(Self {
            name,
            path: path.to_owned(),
            document,
            quick,
            cells,
            lock: None,
        })
    }

    /// The same study with the run seeds of its lock.
    ///
    /// # Errors
    /// If the study is not registered, or if it differs from its lock.
    pub fn registered(mut self) -> Result<Self, RegistrationError> {
        let lock = Lock::check(&self)?;
        let seen = SeenFiles::new(lock.registered.seen_files.iter().map(|seen| &seen.file));
        let repeats = self.repeats();
        for cell in &mut self.cells {
            let RunSource::External(runs) = &cell.source else {
                continue;
            };
            let new = runs.without(&seen)?;
            let expected = new.repeats().unwrap_or(repeats);
            // Runs may be missing, but not too many.
            if new.runs().count() as u64 > expected {
                new.check_number(Some(expected))
                    .map_err(|error| self.document.locate(error))?;
            }
            cell.source = RunSource::External(Arc::new(new));
        }
        self.lock = Some(lock);
        Ok(self)
    }

    /// Run seed of the run with this index in its cell.
    fn run_seed(&self, repeat: u64) -> u64 {
        match &self.lock {
            Some(lock) => lock.run_seed(repeat),
            None => *self.study().first_seed + repeat,
        }
    }

    /// The study file.
    #[must_use]
    pub fn study(&self) -> &Study {
        &self.document.value
    }

    /// Number of runs per cell.
    #[must_use]
    pub fn repeats(&self) -> u64 {
        let (full_repeats, quick_repeats) =
            (self.study().repeats.get(), self.study().quick.repeats.get());
        u64::from(if self.quick {
            quick_repeats.min(full_repeats)
        } else {
            full_repeats
        })
    }

    /// All runs, in the order of their indices.
    #[must_use]
    pub fn runs(&self) -> Vec<PlannedRun<'_>> {
        let mut runs = Vec::new();
        for cell in &self.cells {
            let mut add = |repeat: u64, run_seed: u64, name| {
                let index = runs.len();
                runs.push(PlannedRun {
                    index,
                    cell,
                    repeat,
                    run_seed,
                    name,
                });
            };
            if let Some(external) = cell.source.external() {
                (0..).zip(external.runs()).for_each(|(repeat, run)| {
                    add(repeat, run.id, Some(run.name.as_str()));
                });
            } else {
                (0..self.repeats()).for_each(|repeat| add(repeat, self.run_seed(repeat), None));
            }
        }
        runs
    }

    /// All runs without duplicates. Cells with different names and equal settings share their runs.
    #[must_use]
    pub fn distinct_runs(&self) -> Vec<PlannedRun<'_>> {
        let mut seen = HashSet::new();
        self.runs()
            .into_iter()
            .filter(|run| seen.insert((run.cell.digest.as_str(), run.run_seed)))
            .collect()
    }

    /// Default folder of the results: one for each lock, and others for runs that are not
    /// registered.
    #[must_use]
    pub fn default_folder(&self) -> PathBuf {
        let folder_suffix = match &self.lock {
            Some(lock) => format!("-{}", lock.short_id()),
            None if self.quick => "-quick".to_owned(),
            None => String::new(),
        };
        Path::new("recordings")
            .join("studies")
            .join(format!("{}{folder_suffix}", self.name))
    }
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

/// A value that is replaced in a scenario, as `path=value`, and its place in the study, for errors.
pub(super) type Override<'a> = (&'a Located<String>, String);

/// A cell before its scenario is read.
#[derive(Clone, Default)]
pub(super) struct CellDraft<'a> {
    name_parts: Vec<String>,
    /// The cell in the study file, if it has results of others.
    external: Option<(&'a Study, &'a NamedCell)>,
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

fn cells(study: &Study, path: &Path, quick: bool) -> Result<Vec<Cell>, Problem> {
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
    let own_cells = cells.iter().filter(|cell| cell.source.external().is_none());
    let mut own_tasks: Vec<String> = own_cells
        .map(|cell| cell.source.task().to_owned())
        .collect();
    own_tasks.sort();
    own_tasks.dedup();
    for cell in cells {
        let (RunSource::External(runs), Some(named_cell)) =
            (&mut cell.source, study.external_cell(&cell.name))
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
        Arc::make_mut(runs).task = task;
    }
    Ok(())
}

/// Gives each cell the windows of all cells with equal settings, because these cells share their
/// runs.
fn share_windows(cells: &mut [Cell]) {
    let windows_by_digest: Vec<(String, Vec<u32>)> = cells
        .iter()
        .map(|cell| (cell.digest.clone(), cell.windows.clone()))
        .collect();
    for cell in cells {
        let shared = windows_by_digest
            .iter()
            .filter(|(digest, _)| *digest == cell.digest);
        cell.windows = shared.flat_map(|(_, windows)| windows).copied().collect();
        cell.windows.sort_unstable();
        cell.windows.dedup();
    }
}

pub(super) fn located_text(text: &Located<String>) -> (&Located<String>, String) {
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
    if cell.results.is_some() {
        return CellDraft {
            name_parts: vec![cell.name.value().clone()],
            external: Some((study, cell)),
            ..CellDraft::default()
        };
    }
    let scenario = cell
        .scenario
        .as_ref()
        .map(located_text)
        .or_else(|| shared_settings.scenario.clone());
    let draft = CellDraft {
        name_parts: vec![cell.name.value().clone()],
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
    let grid_cell_count: usize = if study.grid.is_empty() {
        0
    } else {
        study.grid.iter().map(|axis| axis.values.len()).product()
    };
    let named_cell = number
        .checked_sub(grid_cell_count)
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
    pub(super) fn of_scenario(name_parts: Vec<String>, scenario: Override<'a>) -> Self {
        Self {
            name_parts,
            scenario: Some(scenario),
            ..Self::default()
        }
    }

    pub(super) fn with_overrides(
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

    pub(super) fn build(
        self,
        folder: &Path,
        figures: &[Figure],
        error_place: Option<&Located<String>>,
    ) -> Result<Cell, Problem> {
        if let Some((study, cell)) = self.external {
            return external_cell(folder, study, cell);
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
        let experiment =
            experiment::load(&path, &overrides).map_err(|LoadError { step, error }| {
                let place = match step {
                    LoadStep::Read => *place,
                    LoadStep::Override(index) => places[index],
                    LoadStep::Check => error_place.unwrap_or(place),
                };
                error_at(place, &error)
            })?;
        let name = self.name_parts.join(", ");
        Ok(Cell {
            digest: experiment.digest(),
            windows: windows(figures, &name),
            scenario: path.display().to_string(),
            overrides,
            source: RunSource::Experiment(experiment),
            name,
        })
    }
}

/// A cell of results of others.
fn external_cell(folder: &Path, study: &Study, cell: &NamedCell) -> Result<Cell, Problem> {
    let Some(source) = &cell.results else {
        return Err(cell.name.error("expected `results`").into());
    };
    let max_episodes = cell
        .max_episodes
        .as_deref()
        .or(study.max_episodes.as_deref());
    let max_steps = cell.max_steps.as_deref().or(study.max_steps.as_deref());
    let runs = ExternalRuns::load(
        folder,
        ExternalSpec {
            source: source.clone(),
            place: cell.name.clone(),
            solved: cell
                .solved
                .as_ref()
                .or(study.solved.as_ref())
                .map(|solved| **solved),
            agents: cell.agents.as_ref().map(|agents| agents.get()),
            max_episodes: max_episodes.map(|max| max.get()),
            max_steps: max_steps.map(|max| max.get().into()),
            repeats: cell.repeats.as_ref().map(|repeats| repeats.get()),
        },
    )?;
    Ok(Cell {
        name: cell.name.value().clone(),
        scenario: runs.source(),
        overrides: Vec::new(),
        digest: runs.digest(),
        source: RunSource::External(Arc::new(runs)),
        windows: Vec::new(),
    })
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
    let windows_of_figure = |figure: &Figure| match figure {
        Figure::Visitation { episodes, .. } if figure.shows(cell) => episodes
            .iter()
            .map(|window| EpisodeWindow::episodes(*window))
            .collect(),
        _ => Vec::new(),
    };
    figures.iter().flat_map(windows_of_figure).collect()
}

/// Checks that the runs of every cell have all measures of the study, and the runs of the cells of its
/// claims and figures those that these need.
fn check_measures(study: &Study, cells: &[Cell]) -> Result<(), ValidationError> {
    for measure in study.measures.iter() {
        missing_measure(cells.iter(), **measure)
            .map_or(Ok(()), |message| Err(measure.error(message)))?;
    }
    for claim in &study.claims {
        let compared = cells.iter().filter(|cell| claim.is_about(&cell.name));
        if let Some(measure) = &claim.measure
            && let Some(message) = missing_measure(compared, **measure)
        {
            return Err(measure.error(message));
        }
    }
    for figure in &study.figures {
        check_figure_of_external_cells(study, figure, cells)?;
        let shown_cells = cells.iter().filter(|cell| figure.shows(&cell.name));
        let message = figure
            .required_measure(study.main_measure())
            .and_then(|measure| missing_measure(shown_cells, measure));
        message.map_or(Ok(()), |message| {
            Err(figure.error(
                study,
                format!("for the figure `{}`: {message}", figure.kind()),
            ))
        })?;
    }
    Ok(())
}

/// Checks that a figure does not show what results of others do not have: visited states, if it names
/// their cells, and single episodes.
fn check_figure_of_external_cells(
    study: &Study,
    figure: &Figure,
    cells: &[Cell],
) -> Result<(), ValidationError> {
    let external = |name: &str| {
        let cell = cells.iter().find(|cell| cell.name == name)?;
        cell.source.external()
    };
    if let Figure::Visitation { cells, .. } = figure
        && let Some(name) = cells.iter().find(|name| external(name.as_str()).is_some())
    {
        return Err(
            name.error("results of others have no visited states; expected cells with a scenario")
        );
    }
    let draws_episodes = matches!(figure, Figure::Curves { .. } | Figure::Agents { .. });
    let of_means = cells.iter().find(|cell| {
        let unknown = cell.source.external().map(ExternalRuns::unknown);
        figure.shows(&cell.name) && unknown.is_some_and(|unknown| unknown.episodes)
    });
    match of_means {
        Some(cell) if draws_episodes => Err(figure.error(
            study,
            format!(
                "for the figure `{}`: cell `{}` has means over several episodes, so that episodes are not known; \
                 expected `cells` without it",
                figure.kind(),
                cell.name
            ),
        )),
        _ => Ok(()),
    }
}

/// Error message for the first cell whose runs do not have a measure; `None` if all cells have it.
pub(super) fn missing_measure<'a>(
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
