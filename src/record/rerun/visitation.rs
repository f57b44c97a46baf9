//! `/visitation/…`: which states were visited, as parallel coordinates.
//!
//! `/visitation/agent_K/lines` has some states of the latest episodes as lines, `/visitation/agent_K/density` and
//! `/visitation/team/density` all states so far as a picture.

use rerun::components::{Colormap, ImageBuffer, ImageFormat, MagnificationFilter, Radius};
use rerun::datatypes::ChannelDatatype;
use rerun::log::Chunk;
use rerun::{DepthImage, EntityPath, LineStrips2D};

use super::rows::{Moment, Moments, grouped_column, rgb, strips, timeless};
use super::sink::Fault;
use crate::experience::Episode;
use crate::random::Stream;
use crate::record::palette::agent_color;
use crate::record::visitation::{Axes, Density, HEIGHT, pick_states, shade};

/// Episodes whose lines are written as one piece.
const EPISODES_PER_CHUNK: usize = 64;

/// Pictures written as one piece.
const PICTURES_PER_CHUNK: usize = 8;

/// The states of one agent.
pub(super) struct Visits {
    pub(super) density: Density,
    pub(super) lines: Lines,
    pub(super) pictures: Gallery,
    fractions: Vec<f32>,
}

/// Lines that are still to be written.
pub(super) struct Lines {
    entity: EntityPath,
    moments: Moments,
    points: Vec<f32>,
    /// One a row.
    counts: Vec<usize>,
}

/// Pictures that are still to be written.
pub(super) struct Gallery {
    entity: EntityPath,
    moments: Moments,
    pictures: Vec<ImageBuffer>,
}

impl Visits {
    pub(super) fn new(agent: usize, density: Density) -> Self {
        let entity = EntityPath::from(format!("visitation/agent_{agent}"));
        Self { density, lines: Lines::new(&entity), pictures: Gallery::new(&entity), fractions: Vec::new() }
    }

    /// Counts all states of an episode and makes `lines` of them lines, which appear at `end`.
    pub(super) fn add(&mut self, axes: &Axes, episode: &Episode, end: Moment, lines: usize, random: &mut Stream) {
        let states = episode.length() + 1;
        let width = episode.observations.len() / states;
        let picked = pick_states(states, lines, random);
        let mut next = picked.iter().copied().peekable();
        for (step, observation) in episode.observations.chunks_exact(width).enumerate() {
            // Nothing follows the last state, so that it has no bonus.
            let bonus = episode.intrinsic_rewards.get(step).copied().unwrap_or(0.0);
            axes.project(step, observation, bonus, &mut self.fractions);
            self.density.add(&self.fractions);
            if next.next_if_eq(&step).is_some() {
                self.lines.points.extend(axes.line(&self.fractions).flatten());
            }
        }
        self.lines.moments.push(end);
        self.lines.counts.push(picked.len());
    }

    /// Pictures all states so far.
    pub(super) fn picture(&mut self, at: Moment) {
        self.pictures.hang(self.density.pixels(), at);
    }

    /// What is true throughout.
    pub(super) fn styles(&self, axes: &Axes, agent: u32, lines_per_row: u32) -> Result<[Chunk; 2], Fault> {
        Ok([self.lines.style(agent, lines_per_row)?, self.pictures.style(axes)?])
    }
}

impl Lines {
    fn new(entity: &EntityPath) -> Self {
        let entity = entity.join(&"lines".into());
        Self { entity, moments: Moments::default(), points: Vec::new(), counts: Vec::new() }
    }

    /// If there are enough for a piece, or any and all are wanted.
    pub(super) fn take(&mut self, axes: &Axes, all: bool) -> Option<Result<Chunk, Fault>> {
        if !all && self.moments.len() < EPISODES_PER_CHUNK {
            return None;
        }
        let (moments, points) = (std::mem::take(&mut self.moments), std::mem::take(&mut self.points));
        let lines_per_row = std::mem::take(&mut self.counts);
        let points_per_line = vec![axes.all().len(); lines_per_row.iter().sum()];
        if points_per_line.is_empty() {
            return None;
        }
        let column = grouped_column(LineStrips2D::descriptor_strips(), strips(points, points_per_line), lines_per_row);
        Some(moments.into_chunk(&self.entity, [column]))
    }

    /// From dark, at an episode's start, to bright, at its end.
    fn style(&self, agent: u32, lines: u32) -> Result<Chunk, Fault> {
        let color = agent_color(agent).map(f32::from);
        let share = |line: u32| 0.35 + 0.65 * (line + 1) as f32 / lines.max(1) as f32;
        let colors = (0..lines.max(1)).map(|line| rgb(color.map(|channel| (channel * share(line)).min(255.0) as u8)));
        let style = LineStrips2D::update_fields().with_colors(colors).with_radii([Radius::new_ui_points(0.35)]);
        timeless(self.entity.clone(), &style)
    }
}

impl Gallery {
    fn new(entity: &EntityPath) -> Self {
        Self { entity: entity.join(&"density".into()), moments: Moments::default(), pictures: Vec::new() }
    }

    /// For the states of the whole team.
    pub(super) fn of_team() -> Self {
        Self::new(&"visitation/team".into())
    }

    /// Adds a picture of all states so far: `pixels` counts the lines over each pixel.
    fn hang(&mut self, pixels: &[u32], at: Moment) {
        self.moments.push(at);
        self.pictures.push(shade(pixels).into());
    }

    /// Likewise, of the whole team.
    pub(super) fn hang_sum<'a>(&mut self, axes: &Axes, visits: impl Iterator<Item = &'a mut Visits>, at: Moment) {
        let mut sum = vec![0_u32; axes.width() * HEIGHT];
        for visits in visits {
            for (sum, lines) in sum.iter_mut().zip(visits.density.pixels()) {
                *sum = sum.saturating_add(*lines);
            }
        }
        self.hang(&sum, at);
    }

    /// If there are enough for a piece, or any and all are wanted.
    pub(super) fn take(&mut self, all: bool) -> Option<Result<Chunk, Fault>> {
        let least = if all { 1 } else { PICTURES_PER_CHUNK };
        if self.pictures.len() < least {
            return None;
        }
        let (moments, pictures) = (std::mem::take(&mut self.moments), std::mem::take(&mut self.pictures));
        let columns = DepthImage::update_fields().with_many_buffer(pictures).columns_of_unit_batches();
        let columns = columns.map_err(|error| error.to_string());
        Some(columns.and_then(|columns| moments.into_chunk(&self.entity, columns.collect::<Vec<_>>())))
    }

    pub(super) fn style(&self, axes: &Axes) -> Result<Chunk, Fault> {
        let format = ImageFormat::depth([axes.width() as u32, HEIGHT as u32], ChannelDatatype::U8);
        let style = DepthImage::update_fields()
            .with_format(format)
            .with_colormap(Colormap::Inferno)
            .with_depth_range([0.0, 255.0])
            .with_magnification_filter(MagnificationFilter::Linear);
        timeless(self.entity.clone(), &style)
    }
}
