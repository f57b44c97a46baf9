//! What tables say, worked out on all cores: intervals take a while.

use rayon::prelude::*;

use super::words;
use crate::study::comparison::{Aggregate, Comparison, aggregate, compare};
use crate::study::file::Test;
use crate::study::measure::Measure;
use crate::study::results::{CellResults, Results};
use crate::study::statistics::comparison::holm;

/// A table in words. The first column holds names.
pub(super) struct Table {
    pub(super) title: String,
    pub(super) head: Vec<&'static str>,
    pub(super) rows: Vec<Vec<String>>,
}

/// One for each measure, then how cells compare with their peers.
pub(super) fn all(results: &Results) -> Vec<Table> {
    let measures = results
        .study
        .measures
        .iter()
        .map(|measure| of_measure(results, **measure));
    measures.chain(against_peers(results)).collect()
}

/// `tables.md`: all of them, to stand in a text.
pub(super) fn markdown(results: &Results, tables: &[Table]) -> String {
    let title = format!("# {}\n", results.study.title);
    tables
        .iter()
        .fold(title, |text, table| text + "\n" + &table.markdown())
}

impl Table {
    fn markdown(&self) -> String {
        let line = |cells: &mut dyn Iterator<Item = &str>| {
            format!("| {} |\n", cells.collect::<Vec<_>>().join(" | "))
        };
        let head = line(&mut self.head.iter().copied());
        let rule = "|---".repeat(self.head.len()) + "|\n";
        let escaped = |row: &Vec<String>| {
            row.iter()
                .map(|cell| cell.replace('|', "\\|"))
                .collect::<Vec<_>>()
        };
        let rows: String = self
            .rows
            .iter()
            .map(escaped)
            .map(|row| line(&mut row.iter().map(String::as_str)))
            .collect();
        format!("## {}\n\n{head}{rule}{rows}", self.title)
    }
}

/// What the runs of each cell come to in one measure.
fn of_measure(results: &Results, measure: Measure) -> Table {
    let is_time = measure.is_time();
    let reached: &[&str] = if is_time { &["reached"] } else { &[] };
    let head = [
        &["cell", "n"],
        reached,
        &[
            "median",
            "95 % interval",
            "IQM (95 % interval)",
            "least",
            "most",
        ],
    ]
    .concat();
    let row = |cell: &CellResults| {
        let found = aggregate(&cell.scores(measure), is_time);
        let said = found.map_or_else(
            || vec!["no runs".to_owned()],
            |found| aggregate_in_words(&found, is_time),
        );
        let mut row = [vec![cell.about.name.clone()], said].concat();
        row.resize(head.len(), String::new());
        row
    };
    Table {
        title: measure.title(),
        rows: results.cells.par_iter().map(row).collect(),
        head,
    }
}

fn aggregate_in_words(found: &Aggregate, is_time: bool) -> Vec<String> {
    let shown = if is_time { words::time } else { words::number };
    let interval = if is_time {
        words::interval_of_time
    } else {
        words::interval
    };
    let reached = is_time.then(|| format!("{}/{}", found.reached, found.n));
    let rest = [
        shown(found.median.value),
        interval(found.median.interval),
        found
            .interquartile_mean
            .map_or("–".to_owned(), words::estimate),
        shown(found.range[0]),
        shown(found.range[1]),
    ];
    [found.n.to_string()]
        .into_iter()
        .chain(reached)
        .chain(rest)
        .collect()
}

/// Each cell against the first of its task and its number of agents, or where that leaves none, of its task: seed by seed in the measure
/// that counts, with p after Holm.
fn against_peers(results: &Results) -> Option<Table> {
    let of_size = pairs(results, |cell| {
        (cell.about.task.as_str(), cell.about.agents)
    });
    let pairs = if of_size.is_empty() {
        pairs(results, |cell| cell.about.task.as_str())
    } else {
        of_size
    };
    let measure = results.study.main_measure();
    let compared = |(cell, first): &(&CellResults, &CellResults)| {
        compare(
            &cell.scores(measure),
            &first.scores(measure),
            measure.is_time(),
            Test::Paired,
        )
    };
    let found: Vec<_> = pairs
        .par_iter()
        .filter_map(|pair| compared(pair).map(|comparison| (*pair, comparison)))
        .collect();
    let p = holm(
        &found
            .iter()
            .map(|(_, comparison)| comparison.p)
            .collect::<Vec<f64>>(),
    );
    let rows: Vec<Vec<String>> = found
        .iter()
        .zip(p)
        .map(|((pair, comparison), p)| compared_in_words(*pair, comparison, p))
        .collect();
    let title = format!("Seed by seed: {}", measure.title());
    let head = vec![
        "cell",
        "against",
        "pairs",
        "difference (95 % interval)",
        "P(below)",
        "p after Holm",
    ];
    (!rows.is_empty()).then_some(Table { title, head, rows })
}

/// Each cell that is not the first of its kind, with that first one.
fn pairs<'a, K: PartialEq>(
    results: &'a Results,
    kind: impl Fn(&'a CellResults) -> K,
) -> Vec<(&'a CellResults, &'a CellResults)> {
    let first = |cell| results.cells.iter().find(|other| kind(other) == kind(cell));
    let pairs = results
        .cells
        .iter()
        .filter_map(|cell| Some((cell, first(cell)?)));
    pairs
        .filter(|(cell, first)| cell.about.name != first.about.name)
        .collect()
}

fn compared_in_words(
    (cell, first): (&CellResults, &CellResults),
    comparison: &Comparison,
    p: f64,
) -> Vec<String> {
    let names = [cell, first].map(|cell| cell.about.name.clone());
    let (effect, below) = (words::effect(comparison), words::estimate(comparison.below));
    names
        .into_iter()
        .chain([comparison.n[0].to_string(), effect, below, words::p(p)])
        .collect()
}
