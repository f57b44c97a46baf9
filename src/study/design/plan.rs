//! A study plan: a checked study file with its cells, their scenarios, and their runs.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::cell::{Cell, PlannedRun, missing_measure, unequal_axes, warnings_of};
use super::drafts::cells;
use super::figure::{CurveAxis, Figure};
use super::file::Study;
use super::lock::Lock;
use crate::study::external::{ExternalRuns, Problem};
use crate::text::{file_stem, pluralize};
use seedbed_input::{Document, InputError, ValidationError};
use seedbed_stats::MIN_RUNS;

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

impl StudyPlan {
    /// Reads and checks a study, all its scenarios and their tasks, and all results of others.
    ///
    /// # Errors
    /// The first error in any of these files. If it is not in a file of results, it is located in the
    /// study file.
    pub fn load(path: &Path, quick: bool) -> Result<Self, InputError> {
        let plan = Self::load_before_results(path, quick)?;
        for cell in &plan.cells {
            if let Some(runs) = cell.source.found() {
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
        let document = Study::read(path)?;
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

    /// Why the study may not say what it seems to: warnings of its cells, and too few runs for verdicts.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = warnings_of(&self.cells);
        let has_verdicts = self.study().claims.iter().any(|claim| claim.confirmatory);
        let has_own_runs = self.cells.iter().any(|cell| cell.source.found().is_none());
        if has_verdicts && has_own_runs && !self.quick && self.repeats() < MIN_RUNS as u64 {
            warnings.push(format!(
                "there are no verdicts on claims with {} of each cell: expected `repeats: {MIN_RUNS}` or more",
                pluralize(self.repeats() as usize, "run")
            ));
        }
        warnings
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
            if let Some(external) = cell.source.found() {
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
            .filter(|run| seen.insert((run.cell.digest(), run.run_seed)))
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

/// Checks that the runs of every cell have all measures of the study, and the runs of the cells of its
/// claims and figures those that these need.
fn check_measures(study: &Study, cells: &[Cell]) -> Result<(), ValidationError> {
    for measure in study.measures.iter() {
        missing_measure(cells.iter(), **measure)
            .map_or(Ok(()), |message| Err(measure.error(message)))?;
    }
    for claim in &study.claims {
        let compared: Vec<&Cell> = cells
            .iter()
            .filter(|cell| claim.is_about(&cell.name))
            .collect();
        if let Some(measure) = &claim.measure
            && let Some(message) = missing_measure(compared.iter().copied(), **measure)
                .or_else(|| unequal_axes(&compared, **measure))
        {
            return Err(measure.error(message));
        }
    }
    for figure in &study.figures {
        check_figure_of_external_cells(study, figure, cells)?;
        check_axes(figure, cells)?;
        let shown_cells = cells.iter().filter(|cell| figure.shows(&cell.name));
        let message = figure
            .required_measure(study.main_measure())
            .and_then(|measure| missing_measure(shown_cells, measure));
        message.map_or(Ok(()), |message| {
            Err(figure.error(
                &study.measures,
                format!("for the figure `{}`: {message}", figure.kind()),
            ))
        })?;
    }
    Ok(())
}

/// Checks that all cells of a figure have the observations on its axes.
fn check_axes(figure: &Figure, cells: &[Cell]) -> Result<(), ValidationError> {
    let Figure::Scatter {
        axes: Some((x, y)), ..
    } = figure
    else {
        return Ok(());
    };
    for cell in cells.iter().filter(|cell| figure.shows(&cell.name)) {
        let observations = cell.source.observations();
        let has = |name: &str| observations.iter().any(|quantity| quantity.name == name);
        if let Some(axis) = [x, y].into_iter().find(|axis| !has(axis)) {
            let known: Vec<&str> = observations
                .iter()
                .map(|quantity| quantity.name.as_str())
                .collect();
            return Err(axis.error(format!(
                "cell `{}` has no observation `{}`; expected one of {}",
                cell.name,
                axis.as_str(),
                known.join(", ")
            )));
        }
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
        cell.source.found()
    };
    let shows_states = !figure.windows().is_empty();
    if shows_states
        && let Some(name) = figure
            .cells()
            .iter()
            .find(|name| external(name.as_str()).is_some())
    {
        return Err(
            name.error("results of others have no visited states; expected cells with a scenario")
        );
    }
    let is_of_others = |cell: &Cell| cell.source.found().is_some();
    if shows_states && cells.iter().all(is_of_others) {
        let message = format!(
            "for the figure `{}`: results of others have no visited states; expected a cell with a scenario, or no such figure: \
             `seedbed plot` draws recordings",
            figure.kind()
        );
        return Err(figure.error(&study.measures, message));
    }
    for cell in cells.iter().filter(|cell| figure.shows(&cell.name)) {
        let unknown = cell.source.found().map(ExternalRuns::unknown);
        let reason = match (figure.counted(), unknown.unwrap_or_default()) {
            (Some(CurveAxis::Episodes), unknown) if unknown.episodes => {
                "has means over several episodes, so that episodes are not known"
            }
            (Some(CurveAxis::EnvSteps), unknown) if unknown.env_steps => {
                "has no environment steps in its files"
            }
            (Some(CurveAxis::GradientSteps), unknown) if unknown.gradient_steps => {
                "has no gradient steps in its files"
            }
            _ => continue,
        };
        let message = format!(
            "for the figure `{}`: cell `{}` {reason}; expected `cells` without it",
            figure.kind(),
            cell.name
        );
        return Err(figure.error(&study.measures, message));
    }
    Ok(())
}
