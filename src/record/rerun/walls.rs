//! Where all pictures of visited states hang, and what stands around them: `/visitation/axes`, `/pairs/frames`, bars of colours.
//!
//! Pictures of all agents share a view, in which each agent's entity has a place of its own.

use rerun::Transform3D;
use rerun::log::Chunk;

use super::furniture::{Label, NAMED, Wall, beside, number, scale};
use super::pictures::Pictures;
use super::rows::timeless;
use super::sink::Fault;
use super::tiles::{Bar, Room};
use super::visitation::Drawing;
use crate::record::Colour;
use crate::record::palette::{OUTCOMES, diverging, glow, sequential};
use crate::record::visitation::{Axes, Colouring, DIMMEST, Pairs};

/// Points of the screen to the left, for pictures of visited states, on a screen of 1600 × 1000 points, without tabs and a title.
const ROOM: [f32; 2] = [960.0, 880.0];

/// Points that a view's title takes.
const TITLE: f32 = 28.0;

/// The share of the height that the team's pictures take above those of many agents.
pub(super) const TEAM_SHARE: f32 = 0.3;

/// Points for the scale beside pictures.
const SCALE: f32 = 120.0;

/// The walls for pictures of all agents, and for one picture of the team.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Walls {
    pub(super) axes: Wall,
    pub(super) team_axes: Wall,
    pub(super) pairs: Wall,
    pub(super) team_pairs: Wall,
}

/// How pictures of a team share the screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arrangement {
    /// One agent: its lines above its density.
    Alone,
    /// A few agents: one below the other, lines beside densities.
    Few,
    /// The team's pictures above those of many agents.
    Many,
}

impl Arrangement {
    pub(super) fn of(agents: u32) -> Self {
        match agents {
            0 | 1 => Self::Alone,
            2..=NAMED => Self::Few,
            _ => Self::Many,
        }
    }
}

impl Walls {
    pub(super) fn new(agents: u32, axes: &Axes, pairs: &Pairs) -> Self {
        let [width, height] = ROOM;
        let (half, upper) = (width / 2.0, TEAM_SHARE * (height + TITLE) - TITLE);
        let lower = height - upper - TITLE;
        let [of_axes, of_team, of_pairs, of_team_pairs] = match Arrangement::of(agents) {
            Arrangement::Alone => [
                [width, (height - TITLE) / 2.0],
                [half, upper],
                [width, height],
                [width, upper],
            ],
            Arrangement::Few => [
                [half, height],
                [half, upper],
                [half, height],
                [half, height],
            ],
            Arrangement::Many => [
                [width, lower],
                [half, upper],
                [width, lower],
                [width, upper],
            ],
        };
        let room = |size| Room {
            size,
            scale: SCALE,
            overhang: 0.0,
        };
        Self {
            axes: Wall::of_axes(axes, Some(agents), room(of_axes)),
            team_axes: Wall::of_axes(axes, None, room(of_team)),
            pairs: Wall::of_pairs(pairs, Some(agents), room(of_pairs)),
            team_pairs: Wall::of_pairs(pairs, None, room(of_team_pairs)),
        }
    }

    /// Axes, panels, each agent's place, and the scales whose ends are known.
    pub(super) fn furniture(
        &self,
        drawing: &Drawing,
        pictures: &Pictures,
    ) -> Result<Vec<Chunk>, Fault> {
        let mut chunks = self.axes.axes("visitation/axes", &drawing.axes)?.to_vec();
        chunks.extend(self.team_axes.axes("visitation/team/axes", &drawing.axes)?);
        chunks.extend(self.pairs.panels("pairs/frames", &drawing.pairs)?);
        chunks.extend(
            self.team_pairs
                .panels("pairs/team/frames", &drawing.pairs)?,
        );
        for (root, wall) in [("visitation", self.axes), ("pairs", self.pairs)] {
            for (agent, [x, y]) in wall.tiles.corners().enumerate() {
                let place = Transform3D::update_fields().with_translation([x, y, 0.0]);
                chunks.push(timeless(format!("{root}/agent_{agent}"), &place)?);
            }
        }
        chunks.extend(self.scales(pictures)?);
        Ok(chunks)
    }

