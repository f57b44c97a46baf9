//! Static annotations of images of visited states: axes and frames of panels with their names,
//! units and ranges, names of agents, and color scales.

use rerun::components::Radius;
use rerun::log::Chunk;
use rerun::{LineStrips2D, Points2D, Transform3D};

use super::error::RecordingError;
use super::rows::{rgb, static_chunk};
use super::tiles::{CHAR_WIDTH, ColorBar, ImageSize, LINE_HEIGHT, LabelSpace, Tiles, Viewport};
use crate::record::visitation::{AXIS_HEIGHT, Axes, Axis, CELLS_PER_SIDE, Pairs};
use seedbed_env::Quantity;
use seedbed_figure::color::dark::agent_color;

const AXIS_COLOR: [u8; 3] = [150, 150, 160];
const NAME_COLOR: [u8; 3] = [235, 235, 240];
const RANGE_COLOR: [u8; 3] = [215, 215, 220];

/// Space on either side of an image with axis names, in points, in a single column of images and in
/// several columns.
const SIDE_MARGIN: f32 = 34.0;
const NARROW_SIDE_MARGIN: f32 = 16.0;

/// Number of lines for the name of an agent.
const AGENT_LINES: f32 = 1.1;

/// Maximum number of images in a view that are in a single column, with names of axes in any case.
pub(super) const MAX_AGENTS_IN_COLUMN: u32 = 4;

/// Maximum ratio between the zooms of parallel coordinates and of scatter plots in both directions.
const MAX_STRETCH_OF_AXES: f32 = 3.0;
const MAX_STRETCH_OF_PAIRS: f32 = 1.3;

/// The text, position and color of a label.
pub(super) type Label = (String, [f32; 2], [u8; 3]);

/// The layout of the images of one view, and of the labels around the images. Axes and panels have
/// names and ranges once per column of images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PanelLayout {
    pub(super) tiles: Tiles,
    /// Whether each image is labeled with its agent.
    has_agent_labels: bool,
    /// Whether axes have names and ranges.
    has_axis_names: bool,
    /// Whether every other name is one line higher.
    staggered: bool,
}

impl PanelLayout {
    /// The layout of parallel coordinates, with one image per agent or, without `agents`, one image
    /// of the team. Axes have no names if there is no space for them.
    pub(super) fn of_axes(axes: &Axes, agents: Option<u32>, viewport: Viewport) -> Self {
        let image = ImageSize {
            pixels: [axes.width() as f32, AXIS_HEIGHT as f32],
            max_stretch: MAX_STRETCH_OF_AXES,
        };
        let with_name_lines = |name_lines: f32| {
            let viewport = Viewport {
                overhang: overhang(axes),
                ..viewport
            };
            Self::new(agents, image, viewport, name_lines, 3.3)
        };
        let layout = with_name_lines(2.2);
        let width = max_name_width(axes, layout.units_fit(axes));
        if width <= layout.axis_distance(axes) {
            return layout;
        }
        let staggered = Self {
            staggered: true,
            ..with_name_lines(3.2)
        };
        let is_small = agents.unwrap_or(1) > MAX_AGENTS_IN_COLUMN;
        if is_small && width > 2.0 * staggered.axis_distance(axes) {
            return Self::new(agents, image, viewport, 0.0, 3.3);
        }
        staggered
    }

    /// The layout of pairs of observations, with one row of panels per agent or, without `agents`,
    /// one row of the team.
    pub(super) fn for_observation_pairs(
        pairs: &Pairs,
        agents: Option<u32>,
        viewport: Viewport,
    ) -> Self {
        let image = ImageSize {
            pixels: [pairs.width() as f32, CELLS_PER_SIDE as f32],
            max_stretch: MAX_STRETCH_OF_PAIRS,
        };
        Self::new(agents, image, viewport, 1.2, 2.2)
    }

