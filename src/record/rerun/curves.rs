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
use crate::record::metrics::{Metric, Scope, columns_in_display_order};
use crate::record::{EpisodeRow, RoundRow};
use seedbed_figure::color::dark::categorical_color;

/// Number of rows in one chunk.
const ROWS_PER_CHUNK: usize = 256;

/// Number of rounds of the moving average of the team's mean return.
const ROUNDS_OF_MOVING_AVERAGE: usize = 25;

/// Color of curves of the team.
const TEAM_COLOR: [u8; 3] = [255; 3];
const MUTED_COLOR: [u8; 3] = [120, 120, 130];

/// Metrics of updates that have a curve in recordings, either metrics of agents or metrics of the
/// team.
pub(super) fn metrics(scope: Scope) -> impl Iterator<Item = &'static Metric> {
    let metrics = columns_in_display_order().into_iter();
    metrics.filter(move |metric| metric.recorded && metric.scope == scope)
}

/// All curves of a run.
pub(super) struct Curves {
    returns: Vec<Curve>,
    team_mean: Curve,
    smooth_mean: Curve,
    updates: Vec<Curve>,
    team: Vec<Curve>,
}

/// One entity with one or more series.
struct Curve {
    entity: EntityPath,
    series: usize,
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
            smooth_mean: Curve::new(format!("return/team_mean_{ROUNDS_OF_MOVING_AVERAGE}"), 1),
            updates: metrics(Scope::Agent)
                .map(|metric| Curve::new(metric.key, agents))
                .collect(),
            team: metrics(Scope::Team)
                .map(|metric| Curve::new(metric.key, 1))
                .collect(),
        }
    }

    /// Adds an episode that ended at `end`.
    pub(super) fn add_episode(&mut self, row: &EpisodeRow, end: Moment) {
        self.returns[row.agent as usize].add(end, [row.r#return]);
    }

    /// Adds a round that ended at `end`.
    pub(super) fn add_round(
        &mut self,
        episodes: &[EpisodeRow],
        rounds: &[RoundRow],
        end: Moment,
        latest_returns: &mut VecDeque<f64>,
    ) {
        if !episodes.is_empty() {
            let mean = episodes.iter().map(|row| row.r#return).sum::<f64>() / episodes.len() as f64;
            latest_returns.push_back(mean);
            latest_returns.drain(
                ..latest_returns
                    .len()
                    .saturating_sub(ROUNDS_OF_MOVING_AVERAGE),
            );
            self.team_mean.add(end, [mean]);
            self.smooth_mean.add(
                end,
                [latest_returns.iter().sum::<f64>() / latest_returns.len() as f64],
            );
        }
        if rounds.is_empty() {
            return;
        }
        for (curve, metric) in self.updates.iter_mut().zip(metrics(Scope::Agent)) {
            // A row has one value per agent. Agents without a value have NaN, which is not drawn.
            let mut values = vec![f64::NAN; curve.series];
            let mut is_measured = false;
            for row in rounds {
                if let Some(value) = metric.value(row) {
                    values[row.agent as usize] = value;
                    is_measured = true;
                }
            }
            if is_measured {
                curve.add(end, values);
            }
        }
        for (curve, metric) in self.team.iter_mut().zip(metrics(Scope::Team)) {
            if let Some(value) = rounds.last().and_then(|row| metric.value(row)) {
                curve.add(end, [value]);
            }
        }
    }

    /// Takes the rows of curves that have enough for a chunk or, if `all` is set, of all curves.
    pub(super) fn take(
        &mut self,
        all: bool,
    ) -> impl Iterator<Item = Result<Chunk, RecordingError>> {
        let min_rows = if all { 1 } else { ROWS_PER_CHUNK };
        let curves = self
            .returns
            .iter_mut()
            .chain([&mut self.team_mean, &mut self.smooth_mean]);
        let curves = curves.chain(&mut self.updates).chain(&mut self.team);
        curves
            .filter(move |curve| curve.moments.len() >= min_rows)
            .map(Curve::take)
    }

    /// Names and colors of all curves.
    pub(super) fn styles(&self) -> Result<Vec<Chunk>, RecordingError> {
        let agents = self.returns.len();
        let style_of_agent = |agent: usize| series([format!("agent {agent}")], [color(agent)], 1.0);
        let mut styles: Vec<Chunk> = (0..agents)
            .map(|agent| static_chunk(self.returns[agent].entity.clone(), &style_of_agent(agent)))
            .collect::<Result<_, _>>()?;
        let (team, moving_average) = (
            "team mean".to_owned(),
            format!("team mean of {ROUNDS_OF_MOVING_AVERAGE} rounds"),
        );
        styles.push(static_chunk(
            self.team_mean.entity.clone(),
            &series(
                [team],
                [if agents > 1 { MUTED_COLOR } else { color(0) }],
                1.0,
            ),
        )?);
        styles.push(static_chunk(
            self.smooth_mean.entity.clone(),
            &series([moving_average], [TEAM_COLOR], 3.0),
        )?);
        for update in &self.updates {
            let names = (0..agents).map(|agent| format!("agent {agent}"));
            styles.push(static_chunk(
                update.entity.clone(),
                &series(names, (0..agents).map(color), 1.0),
            )?);
        }
        for curve in &self.team {
            styles.push(static_chunk(
                curve.entity.clone(),
                &series(["team".to_owned()], [TEAM_COLOR], 2.0),
            )?);
        }
        Ok(styles)
    }
}

fn series(
    names: impl IntoIterator<Item = String>,
    colors: impl IntoIterator<Item = [u8; 3]>,
    width: f32,
) -> SeriesLines {
    SeriesLines::new()
        .with_names(names)
        .with_colors(colors.into_iter().map(rgb))
        .with_widths([width])
}

fn color(agent: usize) -> [u8; 3] {
    categorical_color(agent as u32)
}

impl Curve {
    fn new(name: impl Into<String>, series: usize) -> Self {
        let entity = format!("curves/{}", name.into()).into();
        Self {
            entity,
            series,
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
            vec![self.series; moments.len()],
        );
        moments.into_chunk(&self.entity, [column])
    }
}
