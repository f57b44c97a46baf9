//! How a measure changes with the number of agents K: speed-up, efficiency, what diversity is worth,
//! and the slope of its logarithm.

use super::results::{CellResults, Results, known_horizon};
use super::rules::Quantity;
use super::score::RunScore;
use crate::experiment::measure::Measure;
use crate::study::design::file::Scaling;
use seedbed_stats::aggregate::mean;
use seedbed_stats::ratios::{log_log_slope, mean_with_log_interval, ratio_of_means};
use seedbed_stats::{Estimate, Interval, MIN_RUNS};

/// A team of one size.
#[derive(Clone, Debug, PartialEq)]
pub struct TeamSize<'a> {
    /// Name of its cell.
    pub cell: &'a str,
    /// Number of agents K.
    pub agents: u32,
    /// Mean of the measure m(K). Times up to the [`known_horizon`] of this task.
    pub mean: Estimate,
    /// Mean of the worst twentieth of the runs.
    pub worst: f64,
    /// S(K) = m*(1) / m(K), where m*(1) is the smallest mean of a cell with one agent in this task.
    /// Exactly 1 of that cell.
    pub speedup: Option<Ratio>,
    /// D(K): the mean of the cell without diversity over that of this cell, which differs from it in
    /// one part of its name.
    pub diversity_gap: Option<Ratio>,
}

/// A ratio of the means of two cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ratio {
    /// A cell over itself: 1, without an interval.
    OfItself,
    /// Of different cells.
    Estimated(Estimate),
}

impl Ratio {
    /// The ratio.
    #[must_use]
    pub fn value(self) -> f64 {
        match self {
            Self::OfItself => 1.0,
            Self::Estimated(estimate) => estimate.value,
        }
    }
}

/// A method in a task, with teams of several sizes.
#[derive(Clone, Debug)]
pub struct Method<'a> {
    /// Names of its cells without the part that names the size of the team.
    pub name: String,
    /// Its cells, in the order of the study.
    pub cells: Vec<&'a CellResults>,
}

/// Name of a cell without the part `K n` that says how many agents it has.
#[must_use]
pub fn method_name(cell: &str, agents: u32) -> String {
    let size = format!("K {agents}");
    let parts: Vec<&str> = cell.split(", ").filter(|part| *part != size).collect();
    parts.join(", ")
}

/// The methods of cells with runs, in the order of their first cells.
#[must_use]
pub fn methods<'a>(cells: &[&'a CellResults]) -> Vec<Method<'a>> {
    let mut methods: Vec<Method<'a>> = Vec::new();
    for cell in cells.iter().filter(|cell| !cell.costs.is_empty()) {
        let name = method_name(&cell.description.name, cell.description.agents);
        match methods.iter_mut().find(|method| method.name == name) {
            Some(method) => method.cells.push(cell),
            None => methods.push(Method {
                name,
                cells: vec![cell],
            }),
        }
    }
    methods
}

/// Each cell with runs, in the order of the study.
#[must_use]
pub fn team_sizes<'a>(results: &'a Results, scaling: &Scaling) -> Vec<TeamSize<'a>> {
    let cells = results.cells.iter();
    let sizes = cells.filter_map(|cell| team_size(results, scaling, cell));
    sizes.collect()
}

fn team_size<'a>(
    results: &'a Results,
    scaling: &Scaling,
    cell: &'a CellResults,
) -> Option<TeamSize<'a>> {
    let measure = *scaling.measure;
    let values = values(results, cell, measure);
    let alone = best_single_agent(results, cell, measure);
    let partner = without_diversity(results, scaling, cell);
    let ratio = |other: &CellResults| ratio(results, other, cell, measure);
    (!values.is_empty()).then(|| TeamSize {
        cell: &cell.description.name,
        agents: cell.description.agents,
        mean: mean_of(&values),
        worst: mean_of_worst(values),
        speedup: alone.and_then(ratio),
        diversity_gap: partner.and_then(ratio),
    })
}

/// The slope of ln m(K) over ln K of each method with at least two sizes: −1 if K agents are K times
/// as fast.
#[must_use]
pub fn slopes(results: &Results, measure: Measure) -> Vec<(Method<'_>, Option<Estimate>)> {
    let cells: Vec<&CellResults> = results.cells.iter().collect();
    let methods = methods(&cells).into_iter();
    methods
        .filter(|method| method.cells.len() > 1)
        .map(|method| {
            let slope = slope(results, &method, measure);
            (method, slope)
        })
        .collect()
}

fn slope(results: &Results, method: &Method<'_>, measure: Measure) -> Option<Estimate> {
    let agents = |cell: &&CellResults| f64::from(cell.description.agents);
    let positions: Vec<f64> = method.cells.iter().map(agents).collect();
    let scores = method.cells.iter().map(|cell| cell.scores(measure));
    let scores: Vec<&[RunScore]> = scores.collect();
    if scores.iter().any(|scores| scores.is_empty()) {
        return None;
    }
    let samples: Vec<Vec<f64>> = method
        .cells
        .iter()
        .map(|cell| values(results, cell, measure))
        .collect();
    let samples: Vec<&[f64]> = samples.iter().map(Vec::as_slice).collect();
    log_log_slope(&positions, &samples, are_paired(results, &scores))
}

