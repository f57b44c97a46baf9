//! Parallel coordinates: one vertical axis per dimension, and one line across all axes per point.

use super::color::{AXIS_COLOR, Color, MUTED_COLOR};
use super::font::{Weight, fit_text, text_width};
use super::panel_axes::{LABEL_SIZE, TICK_SIZE, TITLE_HEIGHT, draw_title};
use super::scale::{Scale, format_number, percent};
use super::svg::{Anchor, Rect, Stroke, SvgWriter, TextStyle};
use crate::Axis;

/// Points of many dimensions, called states, as lines across vertical axes.
#[derive(Clone, Debug, PartialEq)]
pub struct ParallelCoordinates {
    /// Title above the panel.
    pub title: String,
    /// Axes, from left to right.
    pub axes: Vec<Axis>,
    /// The points.
    pub states: States,
}

/// States as single lines, or as a density if there are too many lines to distinguish.
#[derive(Clone, Debug, PartialEq)]
pub enum States {
    /// One line per state; later ones are drawn on top.
    Lines(Vec<StateLine>),
    /// Number of lines over each pixel.
    Density(DensityImage),
    /// Difference over each pixel.
    Difference(DifferenceImage),
}

/// One state.
#[derive(Clone, Debug, PartialEq)]
pub struct StateLine {
    /// Position on each axis, from 0 (lower end) to 1 (upper end): `[axes]`. The line has a gap where a
    /// position is NaN.
    pub axis_positions: Vec<f32>,
    /// Color.
    pub color: Color,
}

/// Number of lines over each pixel between the first and the last axis, in the colors of
/// [`Key::Counts`](super::Key::Counts).
#[derive(Clone, Debug, PartialEq)]
pub struct DensityImage {
    /// Counts row by row from the top: `[height × width]`.
    pub pixels: Vec<u32>,
    /// Width in pixels.
    pub width: usize,
    /// The count with the darkest color.
    pub max_count: u32,
}

/// Approximate height of an axis per tick, and largest number of ticks.
const HEIGHT_PER_TICK: f64 = 28.0;
const MAX_TICKS: f64 = 4.0;

/// Minimum distance of a tick from an end of its axis.
const MIN_TICK_DISTANCE: f64 = 8.0;

/// Height and color of marks of values outside the range of an axis.
const MARK_HEIGHT: f64 = 9.0;
const MARK_COLOR: Color = [178, 40, 0];

/// Size of values at ends of axes that are close to each other.
const SMALL_TICK_SIZE: f64 = 9.0;

/// Height of the line of text with the shares of NaN.
const NAN_HEIGHT: f64 = 12.0;

impl ParallelCoordinates {
    pub(super) fn draw(&self, panel: &Rect, svg: &mut SvgWriter) {
        let staggered = self.must_stagger_names(panel);
        let names_height = if staggered { 30.0 } else { 15.0 };
        let side_margin = (0.5 * panel.width / self.axes.len().max(1) as f64).min(46.0);
        let has_nan = self.axes.iter().any(|axis| axis.nan > 0.0);
        let area = panel.inset([
            TITLE_HEIGHT + names_height + 17.0,
            side_margin,
            if has_nan { 22.0 + NAN_HEIGHT } else { 22.0 },
            side_margin,
        ]);
        draw_title(&self.title, panel, panel.x + 4.0, svg);
        match &self.states {
            States::Lines(lines) => draw_lines(lines, &area, svg),
            States::Density(density) => density.draw(&area, svg),
            States::Difference(difference) => difference.draw(&area, svg),
        }
        for (index, axis) in self.axes.iter().enumerate() {
            let x = self.x(index, &area);
            let is_raised = staggered && index % 2 == 1;
            draw_axis(x, &area, svg);
            self.draw_range(axis, x, &area, svg);
            self.draw_ticks(axis, x, &area, svg);
            self.draw_outside(axis, x, &area, svg);
            draw_nan(axis, [x, area.bottom() + 14.0 + NAN_HEIGHT], svg);
            let y = area.y - if is_raised { 35.0 } else { 20.0 };
            draw_name(
                axis,
                [x, y],
                panel,
                self.allowed_name_width(panel, staggered),
                svg,
            );
        }
    }

