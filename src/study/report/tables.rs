//! Tables of the report. They are computed on all cores, because bootstrap intervals take time.

use rayon::prelude::*;

use super::format;
use crate::experiment::measure::Measure;
use crate::study::design::file::Scaling;
use crate::study::evaluate::comparison::{Aggregate, Comparison, Samples, summarize_scores};
use crate::study::evaluate::cost::{Cost, costs};
use crate::study::evaluate::prediction::{Prediction, predictions};
use crate::study::evaluate::results::{CellResults, Results, default_horizon, earliest_end};
use crate::study::evaluate::rules::Quantity;
use crate::study::evaluate::scaling::{self, Method, Ratio, TeamSize};
use crate::text::{markdown_cell, markdown_line};
use seedbed_stats::Estimate;
use seedbed_stats::correlation::{Correlation, PERMUTATIONS};
use seedbed_stats::shares::wilson_interval;

/// A table of texts. The first column has names.
pub(super) struct Table {
    pub(super) title: String,
    pub(super) head: Vec<&'static str>,
    pub(super) rows: Vec<Vec<String>>,
    /// What a reader must know of the rows; empty if nothing.
    pub(super) note: String,
}

/// All tables of the report: one of costs, one per measure, and one of comparisons between cells.
pub(super) fn all(results: &Results) -> Vec<Table> {
    let measures = results
        .study
        .measures
        .iter()
        .map(|measure| measure_table(results, **measure));
    let cost = std::iter::once(cost_table(results));
    cost.chain(scaling_tables(results))
        .chain(predictors_table(results))
        .chain(measures)
        .chain(comparisons_table(results))
        .collect()
}

/// `tables.md`: all tables, to be included in other documents.
pub(super) fn markdown(results: &Results, tables: &[Table]) -> String {
    let title = format!("# {}\n", markdown_line(&results.study.title));
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
                .map(|cell| markdown_cell(cell))
                .collect::<Vec<_>>()
        };
        let rows: String = self
            .rows
            .iter()
            .map(escaped)
            .map(|row| markdown_row(&mut row.iter().map(String::as_str)))
            .collect();
        let note = match self.note.as_str() {
            "" => String::new(),
            note => format!("\n{}\n", markdown_line(note)),
        };
        format!("## {}\n\n{head}{separator}{rows}{note}", self.title)
    }
}

/// What runs cost until they solved the task or ended and, in studies with cells of one agent, speed-ups over the best of them.
fn cost_table(results: &Results) -> Table {
    let costs = costs(results);
    let has_speedups = costs.iter().any(|(_, cost)| cost.speedup.is_some());
    let row = |(cell, cost): &(&CellResults, Cost)| {
        let optional = |value: Option<f64>| value.map_or("–".to_owned(), format::number);
        let solved = cost.solved.map_or("–".to_owned(), |share| {
            let interval = format::interval(wilson_interval(share));
            format!("{}/{} ({interval})", share.successes, share.runs)
        });
        let mut row = vec![
            cell.description.name.clone(),
            cell.description.agents.to_string(),
            solved,
            format::number_or_unknown(cost.episodes),
            format::number_or_unknown(cost.env_steps),
            format::number_or_unknown(cost.gradient_steps),
        ];
        if has_speedups {
            row.push(optional(cost.speedup.map(|speedup| speedup.factor)));
            row.push(optional(cost.speedup.map(|speedup| speedup.efficiency)));
        }
        row
    };
    let mut head = vec![
        "cell",
        "K",
        "solved (95 % interval)",
        "episodes of each agent",
        "env steps of the team",
        "gradient steps",
    ];
    if has_speedups {
        head.extend(["S(K)", "E(K)"]);
    }
    Table {
        title: "Cost until solved, or until the end of the run: means over runs".to_owned(),
        head,
        rows: costs.iter().map(row).collect(),
        note: String::new(),
    }
}

