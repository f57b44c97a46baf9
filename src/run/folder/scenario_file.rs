//! Scenarios in the folders of runs, which name the copies of tasks beside them.

use std::path::Path;

use super::checksums::Checksums;
use super::{Contents, RunFolder};
use crate::input_files;
use crate::scenario::{self, Scenario, overrides};
use seedbed_input::{Document, InputError};

/// Reads a scenario. That of a run names the copy of the task in the folder of the run, however it was
/// named when the run began: names and paths may mean another task, or none, where the folder is now.
///
/// # Errors
/// The file cannot be read, is no scenario, or belongs to a run that has lost the copy of its task.
pub fn read_scenario(path: &Path) -> Result<Document<Scenario>, InputError> {
    parse_scenario(path, &input_files::read_text(path)?)
}

/// Like [`read_scenario`], for a text that was read from `path`.
///
/// # Errors
/// See [`read_scenario`].
pub fn parse_scenario(path: &Path, text: &str) -> Result<Document<Scenario>, InputError> {
    let mut document: Document<Scenario> = overrides::parse(path, text)?;
    if let Some(folder) = folder_of_scenario(path) {
        let task = document.value.environment.task_name().into_owned();
        if folder.task_file(&task).is_file() {
            document.value.environment = scenario::environment_in_folder(&task);
        } else {
            Checksums::read(&folder)?.check_presence(&folder.task_file(&task))?;
        }
    }
    Ok(document)
}

/// The directory of the run whose scenario is at `path`; `None` if it is not that of a run.
fn folder_of_scenario(path: &Path) -> Option<RunFolder> {
    let folder = RunFolder::new(path.parent()?);
    let is_named_so = !input_files::is_builtin(path) && folder.scenario_file() == path;
    let is_of_run = is_named_so
        && (folder.checksums_file().is_file()
            || matches!(
                folder.contents(),
                Contents::FinishedRun | Contents::UnfinishedRun
            ));
    is_of_run.then_some(folder)
}
