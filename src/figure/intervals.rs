//! A table of estimates as dots with their intervals, and the numbers beside them.

use super::color::{Color, GREY, GRID};
use super::drawing::{Anchor, Area, Drawing, Lettering, Stroke};
use super::font::{Weight, fitted, width};
use super::frame::{HEAD, LABEL, TICK, title};
use super::scale::{Scale, extent, padded, written};

/// Estimates with their intervals, one below the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Intervals {
    /// Stands above the panel.
    pub title: String,
    /// What is estimated, with its unit.
    pub x_label: String,
    /// From top to bottom.
    pub rows: Vec<IntervalRow>,
    /// A value to compare with, such as 0 for differences: a dashed line.
    pub reference: Option<f64>,
}

/// One estimate.
#[derive(Clone, Debug, PartialEq)]
pub struct IntervalRow {
    /// What is compared.
    pub name: String,
    /// The estimate; none where it is a time that was not reached.
    pub estimate: Option<f64>,
    /// Its interval; none where there are too few runs. An end that is not finite reaches to the edge.
    pub interval: Option<[f64; 2]>,
    /// How many runs it is from.
    pub n: usize,
    /// Its colour.
    pub color: Color,
}

/// The radius of a dot.
const DOT: f64 = 4.0;

/// How much broader the letters of a reader may be who has not those of the page.
const BROADER: f64 = 1.15;

/// The height of a row.
const LINE: f64 = 24.0;

impl Intervals {
    /// The height in which all rows have room.
    #[must_use]
    pub fn height(&self) -> f64 {
        HEAD + LINE * self.rows.len() as f64 + 44.0
    }

    pub(super) fn draw(&self, panel: &Area, drawing: &mut Drawing) {
        let widest = |texts: &mut dyn Iterator<Item = String>| {
            texts
                .map(|text| BROADER * width(&text, LABEL, Weight::Regular))
                .fold(0.0, f64::max)
        };
        let names =
            widest(&mut self.rows.iter().map(|row| row.name.clone())).min(0.4 * panel.width) + 12.0;
        let numbers = widest(&mut self.rows.iter().map(IntervalRow::numbers)) + 16.0;
        let area = panel.within([HEAD, numbers, 44.0, names]);
        title(&self.title, panel, panel.x + 4.0, drawing);
        let scale = Scale::new(self.range(), [area.x, area.right()]);
        self.draw_axis(&scale, &area, panel, drawing);
        let each = area.height / self.rows.len().max(1) as f64;
        for (index, row) in self.rows.iter().enumerate() {
            let y = area.y + each * (index as f64 + 0.5);
            let name = fitted(&row.name, names - 8.0, LABEL, Weight::Regular);
            drawing.text(
                [area.x - 8.0, y + 4.0],
                &name,
                Lettering::new(LABEL, Anchor::End),
            );
            drawing.text(
                [panel.right() - 4.0, y + 4.0],
                &row.numbers(),
                Lettering::new(LABEL, Anchor::End).color(GREY),
            );
            drawing.clipped(&with_room_for_dots(&area), |drawing| {
                row.draw(&scale, &area, y, drawing)
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

    fn draw_axis(&self, scale: &Scale, area: &Area, panel: &Area, drawing: &mut Drawing) {
        for (value, text) in scale.ticks(((area.width / 48.0) as usize).clamp(3, 8)) {
            let x = scale.at(value);
            drawing.line(&[[x, area.y], [x, area.bottom()]], Stroke::new(GRID, 1.0));
            drawing.text(
                [x, area.bottom() + 14.0],
                &text,
                Lettering::new(TICK, Anchor::Middle).color(GREY),
            );
        }
        if let Some(reference) = self.reference {
            let x = scale.at(reference);
            drawing.line(
                &[[x, area.y], [x, area.bottom()]],
                Stroke {
                    dashed: true,
                    ..Stroke::new(GREY, 1.0)
                },
            );
        }
        let label = fitted(&self.x_label, panel.width, LABEL, Weight::Regular);
        drawing.text(
            [area.x + area.width / 2.0, area.bottom() + 32.0],
            &label,
            Lettering::new(LABEL, Anchor::Middle),
        );
    }
}

/// A dot at the very edge shows all of itself.
fn with_room_for_dots(area: &Area) -> Area {
    Area {
        x: area.x - DOT,
        width: area.width + 2.0 * DOT,
        ..*area
    }
}

impl IntervalRow {
    fn draw(&self, scale: &Scale, area: &Area, y: f64, drawing: &mut Drawing) {
        if let Some([low, high]) = self.interval {
            let place = |end: f64, edge: f64| if end.is_finite() { scale.at(end) } else { edge };
            let ends = [place(low, area.x), place(high, area.right())];
            drawing.line(&[[ends[0], y], [ends[1], y]], Stroke::new(self.color, 2.0));
            for x in ends {
                drawing.line(&[[x, y - 4.0], [x, y + 4.0]], Stroke::new(self.color, 1.5));
            }
        }
        if let Some(estimate) = self.estimate.filter(|estimate| estimate.is_finite()) {
            drawing.dot([scale.at(estimate), y], DOT, self.color, 1.0);
        }
    }

    /// Such as `127.5 [80, 134], n = 10`.
    fn numbers(&self) -> String {
        let estimate = self.estimate.map_or("not reached".to_owned(), written);
        let interval = match self.interval {
            None => String::new(),
            Some([low, high]) if high == f64::INFINITY => format!(" [from {}]", written(low)),
            Some([low, high]) => format!(" [{}, {}]", written(low), written(high)),
        };
        format!("{estimate}{interval}, n = {}", self.n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_beside_their_dots() {
        let row = |estimate, interval| IntervalRow {
            name: String::new(),
            estimate,
            interval,
            n: 10,
            color: [0; 3],
        };
        assert_eq!(
            row(Some(127.5), Some([80.0, 134.0])).numbers(),
            "127.5 [80, 134], n = 10"
        );
        assert_eq!(
            row(None, Some([210.0, f64::INFINITY])).numbers(),
            "not reached [from 210], n = 10"
        );
        assert_eq!(row(None, None).numbers(), "not reached, n = 10");
        assert_eq!(row(Some(-6.0), None).numbers(), "−6, n = 10");
    }
}
