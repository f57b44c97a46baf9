//! The page: HTML that needs no other file and no network, and is read on any screen.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::tables::Table;
use super::{Drawn, words};
use crate::study::build;
use crate::study::claims::{Judgement, LEAST_RUNS_OF_A_NULL};
use crate::study::comparison::Comparison;
use crate::study::file::{Claim, FIRST_REPORTING_SEED};
use crate::study::measure::Measure;
use crate::study::results::{CellResults, Results};
use crate::study::statistics::{LEAST_RUNS, Verdict};

/// Percentile intervals of fewer runs are said to be too narrow.
const FEW: u64 = 20;

const STYLE: &str = include_str!("page.css");

pub(super) fn html(
    results: &Results,
    judgements: &[Judgement],
    tables: &[Table],
    drawn: &[Drawn],
) -> String {
    let study = &results.study;
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (study.title) }
                style { (PreEscaped(STYLE)) (PreEscaped(crate::figure::font_faces())) }
            }
            body {
                header {
                    h1 { (study.title) }
                    @if !study.about.is_empty() { p { (study.about) } }
                    (warnings(results))
                }
                main {
                    @if !study.claims.is_empty() { (claims_section(results, judgements)) }
                    @if !drawn.is_empty() { h2 { "Figures" } }
                    @for (number, figure) in (1..).zip(drawn) { (figure_section(number, figure)) }
                    h2 { "Numbers" }
                    @for table in tables { (table_of_words(table)) }
                    (failures(results))
                    (how_it_was_run(results))
                    (how_to_read())
                }
            }
        }
    };
    page.into_string()
}

/// What keeps these results from being final.
fn warnings(results: &Results) -> Markup {
    let [finished, failed, missing] = results.counts();
    let seeds = results.manifest.first_seed..results.manifest.first_seed + results.manifest.repeats;
    html! {
        p.facts {
            (words::counted(results.cells.len(), "cell")) ", " (words::counted(finished, "finished run")) ", seeds " (seeds.start) " to " (seeds.end - 1) "."
        }
        @if results.manifest.repeats < FEW {
            p.warning {
                strong { "Few runs. " }
                "Intervals of fewer than " (FEW) " runs are too narrow: of effects that are none, they exclude 0 in about one of six cases at five                  runs, in one of eleven at ten, instead of one of twenty."
            }
        }
        @if let Some(words) = results.manifest.changed_repeats() {
            p.warning { strong { (words) } " An interval that is looked at more than once excludes 0 more often than one of twenty." }
        }
        @if results.is_tuning() {
            p.warning {
                strong { "Tuning seeds. " }
                "Seeds below " (FIRST_REPORTING_SEED) " are for choosing settings; nothing here may be published as a result."
            }
        }
        @if results.manifest.quick {
            p.warning { strong { "Quick run. " } "Fewer or shorter runs than the study asks for, to see whether all is as meant." }
        }
        @if missing > 0 {
            p.warning { strong { "Not complete. " } (words::counted(missing, "run")) " missing; what follows is of those that are there." }
        }
        @if failed > 0 {
            p.warning { strong { (words::counted(failed, "run")) " failed. " } "Left out of all numbers; the reasons stand below." }
        }
        @if results.versions.len() > 1 {
            p.warning {
                strong { "Several versions. " }
                "Runs come from versions " (results.versions.iter().cloned().collect::<Vec<_>>().join(", "))
                ", which need not give the same bits."
            }
        }
        @if results.builds.len() > 1 {
            p.warning {
                strong { "Several builds. " }
                "Runs come from " (results.builds.len()) " builds (" (builds(results)) "); "
                code { "seedbed study " (results.manifest.study_path) " --verify" } " tells whether they still come out the same."
            }
        }
    }
}

fn claims_section(results: &Results, judgements: &[Judgement]) -> Markup {
    html! {
        h2 { "Claims" }
        p.facts { (words::tally(judgements)) "." }
        @for (claim, judgement) in results.study.claims.iter().zip(judgements) { (claim_card(results, claim, judgement)) }
    }
}

