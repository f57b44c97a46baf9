//! A study, read and checked: its cells with their scenarios, and their runs.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::experiment::{self, Experiment, LoadError, LoadStep};
use super::figure::{EpisodeWindow, Figure};
use super::file::{Axis, NamedCell, Study};
use super::measure::Measure;
use seedbed_env::input::{self, Document, InputError, Located, ValidationError};

/// A study that can be run.
#[derive(Clone, Debug)]
pub struct StudyPlan {
    /// Name: the stem of the file.
    pub name: String,
    /// Path of the file.
    pub path: PathBuf,
    /// Contents of the file.
    pub document: Document<Study>,
    /// Whether it is run with the settings of `quick`.
    pub quick: bool,
    /// Cells: first those of the grid, with the last axis varying fastest, then the named ones.
    pub cells: Vec<Cell>,
}

/// One setting of a study.
#[derive(Clone, Debug)]
pub struct Cell {
    /// Name, unique within the study.
    pub name: String,
    /// Path of the scenario.
    pub scenario: PathBuf,
    /// Values that are replaced in the scenario, each as `path=value`.
    pub overrides: Vec<String>,
    /// Experiment to run.
    pub experiment: Arc<dyn Experiment>,
    /// Hash of all that runs of this cell depend on, besides their seeds.
    pub digest: String,
    /// Numbers of first episodes of which the first run keeps states, in ascending order.
    pub windows: Vec<u32>,
}

/// One run of a study.
#[derive(Clone, Copy, Debug)]
pub struct PlannedRun<'a> {
    /// Index among all runs of the study: cell by cell, seed by seed.
    pub index: usize,
    /// Cell of the run.
    pub cell: &'a Cell,
    /// Seed of the run.
    pub seed: u64,
    /// Whether it is the first run of its cell, of which states are kept.
    pub is_first: bool,
}

impl StudyPlan {
    /// Reads and checks a study with all its scenarios and their tasks.
    ///
    /// # Errors
    /// The first error in any of them, with its place in the study.
    pub fn load(path: &Path, quick: bool) -> Result<Self, InputError> {
        let document: Document<Study> = input::read(path)?;
        let built = cells(&document.value, path, quick).map_err(|error| document.locate(error))?;
        let names: Vec<&str> = built.iter().map(|cell| cell.name.as_str()).collect();
        document
            .value
            .check(&names)
            .map_err(|error| document.locate(error))?;
        check_measures(&document.value, &built).map_err(|error| document.locate(error))?;
        let name = path.file_stem().map_or_else(
            || "study".into(),
            |stem| stem.to_string_lossy().into_owned(),
        );
        Ok(Self {
            name,
            path: path.to_owned(),
            document,
            quick,
            cells: built,
        })
    }

    /// Study file.
    #[must_use]
    pub fn study(&self) -> &Study {
        &self.document.value
    }

    /// Number of runs per cell.
    #[must_use]
    pub fn repeats(&self) -> u64 {
        let (all, quick) = (self.study().repeats.get(), self.study().quick.repeats.get());
        u64::from(if self.quick { quick.min(all) } else { all })
    }

    /// All runs, in the order of their indices.
    #[must_use]
    pub fn runs(&self) -> Vec<PlannedRun<'_>> {
        let first_seed = *self.study().first_seed;
        let mut runs = Vec::new();
        for cell in &self.cells {
            for repeat in 0..self.repeats() {
                runs.push(PlannedRun {
                    index: runs.len(),
                    cell,
                    seed: first_seed + repeat,
                    is_first: repeat == 0,
                });
            }
        }
        runs
    }

    /// All runs without duplicates. Cells with equal settings under two names share their runs.
    #[must_use]
    pub fn distinct_runs(&self) -> Vec<PlannedRun<'_>> {
        let mut seen = HashSet::new();
        self.runs()
            .into_iter()
            .filter(|run| seen.insert((run.cell.digest.as_str(), run.seed)))
            .collect()
    }

    /// Default folder of the results.
    #[must_use]
    pub fn default_folder(&self) -> PathBuf {
        let suffix = if self.quick { "-quick" } else { "" };
        Path::new("recordings")
            .join("studies")
            .join(format!("{}{suffix}", self.name))
    }
}

