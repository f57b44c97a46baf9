//! `seedbed study`: what its first word says is done with studies.

mod arguments;
mod former;
mod list;
mod merge;
mod plans;
mod register;
mod run;
mod script;
mod submit;
mod verify;

use arguments::{Action, RunArgs};
pub(super) use arguments::{StudyArgs, SubmitArgs};
pub(super) use former::translated;
use plans::Selection;
pub(super) use plans::check_same_study;

pub(super) use submit::submit;

use super::{CliError, pluralize};
use seedbed::study::design::plan::StudyPlan;
use seedbed::study::store::StudyFolder;

pub(super) fn study(args: &StudyArgs) -> Result<(), CliError> {
    match &args.action {
        None => run(&args.run, false),
        Some(Action::Run(args)) => run(args, false),
        Some(Action::Confirm(args)) => run(args, true),
        Some(Action::List(args)) => {
            let selection = Selection::of_results(&args.studies, &args.results);
            for (plan, folder) in selection.load()? {
                list::print_runs(&plan, &folder);
            }
            Ok(())
        }
        Some(Action::Power(args)) => {
            for (plan, _) in Selection::without_runs(&args.studies, args.out.as_ref()).load()? {
                register::print_power(&plan);
            }
            Ok(())
        }
        Some(Action::Register(args)) => {
            for (plan, folder) in
                Selection::without_runs(&args.studies, args.out.as_ref()).load()?
            {
                register::register(&plan, &folder)?;
            }
            Ok(())
        }
        Some(Action::Verify(args)) => verify::verify_all(args),
        Some(Action::Merge(args)) => merge::merge(args),
        Some(Action::Script(args)) => script::print(args),
        Some(Action::Submit(args)) => submit(args),
    }
}

/// Executes what is missing of studies.
fn run(args: &RunArgs, is_registered: bool) -> Result<(), CliError> {
    if is_registered && args.place.quick {
        let message = "a registered study has no quick settings; expected no --quick".to_owned();
        return Err(CliError::Usage(message));
    }
    let selection = Selection::new(&args.studies, &args.place, is_registered);
    let plans = selection.load()?;
    if plans.len() > 1 && (args.index.is_some() || args.shard.is_some()) {
        let message = "--index and --shard can be used with one study only".to_owned();
        return Err(CliError::Usage(message));
    }
    if !args.execution.ignore_memory {
        plans
            .iter()
            .try_for_each(|(plan, _)| run::check_memory(args, plan))?;
    }
    let mut failed = 0;
    for (plan, folder) in &plans {
        failed += run_study(args, plan, folder)?;
    }
    error_of(failed, "failed")
}

/// Executes what is asked for of one study. Returns the number of failed runs.
fn run_study(args: &RunArgs, plan: &StudyPlan, folder: &StudyFolder) -> Result<usize, CliError> {
    match (args.index, args.shard) {
        (Some(index), _) => run::run_one(args, plan, folder, index),
        (None, Some(shard)) => run::run_shard(args, plan, folder, shard),
        (None, None) => run::run_all(args, plan, folder),
    }
}

/// An error if there are such runs.
fn error_of(runs: usize, what: &str) -> Result<(), CliError> {
    match runs {
        0 => Ok(()),
        runs => Err(CliError::Runtime(format!(
            "{} {what}",
            pluralize(runs, "run")
        ))),
    }
}
