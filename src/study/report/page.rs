//! `report.html`: a page that loads no external files, so that it can be read offline.

use std::collections::HashSet;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::claims_table::note_about_claim;
use super::tables::{Table, note_about_early_ends};
use super::{ReportFigure, format, states};
use crate::experiment::measure::Measure;
use crate::provenance;
use crate::record::difference_of_quantities;
use crate::study::design::file::{Claim, FIRST_REPORTING_SEED};
use crate::study::design::lock::Lock;
use crate::study::evaluate::claims::ClaimResult;
use crate::study::evaluate::comparison::Comparison;
use crate::study::evaluate::cost::cells_without_policy_gradient;
use crate::study::evaluate::gate::gates;
use crate::study::evaluate::results::Audit;
use crate::study::evaluate::results::{CellResults, Results};
use crate::study::evaluate::rules::Rule;
use crate::study::external::{ExternalCell, FileHash};
use crate::text::{html_page, pluralize, shell_word};
use seedbed_stats::{MIN_RUNS, Verdict};

/// Minimum number of runs per cell for a report without the warning about narrow intervals.
const MIN_RUNS_WITHOUT_WARNING: u64 = 20;

const STYLE: &str = include_str!("page.css");

pub(super) fn html(
    results: &Results,
    claim_results: &[ClaimResult],
    tables: &[Table],
    figures: &[ReportFigure],
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
                    @if !study.claims.is_empty() { (claims_section(results, claim_results)) }
                    @if !figures.is_empty() { h2 { "Figures" } }
                    @for (number, figure) in (1..).zip(figures) { (figure_section(number, figure)) }
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

/// Warnings that results are not final or not precise.
fn warnings(results: &Results) -> Markup {
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
    let is_of_visits = |measure: &Measure| {
        measure
            .curve()
            .is_some_and(|curve| curve.metric().is_of_visits())
    };
    if !results.measures().iter().any(is_of_visits) {
        return None;
    }
    for (index, cell) in results.cells.iter().enumerate() {
        let observations = cell.observations();
        for other in &results.cells[index + 1..] {
            let of_other = other.observations();
            if difference_of_quantities(&observations, &of_other).is_some() {
                continue;
            }
            let mut pairs = observations.iter().zip(&of_other);
            let Some((one, two)) = pairs.find(|(one, two)| one.range != two.range) else {
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

fn warning(title: &str, text: &str) -> Markup {
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

fn registration_section(lock: &Lock, audit: &Audit) -> Markup {
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

fn claims_section(results: &Results, claim_results: &[ClaimResult]) -> Markup {
    html! {
        h2 { "Claims" }
        p.facts { (format::summarize_claims(claim_results)) "." }
        @if let Some(exploration) = &results.study.exploration {
            @for gate in gates(results) { p.evidence { (gate.sentence(*exploration.measure)) } }
        }
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

fn figure_section(number: usize, figure: &ReportFigure) -> Markup {
    let width = figure.picture.width;
    let min_width = width.min((0.6 * width).max(340.0));
    html! {
        figure {
            div.scroll {
                div.picture style={ "min-width:" (min_width) "px;max-width:" (width) "px" } {
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

/// CSS class of a column. The first column has names and is wider than columns of numbers.
fn class_of_column(column: usize) -> Option<&'static str> {
    (column == 0).then_some("name")
}

fn table_section(table: &Table) -> Markup {
    html! {
        h3 { (table.title) }
        div.scroll {
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

/// The files of results that others made, with their hashes.
fn results_of_others_section(results: &Results) -> Markup {
    let cells: Vec<(&CellResults, &ExternalCell)> = results
        .cells
        .iter()
        .filter_map(|cell| Some((cell, cell.description.external.as_ref()?)))
        .collect();
    html! {
        @if !cells.is_empty() {
            h2 { "Results of others" }
            p {
                "These results were made by others: run seeds and code cannot be checked. A run is identified by the SHA-256 of \
                 its files. A team whose agents have files of their own has done K · n steps when one of its agents has done n."
            }
            @for (cell, external) in cells {
                h3 { (cell.description.name) }
                p {
                    code { (cell.description.scenario) } ": " (pluralize(external.runs.len(), "run")) ", "
                    (pluralize(files_of(external).len(), "file")) "."
                }
                @for warning in &external.warnings { p.evidence { (warning) "." } }
                @for name in &external.seen_before {
                    p.evidence { "Not used, because its files existed at the registration: " code { (name) } "." }
                }
                details {
                    summary { "Files" }
                    div.scroll {
                        table {
                            thead { tr { th.name { "file" } th { "bytes" } th.name { "SHA-256" } } }
                            tbody {
                                @for file in files_of(external) {
                                    tr {
                                        td.name { (file.path) } td { (file.bytes) } td.name { code { (file.sha256) } }
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// The files of all runs, each once: a file may have several runs.
fn files_of(cell: &ExternalCell) -> Vec<&FileHash> {
    let mut files: Vec<&FileHash> = Vec::new();
    let mut paths = HashSet::new();
    for file in cell.runs.iter().flat_map(|run| &run.files) {
        if paths.insert(&file.path) {
            files.push(file);
        }
    }
    files
}

fn reproduction_section(results: &Results) -> Markup {
    let manifest = &results.manifest;
    let (action, option) = match &manifest.lock {
        Some(_) => ("confirm ", ""),
        None if manifest.quick => ("", " --quick"),
        None => ("", ""),
    };
    let first_seed = manifest.run_seeds().first().copied().unwrap_or_default();
    html! {
        h2 { "How to reproduce the results" }
        pre { "seedbed study " (action) (shell_word(&manifest.study_path)) (option) }
        p { (provenance_text(results)) }
        p { "One run of each cell, with its recording:" }
        div.scroll {
            table {
                thead {
                    tr { th.name { "cell" } th { "K" } th { "max episodes" } th.name { "command" } }
                }
                tbody {
                    @for cell in &results.cells {
                        tr {
                            td.name { (cell.description.name) }
                            td { (cell.description.agents) }
                            td { (max_episodes(cell)) }
                            td.name {
                                @if cell.description.external.is_some() {
                                    "results of others"
                                } @else {
                                    code { (command(cell, first_seed)) }
                                }
                            }
                        }
                    }
                }
            }
        }
        details { summary { "Study file" } pre { (manifest.study) } }
    }
}

fn max_episodes(cell: &CellResults) -> String {
    if cell.unknown().episodes {
        return "unknown".to_owned();
    }
    cell.description.max_episodes.to_string()
}

/// Versions, commits and builds of seedbed that made the runs, and that made this page.
fn provenance_text(results: &Results) -> String {
    let mut runs = format!("seedbed {}", versions(results));
    if !results.commits.is_empty() {
        let commits: Vec<&str> = results.commits.iter().map(String::as_str).collect();
        runs += &format!(", commit {}", commits.join(", "));
    }
    runs += &format!(", build {}", builds(results));
    let mut page = format!("seedbed {}", env!("CARGO_PKG_VERSION"));
    if let Some(commit) = provenance::commit() {
        page += &format!(", commit {commit}");
    }
    let dependencies = provenance::dependency_versions();
    if !dependencies.is_empty() {
        page += &format!(", with {}", dependencies.join(", "));
    }
    let is_external = |cell: &CellResults| cell.description.external.is_some();
    let made = if results.cells.iter().all(is_external) {
        "The results of others were read by"
    } else if results.cells.iter().any(is_external) {
        "Runs were made, and results of others read, by"
    } else {
        "The runs were made by"
    };
    format!("{made} {runs}. This page was made by {page}.")
}

fn versions(results: &Results) -> String {
    let versions: Vec<&str> = results.versions.iter().map(String::as_str).collect();
    versions.join(", ")
}

/// Build ids of all builds that made the runs.
fn builds(results: &Results) -> String {
    let builds = results.builds.iter().copied();
    let ids: Vec<String> = builds.map(provenance::format_build_id).collect();
    ids.join(", ")
}

fn command(cell: &CellResults, seed: u64) -> String {
    let scenario = shell_word(&cell.description.scenario);
    let mut command = format!("seedbed run {scenario} --seed {seed}");
    for text in &cell.description.overrides {
        command += &format!(" --set {}", shell_word(text));
    }
    command
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

    const STUDY: &str = r#"Study(
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

    fn cell(name: &str, max_episodes: u32, return_of_second_agent: f64) -> CellResults {
        let description = CellDescription {
            name: name.to_owned(),
            digest: String::new(),
            scenario: "it's a scenario.ron".to_owned(),
            overrides: vec!["agents.count=2".to_owned()],
            agents: 2,
            max_episodes,
            task: "test".to_owned(),
            observations: Vec::new(),
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
    fn results_with_every_warning() -> Results {
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
        let page = html(&results, &claim_results, &tables, &figures);
        let mut texts = texts_between_tags(&page);
        assert!(texts.iter().any(|text| text.contains("Seeds below 1000")));
        assert!(texts.iter().any(|text| text.contains("Unequal budgets")));
        texts.push(claims_table::markdown(&results, &claim_results));
        texts.push(tables::markdown(&results, &tables));
        for text in texts {
            assert!(!text.contains("  "), "{text:?}");
        }
    }

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

    #[test]
    fn printed_commands_are_quoted_for_the_shell() {
        let command = command(&cell("A", 40, 3.0), 1000);
        let arguments = shlex::split(&command).unwrap();
        assert_eq!(arguments[2], "it's a scenario.ron");
        assert_eq!(
            arguments[3..],
            ["--seed", "1000", "--set", "agents.count=2"]
        );
    }
}
