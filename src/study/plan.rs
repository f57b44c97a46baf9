//! A study read and checked: its cells, each with the scenario that it comes to.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::course::{Course, Override};
use super::figure::{Figure, Upto};
use super::file::{Axis, NamedCell, Study};
use super::measure::Measure;
use crate::input::{self, Complaint, Document, InputError, Located};

/// A study that can be run.
#[derive(Clone, Debug)]
pub struct StudyPlan {
    /// The study's name: its file's stem.
    pub name: String,
    /// Its file.
    pub path: PathBuf,
    /// What stands there, and how.
    pub document: Document<Study>,
    /// Whether it is run as `quick` says.
    pub quick: bool,
    /// The settings: first the grid's, the last axis running fastest, then the named ones.
    pub cells: Vec<Cell>,
}

/// One setting of a study.
#[derive(Clone, Debug)]
pub struct Cell {
    /// Unique within the study.
    pub name: String,
    /// The scenario's file.
    pub scenario: PathBuf,
    /// What is replaced there.
    pub overrides: Vec<String>,
    /// What runs.
    pub course: Course,
    /// Tells what runs of this cell depend on, besides their seeds.
    pub digest: String,
    /// Of which first episodes the first run keeps states: each once, from short to long.
    pub windows: Vec<u32>,
}

/// One run of a study.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// Counts all runs of the study: cell by cell, seed by seed.
    pub index: usize,
    /// Whose.
    pub cell: &'a Cell,
    /// The run's seed.
    pub seed: u64,
    /// Whether it is the cell's first run, whose states are kept.
    pub is_first: bool,
}

impl StudyPlan {
    /// Reads and checks a study with all its scenarios and their tasks.
    ///
    /// # Errors
    /// Whatever is wrong with any of them, with its place in the study.
    pub fn load(path: &Path, quick: bool) -> Result<Self, InputError> {
        let document: Document<Study> = input::read(path)?;
        let built =
            cells(&document.value, path, quick).map_err(|complaint| document.locate(complaint))?;
        let names: Vec<&str> = built.iter().map(|cell| cell.name.as_str()).collect();
        document
            .value
            .check(&names)
            .map_err(|complaint| document.locate(complaint))?;
        check_measures(&document.value, &built).map_err(|complaint| document.locate(complaint))?;
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

    /// What stands in the file.
    #[must_use]
    pub fn study(&self) -> &Study {
        &self.document.value
    }

    /// Runs of each cell.
    #[must_use]
    pub fn repeats(&self) -> u64 {
        let (all, quick) = (self.study().repeats.get(), self.study().quick.repeats.get());
        u64::from(if self.quick { quick.min(all) } else { all })
    }

    /// All runs, by their indices.
    #[must_use]
    pub fn tasks(&self) -> Vec<Task<'_>> {
        let first_seed = *self.study().first_seed;
        let runs = self
            .cells
            .iter()
            .flat_map(|cell| (0..self.repeats()).map(move |repeat| (cell, repeat)));
        let task = |(index, (cell, repeat)): (usize, (_, u64))| Task {
            index,
            cell,
            seed: first_seed + repeat,
            is_first: repeat == 0,
        };
        runs.enumerate().map(task).collect()
    }

    /// All runs but those that are another's again, because their cells have the same settings under two names.
    #[must_use]
    pub fn distinct_tasks(&self) -> Vec<Task<'_>> {
        let mut seen = HashSet::new();
        self.tasks()
            .into_iter()
            .filter(|task| seen.insert((task.cell.digest.as_str(), task.seed)))
            .collect()
    }

    /// The default folder of its results.
    #[must_use]
    pub fn default_folder(&self) -> PathBuf {
        let suffix = if self.quick { "-quick" } else { "" };
        Path::new("recordings")
            .join("studies")
            .join(format!("{}{suffix}", self.name))
    }
}

impl Task<'_> {
    /// Of which first episodes states are kept.
    #[must_use]
    pub fn windows(&self) -> &[u32] {
        if self.is_first {
            &self.cell.windows
        } else {
            &[]
        }
    }
}

/// A cell in the making. Values stay with the place that is to blame for them.
#[derive(Clone, Default)]
struct Draft<'a> {
    words: Vec<String>,
    scenario: Option<Override<'a>>,
    overrides: Vec<Override<'a>>,
}

