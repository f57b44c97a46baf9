//! Panels over episodes and rounds: returns, and the columns of `rounds.csv`.

use super::PlottedRun;
use seedbed::record::metrics::{Metric, round_metrics_in_display_order};
use seedbed::run::summary::FINAL_WINDOW;
use seedbed_figure::color::categorical_color;
use seedbed_figure::{Curves, Panel, Row, Series, Threshold};

/// Color of the mean over the agents of a team.
const TEAM_COLOR: [u8; 3] = [35, 35, 40];

/// Maximum number of agents with a name in the legend.
const MAX_AGENTS_IN_LEGEND: usize = 8;

/// A row with one panel of returns. A single run is drawn with one curve per agent and the mean of
/// the team; several runs are drawn with the mean of each team.
pub(super) fn returns_row(runs: &[PlottedRun], agents: &[u32]) -> Row {
    let panel = match runs {
        [run] => returns_of_agents(run, agents),
        _ => returns_of_teams(runs),
    };
    Row {
        height: 270.0,
        panels: vec![Panel::Curves(panel)],
        key: None,
    }
}

/// The agents of a run that `agents` lists; all agents of the run if it is empty.
fn shown_agents(run: &PlottedRun, agents: &[u32]) -> Vec<u32> {
    (0..run.loaded_run.agent_count() as u32)
        .filter(|agent| agents.is_empty() || agents.contains(agent))
        .collect()
}

fn returns_of_agents(run: &PlottedRun, agents: &[u32]) -> Curves {
    let is_team = run.loaded_run.agent_count() > 1;
    let shown_agents = shown_agents(run, agents);
    let has_names = shown_agents.len() <= MAX_AGENTS_IN_LEGEND;
    let agent_series = |&agent: &u32| Series {
        name: if has_names {
            format!("agent {agent}")
        } else {
            String::new()
        },
        color: categorical_color(agent),
        points: (0..)
            .map(f64::from)
            .zip(run.loaded_run.returns(agent))
            .map(<[f64; 2]>::from)
            .collect(),
        is_faint: is_team,
        ..Series::default()
    };
    let mut series: Vec<Series> = shown_agents.iter().map(agent_series).collect();
    let name_prefix = if is_team { "team, " } else { "" };
    series.push(team_series(
        run,
        format!("{name_prefix}mean of {FINAL_WINDOW} episodes"),
        TEAM_COLOR,
    ));
    let thresholds = threshold(run).into_iter().collect();
    panel(
        "returns",
        "episode of each agent",
        "return",
        series,
        thresholds,
    )
}

fn returns_of_teams(runs: &[PlottedRun]) -> Curves {
    let series = (0..)
        .zip(runs)
        .map(|(index, run)| team_series(run, run.label.clone(), categorical_color(index)))
        .collect();
    let mut thresholds: Vec<Threshold> = runs.iter().filter_map(threshold).collect();
    thresholds.dedup();
    let title = format!("mean return of each team over {FINAL_WINDOW} episodes");
    panel(
        &title,
        "episode of each agent",
        "return",
        series,
        thresholds,
    )
}

/// Curve of the mean return over all agents and over the latest `FINAL_WINDOW` episodes of each
/// agent.
fn team_series(run: &PlottedRun, name: String, color: [u8; 3]) -> Series {
    let returns = run.loaded_run.team_returns();
    let trailing_mean = |last: usize| {
        let window = &returns[(last + 1).saturating_sub(FINAL_WINDOW)..=last];
        window.iter().sum::<f64>() / window.len() as f64
    };
    let points = (0..returns.len())
        .map(|last| [last as f64, trailing_mean(last)])
        .collect();
    Series {
        name,
        color,
        points,
        ..Series::default()
    }
}

fn threshold(run: &PlottedRun) -> Option<Threshold> {
    let solved_at = run.loaded_run.summary.as_ref()?.solved_at?;
    Some(Threshold {
        // Thresholds are stored in single precision; as f64 they would print spurious digits.
        name: format!("solved: {}", solved_at.r#return as f32),
        value: solved_at.r#return,
    })
}

/// One panel per metric. A single run is drawn with one line per agent; several runs are drawn with
/// one line each, the combined value of the team. Metrics that no run has, or that are always 0,
/// are omitted.
pub(super) fn metric_rows(runs: &[PlottedRun], agents: &[u32]) -> Vec<Row> {
    let rows = || runs.iter().flat_map(|run| &run.loaded_run.rounds);
    let is_shown = |metric: &&Metric| {
        let mut values = rows().filter_map(|row| metric.value(row));
        metric.plotted && values.any(f64::is_normal)
    };
    let panels: Vec<Panel> = round_metrics_in_display_order()
        .into_iter()
        .filter(is_shown)
        .map(|metric| Panel::Curves(metric_panel(runs, agents, metric)))
        .collect();
    let row_of = |panels: &[Panel]| {
        let mut panels = panels.to_vec();
        panels.resize(3, Panel::Blank);
        Row {
            height: 210.0,
            panels,
            key: None,
        }
    };
    panels.chunks(3).map(row_of).collect()
}

fn metric_panel(runs: &[PlottedRun], agents: &[u32], metric: &Metric) -> Curves {
    let series = match runs {
        [run] => shown_agents(run, agents)
            .into_iter()
            .map(|agent| metric_of_agent(run, agent, metric))
            .collect(),
        _ => (0..)
            .zip(runs)
            .map(|(index, run)| metric_of_team(run, categorical_color(index), metric))
            .collect(),
    };
    let mut curves = panel(&metric.label(), "round", "", series, Vec::new());
    curves.has_legend = false;
    curves
}

fn metric_of_agent(run: &PlottedRun, agent: u32, metric: &Metric) -> Series {
    let rows = run
        .loaded_run
        .rounds
        .iter()
        .filter(|row| row.agent == agent);
    let points = rows.filter_map(|row| Some([f64::from(row.round), metric.value(row)?]));
    Series {
        color: categorical_color(agent),
        points: finite_points(points),
        ..Series::default()
    }
}

fn metric_of_team(run: &PlottedRun, color: [u8; 3], metric: &Metric) -> Series {
    let rounds = run
        .loaded_run
        .rounds
        .chunk_by(|one, next| one.round == next.round);
    let points = rounds
        .filter_map(|rows| Some([f64::from(rows[0].round), metric.team_value_of_round(rows)?]));
    Series {
        color,
        points: finite_points(points),
        ..Series::default()
    }
}

fn finite_points(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    points.filter(|[_, value]| value.is_finite()).collect()
}

fn panel(
    title: &str,
    x_label: &str,
    y_label: &str,
    series: Vec<Series>,
    thresholds: Vec<Threshold>,
) -> Curves {
    Curves {
        title: title.to_owned(),
        x_label: x_label.to_owned(),
        y_label: y_label.to_owned(),
        series,
        thresholds,
        has_legend: true,
        ..Curves::default()
    }
}