    /// Draws ticks with values between the ends of an axis, where there is space.
    fn draw_ticks(&self, axis: &Axis, x: f64, area: &Rect, svg: &mut SvgWriter) {
        let gap = area.width / (self.axes.len() - 1).max(1) as f64;
        let scale = Scale::new(axis.range.map(f64::from), [area.bottom(), area.y]);
        let style = TextStyle::new(TICK_SIZE, Anchor::Start)
            .color(MUTED_COLOR)
            .with_rim();
        let ticks = (area.height / HEIGHT_PER_TICK).clamp(1.0, MAX_TICKS) as usize;
        for (value, text) in scale.ticks(ticks) {
            let y = scale.position(value);
            // The values at the ends are drawn beyond them.
            let to_end = (y - area.y).min(area.bottom() - y);
            let is_low = y > area.y + area.height / 2.0;
            let mark_height = if axis.outside[usize::from(!is_low)] > 0.0 {
                MARK_HEIGHT
            } else {
                0.0
            };
            if to_end < MIN_TICK_DISTANCE + mark_height {
                continue;
            }
            svg.line(&[[x - 2.5, y], [x + 2.5, y]], Stroke::new(AXIS_COLOR, 1.0));
            if text_width(&text, TICK_SIZE, Weight::Regular) + 10.0 <= gap {
                svg.text([x + 4.0, y + 3.5], &text, style);
            }
        }
    }

    /// Marks the ends of an axis beyond which there are values, with their share.
    fn draw_outside(&self, axis: &Axis, x: f64, area: &Rect, svg: &mut SvgWriter) {
        let gap = area.width / (self.axes.len() - 1).max(1) as f64;
        let style = TextStyle::new(MARK_HEIGHT, Anchor::Start)
            .color(MARK_COLOR)
            .with_rim();
        let ends = [(area.bottom(), -1.0), (area.y, 1.0)];
        for ((end, inward), share) in ends.into_iter().zip(axis.outside) {
            if share <= 0.0 {
                continue;
            }
            let (tip, base) = (end + inward, end + inward * (MARK_HEIGHT - 2.0));
            let corners = [[x + 7.0, tip], [x + 3.0, base], [x + 11.0, base]];
            svg.polygon_with_rim(&corners, MARK_COLOR);
            let text = percent(share);
            if text_width(&text, MARK_HEIGHT, Weight::Regular) + 16.0 <= gap {
                let middle = f64::midpoint(tip, base);
                svg.text([x + 13.0, middle + 3.0], &text, style);
            }
        }
    }

    /// Draws the values at both ends of an axis, in a smaller font or not at all where they would touch those of the next axis.
    fn draw_range(&self, axis: &Axis, x: f64, area: &Rect, svg: &mut SvgWriter) {
        let [low, high] = axis.range.map(|end| format_number(f64::from(end)));
        let gap = area.width / (self.axes.len() - 1).max(1) as f64;
        for (text, y) in [(high, area.y - 5.0), (low, area.bottom() + 14.0)] {
            let fits = |size: &f64| text_width(&text, *size, Weight::Regular) + 3.0 <= gap;
            if let Some(size) = [TICK_SIZE, SMALL_TICK_SIZE].into_iter().find(fits) {
                let style = TextStyle::new(size, Anchor::Middle).color(MUTED_COLOR);
                svg.text([x, y], &text, style);
            }
        }
    }

    fn x(&self, axis: usize, area: &Rect) -> f64 {
        area.x + area.width * axis as f64 / (self.axes.len() - 1).max(1) as f64
    }

    /// Width that the name of an axis may have.
    fn allowed_name_width(&self, panel: &Rect, staggered: bool) -> f64 {
        let width_per_axis = panel.width / self.axes.len().max(1) as f64;
        if staggered {
            2.0 * width_per_axis - 6.0
        } else {
            width_per_axis - 4.0
        }
    }

