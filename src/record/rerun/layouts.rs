//! The layouts of all views of visited states, with their annotations: `/visitation/axes`,
//! `/pairs/frames`, color scales.
//!
//! The images of all agents are in one view, in which the entity of each agent has its own
//! position.

use rerun::log::Chunk;

use super::annotations::{
    Label, MAX_AGENTS_IN_COLUMN, PanelLayout, color_bar_labels, color_scale, format_number,
    label_points,
};
use super::error::RecordingError;
use super::images::{ImageGroup, TeamImages};
use super::rows::static_chunk;
use super::samples::VisitationStyle;
use super::tiles::{ColorBar, Viewport};
use crate::record::visitation::{Axes, Coloring, MIN_BRIGHTNESS, Pairs, outcome_color};
use crate::scenario::recording::ColorBy;
use seedbed_figure::color::dark::{density_color, diverging_color, sequential_color};

/// Width and height available to views of visited states, in points, on a screen of 1600 × 1000
/// points, without tabs and a title.
const VIEW_SIZE: [f32; 2] = [960.0, 880.0];

/// Height of a view's title, in points.
const TITLE_HEIGHT: f32 = 28.0;

/// Share of the height for the team's images, above the images of agents.
pub(super) const TEAM_SHARE: f32 = 0.3;

/// Width of the color scale beside images, in points.
pub(super) const SCALE_WIDTH: f32 = 120.0;

/// Entities of the team's images and lines of parallel coordinates, and of pairs of observations.
const TEAM_IMAGES: [&str; 4] = [
    "visitation/team/lines",
    "visitation/team/density",
    "visitation/team/latest",
    "visitation/difference",
];
const TEAM_PAIRS: [&str; 2] = ["pairs/team/states", "pairs/team/bonus"];

/// The layouts for images of all agents, and for one image of the team.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Layouts {
    pub(super) axes: PanelLayout,
    pub(super) team_axes: PanelLayout,
    pub(super) pairs: PanelLayout,
    pub(super) team_pairs: PanelLayout,
    /// Whether views of lines and points have a color scale. Otherwise lines of a few agents are in a
    /// narrower view.
    pub(super) lines_have_scale: bool,
}

/// Arrangement of the images of a team on the screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arrangement {
    /// One agent: its sampled lines above its density.
    Alone,
    /// A few agents: one below the other, with sampled lines beside densities, below the team.
    Few,
    /// Many agents: the images of the team above the images of the agents.
    Many,
}

impl Arrangement {
    pub(super) fn of(agents: u32) -> Self {
        match agents {
            0 | 1 => Self::Alone,
            2..=MAX_AGENTS_IN_COLUMN => Self::Few,
            _ => Self::Many,
        }
    }
}

impl Layouts {
    pub(super) fn new(agents: u32, axes: &Axes, pairs: &Pairs, color_by: ColorBy) -> Self {
        let lines_have_scale = color_by != ColorBy::Agent;
        let [width, height] = VIEW_SIZE;
        let (half_width, team_height) = (
            width / 2.0,
            TEAM_SHARE * (height + TITLE_HEIGHT) - TITLE_HEIGHT,
        );
        let agents_height = height - team_height - TITLE_HEIGHT;
        let density_width = width * (1.0 - lines_share(lines_have_scale));
        let [axes_size, pairs_size, team_pairs_size] = match Arrangement::of(agents) {
            Arrangement::Alone => [
                [width, (height - TITLE_HEIGHT) / 2.0],
                [width, height],
                [width, team_height],
            ],
            Arrangement::Few => [
                [density_width, agents_height],
                [half_width, height],
                [half_width, height],
            ],
            Arrangement::Many => [
                [width, agents_height],
                [width, agents_height],
                [width, team_height],
            ],
        };
        let viewport = |size| Viewport {
            size,
            scale_width: SCALE_WIDTH,
            overhang: 0.0,
        };
        let team_axes_size = [half_width, team_height];
        Self {
            axes: PanelLayout::of_axes(axes, Some(agents), viewport(axes_size)),
            team_axes: PanelLayout::of_axes(axes, None, viewport(team_axes_size)),
            pairs: PanelLayout::for_observation_pairs(pairs, Some(agents), viewport(pairs_size)),
            team_pairs: PanelLayout::for_observation_pairs(pairs, None, viewport(team_pairs_size)),
            lines_have_scale,
        }
    }

