//! Plots of two dimensions against each other: as points, or as numbers over the cells of a grid.

use super::color::{Color, MUTED_COLOR};
use super::font::{Weight, text_width};
use super::panel_axes::{LABEL_SIZE, PanelAxes, Plot};
use super::scale::percent;
use super::svg::{Rect, Stroke, SvgWriter};
use super::theme::Theme;
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
    /// Lines in the plane, such as walls, drawn on top.
    pub lines: Vec<Vec<[f32; 2]>>,
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

/// Numbers over the cells of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct HeatMap {
    /// Title above the panel.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// Numbers of the cells.
    pub cells: Cells,
    /// Number of columns.
    pub columns: usize,
    /// Lines in the plane, such as walls, drawn on top.
    pub lines: Vec<Vec<[f32; 2]>>,
}

/// Numbers of cells, row by row, beginning with the lowest row.
#[derive(Clone, Debug, PartialEq)]
pub enum Cells {
    /// Counts, in the colors of [`Key::Counts`](super::Key::Counts).
    Counts {
        /// `[rows × columns]`
        counts: Vec<u32>,
        /// The count with the darkest color.
        max_count: u32,
    },
    /// Differences from −1 to 1, in the colors of [`Key::Differences`](super::Key::Differences): `[rows × columns]`.
    Differences(Vec<f32>),
}

impl Cells {
    /// Colors of the cells; `None` of a cell without states.
    fn colors(&self, theme: Theme) -> Vec<Option<Color>> {
        match self {
            Self::Counts { counts, max_count } => {
                let color = |count| (count > 0).then(|| theme.count_color(count, *max_count));
                counts.iter().copied().map(color).collect()
            }
            Self::Differences(differences) => {
                let color = |difference: &f32| {
                    (*difference != 0.0).then(|| theme.difference_color(f64::from(*difference)))
                };
                differences.iter().map(color).collect()
            }
        }
    }
}

impl Scatter {
    pub(super) fn draw(&self, panel: &Rect, svg: &mut SvgWriter) {
        let plot = draw_axes(
            &self.title,
            [&self.x, &self.y],
            is_to_scale([&self.x, &self.y], &self.lines),
            panel,
            svg,
        );
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
        draw_lines(&self.lines, &plot, svg);
    }
}

impl HeatMap {
    pub(super) fn draw(&self, panel: &Rect, svg: &mut SvgWriter) {
        let plot = draw_axes(
            &self.title,
            [&self.x, &self.y],
            is_to_scale([&self.x, &self.y], &self.lines),
            panel,
            svg,
        );
        let columns = self.columns.max(1);
        let theme = svg.theme();
        let colors = self.cells.colors(theme);
        let rows = colors.len() / columns;
        let is_visited = |row: usize, column: usize| colors[row * columns + column].is_some();
        let shown_row = shown_cells(rows, |row| {
            (0..columns).any(|column| is_visited(row, column))
        });
        let shown_column = shown_cells(columns, |column| {
            (0..rows).any(|row| is_visited(row, column))
        });
        let from_the_top = shown_row.iter().rev();
        let colors = from_the_top.flat_map(|row| {
            let row = &colors[row * columns..][..columns];
            shown_column.iter().map(|&column| row[column])
        });
        let colors = colors.map(|color| color.unwrap_or(theme.count_color(0, 1)));
        svg.image_of_colors(&plot.area, colors, self.columns, true);
        draw_lines(&self.lines, &plot, svg);
    }
}

/// Whether a meter has the same length on both axes: where there are walls, and on two lengths of which neither
/// would be too short to be seen.
pub(super) fn is_to_scale(axes: [&Axis; 2], lines: &[Vec<[f32; 2]>]) -> bool {
    let [x, y] = axes.map(|axis| axis.range[1] - axis.range[0]);
    let are_lengths = axes.iter().all(|axis| axis.unit == "m");
    !lines.is_empty() || are_lengths && x <= MAX_ASPECT * y && y <= MAX_ASPECT * x
}

