//! The figure of claims: the effect of each with its interval (a forest plot).

use crate::experiment::measure::Measure;
use crate::study::design::file::Claim;
use crate::study::evaluate::claims::ClaimResult;
use crate::study::evaluate::results::Results;
use crate::study::report::ReportFigure;
use seedbed_figure::{Color, Figure as Picture, IntervalRow, Intervals, Key, Panel, Row};
use seedbed_stats::Verdict;

/// Maximum number of letters in a line of a name.
const LINE_LETTERS: usize = 44;

const CAPTION: &str = "Differences that the claims are about, first cell minus second, each with the interval that decides: of \
    exploratory comparisons the single 95 % interval. Dashed: no difference. Shaded: smaller than the smallest effect of \
    interest.";

/// One panel per measure; `None` if no claim has runs.
pub(in crate::study::report) fn claims(
    results: &Results,
    claim_results: &[ClaimResult],
) -> Option<ReportFigure> {
    let rows: Vec<Row> = results
        .measures_of_claims()
        .into_iter()
        .filter_map(|measure| row_of_measure(results, claim_results, measure))
        .collect();
    if rows.is_empty() {
        return None;
    }
    let title = "Claims".to_owned();
    let picture = Picture {
        title: title.clone(),
        description: CAPTION.to_owned(),
        width: 760.0,
        rows,
    };
    Some(ReportFigure {
        name: "claims".to_owned(),
        title,
        caption: CAPTION.to_owned(),
        picture,
    })
}

fn row_of_measure(
    results: &Results,
    claim_results: &[ClaimResult],
    measure: Measure,
) -> Option<Row> {
    let study = &results.study;
    let of_measure: Vec<_> = study
        .claims
        .iter()
        .zip(claim_results)
        .filter(|(claim, _)| study.measure_of(claim) == measure)
        .collect();
    let rows: Vec<IntervalRow> = of_measure
        .iter()
        .filter_map(|(claim, claim_result)| interval_row(claim, claim_result))
        .collect();
    if rows.is_empty() {
        return None;
    }
    let panel = Intervals {
        title: String::new(),
        x_label: format!("difference in {}", measure.title()),
        rows,
        reference: Some(0.0),
    };
    Some(Row {
        height: panel.height(),
        panels: vec![Panel::Intervals(panel)],
        key: Some(Key::Categories(verdicts(
            of_measure.iter().map(|pair| pair.1),
        ))),
    })
}

/// The effect of a claim; `None` without runs.
fn interval_row(claim: &Claim, claim_result: &ClaimResult) -> Option<IntervalRow> {
    let comparison = claim_result.comparison?;
    Some(IntervalRow {
        name: in_lines(claim.text.trim_end_matches('.')),
        estimate: Some(comparison.effect.value),
        interval: claim_result.interval.ends(),
        margin: Some(claim.smallest.get()),
        n: comparison.n[0].min(comparison.n[1]),
        color: color_of(claim_result.verdict),
    })
}

/// The verdicts that occur, in a fixed order, with their colors.
fn verdicts<'a>(claim_results: impl Iterator<Item = &'a ClaimResult>) -> Vec<(String, Color)> {
    let occurring: Vec<Option<Verdict>> = claim_results.map(|result| result.verdict).collect();
    let all = [
        (Some(Verdict::Supported), "supported"),
        (Some(Verdict::NoRelevantEffect), "no relevant effect"),
        (Some(Verdict::Negligible), "negligible"),
        (Some(Verdict::Refuted), "refuted"),
        (Some(Verdict::Open), "open"),
        (None, "exploratory"),
    ];
    all.into_iter()
        .filter(|(verdict, _)| occurring.contains(verdict))
        .map(|(verdict, name)| (name.to_owned(), color_of(verdict)))
        .collect()
}

fn color_of(verdict: Option<Verdict>) -> Color {
    match verdict {
        Some(Verdict::Supported) => [20, 110, 100],
        Some(Verdict::NoRelevantEffect) => [44, 61, 119],
        Some(Verdict::Negligible) => [110, 150, 140],
        Some(Verdict::Refuted) => [190, 80, 0],
        Some(Verdict::Open) => [125, 125, 135],
        None => [150, 90, 210],
    }
}

/// A text with line breaks between words, so that lines have at most [`LINE_LETTERS`] letters.
fn in_lines(text: &str) -> String {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= LINE_LETTERS => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_claims_have_several_lines() {
        assert_eq!(in_lines("A is faster"), "A is faster");
        let text = "Four agents that share everything solve it in fewer episodes";
        let expected = "Four agents that share everything solve it\nin fewer episodes";
        assert_eq!(in_lines(text), expected);
        let word = "ü".repeat(60);
        assert_eq!(in_lines(&word), word);
    }
}
