//! A table of estimates: each row has a dot, its interval, and the numbers as text.

use super::color::{Color, GRID_COLOR, MUTED_COLOR};
use super::font::{Weight, fit_text, text_width};
use super::panel_axes::{LABEL_SIZE, TICK_SIZE, TITLE_HEIGHT, draw_title, ticks_side_by_side};
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
    /// Name of the row; it may have several lines.
    pub name: String,
    /// The estimate; `None` if it does not exist, such as the median time to a goal that most runs
    /// did not reach. It is shown as `not reached`.
    pub estimate: Option<f64>,
    /// The interval; `None` if there are too few runs. An infinite end is an arrow to the edge of the
    /// plot.
    pub interval: Option<[f64; 2]>,
    /// Values between minus this number and this number are of no interest, and shaded.
    pub margin: Option<f64>,
    /// Number of runs.
    pub n: usize,
    /// Color.
    pub color: Color,
}

/// Color of a shaded margin, on white.
const MARGIN_COLOR: Color = [226, 229, 238];

/// Half of the height of a shaded margin.
const MARGIN_HEIGHT: f64 = 9.0;

/// Radius of a dot.
const DOT_RADIUS: f64 = 4.0;

/// Length of the head of an arrow.
const ARROW_LENGTH: f64 = 8.0;

/// Factor by which text may be wider in an SVG viewer that lacks the fonts of this crate.
const FONT_WIDTH_MARGIN: f64 = 1.15;

/// Height of a row without its name, and of each line of the name.
const ROW_GAP: f64 = 10.0;
const LINE_HEIGHT: f64 = 14.0;

/// Share of the width of a panel that names and numbers may take beside the plot.
const MAX_SHARE_OF_TEXT: f64 = 0.78;

/// Lines below a name that is above its interval: one of numbers and one of the interval.
const LINES_BELOW_NAME: f64 = 2.0;

/// Room between a name beside the plot and the plot.
const NAME_MARGIN: f64 = 8.0;

/// Distance of numbers from the right edge of the panel.
const RIGHT_MARGIN: f64 = 4.0;

/// How the rows of a panel are arranged.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Arrangement {
    /// Names to the left of the plot, which has this left margin.
    NamesBeside(f64),
    /// Names and numbers above their intervals, for narrow panels.
    NamesAbove,
}

impl Intervals {
    /// Height of a wide panel with all rows.
    #[must_use]
    pub fn height(&self) -> f64 {
        self.height_of_rows(
            &self.lines_of_names(Arrangement::NamesBeside(f64::INFINITY), 0.0),
            0.0,
        )
    }

    /// Height of a panel of this width with all rows.
    pub(super) fn height_within(&self, width: f64) -> f64 {
        let arrangement = self.arrangement(width);
        let lines = self.lines_of_names(arrangement, width);
        let line_of_interval = match arrangement {
            Arrangement::NamesBeside(_) => 0.0,
            Arrangement::NamesAbove => LINES_BELOW_NAME * LINE_HEIGHT,
        };
        self.height_of_rows(&lines, line_of_interval)
    }

    fn height_of_rows(&self, lines: &[Vec<String>], line_of_interval: f64) -> f64 {
        let row = row_height(lines) + line_of_interval;
        TITLE_HEIGHT + row * self.rows.len() as f64 + 44.0
    }

    /// Names are above their intervals if there is too little room for both beside each other.
    fn arrangement(&self, width: f64) -> Arrangement {
        let name_width = self.name_width(width);
        if name_width + self.numbers_width() > MAX_SHARE_OF_TEXT * width {
            Arrangement::NamesAbove
        } else {
            Arrangement::NamesBeside(name_width)
        }
    }

    /// The arrangement in a panel, which may be too low for names above.
    fn arrangement_in(&self, panel: &Rect) -> Arrangement {
        if panel.height + 1.0 < self.height_within(panel.width) {
            Arrangement::NamesBeside(self.name_width(panel.width))
        } else {
            self.arrangement(panel.width)
        }
    }

    /// Width of the names beside a plot in a panel of this width.
    fn name_width(&self, width: f64) -> f64 {
        let names = max_width(self.rows.iter().flat_map(IntervalRow::lines));
        names.min(0.4 * width) + 12.0
    }

    fn numbers_width(&self) -> f64 {
        max_width(self.rows.iter().map(IntervalRow::numbers_text)) + 16.0
    }