    /// Share of the width for the lines of a few agents, beside densities with a color scale.
    pub(super) fn lines_share(&self) -> f32 {
        lines_share(self.lines_have_scale)
    }

    /// Static axes, panels, positions of agents, and scales of images.
    pub(super) fn annotations(
        &self,
        style: &VisitationStyle,
        images: &TeamImages,
    ) -> Result<Vec<Chunk>, RecordingError> {
        let mut chunks = self
            .axes
            .axis_chunks("visitation/axes", &style.axes)?
            .to_vec();
        chunks.extend(
            self.team_axes
                .axis_chunks("visitation/team/axes", &style.axes)?,
        );
        chunks.extend(self.pairs.frame_chunks("pairs/frames", &style.pairs)?);
        chunks.extend(
            self.team_pairs
                .frame_chunks("pairs/team/frames", &style.pairs)?,
        );
        for (root, layout) in [("visitation", self.axes), ("pairs", self.pairs)] {
            for (agent, corner) in layout.tiles.corners().enumerate() {
                let entity = format!("{root}/agent_{agent}");
                chunks.push(static_chunk(entity, &layout.transform(corner))?);
            }
        }
        for entity in TEAM_IMAGES {
            let transform = self.team_axes.transform([0.0, 0.0]);
            chunks.push(static_chunk(entity, &transform)?);
        }
        for entity in TEAM_PAIRS {
            let transform = self.team_pairs.transform([0.0, 0.0]);
            chunks.push(static_chunk(entity, &transform)?);
        }
        chunks.extend(self.image_scales(images)?);
        Ok(chunks)
    }

    /// The scales of images. The labels of their upper ends are recorded with the images.
    fn image_scales(&self, images: &TeamImages) -> Result<Vec<Chunk>, RecordingError> {
        let mut chunks = self.density_scales(images)?;
        if let Some(bonus) = &images.bonus {
            chunks.extend(self.bonus_scales(bonus)?);
        }
        chunks.extend(self.difference_scale(images)?);
        Ok(chunks)
    }

    fn density_scales(&self, images: &TeamImages) -> Result<Vec<Chunk>, RecordingError> {
        let [axes, team_axes] = [self.axes, self.team_axes].map(|layout| layout.tiles.color_bar());
        let latest_labels = [axes, team_axes].map(|bar| max_and_note_labels(&bar, -2.15));
        let mut chunks = images.latest.label_styles(&latest_labels)?.to_vec();
        let density_labels = [axes, team_axes].map(|bar| max_label(&bar));
        chunks.extend(images.density.label_styles(&density_labels)?);
        for (entity, bar) in [
            ("visitation/scale/density", axes),
            ("visitation/team/scale/density", team_axes),
        ] {
            chunks.extend(color_scale(
                entity,
                &bar,
                line_density_color,
                color_bar_labels(
                    &bar,
                    &[("states per pixel", 2.1), ("1", -0.05), ("log scale", -1.1)],
                ),
            )?);
        }
        Ok(chunks)
    }

    fn bonus_scales(&self, bonus: &ImageGroup) -> Result<Vec<Chunk>, RecordingError> {
        let [pairs, team_pairs] =
            [self.pairs, self.team_pairs].map(|layout| layout.tiles.color_bar());
        let labels = [pairs, team_pairs].map(|bar| max_and_note_labels(&bar, -1.1));
        let mut chunks = bonus.label_styles(&labels)?.to_vec();
        for (entity, bar) in [
            ("pairs/scale/bonus", pairs),
            ("pairs/team/scale/bonus", team_pairs),
        ] {
            chunks.extend(color_scale(
                entity,
                &bar,
                sequential_color,
                color_bar_labels(&bar, &[("mean bonus", 2.1), ("0", -0.05)]),
            )?);
        }
        Ok(chunks)
    }

