//! Whether the run in a folder is one of a plan.

use super::Options;
use crate::run::error::RunError;
use crate::run::folder;
use crate::run::plan::Plan;
use seedbed_env::gymnasium::GymnasiumTask;
use seedbed_settings::{Difference, Settings};

/// The setting that says which Python file has the environment of a task.
const SOURCE: &str = "found.source_sha256";

/// Checks that the folder contains a run of this plan. `stop` may differ, so that a run can be
/// extended.
pub(super) fn check_same_run(plan: &Plan, options: &Options) -> Result<(), RunError> {
    let folder = &options.folder;
    let mut stored = folder::read_scenario(&folder.scenario_file())?;
    stored.value.stop = plan.scenario.stop.clone();
    let task = &*stored.value.environment.task_name();
    let task_text = seedbed_input::read_text(&folder.task_file(task))?;
    let stored_text = stored.value.beside_its_task(&plan.name, task).resolved();
    let run = folder.path().display();
    check_equal(
        &scenario_settings(&stored_text),
        &scenario_settings(&plan.stored_scenario()),
        |stored, planned| {
            format!(
                "the run in {run} cannot be resumed with this scenario: the run has {stored}, the scenario has {planned}"
            )
        },
    )?;
    // A run may continue with a corrected Python file.
    let settings = |text: &str| {
        let settings = seedbed_env::task_settings(text);
        if options.other_versions {
            settings.without(SOURCE)
        } else {
            settings
        }
    };
    let task = &plan.description.spec().name;
    check_equal(
        &settings(&task_text),
        &settings(&plan.environment_text),
        |stored, planned| {
            if stored.contains(SOURCE) {
                let python_file = plan
                    .description
                    .gymnasium()
                    .and_then(GymnasiumTask::python_file);
                let place =
                    python_file.map_or_else(String::new, |file| format!(" ({})", file.display()));
                return format!(
                    "the Python file of `{task}` has changed since the run in {run} began{place}; resume it with the \
                     changed file with `--other-versions`, or begin a new run with `--out` or `--overwrite`"
                );
            }
            format!(
                "the task `{task}` has changed since the run in {run} began: it had {stored}, it has {planned}"
            )
        },
    )
}

/// Checks that two trees of settings have the same values. `reason` gets the first value that differs as it
/// was and as it is.
fn check_equal(
    stored: &Settings,
    planned: &Settings,
    reason: impl FnOnce(&str, &str) -> String,
) -> Result<(), RunError> {
    let Some(Difference {
        path,
        first,
        second,
    }) = stored.differences(planned).into_iter().next()
    else {
        return Ok(());
    };
    let reason = reason(&shown(&path, first), &shown(&path, second));
    Err(RunError::CannotResume(reason))
}

/// All values of the text of a scenario with all defaults.
fn scenario_settings(text: &str) -> Settings {
    Settings::of(text).expect("a resolved scenario is RON")
}

/// A setting as it is written in files.
fn shown(path: &str, value: Option<String>) -> String {
    match value {
        Some(value) => format!("`{path}: {value}`"),
        None => format!("no `{path}`"),
    }
}
