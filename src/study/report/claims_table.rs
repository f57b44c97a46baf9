//! `claims.md`: one row per claim, to be included in other documents.

use super::format;
use crate::study::claims::ClaimResult;
use crate::study::file::Claim;
use crate::study::results::Results;
use crate::text::pluralize;

pub(super) fn markdown(results: &Results, claim_results: &[ClaimResult]) -> String {
    let mut text = caveats(results);
    text += "| claim | compared | found | n | p | verdict |\n|---|---|---|---|---|---|\n";
    for (claim, claim_result) in results.study.claims.iter().zip(claim_results) {
        text += &row(results, claim, claim_result);
    }
    for note in notes(results) {
        text += &format!("\n{note}\n");
    }
    text
}

/// Notes below the table.
fn notes(results: &Results) -> Vec<String> {
    let mut notes = Vec::new();
    let mut claims = results.study.claims.iter();
    if claims.any(|claim| claim.direction.is_null()) {
        notes.push(format::P_VALUE_NOTE.to_owned());
    }
    notes.extend(results.manifest.changed_repeats_sentence());
    notes
}

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
    if caveats.is_empty() {
        String::new()
    } else {
        format!("Not final: {}.\n\n", caveats.join(", "))
    }
}

fn row(results: &Results, claim: &Claim, claim_result: &ClaimResult) -> String {
    let (first, second) = (claim.compare.0.as_str(), claim.compare.1.as_str());
    let measure = results.study.measure_of(claim).title();
    let compared = format!(
        "{measure}: {first} − {second}, claimed {}",
        format::claimed_effect(claim)
    );
    let found = match &claim_result.comparison {
        Some(comparison) => format::effect(comparison),
        None => "no runs".to_owned(),
    };
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
        &format::p_value_of_claim(claim, claim_result.p),
        &verdict,
    ];
    let escaped = cells.map(|cell| cell.replace('|', "\\|"));
    format!("| {} |\n", escaped.join(" | "))
}
