//! Tables of the report. They are computed on all cores, because bootstrap intervals take time.

use rayon::prelude::*;

use super::format;
use crate::study::comparison::{Aggregate, Comparison, compare, summarize_scores};
use crate::study::file::Test;
use crate::study::measure::Measure;
use crate::study::results::{CellResults, Results};
use seedbed_stats::hypothesis::holm_correction;

/// A table of texts. The first column has names.
pub(super) struct Table {
    pub(super) title: String,
    pub(super) head: Vec<&'static str>,
    pub(super) rows: Vec<Vec<String>>,
}

/// All tables of the report: one per measure, and one of paired comparisons between cells.
pub(super) fn all(results: &Results) -> Vec<Table> {
    let measures = results
        .study
        .measures
        .iter()
        .map(|measure| measure_table(results, **measure));
    measures.chain(paired_comparisons_table(results)).collect()
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
        let markdown_row = |cells: &mut dyn Iterator<Item = &str>| {
            format!("| {} |\n", cells.collect::<Vec<_>>().join(" | "))
        };
        let head = markdown_row(&mut self.head.iter().copied());
        let separator = "|---".repeat(self.head.len()) + "|\n";
        let escaped = |row: &Vec<String>| {
            row.iter()
                .map(|cell| cell.replace('|', "\\|"))
                .collect::<Vec<_>>()
        };
        let rows: String = self
            .rows
            .iter()
            .map(escaped)
            .map(|row| markdown_row(&mut row.iter().map(String::as_str)))
            .collect();
        format!("## {}\n\n{head}{separator}{rows}", self.title)
    }
}

/// Table of one measure, with a summary of the runs of each cell.
fn measure_table(results: &Results, measure: Measure) -> Table {
    let is_time = measure.is_time();
    let reached_column: &[&str] = if is_time { &["reached"] } else { &[] };
    let head = [
        &["cell", "n"],
        reached_column,
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
        let aggregate = summarize_scores(&cell.scores(measure), is_time);
        let value_cells = aggregate.map_or_else(
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
            |aggregate| aggregate_cells(&aggregate, is_time),
        );
        let mut row = [vec![cell.description.name.clone()], value_cells].concat();
        row.resize(head.len(), String::new());
        row
    };
    Table {
        title: measure.title(),
        rows: results.cells.par_iter().map(row).collect(),
        head,
    }
}

fn aggregate_cells(aggregate: &Aggregate, is_time: bool) -> Vec<String> {
    let format_value = if is_time {
        format::time
    } else {
        format::number
    };
    let format_interval = if is_time {
        format::interval_of_time
    } else {
        format::interval
    };
    let mut cells = vec![aggregate.n.to_string()];
    if is_time {
        cells.push(format!("{}/{}", aggregate.reached, aggregate.n));
    }
    let interquartile_mean = aggregate.interquartile_mean.map(format::estimate);
    cells.extend([
        format_value(aggregate.median.value),
        format_interval(aggregate.median.interval),
        interquartile_mean.unwrap_or_else(|| "–".to_owned()),
        format_value(aggregate.range[0]),
        format_value(aggregate.range[1]),
    ]);
    cells
}

/// Table of paired comparisons in the main measure. Each cell is compared with the first cell with
/// the same task and number of agents or, if there are no such pairs, with the first cell with the
/// same task.
fn paired_comparisons_table(results: &Results) -> Option<Table> {
    let pairs_of_equal_team_size = pairs(results, |cell| {
        (cell.description.task.as_str(), cell.description.agents)
    });
    let pairs = if pairs_of_equal_team_size.is_empty() {
        pairs(results, |cell| cell.description.task.as_str())
    } else {
        pairs_of_equal_team_size
    };
    let measure = results.study.main_measure();
    let compare_pair = |(cell, first): &(&CellResults, &CellResults)| {
        compare(
            &cell.scores(measure),
            &first.scores(measure),
            measure.is_time(),
            Test::Paired,
        )
    };
    let comparisons: Vec<_> = pairs
        .par_iter()
        .filter_map(|pair| compare_pair(pair).map(|comparison| (*pair, comparison)))
        .collect();
    let p_values: Vec<f64> = comparisons
        .iter()
        .map(|(_, comparison)| comparison.p)
        .collect();
    let mut rows = Vec::with_capacity(comparisons.len());
    for ((pair, comparison), p) in comparisons.iter().zip(holm_correction(&p_values)) {
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

/// Pairs of each cell and the first cell of its group, except for the first cells. Cells for which
/// `group` returns equal values belong to one group.
fn pairs<'a, K: PartialEq>(
    results: &'a Results,
    group: impl Fn(&'a CellResults) -> K,
) -> Vec<(&'a CellResults, &'a CellResults)> {
    let first = |cell| {
        results
            .cells
            .iter()
            .find(|other| group(other) == group(cell))
    };
    let pairs = results
        .cells
        .iter()
        .filter_map(|cell| Some((cell, first(cell)?)));
    pairs
        .filter(|(cell, first)| cell.description.name != first.description.name)
        .collect()
}

fn comparison_cells(
    (cell, first): (&CellResults, &CellResults),
    comparison: &Comparison,
    p: f64,
) -> Vec<String> {
    vec![
        cell.description.name.clone(),
        first.description.name.clone(),
        comparison.n[0].to_string(),
        format::effect(comparison),
        format::estimate(comparison.probability_below),
        format::p_value(p),
    ]
}
