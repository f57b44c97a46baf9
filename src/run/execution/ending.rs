//! The files of a finished run.

use std::path::Path;

use super::round_recorder::RoundRecorder;
use super::{Options, RunOutcome};
use crate::run::error::RunError;
use crate::run::facts::Summary;
use crate::run::folder::RunFolder;
use crate::run::folder::checksums::NewChecksums;
use crate::run::plan::Plan;
use crate::run::training::{RecordingOrder, TrainerOnRanks};
use crate::run::weights;
use crate::storage::files;
use seedbed_env::gymnasium::GymnasiumTask;

/// Completes the files of a finished run, whose checkpoint has been written. The summary is written
/// last, because its presence marks a finished run, whose checksums are known.
pub(super) fn finish(
    plan: &Plan,
    options: &Options,
    trainer: &TrainerOnRanks<'_>,
    recorder: &mut RoundRecorder,
) -> Result<RunOutcome, RunError> {
    trainer.order_recorders(RecordingOrder::Finish);
    recorder.finish()?;
    write_policies(plan, options, trainer)?;
    let gymnasium = plan.description.gymnasium();
    let summary = Summary {
        repeatability_warning: gymnasium.and_then(GymnasiumTask::repeatability_warning),
        ..Summary::of(&plan.name, plan.scenario.seed, trainer)
    };
    let text = serde_json::to_string_pretty(&summary).map_err(std::io::Error::other);
    let path = options.folder.summary_file();
    let text = text.map_err(|error| RunError::File {
        path: path.clone(),
        error,
    })?;
    let text = format!("{text}\n");
    write_checksums_of_results(&options.folder, &text)?;
    replace_file(&path, text.as_bytes())?;
    Ok(RunOutcome::Finished(Box::new(summary)))
}

/// Writes the checksums of the files of a finished run, whose summary will have this text.
pub(crate) fn write_checksums_of_results(
    folder: &RunFolder,
    summary: &str,
) -> Result<(), RunError> {
    let mut sums = NewChecksums::default();
    sums.add(folder, &folder.summary_file(), summary.as_bytes());
    for path in folder.result_files() {
        sums.add_file(folder, &path)
            .map_err(|error| RunError::File { path, error })?;
    }
    write_checksums(&sums, folder)
}

fn write_policies(
    plan: &Plan,
    options: &Options,
    trainer: &TrainerOnRanks<'_>,
) -> Result<(), RunError> {
    let path = options.folder.policies_file();
    let tensors = trainer.tensors(options.save_initial);
    weights::write(
        &path,
        &tensors,
        &weights::metadata(plan, trainer.local().spec()),
    )
    .map_err(|error| RunError::File { path, error })
}

pub(super) fn replace_file(path: &Path, bytes: &[u8]) -> Result<(), RunError> {
    files::replace(path, bytes).map_err(|error| RunError::File {
        path: path.to_owned(),
        error,
    })
}

pub(super) fn write_checksums(sums: &NewChecksums, folder: &RunFolder) -> Result<(), RunError> {
    sums.write(folder).map_err(|error| RunError::File {
        path: folder.checksums_file(),
        error,
    })
}
