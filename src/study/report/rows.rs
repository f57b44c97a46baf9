//! `results.csv`: one row a run.

use std::io;

use serde::Serialize;

use crate::input::numbers::known_count;
use crate::study::measure::{Curve, Measure};
use crate::study::measured::Measured;
use crate::study::results::{CellResults, Results};

/// One run. What it cannot tell or did not reach is empty.
#[derive(Default, Serialize)]
struct Row<'a> {
    cell: &'a str,
    task: &'a str,
    agents: u32,
    seed: u64,
    /// `tuning` or `reporting`.
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
    reason: &'a str,
}

pub(super) fn csv(results: &Results) -> io::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for cell in &results.cells {
        let about = Row { seeds: if results.is_tuning() { "tuning" } else { "reporting" }, ..about(cell) };
        for (seed, run) in &cell.runs {
            writer.serialize(finished(&about, *seed, run))?;
        }
        for (seed, reason) in &cell.failures {
            writer.serialize(Row { seed: *seed, state: "failed", reason, ..about })?;
        }
    }
    writer.into_inner().map_err(|error| io::Error::other(error.to_string()))
}

fn about(cell: &CellResults) -> Row<'_> {
    Row { cell: &cell.about.name, task: &cell.about.task, agents: cell.about.agents, ..Row::default() }
}

fn finished<'a>(about: &Row<'a>, seed: u64, run: &Measured) -> Row<'a> {
    let of = |measure: Measure| measure.of(run).filter(|value| value.is_finite());
    Row {
        seed,
        state: "finished",
        episodes: Some(run.episodes_per_agent()),
        env_steps: Some(run.env_steps),
        episodes_to_solve: of(Measure::EpisodesToSolve),
        env_steps_to_solve: of(Measure::EnvStepsToSolve),
        final_return: of(Measure::FinalReturn { window: known_count(25) }),
        mean_return: of(Measure::Mean { of: Curve::Return }),
        reach: of(Measure::Reach),
        first_goal: of(Measure::FirstGoal),
        regret: of(Measure::Regret),
        team_coverage: of(Measure::Coverage),
        effective_agents: of(Measure::Last { of: Curve::EffectiveAgents }),
        ..*about
    }
}