/// Largest ratio of two lengths that are to scale without walls.
const MAX_ASPECT: f32 = 4.0;

/// Largest number of values of an axis that are drawn as wide as their distance.
const MAX_VALUES: usize = 50;

/// Which of `count` rows or columns is drawn at the place of each: itself, or, if the axis has few values at equal distances
/// (up to rounding to cells), such as the columns of a grid world, the nearest one with a value. So these values have no gaps between them.
fn shown_cells(count: usize, has_value: impl Fn(usize) -> bool) -> Vec<usize> {
    let values: Vec<usize> = (0..count).filter(|&cell| has_value(cell)).collect();
    let gaps = || values.windows(2).map(|pair| pair[1] - pair[0]);
    let (Some(smallest), Some(largest)) = (gaps().min(), gaps().max()) else {
        return (0..count).collect();
    };
    if values.len() > MAX_VALUES || smallest < 2 || largest > smallest + 1 {
        return (0..count).collect();
    }
    let nearest = |cell: usize| {
        values
            .iter()
            .copied()
            .min_by_key(|value| value.abs_diff(cell))
    };
    let is_near = |cell: usize, value: usize| 2 * value.abs_diff(cell) <= largest;
    (0..count)
        .map(|cell| {
            nearest(cell)
                .filter(|value| is_near(cell, *value))
                .unwrap_or(cell)
        })
        .collect()
}

/// Draws the parts of lines that are within the plot.
fn draw_lines(lines: &[Vec<[f32; 2]>], plot: &Plot, svg: &mut SvgWriter) {
    if lines.is_empty() {
        return;
    }
    svg.clipped(&plot.area, |svg| {
        for line in lines {
            let points: Vec<[f64; 2]> = line
                .iter()
                .map(|point| plot.position(point.map(f64::from)))
                .collect();
            svg.line(&points, Stroke::new(MUTED_COLOR, 1.0));
        }
    });
}

/// Draws the axes, to scale or filling the panel.
fn draw_axes(
    title: &str,
    [x, y]: [&Axis; 2],
    is_to_scale: bool,
    panel: &Rect,
    svg: &mut SvgWriter,
) -> Plot {
    let axes = PanelAxes {
        title,
        x_label: &axis_label_within(x, panel.width),
        y_label: &axis_label_within(y, panel.height),
        x_range: x.range.map(f64::from),
        y_range: y.range.map(f64::from),
        x_ticks: &[],
        logarithmic: [false; 2],
        has_grid: false,
    };
    let margins = if is_to_scale {
        margins_to_scale(&axes.plot(panel).area, axes.x_range, axes.y_range)
    } else {
        [0.0; 4]
    };
    axes.draw(&panel.inset(margins), svg)
}

/// What is left out of an area, so that a unit has the same length on both axes: top, right, bottom, left.
fn margins_to_scale(area: &Rect, x_range: [f64; 2], y_range: [f64; 2]) -> [f64; 4] {
    let [x_length, y_length] = [x_range, y_range].map(|[low, high]| high - low);
    let scale = (area.width / x_length).min(area.height / y_length);
    let bottom = area.height - scale * y_length;
    let right = area.width - scale * x_length;
    [0.0, right, bottom, 0.0]
}

