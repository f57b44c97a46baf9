//! `claims.md`: one row per claim, to be included in other documents.

use super::format;
use super::tables::{note_about_early_ends, note_about_times};
use crate::study::design::file::Claim;
use crate::study::design::power::runs_with_deviation;
use crate::study::evaluate::claims::ClaimResult;
use crate::study::evaluate::gate::gates;
use crate::study::evaluate::results::Results;
use crate::text::{markdown_cell, markdown_line, pluralize};
use seedbed_stats::power::MAX_RUNS;
use seedbed_stats::{Interval, MIN_RUNS, Verdict};

pub(super) fn markdown(results: &Results, claim_results: &[ClaimResult]) -> String {
    let mut text = caveats(results);
    text += "| claim | compared | found | n | p | verdict |\n|---|---|---|---|---|---|\n";
    for (claim, claim_result) in results.study.claims.iter().zip(claim_results) {
        text += &row(results, claim, claim_result);
    }
    text += &format!("\n{CLAIMS_NOTE}\n");
    if let Some(exploration) = &results.study.exploration {
        for gate in gates(results) {
            text += &paragraph(&gate.sentence(*exploration.measure));
        }
    }
    for (claim, claim_result) in results.study.claims.iter().zip(claim_results) {
        let note = note_about_claim(results, claim, claim_result);
        if !note.is_empty() {
            text += &paragraph(&format!("{}: {note}", claim.text.trim_end_matches('.')));
        }
    }
    for measure in results.measures_of_claims() {
        let note = note_about_early_ends(results, measure);
        if !note.is_empty() {
            text += &format!("\n{}: {note}\n", markdown_line(&measure.title()));
        }
    }
    if let (Some(lock), Some(audit)) = (&results.manifest.lock, &results.audit) {
        text += &format!("\nRegistered before the runs: lock `{}`.\n", lock.id);
        for sentence in audit.broken.iter().chain(&audit.notes) {
            text += &paragraph(sentence);
        }
    }
    if let Some(sentence) = results.manifest.changed_repeats_sentence() {
        text += &paragraph(&sentence);
    }
    text
}

/// What a reader must know of the times that a claim compares, and how many runs would decide it if it is open;
/// empty if nothing.
#[must_use]
pub fn note_about_claim(results: &Results, claim: &Claim, claim_result: &ClaimResult) -> String {
    let names = [claim.compare.0.as_str(), claim.compare.1.as_str()];
    let measure = results.study.measure_of(claim);
    let Some(comparison) = claim_result.comparison else {
        return String::new();
    };
    if let (Interval::TooFewRuns { n }, Some(_)) = (claim_result.interval, claim_result.verdict) {
        return format!(
            "{} for a verdict: expected {MIN_RUNS} or more of each cell.",
            format::too_few_runs(n)
        );
    }
    let of_times = note_about_times(results, measure, names, &comparison);
    let of_runs = note_about_runs_needed(results, claim, claim_result);
    let notes = [of_times, of_runs.unwrap_or_default()];
    notes.join(" ").trim().to_owned()
}

/// How many runs would decide a claim that is open, if runs differ as much as these.
fn note_about_runs_needed(
    results: &Results,
    claim: &Claim,
    claim_result: &ClaimResult,
) -> Option<String> {
    let is_open = claim_result.verdict == Some(Verdict::Open);
    let comparison = claim_result.comparison.filter(|_| is_open)?;
    let deviation = comparison.deviation(claim.has_one_score_per_pair())?;
    let runs = match runs_with_deviation(&results.study, claim, deviation) {
        Some(runs) => runs.to_string(),
        None => format!("more than {MAX_RUNS}"),
    };
    let scores = if claim.has_one_score_per_pair() {
        "Differences"
    } else {
        "Scores of runs"
    };
    let smallest = format::number(claim.smallest.get());
    let finds = if claim.direction.rule().is_null {
        format!("exclude an effect of {smallest}, if there is none,")
    } else {
        format!("find an effect of {smallest}")
    };
    Some(format!(
        "{scores} have a standard deviation of {}: a new study with {runs} runs per cell would {finds} with a probability \
         of 0.8.",
        format::number(deviation)
    ))
}

/// A paragraph of a sentence that may have names in it.
fn paragraph(sentence: &str) -> String {
    format!("\n{}\n", markdown_line(sentence))
}

/// Explanation of intervals and p-values below the table.
const CLAIMS_NOTE: &str = "Holm's procedure decides confirmatory claims: p is one-sided, corrected within the claims \
    of an effect or those of no effect, and a claim is supported if p is at most 0.025 and there are five runs or more. Its interval has the \
    error probability at which it was tested. Exploratory comparisons have single 95 % intervals and no verdict.";

/// Text above the table with the reasons why the results are not final; empty if they are final.
fn caveats(results: &Results) -> String {
    let [_, failed, missing] = results.run_counts();
    let mut caveats = Vec::new();
    if results.is_tuning() {
        caveats.push("tuning seeds".to_owned());
    }
    if results.manifest.quick {
        caveats.push("a quick run".to_owned());
    }
    if missing > 0 {
        caveats.push(format!("{} missing", pluralize(missing, "run")));
    }
    if failed > 0 {
        caveats.push(format!("{} failed", pluralize(failed, "run")));
    }
    if results
        .audit
        .as_ref()
        .is_some_and(|audit| !audit.broken.is_empty())
    {
        caveats.push("not what was registered (see below)".to_owned());
    }
    if caveats.is_empty() {
        String::new()
    } else {
        format!("Not final: {}.\n\n", caveats.join(", "))
    }
}

/// The effect with its interval and the values of both cells, such as `−0.25 (−0.4 to −0.1), 0.7 against 0.95`, or `no runs`.
#[must_use]
pub fn effect_found(claim_result: &ClaimResult) -> String {
    match &claim_result.comparison {
        Some(comparison) => format::effect(comparison, claim_result.interval),
        None => "no runs".to_owned(),
    }
}

fn row(results: &Results, claim: &Claim, claim_result: &ClaimResult) -> String {
    let (first, second) = (claim.compare.0.as_str(), claim.compare.1.as_str());
    let measure = results.study.measure_of(claim).title();
    let compared = format!(
        "{measure}: {first} − {second}, claimed {}",
        format::claimed_effect(claim)
    );
    let found = effect_found(claim_result);
    let n = match claim_result.comparison.map(|comparison| comparison.n) {
        Some([first, second]) if first == second => first.to_string(),
        Some([first, second]) => format!("{first}, {second}"),
        None => "0".to_owned(),
    };
    let late = if claim_result.is_late {
        ", claimed late"
    } else {
        ""
    };
    let verdict = format!("{}{late}", claim_result.verdict_text());
    let cells = [
        claim.text.as_str(),
        &compared,
        &found,
        &n,
        &format::p_value_of_claim(claim_result),
        &verdict,
    ];
    let escaped = cells.map(markdown_cell);
    format!("| {} |\n", escaped.join(" | "))
}