/// Mean of the first cell over that of the second.
fn ratio(
    results: &Results,
    first: &CellResults,
    second: &CellResults,
    measure: Measure,
) -> Option<Ratio> {
    if first.description.name == second.description.name {
        return Some(Ratio::OfItself);
    }
    let scores = [first, second].map(|cell| cell.scores(measure));
    let [first, second] = [first, second].map(|cell| values(results, cell, measure));
    if first.is_empty() || second.is_empty() {
        return None;
    }
    ratio_of_means(&first, &second, are_paired(results, &scores)).map(Ratio::Estimated)
}

/// Whether runs with equal run seeds share something, and all cells have the same run seeds.
fn are_paired(results: &Results, scores: &[&[RunScore]]) -> bool {
    let seeds = |scores: &[RunScore]| scores.iter().map(|score| score.run_seed).collect();
    let seeds: Vec<Vec<u64>> = scores.iter().map(|scores| seeds(scores)).collect();
    !results.study.pairs_share.is_empty() && seeds.windows(2).all(|pair| pair[0] == pair[1])
}

/// Values of the runs of a cell; times up to the [`known_horizon`] of this task.
#[must_use]
pub fn values(results: &Results, cell: &CellResults, measure: Measure) -> Vec<f64> {
    let cells: Vec<&CellResults> = cells_of_task(results, cell).collect();
    let quantity = Quantity::of(measure, known_horizon(&cells, measure));
    let scores = cell.scores(measure).iter();
    scores.map(|score| quantity.value(*score)).collect()
}

fn cells_of_task<'a>(
    results: &'a Results,
    cell: &'a CellResults,
) -> impl Iterator<Item = &'a CellResults> {
    let task = &cell.description.task;
    let cells = results.cells.iter();
    cells.filter(move |other| other.description.task == *task)
}

/// The cell with one agent that has the smallest mean in the task of this cell.
#[must_use]
pub fn best_single_agent<'a>(
    results: &'a Results,
    cell: &'a CellResults,
    measure: Measure,
) -> Option<&'a CellResults> {
    let single = cells_of_task(results, cell)
        .filter(|other| other.description.agents == 1 && !other.scores(measure).is_empty());
    let mean = |cell: &&CellResults| mean(&values(results, cell, measure));
    single.min_by(|one, other| mean(one).total_cmp(&mean(other)))
}

/// The cell that differs from this one in the part of its name that stands for diversity.
fn without_diversity<'a>(
    results: &'a Results,
    scaling: &Scaling,
    cell: &CellResults,
) -> Option<&'a CellResults> {
    let name = &cell.description.name;
    let pairs = scaling.diversity.iter();
    let partners = pairs.map(|(with, without)| replace_part(name, with, without));
    partners.flatten().find_map(|name| results.cell(&name))
}

/// The name of a cell with one of its parts replaced; `None` if it does not have this part.
#[must_use]
pub fn replace_part(name: &str, part: &str, replacement: &str) -> Option<String> {
    let mut parts: Vec<&str> = name.split(", ").collect();
    let place = parts.iter().position(|each| *each == part)?;
    parts[place] = replacement;
    Some(parts.join(", "))
}

/// The mean with an interval; without one if the mean is 0.
fn mean_of(values: &[f64]) -> Estimate {
    mean_with_log_interval(values).unwrap_or_else(|| {
        let value = mean(values);
        let interval = if values.len() < MIN_RUNS {
            Interval::TooFewRuns { n: values.len() }
        } else {
            Interval::Known {
                low: value,
                high: value,
            }
        };
        Estimate { value, interval }
    })
}

/// Mean of the largest twentieth of the values, of one at least.
fn mean_of_worst(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let count = values.len().div_ceil(20);
    mean(&values[values.len() - count..])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_size_of_the_team_is_no_part_of_a_method() {
        assert_eq!(method_name("chains, K 16, UCRL", 16), "chains, UCRL");
        // Another number is a part of the method.
        assert_eq!(method_name("M 4, K 16, UCRL", 4), "M 4, K 16, UCRL");
    }

    #[test]
    fn the_partner_differs_in_one_part() {
        let name = "chains, K 4, own seeds";
        let partner = replace_part(name, "own seeds", "one seed");
        assert_eq!(partner.as_deref(), Some("chains, K 4, one seed"));
        assert_eq!(replace_part(name, "own", "one"), None);
    }

    #[test]
    fn the_worst_twentieth_is_rounded_up() {
        assert_eq!(mean_of_worst((1..=40).map(f64::from).collect()), 39.5);
        assert_eq!(mean_of_worst(vec![3.0, 7.0, 5.0]), 7.0);
    }
}