/// What teams of each size gain, and how each method's measure falls with the size of the team. Empty if
/// the study does not ask for it.
fn scaling_tables(results: &Results) -> Vec<Table> {
    let scaling = results.study.scaling.as_ref();
    scaling.map_or(Vec::new(), |scaling| {
        vec![
            team_sizes_table(results, scaling),
            slopes_table(results, *scaling.measure),
        ]
    })
}

fn team_sizes_table(results: &Results, scaling: &Scaling) -> Table {
    let optional = |ratio: Option<Ratio>| match ratio {
        None => "–".to_owned(),
        Some(Ratio::OfItself) => format::number(1.0),
        Some(Ratio::Estimated(estimate)) => format::estimate(estimate),
    };
    let row = |team: &TeamSize<'_>| {
        let efficiency = team
            .speedup
            .map(|speedup| speedup.value() / f64::from(team.agents));
        vec![
            team.cell.to_owned(),
            team.agents.to_string(),
            format::estimate(team.mean),
            format::number(team.worst),
            optional(team.speedup),
            efficiency.map_or("–".to_owned(), format::number),
            optional(team.diversity_gap),
        ]
    };
    let sizes = scaling::team_sizes(results, scaling);
    Table {
        title: format!("Sizes of teams: {}", scaling.measure.title()),
        head: vec![
            "cell",
            "K",
            "mean (95 % interval)",
            "mean of the worst twentieth",
            "S(K)",
            "E(K)",
            "D(K)",
        ],
        rows: sizes.iter().map(row).collect(),
        note: String::new(),
    }
}

fn slopes_table(results: &Results, measure: Measure) -> Table {
    let row = |(method, slope): &(Method<'_>, Option<Estimate>)| {
        let agents = method.cells.iter().map(|cell| cell.description.agents);
        let agents: Vec<String> = agents.map(|agents| agents.to_string()).collect();
        vec![
            method.name.clone(),
            agents.join(", "),
            slope.map_or("–".to_owned(), format::estimate),
        ]
    };
    let slopes = scaling::slopes(results, measure);
    Table {
        title: format!(
            "Slopes: logarithm of {} over the logarithm of K",
            measure.title()
        ),
        head: vec!["method", "K", "slope (95 % interval)"],
        rows: slopes.iter().map(row).collect(),
        note: String::new(),
    }
}

/// How measures go with the outcome that the study asks for; `None` if it asks for none.
fn predictors_table(results: &Results) -> Option<Table> {
    let predictors = results.study.predictors.as_ref()?;
    let correlation = |correlation: Option<Correlation>| {
        correlation.map_or("–".to_owned(), |correlation| {
            format::estimate(correlation.estimate)
        })
    };
    let p_value = |p: Option<f64>| p.map_or("–".to_owned(), format::p_value);
    let row = |prediction: &Prediction| {
        vec![
            prediction.measure.title(),
            prediction
                .over_runs
                .map_or(0, |found| found.runs)
                .to_string(),
            correlation(prediction.over_runs),
            p_value(prediction.corrected_p),
            correlation(prediction.over_cells),
            p_value(prediction.over_cells.map(|found| found.p)),
        ]
    };
    let outcome = *predictors.of;
    let sign = if outcome.is_time() {
        "Negative correlations mean that larger values come with shorter times; times that were not reached are the longest. "
    } else {
        ""
    };
    Some(Table {
        title: format!("Predictors of {}: rank correlations", outcome.title()),
        head: vec![
            "measure",
            "runs",
            "within cells (95 % interval)",
            "p, corrected (Holm)",
            "of the means of cells (95 % interval)",
            "p",
        ],
        rows: predictions(results, predictors).iter().map(row).collect(),
        note: format!(
            "{sign}Within cells, runs are ranked in their cell, so that differences between cells do not count; cells in \
             which all runs are equal are left out. p by {PERMUTATIONS} permutations."
        ),
    })
}

