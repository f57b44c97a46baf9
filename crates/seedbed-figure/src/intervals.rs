//! A table of estimates: each row has a dot, its interval, and the numbers as text.

use super::color::{Color, GRID_COLOR, MUTED_COLOR};
use super::font::{Weight, fit_text, text_width};
use super::panel_axes::{LABEL_SIZE, TICK_SIZE, TITLE_HEIGHT, draw_title};
use super::scale::{Scale, extent, format_number, padded};
use super::svg::{Anchor, Rect, Stroke, SvgWriter, TextStyle};

/// Estimates with their intervals, one below the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Intervals {
    /// Title above the panel.
    pub title: String,
    /// Name of the estimated quantity, with its unit.
    pub x_label: String,
    /// Estimates, from top to bottom.
    pub rows: Vec<IntervalRow>,
    /// A value to compare with, such as 0 for differences, drawn as a dashed line.
    pub reference: Option<f64>,
}

/// One estimate.
#[derive(Clone, Debug, PartialEq)]
pub struct IntervalRow {
    /// Name of the row.
    pub name: String,
    /// The estimate; `None` if it does not exist, such as the median time to a goal that most runs
    /// did not reach. It is shown as `not reached`.
    pub estimate: Option<f64>,
    /// The interval; `None` if there are too few runs. An infinite end is an arrow to the edge of the
    /// plot.
    pub interval: Option<[f64; 2]>,
    /// Number of runs.
    pub n: usize,
    /// Color.
    pub color: Color,
}

/// Radius of a dot.
const DOT_RADIUS: f64 = 4.0;

/// Length of the head of an arrow.
const ARROW_LENGTH: f64 = 8.0;

/// Factor by which text may be wider in an SVG viewer that lacks the fonts of this crate.
const FONT_WIDTH_MARGIN: f64 = 1.15;

/// Height of a row.
const ROW_HEIGHT: f64 = 24.0;

impl Intervals {
    /// Height of a panel with all rows.
    #[must_use]
    pub fn height(&self) -> f64 {
        TITLE_HEIGHT + ROW_HEIGHT * self.rows.len() as f64 + 44.0
    }

    pub(super) fn draw(&self, panel: &Rect, svg: &mut SvgWriter) {
        let max_width = |texts: &mut dyn Iterator<Item = String>| {
            texts
                .map(|text| FONT_WIDTH_MARGIN * text_width(&text, LABEL_SIZE, Weight::Regular))
                .fold(0.0, f64::max)
        };
        let name_width = max_width(&mut self.rows.iter().map(|row| row.name.clone()))
            .min(0.4 * panel.width)
            + 12.0;
        let numbers_width = max_width(&mut self.rows.iter().map(IntervalRow::numbers_text)) + 16.0;
        let area = panel.inset([TITLE_HEIGHT, numbers_width, 44.0, name_width]);
        draw_title(&self.title, panel, panel.x + 4.0, svg);
        let scale = Scale::new(self.range(), [area.x, area.right()]);
        self.draw_axis(&scale, &area, panel, svg);
        let row_height = area.height / self.rows.len().max(1) as f64;
        for (index, row) in self.rows.iter().enumerate() {
            let y = area.y + row_height * (index as f64 + 0.5);
            let name = fit_text(&row.name, name_width - 8.0, LABEL_SIZE, Weight::Regular);
            svg.text(
                [area.x - 8.0, y + 4.0],
                &name,
                TextStyle::new(LABEL_SIZE, Anchor::End),
            );
            svg.text(
                [panel.right() - 4.0, y + 4.0],
                &row.numbers_text(),
                TextStyle::new(LABEL_SIZE, Anchor::End).color(MUTED_COLOR),
            );
            svg.clipped(&clip_area_with_dots(&area), |svg| {
                row.draw(&scale, &area, y, svg);
            });
        }
    }

    fn range(&self) -> [f64; 2] {
        let values = self
            .rows
            .iter()
            .flat_map(|row| row.interval.into_iter().flatten().chain(row.estimate));
        padded(extent(values.chain(self.reference)))
    }

    fn draw_axis(&self, scale: &Scale, area: &Rect, panel: &Rect, svg: &mut SvgWriter) {
        for (value, text) in scale.ticks(((area.width / 48.0) as usize).clamp(3, 8)) {
            let x = scale.position(value);
            svg.line(
                &[[x, area.y], [x, area.bottom()]],
                Stroke::new(GRID_COLOR, 1.0),
            );
            svg.text(
                [x, area.bottom() + 14.0],
                &text,
                TextStyle::new(TICK_SIZE, Anchor::Middle).color(MUTED_COLOR),
            );
        }
        if let Some(reference) = self.reference {
            let x = scale.position(reference);
            svg.line(
                &[[x, area.y], [x, area.bottom()]],
                Stroke {
                    dashed: true,
                    ..Stroke::new(MUTED_COLOR, 1.0)
                },
            );
        }
        let label = fit_text(&self.x_label, panel.width, LABEL_SIZE, Weight::Regular);
        svg.text(
            [area.x + area.width / 2.0, area.bottom() + 32.0],
            &label,
            TextStyle::new(LABEL_SIZE, Anchor::Middle),
        );
    }
}

