//! `seedbed report`: what the runs of a study show, on one page.

use super::{Failure, ReportArgs};
use crate::study::claims::{self, Judgement};
use crate::study::file::Study;
use crate::study::report;
use crate::study::results::{Results, ResultsError};
use crate::study::store::StudyFolder;

pub(super) fn report(args: &ReportArgs) -> Result<(), Failure> {
    args.folders
        .iter()
        .try_for_each(|folder| write_and_tell(&StudyFolder::new(folder)).map(|_| ()))
}

/// Writes a study's report, says what became of its claims and where everything is; counts failed runs.
pub(super) fn write_and_tell(folder: &StudyFolder) -> Result<usize, Failure> {
    let results = Results::read(folder).map_err(|error| match error {
        ResultsError::Folder(_) | ResultsError::Study(_) => Failure::Input(error.to_string()),
    })?;
    let judgements = claims::judge(&results);
    let written = report::write(&results, &judgements, folder.path());
    let page =
        written.map_err(|error| Failure::Work(format!("cannot write the report: {error}")))?;
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
    tell_claims(&results.study, &judgements);
    say!("results    {}", folder.path().join("results.csv").display());
    say!("report     {}", page.display());
    Ok(failed)
}

fn tell_claims(study: &Study, judgements: &[Judgement]) {
    let widest = judgements
        .iter()
        .map(|judgement| judgement.in_words().len())
        .max()
        .unwrap_or(0)
        .max(16);
    for (claim, judgement) in study.claims.iter().zip(judgements) {
        let source = if claim.source.is_empty() {
            String::new()
        } else {
            format!(" ({})", claim.source)
        };
        say!("{:<widest$} {}{source}", judgement.in_words(), claim.text);
    }
    if !judgements.is_empty() {
        say!("claims     {}", report::tally(judgements));
    }
}
