//! Summary of a run as JSON. Numbers that are not known are `null`.

use serde::Serialize;

use super::Inspected;
use seedbed::review::distribution::ValueDistribution;
use seedbed::review::recording_stats::RecordingStats;
use seedbed::run::facts::EpisodeRow;
use seedbed::run::facts::Summary;
use seedbed::run::facts::returns::final_mean;
use seedbed_env::Status;

#[derive(Serialize)]
struct RunJson<'a> {
    name: String,
    path: String,
    finished: bool,
    agent_count: usize,
    /// Number of learners of a recorded run, of which some may act in several copies of the
    /// environment.
    learner_count: Option<usize>,
    episodes_per_agent: usize,
    env_steps: u64,
    /// The numbers of `summary.json`.
    summary: Option<&'a Summary>,
    /// Mean over agents of the return of their n-th episode.
    team_returns: Vec<f64>,
    final_return: Option<f64>,
    /// Number of episodes whose return is NaN; such a return is `null`.
    nan_returns: usize,
    overlap: Option<f64>,
    effective_agents: Option<f64>,
    recent_effective_agents: Option<f64>,
    agents: Vec<AgentJson>,
    /// Overlap of the visited states of each pair of agents; `null` of agents without visits.
    overlaps: Option<Vec<Vec<Option<f64>>>>,
    observations: Vec<ObservationJson>,
    /// Entries of `info` that are recorded beside the observations.
    info: Vec<ObservationJson>,
}

#[derive(Serialize)]
struct AgentJson {
    agent: u32,
    episodes: usize,
    final_return: Option<f64>,
    best_return: Option<f64>,
    mean_length: Option<f64>,
    /// Share of episodes that ended before the time limit.
    terminated: Option<f64>,
    coverage: Option<f64>,
    first_coverage: Option<f64>,
    visitation_evenness: Option<f64>,
    intrinsic_reward: Option<f64>,
}

#[derive(Serialize)]
struct ObservationJson {
    name: String,
    unit: String,
    states: u64,
    /// Smallest value other than NaN; `null` if it is infinite.
    min: f32,
    /// Exact median without NaN.
    median: Option<f64>,
    max: f32,
    /// `[null, null]` for entries of `info`, which have no axis of their own.
    axis_range: [f32; 2],
    /// Share of the values outside the range of the axis.
    outside: f64,
    /// Share of the values that are NaN.
    nan: f64,
    /// Share of the values that are infinite.
    infinite: f64,
}

/// The summary as a JSON object.
pub(super) fn text(inspected: &Inspected) -> String {
    let run = &inspected.run;
    let team_returns = inspected.team_returns();
    let diversity = inspected.diversity();
    let object = RunJson {
        name: run.name(),
        path: run.path.display().to_string(),
        finished: run.is_finished,
        agent_count: inspected.agents.len(),
        learner_count: inspected.returns_of_learners().map(|returns| returns.len()),
        episodes_per_agent: team_returns.len(),
        env_steps: inspected.env_steps(),
        summary: run.summary.as_ref(),
        final_return: inspected.final_return(),
        nan_returns: inspected.nan_returns(),
        team_returns,
        overlap: diversity.map(|(overlap, _)| overlap),
        effective_agents: diversity.map(|(_, agents)| agents),
        recent_effective_agents: inspected.recent_effective_agents(),
        agents: inspected
            .agents
            .iter()
            .map(|&agent| agent_json(inspected, agent))
            .collect(),
        overlaps: inspected.overlaps(),
        observations: distributions(inspected, |stats| &stats.distributions),
        info: distributions(inspected, |stats| &stats.info),
    };
    serde_json::to_string_pretty(&object).expect("numbers and texts can be serialized")
}

fn agent_json(inspected: &Inspected, agent: u32) -> AgentJson {
    let returns: Vec<f64> = inspected.run.returns(agent).collect();
    let rows = inspected.run.episodes.iter();
    let rows: Vec<&EpisodeRow> = rows.filter(|row| row.agent == agent).collect();
    let mean = |value: fn(&EpisodeRow) -> f64| {
        let sum: f64 = rows.iter().map(|row| value(row)).sum();
        (!rows.is_empty()).then(|| sum / rows.len() as f64)
    };
    AgentJson {
        agent,
        episodes: returns.len(),
        final_return: final_mean(&returns),
        best_return: returns
            .iter()
            .copied()
            .filter(|value| !value.is_nan())
            .max_by(f64::total_cmp),
        mean_length: mean(|row| f64::from(row.length)),
        terminated: mean(|row| f64::from(u8::from(row.outcome == Status::Terminated))),
        coverage: inspected.coverage(agent),
        first_coverage: inspected.first_coverage(agent),
        visitation_evenness: inspected.evenness(agent),
        intrinsic_reward: inspected.intrinsic_reward(agent),
    }
}

fn distributions(
    inspected: &Inspected,
    part: fn(&RecordingStats) -> &Vec<ValueDistribution>,
) -> Vec<ObservationJson> {
    let distributions = inspected.stats.iter().flat_map(part);
    let observed = distributions.filter(|distribution| distribution.count > 0);
    observed.map(observation_json).collect()
}

fn observation_json(distribution: &ValueDistribution) -> ObservationJson {
    let quantity = &distribution.quantity;
    let share = |count: u64| count as f64 / distribution.count as f64;
    ObservationJson {
        name: quantity.name.clone(),
        unit: quantity.unit.clone(),
        states: distribution.count,
        min: distribution.min,
        median: distribution.median(),
        max: distribution.max,
        axis_range: quantity.range,
        outside: share(distribution.outside),
        nan: share(distribution.nan),
        infinite: share(distribution.infinite),
    }
}