    /// Whether names of axes are too wide to be on one line. If so, every second name is drawn one
    /// line higher.
    fn must_stagger_names(&self, panel: &Rect) -> bool {
        let allowed_width = self.allowed_name_width(panel, false);
        self.axes
            .iter()
            .any(|axis| text_width(&axis.label(), LABEL_SIZE, Weight::Regular) > allowed_width)
    }
}

fn draw_lines(lines: &[StateLine], area: &Rect, svg: &mut SvgWriter) {
    let opacity = match lines.len() {
        0..50 => 0.9,
        50..300 => 0.55,
        _ => 0.35,
    };
    for line in lines {
        let gap = area.width / (line.axis_positions.len() - 1).max(1) as f64;
        let position = |(index, fraction): (usize, &f32)| {
            [
                area.x + gap * index as f64,
                area.bottom() - f64::from(*fraction) * area.height,
            ]
        };
        let positions: Vec<[f64; 2]> = line
            .axis_positions
            .iter()
            .enumerate()
            .map(position)
            .collect();
        let stroke = Stroke {
            opacity,
            ..Stroke::new(line.color, 0.7)
        };
        for part in positions.split(|[_, y]| y.is_nan()) {
            match part {
                [] => {}
                // Between two gaps: a short line through the axis.
                [[x, y]] => svg.line(&[[x - 3.0, *y], [x + 3.0, *y]], stroke),
                _ => svg.line(part, stroke),
            }
        }
    }
}

/// Writes the share of NaN below an axis.
fn draw_nan(axis: &Axis, position: [f64; 2], svg: &mut SvgWriter) {
    if axis.nan > 0.0 {
        let style = TextStyle::new(TICK_SIZE, Anchor::Middle).color(MARK_COLOR);
        svg.text(position, &format!("NaN {}", percent(axis.nan)), style);
    }
}

/// A number from −1 to 1 for each pixel between the first and the last axis, in the colors of
/// [`Key::Differences`](super::Key::Differences).
#[derive(Clone, Debug, PartialEq)]
pub struct DifferenceImage {
    /// Differences row by row from the top: `[height × width]`.
    pub pixels: Vec<f32>,
    /// Width in pixels.
    pub width: usize,
}

impl DifferenceImage {
    fn draw(&self, area: &Rect, svg: &mut SvgWriter) {
        let theme = svg.theme();
        let color = |&difference: &f32| theme.difference_color(f64::from(difference));
        svg.image_of_colors(area, self.pixels.iter().map(color), self.width, false);
    }
}

impl DensityImage {
    fn draw(&self, area: &Rect, svg: &mut SvgWriter) {
        let theme = svg.theme();
        let colors = self
            .pixels
            .iter()
            .map(|&count| theme.count_color(count, self.max_count));
        svg.image_of_colors(area, colors, self.width, false);
    }
}

fn draw_axis(x: f64, area: &Rect, svg: &mut SvgWriter) {
    svg.line(
        &[[x, area.y], [x, area.bottom()]],
        Stroke::new(AXIS_COLOR, 1.2),
    );
}

/// Draws the name of an axis, with its unit if there is space. The name is moved so that it is
/// within the panel.
fn draw_name(axis: &Axis, [x, y]: [f64; 2], panel: &Rect, max_width: f64, svg: &mut SvgWriter) {
    let name_with_unit = axis.label();
    let name = if text_width(&name_with_unit, LABEL_SIZE, Weight::Regular) > max_width {
        &axis.name
    } else {
        &name_with_unit
    };
    let name = fit_text(
        name,
        max_width.min(panel.width),
        LABEL_SIZE,
        Weight::Regular,
    );
    let half_width = 0.5 * text_width(&name, LABEL_SIZE, Weight::Regular);
    let (min_x, max_x) = (panel.x + half_width, panel.right() - half_width);
    let x = x.clamp(min_x, max_x.max(min_x));
    svg.text([x, y], &name, TextStyle::new(LABEL_SIZE, Anchor::Middle));
}
