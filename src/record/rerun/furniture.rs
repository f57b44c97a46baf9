//! What stands around pictures of visited states and never changes: upright axes, panels of pairs, their names, units and ends, whose
//! picture it is, and bars of colours.

use rerun::components::Radius;
use rerun::log::Chunk;
use rerun::{LineStrips2D, Points2D};

use super::rows::{rgb, timeless};
use super::sink::Fault;
use super::tiles::{Bar, LETTER, Room, Tiles, Words};
use crate::env::Quantity;
use crate::record::palette::agent_color;
use crate::record::visitation::{Axes, CELLS, HEIGHT, Pairs};

const AXIS_COLOR: [u8; 3] = [150, 150, 160];
const NAME_COLOR: [u8; 3] = [235, 235, 240];
const END_COLOR: [u8; 3] = [165, 165, 175];

/// Points of the screen on either side of a picture with names.
const BESIDE: f32 = 34.0;

/// With more pictures in a view than this, names and ends stand beside the team's picture only.
pub(super) const NAMED: u32 = 4;

/// Words, where they stand, and their colour.
pub(super) type Label = (String, [f32; 2], [u8; 3]);

/// Pictures that share a view, and what is written around each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wall {
    pub(super) tiles: Tiles,
    /// Whether each picture says whose it is.
    tagged: bool,
    /// Whether names and ends are written.
    named: bool,
    /// Whether every other name stands one line higher.
    staggered: bool,
    /// Lines of names and ends above a picture.
    names: f32,
}

impl Wall {
    /// For `agents` pictures in parallel coordinates, or one of the whole team.
    pub(super) fn of_axes(axes: &Axes, agents: Option<u32>, room: Room) -> Self {
        let size = [axes.width() as f32, HEIGHT as f32];
        let named = |names| {
            Self::new(
                agents,
                size,
                Room {
                    overhang: overhang(axes),
                    ..room
                },
                [names, 8.0],
                3.3,
            )
        };
        let plain = if agents.unwrap_or(1) <= NAMED {
            named(2.2)
        } else {
            Self::new(agents, size, room, [2.2, 8.0], 3.3)
        };
        let crowded = plain.named
            && (axes.x(1) - axes.x(0)) * plain.tiles.zoom < widest(axes, plain.units(axes));
        if crowded {
            Self {
                staggered: true,
                ..named(3.2)
            }
        } else {
            plain
        }
    }

    /// For `agents` rows of panels, or one row of the whole team.
    pub(super) fn of_pairs(pairs: &Pairs, agents: Option<u32>, room: Room) -> Self {
        Self::new(
            agents,
            [pairs.width() as f32, CELLS as f32],
            room,
            [1.2, 28.0],
            2.2,
        )
    }

    /// `names` lines of words above each picture; without names, `beside` points of the screen keep neighbours apart. `key` lines below
    /// the scale.
    fn new(
        agents: Option<u32>,
        size: [f32; 2],
        room: Room,
        [names, beside]: [f32; 2],
        key: f32,
    ) -> Self {
        let count = agents.unwrap_or(1);
        let (tagged, named) = (agents.is_some_and(|agents| agents > 1), count <= NAMED);
        let names = if named { names } else { 0.2 };
        let above = names + if tagged { 1.0 } else { 0.0 };
        let words = Words {
            above,
            below: if named { 1.3 } else { 0.4 },
            beside: if named { BESIDE } else { beside },
            key,
        };
        Self {
            tiles: Tiles::new(count, size, room, words),
            tagged,
            named,
            staggered: false,
            names,
        }
    }

