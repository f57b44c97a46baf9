//! Whether the run in a folder is one of a plan.

use super::Options;
use crate::run::error::RunError;
use crate::run::folder;
use crate::run::plan::Plan;
use crate::scenario;
use seedbed_settings::{Difference, Settings};

/// Checks that the folder contains a run of this plan. `stop` may differ, so that a run can be
/// extended.
pub(super) fn check_same_run(plan: &Plan, options: &Options) -> Result<(), RunError> {
    let folder = &options.folder;
    let mut stored = folder::read_scenario(&folder.scenario_file())?;
    stored.value.stop = plan.scenario.stop.clone();
    let task = scenario::task_name(&stored.value.environment);
    let task_text = seedbed_input::read_text(&folder.task_file(task))?;
    let stored_text = stored.value.beside_its_task(&plan.name, task).resolved();
    if let Some(difference) = first_difference(
        &scenario_settings(&stored_text),
        &scenario_settings(&plan.stored_scenario()),
    ) {
        return Err(RunError::CannotResume(format!(
            "the run in {} cannot be resumed with this scenario: the run has {}, the scenario has {}",
            folder.path().display(),
            shown(&difference.path, difference.first),
            shown(&difference.path, difference.second)
        )));
    }
    let settings = seedbed_env::task_settings;
    if let Some(difference) =
        first_difference(&settings(&task_text), &settings(&plan.environment_text))
    {
        return Err(RunError::CannotResume(format!(
            "the task `{}` has changed since the run in {} began: it had {}, it has {}",
            plan.description.spec().name,
            folder.path().display(),
            shown(&difference.path, difference.first),
            shown(&difference.path, difference.second)
        )));
    }
    Ok(())
}

/// All values of the text of a scenario with all defaults.
fn scenario_settings(text: &str) -> Settings {
    Settings::of(text).expect("a resolved scenario is RON")
}

fn first_difference(stored: &Settings, planned: &Settings) -> Option<Difference> {
    stored.differences(planned).into_iter().next()
}

/// A setting as it is written in files.
fn shown(path: &str, value: Option<String>) -> String {
    match value {
        Some(value) => format!("`{path}: {value}`"),
        None => format!("no `{path}`"),
    }
}
