//! Whether a task is one of exploration: what the best undirected baseline and the best method of a
//! study solve.
//!
//! Undirected baselines explore by random actions only (ε, entropy, Gaussian noise). A task that they
//! solve says nothing about exploration, and neither does a task that no method solves.

use super::results::{CellResults, Results};
use super::rules::Quantity;
use super::score::RunScore;
use crate::experiment::measure::Measure;
use crate::study::design::file::Exploration;
use crate::text::short_number as number;
use seedbed_stats::aggregate::mean;

/// Undirected baselines must be below this share.
const MAX_OF_BASELINES: f64 = 0.2;

/// Some method must be above this share.
const MIN_OF_METHODS: f64 = 0.8;

/// What the teams of one size reach in one task.
#[derive(Clone, Debug, PartialEq)]
pub struct Gate {
    /// Name of the task.
    pub task: String,
    /// Number of agents K.
    pub agents: u32,
    /// The undirected baseline with the largest mean, and this mean.
    pub baseline: (String, f64),
    /// The other cell with the largest mean, and this mean.
    pub method: (String, f64),
}

impl Gate {
    /// Whether the task is one of exploration.
    #[must_use]
    pub fn is_passed(&self) -> bool {
        self.baseline.1 < MAX_OF_BASELINES && self.method.1 > MIN_OF_METHODS
    }

    /// What the gate found, as a sentence.
    #[must_use]
    pub fn sentence(&self, measure: Measure) -> String {
        let (baseline, share) = &self.baseline;
        let (method, most) = &self.method;
        let verdict = if self.is_passed() {
            "a task"
        } else {
            "no task"
        };
        format!(
            "`{}` with K = {} is {verdict} of exploration: the {} is {} for the best undirected baseline \
             ({baseline}), and {} for the best method ({method}).",
            self.task,
            self.agents,
            measure.title(),
            number(*share),
            number(*most),
        )
    }
}

/// The gates of a study that names undirected baselines: one per task and size of teams, in the order
/// of its cells. Teams without a baseline or without another method are left out.
#[must_use]
pub fn gates(results: &Results) -> Vec<Gate> {
    let Some(exploration) = &results.study.exploration else {
        return Vec::new();
    };
    let mut teams: Vec<(&str, u32)> = Vec::new();
    for cell in &results.cells {
        let team = (cell.description.task.as_str(), cell.description.agents);
        if !teams.contains(&team) {
            teams.push(team);
        }
    }
    let gates = teams
        .into_iter()
        .map(|team| gate(results, exploration, team));
    gates.flatten().collect()
}

fn gate(results: &Results, exploration: &Exploration, (task, agents): (&str, u32)) -> Option<Gate> {
    let best = |among_baselines: bool| {
        let cells = results.cells.iter().filter(|cell| {
            let undirected = exploration.undirected.iter();
            let is_baseline = undirected
                .into_iter()
                .any(|name| **name == cell.description.name);
            (cell.description.task.as_str(), cell.description.agents) == (task, agents)
                && is_baseline == among_baselines
        });
        let means =
            cells.filter_map(|cell| mean_of_cell(cell, *exploration.measure, among_baselines));
        means.reduce(|best, other| if other.1 > best.1 { other } else { best })
    };
    Some(Gate {
        task: task.to_owned(),
        agents,
        baseline: best(true)?,
        method: best(false)?,
    })
}

/// The mean of a cell: of what is known only as a range, the largest possible one of baselines and the smallest
/// possible one of other methods, so that no task passes by what is not known.
fn mean_of_cell(cell: &CellResults, measure: Measure, is_baseline: bool) -> Option<(String, f64)> {
    let value = |score: &RunScore| match Quantity::of(measure, f64::INFINITY) {
        Quantity::Share => Quantity::Share.range(*score)[usize::from(is_baseline)],
        Quantity::Mean | Quantity::RestrictedMeanTime { .. } => score.value,
    };
    let values: Vec<f64> = cell.scores(measure).iter().map(value).collect();
    (!values.is_empty()).then(|| (cell.description.name.clone(), mean(&values)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gate(baseline: f64, method: f64) -> Gate {
        Gate {
            task: "sea".to_owned(),
            agents: 4,
            baseline: ("ε".to_owned(), baseline),
            method: ("ensemble".to_owned(), method),
        }
    }

    #[test]
    fn a_task_that_random_actions_solve_or_nothing_solves_is_none_of_exploration() {
        assert!(gate(0.1, 0.9).is_passed());
        assert!(!gate(0.2, 0.9).is_passed());
        assert!(!gate(0.1, 0.8).is_passed());
        assert_eq!(
            gate(0.25, 0.9).sentence(Measure::Solved),
            "`sea` with K = 4 is no task of exploration: the share solved is 0.25 for the best undirected \
             baseline (ε), and 0.9 for the best method (ensemble)."
        );
    }
}
