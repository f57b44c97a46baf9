//! `seedbed study merge`: copies the stored runs of a study from other directories.

use super::arguments::MergeArgs;
use super::plans::{Selection, check_same_study};
use super::verify;
use crate::cli::execution::{jobs, lock_folder};
use crate::cli::{CliError, pluralize};
use seedbed::provenance::format_build_id;
use seedbed::study::design::plan::StudyPlan;
use seedbed::study::store::StudyFolder;
use seedbed::study::store::merge::{self, MergeError, Merged};

pub(super) fn merge(args: &MergeArgs) -> Result<(), CliError> {
    let selection = Selection::of_results(std::slice::from_ref(&args.study), &args.results);
    for (plan, target) in selection.load()? {
        merge_into(args, &plan, &target)?;
    }
    Ok(())
}

fn merge_into(args: &MergeArgs, plan: &StudyPlan, target: &StudyFolder) -> Result<(), CliError> {
    let sources: Vec<StudyFolder> = args.from.iter().map(StudyFolder::new).collect();
    for source in &sources {
        check_source(plan, target, source)?;
    }
    check_same_study(plan, target)?;
    let _lock = lock_folder(target, true)?;
    if args.unverified {
        note!(
            "warning: no run is repeated: nothing shows that the directories have what runs give"
        );
    } else {
        repeat_a_run_of_each(args, plan, target, &sources)?;
    }
    let merged = merge::merge(plan, target, &sources).map_err(|error| merge_error(&error))?;
    print_merged(plan, target, &merged);
    Ok(())
}

/// Repeats a random run of each directory, of those that are new.
fn repeat_a_run_of_each(
    args: &MergeArgs,
    plan: &StudyPlan,
    target: &StudyFolder,
    sources: &[StudyFolder],
) -> Result<(), CliError> {
    let draw = verify::draw(args.draw)?;
    let runs = plan.distinct_runs();
    for (number, source) in (0..).zip(sources) {
        let mut new = runs.clone();
        new.retain(|run| {
            run.name.is_none()
                && source.stored_run(run).is_some()
                && target.stored_run(run).is_none()
        });
        let Some(run) = draw.choose_one(&new, number) else {
            continue;
        };
        let chosen = [run];
        let differing = verify::repeat(plan, &chosen, source, jobs(&args.execution))?;
        if !differing.is_empty() {
            let file = source.result_file(run.cell.digest(), run.run_seed);
            return Err(CliError::Usage(format!(
                "{}: the run gives another result when it is repeated, so that nothing was copied: the \
                 file was changed, or comes from other code or another kind of machine; draw {}",
                file.display(),
                draw.number()
            )));
        }
        say!(
            "verified   {}, {} of {}: bit-identical (draw {})",
            run.cell.name,
            run.label(),
            source.path().display(),
            draw.number()
        );
    }
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
            "{path} is the directory of the results itself; --from expects other directories"
        )));
    }
    check_same_study(plan, source)
}

fn merge_error(error: &MergeError) -> CliError {
    match error {
        MergeError::Damaged(_) | MergeError::Unreadable(_) | MergeError::Conflicts(_) => {
            CliError::Usage(error.to_string())
        }
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
