//! A scenario and its task, read and checked.

use std::path::Path;

use super::folder::checksums::Checksums;
use super::folder::{self, RunFolder};
use crate::scenario::{self, Scenario, overrides};
use crate::text::file_stem;
use seedbed_env::TaskDescription;
use seedbed_input::{Document, InputError};

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
        Checksums::read(folder)?.verify_scenario()?;
        Self::load(&folder.scenario_file(), &[])
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
