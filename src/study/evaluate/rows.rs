//! `results.csv`: one row per run.

use std::borrow::Cow;
use std::io;

use serde::Serialize;

use super::results::{CellResults, Results};
use super::score::RunCost;
use crate::experiment::measure::{Curve, Measure};
use crate::experiment::run_result::RunResult;
use crate::text::spreadsheet_cell;
use seedbed_input::numbers::ranged_count;

/// Names of the columns that `results.csv` has for every study.
pub(super) const COLUMNS: [&str; 22] = [
    "cell",
    "task",
    "agents",
    "seed",
    "run",
    "seeds",
    "state",
    "episodes",
    "env_steps",
    "episodes_to_solve",
    "env_steps_to_solve",
    "final_return",
    "mean_return",
    "reach",
    "first_goal",
    "regret",
    "team_coverage",
    "effective_agents",
    "solved",
    "gradient_steps",
    "had_policy_gradient",
    "reason",
];

/// The columns that `results.csv` has for every study. A cell of the table is empty if the run does
/// not have the measure or did not reach the time.
#[derive(Clone, Default, Serialize)]
struct Row<'a> {
    cell: Cow<'a, str>,
    task: Cow<'a, str>,
    agents: u32,
    /// Run seed or, of results of others, the id of the run.
    seed: u64,
    /// Name of a run that others made.
    run: Cow<'a, str>,
    /// `tuning`, `reporting` or, of results of others, `external`.
    seeds: &'static str,
    /// `finished` or `failed`.
    state: &'static str,
    episodes: Option<usize>,
    env_steps: Option<u64>,
    episodes_to_solve: Option<f64>,
    env_steps_to_solve: Option<f64>,
    final_return: Option<f64>,
    mean_return: Option<f64>,
    reach: Option<f64>,
    first_goal: Option<f64>,
    regret: Option<f64>,
    team_coverage: Option<f64>,
    effective_agents: Option<f64>,
    solved: Option<bool>,
    /// Until the task was solved, or until the end of the run.
    gradient_steps: Option<f64>,
    had_policy_gradient: Option<bool>,
    reason: Cow<'a, str>,
}

/// The bytes of `results.csv`: the columns of [`Row`], and one column per [measure of the
/// results](Results::measures), named as in the study file. In these columns `inf` is a time that was not reached.
pub(in crate::study) fn csv(results: &Results) -> io::Result<Vec<u8>> {
    let mut writer = csv::WriterBuilder::new()
        .has_headers(false)
        .from_writer(Vec::new());
    let measures = results.measures();
    let names: Vec<String> = measures.iter().map(|&measure| column(measure)).collect();
    writer.write_record(COLUMNS.into_iter().chain(names.iter().map(String::as_str)))?;
    for cell in &results.cells {
        let cell_columns = Row {
            seeds: match &cell.description.external {
                Some(_) => "external",
                None if results.is_tuning() => "tuning",
                None => "reporting",
            },
            ..columns_of_cell(cell)
        };
        for (seed, run) in &cell.runs {
            writer.serialize((
                columns_of_run(&cell_columns, cell, *seed, run),
                measures
                    .iter()
                    .map(|measure| measure.of(run).filter(|_| cell.has_measure(*measure)))
                    .collect::<Vec<_>>(),
            ))?;
        }
        for (seed, reason) in &cell.failures {
            let row = Row {
                seed: *seed,
                state: "failed",
                reason: spreadsheet_cell(reason),
                ..cell_columns.clone()
            };
            writer.serialize((row, vec![None::<f64>; measures.len()]))?;
        }
    }
    writer
        .into_inner()
        .map_err(|error| io::Error::other(error.to_string()))
}

/// Name of the column of a measure.
pub(in crate::study) fn column(measure: Measure) -> String {
    ron::to_string(&measure).expect("plain data always serializes")
}

fn columns_of_cell(cell: &CellResults) -> Row<'_> {
    Row {
        cell: spreadsheet_cell(&cell.description.name),
        task: spreadsheet_cell(&cell.description.task),
        agents: cell.description.agents,
        ..Row::default()
    }
}

fn columns_of_run<'a>(
    cell_columns: &Row<'a>,
    cell: &'a CellResults,
    seed: u64,
    run: &RunResult,
) -> Row<'a> {
    let finite_value = |measure: Measure| {
        let value = measure.of(run).filter(|value| value.is_finite());
        value.filter(|_| cell.has_measure(measure))
    };
    let unknown = cell.unknown();
    let cost = RunCost::of(run, unknown);
    Row {
        seed,
        run: spreadsheet_cell(cell.run_name(seed).unwrap_or_default()),
        state: "finished",
        episodes: (!unknown.episodes).then(|| run.episodes_per_agent()),
        env_steps: (!unknown.env_steps).then_some(run.env_steps),
        episodes_to_solve: finite_value(Measure::EpisodesToSolve),
        env_steps_to_solve: finite_value(Measure::EnvStepsToSolve),
        final_return: finite_value(Measure::final_return(ranged_count(25))),
        mean_return: finite_value(Measure::Mean { of: Curve::Return }),
        reach: finite_value(Measure::Reach),
        first_goal: finite_value(Measure::FirstGoal),
        regret: finite_value(Measure::Regret),
        team_coverage: finite_value(Measure::Coverage),
        effective_agents: finite_value(Measure::Last {
            of: Curve::EffectiveAgents,
        }),
        solved: cost.solved,
        gradient_steps: cost.gradient_steps,
        had_policy_gradient: cost.had_policy_gradient,
        ..cell_columns.clone()
    }
}