fn claim_card(results: &Results, claim: &Claim, judgement: &Judgement) -> Markup {
    let measure = results.study.measure_of(claim);
    html! {
        section.claim.(class(judgement.verdict)) {
            p.verdict { (judgement.in_words()) @if judgement.late { ", but claimed late" } }
            p.text { (claim.text) @if !claim.source.is_empty() { span.source { " " (claim.source) } } }
            p.compared {
                (measure.title()) ": " strong { (claim.compare.0.as_str()) } " less " strong { (claim.compare.1.as_str()) }
                ", claimed to be " (words::claimed(claim))
            }
            @if let Some(words) = different_budgets(results, claim, measure) { p.evidence { (words) } }
            @match &judgement.comparison {
                Some(comparison) => { (evidence(claim, measure, comparison, judgement.p)) }
                None => { p.evidence { "There are no runs to compare." } }
            }
        }
    }
}

/// Times are compared up to where all is known; of all else the reader has to know that one side had more time.
fn different_budgets(results: &Results, claim: &Claim, measure: Measure) -> Option<String> {
    let most = |name: &str| results.cell(name).map(|cell| cell.about.most_episodes);
    let (first, second) = (most(&claim.compare.0)?, most(&claim.compare.1)?);
    (first != second && !measure.is_time()).then(|| {
        format!(
            "Not alike: the first may take {first} episodes of each agent, the second {second}."
        )
    })
}

fn evidence(claim: &Claim, measure: Measure, comparison: &Comparison, p: f64) -> Markup {
    let [first, second] = comparison.n;
    html! {
        p.evidence {
            "Found: " strong { (words::effect(comparison)) }
            "; n = " (first) @if first != second { " and " (second) }
            "; " (who_is_ahead(claim, comparison))
            @if claim.direction.is_null() { "; no p: a high one would be no evidence. " } @else { "; " (words::p_is(p)) " after Holm. " }
            span.source { (how_compared(claim, measure)) "." (up_to(comparison)) }
        }
    }
}

/// How likely a run of the first lies on the claimed side of one of the second.
fn who_is_ahead(claim: &Claim, comparison: &Comparison) -> String {
    let (side, probability) = if claim.direction.is_upwards() {
        ("above", comparison.above())
    } else {
        ("below", comparison.below)
    };
    format!("P(first {side} second) = {}", words::estimate(probability))
}

/// What the effect is and, where a p of it is told, the test that this is from.
fn how_compared(claim: &Claim, measure: Measure) -> String {
    let [effect, test] = words::test(claim.test, measure.is_time());
    if claim.direction.is_null() {
        effect.to_owned()
    } else {
        format!("{effect}; {test}")
    }
}

fn up_to(comparison: &Comparison) -> String {
    if comparison.horizon.is_infinite() {
        return String::new();
    }
    format!(
        " Times count up to {}, where the first run ended that did not get there.",
        words::number(comparison.horizon)
    )
}

fn class(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Replicated => "replicated",
        Verdict::NotReplicated => "refuted",
        Verdict::Inconclusive => "open",
    }
}

fn figure_section(number: usize, figure: &Drawn) -> Markup {
    let least = figure
        .picture
        .width
        .min((0.6 * figure.picture.width).max(340.0));
    html! {
        figure {
            div.scroll {
                div.picture style={ "min-width:" (least) "px;max-width:" (figure.picture.width) "px" } {
                    (PreEscaped(figure.picture.svg()))
                }
            }
            figcaption {
                strong { "Figure " (number) ". " (figure.title) ". " } (figure.caption)
                " Files: figures/" (figure.name) ".svg, .png."
            }
        }
    }
}

/// The first column is broader than those of numbers.
fn name_of(column: usize) -> Option<&'static str> {
    (column == 0).then_some("name")
}

