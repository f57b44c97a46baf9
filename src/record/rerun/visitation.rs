//! `/visitation/agent_K/lines` and `/pairs/agent_K/states`: some states of the latest episodes, as lines in parallel coordinates and as
//! points in plots of pairs. Those of the team are fewer of each agent, on top of each other.

use std::sync::Arc;

use rerun::components::Radius;
use rerun::external::arrow::array::{ArrayRef, FixedSizeListArray, Float32Array, UInt32Array};
use rerun::external::arrow::datatypes::{DataType, Field};
use rerun::log::Chunk;
use rerun::{EntityPath, LineStrips2D, Points2D, SerializedComponentColumn};

use super::rows::{Moment, Moments, grouped_column, rgb, strips, timeless};
use super::sink::Fault;
use crate::experience::Episode;
use crate::random::Stream;
use crate::record::palette::agent_color;
use crate::record::visitation::{Axes, Colouring, Pairs, Seen, Visited, pick_states};

/// Episodes that are written as one piece.
const EPISODES_PER_CHUNK: usize = 64;

/// How states are drawn.
pub(super) struct Drawing {
    pub(super) axes: Axes,
    pub(super) pairs: Pairs,
    pub(super) colouring: Colouring,
}

/// Some states of one agent or of the team, as lines and as points.
pub(super) struct Sample {
    lines: Marks,
    points: Marks,
}

/// Marks of one entity that are still to be written.
struct Marks {
    entity: EntityPath,
    moments: Moments,
    coordinates: Vec<f32>,
    /// One a state; none where agents have their own.
    colors: Vec<u32>,
    /// States a row.
    counts: Vec<usize>,
}

/// How many states of an episode are picked for its agent and for the team.
#[derive(Clone, Copy)]
pub(super) struct Wanted {
    pub(super) of_agent: usize,
    pub(super) of_team: usize,
}

impl Drawing {
    /// Counts all states of an episode, and picks some for the samples of its agent and of the team, which appear at `end`.
    pub(super) fn add(
        &self,
        episode: &Episode,
        end: Moment,
        visited: &mut Visited,
        [own, team]: [&mut Sample; 2],
        wanted: Wanted,
        random: &mut Stream,
    ) {
        let states = episode.length() + usize::from(!self.axes.show_actions());
        let picked = pick_states(states, wanted.of_agent, random);
        let shared = pick_states(picked.len(), wanted.of_team.min(picked.len()), random);
        let (mut fractions, mut next) = (Vec::new(), picked.iter().enumerate().peekable());
        for (step, seen) in Seen::all(episode).take(states).enumerate() {
            self.axes.project(&seen, &mut fractions);
            visited.add(&fractions, &self.pairs, &seen);
            if let Some((place, _)) = next.next_if(|(_, picked)| **picked == step) {
                let color = self.colouring.color(episode, &seen);
                own.draw(self, &seen, &fractions, color);
                if shared.binary_search(&place).is_ok() {
                    team.draw(
                        self,
                        &seen,
                        &fractions,
                        Some(color.unwrap_or_else(|| agent_color(episode.agent))),
                    );
                }
            }
        }
        own.end(picked.len(), end);
        team.end(shared.len(), end);
    }
}

impl Sample {
    pub(super) fn new(who: &str) -> Self {
        Self {
            lines: Marks::new(format!("visitation/{who}/lines")),
            points: Marks::new(format!("pairs/{who}/states")),
        }
    }

    fn draw(
        &mut self,
        drawing: &Drawing,
        seen: &Seen<'_>,
        fractions: &[f32],
        color: Option<[u8; 3]>,
    ) {
        self.lines
            .coordinates
            .extend(drawing.axes.line(fractions).flatten());
        self.points
            .coordinates
            .extend(drawing.pairs.points(seen).flatten());
        let color = color.map(|color| rgb(color).to_u32());
        self.lines.colors.extend(color);
        self.points.colors.extend(
            color
                .into_iter()
                .flat_map(|color| vec![color; drawing.pairs.panels().len()]),
        );
    }

    fn end(&mut self, states: usize, at: Moment) {
        for marks in [&mut self.lines, &mut self.points] {
            marks.moments.push(at);
            marks.counts.push(states);
        }
    }

