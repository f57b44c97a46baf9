//! What the page's tables say, worked out on all cores: intervals take a while.

use rayon::prelude::*;

use crate::study::comparison::{Aggregate, Comparison, aggregate, compare};
use crate::study::file::Test;
use crate::study::measure::Measure;
use crate::study::results::{CellResults, Results};
use crate::study::statistics::comparison::holm;

/// What the runs of each cell come to in one measure; none for cells without runs that tell.
pub(super) fn aggregates(results: &Results, measure: Measure) -> Vec<(&CellResults, Option<Aggregate>)> {
    let of_cell = |cell| (cell, aggregate(&CellResults::scores(cell, measure), measure.is_time()));
    results.cells.par_iter().map(of_cell).collect()
}

/// Each cell of the same task against the first, seed by seed, in the measure that counts, with p after Holm.
pub(super) fn against_the_first(results: &Results) -> Vec<(&CellResults, Comparison, f64)> {
    let measure = results.study.main_measure();
    let Some((first, others)) = results.cells.split_first() else { return Vec::new() };
    let reference = first.scores(measure);
    let compared = |cell: &'_ CellResults| compare(&cell.scores(measure), &reference, measure.is_time(), Test::Paired);
    let peers: Vec<&CellResults> = others.iter().filter(|cell| cell.about.task == first.about.task).collect();
    let found: Vec<(&CellResults, Comparison)> =
        peers.into_par_iter().filter_map(|cell| compared(cell).map(|comparison| (cell, comparison))).collect();
    let p = holm(&found.iter().map(|(_, comparison)| comparison.p).collect::<Vec<f64>>());
    found.into_iter().zip(p).map(|((cell, comparison), p)| (cell, comparison, p)).collect()
}
