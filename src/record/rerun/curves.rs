//! `/curves/…`: returns, and the metrics of updates.
//!
//! `/curves/return/agent_K` has one row per episode. `/curves/return/team_mean` and
//! `/curves/return/team_mean_25` have one row per round. All other curves have one row per round,
//! with one value per agent or one value of the team.

use std::collections::VecDeque;
use std::sync::Arc;

use rerun::external::arrow::array::{ArrayRef, Float64Array};
use rerun::log::Chunk;
use rerun::{EntityPath, Scalars, SeriesLines};

use super::error::RecordingError;
use super::rows::{Moment, Moments, grouped_column, rgb, static_chunk};
use crate::run::facts::metrics::{Metric, Scope, round_metrics_in_display_order};
use crate::run::facts::{EpisodeRow, RoundRow};
use seedbed_figure::color::dark::{TEAM_COLOR, agent_color};

/// Number of rows in one chunk.
const ROWS_PER_CHUNK: usize = 256;

/// Number of rounds of the moving average of the team's mean return.
const ROUNDS_OF_MOVING_AVERAGE: usize = 25;

/// Color of the team's mean return in single rounds.
const MUTED_COLOR: [u8; 3] = [120, 120, 130];

/// Metrics of updates that have a curve in recordings, either metrics of agents or metrics of the
/// team.
pub(super) fn recorded_metrics(scope: Scope) -> impl Iterator<Item = &'static Metric> {
    let metrics = round_metrics_in_display_order().into_iter();
    metrics.filter(move |metric| metric.recorded && metric.scope == scope)
}

/// All curves of a run.
#[derive(Clone)]
pub(super) struct Curves {
    returns: Vec<Curve>,
    team_mean: Curve,
    /// Moving average of the team's mean return.
    moving_average: Curve,
    agent_metrics: Vec<Curve>,
    team_metrics: Vec<Curve>,
}

/// One entity with one or more series.
#[derive(Clone)]
struct Curve {
    entity: EntityPath,
    series_count: usize,
    moments: Moments,
    values: Vec<f64>,
}

impl Curves {
    pub(super) fn new(agents: usize) -> Self {
        Self {
            returns: (0..agents)
                .map(|agent| Curve::new(format!("return/agent_{agent}"), 1))
                .collect(),
            team_mean: Curve::new("return/team_mean", 1),
            moving_average: Curve::new(format!("return/team_mean_{ROUNDS_OF_MOVING_AVERAGE}"), 1),
            agent_metrics: recorded_metrics(Scope::Agent)
                .map(|metric| Curve::new(metric.key, agents))
                .collect(),
            team_metrics: recorded_metrics(Scope::Team)
                .map(|metric| Curve::new(metric.key, 1))
                .collect(),
        }
    }

