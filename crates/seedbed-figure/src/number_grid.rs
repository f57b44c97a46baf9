//! Numbers over two dimensions: a table whose cells have the color of their number.

use super::color::{Color, MUTED_COLOR, TEXT_COLOR, difference_color};
use super::font::{Weight, fit_text};
use super::panel_axes::{LABEL_SIZE, TICK_SIZE, TITLE_HEIGHT, draw_title};
use super::scale::format_significant;
use super::svg::{Anchor, Rect, SvgWriter, TextStyle};

/// Differences over two dimensions, in the colors of [`difference_color`]: blue below 0, orange above.
/// Square roots are shown, so that small differences have a color, too.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NumberGrid {
    /// Title above the panel.
    pub title: String,
    /// Name of the horizontal dimension.
    pub x_label: String,
    /// Name of the vertical dimension.
    pub y_label: String,
    /// Names of the columns, from left to right.
    pub columns: Vec<String>,
    /// Names of the rows, from bottom to top.
    pub rows: Vec<String>,
    /// Numbers row by row, beginning with the lowest row: `[rows × columns]`; `None` leaves a cell
    /// empty.
    pub numbers: Vec<Option<GridNumber>>,
    /// Magnitude with the strongest color, above 0.
    pub max: f64,
}

/// The number of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridNumber {
    /// The number.
    pub value: f64,
    /// Whether its sign is uncertain; such numbers are in parentheses.
    pub is_uncertain: bool,
}

/// Space for the names of rows, columns and dimensions.
const LEFT: f64 = 46.0;
const BOTTOM: f64 = 40.0;

impl NumberGrid {
    pub(super) fn draw(&self, panel: &Rect, svg: &mut SvgWriter) {
        let area = panel.inset([TITLE_HEIGHT, 4.0, BOTTOM, LEFT]);
        draw_title(&self.title, panel, area.x, svg);
        let size = [
            area.width / self.columns.len().max(1) as f64,
            area.height / self.rows.len().max(1) as f64,
        ];
        self.draw_names(panel, &area, size, svg);
        let rows = self.numbers.chunks(self.columns.len().max(1));
        for (row, numbers) in rows.enumerate() {
            for (column, number) in numbers.iter().enumerate() {
                let cell = Rect {
                    x: area.x + size[0] * column as f64,
                    y: area.bottom() - size[1] * (row + 1) as f64,
                    width: size[0],
                    height: size[1],
                };
                if let Some(number) = number {
                    number.draw(&cell, self.max, svg);
                }
            }
        }
    }

    fn draw_names(&self, panel: &Rect, area: &Rect, size: [f64; 2], svg: &mut SvgWriter) {
        let muted = |anchor| TextStyle::new(TICK_SIZE, anchor).color(MUTED_COLOR);
        for (column, name) in self.columns.iter().enumerate() {
            let x = area.x + size[0] * (column as f64 + 0.5);
            svg.text([x, area.bottom() + 15.0], name, muted(Anchor::Middle));
        }
        for (row, name) in self.rows.iter().enumerate() {
            let y = area.bottom() - size[1] * (row as f64 + 0.5);
            svg.text([area.x - 6.0, y + 4.0], name, muted(Anchor::End));
        }
        let style = TextStyle::new(LABEL_SIZE, Anchor::Middle);
        let x_label = fit_text(&self.x_label, area.width, LABEL_SIZE, Weight::Regular);
        let middle = [area.x + area.width / 2.0, area.y + area.height / 2.0];
        svg.text([middle[0], panel.bottom() - 6.0], &x_label, style);
        let y_label = fit_text(&self.y_label, area.height, LABEL_SIZE, Weight::Regular);
        svg.text([panel.x + 12.0, middle[1]], &y_label, style.upward());
    }
}

impl GridNumber {
    fn draw(self, cell: &Rect, max: f64, svg: &mut SvgWriter) {
        let root = (self.value.abs() / max).sqrt().copysign(self.value);
        svg.rectangle(&cell.inset([1.0; 4]), difference_color(root), 1.0);
        let center = [cell.x + cell.width / 2.0, cell.y + cell.height / 2.0 + 4.0];
        let style = TextStyle::new(TICK_SIZE, Anchor::Middle).color(text_color(root));
        svg.text(center, &self.text(), style);
    }

    /// The number with two digits, in parentheses if its sign is uncertain.
    fn text(self) -> String {
        let number = format_significant(self.value, 2);
        if self.is_uncertain {
            format!("({number})")
        } else {
            number
        }
    }
}

/// Color of text that can be read on the color of a number.
fn text_color(root: f64) -> Color {
    if root.abs() > 0.7 {
        [255; 3]
    } else {
        TEXT_COLOR
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uncertain_numbers_are_in_parentheses() {
        let number = |value, is_uncertain| GridNumber {
            value,
            is_uncertain,
        };
        assert_eq!(number(-12.34, false).text(), "−12");
        assert_eq!(number(0.123, true).text(), "(0.12)");
    }

    /// Two columns of 100 pixels and two rows of 50: the first number is at the lower left, the last
    /// one at the upper right, and an empty cell has no rectangle.
    #[test]
    fn the_first_row_is_the_lowest() {
        let number = |value| {
            Some(GridNumber {
                value,
                is_uncertain: false,
            })
        };
        let grid = NumberGrid {
            columns: vec!["1".to_owned(), "2".to_owned()],
            rows: vec!["3".to_owned(), "4".to_owned()],
            numbers: vec![number(-4.0), None, number(1.0), number(4.0)],
            max: 4.0,
            ..NumberGrid::default()
        };
        let panel = Rect {
            x: 0.0,
            y: 0.0,
            width: LEFT + 200.0 + 4.0,
            height: TITLE_HEIGHT + 100.0 + BOTTOM,
        };
        let mut svg = SvgWriter::default();
        grid.draw(&panel, &mut svg);
        let text = svg.into_svg([254.0, 164.0], 1.0, "", "");
        assert!(text.contains(">−4</text>"), "{text}");
        let position = |x: f64, y: f64| format!("x=\"{}\" y=\"{}\"", LEFT + x, TITLE_HEIGHT + y);
        // Lower left, upper left and upper right.
        for [x, y] in [[1.0, 51.0], [1.0, 1.0], [101.0, 1.0]] {
            assert!(text.contains(&position(x, y)), "{x}, {y}: {text}");
        }
        assert!(!text.contains(&position(101.0, 51.0)), "{text}");
    }
}