    /// If there are enough for a piece, or any and all are wanted.
    pub(super) fn take(&mut self, drawing: &Drawing, all: bool) -> Result<Vec<Chunk>, Fault> {
        if !all && self.lines.moments.len() < EPISODES_PER_CHUNK {
            return Ok(Vec::new());
        }
        let (axes, panels) = (drawing.axes.all().len(), drawing.pairs.panels().len());
        let line = |coordinates, states| {
            (
                LineStrips2D::descriptor_strips(),
                strips(coordinates, vec![axes; states]),
            )
        };
        let point = |coordinates, _| (Points2D::descriptor_positions(), positions(coordinates));
        let lines = self.lines.take(1, LineStrips2D::descriptor_colors(), line);
        let points = self
            .points
            .take(panels, Points2D::descriptor_colors(), point);
        lines.into_iter().chain(points).collect()
    }

    /// What is true throughout. Where agents have their own colours: from dark, at an episode's start, to bright, at its end.
    pub(super) fn styles(
        &self,
        agent: Option<u32>,
        states_per_row: u32,
        panels: usize,
    ) -> Result<[Chunk; 2], Fault> {
        let states = states_per_row.max(1);
        let share = |state: u32| 0.35 + 0.65 * (state + 1) as f32 / states as f32;
        let faded = |agent: u32, state: u32| {
            agent_color(agent).map(|channel| (f32::from(channel) * share(state)).min(255.0) as u8)
        };
        let colors: Vec<_> = agent
            .into_iter()
            .flat_map(|agent| (0..states).map(move |state| rgb(faded(agent, state))))
            .collect();
        let lines = LineStrips2D::update_fields().with_radii([Radius::new_ui_points(0.35)]);
        let points = Points2D::update_fields().with_radii([Radius::new_ui_points(1.2)]);
        if colors.is_empty() {
            return Ok([
                timeless(self.lines.entity.clone(), &lines)?,
                timeless(self.points.entity.clone(), &points)?,
            ]);
        }
        let of_points = colors
            .iter()
            .flat_map(|color| vec![*color; panels])
            .collect::<Vec<_>>();
        Ok([
            timeless(self.lines.entity.clone(), &lines.with_colors(colors))?,
            timeless(self.points.entity.clone(), &points.with_colors(of_points))?,
        ])
    }
}

impl Marks {
    fn new(entity: String) -> Self {
        let (coordinates, colors, counts) = (Vec::new(), Vec::new(), Vec::new());
        Self {
            entity: entity.into(),
            moments: Moments::default(),
            coordinates,
            colors,
            counts,
        }
    }

    /// A state makes `marks` marks.
    fn take(
        &mut self,
        marks: usize,
        color: rerun::ComponentDescriptor,
        shapes: impl FnOnce(Vec<f32>, usize) -> (rerun::ComponentDescriptor, ArrayRef),
    ) -> Option<Result<Chunk, Fault>> {
        let (moments, colors) = (
            std::mem::take(&mut self.moments),
            std::mem::take(&mut self.colors),
        );
        let counts: Vec<usize> = std::mem::take(&mut self.counts)
            .into_iter()
            .map(|states| states * marks)
            .collect();
        let states = counts.iter().sum::<usize>() / marks.max(1);
        let coordinates = std::mem::take(&mut self.coordinates);
        if coordinates.is_empty() {
            return None;
        }
        let (name, shapes) = shapes(coordinates, states);
        let colored = (!colors.is_empty())
            .then(|| grouped_column(color, Arc::new(UInt32Array::from(colors)), counts.clone()));
        let columns: Vec<SerializedComponentColumn> = [grouped_column(name, shapes, counts)]
            .into_iter()
            .chain(colored)
            .collect();
        Some(moments.into_chunk(&self.entity, columns))
    }
}

/// 2D points, as the components of points want them.
fn positions(coordinates: Vec<f32>) -> ArrayRef {
    let number = Field::new("item", DataType::Float32, false);
    Arc::new(FixedSizeListArray::new(
        number.into(),
        2,
        Arc::new(Float32Array::from(coordinates)),
        None,
    ))
}
