//! Shapes in a plane, drawn to scale.

use super::color::Color;
use super::panel_axes::{TITLE_HEIGHT, draw_title};
use super::svg::{Rect, Stroke, SvgWriter};

/// Shapes in a plane whose y axis points down.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawing {
    /// Title above the panel.
    pub title: String,
    /// Shapes; later ones are drawn on top.
    pub shapes: Vec<DrawnShape>,
    /// Left, right, upper and lower end of the part of the plane that is shown. It is extended to
    /// the proportions of the panel.
    pub bounds: [f32; 4],
}

/// A polygon or a line.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnShape {
    /// Points in the plane.
    pub points: Vec<[f32; 2]>,
    /// Color.
    pub color: Color,
    /// Thickness of the line, in the unit of the plane; `None` fills the polygon.
    pub thickness: Option<f32>,
}

/// Minimum thickness of a line, in pixels.
const MIN_THICKNESS: f64 = 1.5;

impl Drawing {
    pub(super) fn draw(&self, panel: &Rect, svg: &mut SvgWriter) {
        draw_title(&self.title, panel, panel.x + 4.0, svg);
        let area = panel.inset([TITLE_HEIGHT, 4.0, 4.0, 4.0]);
        let [left, right, top, bottom] = self.bounds.map(f64::from);
        let scale = (area.width / (right - left)).min(area.height / (bottom - top));
        let center = [0.5 * (left + right), 0.5 * (top + bottom)];
        let position = |&[x, y]: &[f32; 2]| {
            [
                area.x + 0.5 * area.width + scale * (f64::from(x) - center[0]),
                area.y + 0.5 * area.height + scale * (f64::from(y) - center[1]),
            ]
        };
        svg.clipped(&area, |svg| {
            for shape in &self.shapes {
                let points: Vec<[f64; 2]> = shape.points.iter().map(position).collect();
                shape.draw(&points, scale, svg);
            }
        });
    }
}

impl DrawnShape {
    fn draw(&self, points: &[[f64; 2]], scale: f64, svg: &mut SvgWriter) {
        match self.thickness {
            None => svg.polygon(points, self.color, 1.0),
            Some(thickness) => {
                let width = (scale * f64::from(thickness)).max(MIN_THICKNESS);
                svg.line(points, Stroke::new(self.color, width).round());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of 2 by 2 in a panel of 200 by 124, of which 100 remain below the title and within
    /// margins: 96 / 2 = 48 pixels per unit.
    #[test]
    fn shapes_keep_their_proportions() {
        let square = DrawnShape {
            points: vec![[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]],
            color: [0; 3],
            thickness: None,
        };
        let drawing = Drawing {
            shapes: vec![square],
            bounds: [-1.0, 1.0, -1.0, 1.0],
            ..Drawing::default()
        };
        let panel = Rect {
            x: 0.0,
            y: 0.0,
            width: 200.0,
            height: 24.0 + 4.0 + 96.0,
        };
        let mut svg = SvgWriter::default();
        drawing.draw(&panel, &mut svg);
        let text = svg.into_svg([200.0, 124.0], 1.0, "", "");
        assert!(text.contains("M52 24L148 24L148 120L52 120Z"), "{text}");
    }
}
