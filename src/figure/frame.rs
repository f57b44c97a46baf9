//! The frame of a panel: its title, its axes with their ticks, and the grid.

use super::color::{AXIS, GREY, GRID};
use super::drawing::{Anchor, Area, Drawing, Lettering, Stroke};
use super::font::{Weight, fitted, width};
use super::scale::Scale;

/// Sizes of letters.
pub(super) const TITLE: f64 = 13.0;
pub(super) const LABEL: f64 = 12.0;
pub(super) const TICK: f64 = 11.0;

/// Room for a panel's title.
pub(super) const HEAD: f64 = 24.0;

/// What a frame is drawn from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame<'a> {
    pub(super) title: &'a str,
    pub(super) x_label: &'a str,
    pub(super) y_label: &'a str,
    pub(super) x_range: [f64; 2],
    pub(super) y_range: [f64; 2],
    pub(super) grid: bool,
}

/// A frame that was drawn: where data go.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plot {
    pub(super) area: Area,
    pub(super) x: Scale,
    pub(super) y: Scale,
}

impl Plot {
    pub(super) fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.x.at(x), self.y.at(y)]
    }
}

impl Frame<'_> {
    pub(super) fn draw(&self, panel: &Area, drawing: &mut Drawing) -> Plot {
        let below = if self.x_label.is_empty() { 24.0 } else { 40.0 };
        let ticks_of_y = Scale::new(self.y_range, [0.0, 1.0]).ticks(count(panel.height - HEAD - below, 36.0));
        let widest = ticks_of_y.iter().map(|(_, text)| width(text, TICK, Weight::Regular)).fold(0.0, f64::max);
        let left = widest + if self.y_label.is_empty() { 12.0 } else { 30.0 };
        let area = panel.within([HEAD, 12.0, below, left]);
        let plot = Plot {
            area,
            x: Scale::new(self.x_range, [area.x, area.right()]),
            y: Scale::new(self.y_range, [area.bottom(), area.y]),
        };
        title(self.title, panel, area.x, drawing);
        self.draw_y(&plot, &ticks_of_y, panel, drawing);
        self.draw_x(&plot, panel, drawing);
        drawing.line(&[[area.x, area.y], [area.x, area.bottom()], [area.right(), area.bottom()]], Stroke::new(AXIS, 1.0));
        plot
    }

    fn draw_y(&self, plot: &Plot, ticks: &[(f64, String)], panel: &Area, drawing: &mut Drawing) {
        let area = plot.area;
        for (value, text) in ticks {
            let y = plot.y.at(*value);
            if self.grid {
                drawing.line(&[[area.x, y], [area.right(), y]], Stroke::new(GRID, 1.0));
            }
            drawing.text([area.x - 6.0, y + 4.0], text, Lettering::new(TICK, Anchor::End).color(GREY));
        }
        let label = fitted(self.y_label, panel.height, LABEL, Weight::Regular);
        if !label.is_empty() {
            let place = [panel.x + 12.0, area.y + area.height / 2.0];
            drawing.text(place, &label, Lettering::new(LABEL, Anchor::Middle).upwards());
        }
    }

    fn draw_x(&self, plot: &Plot, panel: &Area, drawing: &mut Drawing) {
        let area = plot.area;
        for (value, text) in plot.x.ticks(count(area.width, 52.0)) {
            let x = plot.x.at(value);
            drawing.line(&[[x, area.bottom()], [x, area.bottom() + 4.0]], Stroke::new(AXIS, 1.0));
            drawing.text([x, area.bottom() + 16.0], &text, Lettering::new(TICK, Anchor::Middle).color(GREY));
        }
        let label = fitted(self.x_label, panel.width, LABEL, Weight::Regular);
        if !label.is_empty() {
            drawing.text([area.x + area.width / 2.0, panel.bottom() - 7.0], &label, Lettering::new(LABEL, Anchor::Middle));
        }
    }
}

/// As many ticks as have room.
fn count(length: f64, each: f64) -> usize {
    ((length / each) as usize).clamp(3, 8)
}

/// A panel's title, beginning above `x`.
pub(super) fn title(title: &str, panel: &Area, x: f64, drawing: &mut Drawing) {
    let title = fitted(title, panel.right() - x, TITLE, Weight::Medium);
    if !title.is_empty() {
        drawing.text([x, panel.y + 14.0], &title, Lettering::new(TITLE, Anchor::Start).bold());
    }
}
