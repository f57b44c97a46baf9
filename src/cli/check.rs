//! `seedbed check`.

use std::path::{Path, PathBuf};

use super::{Failure, counted, tabular};
use crate::env::{self, Choice, Spec};
use crate::input::{self, InputError, Kind};
use crate::run::Plan;
use crate::study::plan::StudyPlan;

/// Of more observations than these, only so many are named.
pub(super) const MOST_SHOWN: usize = 30;

/// Checks every file, and fails if one of them is wrong.
pub(super) fn check(files: &[PathBuf]) -> Result<(), Failure> {
    let mut wrong = 0;
    for path in files {
        match check_file(path) {
            Ok(said) => say!("ok: {}: {said}", path.display()),
            Err(error) => {
                wrong += 1;
                eprintln!("error: {error}");
            }
        }
    }
    if wrong == 0 {
        Ok(())
    } else {
        Err(Failure::Files(wrong))
    }
}

fn check_file(path: &Path) -> Result<String, InputError> {
    let text = input::read_text(path)?;
    match input::kind(&path.display().to_string(), &text)? {
        Kind::Environment | Kind::TabularEnvironment => Ok(format!(
            "environment with {}",
            described(&env::load(path)?.spec)
        )),
        Kind::TabularScenario => {
            tabular::described(path).map(|said| format!("tabular scenario of {said}"))
        }
        Kind::Scenario => {
            let plan = Plan::load(path, &[])?;
            let agents = counted(plan.scenario.agents.count.get() as usize, "agent");
            Ok(format!(
                "scenario of {agents} in `{}`, {}",
                plan.description.spec.name,
                described(&plan.description.spec)
            ))
        }
        Kind::Study => {
            let plan = StudyPlan::load(path, false)?;
            StudyPlan::load(path, true)?;
            let (cells, claims) = (
                counted(plan.cells.len(), "cell"),
                counted(plan.study().claims.len(), "claim"),
            );
            Ok(format!(
                "study of {cells} with {} each, and {claims}",
                counted(plan.repeats() as usize, "run")
            ))
        }
    }
}

fn described(spec: &Spec) -> String {
    let observations: Vec<&str> = spec
        .observations
        .iter()
        .map(|quantity| quantity.name.as_str())
        .collect();
    let shown = match observations.get(..MOST_SHOWN) {
        Some(first) => format!("{}, … ({} in all)", first.join(", "), observations.len()),
        None => observations.join(", "),
    };
    format!("observations {shown}; actions {}", actions(spec))
}

/// Such as `force (-10 or 10 N)`.
pub(super) fn actions(spec: &Spec) -> String {
    let described = spec.actions.iter().map(|action| {
        let quantity = &action.quantity;
        let values = match &action.choice {
            Choice::Discrete(values) => values
                .iter()
                .map(f32::to_string)
                .collect::<Vec<_>>()
                .join(" or "),
            Choice::Continuous => format!("{} to {}", quantity.range[0], quantity.range[1]),
        };
        format!(
            "{} ({})",
            quantity.name,
            format!("{values} {}", quantity.unit).trim_end()
        )
    });
    described.collect::<Vec<_>>().join(", ")
}