    /// The scales of pictures; their upper ends come with the pictures.
    fn scales(&self, pictures: &Pictures) -> Result<Vec<Chunk>, Fault> {
        let [axes, team_axes, pairs, team_pairs] =
            [self.axes, self.team_axes, self.pairs, self.team_pairs].map(|wall| wall.tiles.bar());
        let mut chunks = pictures
            .latest
            .words(&ends(&axes, -2.15), &ends(&team_axes, -2.15))?
            .to_vec();
        chunks.extend(pictures.density.words(&upper(&axes), &upper(&team_axes))?);
        for (entity, bar) in [
            ("visitation/scale/density", axes),
            ("visitation/team/scale/density", team_axes),
        ] {
            chunks.extend(scale(
                entity,
                &bar,
                lit,
                beside(
                    &bar,
                    &[("lines a pixel", 2.1), ("1", -0.05), ("log scale", -1.1)],
                ),
            )?);
        }
        if let Some(bonus) = &pictures.bonus {
            chunks.extend(bonus.words(&ends(&pairs, -1.1), &ends(&team_pairs, -1.1))?);
            for (entity, bar) in [
                ("pairs/scale/bonus", pairs),
                ("pairs/team/scale/bonus", team_pairs),
            ] {
                chunks.extend(scale(
                    entity,
                    &bar,
                    sequential,
                    beside(&bar, &[("mean bonus", 2.1), ("0", -0.05)]),
                )?);
            }
        }
        let sides = beside(
            &team_axes,
            &[("", 2.1), ("", 1.05), ("", -0.05), ("", -1.1)],
        );
        chunks.push(pictures.difference_words(&sides)?);
        chunks.extend(scale(
            "visitation/difference/scale",
            &team_axes,
            |share| diverging(2.0 * share - 1.0),
            beside(&team_axes, &[("root scale", 3.15)]),
        )?);
        Ok(chunks)
    }

    /// The scale of lines and points, whose ends may be known only after the first round.
    pub(super) fn colours(&self, colouring: &Colouring) -> Result<Vec<Chunk>, Fault> {
        let walls = [
            ("visitation/scale/lines", self.axes),
            ("visitation/team/scale/lines", self.team_axes),
            ("pairs/scale/states", self.pairs),
            ("pairs/team/scale/states", self.team_pairs),
        ];
        let scales = walls
            .into_iter()
            .map(|(entity, wall)| coloured(entity, &wall.tiles.bar(), colouring));
        Ok(scales
            .collect::<Result<Vec<_>, _>>()?
            .into_iter()
            .flatten()
            .collect())
    }
}

/// A place for the upper end of a scale.
fn upper(bar: &Bar) -> Vec<Label> {
    beside(bar, &[("", 1.05)])
}

/// Likewise, and one for a note.
fn ends(bar: &Bar, note: f32) -> Vec<Label> {
    beside(bar, &[("", 1.05), ("", note)])
}

/// The scale of densities: a single line is not black.
fn lit(share: f32) -> [u8; 3] {
    let dimmest = f32::from(DIMMEST) / 255.0;
    glow(dimmest + (1.0 - dimmest) * share)
}

fn coloured(entity: &str, bar: &Bar, colouring: &Colouring) -> Result<Vec<Chunk>, Fault> {
    let [low, high] = colouring.range.map(number);
    match colouring.by {
        Colour::Agent => Ok(Vec::new()),
        Colour::Outcome => {
            let [truncated, terminated] = OUTCOMES;
            let word = |text: &str, lines: f32, color| (text.to_owned(), bar.words(lines), color);
            let words = vec![
                word("truncated", 2.1, truncated),
                word("terminated", 1.05, terminated),
            ];
            Ok(vec![timeless(
                format!("{entity}/labels"),
                &super::furniture::texts(words),
            )?])
        }
        Colour::Return => {
            let (low, high) = (format!("{low} or less"), format!("{high} or more"));
            let words = beside(
                bar,
                &[(colouring.title(), 2.1), (&high, 1.05), (&low, -0.05)],
            );
            scale(entity, bar, sequential, words).map(Vec::from)
        }
        Colour::Episode | Colour::IntrinsicReward => {
            let words = beside(
                bar,
                &[(colouring.title(), 2.1), (&high, 1.05), (&low, -0.05)],
            );
            scale(entity, bar, sequential, words).map(Vec::from)
        }
    }
}