    /// The upright axes and their words, at `entity` and below.
    pub(super) fn axes(&self, entity: &str, axes: &Axes) -> Result<[Chunk; 2], Fault> {
        let stands: Vec<f32> = (0..axes.all().len()).map(|axis| axes.x(axis)).collect();
        let upright = |[left, top]: [f32; 2]| {
            stands
                .iter()
                .map(move |x| vec![[left + x, top], [left + x, top + HEIGHT as f32]])
        };
        let lines: Vec<Vec<[f32; 2]>> = self.tiles.corners().flat_map(upright).collect();
        let words = self
            .tiles
            .corners()
            .flat_map(|corner| self.axis_words(axes, corner));
        self.furnished(entity, &lines, words.collect())
    }

    /// The panels and their words, at `entity` and below.
    pub(super) fn panels(&self, entity: &str, pairs: &Pairs) -> Result<[Chunk; 2], Fault> {
        let side = CELLS as f32;
        let panel = |[left, top]: [f32; 2], x: f32| {
            let (left, right, bottom) = (left + x, left + x + side, top + side);
            vec![
                [left, top],
                [right, top],
                [right, bottom],
                [left, bottom],
                [left, top],
            ]
        };
        let row = |corner: [f32; 2]| {
            (0..pairs.panels().len()).map(move |index| panel(corner, pairs.x(index) as f32))
        };
        let lines: Vec<Vec<[f32; 2]>> = self.tiles.corners().flat_map(row).collect();
        let words = self
            .tiles
            .corners()
            .flat_map(|corner| self.panel_words(pairs, corner));
        self.furnished(entity, &lines, words.collect())
    }

    fn furnished(
        &self,
        entity: &str,
        lines: &[Vec<[f32; 2]>],
        mut words: Vec<Label>,
    ) -> Result<[Chunk; 2], Fault> {
        if self.tagged {
            words.extend(
                self.tiles
                    .corners()
                    .zip(0..)
                    .map(|(corner, agent)| self.tag(corner, agent)),
            );
        }
        let lines = LineStrips2D::new(lines)
            .with_colors([rgb(AXIS_COLOR)])
            .with_radii([Radius::new_ui_points(0.6)]);
        Ok([
            timeless(entity, &lines.with_draw_order(50.0))?,
            timeless(format!("{entity}/labels"), &texts(words))?,
        ])
    }

    /// Whose picture it is, at its upper left corner.
    fn tag(&self, [left, top]: [f32; 2], agent: u32) -> Label {
        let text = format!("agent {agent}");
        let half = 0.5 * text.len() as f32 * LETTER / self.tiles.zoom;
        (
            text,
            [left + half, top - (self.names + 0.9) * self.tiles.line()],
            agent_color(agent),
        )
    }

    fn axis_words(&self, axes: &Axes, [left, top]: [f32; 2]) -> Vec<Label> {
        let (line, units) = (self.tiles.line(), self.units(axes));
        let words = |(index, axis): (usize, &crate::record::visitation::Axis)| {
            let x = left + axes.x(index);
            let lines = if self.staggered && index % 2 == 1 {
                3.1
            } else {
                2.1
            };
            let [low, high] = axis.quantity.range.map(number);
            let bottom = top + HEIGHT as f32 + 0.05 * line;
            [
                (
                    name(&axis.quantity, units),
                    [x, top - lines * line],
                    NAME_COLOR,
                ),
                (high, [x, top - 1.05 * line], END_COLOR),
                (low, [x, bottom], END_COLOR),
            ]
        };
        if self.named {
            axes.all().iter().enumerate().flat_map(words).collect()
        } else {
            Vec::new()
        }
    }

    /// Whether units have room beside the names of axes.
    fn units(&self, axes: &Axes) -> bool {
        widest(axes, true) <= 2.0 * (axes.x(1) - axes.x(0)) * self.tiles.zoom
    }