    /// The lines of each name. Beside the plot they are those of the name, unless one of them is too wide.
    fn lines_of_names(&self, arrangement: Arrangement, width: f64) -> Vec<Vec<String>> {
        let lines = |row: &IntervalRow| match arrangement {
            Arrangement::NamesBeside(name_width) => row.lines_within(name_width - NAME_MARGIN),
            Arrangement::NamesAbove => wrapped(&row.name.replace('\n', " "), width - 8.0),
        };
        self.rows.iter().map(lines).collect()
    }

    pub(super) fn draw(&self, panel: &Rect, svg: &mut SvgWriter) {
        let arrangement = self.arrangement_in(panel);
        let [left, right] = match arrangement {
            Arrangement::NamesBeside(name_width) => [name_width, self.numbers_width()],
            Arrangement::NamesAbove => [12.0, 16.0],
        };
        let area = panel.inset([TITLE_HEIGHT, right, 44.0, left]);
        draw_title(&self.title, panel, panel.x + 4.0, svg);
        let scale = Scale::new(self.range(), [area.x, area.right()]);
        let row_height = area.height / self.rows.len().max(1) as f64;
        let lines = self.lines_of_names(arrangement, panel.width);
        let heights = heights_of_intervals(&lines, arrangement, area.y, row_height);
        let stretches = stretches_of_lines(&heights, arrangement, &area);
        self.draw_axis(&scale, &area, &stretches, panel, svg);
        for ((row, lines), &y) in self.rows.iter().zip(&lines).zip(&heights) {
            match arrangement {
                Arrangement::NamesBeside(_) => {
                    draw_name_beside(lines, [area.x - 8.0, y], left - NAME_MARGIN, svg);
                    let place = [panel.right() - RIGHT_MARGIN, y + 4.0];
                    svg.text(place, &row.numbers_text(), numbers_style(Anchor::End));
                }
                Arrangement::NamesAbove => {
                    let top = y - LINE_HEIGHT * (lines.len() as f64 + LINES_BELOW_NAME);
                    draw_name_above(lines, [panel.x + 4.0, top], svg);
                    let place = [panel.x + 4.0, y - LINE_HEIGHT];
                    svg.text(place, &row.numbers_text(), numbers_style(Anchor::Start));
                }
            }
            row.draw_margin(&scale, y, svg);
        }
        self.draw_reference(&scale, &stretches, svg);
        svg.clipped(&clip_area_with_dots(&area), |svg| {
            for (row, &y) in self.rows.iter().zip(&heights) {
                row.draw(&scale, &area, y, svg);
            }
        });
    }

    fn range(&self) -> [f64; 2] {
        let values = self.rows.iter().flat_map(|row| {
            let margin = row.margin.into_iter().flat_map(|margin| [-margin, margin]);
            let interval = row.interval.into_iter().flatten();
            interval.chain(row.estimate).chain(margin)
        });
        padded(extent(values.chain(self.reference)))
    }

    fn draw_reference(&self, scale: &Scale, stretches: &[[f64; 2]], svg: &mut SvgWriter) {
        let Some(reference) = self.reference else {
            return;
        };
        let stroke = Stroke {
            dashed: true,
            ..Stroke::new(MUTED_COLOR, 1.0)
        };
        draw_upright(scale.position(reference), stretches, stroke, svg);
    }

