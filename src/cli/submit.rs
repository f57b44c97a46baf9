//! `seedbed submit`: packs a registered study with its results.

use std::path::{Path, PathBuf};

use super::study::{check_same_study, registration_error};
use super::{CliError, SubmitArgs, pluralize, report};
use seedbed::input_files::{self, Directory};
use seedbed::study::plan::StudyPlan;
use seedbed::study::published;
use seedbed::study::store::StudyFolder;
use seedbed::study::submission::{self, SubmissionError};

pub(super) fn submit(args: &SubmitArgs) -> Result<(), CliError> {
    let path = input_files::find_argument(&args.study, &[Directory::Scenarios])?;
    let plan = StudyPlan::load(&path, false)?;
    let plan = plan.registered().map_err(registration_error)?;
    let folder = StudyFolder::new(
        args.results
            .clone()
            .unwrap_or_else(|| results_folder(&plan)),
    );
    check_same_study(&plan, &folder)?;
    let results = report::read(&folder)?;
    let archive = match &args.out {
        Some(path) => path.clone(),
        None => default_archive(&plan)?,
    };
    let packed = submission::write(&plan, &results, &archive).map_err(submission_error)?;
    say!("results    {}", folder.path().display());
    let (files, kilobytes) = (pluralize(packed.files, "file"), packed.bytes.div_ceil(1000));
    say!("packed     {} ({files}, {kilobytes} kB)", archive.display());
    say!(
        "to check   unzip it, and in {}: seedbed study {} --confirm --verify=2%",
        packed.folder,
        packed.study.display()
    );
    Ok(())
}

/// The directory of the study's runs or, if there is none, of the published results beside the study.
fn results_folder(plan: &StudyPlan) -> PathBuf {
    let beside_study = published::folder_beside(&plan.path);
    let stored = plan.default_folder();
    if !stored.exists() && published::is_published(&StudyFolder::new(&beside_study)) {
        beside_study
    } else {
        stored
    }
}

fn default_archive(plan: &StudyPlan) -> Result<PathBuf, CliError> {
    let name = submission::name(plan).map_err(submission_error)?;
    let folder = Path::new("recordings").join("submissions");
    std::fs::create_dir_all(&folder).map_err(|error| {
        CliError::Runtime(format!("cannot write to {}: {error}", folder.display()))
    })?;
    Ok(folder.join(format!("{name}.zip")))
}

fn submission_error(error: SubmissionError) -> CliError {
    match error {
        SubmissionError::File { .. } => CliError::Runtime(error.to_string()),
        error => CliError::Usage(error.to_string()),
    }
}
