//! Two dimensions against each other: as points, or as counts.

use super::color::{Color, of_count};
use super::drawing::{Area, Drawing};
use super::frame::{Frame, Plot};
use super::pixels;
use crate::env::Quantity;

/// Points of two dimensions.
#[derive(Clone, Debug, PartialEq)]
pub struct Scatter {
    /// Stands above the panel.
    pub title: String,
    /// To the right: name, unit and range.
    pub x: Quantity,
    /// Upwards: name, unit and range.
    pub y: Quantity,
    /// The later ones on top.
    pub points: Vec<ScatterPoint>,
}

/// One point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScatterPoint {
    /// (x, y); what lies beyond the ranges is drawn at their ends.
    pub at: [f32; 2],
    /// Its colour.
    pub color: Color,
}

/// How often each cell of a grid was visited. Colours are those of [`Key::Counts`](super::Key::Counts).
#[derive(Clone, Debug, PartialEq)]
pub struct HeatMap {
    /// Stands above the panel.
    pub title: String,
    /// To the right: name, unit and range.
    pub x: Quantity,
    /// Upwards: name, unit and range.
    pub y: Quantity,
    /// Row by row from the lowest: `[rows × columns]`.
    pub counts: Vec<u32>,
    /// Cells to the right.
    pub columns: usize,
    /// The count that has the darkest colour.
    pub most: u32,
}

impl Scatter {
    pub(super) fn draw(&self, panel: &Area, drawing: &mut Drawing) {
        let plot = frame(&self.title, &self.x, &self.y, panel, drawing);
        let (radius, opacity) = if self.points.len() > 500 {
            (1.3, 0.5)
        } else {
            (2.2, 0.7)
        };
        for point in &self.points {
            let within = |value: f32, [low, high]: [f32; 2]| f64::from(value.clamp(low, high));
            let at = plot.at([
                within(point.at[0], self.x.range),
                within(point.at[1], self.y.range),
            ]);
            drawing.dot(at, radius, point.color, opacity);
        }
    }
}

impl HeatMap {
    pub(super) fn draw(&self, panel: &Area, drawing: &mut Drawing) {
        let plot = frame(&self.title, &self.x, &self.y, panel, drawing);
        let from_the_top = self.counts.chunks(self.columns.max(1)).rev().flatten();
        let colors: Vec<Color> = from_the_top
            .map(|&count| of_count(count, self.most))
            .collect();
        if !colors.is_empty() {
            drawing.image(&plot.area, &pixels::picture(&colors, self.columns), true);
        }
    }
}

fn frame(title: &str, x: &Quantity, y: &Quantity, panel: &Area, drawing: &mut Drawing) -> Plot {
    let frame = Frame {
        title,
        x_label: &name(x),
        y_label: &name(y),
        x_range: x.range.map(f64::from),
        y_range: y.range.map(f64::from),
        y_logarithmic: false,
        grid: false,
    };
    frame.draw(panel, drawing)
}

/// Such as `angle [rad]`.
pub(super) fn name(quantity: &Quantity) -> String {
    if quantity.unit.is_empty() {
        quantity.name.clone()
    } else {
        format!("{} [{}]", quantity.name, quantity.unit)
    }
}
