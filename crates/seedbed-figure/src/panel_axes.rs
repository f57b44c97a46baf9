//! What surrounds the data of a panel: title, axes with ticks, and grid.

use super::color::{AXIS_COLOR, GRID_COLOR, MUTED_COLOR};
use super::font::{Weight, fit_text, text_width};
use super::scale::Scale;
use super::svg::{Anchor, PanelTitle, Rect, Stroke, SvgWriter, TextStyle};

/// Font sizes.
pub(super) const TITLE_SIZE: f64 = 13.0;
/// Size of the letters of axis labels, in CSS pixels.
pub(super) const LABEL_SIZE: f64 = 12.0;
pub(super) const TICK_SIZE: f64 = 11.0;
const SMALL_TITLE_SIZE: f64 = 10.5;

/// Height of a panel's title.
pub(super) const TITLE_HEIGHT: f64 = 24.0;

/// Title, axes and grid of a panel.
#[derive(Clone, Copy, Debug)]
pub(super) struct PanelAxes<'a> {
    pub(super) title: &'a str,
    pub(super) x_label: &'a str,
    pub(super) y_label: &'a str,
    pub(super) x_range: [f64; 2],
    pub(super) y_range: [f64; 2],
    /// Ticks of the x axis; empty for round values.
    pub(super) x_ticks: &'a [(f64, String)],
    /// Whether the x axis and the y axis are logarithmic.
    pub(super) logarithmic: [bool; 2],
    pub(super) has_grid: bool,
}

/// The rectangle of a panel in which data are drawn, with its scales.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plot {
    pub(super) area: Rect,
    pub(super) x: Scale,
    pub(super) y: Scale,
}

impl Plot {
    pub(super) fn position(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.x.position(x), self.y.position(y)]
    }
}

impl PanelAxes<'_> {
    /// The plot within a panel, without drawing anything.
    pub(super) fn plot(&self, panel: &Rect) -> Plot {
        let bottom_margin = self.bottom_margin();
        let max_width = self
            .ticks_of_y(panel)
            .iter()
            .map(|(_, text)| text_width(text, TICK_SIZE, Weight::Regular))
            .fold(0.0, f64::max);
        let left = max_width + if self.y_label.is_empty() { 12.0 } else { 30.0 };
        let area = panel.inset([TITLE_HEIGHT, 12.0, bottom_margin, left]);
        Plot {
            area,
            x: Scale::new(self.x_range, [area.x, area.right()]).logarithmic(self.logarithmic[0]),
            y: Scale::new(self.y_range, [area.bottom(), area.y]).logarithmic(self.logarithmic[1]),
        }
    }

    fn bottom_margin(&self) -> f64 {
        if self.x_label.is_empty() { 24.0 } else { 40.0 }
    }

    fn ticks_of_y(&self, panel: &Rect) -> Vec<(f64, String)> {
        let scale = Scale::new(self.y_range, [0.0, 1.0]).logarithmic(self.logarithmic[1]);
        let height = panel.height - TITLE_HEIGHT - self.bottom_margin();
        let most = (height / LINE_OF_TICK) as usize;
        scale.ticks(tick_count(height, 36.0).min(most.max(1)))
    }

    pub(super) fn draw(&self, panel: &Rect, svg: &mut SvgWriter) -> Plot {
        let (plot, ticks_of_y) = (self.plot(panel), self.ticks_of_y(panel));
        let area = plot.area;
        draw_title(self.title, panel, area.x, svg);
        self.draw_y_axis(&plot, &ticks_of_y, panel, svg);
        self.draw_x_axis(&plot, panel, svg);
        svg.line(
            &[
                [area.x, area.y],
                [area.x, area.bottom()],
                [area.right(), area.bottom()],
            ],
            Stroke::new(AXIS_COLOR, 1.0),
        );
        plot
    }

    fn draw_y_axis(&self, plot: &Plot, ticks: &[(f64, String)], panel: &Rect, svg: &mut SvgWriter) {
        let area = plot.area;
        for (value, text) in ticks {
            let y = plot.y.position(*value);
            if self.has_grid {
                svg.line(
                    &[[area.x, y], [area.right(), y]],
                    Stroke::new(GRID_COLOR, 1.0),
                );
            }
            svg.text(
                [area.x - 6.0, y + 4.0],
                text,
                TextStyle::new(TICK_SIZE, Anchor::End).color(MUTED_COLOR),
            );
        }
        let label = fit_text(self.y_label, panel.height, LABEL_SIZE, Weight::Regular);
        if !label.is_empty() {
            let position = [panel.x + 12.0, area.y + area.height / 2.0];
            svg.text(
                position,
                &label,
                TextStyle::new(LABEL_SIZE, Anchor::Middle).upward(),
            );
        }
    }

    fn draw_x_axis(&self, plot: &Plot, panel: &Rect, svg: &mut SvgWriter) {
        let area = plot.area;
        let ticks = if self.x_ticks.is_empty() {
            ticks_side_by_side(&plot.x, tick_count(area.width, 52.0))
        } else {
            self.x_ticks.to_vec()
        };
        for (value, text) in ticks {
            let x = plot.x.position(value);
            svg.line(
                &[[x, area.bottom()], [x, area.bottom() + 4.0]],
                Stroke::new(AXIS_COLOR, 1.0),
            );
            svg.text(
                [x, area.bottom() + 16.0],
                &text,
                TextStyle::new(TICK_SIZE, Anchor::Middle).color(MUTED_COLOR),
            );
        }
        let label = fit_text(self.x_label, panel.width, LABEL_SIZE, Weight::Regular);
        if !label.is_empty() {
            let half = text_width(&label, LABEL_SIZE, Weight::Regular) / 2.0;
            let center = area.x + area.width / 2.0;
            let center = center.min(panel.right() - half).max(panel.x + half);
            svg.text(
                [center, panel.bottom() - 7.0],
                &label,
                TextStyle::new(LABEL_SIZE, Anchor::Middle),
            );
        }
    }
}

