//! `seedbed study --merge`: copies the stored runs of a study from other directories.

use std::path::PathBuf;

use super::execution::lock_folder;
use super::study::check_same_study;
use super::{CliError, pluralize};
use seedbed::study::merge::{self, MergeError, Merged};
use seedbed::study::plan::StudyPlan;
use seedbed::study::provenance::format_build_id;
use seedbed::study::store::StudyFolder;

pub(super) fn merge(
    plan: &StudyPlan,
    target: &StudyFolder,
    directories: &[PathBuf],
) -> Result<(), CliError> {
    let sources: Vec<StudyFolder> = directories.iter().map(StudyFolder::new).collect();
    for source in &sources {
        check_source(plan, target, source)?;
    }
    check_same_study(plan, target)?;
    let _lock = lock_folder(target, true)?;
    let merged = merge::merge(plan, target, &sources).map_err(|error| merge_error(&error))?;
    print_merged(plan, target, &merged);
    Ok(())
}

/// An error if the directory has no runs of this study, or is that of the results.
fn check_source(
    plan: &StudyPlan,
    target: &StudyFolder,
    source: &StudyFolder,
) -> Result<(), CliError> {
    let path = source.path().display();
    let manifest = source.manifest_if_any();
    let manifest = manifest.map_err(|error| CliError::Usage(error.to_string()))?;
    if manifest.is_none() {
        let message = format!("{path} contains no study: expected a directory with `study.json`");
        return Err(CliError::Usage(message));
    }
    let real_path = |folder: &StudyFolder| folder.path().canonicalize().ok();
    if real_path(source) == real_path(target) {
        return Err(CliError::Usage(format!(
            "{path} is the directory of the results itself; --merge expects other directories"
        )));
    }
    check_same_study(plan, source)
}

fn merge_error(error: &MergeError) -> CliError {
    match error {
        MergeError::Damaged(_) | MergeError::Conflicts(_) => CliError::Usage(error.to_string()),
        MergeError::Changed(_) | MergeError::Store(_) => CliError::Runtime(error.to_string()),
    }
}

fn print_merged(plan: &StudyPlan, target: &StudyFolder, merged: &Merged) {
    say!(
        "merged     {}: {} new, {} equal, 0 refused",
        plan.name,
        merged.new,
        merged.equal
    );
    if merged.other > 0 {
        note!(
            "warning: {} of other settings than those of the study now: not copied",
            pluralize(merged.other, "stored run")
        );
    }
    if merged.builds.len() > 1 {
        note!("warning: the runs were made by several builds:");
        for ((version, build), files) in &merged.builds {
            let build = format_build_id(*build);
            note!("  {version}, build {build}: {}", pluralize(*files, "file"));
        }
    }
    let runs = plan.distinct_runs();
    let own = runs.iter().filter(|run| run.name.is_none());
    let missing = own.filter(|run| target.stored_run(run).is_none()).count();
    say!("to run     {}", pluralize(missing, "run"));
    say!("results    {}", target.path().display());
}
