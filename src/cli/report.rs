//! `seedbed report`: writes the report of a study.

use std::io;
use std::path::{Path, PathBuf};

use super::{CliError, ReportArgs};
use seedbed::study::evaluate::claims::{self, ClaimResult};
use seedbed::study::evaluate::completeness;
use seedbed::study::evaluate::cost::cells_without_policy_gradient;
use seedbed::study::evaluate::gate::gates;
use seedbed::study::evaluate::published;
use seedbed::study::evaluate::results::{Results, ResultsError};
use seedbed::study::report;
use seedbed::study::report::publish;
use seedbed::study::store::StudyFolder;
use seedbed_figure::PrintLayout;
use seedbed_stats::Verdict;

pub(super) fn report(args: &ReportArgs) -> Result<(), CliError> {
    let layout = &args.print.layout()?;
    for folder in &args.folders {
        let folder = StudyFolder::new(folder);
        match &args.publish {
            Some(parent) => publish(&folder, parent)?,
            None if published::is_published(&folder) => {
                refuse_layout(&folder, layout)?;
                write_texts_and_print(&folder)?;
            }
            None => write_and_print(&folder, layout).map(|_| ())?,
        }
    }
    Ok(())
}

/// Published results are single numbers of runs, from which no figures are drawn.
fn refuse_layout(folder: &StudyFolder, layout: &PrintLayout) -> Result<(), CliError> {
    if *layout == PrintLayout::default() {
        return Ok(());
    }
    let path = folder.path().display();
    let message = format!(
        "{path} has published results without figures; expected a study directory with runs"
    );
    Err(CliError::Usage(message))
}

/// Writes the results of a study to a folder in `parent`.
fn publish(folder: &StudyFolder, parent: &Path) -> Result<(), CliError> {
    if published::is_published(folder) {
        let path = folder.path().display();
        let message = format!("{path} has published results; expected a study directory with runs");
        return Err(CliError::Usage(message));
    }
    let results = read(folder)?;
    refuse_if_broken(&results)?;
    let [_, _, missing] = results.run_counts();
    if missing > 0 {
        return Err(CliError::Usage(format!(
            "{}: {}; only complete results are published: run the study first",
            folder.path().display(),
            completeness::missing_sentence(&results)
        )));
    }
    let claim_results = claims::evaluate(&results);
    let written = publish::write(&results, &claim_results, parent);
    let written = written.map_err(|error| write_error(parent, &error))?;
    if results.audit.is_none() {
        note!("warning: these results are not registered: see `seedbed study --help`");
    }
    say!("published  {}", written.display());
    Ok(())
}

/// Writes the tables of published results again, and prints the verdicts.
fn write_texts_and_print(folder: &StudyFolder) -> Result<(), CliError> {
    let results = read(folder)?;
    let claim_results = claims::evaluate(&results);
    report::write_texts(&results, &claim_results, folder.path())
        .map_err(|error| write_error(folder.path(), &error))?;
    print_results(&results, &claim_results);
    say!("tables     {}", folder.path().join("tables.md").display());
    refuse_if_broken(&results)
}

fn write_error(folder: &Path, error: &io::Error) -> CliError {
    CliError::Runtime(format!("cannot write to {}: {error}", folder.display()))
}

/// Writes the report of a study, and prints the verdicts and the paths of the files. Returns the
/// number of failed runs.
pub(super) fn write_and_print(
    folder: &StudyFolder,
    layout: &PrintLayout,
) -> Result<usize, CliError> {
    let results = read(folder)?;
    warn_if_unverified(folder)?;
    let claim_results = claims::evaluate(&results);
    let report_path = report::write(&results, &claim_results, folder.path(), layout)
        .map_err(|error| write_error(folder.path(), &error))?;
    print_results(&results, &claim_results);
    say!("results    {}", folder.path().join("results.csv").display());
    say!("report     {}", report_path.display());
    refuse_if_broken(&results)?;
    let [_, failed, _] = results.run_counts();
    Ok(failed)
}

/// Warns if the description of the study has no checksum.
fn warn_if_unverified(folder: &StudyFolder) -> Result<(), CliError> {
    let is_verified = folder.manifest_has_checksum();
    if !is_verified.map_err(|error| CliError::Usage(error.to_string()))? {
        note!(
            "warning: {} has no checksum and cannot be verified; `seedbed study` writes it again",
            folder.path().join("study.json").display()
        );
    }
    Ok(())
}

