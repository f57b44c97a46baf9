//! `report.html`: a page that loads no external files, so that it can be read offline.

mod claims;
mod provenance;
mod warnings;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use self::claims::{claims_section, registration_section};
use self::provenance::{reproduction_section, results_of_others_section};
use self::warnings::warnings;
use super::tables::Table;
use super::{ReportFigure, states};
use crate::study::evaluate::claims::ClaimResult;
use crate::study::evaluate::results::Results;
use crate::text::{html_page, pluralize};
use seedbed_stats::MIN_RUNS;

const STYLE: &str = include_str!("page.css");

pub(super) fn html(
    results: &Results,
    claim_results: &[ClaimResult],
    tables: &[Table],
    figures: &[ReportFigure],
    claims_figure: Option<&ReportFigure>,
) -> String {
    let study = &results.study;
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (study.title) }
                style { (PreEscaped(STYLE)) (PreEscaped(seedbed_figure::font_faces())) }
            }
            body {
                header {
                    h1 { (study.title) }
                    @if !study.about.is_empty() { p { (study.about) } }
                    (summary(results))
                    (warnings(results))
                }
                main {
                    @if let (Some(lock), Some(audit)) = (&results.manifest.lock, &results.audit) {
                        (registration_section(lock, audit))
                    }
                    @if !study.claims.is_empty() {
                        (claims_section(results, claim_results, claims_figure))
                    }
                    @if !figures.is_empty() { h2 { "Figures" } }
                    @for (number, figure) in (1..).zip(figures) { (figure_section(&format!("Figure {number}. "), figure)) }
                    @if let Some(section) = states::section(results) { (section) }
                    h2 { "Tables" }
                    @for table in tables { (table_section(table)) }
                    (failures_section(results))
                    (results_of_others_section(results))
                    (reproduction_section(results))
                    (methods_section())
                }
            }
        }
    };
    html_page(page)
}

/// Numbers of cells and finished runs, and the run seeds.
fn summary(results: &Results) -> Markup {
    let [finished, _, _] = results.run_counts();
    html! {
        p.facts {
            (pluralize(results.cells.len(), "cell")) ", "
            (pluralize(finished, "finished run")) ", " (run_seeds_text(results)) "."
        }
    }
}

fn run_seeds_text(results: &Results) -> String {
    let manifest = &results.manifest;
    let mut cells = manifest.cells.iter();
    if cells.all(|cell| cell.external.is_some()) {
        return "made by others".to_owned();
    }
    if let Some(lock) = &manifest.lock {
        return format!("seeds from the lock {}", lock.short_id());
    }
    let last_seed = manifest.first_seed + manifest.repeats - 1;
    format!("seeds {} to {last_seed}", manifest.first_seed)
}
/// A figure with its caption. `number`: such as `Figure 1. `, or nothing
fn figure_section(number: &str, figure: &ReportFigure) -> Markup {
    let width = figure.picture.width;
    let min_width = width.min((0.6 * width).max(340.0));
    html! {
        figure {
            div.scroll tabindex="0" {
                div.picture style={ "min-width:" (min_width) "px;max-width:" (width) "px" } {
                    (PreEscaped(figure.picture.svg()))
                }
            }
            figcaption {
                strong { (number) (figure.title) ". " } (figure.caption)
                " Files: figures/" (figure.name) ".svg, .pdf, .png."
            }
        }
    }
}

/// CSS class of a column. The first column has names and is wider than columns of numbers.
fn class_of_column(column: usize) -> Option<&'static str> {
    (column == 0).then_some("name")
}

