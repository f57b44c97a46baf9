//! What the results of a study cost: episodes, environment steps and gradient steps until the task
//! is solved, and the speed-up over the best single agent.

use super::results::{CellResults, Results, known_horizon};
use super::score::RunCost;
use super::score::times_to_event;
use crate::experiment::measure::Measure;
use seedbed_stats::aggregate::mean;
use seedbed_stats::shares::Share;

/// Cost of the runs of a cell, until a run solved its task or, if it did not, until its end. Means
/// over runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Cost {
    /// Share of runs that solved the task; `None` if no threshold is set.
    pub solved: Option<Share>,
    /// Episodes of each agent; `None` if unknown.
    pub episodes: Option<f64>,
    /// Environment steps of the team; `None` if unknown.
    pub env_steps: Option<f64>,
    /// Gradient steps of all networks of the team; `None` if unknown.
    pub gradient_steps: Option<f64>,
    /// Speed-up over the best single agent; `None` if the study has no single agent in this task.
    pub speedup: Option<Speedup>,
}

/// Speed-up of a team of K agents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Speedup {
    /// S(K) = T*(1) / T(K): mean episodes of each agent of the best cell with one agent, over those
    /// of this cell, both up to the same number of episodes.
    pub factor: f64,
    /// E(K) = S(K) / K: 1 if K agents are K times as fast.
    pub efficiency: f64,
}

/// Cost of each cell with runs, in the order of the study.
#[must_use]
pub fn costs(results: &Results) -> Vec<(&CellResults, Cost)> {
    let cells = results.cells.iter().filter(|cell| !cell.costs.is_empty());
    cells.map(|cell| (cell, cost(results, cell))).collect()
}

fn cost(results: &Results, cell: &CellResults) -> Cost {
    let runs = || cell.costs.iter().map(|(_, run)| run);
    let mean_over_runs = |quantity: fn(&RunCost) -> Option<f64>| {
        let values: Option<Vec<f64>> = runs().map(quantity).collect();
        values.map(|values| mean(&values))
    };
    let has_threshold = runs().all(|run| run.solved.is_some());
    Cost {
        solved: has_threshold.then(|| Share {
            successes: runs().filter(|run| run.solved == Some(true)).count(),
            runs: cell.costs.len(),
        }),
        episodes: mean_over_runs(|run| run.episodes),
        env_steps: mean_over_runs(|run| run.env_steps),
        gradient_steps: mean_over_runs(|run| run.gradient_steps),
        speedup: has_threshold.then(|| speedup(results, cell)).flatten(),
    }
}

/// Speed-up over the fastest cell with one agent in the same task; `None` without teams or without
/// single agents. Times are compared up to the [`known_horizon`] of all cells in this task.
fn speedup(results: &Results, cell: &CellResults) -> Option<Speedup> {
    let task = &cell.description.task;
    if cell.unknown().episodes {
        return None;
    }
    let cells = || {
        results
            .cells
            .iter()
            .filter(|other| other.description.task == *task && !other.unknown().episodes)
    };
    let horizon = known_horizon(&cells().collect::<Vec<_>>(), Measure::EpisodesToSolve);
    if cells().all(|other| other.description.agents == 1) {
        return None;
    }
    let single_agents = cells().filter(|other| other.description.agents == 1);
    let time_of_best = single_agents
        .filter_map(|other| mean_episodes(other, horizon))
        .reduce(f64::min)?;
    let factor = time_of_best / mean_episodes(cell, horizon)?;
    Some(Speedup {
        factor,
        efficiency: factor / f64::from(cell.description.agents),
    })
}

/// Mean number of episodes of each agent until solved, at most `horizon`; `None` without runs or
/// without a threshold.
fn mean_episodes(cell: &CellResults, horizon: f64) -> Option<f64> {
    let times = times_to_event(cell.scores(Measure::EpisodesToSolve));
    let restricted = times.iter().map(|time| time.restricted_to(horizon));
    (!times.is_empty()).then(|| mean(&restricted.collect::<Vec<f64>>()))
}

/// Names of cells whose policies never had a gradient: their policy loss was 0 in every round of
/// every run. Such agents act by their initial policies, and are no baseline.
#[must_use]
pub fn cells_without_policy_gradient(results: &Results) -> Vec<&str> {
    let has_no_gradient = |cell: &&CellResults| {
        let mut runs = cell.costs.iter().map(|(_, run)| run.had_policy_gradient);
        !cell.costs.is_empty() && runs.all(|had_gradient| had_gradient == Some(false))
    };
    let cells = results.cells.iter().filter(has_no_gradient);
    cells.map(|cell| cell.description.name.as_str()).collect()
}
