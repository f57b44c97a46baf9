//! A scenario and its task, read and checked.

use std::path::Path;

use super::folder::checksums::Checksums;
use super::folder::{self, RunFolder};
use crate::scenario::{self, Scenario, overrides};
use crate::text::file_stem;
use seedbed_env::{Choice, TaskDescription, TaskSpec};
use seedbed_input::{Document, InputError, WITH_REPLACED_VALUES, quoted_list};
use seedbed_scene::outline;

/// A scenario and its task, read and checked: all that determines the results of a run.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The scenario's name: its file's stem.
    pub name: String,
    /// The scenario.
    pub scenario: Scenario,
    /// The task.
    pub description: TaskDescription,
    /// The text of the task's file.
    pub environment_text: String,
}

impl Plan {
    /// Reads and checks a scenario and its task.
    ///
    /// # Errors
    /// A mistake in either file, with its location.
    pub fn load(path: &Path, overrides: &[String]) -> Result<Self, InputError> {
        let document = overrides::apply_all(folder::read_scenario(path)?, overrides)?;
        Self::from_document(document, path)
    }

    /// Reads the plan of the run in a folder.
    ///
    /// # Errors
    /// The scenario or its task is damaged or was changed after the run began, or has a mistake.
    pub fn of_run(folder: &RunFolder) -> Result<Self, InputError> {
        if folder.has_state_files() && !folder.scenario_file().is_file() {
            let path = folder.path().display().to_string();
            let message = "another program made this run: its policies and its scenario are not in the recording";
            return Err(InputError::about(&path, message.to_owned()));
        }
        Checksums::read(folder)?.verify_scenario()?;
        Self::load(&folder.scenario_file(), &[])
    }

    /// This plan of the run in a folder, in another task with the same observations and actions: one with this name or path, or
    /// `Gymnasium(…)`.
    ///
    /// # Errors
    /// There is no such task, it has a mistake, or it has other observations or actions.
    pub fn in_environment(
        &self,
        folder: &RunFolder,
        environment: &str,
    ) -> Result<Self, InputError> {
        let environment = match Path::new(environment).canonicalize() {
            Ok(path) if path.is_file() => format!("{:?}", path.to_string_lossy()),
            _ => environment.to_owned(),
        };
        let plan = Self::load(
            &folder.scenario_file(),
            &[format!("environment={environment}")],
        );
        let plan = plan.map_err(without_assignment)?;
        check_interface(self.description.spec(), plan.description.spec())?;
        Ok(Self {
            name: self.name.clone(),
            ..plan
        })
    }

    /// The outlines of bodies of the task that never move, m: `[lines]` of `[points]`; none if the task has no bodies.
    #[must_use]
    pub fn walls(&self) -> Vec<Vec<[f32; 2]>> {
        let shapes = self.fixed_shapes().into_iter();
        shapes.map(|(points, _)| points).collect()
    }

    /// The shapes of bodies of the task that never move, as of [`outline::fixed_shapes`]; none if the task has no bodies.
    #[must_use]
    pub fn fixed_shapes(&self) -> Vec<(Vec<[f32; 2]>, Option<f32>)> {
        if self.description.gymnasium().is_some() {
            return Vec::new();
        }
        let environment = seedbed_env::build(&self.description, self.scenario.physics, 1);
        environment.map_or(Vec::new(), |environment| {
            outline::fixed_shapes(&*environment)
        })
    }

    /// Text of the scenario in the folder of a run, which names the copy of the task in this folder.
    #[must_use]
    pub fn stored_scenario(&self) -> String {
        let task = &self.description.spec().name;
        self.scenario.beside_its_task(&self.name, task).resolved()
    }

    /// Checks the scenario that was read from `path`, and reads its task.
    ///
    /// # Errors
    /// A mistake in either file, with its location.
    pub fn from_document(document: Document<Scenario>, path: &Path) -> Result<Self, InputError> {
        let (description, environment_text) = scenario::read_task(&document, path)?;
        check(&document, &description)?;
        let name = document.value.name.as_str();
        Ok(Self {
            name: if name.is_empty() {
                file_stem(path, "run")
            } else {
                name.to_owned()
            },
            environment_text,
            scenario: document.value,
            description,
        })
    }
}

/// An error in the scenario with another task, of which a user has written the task only.
fn without_assignment(error: InputError) -> InputError {
    let is_of_task = !error.origin.starts_with("--set ");
    if is_of_task && !error.origin.ends_with(WITH_REPLACED_VALUES) {
        return error;
    }
    InputError {
        origin: "--environment".to_owned(),
        position: None,
        field: String::new(),
        ..error
    }
}

/// Checks that policies which were trained in one task can act in another.
fn check_interface(trained_in: &TaskSpec, other: &TaskSpec) -> Result<(), InputError> {
    let [expected, found] = [trained_in, other].map(interface);
    if expected == found {
        return Ok(());
    }
    let message = format!(
        "policies that were trained in `{}` cannot act in `{}`, since it has other observations or actions",
        trained_in.name, other.name
    );
    Err(InputError {
        help: Some(format!("expected {expected}; found {found}")),
        ..InputError::about("--environment", message)
    })
}

/// The observations and actions of a task.
fn interface(task: &TaskSpec) -> String {
    let names = task
        .observations
        .iter()
        .map(|observation| &*observation.name);
    let actions: Vec<String> = task
        .actions
        .iter()
        .map(|action| match &action.choice {
            Choice::Discrete(values) => {
                format!("`{}` ({} choices)", action.quantity.name, values.len())
            }
            Choice::Continuous => format!("`{}`", action.quantity.name),
        })
        .collect();
    format!(
        "observations {} and actions {}",
        quoted_list(names),
        actions.join(", ")
    )
}

/// Checks what depends on several fields, or on the scenario and its task together.
fn check(document: &Document<Scenario>, description: &TaskDescription) -> Result<(), InputError> {
    let scenario = &document.value;
    scenario.check().map_err(|error| document.locate(error))?;
    scenario
        .recording
        .check_pairs(description.spec())
        .map_err(|error| document.locate(error))?;
    let task_check = scenario.algorithm.config().check_task(description.spec());
    task_check.map_err(|message| document.locate(scenario.algorithm.error(message)))?;
    seedbed_env::build(description, scenario.physics, 1).map(|_| ())
}
