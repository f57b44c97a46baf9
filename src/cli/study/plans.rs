//! The studies of a command, and the folders of their results.

use std::path::{Path, PathBuf};

use super::arguments::{PlaceArgs, ResultsArgs};
use super::former::actions;
use crate::cli::CliError;
use seedbed::input_files::{self, Directory};
use seedbed::study::design::lock::{Lock, RegistrationError};
use seedbed::study::design::plan::StudyPlan;
use seedbed::study::store::StudyFolder;
use seedbed_input::InputError;
use seedbed_input::nearest_name;

/// Which studies are meant, and where their results are.
#[derive(Clone, Copy)]
pub(super) struct Selection<'a> {
    studies: &'a [PathBuf],
    out: Option<&'a PathBuf>,
    quick: bool,
    /// Whether their runs are those that are registered.
    is_registered: bool,
    /// Whether results of others need not exist yet.
    before_results: bool,
}

impl<'a> Selection<'a> {
    /// Studies with their results.
    pub(super) fn new(studies: &'a [PathBuf], place: &'a PlaceArgs, is_registered: bool) -> Self {
        Self {
            studies,
            out: place.out.as_ref(),
            quick: place.quick,
            is_registered,
            before_results: false,
        }
    }

    /// Studies with their results, which may be registered.
    pub(super) fn of_results(studies: &'a [PathBuf], results: &'a ResultsArgs) -> Self {
        Self::new(studies, &results.place, results.registered)
    }

    /// Studies of which nothing is run.
    pub(super) fn without_runs(studies: &'a [PathBuf], out: Option<&'a PathBuf>) -> Self {
        Self {
            studies,
            out,
            quick: false,
            is_registered: false,
            before_results: true,
        }
    }

    /// Reads the studies, each with the folder of its results.
    pub(super) fn load(self) -> Result<Vec<(StudyPlan, StudyFolder)>, CliError> {
        let plans: Result<Vec<StudyPlan>, CliError> =
            self.studies.iter().map(|path| self.plan(path)).collect();
        let plans = plans?;
        check_distinct_folders(&plans)?;
        if plans.len() > 1 && self.out.is_some() {
            let message = "--out can be used with one study only".to_owned();
            return Err(CliError::Usage(message));
        }
        let with_folder = |plan: StudyPlan| {
            let folder = self.out.cloned().unwrap_or_else(|| plan.default_folder());
            (plan, StudyFolder::new(folder))
        };
        Ok(plans.into_iter().map(with_folder).collect())
    }

    fn plan(self, path: &Path) -> Result<StudyPlan, CliError> {
        let found = input_files::find_argument(path, &[Directory::Scenarios]);
        let path = &found.map_err(|error| with_action(path, error))?;
        let plan = if self.before_results || self.is_registered {
            StudyPlan::load_before_results(path, self.quick)?
        } else {
            StudyPlan::load(path, self.quick)?
        };
        if self.is_registered {
            return plan.registered().map_err(registration_error);
        }
        let lock = Lock::path(path);
        if !self.before_results && !self.quick && lock.is_file() {
            note!(
                "note       these runs are not those that {} registers, which `study confirm` executes, and other commands mean with --registered",
                lock.display()
            );
        }
        Ok(plan)
    }
}

pub(in crate::cli) fn registration_error(error: RegistrationError) -> CliError {
    match error {
        RegistrationError::File(error) => CliError::Runtime(error.to_string()),
        error => CliError::Usage(error.to_string()),
    }
}

/// An error if two studies would write to one directory: each would take the other's runs for its
/// own.
fn check_distinct_folders(plans: &[StudyPlan]) -> Result<(), CliError> {
    let repeated_name = plans.iter().enumerate().find(|(index, plan)| {
        plans[..*index]
            .iter()
            .any(|earlier| earlier.name == plan.name)
    });
    repeated_name.map_or(Ok(()), |(_, plan)| {
        let folder = plan.default_folder();
        Err(CliError::Usage(format!(
            "two studies are named `{}` and would both write to {}; run them one at a time with --out",
            plan.name,
            folder.display()
        )))
    })
}

/// An error if the directory belongs to another study, or to this study with another value of
/// `--quick`.
pub(in crate::cli) fn check_same_study(
    plan: &StudyPlan,
    folder: &StudyFolder,
) -> Result<(), CliError> {
    let manifest = folder.manifest_if_any();
    let Some(manifest) = manifest.map_err(|error| CliError::Usage(error.to_string()))? else {
        return Ok(());
    };
    let is_same = (manifest.name.as_str(), manifest.quick) == (plan.name.as_str(), plan.quick);
    let lock_id = |lock: &Option<Lock>| lock.as_ref().map(|lock| lock.id.clone());
    if is_same && lock_id(&manifest.lock) == lock_id(&plan.lock) {
        return Ok(());
    }
    if is_same {
        return Err(CliError::Usage(format!(
            "{} contains this study with other run seeds (registered: {}); choose another directory with --out",
            folder.path().display(),
            manifest.lock.as_ref().map_or("no", Lock::short_id)
        )));
    }
    let kind = if manifest.quick {
        "quick study"
    } else {
        "study"
    };
    let path = folder.path().display();
    Err(CliError::Usage(format!(
        "{path} contains the {kind} `{}`; choose another directory with --out",
        manifest.name
    )))
}
/// The error for a word that names no study, which may be an action with another spelling.
fn with_action(word: &Path, error: InputError) -> InputError {
    let action = nearest_name(&word.to_string_lossy(), actions());
    let help = action.map(|action| format!("`seedbed study {action}`, if that was meant"));
    InputError {
        help: help.or(error.help),
        ..error
    }
}
