//! Warnings at the beginning of a report.

use maud::{Markup, html};

use super::provenance::{builds, versions};
use crate::record::{difference_of_quantities, other_range};
use crate::study::design::file::FIRST_REPORTING_SEED;
use crate::study::evaluate::cost::cells_without_policy_gradient;
use crate::study::evaluate::results::{CellResults, Results};
use crate::study::report::format;
use crate::study::report::tables::note_about_early_ends;
use crate::text::{pluralize, shell_word};

/// Minimum number of runs per cell for a report without the warning about narrow intervals.
const MIN_RUNS_WITHOUT_WARNING: u64 = 20;

/// Warnings that results are not final or not precise.
pub(super) fn warnings(results: &Results) -> Markup {
    let [_, failed, missing] = results.run_counts();
    let manifest = &results.manifest;
    html! {
        @if fewest_runs(results) < MIN_RUNS_WITHOUT_WARNING {
            (warning("Few runs.", &format!(
                "Bootstrap intervals, in tables and figures of single cells, are too narrow from fewer than \
                 {MIN_RUNS_WITHOUT_WARNING} runs: when there is no effect, an \
                 interval should exclude 0 in 1 of 20 studies, but from 5 runs it does so in about 1 \
                 of 6, and from 10 runs in about 1 of 11."
            )))
        }
        @if let Some(sentence) = manifest.changed_repeats_sentence() {
            (warning(&sentence, "When there is no effect, an interval that is inspected more than once \
                excludes 0 more often than in 1 of 20 studies."))
        }
        @for cell in cells_without_policy_gradient(results) {
            (warning("A policy that never moved.", &format!(
                "In cell `{cell}` the policy loss was 0 in all rounds of all runs: agents acted by their initial \
                 policies. Such a cell is not a baseline of learning."
            )))
        }
        @for measure in results.measures() {
            @let note = note_about_early_ends(results, measure);
            @if !note.is_empty() { (warning(&format!("Not known of all runs: {}.", measure.title()), &note)) }
        }
        @for sentence in unequal_thresholds(results) {
            (warning("Unequal thresholds.", &sentence))
        }
        @if let Some(sentence) = unequal_ranges(results) {
            (warning("Unequal display ranges.", &sentence))
        }
        @if results.is_tuning() {
            (warning("Tuning seeds.", &format!(
                "Seeds below {FIRST_REPORTING_SEED} are for choosing settings. These results must not \
                 be published."
            )))
        }
        @if manifest.quick {
            (warning("Quick run.", "This run has fewer or shorter runs than the study, to check the study \
                before its long runs."))
        }
        @if missing > 0 {
            (warning("Incomplete.", &format!(
                "{} missing. All results below are from the runs that are finished.",
                runs_with_verb(missing)
            )))
        }
        @if failed > 0 {
            (warning(&format!("{} failed.", pluralize(failed, "run")), "Failed runs are excluded from \
                all results. The reasons are listed below."))
        }
        @if results.versions.len() > 1 {
            (warning("Several versions.", &format!(
                "The runs were made by seedbed {}. Different versions need not give identical results.",
                versions(results)
            )))
        }
        @if results.builds.len() > 1 { (warning_of_builds(results)) }
    }
}

/// Smallest number of runs that a cell has or should have.
fn fewest_runs(results: &Results) -> u64 {
    let runs_of = |cell: &CellResults| match &cell.description.external {
        Some(external) => (external.runs.len() + cell.missing) as u64,
        None => results.manifest.repeats,
    };
    let cells = results.cells.iter();
    cells.map(runs_of).min().unwrap_or(results.manifest.repeats)
}

/// Sentences about cells of results of others that count as solved at another return, or over another
/// number of episodes, than the first cell with the same task.
fn unequal_thresholds(results: &Results) -> Vec<String> {
    let threshold = |cell: &CellResults| cell.runs.first().and_then(|(_, run)| run.threshold);
    let mut sentences = Vec::new();
    for cell in &results.cells {
        let mut cells = results.cells.iter();
        let first = cells.find(|other| {
            other.description.task == cell.description.task && threshold(other).is_some()
        });
        let Some(first) = first else { continue };
        let is_external = [first, cell]
            .iter()
            .any(|cell| cell.description.external.is_some());
        if let (Some(of_first), Some(of_cell)) = (threshold(first), threshold(cell))
            && is_external
            && of_first != of_cell
        {
            sentences.push(format!(
                "Runs of cell `{}` count as solved at a mean return of {} over {}, those of cell `{}` at {} over {}.",
                cell.description.name,
                format::number(of_cell.0),
                pluralize(of_cell.1 as usize, "episode"),
                first.description.name,
                format::number(of_first.0),
                pluralize(of_first.1 as usize, "episode"),
            ));
        }
    }
    sentences
}

/// Sentence about the first two cells with the same observations, but other display ranges, if the study has a
/// measure of visits, which counts cells of these ranges.
fn unequal_ranges(results: &Results) -> Option<String> {
    if !results
        .measures()
        .iter()
        .any(|measure| measure.is_of_visits())
    {
        return None;
    }
    for (index, cell) in results.cells.iter().enumerate() {
        let observations = cell.observations();
        for other in &results.cells[index + 1..] {
            let of_other = other.observations();
            if difference_of_quantities(&observations, &of_other).is_some() {
                continue;
            }
            let Some((one, two)) = other_range(&observations, &of_other) else {
                continue;
            };
            let [range, other_range] = [one, two].map(|quantity| {
                let [low, high] = quantity.range.map(|end| format::number(f64::from(end)));
                format!("{low} to {high}")
            });
            return Some(format!(
                "`{}` is shown from {range} in cell `{}` and from {other_range} in cell `{}`: measures of visits, such as coverage, \
                 are shares of other parts of the state space, and cannot be compared.",
                one.name, cell.description.name, other.description.name
            ));
        }
    }
    None
}

pub(super) fn warning(title: &str, text: &str) -> Markup {
    html! { p.warning { strong { (title) } " " (text) } }
}

fn warning_of_builds(results: &Results) -> Markup {
    html! {
        p.warning {
            strong { "Several builds." } " The runs were made by " (results.builds.len())
            " builds of seedbed (" (builds(results)) "). To check that the results are still the same, run "
            code { "seedbed study verify " (shell_word(&results.manifest.study_path)) } "."
        }
    }
}

/// `1 run is`, `2 runs are`.
fn runs_with_verb(runs: usize) -> String {
    let verb = if runs == 1 { "is" } else { "are" };
    format!("{} {verb}", pluralize(runs, "run"))
}

#[cfg(test)]
mod tests {
    use super::super::tests::{STUDY, results_with_every_warning};
    use super::*;

    #[test]
    fn other_display_ranges_are_a_warning_for_measures_of_visits() {
        let mut results = results_with_every_warning();
        for (cell, end) in results.cells.iter_mut().zip([1.0, 10.0]) {
            let observation = ("x".to_owned(), "m".to_owned(), [-end, end]);
            cell.description.observations = vec![observation];
        }
        assert_eq!(unequal_ranges(&results), None, "returns can be compared");
        let study = STUDY.replace("FinalReturn()],", "FinalReturn(), Coverage],");
        results.study = seedbed_input::parse("small.ron", study).unwrap().value;
        let sentence = unequal_ranges(&results).unwrap();
        let expected = "`x` is shown from −1 to 1 in cell `A` and from −10 to 10 in cell `B`";
        assert!(sentence.starts_with(expected), "{sentence}");
    }
}
