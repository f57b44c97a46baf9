//! `seedbed report`: writes the report of a study.

use super::{CliError, ReportArgs};
use crate::study::claims::{self, ClaimResult};
use crate::study::file::Study;
use crate::study::report;
use crate::study::results::{Results, ResultsError};
use crate::study::store::StudyFolder;

pub(super) fn report(args: &ReportArgs) -> Result<(), CliError> {
    args.folders
        .iter()
        .try_for_each(|folder| write_and_print(&StudyFolder::new(folder)).map(|_| ()))
}

/// Writes the report of a study, and prints verdicts and paths of files. Returns the number of failed runs.
pub(super) fn write_and_print(folder: &StudyFolder) -> Result<usize, CliError> {
    let results = Results::read(folder).map_err(|error| match error {
        ResultsError::Folder(_) | ResultsError::Study(_) => CliError::Usage(error.to_string()),
    })?;
    let claim_results = claims::evaluate(&results);
    let written = report::write(&results, &claim_results, folder.path());
    let page =
        written.map_err(|error| CliError::Runtime(format!("cannot write the report: {error}")))?;
    let [finished, failed, missing] = results.counts();
    let others = [(failed, "failed"), (missing, "missing")]
        .into_iter()
        .filter(|(count, _)| *count > 0);
    let counts: Vec<String> = others
        .map(|(count, what)| format!("{count} {what}"))
        .collect();
    say!(
        "runs       {}",
        [vec![format!("{finished} finished")], counts]
            .concat()
            .join(", ")
    );
    print_claims(&results.study, &claim_results);
    say!("results    {}", folder.path().join("results.csv").display());
    say!("report     {}", page.display());
    Ok(failed)
}

fn print_claims(study: &Study, claim_results: &[ClaimResult]) {
    let widest = claim_results
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
            "{:<widest$} {}{source}",
            claim_result.verdict_text(),
            claim.text
        );
    }
    if !claim_results.is_empty() {
        say!("claims     {}", report::summarize_claims(claim_results));
    }
}
