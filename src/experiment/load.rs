//! Loads the experiment of a scenario file: a training scenario or a tabular scenario.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::Experiment;
use crate::input_files;
use crate::run::{Plan, folder};
use crate::scenario;
use crate::scenario::overrides;
use crate::scenario::resolve::Resolve;
use crate::tabular::{TabularPlan, TabularScenario};
use seedbed_input::{Document, FileKind, FormerName, InputError};
use seedbed_learn::experience::replay::RowWidths;

/// An input error, and the step of loading in which it was found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{error}")]
pub struct LoadError {
    /// Failed step.
    pub step: LoadStep,
    /// What is wrong, and where.
    pub error: InputError,
}

/// A step of loading an experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoadStep {
    /// Reading the scenario file.
    Read,
    /// Applying the override with this index.
    Override(usize),
    /// Checking the scenario with its overrides and its task.
    Check,
}

impl LoadStep {
    /// The error that this step failed with.
    fn failed(self, error: InputError) -> LoadError {
        LoadError { step: self, error }
    }
}

/// The experiment of a scenario file.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The experiment.
    pub experiment: Arc<dyn Experiment>,
    /// Fields that have their former names in the scenario file.
    pub former_names: Vec<FormerName>,
}

/// An error at the field of a scenario file that says how many transitions its replay buffer has. `None` if
/// the file does not say it, or if the buffer needs at most `bytes`.
#[must_use]
pub fn error_at_replay(
    path: &Path,
    overrides: &[String],
    bytes: u64,
    message: &str,
) -> Option<InputError> {
    let document = overrides::apply_all(folder::read_scenario(path).ok()?, overrides).ok()?;
    let (description, _) = scenario::read_task(&document, path).ok()?;
    let replay = document.value.algorithm.config().replay()?;
    let transition = RowWidths::from(description.spec()).bytes() as u64;
    let is_to_blame = replay.has_place() && u64::from(replay.get()) * transition > bytes;
    is_to_blame.then(|| document.locate(replay.error(message)))
}

/// Reads the scenario at `path`, applies `overrides`, each of which has the form
/// `path.to.field=value`, and checks the result together with its task.
///
/// # Errors
/// If the file, an override or the task's file is invalid.
pub fn load(path: &Path, overrides: &[String]) -> Result<Loaded, LoadError> {
    let origin = path.display().to_string();
    let text = input_files::read_text(path).map_err(|error| LoadStep::Read.failed(error))?;
    let kind = seedbed_input::file_kind(&origin, &text);
    if matches!(kind, Ok(FileKind::TabularScenario)) {
        let document: Result<Document<TabularScenario>, _> = overrides::parse(path, &text);
        let document = with_overrides(document, overrides)?;
        return Ok(Loaded {
            former_names: document.former_names,
            experiment: Arc::new(TabularPlan::new(path, document.value)),
        });
    }
    if let Ok(
        kind @ (FileKind::Study
        | FileKind::Tuning
        | FileKind::Environment
        | FileKind::TabularEnvironment
        | FileKind::Gymnasium),
    ) = kind
    {
        return Err(LoadStep::Read.failed(wrong_kind(&origin, kind)));
    }
    // Files of any other kind are refused with the errors of a `Scenario`.
    let document = with_overrides(folder::parse_scenario(path, &text), overrides)?;
    let former_names = document.former_names.clone();
    let plan = Plan::from_document(document, path);
    let plan = plan.map_err(|error| LoadStep::Check.failed(error))?;
    Ok(Loaded {
        experiment: Arc::new(plan),
        former_names,
    })
}

/// Paths of the files that [`load`] reads: the scenario, its task, and what the task extends. Built-in
/// files have paths such as `builtin:envs/cartpole.ron`.
///
/// # Errors
/// See [`load`].
pub fn files_read(path: &Path, overrides: &[String]) -> Result<Vec<PathBuf>, LoadError> {
    let origin = path.display().to_string();
    let text = input_files::read_text(path).map_err(|error| LoadStep::Read.failed(error))?;
    let mut files = vec![path.to_owned()];
    if matches!(
        seedbed_input::file_kind(&origin, &text),
        Ok(FileKind::TabularScenario)
    ) {
        return Ok(files);
    }
    let document = with_overrides(folder::parse_scenario(path, &text), overrides)?;
    let of_task = scenario::files_of_task(&document, path);
    files.extend(of_task.map_err(|error| LoadStep::Check.failed(error))?);
    Ok(files)
}

/// The error that a file is no scenario, with the command that is meant for it.
fn wrong_kind(origin: &str, kind: FileKind) -> InputError {
    let (noun, command) = match kind {
        FileKind::Study => ("a study", "study"),
        FileKind::Tuning => ("a search for parameters", "tune"),
        _ => ("an environment", "preview"),
    };
    InputError {
        help: Some(format!("use `seedbed {command} {origin}`")),
        ..InputError::about(origin, format!("expected a scenario, found {noun}"))
    }
}

fn with_overrides<T: Resolve>(
    document: Result<Document<T>, InputError>,
    overrides: &[String],
) -> Result<Document<T>, LoadError> {
    let mut document = document.map_err(|error| LoadStep::Read.failed(error))?;
    for (index, assignment) in overrides.iter().enumerate() {
        document = overrides::apply(&document, assignment)
            .map_err(|error| LoadStep::Override(index).failed(error))?;
    }
    Ok(document)
}
