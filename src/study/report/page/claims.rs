//! Sections of a report with its registration and its claims.

use maud::{Markup, html};

use super::figure_section;
use super::warnings::warning;
use crate::experiment::measure::Measure;
use crate::study::design::file::Claim;
use crate::study::design::lock::Lock;
use crate::study::evaluate::claims::ClaimResult;
use crate::study::evaluate::comparison::Comparison;
use crate::study::evaluate::gate::gates;
use crate::study::evaluate::results::{Audit, Results};
use crate::study::evaluate::rules::Rule;
use crate::study::report::claims_table::note_about_claim;
use crate::study::report::{ReportFigure, format};
use seedbed_stats::Verdict;

pub(super) fn registration_section(lock: &Lock, audit: &Audit) -> Markup {
    html! {
        h2 { "Registration" }
        p.facts {
            "Registered before the runs: lock " code { (lock.id) } ". Run seeds are derived from it. Stored runs could be \
             edited together with their checksums; to repeat them: " code { "seedbed study verify STUDY --registered" } "."
        }
        @for sentence in &audit.broken { (warning("Not confirmed.", sentence)) }
        @for sentence in &audit.notes { p.evidence { (sentence) } }
    }
}

pub(super) fn claims_section(
    results: &Results,
    claim_results: &[ClaimResult],
    figure: Option<&ReportFigure>,
) -> Markup {
    html! {
        h2 { "Claims" }
        p.facts { (format::summarize_claims(claim_results)) "." }
        @if let Some(exploration) = &results.study.exploration {
            @for gate in gates(results) { p.evidence { (gate.sentence(*exploration.measure)) } }
        }
        @if let Some(figure) = figure { (figure_section("", figure)) }
        @for (claim, claim_result) in results.study.claims.iter().zip(claim_results) {
            (claim_card(results, claim, claim_result))
        }
    }
}

fn claim_card(results: &Results, claim: &Claim, claim_result: &ClaimResult) -> Markup {
    let measure = results.study.measure_of(claim);
    let (first, second) = (claim.compare.0.as_str(), claim.compare.1.as_str());
    html! {
        section.claim.(css_class(claim_result.verdict)) {
            p.verdict {
                (claim_result.verdict_text()) @if claim_result.is_late { ", claimed late" }
            }
            p.text {
                (claim.text)
                @if !claim.source.is_empty() { span.source { " " (claim.source) } }
            }
            p.compared {
                (measure.title()) ": " strong { (first) } " − " strong { (second) }
                ", claimed to be " (format::claimed_effect(claim))
            }
            @if let Some(sentence) = unequal_budgets_sentence(results, claim, measure) {
                p.evidence { (sentence) }
            }
            @if !claim.because.is_empty() {
                p.evidence { "Smaller effects are of no interest: " (claim.because) }
            }
            @match &claim_result.comparison {
                Some(comparison) => { (evidence_text(claim, measure, comparison, claim_result)) }
                None => { p.evidence { "There are no runs to compare." } }
            }
            @let note = note_about_claim(results, claim, claim_result);
            @if !note.is_empty() { p.evidence { (note) } }
        }
    }
}

/// Sentence for claims that compare cells with different numbers of episodes. Times need no such
/// sentence, because they are compared up to the end of the shortest run.
fn unequal_budgets_sentence(results: &Results, claim: &Claim, measure: Measure) -> Option<String> {
    let max_episodes = |name: &str| results.cell(name).map(|cell| cell.description.max_episodes);
    let first = max_episodes(&claim.compare.0)?;
    let second = max_episodes(&claim.compare.1)?;
    (first != second && !measure.is_time()).then(|| {
        format!(
            "Unequal budgets: each agent has at most {first} episodes in the first cell, and at most \
             {second} in the second."
        )
    })
}

fn evidence_text(
    claim: &Claim,
    measure: Measure,
    comparison: &Comparison,
    claim_result: &ClaimResult,
) -> Markup {
    let [first, second] = comparison.n;
    html! {
        p.evidence {
            "Found: " strong { (format::effect(comparison, claim_result.interval)) }
            "; n = " (first) @if first != second { " and " (second) }
            "; " (probability_text(claim, comparison))
            @if let Some(p) = claim_result.p { "; " (format::p_equation(p)) " (Holm)" }
            ". "
            @if comparison.is_constant {
                "All runs of both cells have the same value: they may be at a floor or a ceiling. "
            }
            span.source { (method_text(claim, measure)) }
        }
    }
}

/// Probability that a run of the first cell is above or below (as claimed) a run of the second.
fn probability_text(claim: &Claim, comparison: &Comparison) -> String {
    let (side, probability) = if claim.direction.rule().is_upwards {
        ("above", comparison.probability_above())
    } else {
        ("below", comparison.probability_below)
    };
    format!("P(first {side} second) = {}", format::estimate(probability))
}

/// Definition of the effect, and the test.
fn method_text(claim: &Claim, measure: Measure) -> String {
    let Rule { effect, test, .. } = format::comparison_rule(measure, claim);
    let horizon = claim.horizon.map_or(String::new(), |horizon| {
        format!(
            " Times are compared up to {}.",
            format::number(horizon.get())
        )
    });
    format!("Effect: {effect}. Test: {test}.{horizon}")
}

fn css_class(verdict: Option<Verdict>) -> &'static str {
    match verdict {
        Some(Verdict::Supported | Verdict::NoRelevantEffect) => "supported",
        Some(Verdict::Refuted) => "refuted",
        Some(Verdict::Negligible | Verdict::Open) => "open",
        None => "exploratory",
    }
}
