//! Whether the results of all runs are there. Runs that are missing may have been left out because of
//! their results.

use std::collections::BTreeSet;

use super::claims;
use super::results::{CellResults, Results};
use crate::text::pluralize;
use seedbed_stats::Verdict;

/// Number of runs whose results are missing: of all cells, up to the look at which the study could end.
/// A registered study ends at its last look, or when all of its confirmatory claims are decided.
#[must_use]
pub fn missing_runs(results: &Results) -> usize {
    let [_, _, missing] = results.run_counts();
    if missing > 0 {
        missing
    } else {
        runs_of_next_look(results)
    }
}

/// Such as `1 of 24 runs is missing`.
#[must_use]
pub fn missing_sentence(results: &Results, missing: usize) -> String {
    let [finished, failed, _] = results.run_counts();
    let verb = if missing == 1 { "is" } else { "are" };
    let total = pluralize(finished + failed + missing, "run");
    format!("{missing} of {total} {verb} missing")
}

/// Number of runs of the next look, if the results end at a look at which claims are open.
fn runs_of_next_look(results: &Results) -> usize {
    let looks = results.study.looks();
    if results.manifest.lock.is_none() || looks.len() < 2 {
        return 0;
    }
    let own_cells = || {
        let cells = results.cells.iter();
        cells.filter(|cell| cell.description.external.is_none())
    };
    let run_seeds = |cell: &CellResults| -> BTreeSet<u64> {
        let finished = cell.costs.iter().map(|(run_seed, _)| *run_seed);
        let failed = cell.failures.iter().map(|(run_seed, _)| *run_seed);
        finished.chain(failed).collect()
    };
    let present = own_cells().map(|cell| run_seeds(cell).len() as u64).max();
    let present = present.unwrap_or(0);
    let Some(next) = looks.into_iter().find(|look| *look > present) else {
        return 0;
    };
    let claims = claims::evaluate(results);
    let is_open = claims
        .iter()
        .any(|claim| claim.verdict == Some(Verdict::Open));
    if is_open {
        own_cells().count() * (next - present) as usize
    } else {
        0
    }
}
