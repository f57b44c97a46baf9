//! Static annotations of images of visited states: axes and frames of panels with their names,
//! units and ranges, names of agents, and color scales.

use rerun::components::Radius;
use rerun::log::Chunk;
use rerun::{LineStrips2D, Points2D};

use super::error::RecordingError;
use super::rows::{rgb, static_chunk};
use super::tiles::{CHAR_WIDTH, ColorBar, LabelSpace, Tiles, Viewport};
use crate::record::visitation::{AXIS_HEIGHT, Axes, Axis, CELLS_PER_SIDE, Pairs};
use seedbed_env::Quantity;
use seedbed_figure::color::dark::agent_color;

const AXIS_COLOR: [u8; 3] = [150, 150, 160];
const NAME_COLOR: [u8; 3] = [235, 235, 240];
const RANGE_COLOR: [u8; 3] = [165, 165, 175];

/// Space on either side of an image with axis names, in points.
const SIDE_MARGIN: f32 = 34.0;

/// Maximum number of images in a view whose axes have names and ranges. In views with more images,
/// only the image of the team has them.
pub(super) const MAX_LABELED_IMAGES: u32 = 4;

/// The text, position and color of a label.
pub(super) type Label = (String, [f32; 2], [u8; 3]);

/// The layout of the images of one view, and of the labels around each image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PanelLayout {
    pub(super) tiles: Tiles,
    /// Whether each image is labeled with its agent.
    has_agent_labels: bool,
    /// Whether axes have names and ranges.
    has_axis_names: bool,
    /// Whether every other name is one line higher.
    staggered: bool,
    /// Number of lines for names and ranges above an image.
    name_lines: f32,
}

impl PanelLayout {
    /// The layout of parallel coordinates, with one image per agent or, without `agents`, one image
    /// of the team.
    pub(super) fn of_axes(axes: &Axes, agents: Option<u32>, viewport: Viewport) -> Self {
        let size = [axes.width() as f32, AXIS_HEIGHT as f32];
        let with_name_lines = |name_lines| {
            Self::new(
                agents,
                size,
                Viewport {
                    overhang: overhang(axes),
                    ..viewport
                },
                [name_lines, 8.0],
                3.3,
            )
        };
        let unstaggered = if agents.unwrap_or(1) <= MAX_LABELED_IMAGES {
            with_name_lines(2.2)
        } else {
            Self::new(agents, size, viewport, [2.2, 8.0], 3.3)
        };
        let is_crowded = unstaggered.has_axis_names
            && (axes.x(1) - axes.x(0)) * unstaggered.tiles.zoom
                < max_name_width(axes, unstaggered.units_fit(axes));
        if is_crowded {
            Self {
                staggered: true,
                ..with_name_lines(3.2)
            }
        } else {
            unstaggered
        }
    }

    /// The layout of pairs of observations, with one row of panels per agent or, without `agents`,
    /// one row of the team.
    pub(super) fn for_observation_pairs(
        pairs: &Pairs,
        agents: Option<u32>,
        viewport: Viewport,
    ) -> Self {
        Self::new(
            agents,
            [pairs.width() as f32, CELLS_PER_SIDE as f32],
            viewport,
            [1.2, 28.0],
            2.2,
        )
    }

    /// A layout with `name_lines` lines of labels above each image and `scale_lines` lines below
    /// the color scale. If axes have no names, there are `side_margin` points on either side of an
    /// image.
    fn new(
        agents: Option<u32>,
        size: [f32; 2],
        viewport: Viewport,
        [name_lines, side_margin]: [f32; 2],
        scale_lines: f32,
    ) -> Self {
        let image_count = agents.unwrap_or(1);
        let has_agent_labels = agents.is_some_and(|agents| agents > 1);
        let has_axis_names = image_count <= MAX_LABELED_IMAGES;
        let name_lines = if has_axis_names { name_lines } else { 0.2 };
        let lines_above = name_lines + if has_agent_labels { 1.0 } else { 0.0 };
        let labels = LabelSpace {
            lines_above,
            lines_below: if has_axis_names { 1.3 } else { 0.4 },
            side_margin: if has_axis_names {
                SIDE_MARGIN
            } else {
                side_margin
            },
            scale_lines,
        };
        Self {
            tiles: Tiles::new(image_count, size, viewport, labels),
            has_agent_labels,
            has_axis_names,
            staggered: false,
            name_lines,
        }
    }