impl PlannedRun<'_> {
    /// Numbers of first episodes of which states are kept.
    #[must_use]
    pub fn windows(&self) -> &[u32] {
        if self.is_first {
            &self.cell.windows
        } else {
            &[]
        }
    }
}

/// A value that is replaced in a scenario, as `path=value`, and its place in the study, for errors.
type Override<'a> = (&'a Located<String>, String);

/// A cell before its scenario is read.
#[derive(Clone, Default)]
struct Draft<'a> {
    name_parts: Vec<String>,
    scenario: Option<Override<'a>>,
    overrides: Vec<Override<'a>>,
}

fn cells(study: &Study, path: &Path, quick: bool) -> Result<Vec<Cell>, ValidationError> {
    let base = Draft {
        scenario: study.scenario.as_ref().map(with_place),
        ..Draft::default()
    };
    let base = base.with(study.set.iter().map(with_place));
    let mut drafts = if study.grid.is_empty() {
        Vec::new()
    } else {
        grid(&base, &study.grid)?
    };
    drafts.extend(study.cells.iter().map(|cell| named(&base, cell)));
    if drafts.is_empty() {
        drafts.push(Draft {
            name_parts: vec!["all".to_owned()],
            ..base
        });
    }
    let last = if quick {
        study.quick.set.as_slice()
    } else {
        &[]
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut built: Vec<Cell> = Vec::with_capacity(drafts.len());
    for (number, draft) in drafts.into_iter().enumerate() {
        let error_place = error_place(study, number, &draft);
        let cell =
            draft
                .with(last.iter().map(with_place))
                .build(folder, &study.figures, error_place)?;
        if built.iter().any(|other| other.name == cell.name) {
            return Err(error(
                error_place,
                study,
                &format!("there are two cells named `{}`", cell.name),
            ));
        }
        built.push(cell);
    }
    share_windows(&mut built);
    Ok(built)
}

/// Cells with equal settings share their runs, which keep the states that any of these cells needs.
fn share_windows(cells: &mut [Cell]) {
    let shown: Vec<(String, Vec<u32>)> = cells
        .iter()
        .map(|cell| (cell.digest.clone(), cell.windows.clone()))
        .collect();
    for cell in cells {
        let shared = shown.iter().filter(|(digest, _)| *digest == cell.digest);
        cell.windows = shared.flat_map(|(_, windows)| windows).copied().collect();
        cell.windows.sort_unstable();
        cell.windows.dedup();
    }
}

fn with_place(text: &Located<String>) -> (&Located<String>, String) {
    (text, text.value().clone())
}

/// Every combination of the axes' values, with the last axis varying fastest.
fn grid<'a>(base: &Draft<'a>, axes: &'a [Axis]) -> Result<Vec<Draft<'a>>, ValidationError> {
    let mut drafts = vec![base.clone()];
    for axis in axes {
        let labels = labels(axis)?;
        check_with(axis)?;
        let values = || (0..labels.len()).map(|number| (number, labels[number].as_str()));
        drafts = drafts
            .iter()
            .flat_map(|draft| values().map(|(number, label)| draft.along(axis, number, label)))
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

fn check_with(axis: &Axis) -> Result<(), ValidationError> {
    let (values, lists) = (axis.values.len(), axis.with.len());
    if lists == 0 || lists == values {
        return Ok(());
    }
    Err(axis.with.error(format!(
        "expected {values} lists, one for each value, found {lists}"
    )))
}

fn named<'a>(base: &Draft<'a>, cell: &'a NamedCell) -> Draft<'a> {
    let scenario = cell
        .scenario
        .as_ref()
        .map(with_place)
        .or_else(|| base.scenario.clone());
    let draft = Draft {
        name_parts: vec![cell.name.value().clone()],
        scenario,
        ..base.clone()
    };
    draft.with(cell.set.iter().map(with_place))
}

/// Place of the file for errors of a whole cell: its name, or the last value of its axes.
fn error_place<'a>(
    study: &'a Study,
    number: usize,
    draft: &Draft<'a>,
) -> Option<&'a Located<String>> {
    let from_grid: usize = if study.grid.is_empty() {
        0
    } else {
        study.grid.iter().map(|axis| axis.values.len()).product()
    };
    let named = number
        .checked_sub(from_grid)
        .and_then(|number| study.cells.get(number));
    named
        .map(|cell| &cell.name)
        .or_else(|| draft.overrides.last().map(|(place, _)| *place))
        .or(study.scenario.as_ref())
}

fn error(place: Option<&Located<String>>, study: &Study, message: &str) -> ValidationError {
    place.map_or_else(
        || study.repeats.error(message),
        |place| place.error(message),
    )
}

impl<'a> Draft<'a> {
    fn with(mut self, overrides: impl Iterator<Item = (&'a Located<String>, String)>) -> Self {
        self.overrides
            .extend(overrides.filter(|(_, text)| !text.trim().is_empty()));
        self
    }

    /// The same cell with one value of an axis.
    fn along(&self, axis: &'a Axis, number: usize, label: &str) -> Self {
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
        let along = axis.with.get(number).into_iter().flatten();
        draft
            .with(set)
            .with(along.map(|template| (template, template.replace("{}", value))))
    }

    fn build(
        self,
        folder: &Path,
        figures: &[Figure],
        error_place: Option<&Located<String>>,
    ) -> Result<Cell, ValidationError> {
        let Some((place, scenario)) = &self.scenario else {
            let place = error_place.cloned().unwrap_or_default();
            return Err(place.error(
                "this cell has no scenario; expected `scenario: \"….ron\"` in the study or in the \
                 cell",
            ));
        };
        let path = folder.join(scenario);
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
            scenario: path,
            overrides,
            experiment,
            name,
        })
    }
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
    let of_figure = |figure: &Figure| match figure {
        Figure::Visitation { episodes, .. } if figure.shows(cell) => episodes
            .iter()
            .map(|upto| EpisodeWindow::episodes(*upto))
            .collect(),
        _ => Vec::new(),
    };
    figures.iter().flat_map(of_figure).collect()
}