/// The label with the shares of values that have no place on the axis or, if that is too long, without them.
fn axis_label_within(axis: &Axis, length: f64) -> String {
    let label = axis_label_with_shares(axis);
    if text_width(&label, LABEL_SIZE, Weight::Regular) <= length {
        label
    } else {
        axis.label()
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The plot is square; the wall is at a quarter of its width, from its bottom to three quarters of its height.
    #[test]
    fn walls_are_drawn_to_scale() {
        let axis = |name: &str| Axis {
            name: name.to_owned(),
            unit: "m".to_owned(),
            range: [-1.0, 1.0],
            outside: [0.0; 2],
            nan: 0.0,
        };
        let scatter = Scatter {
            title: String::new(),
            x: axis("x"),
            y: axis("y"),
            points: Vec::new(),
            lines: vec![vec![[-0.5, -1.0], [-0.5, 0.5]]],
        };
        let mut svg = SvgWriter::default();
        let panel = Rect {
            x: 0.0,
            y: 0.0,
            width: 400.0,
            height: 120.0,
        };
        scatter.draw(&panel, &mut svg);
        let plot = draw_axes(
            "",
            [&scatter.x, &scatter.y],
            true,
            &panel,
            &mut SvgWriter::default(),
        );
        assert!((plot.area.width - plot.area.height).abs() < 1e-9 && plot.area.width > 40.0);
        let side = plot.area.width;
        let text = svg.into_svg([400.0, 120.0], 1.0, "", "");
        let start = text.rfind("<path d=\"M").unwrap() + 10;
        let numbers: Vec<f64> = text[start..]
            .split('"')
            .next()
            .unwrap()
            .split(['L', ' '])
            .map(|number| number.parse().unwrap())
            .collect();
        let expected = [0.25, 1.0, 0.25, 0.25].map(|share| share * side);
        let offsets = [plot.area.x, plot.area.y, plot.area.x, plot.area.y];
        for ((number, share), offset) in numbers.iter().zip(expected).zip(offsets) {
            assert!((number - offset - share).abs() < 0.01, "{text}");
        }
    }

    /// Lengths of 2 m and 8 m are to scale, of 2 m and 9 m only with walls; other units never.
    #[test]
    fn lengths_are_to_scale() {
        let axis = |unit: &str, length: f32| Axis {
            name: "x".to_owned(),
            unit: unit.to_owned(),
            range: [1.0, 1.0 + length],
            outside: [0.0; 2],
            nan: 0.0,
        };
        let walls = [vec![[0.0, 0.0], [0.0, 1.0]]];
        for (units, length, expected) in [
            (["m", "m"], 8.0, [true, true]),
            (["m", "m"], 9.0, [false, true]),
            (["m", "m/s"], 2.0, [false, true]),
            (["", ""], 2.0, [false, true]),
        ] {
            let axes = [&axis(units[0], 2.0), &axis(units[1], length)];
            let found = [is_to_scale(axes, &[]), is_to_scale(axes, &walls)];
            assert_eq!(found, expected, "{units:?} {length}");
        }
    }

    /// 4 × 2 units in 100 × 80 are 25 per unit, so that 50 of the height are used; 2 × 4 units are 20 per unit.
    #[test]
    fn plots_to_scale_use_as_much_of_their_area_as_possible() {
        let area = Rect {
            x: 0.0,
            y: 0.0,
            width: 100.0,
            height: 80.0,
        };
        assert_eq!(
            margins_to_scale(&area, [-2.0, 2.0], [0.0, 2.0]),
            [0.0, 0.0, 30.0, 0.0]
        );
        assert_eq!(
            margins_to_scale(&area, [0.0, 2.0], [0.0, 4.0]),
            [0.0, 60.0, 0.0, 0.0]
        );
    }

    /// Values 0, 1 and 2 of an axis from 0 to 2 are in the cells 0, 4 and 7 of eight: cells are as wide as their distance.
    #[test]
    fn few_values_at_equal_distances_have_no_gaps_between_them() {
        let shown = |count, values: &[usize]| shown_cells(count, |cell| values.contains(&cell));
        assert_eq!(shown(8, &[0, 4, 7]), [0, 0, 0, 4, 4, 4, 7, 7]);
        // What is farther than half of the distance stays empty.
        assert_eq!(shown(9, &[0, 3]), [0, 0, 3, 3, 3, 5, 6, 7, 8]);
        for values in [&[][..], &[3], &[0, 1, 2], &[0, 2, 7]] {
            assert_eq!(shown(8, values), [0, 1, 2, 3, 4, 5, 6, 7], "{values:?}");
        }
    }
}