    /// A layout with `name_lines` lines of names and ranges above the images, without names if this
    /// is 0, and `scale_lines` lines below the color scale.
    fn new(
        agents: Option<u32>,
        image: ImageSize,
        viewport: Viewport,
        name_lines: f32,
        scale_lines: f32,
    ) -> Self {
        let has_agent_labels = agents.is_some_and(|agents| agents > 1);
        let has_axis_names = name_lines > 0.0;
        let labels = LabelSpace {
            lines_above_all: name_lines + 0.1,
            lines_below_all: if has_axis_names { 1.2 } else { 0.0 },
            lines_above: if has_agent_labels { AGENT_LINES } else { 0.0 },
            lines_below: 0.2,
            side_margin: if agents.unwrap_or(1) <= MAX_AGENTS_IN_COLUMN {
                SIDE_MARGIN
            } else if has_axis_names {
                NARROW_SIDE_MARGIN
            } else {
                8.0
            },
            scale_lines,
        };
        Self {
            tiles: Tiles::new(agents.unwrap_or(1), image, viewport, labels),
            has_agent_labels,
            has_axis_names,
            staggered: false,
        }
    }

    /// Position and stretching of an image at this upper left corner, in which positions are in
    /// pixels.
    pub(super) fn transform(&self, [x, y]: [f32; 2]) -> Transform3D {
        let [horizontal, vertical] = self.tiles.zoom;
        Transform3D::update_fields()
            .with_translation([x, y, 0.0])
            .with_scale([horizontal, vertical, 1.0])
    }

    /// Height of the labels of agents above images.
    fn agent_height(&self) -> f32 {
        if self.has_agent_labels {
            AGENT_LINES * LINE_HEIGHT
        } else {
            0.0
        }
    }

    /// Horizontal position of an axis in an image.
    fn axis_x(&self, axes: &Axes, axis: usize) -> f32 {
        axes.x(axis) * self.tiles.zoom[0]
    }

    /// Distance between neighboring axes.
    fn axis_distance(&self, axes: &Axes) -> f32 {
        self.axis_x(axes, 1) - self.axis_x(axes, 0)
    }

    /// The vertical axes, at `entity`, and their labels, at `entity/labels`.
    pub(super) fn axis_chunks(
        &self,
        entity: &str,
        axes: &Axes,
    ) -> Result<[Chunk; 2], RecordingError> {
        let vertical = |[left, top]: [f32; 2]| {
            (0..axes.all().len()).map(move |axis| {
                let x = left + self.axis_x(axes, axis);
                vec![[x, top], [x, top + self.tiles.size[1]]]
            })
        };
        let lines: Vec<Vec<[f32; 2]>> = self.tiles.corners().flat_map(vertical).collect();
        let tops = self.tiles.top_corners();
        let bottoms = self.tiles.bottom_corners();
        let mut labels = Vec::new();
        if self.has_axis_names {
            labels.extend(tops.flat_map(|corner| self.labels_above_axes(axes, corner)));
            labels.extend(bottoms.flat_map(|corner| self.labels_below_axes(axes, corner)));
        }
        self.annotation_chunks(entity, &lines, labels)
    }

    /// The frames of panels, at `entity`, and their labels, at `entity/labels`.
    pub(super) fn frame_chunks(
        &self,
        entity: &str,
        pairs: &Pairs,
    ) -> Result<[Chunk; 2], RecordingError> {
        let [width, height] = self.tiles.zoom.map(|zoom| zoom * CELLS_PER_SIDE as f32);
        let frame = |[left, top]: [f32; 2], x: f32| {
            let (left, right, bottom) = (left + x, left + x + width, top + height);
            vec![
                [left, top],
                [right, top],
                [right, bottom],
                [left, bottom],
                [left, top],
            ]
        };
        let row = |corner: [f32; 2]| {
            (0..pairs.panels().len()).map(move |index| frame(corner, self.panel_x(pairs, index)))
        };
        let lines: Vec<Vec<[f32; 2]>> = self.tiles.corners().flat_map(row).collect();
        let tops = self.tiles.top_corners();
        let bottoms = self.tiles.bottom_corners();
        let mut labels = Vec::new();
        labels.extend(tops.flat_map(|corner| self.labels_above_panels(pairs, corner)));
        labels.extend(bottoms.flat_map(|corner| self.labels_below_panels(pairs, corner)));
        self.annotation_chunks(entity, &lines, labels)
    }