/// Table of one measure, with a summary of the runs of each cell.
fn measure_table(results: &Results, measure: Measure) -> Table {
    let quantity = Quantity::of(measure, f64::INFINITY);
    let head = [&["cell", "n"], columns(quantity)].concat();
    let row = |cell: &CellResults| {
        let value_cells = match summarize_scores(cell.scores(measure), measure) {
            Some(aggregate) => aggregate_cells(&aggregate, quantity),
            None if cell.costs.is_empty() => vec!["no runs".to_owned()],
            None => vec!["not measured".to_owned()],
        };
        let mut row = [vec![cell.description.name.clone()], value_cells].concat();
        row.resize(head.len(), String::new());
        row
    };
    Table {
        title: measure.title(),
        rows: results.cells.par_iter().map(row).collect(),
        head,
        note: note_about_early_ends(results, measure),
    }
}

/// Which runs ended before the episode of a measure, so that it is not known of them; empty if none.
pub(super) fn note_about_early_ends(results: &Results, measure: Measure) -> String {
    if measure == Measure::Solved {
        return note_about_unsolved_runs(results);
    }
    let Some(moment) = measure.needed_moment() else {
        return String::new();
    };
    let cells = results.cells.iter().filter_map(|cell| {
        let (runs, known) = (cell.costs.len(), cell.scores(measure).len());
        (known < runs).then(|| {
            format!(
                "{} of {runs} runs of {}",
                runs - known,
                cell.description.name
            )
        })
    });
    let cells: Vec<String> = cells.collect();
    if cells.is_empty() {
        return String::new();
    }
    format!(
        "Unknown of runs that ended before {moment}, which are left out here and in comparisons: {}. With \
         `held: true`, they keep their last value.",
        cells.join("; ")
    )
}

/// Which runs of others ended early, so that it is not known whether they would have solved their task; empty if
/// none.
fn note_about_unsolved_runs(results: &Results) -> String {
    let cells = results.cells.iter().filter_map(|cell| {
        let scores = cell.scores(Measure::Solved);
        let early = scores
            .iter()
            .filter(|score| score.observed_until.is_finite());
        let (early, runs) = (early.count(), scores.len());
        (early > 0).then(|| format!("{early} of {runs} runs of {}", cell.description.name))
    });
    let cells: Vec<String> = cells.collect();
    if cells.is_empty() {
        return String::new();
    }
    format!(
        "Not known of runs that ended before `max_episodes` without solving their task, which they may have solved \
         afterwards: {}. Intervals hold for all that is possible, and shares are its middle.",
        cells.join("; ")
    )
}

/// What is not known of the times in a comparison, and up to which time they are compared if this
/// follows from the runs of others. Empty if there is nothing to say.
pub(super) fn note_about_times(
    results: &Results,
    measure: Measure,
    names: [&str; 2],
    comparison: &Comparison,
) -> String {
    let horizon = format::number(comparison.horizon);
    let early = (0..2).filter(|&cell| comparison.ended_early[cell] > 0);
    let early = early.map(|cell| {
        let (ended, runs) = (comparison.ended_early[cell], comparison.n[cell]);
        format!("{ended} of {runs} runs of {}", names[cell])
    });
    let early: Vec<String> = early.collect();
    if !early.is_empty() && !measure.is_time() {
        // The table of the measure says it of each cell.
        return String::new();
    }
    if !early.is_empty() {
        return format!(
            "Not known up to {horizon}: {} ended before without reaching their time, which may be any after their \
             end. Intervals hold for all that is possible, and values are its middle.",
            early.join(" and ")
        );
    }
    let cells: Vec<&CellResults> = names.iter().filter_map(|name| results.cell(name)).collect();
    let is_external = cells.iter().any(|cell| cell.description.external.is_some());
    let is_first_end = comparison.horizon == earliest_end(&cells, measure);
    if is_external && comparison.horizon.is_finite() && is_first_end {
        return format!(
            "Times are compared up to {horizon}, where the first run ended that did not reach its time: {} and {}.",
            names[0], names[1]
        );
    }
    String::new()
}

