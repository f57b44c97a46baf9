//! `/visitation/…`: which states were visited, as parallel coordinates.
//!
//! `/visitation/agent_K/lines` has some states of the latest episodes as lines, `/visitation/agent_K/density` and
//! `/visitation/team/density` all states so far as a picture, `/visitation/axes` what both are drawn on.

use rerun::components::{Colormap, MagnificationFilter, Radius};
use rerun::datatypes::ChannelDatatype;
use rerun::log::Chunk;
use rerun::{DepthImage, EntityPath, LineStrips2D, Points2D};

use super::rows::{Moment, Moments, grouped_column, rgb, single, strips, timeless};
use super::sink::Fault;
use crate::env::Quantity;
use crate::experience::Episode;
use crate::random::Stream;
use crate::record::palette::agent_color;
use crate::record::visitation::{Axes, Density, HEIGHT, pick_states, shade};

/// Episodes whose lines are written as one piece.
const EPISODES_PER_CHUNK: usize = 32;

const AXIS_COLOR: [u8; 3] = [150, 150, 160];
const NAME_COLOR: [u8; 3] = [235, 235, 240];
const END_COLOR: [u8; 3] = [165, 165, 175];

/// The states of one agent: those already counted, and lines that are still to be written.
pub(super) struct Visits {
    entity: EntityPath,
    pub(super) density: Density,
    moments: Moments,
    points: Vec<f32>,
    lines_per_row: Vec<usize>,
    fractions: Vec<f32>,
}

impl Visits {
    pub(super) fn new(agent: usize, density: Density) -> Self {
        let entity = format!("visitation/agent_{agent}").into();
        let (points, lines_per_row, fractions) = (Vec::new(), Vec::new(), Vec::new());
        Self { entity, density, moments: Moments::default(), points, lines_per_row, fractions }
    }

    /// Counts all states of an episode and makes `lines` of them lines, which appear at `end`.
    pub(super) fn add(&mut self, axes: &Axes, episode: &Episode, end: Moment, lines: usize, random: &mut Stream) {
        let states = episode.length() + 1;
        let width = episode.observations.len() / states;
        let picked = pick_states(states, lines, random);
        let mut next = picked.iter().copied().peekable();
        for (step, observation) in episode.observations.chunks_exact(width).enumerate() {
            axes.project(step, observation, &mut self.fractions);
            self.density.add(&self.fractions);
            if next.next_if_eq(&step).is_some() {
                self.points.extend(axes.line(&self.fractions).flatten());
            }
        }
        self.moments.push(end);
        self.lines_per_row.push(picked.len());
    }

    /// Enough lines to be written.
    pub(super) fn is_ready(&self) -> bool {
        self.moments.len() >= EPISODES_PER_CHUNK
    }

    /// All lines that are still to be written.
    pub(super) fn take_lines(&mut self, axes: &Axes) -> Option<Result<Chunk, Fault>> {
        let (moments, points) = (std::mem::take(&mut self.moments), std::mem::take(&mut self.points));
        let lines_per_row = std::mem::take(&mut self.lines_per_row);
        let points_per_line = vec![axes.all().len(); lines_per_row.iter().sum()];
        if points_per_line.is_empty() {
            return None;
        }
        let lines = strips(points, points_per_line);
        let column = grouped_column(LineStrips2D::descriptor_strips(), lines, lines_per_row);
        Some(moments.into_chunk(&lines_of(&self.entity), [column]))
    }

    /// All states so far as a picture.
    pub(super) fn picture(&mut self, axes: &Axes, at: Moment) -> Result<Chunk, Fault> {
        picture(&self.entity, axes, self.density.pixels(), at)
    }

    /// What is true of the agent's lines throughout: from dark, at an episode's start, to bright, at its end.
    pub(super) fn style(&self, agent: u32, lines: u32) -> Result<Chunk, Fault> {
        let color = agent_color(agent).map(f32::from);
        let share = |line: u32| 0.35 + 0.65 * (line + 1) as f32 / lines.max(1) as f32;
        let colors = (0..lines.max(1)).map(|line| rgb(color.map(|channel| (channel * share(line)).min(255.0) as u8)));
        let style = LineStrips2D::update_fields().with_colors(colors).with_radii([Radius::new_ui_points(0.35)]);
        timeless(lines_of(&self.entity), &style)
    }
}

fn lines_of(entity: &EntityPath) -> EntityPath {
    entity.join(&"lines".into())
}

/// The states of the whole team so far as a picture.
pub(super) fn team_picture<'a>(visits: impl Iterator<Item = &'a mut Visits>, axes: &Axes, at: Moment) -> Result<Chunk, Fault> {
    let mut sum = vec![0_u32; axes.width() * HEIGHT];
    for visits in visits {
        for (sum, lines) in sum.iter_mut().zip(visits.density.pixels()) {
            *sum = sum.saturating_add(*lines);
        }
    }
    picture(&"visitation/team".into(), axes, &sum, at)
}