    fn difference_scale(&self, images: &TeamImages) -> Result<Vec<Chunk>, RecordingError> {
        let bar = self.team_axes.tiles.color_bar();
        let labels = color_bar_labels(&bar, &[("", 2.1), ("", 1.05), ("", -0.05), ("", -1.1)]);
        let mut chunks = vec![images.difference_label_style(&labels)?];
        chunks.extend(color_scale(
            "visitation/team/scale/difference",
            &bar,
            |share| diverging_color(2.0 * share - 1.0),
            color_bar_labels(&bar, &[("√ scale", 3.15)]),
        )?);
        Ok(chunks)
    }

    /// The color scales of lines and points. Their ends may depend on the returns of the first
    /// round.
    pub(super) fn color_scales(&self, coloring: &Coloring) -> Result<Vec<Chunk>, RecordingError> {
        let layouts = [
            ("visitation/scale/lines", self.axes),
            ("visitation/team/scale/lines", self.team_axes),
            ("pairs/scale/states", self.pairs),
            ("pairs/team/scale/states", self.team_pairs),
        ];
        let scales = layouts
            .into_iter()
            .map(|(entity, layout)| state_color_scale(entity, &layout.tiles.color_bar(), coloring));
        Ok(scales
            .collect::<Result<Vec<_>, _>>()?
            .into_iter()
            .flatten()
            .collect())
    }
}

/// Lines are in a view that is narrower by the width of a scale if they have none, so that images in
/// both views have the same size.
fn lines_share(have_scale: bool) -> f32 {
    let missing = if have_scale { 0.0 } else { SCALE_WIDTH };
    (VIEW_SIZE[0] - missing) / (2.0 * VIEW_SIZE[0])
}

/// The position of the label at the upper end of a scale. Its text is recorded with the images.
fn max_label(bar: &ColorBar) -> Vec<Label> {
    color_bar_labels(bar, &[("", 1.05)])
}

/// The positions of the label at the upper end of a scale and of a note, which is `-note_lines`
/// lines below the scale. Both texts are recorded with the images.
fn max_and_note_labels(bar: &ColorBar, note_lines: f32) -> Vec<Label> {
    color_bar_labels(bar, &[("", 1.05), ("", note_lines)])
}

/// The color at a share of the color scale. At 0 it is the color of a pixel with a single line
/// (dark, but not black), at 1 the color of the pixel with the most lines.
fn line_density_color(share: f32) -> [u8; 3] {
    let min = f32::from(MIN_BRIGHTNESS) / 255.0;
    density_color(min + (1.0 - min) * share)
}

fn state_color_scale(
    entity: &str,
    bar: &ColorBar,
    coloring: &Coloring,
) -> Result<Vec<Chunk>, RecordingError> {
    let [low, high] = coloring.range.map(format_number);
    match coloring.color_by {
        ColorBy::Agent => Ok(Vec::new()),
        ColorBy::Outcome => {
            let [truncated, terminated] = [false, true].map(outcome_color);
            let label =
                |text: &str, lines: f32, color| (text.to_owned(), bar.label_position(lines), color);
            let labels = vec![
                label("truncated", 2.1, truncated),
                label("terminated", 1.05, terminated),
            ];
            let entity = format!("{entity}/labels");
            Ok(vec![static_chunk(entity, &label_points(labels))?])
        }
        ColorBy::Return => {
            let (low, high) = (format!("{low} or less"), format!("{high} or more"));
            let labels = color_bar_labels(
                bar,
                &[(coloring.title(), 2.1), (&high, 1.05), (&low, -0.05)],
            );
            color_scale(entity, bar, sequential_color, labels).map(Vec::from)
        }
        ColorBy::Episode | ColorBy::IntrinsicReward => {
            let labels = color_bar_labels(
                bar,
                &[(coloring.title(), 2.1), (&high, 1.05), (&low, -0.05)],
            );
            color_scale(entity, bar, sequential_color, labels).map(Vec::from)
        }
    }
}