fn table_section(table: &Table) -> Markup {
    html! {
        h3 { (table.title) }
        div.scroll tabindex="0" {
            table {
                thead {
                    tr {
                        @for (column, name) in table.head.iter().enumerate() {
                            th class=[class_of_column(column)] { (name) }
                        }
                    }
                }
                tbody {
                    @for row in &table.rows {
                        tr {
                            @for (column, cell) in row.iter().enumerate() {
                                td class=[class_of_column(column)] { (cell) }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn failures_section(results: &Results) -> Markup {
    let [_, failed, _] = results.run_counts();
    html! {
        @if failed > 0 {
            h2 { "Failed runs" }
            ul {
                @for cell in &results.cells {
                    @for (seed, reason) in &cell.failures {
                        li {
                            (cell.description.name) ", "
                            @match cell.run_name(*seed) {
                                Some(name) => { (name) }
                                None => { "seed " (seed) }
                            }
                            ": " (reason)
                        }
                    }
                }
            }
        }
    }
}
fn methods_section() -> Markup {
    html! {
        h2 { "How to read this report" }
        p {
            "Statistics count runs. One run is one whole team with one seed; agents and episodes of the \
             same run are not independent, so they do not count as repetitions. All intervals are 95 % \
             intervals. In tables of single cells, they are those of Brookmeyer and Crowley for median times, Wilson's for shares of \
             runs, and otherwise percentile bootstrap intervals from 50,000 resamples. With fewer than " (MIN_RUNS) " runs, only shares have an interval. \
             IQM is the interquartile mean: the mean of the middle half of the runs."
        }
        p {
            "If a run ended without reaching its time, the time is censored, not dropped; medians of \
             times are Kaplan–Meier estimates. Comparisons of times are of restricted means: times up to a horizon \
             (the smaller maximum number of episodes of the two cells, unless the claim says another), \
             where longer times count as the horizon. A run that ended before the horizon without reaching its time may have \
             reached it at any time afterwards: intervals and verdicts hold for all that is possible."
        }
        p {
            "Each kind of measure has one effect and one test, and intervals are inversions of this test: \
             differences of shares of solved runs by the exact unconditional score test, differences of means by \
             a permutation test. So an interval excludes an effect exactly if the test rejects it. The probability \
             that a run is above or below another has Newcombe's interval."
        }
        p {
            "Costs are counted until a run solved its task or ended: episodes of each agent, environment steps of the \
             whole team, and gradient steps of all its networks. S(K) is the mean number of episodes of the fastest cell \
             with one agent in the same task over that of this cell, and E(K) = S(K) / K. Shares have Wilson's interval."
        }
        p {
            em { "Confirmatory" } " claims are decided by Holm's procedure, in one family of the claims of an effect \
             and one of the claims of no effect: the probability that any claim of a family is falsely supported is at \
             most 2.5 %. The interval of a claim has the error probability at which Holm's procedure tested it. A claim \
             of an effect is " em { "supported" } " if its interval excludes 0 in the claimed direction, "
            em { "supported but negligible" } " if it also excludes the smallest effect of interest, "
            em { "refuted" } " if it excludes the smallest effect of interest but not 0, and otherwise " em { "open" }
            ". For a claim of no effect there is " em { "no relevant effect" } " (with a margin on one side only: no relevant \
             increase or decrease) if the whole interval is within the margins; it is " em { "refuted" } " if the whole interval is outside, and otherwise open. Claims whose runs \
             all have the same value are open."
        }
        p {
            em { "Exploratory" } " comparisons have single 95 % intervals and no verdict. Cells, measure, direction and \
             smallest effect of interest of each claim are fixed in the study file. A claim is " em { "late" } " if it was \
             written or changed when both of its cells already had runs."
        }
    }
}
#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::{claims_table, figures, tables};
    use super::*;
    use crate::experiment::run_result::RunResult;
    use crate::study::design::cell::CellDescription;
    use crate::study::evaluate::claims;
    use crate::study::evaluate::results::{CellResults, Results};
    use crate::study::store::Manifest;

    pub(super) const STUDY: &str = r#"Study(
        title: "Small",
        cells: [(name: "A"), (name: "B")],
        measures: [EpisodesToSolve, FinalReturn()],
        claims: [
            (text: "A is faster.", compare: ("A", "B"), direction: Less, smallest: 5, confirmatory: true),
            (text: "A is not better.", compare: ("A", "B"), measure: FinalReturn(), direction: NotMore, smallest: 1),
        ],
        figures: [Curves(), Agents(), Intervals(), Unsolved(), Profiles()],
    )"#;

    /// A run with a threshold and the returns of two agents. The second agent has the constant
    /// return `return_of_second_agent`.
    fn run(seed: u64, return_of_second_agent: f64) -> RunResult {
        let returns: Vec<f64> = (0..40)
            .map(|episode| f64::from(episode) + seed as f64)
            .collect();
        RunResult {
            returns: vec![returns, vec![return_of_second_agent; 40]],
            threshold: Some((30.0, 5)),
            ..RunResult::default()
        }
    }

    pub(super) fn cell(name: &str, max_episodes: u32, return_of_second_agent: f64) -> CellResults {
        let description = CellDescription {
            name: name.to_owned(),
            digest: String::new(),
            scenario: "it's a scenario.ron".to_owned(),
            overrides: vec!["agents.count=2".to_owned()],
            agents: 2,
            max_episodes,
            task: "test".to_owned(),
            observations: Vec::new(),
            walls: Vec::new(),
            random_actions: None,
            paid_for: None,
            external: None,
        };
        let mut cell = CellResults::without_runs(description);
        cell.runs = (0..6)
            .map(|seed| (seed, run(seed, return_of_second_agent)))
            .collect();
        cell.failures = vec![(6, "a reason".to_owned())];
        cell.missing = 1;
        cell
    }

    /// Results for which the report has every warning.
    pub(super) fn results_with_every_warning() -> Results {
        let study = seedbed_input::parse("small.ron", STUDY.to_owned())
            .unwrap()
            .value;
        let cells = vec![cell("A", 40, 3.0), cell("B", 50, 1.0)];
        let mut results = Results {
            manifest: Manifest {
                version: "0.1.0".to_owned(),
                name: "small".to_owned(),
                study_path: "small.ron".to_owned(),
                study: String::new(),
                quick: true,
                lock: None,
                first_seed: 0,
                repeats: 8,
                cells: cells.iter().map(|cell| cell.description.clone()).collect(),
                late_claims: Vec::new(),
                earlier_repeats: vec![4],
                changed_results: Vec::new(),
                read_results: Vec::new(),
            },
            study,
            cells,
            versions: ["0.1.0", "0.2.0"].map(str::to_owned).into(),
            commits: BTreeSet::new(),
            builds: [None, Some([1; 8])].into(),
            audit: None,
        };
        results.score_runs();
        results
    }

    /// All texts between tags of a page, except styles, figures and preformatted text.
    fn texts_between_tags(page: &str) -> Vec<String> {
        let mut rest = page;
        let mut texts = Vec::new();
        while let Some((text, after)) = rest.split_once('<') {
            texts.push(text.to_owned());
            let skipped_tag = ["style", "svg", "pre"]
                .into_iter()
                .find(|tag| after.starts_with(tag));
            let end = skipped_tag.map_or(">".to_owned(), |tag| format!("</{tag}>"));
            rest = after.split_once(&end).map_or("", |(_, rest)| rest);
        }
        texts
    }

    #[test]
    fn no_sentence_has_double_spaces() {
        let results = results_with_every_warning();
        let claim_results = claims::evaluate(&results);
        let (tables, figures) = (tables::all(&results), figures::draw(&results));
        assert_eq!((tables.len(), figures.len()), (4, 5));
        let claims_figure = figures::claims(&results, &claim_results);
        let claims_figure = claims_figure.as_ref();
        let page = html(&results, &claim_results, &tables, &figures, claims_figure);
        assert!(page.contains("Differences that the claims are about"));
        let mut texts = texts_between_tags(&page);
        assert!(texts.iter().any(|text| text.contains("Seeds below 1000")));
        assert!(texts.iter().any(|text| text.contains("Unequal budgets")));
        texts.push(claims_table::markdown(&results, &claim_results));
        texts.push(tables::markdown(&results, &tables));
        for text in texts {
            assert!(!text.contains("  "), "{text:?}");
        }
    }
}