    /// Horizontal position of a panel in an image.
    fn panel_x(&self, pairs: &Pairs, index: usize) -> f32 {
        pairs.x(index) as f32 * self.tiles.zoom[0]
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

    /// The name of an agent, above the upper left corner of its image.
    fn agent_label(&self, [left, top]: [f32; 2], agent: u32) -> Label {
        let text = format!("agent {agent}");
        let half = 0.5 * text.len() as f32 * CHAR_WIDTH;
        let position = [left + half, top - self.agent_height()];
        // Lighter, because some colors are hard to read on the gray background of labels.
        let color = agent_color(agent).map(|channel| channel / 2 + 127);
        (text, position, color)
    }

    /// Names and upper ends of axes.
    fn labels_above_axes(&self, axes: &Axes, [left, top]: [f32; 2]) -> Vec<Label> {
        let (with_units, top) = (self.units_fit(axes), top - self.agent_height());
        let labels = |(index, axis): (usize, &Axis)| {
            let x = left + self.axis_x(axes, index);
            let is_higher = self.staggered && index % 2 == 1;
            let lines_above = if is_higher { 3.1 } else { 2.1 };
            let [_, high] = axis.quantity.range.map(format_number);
            let name = axis_name(&axis.quantity, with_units);
            [
                (name, [x, top - lines_above * LINE_HEIGHT], NAME_COLOR),
                (high, [x, top - 1.05 * LINE_HEIGHT], RANGE_COLOR),
            ]
        };
        axes.all().iter().enumerate().flat_map(labels).collect()
    }

    /// Lower ends of axes.
    fn labels_below_axes(&self, axes: &Axes, [left, top]: [f32; 2]) -> Vec<Label> {
        let bottom = top + self.tiles.size[1] + 0.05 * LINE_HEIGHT;
        let label = |(index, axis): (usize, &Axis)| {
            let low = format_number(axis.quantity.range[0]);
            let x = left + self.axis_x(axes, index);
            (low, [x, bottom], RANGE_COLOR)
        };
        axes.all().iter().enumerate().map(label).collect()
    }

    /// Whether there is space for the names of axes with their units.
    fn units_fit(&self, axes: &Axes) -> bool {
        max_name_width(axes, true) <= 2.0 * self.axis_distance(axes)
    }

    /// Names of the vertical quantities of panels.
    fn labels_above_panels(&self, pairs: &Pairs, [left, top]: [f32; 2]) -> Vec<Label> {
        let top = top - self.agent_height() - 1.05 * LINE_HEIGHT;
        let label = |(index, [_, vertical]): (usize, &[Axis; 2])| {
            let text = panel_label(&vertical.quantity, "↑", self.max_chars(pairs));
            (
                text,
                [left + self.panel_middle(pairs, index), top],
                NAME_COLOR,
            )
        };
        pairs.panels().iter().enumerate().map(label).collect()
    }

    /// Names of the horizontal quantities of panels.
    fn labels_below_panels(&self, pairs: &Pairs, [left, top]: [f32; 2]) -> Vec<Label> {
        let bottom = top + self.tiles.size[1] + 0.05 * LINE_HEIGHT;
        let label = |(index, [horizontal, _]): (usize, &[Axis; 2])| {
            let text = panel_label(&horizontal.quantity, "→", self.max_chars(pairs));
            (
                text,
                [left + self.panel_middle(pairs, index), bottom],
                NAME_COLOR,
            )
        };
        pairs.panels().iter().enumerate().map(label).collect()
    }

    fn panel_middle(&self, pairs: &Pairs, index: usize) -> f32 {
        self.panel_x(pairs, index) + 0.5 * CELLS_PER_SIDE as f32 * self.tiles.zoom[0]
    }

    /// Maximum number of characters of the label of a panel.
    fn max_chars(&self, pairs: &Pairs) -> usize {
        (self.panel_x(pairs, 1) / CHAR_WIDTH) as usize
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