/// The area of the plot, widened so that dots at its edges are not clipped.
fn clip_area_with_dots(area: &Rect) -> Rect {
    Rect {
        x: area.x - DOT_RADIUS,
        width: area.width + 2.0 * DOT_RADIUS,
        ..*area
    }
}

impl IntervalRow {
    fn draw(&self, scale: &Scale, area: &Rect, y: f64, svg: &mut SvgWriter) {
        if let Some([low, high]) = self.interval {
            // Position and, at an open end, direction of an arrow.
            let end = |value: f64, edge: f64, outward: f64| {
                if value.is_finite() {
                    (scale.position(value), None)
                } else {
                    (edge, Some(outward))
                }
            };
            let ends = [end(low, area.x, -1.0), end(high, area.right(), 1.0)];
            let shaft = ends.map(|(x, arrow)| [x - ARROW_LENGTH * arrow.unwrap_or(0.0), y]);
            svg.line(&shaft, Stroke::new(self.color, 2.0));
            for (x, arrow) in ends {
                self.draw_end([x, y], arrow, svg);
            }
        }
        if let Some(estimate) = self.estimate.filter(|estimate| estimate.is_finite()) {
            svg.dot([scale.position(estimate), y], DOT_RADIUS, self.color, 1.0);
        }
    }

    /// Draws a cap or, at an open end, the head of an arrow.
    fn draw_end(&self, [x, y]: [f64; 2], arrow: Option<f64>, svg: &mut SvgWriter) {
        let Some(outward) = arrow else {
            svg.line(&[[x, y - 4.0], [x, y + 4.0]], Stroke::new(self.color, 1.5));
            return;
        };
        let base = x - ARROW_LENGTH * outward;
        svg.polygon(&[[x, y], [base, y - 4.5], [base, y + 4.5]], self.color, 1.0);
    }

    /// Estimate, interval and number of runs as text, such as `127.5 [80, 134], n = 10`.
    fn numbers_text(&self) -> String {
        let estimate = self
            .estimate
            .map_or("not reached".to_owned(), format_number);
        let interval = match self.interval {
            None => String::new(),
            Some([low, high]) if low.is_infinite() && high.is_infinite() => " [open]".to_owned(),
            Some([low, high]) if high.is_infinite() => {
                format!(" [at least {}]", format_number(low))
            }
            Some([low, high]) if low.is_infinite() => {
                format!(" [at most {}]", format_number(high))
            }
            Some([low, high]) => format!(" [{}, {}]", format_number(low), format_number(high)),
        };
        format!("{estimate}{interval}, n = {}", self.n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_text_has_estimate_interval_and_number_of_runs() {
        let row = |estimate, interval| IntervalRow {
            name: String::new(),
            estimate,
            interval,
            n: 10,
            color: [0; 3],
        };
        assert_eq!(
            row(Some(127.5), Some([80.0, 134.0])).numbers_text(),
            "127.5 [80, 134], n = 10"
        );
        assert_eq!(
            row(None, Some([210.0, f64::INFINITY])).numbers_text(),
            "not reached [at least 210], n = 10"
        );
        assert_eq!(
            row(Some(3.0), Some([f64::NEG_INFINITY, 7.0])).numbers_text(),
            "3 [at most 7], n = 10"
        );
        assert_eq!(row(None, None).numbers_text(), "not reached, n = 10");
        assert_eq!(row(Some(-6.0), None).numbers_text(), "−6, n = 10");
    }

    /// A closed interval has two caps, which are vertical lines. At an open end there is the head of an
    /// arrow instead, whose tip is at the edge of the plot.
    #[test]
    fn an_open_end_is_an_arrow() {
        let drawn = |interval| {
            let row = IntervalRow {
                name: String::new(),
                estimate: None,
                interval: Some(interval),
                n: 10,
                color: [0; 3],
            };
            let area = Rect {
                x: 0.0,
                y: 0.0,
                width: 100.0,
                height: 20.0,
            };
            let scale = Scale::new([0.0, 200.0], [0.0, 100.0]);
            let mut svg = SvgWriter::default();
            row.draw(&scale, &area, 10.0, &mut svg);
            svg.into_svg([100.0, 20.0], 1.0, "", "")
        };
        let cap = |x: f64| format!("M{x} 6L{x} 14");
        let [right, left] = ["M100 10L92 5.5L92 14.5", "M0 10L8 5.5L8 14.5"];
        let closed = drawn([40.0, 100.0]);
        assert!(closed.contains(&cap(20.0)) && closed.contains(&cap(50.0)));
        assert!(!closed.contains(right) && !closed.contains(left));
        let at_least = drawn([40.0, f64::INFINITY]);
        assert!(at_least.contains(&cap(20.0)), "{at_least}");
        assert!(
            at_least.contains(right) && !at_least.contains(&cap(100.0)),
            "{at_least}"
        );
        let at_most = drawn([f64::NEG_INFINITY, 100.0]);
        assert!(
            at_most.contains(left) && !at_most.contains(&cap(0.0)),
            "{at_most}"
        );
    }
}
