//! Which measures of a study go with an outcome, such as an early coverage with finding a goal later: over the runs of
//! each cell, and over the cells.

use std::collections::BTreeMap;

use super::comparison::summarize_scores;
use super::results::{CellResults, Results};
use crate::experiment::measure::Measure;
use crate::study::design::file::Predictors;
use seedbed_stats::correlation::{Correlation, rank_correlation_within_groups};
use seedbed_stats::family::holm_correction;

/// How a measure goes with the outcome.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// The measure.
    pub measure: Measure,
    /// Rank correlation over the runs within cells; `None` if nothing varies within them.
    pub over_runs: Option<Correlation>,
    /// p-value of this correlation, corrected for the number of measures (Holm 1979).
    pub corrected_p: Option<f64>,
    /// Rank correlation of the means of cells.
    pub over_cells: Option<Correlation>,
}

/// One prediction per measure that the study asks for, in its order.
#[must_use]
pub fn predictions(results: &Results, predictors: &Predictors) -> Vec<Prediction> {
    let outcome = *predictors.of;
    let correlate = |measure: Measure| Prediction {
        measure,
        over_runs: over_runs(results, measure, outcome),
        corrected_p: None,
        over_cells: over_cells(results, measure, outcome),
    };
    let measures = predictors.measures.iter().map(|measure| **measure);
    let mut predictions: Vec<Prediction> = measures.map(correlate).collect();
    let p: Vec<f64> = predictions
        .iter()
        .filter_map(|one| Some(one.over_runs?.p))
        .collect();
    let mut corrected = holm_correction(&p).into_iter();
    for prediction in predictions.iter_mut().filter(|one| one.over_runs.is_some()) {
        prediction.corrected_p = corrected.next();
    }
    predictions
}

fn over_runs(results: &Results, measure: Measure, outcome: Measure) -> Option<Correlation> {
    let cells = results.cells.iter();
    let groups: Vec<Vec<[f64; 2]>> = cells.map(|cell| pairs(cell, measure, outcome)).collect();
    rank_correlation_within_groups(&groups)
}

/// Both measures of each run of a cell that has both.
fn pairs(cell: &CellResults, measure: Measure, outcome: Measure) -> Vec<[f64; 2]> {
    let outcomes = cell.scores(outcome).iter();
    let outcomes: BTreeMap<u64, f64> = outcomes
        .map(|score| (score.run_seed, score.value))
        .collect();
    let scores = cell.scores(measure).iter();
    scores
        .filter_map(|score| Some([score.value, *outcomes.get(&score.run_seed)?]))
        .collect()
}

fn over_cells(results: &Results, measure: Measure, outcome: Measure) -> Option<Correlation> {
    let center = |cell: &CellResults, measure| {
        let summary = summarize_scores(cell.scores(measure), measure)?;
        Some(summary.center.value)
    };
    let cells = results.cells.iter();
    let centers = cells.filter_map(|cell| Some([center(cell, measure)?, center(cell, outcome)?]));
    rank_correlation_within_groups(&[centers.collect()])
}