/// Checks that the runs of every cell have all measures that claims and figures need.
fn check_measures(study: &Study, cells: &[Cell]) -> Result<(), ValidationError> {
    let measures = study.measures.iter().chain(
        study
            .claims
            .iter()
            .filter_map(|claim| claim.measure.as_ref()),
    );
    for measure in measures {
        missing_measure(cells.iter(), **measure)
            .map_or(Ok(()), |message| Err(measure.error(message)))?;
    }
    for figure in &study.figures {
        let shown = cells.iter().filter(|cell| figure.shows(&cell.name));
        let message = figure
            .required_measure(study.main_measure())
            .and_then(|measure| missing_measure(shown, measure));
        message.map_or(Ok(()), |message| {
            Err(figure.error(
                study,
                format!("for the figure `{}`: {message}", figure.kind()),
            ))
        })?;
    }
    Ok(())
}

/// Message about the first cell whose runs do not have a measure.
fn missing_measure<'a>(
    mut cells: impl Iterator<Item = &'a Cell>,
    measure: Measure,
) -> Option<String> {
    let lack = |cell: &Cell| {
        cell.experiment
            .lacks(measure)
            .map(|(lack, help)| (cell.name.clone(), lack, help))
    };
    let (name, lack, help) = cells.find_map(lack)?;
    Some(format!(
        "cell `{name}` does not have this measure: {lack}; {help}"
    ))
}
