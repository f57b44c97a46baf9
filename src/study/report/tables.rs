//! Tables of the report, computed on all cores: bootstrap intervals take time.

use rayon::prelude::*;

use super::format;
use crate::study::comparison::{Aggregate, Comparison, aggregate, compare};
use crate::study::file::Test;
use crate::study::measure::Measure;
use crate::study::results::{CellResults, Results};
use seedbed_stats::Interval;
use seedbed_stats::hypothesis::holm_correction;

/// A table as text. The first column holds names.
pub(super) struct Table {
    pub(super) title: String,
    pub(super) head: Vec<&'static str>,
    pub(super) rows: Vec<Vec<String>>,
}

/// One table per measure, then one of comparisons between cells.
pub(super) fn all(results: &Results) -> Vec<Table> {
    let measures = results
        .study
        .measures
        .iter()
        .map(|measure| of_measure(results, **measure));
    measures.chain(against_peers(results)).collect()
}

/// `tables.md`: all tables, to be included in other documents.
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

/// Summary of the runs of each cell in one measure.
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
            "min",
            "max",
        ],
    ]
    .concat();
    let row = |cell: &CellResults| {
        let found = aggregate(&cell.scores(measure), is_time);
        let said = found.map_or_else(
            || {
                vec![
                    if cell.runs.is_empty() {
                        "no runs"
                    } else {
                        "not measured"
                    }
                    .to_owned(),
                ]
            },
            |found| aggregate_cells(&found, is_time),
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

fn aggregate_cells(found: &Aggregate, is_time: bool) -> Vec<String> {
    let (value, interval): (fn(f64) -> String, fn(Interval) -> String) = if is_time {
        (format::time, format::interval_of_time)
    } else {
        (format::number, format::interval)
    };
    let mut cells = vec![found.n.to_string()];
    if is_time {
        cells.push(format!("{}/{}", found.reached, found.n));
    }
    let interquartile_mean = found.interquartile_mean.map(format::estimate);
    cells.extend([
        value(found.median.value),
        interval(found.median.interval),
        interquartile_mean.unwrap_or_else(|| "–".to_owned()),
        value(found.range[0]),
        value(found.range[1]),
    ]);
    cells
}

/// Each cell against the first cell with the same task and number of agents or, if there are no such
/// pairs, with the same task: paired by seed, in the main measure.
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
    let p: Vec<f64> = found.iter().map(|(_, comparison)| comparison.p).collect();
    let mut rows = Vec::with_capacity(found.len());
    for ((pair, comparison), p) in found.iter().zip(holm_correction(&p)) {
        rows.push(comparison_cells(*pair, comparison, p));
    }
    let title = format!("Paired comparisons: {}", measure.title());
    let head = vec![
        "cell",
        "compared with",
        "pairs",
        "difference (95 % interval)",
        "P(below)",
        "p (Holm)",
    ];
    (!rows.is_empty()).then_some(Table { title, head, rows })
}

/// Each cell that is not the first of its kind, with the first one.
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

fn comparison_cells(
    (cell, first): (&CellResults, &CellResults),
    comparison: &Comparison,
    p: f64,
) -> Vec<String> {
    vec![
        cell.about.name.clone(),
        first.about.name.clone(),
        comparison.n[0].to_string(),
        format::effect(comparison),
        format::estimate(comparison.probability_below),
        format::p_value(p),
    ]
}
