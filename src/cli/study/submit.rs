//! `seedbed submit`: packs a registered study with its results.

use std::path::{Path, PathBuf};

use super::arguments::SubmitArgs;
use super::plans::{check_same_study, registration_error};
use crate::cli::{CliError, pluralize, report};
use seedbed::input_files::{self, Directory};
use seedbed::study::design::plan::StudyPlan;
use seedbed::study::evaluate::published;
use seedbed::study::report::submission::{self, SubmissionError};
use seedbed::study::store::StudyFolder;

pub(in crate::cli) fn submit(args: &SubmitArgs) -> Result<(), CliError> {
    let path = input_files::find_argument(&args.study, &[Directory::Scenarios])?;
    let plan = StudyPlan::load(&path, false)?;
    let plan = plan.registered().map_err(registration_error)?;
    let folder = if let Some(folder) = &args.results {
        StudyFolder::new(folder)
    } else {
        let stored = StudyFolder::new(plan.default_folder());
        published::stored_or_beside(&plan.path, stored)
    };
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
        "to check   unzip it, and in {}: {}",
        packed.folder,
        packed.verify
    );
    Ok(())
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