/// Prints the numbers of runs, the registration, warnings and the verdicts.
fn print_results(results: &Results, claim_results: &[ClaimResult]) {
    let [finished, failed, missing] = results.run_counts();
    let mut run_counts = vec![format!("{finished} finished")];
    for (count, state) in [(failed, "failed"), (missing, "missing")] {
        if count > 0 {
            run_counts.push(format!("{count} {state}"));
        }
    }
    say!("runs       {}", run_counts.join(", "));
    print_registration(results);
    for cell in cells_without_policy_gradient(results) {
        note!(
            "warning: the policy loss of cell `{cell}` was 0 in all rounds: its policies never moved"
        );
    }
    print_claims(results, claim_results);
    if let Some(exploration) = &results.study.exploration {
        for gate in gates(results) {
            say!("gate       {}", gate.sentence(*exploration.measure));
        }
    }
}

fn refuse_if_broken(results: &Results) -> Result<(), CliError> {
    let audit = results.audit.as_ref();
    let broken = audit.and_then(|audit| audit.broken.first());
    broken.map_or(Ok(()), |sentence| {
        Err(CliError::Runtime(format!(
            "these results do not confirm what was registered: {sentence}"
        )))
    })
}

/// Whether all confirmatory claims of a study have a verdict.
pub(super) fn all_claims_are_decided(folder: &StudyFolder) -> Result<bool, CliError> {
    let results = read(folder)?;
    let is_open = |claim_result: &ClaimResult| claim_result.verdict == Some(Verdict::Open);
    Ok(!claims::evaluate(&results).iter().any(is_open))
}

pub(super) fn read(folder: &StudyFolder) -> Result<Results, CliError> {
    Results::read(folder).map_err(|error| match error {
        ResultsError::Folder(_) if !folder.has_manifest() => CliError::Usage(no_study(folder)),
        ResultsError::Folder(_)
        | ResultsError::Study(_)
        | ResultsError::Run { .. }
        | ResultsError::Table { .. } => CliError::Usage(error.to_string()),
    })
}

/// The error that a folder is no study, with the folders that may be meant: those in it, and those with
/// the id of a lock after its name.
fn no_study(folder: &StudyFolder) -> String {
    const MAX_NAMED: usize = 4;
    let path = folder.path();
    let prefix = path.file_name().unwrap_or_default().to_string_lossy();
    let prefix = format!("{prefix}-");
    let parent = path.parent().filter(|parent| *parent != Path::new(""));
    let mut studies = studies_in(parent.unwrap_or(Path::new(".")));
    studies.retain(|study| {
        let name = study.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with(&prefix)
    });
    studies.extend(studies_in(path));
    let reason = if path.is_dir() {
        "contains no study: expected study.json in it"
    } else if path.extension().is_some_and(|extension| extension == "ron") {
        "a study file; expected the directory of its results, such as recordings/studies/NAME"
    } else {
        "no such directory"
    };
    let named: Vec<String> = studies
        .iter()
        .take(MAX_NAMED)
        .map(|study| format!("`{}`", study.display()))
        .collect();
    let more = if studies.len() > MAX_NAMED {
        " or others"
    } else {
        ""
    };
    let help = if named.is_empty() {
        String::new()
    } else {
        format!("; did you mean {}{more}?", named.join(" or "))
    };
    format!("{}: {reason}{help}", path.display())
}

/// The folders of studies in a folder, sorted.
fn studies_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let paths = entries.map(|entry| entry.path());
    let mut studies: Vec<PathBuf> = paths
        .filter(|path| StudyFolder::new(path).has_manifest())
        .map(|path| path.strip_prefix(".").map_or(path.clone(), Path::to_owned))
        .collect();
    studies.sort();
    studies
}

fn print_registration(results: &Results) {
    let (Some(lock), Some(audit)) = (&results.manifest.lock, &results.audit) else {
        return;
    };
    say!("registered lock {}", lock.short_id());
    for sentence in &audit.broken {
        say!("not confirmed: {sentence}");
    }
    for sentence in &audit.notes {
        say!("note       {sentence}");
    }
}

fn print_claims(results: &Results, claim_results: &[ClaimResult]) {
    let study = &results.study;
    if results.manifest.quick && !claim_results.is_empty() {
        say!("quick run  fewer or shorter runs than the study: these verdicts are not results");
    }
    let verdict_width = claim_results
        .iter()
        .map(|claim_result| claim_result.verdict_text().len())
        .max()
        .unwrap_or(0)
        .max(16);
    for (claim, claim_result) in study.claims.iter().zip(claim_results) {
        let source = if claim.source.is_empty() {
            String::new()
        } else {
            format!(" ({})", claim.source)
        };
        say!(
            "{:<verdict_width$} {}{source}",
            claim_result.verdict_text(),
            claim.text
        );
        say!(
            "{:<verdict_width$} {}: {}",
            "",
            study.measure_of(claim).title(),
            report::effect_found(claim_result)
        );
        let note = report::note_about_claim(results, claim, claim_result);
        if !note.is_empty() {
            say!("{:<verdict_width$} {note}", "");
        }
    }
    if !claim_results.is_empty() {
        say!("claims     {}", report::summarize_claims(claim_results));
    }
}
