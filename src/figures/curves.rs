//! Panels over episodes and rounds: returns, and the columns of `rounds.csv`.

use std::collections::BTreeMap;

use super::progress::Over;
use super::runs::PlottedRun;
use super::settings::FigureSettings;
use crate::plotting::trailing_means;
use crate::record::other_range;
use crate::record::state_files::Learners;
use crate::run::Plan;
use crate::run::facts::FINAL_WINDOW;
use crate::run::facts::metrics::{Metric, Scope, round_metrics_in_display_order};
use crate::text::without_trailing_zeros;
use seedbed_env::Quantity;
use seedbed_figure::color::{
    AGENT_COLORS, OTHERS_COLOR, TEAM_COLOR, categorical_color, series_color,
};
use seedbed_figure::{Color, Curves, Panel, Row, Series, Threshold};

/// A row with one panel of returns. A single run is drawn with one curve per agent and the mean of
/// the team; several runs are drawn with the mean of each team.
pub(super) fn returns_row(runs: &[PlottedRun], agents: &[u32], over: Over) -> Row {
    let panel = match runs {
        [run] => returns_of_agents(run, agents, over),
        _ => returns_of_teams(runs, over),
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

/// An agent in a panel: gray agents first, so that colored ones are drawn on top of them.
struct ShownAgent {
    agent: u32,
    /// Name in the legend; empty if another agent's name stands for it.
    name: String,
    color: Color,
}

/// Colors and names of agents. Up to eight have colors of their own: the first eight that are shown.
/// All others are gray, with one common name.
fn with_colors(shown: &[u32]) -> Vec<ShownAgent> {
    let colored = shown.len().min(AGENT_COLORS as usize);
    let has_listed_colors = shown[..colored].iter().all(|&agent| agent < AGENT_COLORS);
    let gray = shown[colored..]
        .iter()
        .enumerate()
        .map(|(index, &agent)| ShownAgent {
            agent,
            name: if index == 0 {
                "other agents".to_owned()
            } else {
                String::new()
            },
            color: OTHERS_COLOR,
        });
    let named = shown[..colored]
        .iter()
        .zip(0..)
        .map(|(&agent, index)| ShownAgent {
            agent,
            name: format!("agent {agent}"),
            color: categorical_color(if has_listed_colors { agent } else { index }),
        });
    gray.chain(named).collect()
}

fn returns_of_agents(run: &PlottedRun, agents: &[u32], over: Over) -> Curves {
    let learners = learners_in_copies(run).filter(|_| agents.is_empty());
    let (shown, noun) = match learners {
        Some(learners) => ((0..learners.count() as u32).collect(), "learner"),
        None => (shown_agents(run, agents), "agent"),
    };
    let of_learners = learners.map(|learners| learners.returns(&run.loaded_run.episodes));
    let positions = positions(run, over);
    let returns = |agent: u32| match &of_learners {
        Some(returns) => returns[agent as usize].clone(),
        None => run.loaded_run.returns(agent).collect(),
    };
    let is_team = of_learners
        .as_ref()
        .map_or(run.loaded_run.agent_count(), Vec::len)
        > 1;
    let agent_series = |shown: &ShownAgent| Series {
        name: shown.name.replace("agent", noun),
        color: shown.color,
        points: points(&positions[shown.agent as usize], &returns(shown.agent)),
        is_faint: is_team,
        ..Series::default()
    };
    let mut series: Vec<Series> = with_colors(&shown).iter().map(agent_series).collect();
    let name_prefix = if is_team { "team, " } else { "" };
    series.push(team_series(
        run,
        over,
        format!("{name_prefix}mean of {FINAL_WINDOW} episodes"),
        TEAM_COLOR,
    ));
    let thresholds = threshold(run).into_iter().collect();
    panel(
        &format!("returns{}", nan_note(returns_of(&[run]))),
        &over.label_of_returns(noun),
        "return",
        series,
        thresholds,
    )
}

/// The learners of a recorded run, if some act in several copies of the environment: their episodes
/// count, not those of single copies.
fn learners_in_copies(run: &PlottedRun) -> Option<&Learners> {
    let learners = run.loaded_run.learners();
    learners.filter(|learners| learners.have_copies())
}

fn returns_of_teams(runs: &[PlottedRun], over: Over) -> Curves {
    let series = (0..)
        .zip(runs)
        .map(|(index, run)| team_series(run, over, run.label.clone(), series_color(index)))
        .collect();
    let mut thresholds: Vec<Threshold> = runs.iter().filter_map(threshold).collect();
    thresholds.dedup();
    let runs: Vec<&PlottedRun> = runs.iter().collect();
    let title = format!(
        "mean return of each team over {FINAL_WINDOW} episodes{}",
        nan_note(returns_of(&runs))
    );
    panel(
        &title,
        &over.label_of_returns("agent"),
        "return",
        series,
        thresholds,
    )
}

fn returns_of<'a>(runs: &'a [&'a PlottedRun]) -> impl Iterator<Item = f64> + Clone + 'a {
    let rows = runs.iter().flat_map(|run| &run.loaded_run.episodes);
    rows.map(|row| row.r#return)
}

/// What a title says if values are NaN, where curves have gaps, such as ` (NaN 30 %)`.
fn nan_note(values: impl Iterator<Item = f64> + Clone) -> String {
    let nan = values.clone().filter(|value| value.is_nan()).count();
    if nan == 0 {
        return String::new();
    }
    let percent = 100.0 * nan as f64 / values.count() as f64;
    format!(
        " (NaN {} %)",
        without_trailing_zeros(&format!("{percent:.1}"))
    )
}

/// Curve of the mean return over all agents and over the latest `FINAL_WINDOW` episodes of each
/// agent.
fn team_series(run: &PlottedRun, over: Over, name: String, color: [u8; 3]) -> Series {
    let means = trailing_means(&run.loaded_run.team_returns(), FINAL_WINDOW);
    Series {
        name,
        color,
        points: points(&Over::of_team(&positions(run, over)), &means),
        ..Series::default()
    }
}

/// The positions of the episodes of each agent or, where learners act in copies, of each learner.
fn positions(run: &PlottedRun, over: Over) -> Vec<Vec<f64>> {
    match learners_in_copies(run) {
        Some(learners) => over.of_learners(run, learners),
        None => (0..run.loaded_run.agent_count() as u32)
            .map(|agent| over.of_agent(run, agent))
            .collect(),
    }
}

/// Points of a curve.
fn points(positions: &[f64], values: &[f64]) -> Vec<[f64; 2]> {
    let points = positions.iter().zip(values);
    points.map(|(&x, &y)| [x, y]).collect()
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
pub(super) fn metric_rows(
    runs: &[PlottedRun],
    settings: &FigureSettings,
    visits_are_comparable: bool,
    columns: usize,
) -> Vec<Row> {
    let rows = || runs.iter().flat_map(|run| &run.loaded_run.rounds);
    let is_shown = |metric: &&Metric| {
        let mut values = rows().filter_map(|row| metric.value(row));
        metric.plotted && values.any(f64::is_normal)
    };
    let rounds: Vec<RunRounds<'_>> = runs
        .iter()
        .map(|run| RunRounds::new(run, settings.over))
        .collect();
    let panels: Vec<Panel> = round_metrics_in_display_order()
        .into_iter()
        .filter(is_shown)
        .filter(|metric| !metric.is_of_visits() || visits_are_comparable)
        .map(|metric| Panel::Curves(metric_panel(&rounds, settings, metric)))
        .collect();
    let row_of = |panels: &[Panel]| {
        let mut panels = panels.to_vec();
        panels.resize(columns, Panel::Blank);
        Row {
            height: 210.0,
            panels,
            key: None,
        }
    };
    panels.chunks(columns).map(row_of).collect()
}

/// What differs between runs, if measures of visits cannot be compared: they count cells of the display
/// ranges of observations, and the same observations have other ranges.
pub(super) fn other_ranges(runs: &[PlottedRun]) -> Option<String> {
    let with_observations: Vec<(&String, Vec<Quantity>)> = runs
        .iter()
        .filter_map(|run| Some((&run.label, observations(run)?)))
        .collect();
    let ((first, observations), others) = with_observations.split_first()?;
    for (label, of_other) in others {
        if let Some((one, other)) = other_range(observations, of_other) {
            let [range, range_of_first] = [other, one].map(|quantity| {
                let [low, high] = quantity.range;
                format!("{low} to {high}")
            });
            return Some(format!(
                "{} is {range} in {label}, and {range_of_first} in {first}",
                one.name
            ));
        }
    }
    None
}

/// The observations of the recording or, without one, of the task; `None` if they are not known.
fn observations(run: &PlottedRun) -> Option<Vec<Quantity>> {
    if let Some(recording) = &run.loaded_run.recording {
        return Some(recording.observations().to_vec());
    }
    let plan = Plan::of_run(run.loaded_run.folder.as_ref()?).ok()?;
    Some(plan.description.spec().observations.clone())
}

/// A run with the positions of its rounds.
struct RunRounds<'a> {
    run: &'a PlottedRun,
    positions: BTreeMap<u32, f64>,
}

impl<'a> RunRounds<'a> {
    fn new(run: &'a PlottedRun, over: Over) -> Self {
        let positions = over.of_rounds(run);
        Self { run, positions }
    }
}

fn metric_panel(runs: &[RunRounds<'_>], settings: &FigureSettings, metric: &Metric) -> Curves {
    let series = match runs {
        [run] if metric.scope == Scope::Team => {
            vec![metric_of_team(run, "team".to_owned(), TEAM_COLOR, metric)]
        }
        [run] => with_colors(&shown_agents(run.run, &settings.agents))
            .into_iter()
            .map(|shown| metric_of_agent(run, shown, metric))
            .collect(),
        _ => (0..)
            .zip(runs)
            .map(|(index, run)| {
                metric_of_team(run, run.run.label.clone(), series_color(index), metric)
            })
            .collect(),
    };
    let values = series.iter().flat_map(|series| &series.points);
    let title = format!(
        "{}{}",
        metric.label(),
        nan_note(values.map(|point| point[1]))
    );
    let x_label = settings.over.label_of_rounds();
    panel(&title, x_label, "", series, Vec::new())
}

fn metric_of_agent(
    RunRounds { run, positions }: &RunRounds<'_>,
    shown: ShownAgent,
    metric: &Metric,
) -> Series {
    let rows = run
        .loaded_run
        .rounds
        .iter()
        .filter(|row| row.agent == shown.agent);
    let points = rows.filter_map(|row| Some([*positions.get(&row.round)?, metric.value(row)?]));
    Series {
        name: shown.name,
        color: shown.color,
        points: points.collect(),
        ..Series::default()
    }
}

fn metric_of_team(
    RunRounds { run, positions }: &RunRounds<'_>,
    name: String,
    color: Color,
    metric: &Metric,
) -> Series {
    let rounds = run
        .loaded_run
        .rounds
        .chunk_by(|one, next| one.round == next.round);
    let points = rounds.filter_map(|rows| {
        Some([
            *positions.get(&rows[0].round)?,
            metric.team_value_of_round(rows)?,
        ])
    });
    Series {
        name,
        color,
        points: points.collect(),
        ..Series::default()
    }
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
