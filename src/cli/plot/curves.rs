//! Panels over episodes and rounds: returns, and the columns of `rounds.csv`.

use super::PlottedRun;
use crate::record::metrics::{Metric, columns_in_display_order};
use crate::run::summary::FINAL_WINDOW;
use seedbed_figure::color::categorical_color;
use seedbed_figure::{Curves, Panel, Row, Series, Threshold};

/// Color of the mean over the agents of a team.
const TEAM: [u8; 3] = [35, 35, 40];

/// Maximum number of agents with a name in the legend.
const MAX_NAMED: usize = 8;

/// A panel of returns: of one run, the returns of each agent and their mean; of several runs, the mean of each
/// run.
pub(super) fn returns(runs: &[PlottedRun], agents: &[u32]) -> Row {
    let panel = match runs {
        [run] => of_agents(run, agents),
        _ => of_runs(runs),
    };
    Row {
        height: 270.0,
        panels: vec![Panel::Curves(panel)],
        key: None,
    }
}

fn of_agents(run: &PlottedRun, agents: &[u32]) -> Curves {
    let count = run.review.agents();
    let shown: Vec<u32> = (0..count as u32)
        .filter(|agent| agents.is_empty() || agents.contains(agent))
        .collect();
    let named = shown.len() <= MAX_NAMED;
    let of_agent = |&agent: &u32| Series {
        name: if named {
            format!("agent {agent}")
        } else {
            String::new()
        },
        color: categorical_color(agent),
        points: (0..)
            .map(f64::from)
            .zip(run.review.returns(agent))
            .map(<[f64; 2]>::from)
            .collect(),
        faint: count > 1,
        ..Series::default()
    };
    let mut series: Vec<Series> = shown.iter().map(of_agent).collect();
    let who = if count > 1 { "team, " } else { "" };
    series.push(team(
        run,
        format!("{who}mean of {FINAL_WINDOW} episodes"),
        TEAM,
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

fn of_runs(runs: &[PlottedRun]) -> Curves {
    let series = (0..)
        .zip(runs)
        .map(|(index, run)| team(run, run.label.clone(), categorical_color(index)))
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

/// The mean return over all agents and over the latest episodes of each agent.
fn team(run: &PlottedRun, name: String, color: [u8; 3]) -> Series {
    let returns = run.review.team_returns();
    let mean = |end: usize| {
        let window = &returns[(end + 1).saturating_sub(FINAL_WINDOW)..=end];
        window.iter().sum::<f64>() / window.len() as f64
    };
    let points = (0..returns.len())
        .map(|end| [end as f64, mean(end)])
        .collect();
    Series {
        name,
        color,
        points,
        ..Series::default()
    }
}

fn threshold(run: &PlottedRun) -> Option<Threshold> {
    let solved = run.review.summary.as_ref()?.solved_at?;
    Some(Threshold {
        name: format!("solved: {}", solved.r#return),
        value: solved.r#return,
    })
}

/// One panel per metric, with one line per agent. For several runs, one line per run, the combined value of its
/// agents. Metrics that no run has, or that are always 0, are omitted.
pub(super) fn updates(runs: &[PlottedRun], agents: &[u32]) -> Vec<Row> {
    let rows = || runs.iter().flat_map(|run| &run.review.rounds);
    let is_shown = |metric: &&Metric| {
        let mut values = rows().filter_map(|row| metric.value(row));
        metric.plotted && values.any(f64::is_normal)
    };
    let panels: Vec<Panel> = columns_in_display_order()
        .into_iter()
        .filter(is_shown)
        .map(|metric| Panel::Curves(of_metric(runs, agents, metric)))
        .collect();
    let in_row = |panels: &[Panel]| {
        let mut panels = panels.to_vec();
        panels.resize(3, Panel::Blank);
        Row {
            height: 210.0,
            panels,
            key: None,
        }
    };
    panels.chunks(3).map(in_row).collect()
}

fn of_metric(runs: &[PlottedRun], agents: &[u32], metric: &Metric) -> Curves {
    let series = match runs {
        [run] => {
            let all = (0..run.review.agents() as u32)
                .filter(|agent| agents.is_empty() || agents.contains(agent));
            all.map(|agent| of_agent(run, agent, metric)).collect()
        }
        _ => (0..)
            .zip(runs)
            .map(|(index, run)| of_run(run, categorical_color(index), metric))
            .collect(),
    };
    let mut curves = panel(&metric.label(), "round", "", series, Vec::new());
    curves.legend = false;
    curves
}

fn of_agent(run: &PlottedRun, agent: u32, metric: &Metric) -> Series {
    let own = run.review.rounds.iter().filter(|row| row.agent == agent);
    let points = own.filter_map(|row| Some([f64::from(row.round), metric.value(row)?]));
    Series {
        color: categorical_color(agent),
        points: finite(points),
        ..Series::default()
    }
}

fn of_run(run: &PlottedRun, color: [u8; 3], metric: &Metric) -> Series {
    let rounds = run
        .review
        .rounds
        .chunk_by(|one, next| one.round == next.round);
    let points = rounds
        .filter_map(|rows| Some([f64::from(rows[0].round), metric.team_value_of_round(rows)?]));
    Series {
        color,
        points: finite(points),
        ..Series::default()
    }
}

fn finite(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
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
        legend: true,
        ..Curves::default()
    }
}