    fn panel_words(&self, pairs: &Pairs, [left, top]: [f32; 2]) -> Vec<Label> {
        let (line, side) = (self.tiles.line(), CELLS as f32);
        let room = (pairs.x(1) as f32 * self.tiles.zoom / LETTER) as usize;
        let words = |(index, [across, upwards]): (usize, &[crate::record::visitation::Axis; 2])| {
            let middle = left + pairs.x(index) as f32 + 0.5 * side;
            [
                (
                    described(&upwards.quantity, "↑", room),
                    [middle, top - 1.05 * line],
                    NAME_COLOR,
                ),
                (
                    described(&across.quantity, "→", room),
                    [middle, top + side + 0.05 * line],
                    NAME_COLOR,
                ),
            ]
        };
        if self.named {
            pairs.panels().iter().enumerate().flat_map(words).collect()
        } else {
            Vec::new()
        }
    }
}

/// Points of the screen that the longest name takes.
fn widest(axes: &Axes, with_units: bool) -> f32 {
    let letters = axes
        .all()
        .iter()
        .map(|axis| name(&axis.quantity, with_units).chars().count());
    letters.max().unwrap_or(0) as f32 * LETTER + 8.0
}

/// Points of the screen by which the last axis' name reaches beyond the room beside a picture.
fn overhang(axes: &Axes) -> f32 {
    let letters = axes
        .all()
        .last()
        .map_or(0, |axis| name(&axis.quantity, true).chars().count());
    (0.5 * letters as f32 * LETTER - BESIDE).max(0.0)
}

/// An upright bar with the colours of a scale at `entity`, its words below.
pub(super) fn scale(
    entity: &str,
    bar: &Bar,
    color: impl Fn(f32) -> [u8; 3],
    words: Vec<Label>,
) -> Result<[Chunk; 2], Fault> {
    let [left, right] = bar.x;
    let lines = LineStrips2D::new(bar.steps().map(|(y, _)| [[left, y], [right, y]]));
    let lines = lines.with_colors(bar.steps().map(|(_, share)| rgb(color(share))));
    let lines = lines
        .with_radii([Radius::new_scene_units(bar.half_step())])
        .with_draw_order(50.0);
    Ok([
        timeless(entity, &lines)?,
        timeless(format!("{entity}/labels"), &texts(words))?,
    ])
}

/// Words beside a bar, where each begins a number of lines above or below it.
pub(super) fn beside(bar: &Bar, words: &[(&str, f32)]) -> Vec<Label> {
    words
        .iter()
        .map(|(text, lines)| ((*text).to_owned(), bar.words(*lines), NAME_COLOR))
        .collect()
}

/// Words by themselves.
pub(super) fn texts(labels: Vec<Label>) -> Points2D {
    let places = Points2D::new(labels.iter().map(|(_, place, _)| *place));
    let colored = places.with_colors(labels.iter().map(|(_, _, color)| rgb(*color)));
    lettered(colored).with_labels(labels.into_iter().map(|(text, ..)| text))
}

/// Points that show nothing but their words.
pub(super) fn lettered(places: Points2D) -> Points2D {
    places
        .with_radii([Radius::ZERO])
        .with_show_labels(true)
        .with_draw_order(60.0)
}

/// At most three decimals, none of them an idle zero; of what is small, two digits.
pub(super) fn number(value: f32) -> String {
    if value != 0.0 && value.abs() < 0.000_95 {
        return format!("{value:.1e}");
    }
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn name(quantity: &Quantity, with_unit: bool) -> String {
    if quantity.unit.is_empty() || !with_unit {
        quantity.name.clone()
    } else {
        format!("{} [{}]", quantity.name, quantity.unit)
    }
}

/// The name with as much else as `room` letters allow.
fn described(quantity: &Quantity, arrow: &str, room: usize) -> String {
    let [low, high] = quantity.range.map(number);
    let short = format!("{} {arrow}", quantity.name);
    let versions = [
        format!("{}  {low} to {high} {arrow}", name(quantity, true)),
        format!("{} {arrow}", name(quantity, true)),
    ];
    versions
        .into_iter()
        .find(|text| text.chars().count() <= room)
        .unwrap_or(short)
}
