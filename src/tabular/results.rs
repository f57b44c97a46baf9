//! What a run in a finite task came to, and the files that say so.

use serde::Serialize;

use super::scenario::TabularScenario;
use super::team::{Episode, TabularTeam};
use crate::run::files;
use crate::run::folder::RunFolder;
use crate::scenario::overrides::Resolve;

/// A finished run.
#[derive(Clone, Debug, PartialEq)]
pub struct Results {
    /// What it came to.
    pub summary: Summary,
    /// In the order in which they ended.
    pub episodes: Vec<Episode>,
    /// Who was where.
    pub visits: Vec<VisitRow>,
}

/// `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// The scenario's name.
    pub scenario: String,
    /// The run's seed.
    pub seed: u64,
    /// The family of tasks.
    pub task: &'static str,
    /// How agents explored.
    pub algorithm: &'static str,
    /// K.
    pub agents: u32,
    /// Of each agent.
    pub episodes_per_agent: u32,
    /// Actions of the whole team.
    pub env_steps: u64,
    /// What the best policy earns in an episode on average.
    pub optimal_value: f64,
    /// Mean over agents of the regret of all their episodes.
    pub regret_per_agent: f64,
    /// Sum over agents.
    pub cumulative_regret: f64,
    /// Share of episodes without regret.
    pub episodes_without_regret: f64,
    /// States in which any agent was, and all that there are.
    pub states_visited: usize,
    /// All that there are.
    pub states: usize,
}

/// One row of `visits.csv`: a state where somebody was.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VisitRow {
    /// The state's number.
    pub state: u32,
    /// Where it is, such as `row 3, column 1`.
    pub place: String,
    /// How often the team was there.
    pub visits: u64,
    /// How many agents were there at least once.
    pub agents: u32,
}

/// Regrets below this are rounding.
const ROUNDING: f64 = 1e-9;

impl Results {
    /// What a team came to that ended these episodes.
    #[must_use]
    pub fn of(
        name: &str,
        scenario: &TabularScenario,
        team: &TabularTeam,
        episodes: Vec<Episode>,
    ) -> Self {
        let cumulative: f64 = episodes.iter().map(|episode| episode.regret).sum();
        let without = episodes
            .iter()
            .filter(|episode| episode.regret < ROUNDING)
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
            regret_per_agent: cumulative / f64::from(agents),
            cumulative_regret: cumulative,
            episodes_without_regret: without as f64 / episodes.len() as f64,
            states_visited: team.states_visited(),
            states: team.model().states(),
        };
        Self {
            summary,
            episodes,
            visits: visit_rows(team),
        }
    }

    /// Writes `scenario.ron`, `regret.csv`, `visits.csv` and, last of all, `summary.json` into
    /// `folder`.
    ///
    /// # Errors
    /// The system refuses.
    pub fn write(&self, scenario: &TabularScenario, folder: &RunFolder) -> std::io::Result<()> {
        files::replace(&folder.scenario(), scenario.resolved().as_bytes())?;
        files::replace(&folder.regret(), &table(&self.episodes)?)?;
        files::replace(&folder.visits(), &table(&self.visits)?)?;
        let summary = serde_json::to_string_pretty(&self.summary).map_err(std::io::Error::other)?;
        files::replace(&folder.summary(), format!("{summary}\n").as_bytes())
    }
}

fn visit_rows(team: &TabularTeam) -> Vec<VisitRow> {
    let place = |state: u32| {
        let named = team
            .model()
            .coordinates
            .iter()
            .zip(team.model().coordinates_of(state));
        named
            .map(|(coordinate, value)| format!("{} {value}", coordinate.name))
            .collect::<Vec<_>>()
            .join(", ")
    };
    let visited = team
        .visits()
        .iter()
        .zip(0..)
        .filter(|(visits, _)| visits.agents > 0);
    visited
        .map(|(visits, state)| VisitRow {
            state,
            place: place(state),
            visits: visits.visits,
            agents: visits.agents,
        })
        .collect()
}

fn table(rows: &[impl Serialize]) -> std::io::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    rows.iter()
        .try_for_each(|row| writer.serialize(row))
        .map_err(std::io::Error::other)?;
    writer
        .into_inner()
        .map_err(|error| std::io::Error::other(error.to_string()))
}
