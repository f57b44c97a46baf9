//! Whether the results of all runs are there. Runs that are missing may have been left out because of
//! their results.

use super::claims;
use super::results::Results;
use crate::text::pluralize;
use seedbed_stats::Verdict;

/// Such as `1 of 24 runs is missing`.
#[must_use]
pub fn missing_sentence(results: &Results) -> String {
    let [finished, failed, missing] = results.run_counts();
    let verb = if missing == 1 { "is" } else { "are" };
    let total = pluralize(finished + failed + missing, "run");
    format!("{missing} of {total} {verb} missing")
}

/// Counts the runs of the next look as missing if registered results end at a look at which claims are
/// open: a registered study ends at its last look, or when all of its confirmatory claims are decided.
/// Returns whether there are such runs.
pub(super) fn count_next_look(results: &mut Results) -> bool {
    let missing = runs_of_next_look(results).unwrap_or(0);
    let cells = results.cells.iter_mut();
    let own_cells = cells.filter(|cell| cell.description.external.is_none());
    let counted = own_cells.map(|cell| cell.missing += missing).count();
    missing > 0 && counted > 0
}

/// Number of runs of each cell that the next look has in addition; `None` if there need not be one.
fn runs_of_next_look(results: &Results) -> Option<usize> {
    let audit = results.audit.as_ref()?;
    let [_, _, missing] = results.run_counts();
    let looks = results.study.looks();
    if missing > 0 || looks.len() < 2 || !audit.broken.is_empty() {
        return None;
    }
    let cells = results.cells.iter();
    let own_cells = cells.filter(|cell| cell.description.external.is_none());
    let present = own_cells
        .map(|cell| cell.run_seeds().count() as u64)
        .max()?;
    let next = looks.into_iter().find(|look| *look > present)?;
    let claims = claims::evaluate(results);
    let is_open = claims
        .iter()
        .any(|claim| claim.verdict == Some(Verdict::Open));
    is_open.then_some((next - present) as usize)
}
