//! `claims.md`: one row a claim, to stand in a text.

use super::words;
use crate::study::claims::Judgement;
use crate::study::file::Claim;
use crate::study::results::Results;

pub(super) fn markdown(results: &Results, judgements: &[Judgement]) -> String {
    let head = caveats(results)
        + "| claim | compared | found | n | p | verdict |\n|---|---|---|---|---|---|\n";
    let rows = results
        .study
        .claims
        .iter()
        .zip(judgements)
        .map(|(claim, judgement)| row(results, claim, judgement));
    rows.fold(head, |table, row| table + &row) + &note(results)
}

/// What stands below the table.
fn note(results: &Results) -> String {
    let has_null = results
        .study
        .claims
        .iter()
        .any(|claim| claim.direction.is_null());
    let notes = [
        has_null.then(|| words::NO_P.to_owned()),
        results.manifest.changed_repeats(),
    ];
    notes
        .into_iter()
        .flatten()
        .map(|note| format!("\n{note}\n"))
        .collect::<Vec<_>>()
        .concat()
}

/// What keeps the table from being final.
fn caveats(results: &Results) -> String {
    let [_, failed, missing] = results.counts();
    let caveats = [
        (results.is_tuning(), "tuning seeds".to_owned()),
        (results.manifest.quick, "a quick run".to_owned()),
        (
            missing > 0,
            format!("{} missing", words::counted(missing, "run")),
        ),
        (
            failed > 0,
            format!("{} failed", words::counted(failed, "run")),
        ),
    ];
    let words: Vec<String> = caveats
        .into_iter()
        .filter(|(holds, _)| *holds)
        .map(|(_, words)| words)
        .collect();
    if words.is_empty() {
        String::new()
    } else {
        format!("Not final: {}.\n\n", words.join(", "))
    }
}

fn row(results: &Results, claim: &Claim, judgement: &Judgement) -> String {
    let (first, second) = (claim.compare.0.as_str(), claim.compare.1.as_str());
    let measure = results.study.measure_of(claim).title();
    let compared = format!(
        "{measure}: {first} less {second}: claimed {}",
        words::claimed(claim)
    );
    let found = judgement
        .comparison
        .map_or("no runs".to_owned(), |comparison| {
            words::effect(&comparison)
        });
    let n = match judgement.comparison.map(|comparison| comparison.n) {
        Some([first, second]) if first == second => first.to_string(),
        Some([first, second]) => format!("{first}, {second}"),
        None => "0".to_owned(),
    };
    let late = if judgement.late {
        ", but claimed late"
    } else {
        ""
    };
    let verdict = format!("{}{late}", judgement.in_words());
    let cells = [
        claim.text.as_str(),
        &compared,
        &found,
        &n,
        &words::p_of_claim(claim, judgement.p),
        &verdict,
    ];
    let escaped = cells.map(|cell| cell.replace('|', "\\|"));
    format!("| {} |\n", escaped.join(" | "))
}