/// Columns behind the number of runs, those of [`aggregate_cells`].
fn columns(quantity: Quantity) -> &'static [&'static str] {
    match quantity {
        Quantity::Share => &["share (95 % interval)"],
        Quantity::Mean => &[
            "mean (95 % interval)",
            "median",
            "IQM (95 % interval)",
            "min",
            "max",
        ],
        Quantity::RestrictedMeanTime { .. } => &[
            "reached",
            "median",
            "95 % interval",
            "IQM (95 % interval)",
            "min",
            "max",
        ],
    }
}

fn aggregate_cells(aggregate: &Aggregate, quantity: Quantity) -> Vec<String> {
    let Aggregate { n, center, .. } = *aggregate;
    let iqm = aggregate.interquartile_mean.map(format::estimate);
    let iqm = iqm.unwrap_or_else(|| "–".to_owned());
    let [min, max] = aggregate.range;
    match quantity {
        Quantity::Share => vec![n.to_string(), format::estimate(center)],
        Quantity::Mean => vec![
            n.to_string(),
            format::estimate(center),
            format::number(aggregate.median),
            iqm,
            format::number(min),
            format::number(max),
        ],
        Quantity::RestrictedMeanTime { .. } => vec![
            n.to_string(),
            format!("{}/{n}", aggregate.reached),
            format::time(center.value),
            format::interval_of_time(center.interval),
            iqm,
            format::time(min),
            format::time(max),
        ],
    }
}

/// Table of comparisons in the main measure. Each cell is compared with the first cell with the same
/// task and number of agents or, if there are no such pairs, with the first cell with the same task.
fn comparisons_table(results: &Results) -> Option<Table> {
    let pairs_of_equal_team_size = pairs(results, |cell| {
        (cell.description.task.as_str(), cell.description.agents)
    });
    let pairs = if pairs_of_equal_team_size.is_empty() {
        pairs(results, |cell| cell.description.task.as_str())
    } else {
        pairs_of_equal_team_size
    };
    let measure = results.study.main_measure();
    let compared: Vec<(Vec<String>, String)> = pairs
        .par_iter()
        .filter_map(|&(cell, first)| {
            let comparison = compare_cells(results, cell, first)?;
            let names = [cell, first].map(|cell| cell.description.name.as_str());
            let note = note_about_times(results, measure, names, &comparison);
            Some((comparison_cells(cell, first, &comparison), note))
        })
        .collect();
    let (rows, mut notes): (Vec<_>, Vec<_>) = compared.into_iter().unzip();
    notes.push(note_about_early_ends(results, measure));
    notes.retain(|note| !note.is_empty());
    let title = format!("Comparisons: {}", measure.title());
    let head = vec![
        "cell",
        "compared with",
        "n",
        "difference (95 % interval)",
        "P(below)",
    ];
    (!rows.is_empty()).then_some(Table {
        title,
        head,
        rows,
        note: notes.join(" "),
    })
}

/// Compares two cells in the main measure, paired if runs of equal run seeds share something.
fn compare_cells(results: &Results, cell: &CellResults, first: &CellResults) -> Option<Comparison> {
    let measure = results.study.main_measure();
    let scores = [cell, first].map(|cell| cell.scores(measure));
    let quantity = Quantity::of(measure, default_horizon(&[cell, first], measure));
    let is_external = |cell: &CellResults| cell.description.external.is_some();
    let paired = !results.study.pairs_share.is_empty()
        && quantity != Quantity::Share
        && !is_external(cell)
        && !is_external(first);
    let names = [cell, first].map(|cell| cell.description.name.as_str());
    let is_reversed = results
        .study
        .compares_in_reverse(measure, names[0], names[1]);
    let samples = Samples::in_direction(is_reversed, scores[0], scores[1], quantity, paired)?;
    Some(samples.compare(&*samples.test()))
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
    cell: &CellResults,
    first: &CellResults,
    comparison: &Comparison,
) -> Vec<String> {
    let n = match comparison.n {
        [n, m] if n == m => n.to_string(),
        [n, m] => format!("{n}, {m}"),
    };
    vec![
        cell.description.name.clone(),
        first.description.name.clone(),
        n,
        format::difference(comparison, comparison.effect.interval),
        format::estimate(comparison.probability_below),
    ]
}
