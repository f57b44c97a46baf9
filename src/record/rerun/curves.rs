//! `/curves/…`: how returns grew and what the updates were like.
//!
//! `/curves/return/agent_K` has a row an episode, `/curves/return/team_mean` and `/curves/return/team_mean_25` a row a round;
//! the others have a row a round with one number for each agent, or one for the team.

use std::collections::VecDeque;
use std::sync::Arc;

use rerun::external::arrow::array::{ArrayRef, Float64Array};
use rerun::log::Chunk;
use rerun::{EntityPath, Scalars, SeriesLines};

use super::rows::{Moment, Moments, grouped_column, rgb, timeless};
use super::sink::Fault;
use crate::record::palette::agent_color;
use crate::record::{EpisodeRow, RoundRow};

/// Rows written as one piece.
const ROWS_PER_CHUNK: usize = 256;

/// Rounds over which the smooth curve of returns is averaged.
const SMOOTH: usize = 25;

/// The team's mean return is drawn like this.
const TEAM_COLOR: [u8; 3] = [255; 3];
const PALE_COLOR: [u8; 3] = [120, 120, 130];

/// Finds a curve's value in a row.
type OfRow = fn(&RoundRow) -> f64;

/// What is drawn of each update: its entity and where it is found.
pub(super) const UPDATE_CURVES: [(&str, OfRow); 11] = [
    ("coverage", |row| row.coverage),
    ("visitation_entropy", |row| row.visitation_entropy),
    ("entropy", |row| f64::from(row.entropy)),
    ("intrinsic_reward", |row| f64::from(row.intrinsic_reward)),
    ("prediction_error", |row| f64::from(row.prediction_error)),
    ("bonus_agreement", |row| {
        row.bonus_agreement.map_or(f64::NAN, f64::from)
    }),
    ("ratio_deviation", |row| f64::from(row.ratio_deviation)),
    ("largest_ratio", |row| f64::from(row.largest_ratio)),
    ("clipped_fraction", |row| f64::from(row.clipped_fraction)),
    ("value_loss", |row| f64::from(row.value_loss)),
    ("policy_loss", |row| f64::from(row.policy_loss)),
];

/// What is drawn of the team at each update: one number for all agents.
pub(super) const TEAM_CURVES: [(&str, OfRow); 3] = [
    ("team_coverage", |row| row.team_coverage),
    ("team_overlap", |row| row.team_overlap),
    ("effective_agents", |row| row.effective_agents),
];

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
            smooth_mean: Curve::new(format!("return/team_mean_{SMOOTH}"), 1),
            updates: UPDATE_CURVES
                .iter()
                .map(|(name, _)| Curve::new(*name, agents))
                .collect(),
            team: TEAM_CURVES
                .iter()
                .map(|(name, _)| Curve::new(*name, 1))
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
        latest: &mut VecDeque<f64>,
    ) {
        if !episodes.is_empty() {
            let mean = episodes.iter().map(|row| row.r#return).sum::<f64>() / episodes.len() as f64;
            latest.push_back(mean);
            latest.drain(..latest.len().saturating_sub(SMOOTH));
            self.team_mean.add(end, [mean]);
            self.smooth_mean
                .add(end, [latest.iter().sum::<f64>() / latest.len() as f64]);
        }
        if rounds.is_empty() {
            return;
        }
        for (curve, (_, value)) in self.updates.iter_mut().zip(UPDATE_CURVES) {
            let mut values = vec![f64::NAN; curve.series];
            for row in rounds {
                values[row.agent as usize] = value(row);
            }
            curve.add(end, values);
        }
        for (curve, (_, value)) in self.team.iter_mut().zip(TEAM_CURVES) {
            curve.add(end, rounds.last().map(value).or(Some(f64::NAN)));
        }
    }

    /// Those with enough rows to be written, or all that have any.
    pub(super) fn take(&mut self, all: bool) -> impl Iterator<Item = Result<Chunk, Fault>> {
        let least = if all { 1 } else { ROWS_PER_CHUNK };
        let curves = self
            .returns
            .iter_mut()
            .chain([&mut self.team_mean, &mut self.smooth_mean]);
        let curves = curves.chain(&mut self.updates).chain(&mut self.team);
        curves
            .filter(move |curve| curve.moments.len() >= least)
            .map(Curve::take)
    }

    /// Names and colours.
    pub(super) fn styles(&self) -> Result<Vec<Chunk>, Fault> {
        let agents = self.returns.len();
        let of_agent = |agent: usize| series([format!("agent {agent}")], [color(agent)], 1.0);
        let mut styles: Vec<Chunk> = (0..agents)
            .map(|agent| timeless(self.returns[agent].entity.clone(), &of_agent(agent)))
            .collect::<Result<_, _>>()?;
        let (team, smooth) = (
            "team mean".to_owned(),
            format!("team mean of {SMOOTH} rounds"),
        );
        styles.push(timeless(
            self.team_mean.entity.clone(),
            &series(
                [team],
                [if agents > 1 { PALE_COLOR } else { color(0) }],
                1.0,
            ),
        )?);
        styles.push(timeless(
            self.smooth_mean.entity.clone(),
            &series([smooth], [TEAM_COLOR], 3.0),
        )?);
        for update in &self.updates {
            let names = (0..agents).map(|agent| format!("agent {agent}"));
            styles.push(timeless(
                update.entity.clone(),
                &series(names, (0..agents).map(color), 1.0),
            )?);
        }
        for curve in &self.team {
            styles.push(timeless(
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
    agent_color(agent as u32)
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

    fn add(&mut self, at: Moment, values: impl IntoIterator<Item = f64>) {
        self.moments.push(at);
        self.values.extend(values);
    }

    fn take(&mut self) -> Result<Chunk, Fault> {
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
