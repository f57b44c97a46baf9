//! The frame of a panel: its title, its axes with their ticks, and the grid.

use super::color::{AXIS, GREY, GRID};
use super::drawing::{Anchor, Area, Drawing, Lettering, Stroke};
use super::font::{Weight, fitted, width};
use super::scale::Scale;

/// Sizes of letters.
pub(super) const TITLE: f64 = 13.0;
pub(super) const LABEL: f64 = 12.0;
pub(super) const TICK: f64 = 11.0;
const SMALL: f64 = 10.5;

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
    pub(super) y_logarithmic: bool,
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
    /// Where data will go.
    pub(super) fn plot(&self, panel: &Area) -> Plot {
        let below = self.below();
        let widest = self
            .ticks_of_y(panel)
            .iter()
            .map(|(_, text)| width(text, TICK, Weight::Regular))
            .fold(0.0, f64::max);
        let left = widest + if self.y_label.is_empty() { 12.0 } else { 30.0 };
        let area = panel.within([HEAD, 12.0, below, left]);
        Plot {
            area,
            x: Scale::new(self.x_range, [area.x, area.right()]),
            y: Scale::new(self.y_range, [area.bottom(), area.y]).logarithmic(self.y_logarithmic),
        }
    }

    fn below(&self) -> f64 {
        if self.x_label.is_empty() { 24.0 } else { 40.0 }
    }

    fn ticks_of_y(&self, panel: &Area) -> Vec<(f64, String)> {
        let scale = Scale::new(self.y_range, [0.0, 1.0]).logarithmic(self.y_logarithmic);
        scale.ticks(count(panel.height - HEAD - self.below(), 36.0))
    }

    pub(super) fn draw(&self, panel: &Area, drawing: &mut Drawing) -> Plot {
        let (plot, ticks_of_y) = (self.plot(panel), self.ticks_of_y(panel));
        let area = plot.area;
        title(self.title, panel, area.x, drawing);
        self.draw_y(&plot, &ticks_of_y, panel, drawing);
        self.draw_x(&plot, panel, drawing);
        drawing.line(
            &[
                [area.x, area.y],
                [area.x, area.bottom()],
                [area.right(), area.bottom()],
            ],
            Stroke::new(AXIS, 1.0),
        );
        plot
    }

    fn draw_y(&self, plot: &Plot, ticks: &[(f64, String)], panel: &Area, drawing: &mut Drawing) {
        let area = plot.area;
        for (value, text) in ticks {
            let y = plot.y.at(*value);
            if self.grid {
                drawing.line(&[[area.x, y], [area.right(), y]], Stroke::new(GRID, 1.0));
            }
            drawing.text(
                [area.x - 6.0, y + 4.0],
                text,
                Lettering::new(TICK, Anchor::End).color(GREY),
            );
        }
        let label = fitted(self.y_label, panel.height, LABEL, Weight::Regular);
        if !label.is_empty() {
            let place = [panel.x + 12.0, area.y + area.height / 2.0];
            drawing.text(
                place,
                &label,
                Lettering::new(LABEL, Anchor::Middle).upwards(),
            );
        }
    }

    fn draw_x(&self, plot: &Plot, panel: &Area, drawing: &mut Drawing) {
        let area = plot.area;
        for (value, text) in plot.x.ticks(count(area.width, 52.0)) {
            let x = plot.x.at(value);
            drawing.line(
                &[[x, area.bottom()], [x, area.bottom() + 4.0]],
                Stroke::new(AXIS, 1.0),
            );
            drawing.text(
                [x, area.bottom() + 16.0],
                &text,
                Lettering::new(TICK, Anchor::Middle).color(GREY),
            );
        }
        let label = fitted(self.x_label, panel.width, LABEL, Weight::Regular);
        if !label.is_empty() {
            drawing.text(
                [area.x + area.width / 2.0, panel.bottom() - 7.0],
                &label,
                Lettering::new(LABEL, Anchor::Middle),
            );
        }
    }
}

/// As many ticks as have room.
fn count(length: f64, each: f64) -> usize {
    ((length / each) as usize).clamp(3, 8)
}

/// A panel's title, beginning above `x`: a long one in small letters, a longer one on two lines.
pub(super) fn title(title: &str, panel: &Area, x: f64, drawing: &mut Drawing) {
    let room = panel.right() - x;
    let fits = |size: f64| width(title, size, Weight::Medium) <= room;
    let (lines, size, first) = match (fits(TITLE), fits(TICK)) {
        (true, _) => (vec![title.to_owned()], TITLE, 14.0),
        (_, true) => (vec![title.to_owned()], TICK, 14.0),
        _ => (in_two_lines(title, room, SMALL), SMALL, 8.0),
    };
    for (line, text) in lines
        .iter()
        .enumerate()
        .filter(|(_, text)| !text.is_empty())
    {
        let y = panel.y + first + (SMALL + 1.0) * line as f64;
        drawing.text([x, y], text, Lettering::new(size, Anchor::Start).bold());
    }
}

/// Broken after a colon where both parts have room, or else after as many words as have; what is left is shortened if it must be.
fn in_two_lines(text: &str, room: f64, size: f64) -> Vec<String> {
    let fits = |text: &str| width(text, size, Weight::Medium) <= room;
    let after_colon = text
        .find(": ")
        .map(|at| at + 1)
        .filter(|&at| fits(&text[..at]) && fits(&text[at + 1..]));
    let last = || {
        text.rmatch_indices(' ')
            .map(|(at, _)| at)
            .find(|&at| fits(&text[..at]))
    };
    let break_at = after_colon.or_else(last);
    let (first, rest) = break_at.map_or((text, ""), |at| (&text[..at], &text[at + 1..]));
    [first, rest]
        .map(|line| fitted(line, room, size, Weight::Medium))
        .to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_title_takes_two_lines() {
        let title = "16 agents together: 277,974 states";
        let room = |text: &str| width(text, SMALL, Weight::Medium);
        assert_eq!(
            in_two_lines(title, room("16 agents together: 277,974"), SMALL),
            ["16 agents together:", "277,974 states"]
        );
        let long = "Thompson resampling of seeds: 880 states";
        assert_eq!(
            in_two_lines(long, room("Thompson resampling o"), SMALL),
            ["Thompson resampling", "of seeds: 880 states"]
        );
        let lines = in_two_lines("incomprehensibilities", 40.0, SMALL);
        assert!(lines[0].ends_with('…') && lines[1].is_empty(), "{lines:?}");
    }
}
