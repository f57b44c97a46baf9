//! Plots of two dimensions against each other: as points, or as counts.

use super::color::{Color, count_color};
use super::panel_axes::{PanelAxes, Plot};
use super::pixels;
use super::scale::percent;
use super::svg::{Rect, SvgWriter};
use crate::Axis;

/// Points of two dimensions.
#[derive(Clone, Debug, PartialEq)]
pub struct Scatter {
    /// Title above the panel.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// Points; later ones are drawn on top.
    pub points: Vec<ScatterPoint>,
}

/// One point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScatterPoint {
    /// Position (x, y). Values outside the range of an axis are drawn at its end; a point with a NaN is
    /// not drawn.
    pub position: [f32; 2],
    /// Color.
    pub color: Color,
}

/// Counts over the cells of a grid, in the colors of [`Key::Counts`](super::Key::Counts).
#[derive(Clone, Debug, PartialEq)]
pub struct HeatMap {
    /// Title above the panel.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// Counts row by row, beginning with the lowest row: `[rows × columns]`.
    pub counts: Vec<u32>,
    /// Number of columns.
    pub columns: usize,
    /// The count with the darkest color.
    pub max_count: u32,
}

impl Scatter {
    pub(super) fn draw(&self, panel: &Rect, svg: &mut SvgWriter) {
        let plot = draw_axes(&self.title, &self.x, &self.y, panel, svg);
        let (radius, opacity) = if self.points.len() > 500 {
            (1.3, 0.5)
        } else {
            (2.2, 0.7)
        };
        let is_nan = |point: &&ScatterPoint| point.position.iter().any(|value| value.is_nan());
        for point in self.points.iter().filter(|point| !is_nan(point)) {
            let within = |value: f32, [low, high]: [f32; 2]| f64::from(value.clamp(low, high));
            let position = plot.position([
                within(point.position[0], self.x.range),
                within(point.position[1], self.y.range),
            ]);
            svg.dot(position, radius, point.color, opacity);
        }
    }
}

impl HeatMap {
    pub(super) fn draw(&self, panel: &Rect, svg: &mut SvgWriter) {
        let plot = draw_axes(&self.title, &self.x, &self.y, panel, svg);
        let from_the_top = self.counts.chunks(self.columns.max(1)).rev().flatten();
        let colors: Vec<Color> = from_the_top
            .map(|&count| count_color(count, self.max_count))
            .collect();
        if !colors.is_empty() {
            svg.image(
                &plot.area,
                &pixels::png_of_colors(&colors, self.columns),
                true,
            );
        }
    }
}

fn draw_axes(title: &str, x: &Axis, y: &Axis, panel: &Rect, svg: &mut SvgWriter) -> Plot {
    let axes = PanelAxes {
        title,
        x_label: &axis_label_with_shares(x),
        y_label: &axis_label_with_shares(y),
        x_range: x.range.map(f64::from),
        y_range: y.range.map(f64::from),
        x_ticks: &[],
        y_logarithmic: false,
        has_grid: false,
    };
    axes.draw(panel, svg)
}

/// Name and unit of an axis, with the shares of values that are not drawn at their place, such as
/// `angle [rad] (NaN 30 %, outside 2 %)`.
fn axis_label_with_shares(axis: &Axis) -> String {
    let outside = axis.outside.iter().sum();
    let shares: Vec<String> = [("NaN", axis.nan), ("outside", outside)]
        .into_iter()
        .filter(|(_, share)| *share > 0.0)
        .map(|(name, share)| format!("{name} {}", percent(share)))
        .collect();
    if shares.is_empty() {
        axis.label()
    } else {
        format!("{} ({})", axis.label(), shares.join(", "))
    }
}
