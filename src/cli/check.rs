//! `seedbed check`.

use std::path::{Path, PathBuf};

use super::{CliError, former_names, pluralize};
use seedbed::experiment::Experiment;
use seedbed::input_files::{self, Directory};
use seedbed::run::Plan;
use seedbed::study::design::cell::warnings_of;
use seedbed::study::design::plan::StudyPlan;
use seedbed::study::tuning::file::Tuning;
use seedbed::study::tuning::plan::TuningFile;
use seedbed::tabular;
use seedbed_env::{Choice, Physics, TaskSpec, physics_warnings};
use seedbed_input::numbers::readable;
use seedbed_input::{FileKind, InputError, former_names_in};

/// Maximum number of observations that are listed by name.
pub(super) const MAX_NAMED_OBSERVATIONS: usize = 30;

/// Checks every file and prints the result; an error if a file is invalid.
pub(super) fn check(files: &[PathBuf]) -> Result<(), CliError> {
    let mut invalid = 0;
    for path in files {
        match find_and_check(path) {
            Ok(Checked {
                description,
                warnings,
            }) => {
                say!("ok: {}: {description}", path.display());
                for warning in warnings {
                    say!("warning: {}: {warning}", path.display());
                }
            }
            Err(error) => {
                invalid += 1;
                note!("error: {error}");
            }
        }
    }
    if invalid == 0 {
        Ok(())
    } else {
        Err(CliError::InvalidFiles(invalid))
    }
}

/// A valid file.
struct Checked {
    description: String,
    /// Why the file may not do what it seems to do.
    warnings: Vec<String>,
}

fn find_and_check(path: &Path) -> Result<Checked, InputError> {
    let directories = [Directory::Scenarios, Directory::Environments];
    check_file(&input_files::find_argument(path, &directories)?)
}

fn check_file(path: &Path) -> Result<Checked, InputError> {
    let text = input_files::read_text(path)?;
    let names = former_names_in(&text).into_iter();
    let mut warnings: Vec<String> = names.map(former_names::sentence).collect();
    let description = match seedbed_input::file_kind(&path.display().to_string(), &text)? {
        FileKind::Environment | FileKind::TabularEnvironment | FileKind::Gymnasium => {
            let (task, _) = input_files::read_task(path)?;
            warnings.extend(physics_warnings(&task, Physics::Rapier));
            Ok(format!("environment; {}", describe_spaces(task.spec())))
        }
        FileKind::TabularScenario => {
            describe_tabular(path).map(|description| format!("tabular scenario with {description}"))
        }
        FileKind::Scenario => {
            let plan = Plan::load(path, &[])?;
            warnings.extend(plan.warnings());
            let agents = pluralize(plan.scenario.agents.count.get() as usize, "agent");
            Ok(format!(
                "scenario with {agents} in `{}`; {}",
                plan.description.spec().name,
                describe_spaces(plan.description.spec())
            ))
        }
        FileKind::Study => {
            let plan = StudyPlan::load(path, false)?;
            if plan.cells.iter().any(|cell| cell.source.found().is_none()) {
                StudyPlan::load_before_results(path, true)?;
            }
            warnings.extend(plan.warnings());
            let (cells, claims) = (
                pluralize(plan.cells.len(), "cell"),
                pluralize(plan.study().claims.len(), "claim"),
            );
            Ok(format!(
                "study with {cells}, {}, and {claims}",
                describe_runs(&plan)
            ))
        }
        FileKind::Tuning => {
            let file = TuningFile::load(path)?;
            warnings.extend(warnings_of(&file.defaults));
            Ok(describe_tuning(&file.document.value))
        }
    }?;
    Ok(Checked {
        description,
        warnings,
    })
}

/// Description of a tuning file, such as `search for 3 parameters of 2 methods`.
pub(super) fn describe_tuning(tuning: &Tuning) -> String {
    let parameters = tuning.methods.iter().map(|method| method.space.len());
    let count = tuning.space.len() + parameters.sum::<usize>();
    format!(
        "search for {} of {}",
        pluralize(count, "parameter"),
        pluralize(tuning.methods.len(), "method")
    )
}

/// Number of runs per cell, such as `20 runs each`, and of runs of others.
pub(super) fn describe_runs(plan: &StudyPlan) -> String {
    let external = || plan.cells.iter().filter_map(|cell| cell.source.found());
    let mut parts = Vec::new();
    if external().count() < plan.cells.len() {
        parts.push(describe_own_runs(plan.repeats()));
    }
    if external().count() > 0 {
        let runs: usize = external().map(|runs| runs.runs().count()).sum();
        parts.push(format!("{} of others", pluralize(runs, "run")));
    }
    parts.join(" and ")
}

/// For example `20 runs each`.
pub(super) fn describe_own_runs(repeats: u64) -> String {
    format!("{} each", pluralize(repeats as usize, "run"))
}

/// Description of a tabular scenario, e.g. `100 agents in BipolarChain, SeedSampling`.
pub(super) fn describe_tabular(path: &Path) -> Result<String, InputError> {
    let scenario = tabular::scenario::load(path, &[])?.value;
    let agents = pluralize(scenario.agents.count.get() as usize, "agent");
    Ok(format!(
        "{agents} in {}, {}",
        scenario.task.name(),
        scenario.algorithm.name()
    ))
}

fn describe_spaces(spec: &TaskSpec) -> String {
    let observation_names: Vec<&str> = spec
        .observations
        .iter()
        .map(|quantity| quantity.name.as_str())
        .collect();
    let listed = match observation_names.get(..MAX_NAMED_OBSERVATIONS) {
        Some(first_names) => format!(
            "{}, … ({} in total)",
            first_names.join(", "),
            observation_names.len()
        ),
        None => observation_names.join(", "),
    };
    format!("observations {listed}; actions {}", format_actions(spec))
}

/// Names and values of the actions, e.g. `force (-10 or 10 N)`.
pub(super) fn format_actions(spec: &TaskSpec) -> String {
    let action_texts = spec.actions.iter().map(|action| {
        let quantity = &action.quantity;
        let values = match &action.choice {
            Choice::Discrete(values) => values
                .iter()
                .map(|value| readable(*value))
                .collect::<Vec<_>>()
                .join(" or "),
            Choice::Continuous => quantity.range.map(readable).join(" to "),
        };
        format!(
            "{} ({})",
            quantity.name,
            format!("{values} {}", quantity.unit).trim_end()
        )
    });
    action_texts.collect::<Vec<_>>().join(", ")
}