/// At most about `count` ticks at round values, and fewer if their labels would touch.
pub(super) fn ticks_side_by_side(scale: &Scale, count: usize) -> Vec<(f64, String)> {
    let touch = |ticks: &[(f64, String)]| {
        ticks.windows(2).any(|pair| {
            let [one, next] = [&pair[0], &pair[1]];
            let widths = [one, next].map(|tick| text_width(&tick.1, TICK_SIZE, Weight::Regular));
            let distance = scale.position(next.0) - scale.position(one.0);
            distance < f64::midpoint(widths[0], widths[1]) + MIN_GAP_OF_TICKS
        })
    };
    let mut fewer = (1..=count).rev().map(|count| scale.ticks(count));
    let fitting = fewer.find(|ticks| !touch(ticks));
    fitting.unwrap_or_default()
}

/// Minimum distance between ticks one above the other.
const LINE_OF_TICK: f64 = 16.0;

/// Minimum distance between the labels of ticks side by side.
const MIN_GAP_OF_TICKS: f64 = 4.0;

/// Number of ticks that fit on an axis: one per `length_per_tick`, from 3 to 8.
fn tick_count(length: f64, length_per_tick: f64) -> usize {
    ((length / length_per_tick) as usize).clamp(3, 8)
}

/// Adds the title of a panel, starting at `x`.
pub(super) fn draw_title(title: &str, panel: &Rect, x: f64, svg: &mut SvgWriter) {
    svg.add_title(|place| PanelTitle {
        text: title.to_owned(),
        x,
        y: panel.y,
        max_width: panel.right() - x,
        place,
    });
}

/// Draws the titles of the panels of a row, all with the largest font in which each of them fits; if none fits, in two
/// lines.
pub(super) fn draw_titles_of_row(svg: &mut SvgWriter) {
    let titles = svg.take_titles();
    let fit = |size: f64| {
        titles
            .iter()
            .all(|title| text_width(&title.text, size, Weight::Medium) <= title.max_width)
    };
    let size = [TITLE_SIZE, TICK_SIZE].into_iter().find(|size| fit(*size));
    // The last one first, so that the places of others do not change.
    for title in titles.iter().rev() {
        svg.insert_at(title.place, |svg| draw_title_with(title, size, svg));
    }
}

/// Draws a title in one line of this size, or in two lines.
fn draw_title_with(title: &PanelTitle, size: Option<f64>, svg: &mut SvgWriter) {
    let (lines, size, first_baseline) = match size {
        Some(size) => (vec![title.text.clone()], size, 14.0),
        None => (
            split_title(&title.text, title.max_width, SMALL_TITLE_SIZE),
            SMALL_TITLE_SIZE,
            8.0,
        ),
    };
    let lines = lines.iter().enumerate();
    for (line, text) in lines.filter(|(_, text)| !text.is_empty()) {
        let y = title.y + first_baseline + (SMALL_TITLE_SIZE + 1.0) * line as f64;
        let style = TextStyle::new(size, Anchor::Start).bold();
        svg.text([title.x, y], text, style);
    }
}

/// Splits a title after a colon if both parts fit, otherwise after as many words as fit. Parts that
/// are still too long are shortened.
fn split_title(text: &str, max_width: f64, size: f64) -> Vec<String> {
    let fits = |text: &str| text_width(text, size, Weight::Medium) <= max_width;
    let after_colon = text
        .find(": ")
        .map(|index| index + 1)
        .filter(|&index| fits(&text[..index]) && fits(&text[index + 1..]));
    let last_fitting_space = || {
        text.rmatch_indices(' ')
            .map(|(index, _)| index)
            .find(|&index| fits(&text[..index]))
    };
    let break_at = after_colon.or_else(last_fitting_space);
    let (first_line, second_line) =
        break_at.map_or((text, ""), |index| (&text[..index], &text[index + 1..]));
    [first_line, second_line]
        .map(|line| fit_text(line, max_width, size, Weight::Medium))
        .to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_title_takes_two_lines() {
        let title = "16 agents together: 277,974 states";
        let width = |text: &str| text_width(text, SMALL_TITLE_SIZE, Weight::Medium);
        assert_eq!(
            split_title(
                title,
                width("16 agents together: 277,974"),
                SMALL_TITLE_SIZE
            ),
            ["16 agents together:", "277,974 states"]
        );
        let long = "Thompson resampling of seeds: 880 states";
        assert_eq!(
            split_title(long, width("Thompson resampling o"), SMALL_TITLE_SIZE),
            ["Thompson resampling", "of seeds: 880 states"]
        );
        let lines = split_title("incomprehensibilities", 40.0, SMALL_TITLE_SIZE);
        assert!(lines[0].ends_with('…') && lines[1].is_empty(), "{lines:?}");
    }
}