    /// The vertical axes, at `entity`, and their labels, at `entity/labels`.
    pub(super) fn axis_chunks(
        &self,
        entity: &str,
        axes: &Axes,
    ) -> Result<[Chunk; 2], RecordingError> {
        let axis_positions: Vec<f32> = (0..axes.all().len()).map(|axis| axes.x(axis)).collect();
        let vertical = |[left, top]: [f32; 2]| {
            axis_positions
                .iter()
                .map(move |x| vec![[left + x, top], [left + x, top + AXIS_HEIGHT as f32]])
        };
        let lines: Vec<Vec<[f32; 2]>> = self.tiles.corners().flat_map(vertical).collect();
        let labels = self
            .tiles
            .corners()
            .flat_map(|corner| self.axis_labels(axes, corner));
        self.annotation_chunks(entity, &lines, labels.collect())
    }

    /// The frames of panels, at `entity`, and their labels, at `entity/labels`.
    pub(super) fn frame_chunks(
        &self,
        entity: &str,
        pairs: &Pairs,
    ) -> Result<[Chunk; 2], RecordingError> {
        let side = CELLS_PER_SIDE as f32;
        let frame = |[left, top]: [f32; 2], x: f32| {
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
            (0..pairs.panels().len()).map(move |index| frame(corner, pairs.x(index) as f32))
        };
        let lines: Vec<Vec<[f32; 2]>> = self.tiles.corners().flat_map(row).collect();
        let labels = self
            .tiles
            .corners()
            .flat_map(|corner| self.panel_labels(pairs, corner));
        self.annotation_chunks(entity, &lines, labels.collect())
    }

    fn annotation_chunks(
        &self,
        entity: &str,
        lines: &[Vec<[f32; 2]>],
        mut labels: Vec<Label>,
    ) -> Result<[Chunk; 2], RecordingError> {
        if self.has_agent_labels {
            labels.extend(
                self.tiles
                    .corners()
                    .zip(0..)
                    .map(|(corner, agent)| self.agent_label(corner, agent)),
            );
        }
        let lines = LineStrips2D::new(lines)
            .with_colors([rgb(AXIS_COLOR)])
            .with_radii([Radius::new_ui_points(0.6)]);
        Ok([
            static_chunk(entity, &lines.with_draw_order(50.0))?,
            static_chunk(format!("{entity}/labels"), &label_points(labels))?,
        ])
    }

    /// The name of an agent, at the upper left corner of its image.
    fn agent_label(&self, [left, top]: [f32; 2], agent: u32) -> Label {
        let text = format!("agent {agent}");
        let half = 0.5 * text.len() as f32 * CHAR_WIDTH / self.tiles.zoom;
        (
            text,
            [
                left + half,
                top - (self.name_lines + 0.9) * self.tiles.line_height(),
            ],
            agent_color(agent),
        )
    }

    fn axis_labels(&self, axes: &Axes, [left, top]: [f32; 2]) -> Vec<Label> {
        let (line_height, with_units) = (self.tiles.line_height(), self.units_fit(axes));
        let labels = |(index, axis): (usize, &Axis)| {
            let x = left + axes.x(index);
            let lines_above = if self.staggered && index % 2 == 1 {
                3.1
            } else {
                2.1
            };
            let [low, high] = axis.quantity.range.map(format_number);
            let bottom = top + AXIS_HEIGHT as f32 + 0.05 * line_height;
            [
                (
                    axis_name(&axis.quantity, with_units),
                    [x, top - lines_above * line_height],
                    NAME_COLOR,
                ),
                (high, [x, top - 1.05 * line_height], RANGE_COLOR),
                (low, [x, bottom], RANGE_COLOR),
            ]
        };
        if self.has_axis_names {
            axes.all().iter().enumerate().flat_map(labels).collect()
        } else {
            Vec::new()
        }
    }

    /// Whether there is space for the names of axes with their units.
    fn units_fit(&self, axes: &Axes) -> bool {
        max_name_width(axes, true) <= 2.0 * (axes.x(1) - axes.x(0)) * self.tiles.zoom
    }