fn table_of_words(table: &Table) -> Markup {
    html! {
        h3 { (table.title) }
        div.scroll {
            table {
                thead { tr { @for (column, name) in table.head.iter().enumerate() { th class=[name_of(column)] { (name) } } } }
                tbody {
                    @for row in &table.rows {
                        tr { @for (column, cell) in row.iter().enumerate() { td class=[name_of(column)] { (cell) } } }
                    }
                }
            }
        }
    }
}

fn failures(results: &Results) -> Markup {
    let failed = || {
        results
            .cells
            .iter()
            .filter(|cell| !cell.failures.is_empty())
    };
    html! {
        @if failed().next().is_some() {
            h2 { "Failed runs" }
            ul {
                @for cell in failed() {
                    @for (seed, reason) in &cell.failures { li { (cell.about.name) ", seed " (seed) ": " (reason) } }
                }
            }
        }
    }
}

fn how_it_was_run(results: &Results) -> Markup {
    let manifest = &results.manifest;
    let quick = if manifest.quick { " --quick" } else { "" };
    html! {
        h2 { "How it was run" }
        pre { "seedbed study " (manifest.study_path) (quick) }
        p {
            "Runs: seedbed " (results.versions.iter().cloned().collect::<Vec<_>>().join(", ")) ", build " (builds(results)) ". \
             This page: seedbed " (env!("CARGO_PKG_VERSION")) " with " (build::parts().join(", ")) "."
        }
        p { "One run of a cell, with its recording:" }
        div.scroll {
            table {
                thead { tr { th.name { "cell" } th { "K" } th { "episodes at most" } th.name { "command" } } }
                tbody {
                    @for cell in &results.cells {
                        tr {
                            td.name { (cell.about.name) }
                            td { (cell.about.agents) }
                            td { (cell.about.most_episodes) }
                            td.name { code { (command(cell, manifest.first_seed)) } }
                        }
                    }
                }
            }
        }
        details { summary { "The study's file" } pre { (manifest.study) } }
    }
}

/// The marks of all builds that ran any of it.
fn builds(results: &Results) -> String {
    results
        .builds
        .iter()
        .map(|build| build::in_words(*build))
        .collect::<Vec<_>>()
        .join(", ")
}

fn command(cell: &CellResults, seed: u64) -> String {
    let sets = cell
        .about
        .overrides
        .iter()
        .map(|text| format!(" --set {}", quoted(text)));
    format!(
        "seedbed run {} --seed {seed}{}",
        quoted(&cell.about.scenario),
        sets.collect::<String>()
    )
}

/// As a shell takes it for one word.
fn quoted(text: &str) -> String {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "/._-=:+,@".contains(letter);
    if text.chars().all(is_plain) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', r"'\''"))
    }
}

fn how_to_read() -> Markup {
    html! {
        h2 { "How to read it" }
        p {
            "A run is a whole team; agents and episodes of one run are no repeats. Intervals hold 95 %: percentile bootstrap of 50 000 \
             redrawn samples and, for medians of times, Brookmeyer and Crowley's. Times are censored where a run ended first; their medians \
             are Kaplan and Meier's. IQM is the mean of the middle half of the runs. Fewer than " (LEAST_RUNS) " runs make no interval.              Effects are medians of differences of times, and means of differences of all else. Two times that were both not reached differ by              nobody knows what: an effect is " em { "unknown" } " where that decides, or two numbers between \
             which it lies, and its interval reaches as far as it may."
        }
        p {
            "A claim that there is an effect is " em { "replicated" } " if the interval of the effect excludes 0 in the claimed direction, "
            em { "not replicated" } " if not, and it excludes the claimed size, and else " em { "inconclusive" } ". It is replicated but "
            em { "smaller than claimed" } " if the interval excludes 0 and the claimed size. A claim that there is none \
             is replicated if at least " (LEAST_RUNS_OF_A_NULL) " runs put the whole interval within the claimed bounds, and not replicated if \
             all of it lies outside. The interval alone decides; the test's p after Holm, over all claims of the study, stands beside it for \
             who would rather be strict. " (words::NO_P) " Cells, measure, test, direction and size stand in the study's file. A claim is \
             said to be late if it was written or changed when both sides had runs already."
        }
    }
}