fn picture(entity: &EntityPath, axes: &Axes, pixels: &[u32], at: Moment) -> Result<Chunk, Fault> {
    let size = [axes.width() as u32, HEIGHT as u32];
    let image = DepthImage::from_data_type_and_bytes(shade(pixels), size, ChannelDatatype::U8)
        .with_colormap(Colormap::Inferno)
        .with_depth_range([0.0, 255.0])
        .with_magnification_filter(MagnificationFilter::Linear);
    single(entity.join(&"density".into()), at, &image)
}

/// `/visitation/axes`, with names and ends at `/visitation/axes/labels` and for small views with bare `/visitation/axes/names`.
pub(super) fn furniture(axes: &Axes, wide: Lettering, narrow: Lettering) -> Result<[Chunk; 3], Fault> {
    let stands = (0..axes.all().len()).map(|axis| axes.x(axis));
    let uprights = LineStrips2D::new(stands.map(|x| [[x, 0.0], [x, HEIGHT as f32]]));
    let uprights = uprights.with_colors([rgb(AXIS_COLOR)]).with_radii([Radius::new_ui_points(0.8)]).with_draw_order(50.0);
    Ok([
        timeless("visitation/axes", &uprights)?,
        timeless("visitation/axes/labels", &texts(wide.names(axes).chain(wide.ends(axes))))?,
        timeless("visitation/axes/names", &texts(narrow.names(axes)))?,
    ])
}

/// Words, where they stand, and their colour.
type Label = (String, [f32; 2], [u8; 3]);

fn texts(labels: impl Iterator<Item = Label>) -> Points2D {
    let labels: Vec<Label> = labels.collect();
    Points2D::new(labels.iter().map(|(_, place, _)| *place))
        .with_colors(labels.iter().map(|(_, _, color)| rgb(*color)))
        .with_labels(labels.into_iter().map(|(text, ..)| text))
        .with_radii([Radius::ZERO])
        .with_show_labels(true)
        .with_draw_order(60.0)
}

/// At most three decimals, none of them an idle zero.
fn number(value: f32) -> String {
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Where words stand. Their size is fixed in points of the screen, whereas everything else grows with the view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lettering {
    /// Height of a line of words, in pixels of the density image.
    line: f32,
    /// Whether numbers stand at the ends of the axes.
    with_ends: bool,
    /// Whether units have room beside names.
    with_units: bool,
    /// Whether every other name stands one line higher.
    staggered: bool,
}

impl Lettering {
    /// Points of the screen that a line of words takes.
    pub(super) const LINE: f32 = 19.0;

    /// Points of the screen that a letter takes.
    const LETTER: f32 = 6.7;

    /// For views in which a pixel of the density image is `scale` points of the screen.
    pub(super) fn new(axes: &Axes, scale: f32, with_ends: bool) -> Self {
        let room = (axes.x(1) - axes.x(0)) * scale;
        let widest = |with_units| {
            let letters = axes.all().iter().map(|axis| name(&axis.quantity, with_units).chars().count());
            letters.max().unwrap_or(0) as f32 * Self::LETTER + 8.0
        };
        let with_units = with_ends && widest(true) <= 2.0 * room;
        Self { line: Self::LINE / scale, with_ends, with_units, staggered: widest(with_units) > room }
    }

    fn names(self, axes: &Axes) -> impl Iterator<Item = Label> {
        let below = if self.with_ends { 2.1 } else { 1.05 };
        (0..).zip(axes.all()).map(move |(index, axis)| {
            let lines = if self.staggered && index % 2 == 1 { below + 1.0 } else { below };
            (name(&axis.quantity, self.with_units), [axes.x(index), -lines * self.line], NAME_COLOR)
        })
    }

    fn ends(self, axes: &Axes) -> impl Iterator<Item = Label> {
        let bottom = HEIGHT as f32 + 0.05 * self.line;
        (0..).zip(axes.all()).flat_map(move |(index, axis)| {
            let [low, high] = axis.quantity.range.map(number);
            let x = axes.x(index);
            [(high, [x, -1.05 * self.line], END_COLOR), (low, [x, bottom], END_COLOR)]
        })
    }

    /// What is written, from the uppermost to the lowest end.
    pub(super) fn y_range(self) -> [f64; 2] {
        let above = if self.staggered { 2.2 } else { 1.2 } + if self.with_ends { 1.0 } else { 0.0 };
        let below = if self.with_ends { 1.2 } else { 0.2 };
        [f64::from(-above * self.line), f64::from(HEIGHT as f32 + below * self.line)]
    }
}

fn name(quantity: &Quantity, with_unit: bool) -> String {
    if quantity.unit.is_empty() || !with_unit { quantity.name.clone() } else { format!("{} [{}]", quantity.name, quantity.unit) }
}