    fn panel_labels(&self, pairs: &Pairs, [left, top]: [f32; 2]) -> Vec<Label> {
        let (line_height, side) = (self.tiles.line_height(), CELLS_PER_SIDE as f32);
        let max_chars = (pairs.x(1) as f32 * self.tiles.zoom / CHAR_WIDTH) as usize;
        let labels = |(index, [horizontal, vertical]): (usize, &[Axis; 2])| {
            let middle = left + pairs.x(index) as f32 + 0.5 * side;
            [
                (
                    panel_label(&vertical.quantity, "↑", max_chars),
                    [middle, top - 1.05 * line_height],
                    NAME_COLOR,
                ),
                (
                    panel_label(&horizontal.quantity, "→", max_chars),
                    [middle, top + side + 0.05 * line_height],
                    NAME_COLOR,
                ),
            ]
        };
        if self.has_axis_names {
            pairs.panels().iter().enumerate().flat_map(labels).collect()
        } else {
            Vec::new()
        }
    }
}

/// Width of the longest name of an axis, in points.
fn max_name_width(axes: &Axes, with_units: bool) -> f32 {
    let chars = axes
        .all()
        .iter()
        .map(|axis| axis_name(&axis.quantity, with_units).chars().count());
    chars.max().unwrap_or(0) as f32 * CHAR_WIDTH + 8.0
}

/// Width by which the name of the last axis exceeds the space beside an image, in points.
fn overhang(axes: &Axes) -> f32 {
    let chars = axes
        .all()
        .last()
        .map_or(0, |axis| axis_name(&axis.quantity, true).chars().count());
    (0.5 * chars as f32 * CHAR_WIDTH - SIDE_MARGIN).max(0.0)
}

/// A vertical color bar, at `entity`, and its labels, at `entity/labels`.
pub(super) fn color_scale(
    entity: &str,
    bar: &ColorBar,
    color: impl Fn(f32) -> [u8; 3],
    labels: Vec<Label>,
) -> Result<[Chunk; 2], RecordingError> {
    let [left, right] = bar.x;
    let lines = LineStrips2D::new(bar.steps().map(|(y, _)| [[left, y], [right, y]]));
    let lines = lines.with_colors(bar.steps().map(|(_, share)| rgb(color(share))));
    let lines = lines
        .with_radii([Radius::new_scene_units(bar.half_step())])
        .with_draw_order(50.0);
    Ok([
        static_chunk(entity, &lines)?,
        static_chunk(format!("{entity}/labels"), &label_points(labels))?,
    ])
}

/// Labels of a color bar. `texts` has the text of each label, and its number of lines above the bar
/// (positive) or below it (negative).
pub(super) fn color_bar_labels(bar: &ColorBar, texts: &[(&str, f32)]) -> Vec<Label> {
    texts
        .iter()
        .map(|(text, lines)| ((*text).to_owned(), bar.label_position(*lines), NAME_COLOR))
        .collect()
}

/// Labels, as points of radius 0.
pub(super) fn label_points(labels: Vec<Label>) -> Points2D {
    let points = Points2D::new(labels.iter().map(|(_, position, _)| *position));
    let colored = points.with_colors(labels.iter().map(|(_, _, color)| rgb(*color)));
    show_labels_only(colored).with_labels(labels.into_iter().map(|(text, ..)| text))
}

/// Hides points and shows their labels.
pub(super) fn show_labels_only(points: Points2D) -> Points2D {
    points
        .with_radii([Radius::ZERO])
        .with_show_labels(true)
        .with_draw_order(60.0)
}

/// A number with at most three decimals and no trailing zeros. Numbers with a magnitude below
/// 0.00095 are in scientific notation, with two significant digits.
pub(super) fn format_number(value: f32) -> String {
    if value != 0.0 && value.abs() < 0.000_95 {
        return format!("{value:.1e}");
    }
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn axis_name(quantity: &Quantity, with_unit: bool) -> String {
    if quantity.unit.is_empty() || !with_unit {
        quantity.name.clone()
    } else {
        format!("{} [{}]", quantity.name, quantity.unit)
    }
}

/// The name of a quantity with its unit and range, with its unit only, or alone: the longest label
/// of at most `max_chars` characters.
fn panel_label(quantity: &Quantity, arrow: &str, max_chars: usize) -> String {
    let [low, high] = quantity.range.map(format_number);
    let short = format!("{} {arrow}", quantity.name);
    let labels_by_length = [
        format!("{}  {low} to {high} {arrow}", axis_name(quantity, true)),
        format!("{} {arrow}", axis_name(quantity, true)),
    ];
    labels_by_length
        .into_iter()
        .find(|text| text.chars().count() <= max_chars)
        .unwrap_or(short)
}