    /// Adds an episode that ended at `end`.
    pub(super) fn add_episode(&mut self, row: &EpisodeRow, end: Moment) {
        self.returns[row.agent as usize].add(end, [row.r#return]);
    }

    /// Adds a round that ended at `end`. `latest_returns` has the team's mean returns of the latest
    /// rounds, to which the mean return of this round is added.
    pub(super) fn add_round(
        &mut self,
        episodes: &[EpisodeRow],
        updates: &[RoundRow],
        end: Moment,
        latest_returns: &mut VecDeque<f64>,
    ) {
        if !episodes.is_empty() {
            self.add_team_return(episodes, end, latest_returns);
        }
        if !updates.is_empty() {
            self.add_metrics(updates, end);
        }
    }

    fn add_team_return(
        &mut self,
        episodes: &[EpisodeRow],
        end: Moment,
        latest_returns: &mut VecDeque<f64>,
    ) {
        let mean = episodes.iter().map(|row| row.r#return).sum::<f64>() / episodes.len() as f64;
        latest_returns.push_back(mean);
        latest_returns.drain(
            ..latest_returns
                .len()
                .saturating_sub(ROUNDS_OF_MOVING_AVERAGE),
        );
        self.team_mean.add(end, [mean]);
        self.moving_average.add(
            end,
            [latest_returns.iter().sum::<f64>() / latest_returns.len() as f64],
        );
    }

    fn add_metrics(&mut self, updates: &[RoundRow], end: Moment) {
        let agent_curves = self.agent_metrics.iter_mut();
        for (curve, metric) in agent_curves.zip(recorded_metrics(Scope::Agent)) {
            // A row has one value per agent. Agents without a value have NaN, which is not drawn.
            let mut values = vec![f64::NAN; curve.series_count];
            let mut is_measured = false;
            for row in updates {
                if let Some(value) = metric.value(row) {
                    values[row.agent as usize] = value;
                    is_measured = true;
                }
            }
            if is_measured {
                curve.add(end, values);
            }
        }
        let team_curves = self.team_metrics.iter_mut();
        for (curve, metric) in team_curves.zip(recorded_metrics(Scope::Team)) {
            if let Some(value) = updates.last().and_then(|row| metric.value(row)) {
                curve.add(end, [value]);
            }
        }
    }

    /// Takes the rows of curves that have enough rows for a chunk or, if `all` is set, the rows of
    /// all curves.
    pub(super) fn take(
        &mut self,
        all: bool,
    ) -> impl Iterator<Item = Result<Chunk, RecordingError>> {
        let min_rows = if all { 1 } else { ROWS_PER_CHUNK };
        let curves = self
            .returns
            .iter_mut()
            .chain([&mut self.team_mean, &mut self.moving_average]);
        let curves = curves
            .chain(&mut self.agent_metrics)
            .chain(&mut self.team_metrics);
        curves
            .filter(move |curve| curve.moments.len() >= min_rows)
            .map(Curve::take)
    }

    /// Names and colors of all curves.
    pub(super) fn styles(&self) -> Result<Vec<Chunk>, RecordingError> {
        let agents = self.returns.len();
        let style_of_agent = |agent: usize| {
            series_style([format!("agent {agent}")], [agent_color(agent as u32)], 1.0)
        };
        let mut styles: Vec<Chunk> = (0..agents)
            .map(|agent| static_chunk(self.returns[agent].entity.clone(), &style_of_agent(agent)))
            .collect::<Result<_, _>>()?;
        let (team_name, moving_average_name) = (
            "team mean".to_owned(),
            format!("team mean of {ROUNDS_OF_MOVING_AVERAGE} rounds"),
        );
        styles.push(static_chunk(
            self.team_mean.entity.clone(),
            &series_style(
                [team_name],
                [if agents > 1 {
                    MUTED_COLOR
                } else {
                    agent_color(0)
                }],
                1.0,
            ),
        )?);
        styles.push(static_chunk(
            self.moving_average.entity.clone(),
            &series_style([moving_average_name], [TEAM_COLOR], 3.0),
        )?);
        for curve in &self.agent_metrics {
            let names = (0..agents).map(|agent| format!("agent {agent}"));
            styles.push(static_chunk(
                curve.entity.clone(),
                &series_style(names, (0..agents as u32).map(agent_color), 1.0),
            )?);
        }
        for curve in &self.team_metrics {
            styles.push(static_chunk(
                curve.entity.clone(),
                &series_style(["team".to_owned()], [TEAM_COLOR], 2.0),
            )?);
        }
        Ok(styles)
    }
}

fn series_style(
    names: impl IntoIterator<Item = String>,
    colors: impl IntoIterator<Item = [u8; 3]>,
    width: f32,
) -> SeriesLines {
    SeriesLines::new()
        .with_names(names)
        .with_colors(colors.into_iter().map(rgb))
        .with_widths([width])
}

impl Curve {
    fn new(name: impl Into<String>, series_count: usize) -> Self {
        let entity = format!("curves/{}", name.into()).into();
        Self {
            entity,
            series_count,
            moments: Moments::default(),
            values: Vec::new(),
        }
    }

    fn add(&mut self, moment: Moment, values: impl IntoIterator<Item = f64>) {
        self.moments.push(moment);
        self.values.extend(values);
    }

    fn take(&mut self) -> Result<Chunk, RecordingError> {
        let values: ArrayRef = Arc::new(Float64Array::from(std::mem::take(&mut self.values)));
        let moments = std::mem::take(&mut self.moments);
        let column = grouped_column(
            Scalars::descriptor_scalars(),
            values,
            vec![self.series_count; moments.len()],
        );
        moments.into_chunk(&self.entity, [column])
    }
}