fn cells(study: &Study, path: &Path, quick: bool) -> Result<Vec<Cell>, Complaint> {
    let base = Draft {
        scenario: study.scenario.as_ref().map(as_it_stands),
        ..Draft::default()
    };
    let base = base.with(study.set.iter().map(as_it_stands));
    let mut drafts = if study.grid.is_empty() {
        Vec::new()
    } else {
        grid(&base, &study.grid)?
    };
    drafts.extend(study.cells.iter().map(|cell| named(&base, cell)));
    if drafts.is_empty() {
        drafts.push(Draft {
            words: vec!["all".to_owned()],
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
        let blamed = blamed(study, number, &draft);
        let cell =
            draft
                .with(last.iter().map(as_it_stands))
                .build(folder, &study.figures, blamed)?;
        if built.iter().any(|other| other.name == cell.name) {
            return Err(complain(
                blamed,
                study,
                &format!("there are two cells named `{}`", cell.name),
            ));
        }
        built.push(cell);
    }
    share_windows(&mut built);
    Ok(built)
}

/// Cells of the same settings share their runs, which keep the states that any of them shows.
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

fn as_it_stands(text: &Located<String>) -> (&Located<String>, String) {
    (text, text.value().clone())
}

/// Every combination of the axes' values, the last axis running fastest.
fn grid<'a>(base: &Draft<'a>, axes: &'a [Axis]) -> Result<Vec<Draft<'a>>, Complaint> {
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

fn labels(axis: &Axis) -> Result<Vec<String>, Complaint> {
    let values: Vec<String> = axis
        .values
        .iter()
        .map(|value| value.value().clone())
        .collect();
    if values.is_empty() {
        return Err(axis.values.complain("expected at least one value"));
    }
    let templates = axis.scenario.iter().chain(&axis.set);
    if !templates.clone().any(|template| template.contains("{}")) {
        return Err(axis
            .values
            .complain("nothing in this axis' `scenario` or `set` holds `{}`, where values go"));
    }
    match &axis.labels {
        Some(labels) if labels.len() != values.len() => Err(labels.complain(format!(
            "expected {} labels, one for each value, found {}",
            values.len(),
            labels.len()
        ))),
        Some(labels) => Ok(labels.value().clone()),
        None => Ok(values),
    }
}

fn check_with(axis: &Axis) -> Result<(), Complaint> {
    let (values, lists) = (axis.values.len(), axis.with.len());
    if lists == 0 || lists == values {
        return Ok(());
    }
    Err(axis.with.complain(format!(
        "expected {values} lists, one for each value, found {lists}"
    )))
}

fn named<'a>(base: &Draft<'a>, cell: &'a NamedCell) -> Draft<'a> {
    let scenario = cell
        .scenario
        .as_ref()
        .map(as_it_stands)
        .or_else(|| base.scenario.clone());
    let draft = Draft {
        words: vec![cell.name.value().clone()],
        scenario,
        ..base.clone()
    };
    draft.with(cell.set.iter().map(as_it_stands))
}

/// What stands for the cell as a whole: its name, or the last value of its axes.
fn blamed<'a>(study: &'a Study, number: usize, draft: &Draft<'a>) -> Option<&'a Located<String>> {
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

fn complain(blamed: Option<&Located<String>>, study: &Study, message: &str) -> Complaint {
    blamed.map_or_else(
        || study.repeats.complain(message),
        |place| place.complain(message),
    )
}

impl<'a> Draft<'a> {
    fn with(mut self, overrides: impl Iterator<Item = (&'a Located<String>, String)>) -> Self {
        self.overrides
            .extend(overrides.filter(|(_, text)| !text.trim().is_empty()));
        self
    }

    /// The same with one value of an axis.
    fn along(&self, axis: &'a Axis, number: usize, label: &str) -> Self {
        let (mut draft, value) = (self.clone(), &axis.values[number]);
        draft
            .words
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
        blamed: Option<&Located<String>>,
    ) -> Result<Cell, Complaint> {
        let Some((place, scenario)) = &self.scenario else {
            let place = blamed.cloned().unwrap_or_default();
            return Err(place.complain("this cell has no scenario; expected `scenario: \"….ron\"` in the study or in the cell"));
        };
        let path = folder.join(scenario);
        let course = Course::load(&path, place, &self.overrides, blamed.unwrap_or(place))?;
        let (name, overrides) = (
            self.words.join(", "),
            self.overrides.into_iter().map(|(_, text)| text).collect(),
        );
        Ok(Cell {
            digest: course.digest(),
            windows: windows(figures, &name),
            scenario: path,
            overrides,
            course,
            name,
        })
    }
}

/// The windows of all figures of visited states that show a cell.
fn windows(figures: &[Figure], cell: &str) -> Vec<u32> {
    let of_figure = |figure: &Figure| match figure {
        Figure::Visitation { episodes, .. } if figure.shows(cell) => {
            episodes.iter().map(|upto| Upto::episodes(*upto)).collect()
        }
        _ => Vec::new(),
    };
    figures.iter().flat_map(of_figure).collect()
}

/// Every cell can tell everything that is measured.
fn check_measures(study: &Study, cells: &[Cell]) -> Result<(), Complaint> {
    let measures = study.measures.iter().chain(
        study
            .claims
            .iter()
            .filter_map(|claim| claim.measure.as_ref()),
    );
    for measure in measures {
        lacking(cells.iter(), **measure)
            .map_or(Ok(()), |message| Err(measure.complain(message)))?;
    }
    for figure in &study.figures {
        let shown = cells.iter().filter(|cell| figure.shows(&cell.name));
        let message = figure
            .shown(study.main_measure())
            .and_then(|measure| lacking(shown, measure));
        message.map_or(Ok(()), |message| {
            Err(figure.complain(
                study,
                format!("for the figure `{}`: {message}", figure.kind()),
            ))
        })?;
    }
    Ok(())
}

/// Which cell cannot tell a measure, and why.
fn lacking<'a>(mut cells: impl Iterator<Item = &'a Cell>, measure: Measure) -> Option<String> {
    let lack = |cell: &Cell| {
        cell.course
            .lacks(measure)
            .map(|(lack, help)| (cell.name.clone(), lack, help))
    };
    let (name, lack, help) = cells.find_map(lack)?;
    Some(format!("cell `{name}` cannot tell this: {lack}; {help}"))
}