    fn draw_axis(
        &self,
        scale: &Scale,
        area: &Rect,
        stretches: &[[f64; 2]],
        panel: &Rect,
        svg: &mut SvgWriter,
    ) {
        let most = ((area.width / 48.0) as usize).clamp(3, 8);
        for (value, text) in ticks_side_by_side(scale, most) {
            let x = scale.position(value);
            draw_upright(x, stretches, Stroke::new(GRID_COLOR, 1.0), svg);
            svg.text(
                [x, area.bottom() + 14.0],
                &text,
                TextStyle::new(TICK_SIZE, Anchor::Middle).color(MUTED_COLOR),
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

/// Height of each interval: in the middle of its row, or below its name and numbers.
fn heights_of_intervals(
    lines: &[Vec<String>],
    arrangement: Arrangement,
    top: f64,
    row_height: f64,
) -> Vec<f64> {
    let height = |(index, lines): (usize, &Vec<String>)| {
        let top = top + row_height * index as f64;
        match arrangement {
            Arrangement::NamesBeside(_) => top + row_height / 2.0,
            Arrangement::NamesAbove => top + LINE_HEIGHT * (lines.len() as f64 + LINES_BELOW_NAME),
        }
    };
    lines.iter().enumerate().map(height).collect()
}

/// From where to where upright lines are drawn: around each interval where names are above them, so that no line
/// crosses text.
fn stretches_of_lines(heights: &[f64], arrangement: Arrangement, area: &Rect) -> Vec<[f64; 2]> {
    match arrangement {
        Arrangement::NamesBeside(_) => vec![[area.y, area.bottom()]],
        Arrangement::NamesAbove => {
            let around = heights
                .iter()
                .map(|y| [y - MARGIN_HEIGHT, y + MARGIN_HEIGHT]);
            around.collect()
        }
    }
}

fn draw_upright(x: f64, stretches: &[[f64; 2]], stroke: Stroke, svg: &mut SvgWriter) {
    for &[top, bottom] in stretches {
        svg.line(&[[x, top], [x, bottom]], stroke);
    }
}

/// Height of a row without an interval of its own line: that of the longest name.
fn row_height(lines: &[Vec<String>]) -> f64 {
    let most = lines.iter().map(Vec::len).max().unwrap_or(1);
    ROW_GAP + LINE_HEIGHT * most as f64
}

/// Width of the widest text, also in viewers without the fonts of this crate.
fn max_width(texts: impl Iterator<Item = String>) -> f64 {
    texts
        .map(|text| FONT_WIDTH_MARGIN * text_width(&text, LABEL_SIZE, Weight::Regular))
        .fold(0.0, f64::max)
}

/// A text in lines of at most this width, broken between words.
fn wrapped(text: &str, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        let longer = lines.last().map(|line| format!("{line} {word}"));
        match longer.filter(|line| text_width(line, LABEL_SIZE, Weight::Regular) <= width) {
            Some(longer) => *lines.last_mut().expect("there is a line") = longer,
            None => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Draws the lines of a name around a height, each shortened to `width`.
fn draw_name_beside(lines: &[String], [right, middle]: [f64; 2], width: f64, svg: &mut SvgWriter) {
    let first = middle - 0.5 * LINE_HEIGHT * (lines.len() as f64 - 1.0);
    for (number, line) in lines.iter().enumerate() {
        let line = fit_text(line, width, LABEL_SIZE, Weight::Regular);
        let y = first + LINE_HEIGHT * number as f64 + 4.0;
        svg.text([right, y], &line, TextStyle::new(LABEL_SIZE, Anchor::End));
    }
}

fn numbers_style(anchor: Anchor) -> TextStyle {
    TextStyle::new(LABEL_SIZE, anchor).color(MUTED_COLOR)
}

/// Draws the lines of a name from a height downwards.
fn draw_name_above(lines: &[String], [left, top]: [f64; 2], svg: &mut SvgWriter) {
    for (number, line) in lines.iter().enumerate() {
        let y = top + LINE_HEIGHT * (number as f64 + 1.0);
        svg.text([left, y], line, TextStyle::new(LABEL_SIZE, Anchor::Start));
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
    /// Lines of the name.
    fn lines(&self) -> impl Iterator<Item = String> {
        self.name.split('\n').map(str::to_owned)
    }

    /// Lines of the name. If one is wider than `width`, the whole name is wrapped to this width.
    fn lines_within(&self, width: f64) -> Vec<String> {
        let is_too_wide = |line: String| text_width(&line, LABEL_SIZE, Weight::Regular) > width;
        if self.lines().any(is_too_wide) {
            return wrapped(&self.name.replace('\n', " "), width);
        }
        self.lines().collect()
    }

    fn draw_margin(&self, scale: &Scale, y: f64, svg: &mut SvgWriter) {
        let Some(margin) = self.margin else { return };
        let [left, right] = [-margin, margin].map(|end| scale.position(end));
        let shaded = Rect {
            x: left,
            y: y - MARGIN_HEIGHT,
            width: right - left,
            height: 2.0 * MARGIN_HEIGHT,
        };
        svg.rectangle(&shaded, MARGIN_COLOR, 1.0);
    }

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

    /// Estimate, interval and number of runs as text, such as `127.5 (80 to 134), n = 10`.
    fn numbers_text(&self) -> String {
        let estimate = self
            .estimate
            .map_or("not reached".to_owned(), format_number);
        let interval = match self.interval {
            None => String::new(),
            Some([low, high]) if low.is_infinite() && high.is_infinite() => " (open)".to_owned(),
            Some([low, high]) if high.is_infinite() => {
                format!(" (at least {})", format_number(low))
            }
            Some([low, high]) if low.is_infinite() => {
                format!(" (at most {})", format_number(high))
            }
            Some([low, high]) => format!(" ({} to {})", format_number(low), format_number(high)),
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
            margin: None,
            n: 10,
            color: [0; 3],
        };
        assert_eq!(
            row(Some(127.5), Some([80.0, 134.0])).numbers_text(),
            "127.5 (80 to 134), n = 10"
        );
        assert_eq!(
            row(None, Some([210.0, f64::INFINITY])).numbers_text(),
            "not reached (at least 210), n = 10"
        );
        assert_eq!(
            row(Some(3.0), Some([f64::NEG_INFINITY, 7.0])).numbers_text(),
            "3 (at most 7), n = 10"
        );
        assert_eq!(row(None, None).numbers_text(), "not reached, n = 10");
        assert_eq!(row(Some(-6.0), None).numbers_text(), "−6, n = 10");
    }

    /// On a page of 760 pixels, names and numbers are beside the plot; in a column of 260 above it, in rows of more lines.
    #[test]
    fn names_are_above_intervals_in_narrow_panels() {
        let row = IntervalRow {
            name: "four agents that share\nall experience".to_owned(),
            estimate: Some(0.5),
            interval: Some([0.25, 0.75]),
            margin: None,
            n: 10,
            color: [0; 3],
        };
        let panel = Intervals {
            rows: vec![row],
            ..Intervals::default()
        };
        assert_eq!(panel.height_within(760.0), panel.height());
        assert!(matches!(
            panel.arrangement(760.0),
            Arrangement::NamesBeside(_)
        ));
        assert_eq!(panel.arrangement(260.0), Arrangement::NamesAbove);
        let area = |height| Rect {
            x: 0.0,
            y: 0.0,
            width: 260.0,
            height,
        };
        let high = panel.height_within(260.0);
        assert!(high > panel.height());
        assert_eq!(panel.arrangement_in(&area(high)), Arrangement::NamesAbove);
        let low = panel.arrangement_in(&area(panel.height()));
        assert!(matches!(low, Arrangement::NamesBeside(_)));
        assert_eq!(wrapped("one two three", 60.0), ["one two", "three"]);
    }

    /// The margin is shaded, and part of the plot even if the interval is far from it.
    #[test]
    fn margins_are_shaded() {
        let row = IntervalRow {
            name: String::new(),
            estimate: Some(0.5),
            interval: Some([0.4, 0.6]),
            margin: Some(0.3),
            n: 10,
            color: [0; 3],
        };
        let panel = Intervals {
            rows: vec![row.clone()],
            ..Intervals::default()
        };
        let [low, high] = panel.range();
        assert!(low <= -0.3 && high >= 0.6, "{low} {high}");
        let mut svg = SvgWriter::default();
        let scale = Scale::new([-0.5, 0.5], [0.0, 100.0]);
        row.draw_margin(&scale, 10.0, &mut svg);
        let drawn = svg.into_svg([100.0, 20.0], 1.0, "", "");
        assert!(
            drawn.contains(r#"x="20" y="1" width="60" height="18""#),
            "{drawn}"
        );
    }

    /// A closed interval has two caps, which are vertical lines. At an open end there is the head of an
    /// arrow instead, whose tip is at the edge of the plot.
    /// At half of the width that its first line needs, a name has more lines, and all of its words.
    #[test]
    fn names_are_broken_anew_where_lines_are_too_wide() {
        let row = IntervalRow {
            name: "from the same networks as many agents\nreach it".to_owned(),
            estimate: None,
            interval: None,
            margin: None,
            n: 10,
            color: [0; 3],
        };
        let width = text_width(&row.lines().next().unwrap(), LABEL_SIZE, Weight::Regular);
        assert_eq!(row.lines_within(width), row.lines().collect::<Vec<_>>());
        let lines = row.lines_within(0.5 * width);
        assert_eq!(lines.join(" "), row.name.replace('\n', " "));
        let is_narrow =
            |line: &String| text_width(line, LABEL_SIZE, Weight::Regular) <= 0.5 * width;
        assert!(lines.len() > 2 && lines.iter().all(is_narrow), "{lines:?}");
    }

    #[test]
    fn an_open_end_is_an_arrow() {
        let drawn = |interval| {
            let row = IntervalRow {
                name: String::new(),
                estimate: None,
                interval: Some(interval),
                margin: None,
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
