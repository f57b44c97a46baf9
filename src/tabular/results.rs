//! Results of a tabular run, and their files.

use std::path::Path;

use serde::Serialize;

use super::scenario::TabularScenario;
use super::team::{Episode, TabularTeam};
use crate::run::folder::RunFolder;
use crate::run::{self, RunError};
use crate::scenario::resolve::Resolve;
use crate::storage::files;

/// Results of a finished run.
#[derive(Clone, Debug, PartialEq)]
pub struct Results {
    /// The numbers of `summary.json`.
    pub summary: Summary,
    /// Episodes in the order in which they ended.
    pub episodes: Vec<Episode>,
    /// Visited states.
    pub visits: Vec<VisitRow>,
}

/// `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the scenario.
    pub scenario: String,
    /// Run seed.
    pub seed: u64,
    /// Name of the task family.
    pub task: &'static str,
    /// Name of the algorithm.
    pub algorithm: &'static str,
    /// Number of agents K.
    pub agents: u32,
    /// Number of episodes per agent.
    pub episodes_per_agent: u32,
    /// Number of actions of the whole team.
    pub env_steps: u64,
    /// Expected return of an episode under the optimal policy.
    pub optimal_value: f64,
    /// Sum of the regret over all episodes of an agent, mean over agents.
    pub regret_per_agent: f64,
    /// Sum of the regret over all episodes of all agents.
    pub cumulative_regret: f64,
    /// Share of episodes without regret.
    pub episodes_without_regret: f64,
    /// Number of states that the team visited.
    pub states_visited: usize,
    /// Number of states.
    pub states: usize,
}

/// One row of `visits.csv`: a state that the team visited.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VisitRow {
    /// Index of the state.
    pub state: u32,
    /// Coordinates of the state, e.g. `row 3, column 1`.
    pub place: String,
    /// Number of visits by the whole team.
    pub visits: u64,
    /// Number of agents that visited the state at least once.
    pub agents: u32,
}

/// Smallest regret of an episode that counts as regret; smaller values are rounding errors.
const MIN_REGRET: f64 = 1e-9;

impl Results {
    /// Results of a team that has finished `episodes`.
    #[must_use]
    pub fn of(
        name: &str,
        scenario: &TabularScenario,
        team: &TabularTeam,
        episodes: Vec<Episode>,
    ) -> Self {
        let cumulative_regret: f64 = episodes.iter().map(|episode| episode.regret).sum();
        let without_regret = episodes
            .iter()
            .filter(|episode| episode.regret < MIN_REGRET)
            .count();
        let agents = scenario.agents.count.get();
        let summary = Summary {
            scenario: name.to_owned(),
            seed: scenario.seed,
            task: scenario.task.name(),
            algorithm: scenario.algorithm.name(),
            agents,
            episodes_per_agent: scenario.episodes.get(),
            env_steps: team.steps(),
            optimal_value: team.optimal_value(),
            regret_per_agent: cumulative_regret / f64::from(agents),
            cumulative_regret,
            episodes_without_regret: without_regret as f64 / episodes.len() as f64,
            states_visited: team.states_visited(),
            states: team.model().state_count(),
        };
        Self {
            summary,
            episodes,
            visits: visit_rows(team),
        }
    }

    /// Writes `scenario.ron`, `regret.csv`, `visits.csv` and the checksums, and finally
    /// `summary.json`, which marks the run as finished.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, scenario: &TabularScenario, folder: &RunFolder) -> Result<(), RunError> {
        replace_file(&folder.scenario_file(), || Ok(scenario.resolved().into()))?;
        replace_file(&folder.regret_file(), || to_csv(&self.episodes))?;
        replace_file(&folder.visits_file(), || to_csv(&self.visits))?;
        let summary = serde_json::to_string_pretty(&self.summary).map(|text| text + "\n");
        let summary = summary.map_err(|error| RunError::File {
            path: folder.summary_file(),
            error: error.into(),
        })?;
        run::write_checksums_of_results(folder, &summary)?;
        replace_file(&folder.summary_file(), || Ok(summary.into()))
    }
}

fn replace_file(
    path: &Path,
    contents: impl FnOnce() -> std::io::Result<Vec<u8>>,
) -> Result<(), RunError> {
    let written = contents().and_then(|bytes| files::replace(path, &bytes));
    written.map_err(|error| RunError::File {
        path: path.to_owned(),
        error,
    })
}

fn visit_rows(team: &TabularTeam) -> Vec<VisitRow> {
    let mut rows = Vec::new();
    for (state, visits) in (0..).zip(team.visits()) {
        if visits.agents > 0 {
            rows.push(VisitRow {
                state,
                place: format_place(team, state),
                visits: visits.count,
                agents: visits.agents,
            });
        }
    }
    rows
}

fn format_place(team: &TabularTeam, state: u32) -> String {
    let coordinates = team.model().coordinates.iter();
    coordinates
        .zip(team.model().coordinates_of(state))
        .map(|(coordinate, value)| format!("{} {value}", coordinate.name))
        .collect::<Vec<_>>()
        .join(", ")
}

fn to_csv(rows: &[impl Serialize]) -> std::io::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    rows.iter()
        .try_for_each(|row| writer.serialize(row))
        .map_err(std::io::Error::other)?;
    writer
        .into_inner()
        .map_err(|error| std::io::Error::other(error.to_string()))
}
