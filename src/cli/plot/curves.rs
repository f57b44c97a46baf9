//! Panels over episodes and rounds: returns, and the columns of `rounds.csv`.

use super::Drawn;
use crate::figure::color::agent_color;
use crate::figure::{Curves, Panel, Row, Series, Threshold};
use crate::record::RoundRow;
use crate::run::summary::FINAL_WINDOW;

/// The team's mean.
const TEAM: [u8; 3] = [35, 35, 40];

/// Agents that are named one by one.
const MOST_NAMED: usize = 8;

/// A panel with the returns of one run's agents and their mean, or with the means of several runs.
pub(super) fn returns(runs: &[Drawn], agents: &[u32]) -> Row {
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

fn of_agents(run: &Drawn, agents: &[u32]) -> Curves {
    let count = run.review.agents();
    let shown: Vec<u32> = (0..count as u32)
        .filter(|agent| agents.is_empty() || agents.contains(agent))
        .collect();
    let named = shown.len() <= MOST_NAMED;
    let of_agent = |&agent: &u32| Series {
        name: if named {
            format!("agent {agent}")
        } else {
            String::new()
        },
        color: agent_color(agent),
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

fn of_runs(runs: &[Drawn]) -> Curves {
    let series = (0..)
        .zip(runs)
        .map(|(index, run)| team(run, run.label.clone(), agent_color(index)))
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

/// The mean over all agents and over the latest episodes of each.
fn team(run: &Drawn, name: String, color: [u8; 3]) -> Series {
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

fn threshold(run: &Drawn) -> Option<Threshold> {
    let solved = run.review.summary.as_ref()?.solved_at?;
    Some(Threshold {
        name: format!("solved: {}", solved.r#return),
        value: solved.r#return,
    })
}

/// Finds a curve's value in a row: not a number where there is none.
type OfRow = fn(&RoundRow) -> f64;

const COLUMNS: [(&str, OfRow); 10] = [
    ("coverage", |row| row.coverage),
    ("visitation evenness", |row| row.visitation_evenness),
    ("effective agents", |row| row.effective_agents),
    ("entropy of the policy, nats", |row| f64::from(row.entropy)),
    ("ratio deviation", |row| f64::from(row.ratio_deviation)),
    ("clipped fraction", |row| f64::from(row.clipped_fraction)),
    ("value loss", |row| f64::from(row.value_loss)),
    ("intrinsic reward of a step", |row| {
        f64::from(row.intrinsic_reward)
    }),
    ("prediction error", |row| f64::from(row.prediction_error)),
    ("agreement on bonuses", |row| {
        row.bonus_agreement.map_or(f64::NAN, f64::from)
    }),
];

/// One panel a column: a line an agent, or of several runs a line a run, the mean of its agents. Columns of zeros are left out.
pub(super) fn updates(runs: &[Drawn], agents: &[u32]) -> Vec<Row> {
    let rows = || runs.iter().flat_map(|run| &run.review.rounds);
    let shown = COLUMNS
        .into_iter()
        .filter(|(_, value)| rows().any(|row| value(row).is_normal()));
    let panels: Vec<Panel> = shown
        .map(|(name, value)| Panel::Curves(of_column(runs, agents, name, value)))
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

fn of_column(runs: &[Drawn], agents: &[u32], name: &str, value: OfRow) -> Curves {
    let series = match runs {
        [run] => {
            let all = (0..run.review.agents() as u32)
                .filter(|agent| agents.is_empty() || agents.contains(agent));
            all.map(|agent| of_agent(run, agent, value)).collect()
        }
        _ => (0..)
            .zip(runs)
            .map(|(index, run)| of_run(run, agent_color(index), value))
            .collect(),
    };
    let mut curves = panel(name, "round", "", series, Vec::new());
    curves.legend = false;
    curves
}

fn of_agent(run: &Drawn, agent: u32, value: OfRow) -> Series {
    let own = run.review.rounds.iter().filter(|row| row.agent == agent);
    let points = known(own.map(|row| [f64::from(row.round), value(row)]));
    Series {
        color: agent_color(agent),
        points,
        ..Series::default()
    }
}

fn of_run(run: &Drawn, color: [u8; 3], value: OfRow) -> Series {
    let rounds = run
        .review
        .rounds
        .chunk_by(|one, next| one.round == next.round);
    let mean = |rows: &[RoundRow]| rows.iter().map(value).sum::<f64>() / rows.len() as f64;
    let points = known(rounds.map(|rows| [f64::from(rows[0].round), mean(rows)]));
    Series {
        color,
        points,
        ..Series::default()
    }
}

fn known(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
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
