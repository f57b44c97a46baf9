//! The legend of curves. It is drawn in a corner or at an edge of the plot that no curve covers. If there
//! is no such place, it is drawn beside the plot or, where that would take too much of its width, below.
//!
//! Curves and bands are sampled so densely that no legend fits between two sample points. So a
//! rectangle without sample points is free.

use super::color::Color;
use super::font::{Weight, fit_text, text_width};
use super::panel_axes::TICK_SIZE;
use super::svg::{Anchor, Rect, Stroke, SvgWriter, TextStyle};

/// One name in a legend.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry<'a> {
    pub(super) name: &'a str,
    pub(super) color: Color,
}

const LINE_HEIGHT: f64 = 16.0;
const MARGIN: f64 = 6.0;
/// Distance between sample points: half the height of the smallest legend.
const SAMPLE_DISTANCE: f64 = 8.0;

/// Width and height of a legend with as many entries as fit into `plot`.
fn legend_size(entries: &[Entry<'_>], plot: &Rect) -> [f64; 2] {
    let max_width = entries
        .iter()
        .map(|entry| text_width(entry.name, TICK_SIZE, Weight::Regular))
        .fold(0.0, f64::max);
    [
        max_width + 34.0,
        LINE_HEIGHT * entries.len().min(max_entries(plot)) as f64 + 4.0,
    ]
}

fn max_entries(plot: &Rect) -> usize {
    ((plot.height - 2.0 * MARGIN) / LINE_HEIGHT) as usize
}

/// Where a legend is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Place {
    /// Within the plot, where nothing else is.
    Inside(Rect),
    /// To the right of the plot, with this width.
    Beside(f64),
    /// Below the plot, with this height.
    Below(f64),
}

impl Place {
    /// The part of the panel that the legend needs: top, right, bottom, left.
    pub(super) fn margins(self) -> [f64; 4] {
        match self {
            Self::Inside(_) => [0.0; 4],
            Self::Beside(width) => [0.0, width, 0.0, 0.0],
            Self::Below(height) => [0.0, 0.0, height, 0.0],
        }
    }
}

/// Share of the width of a panel that a legend beside the plot may take.
const MAX_SHARE_BESIDE: f64 = 0.3;

/// Share of the height of a panel that a legend below the plot may take.
const MAX_SHARE_BELOW: f64 = 0.4;

/// A place for a legend that covers none of `points`.
pub(super) fn place(
    entries: &[Entry<'_>],
    panel: &Rect,
    plot: &Rect,
    points: &[[f64; 2]],
) -> Place {
    if entries.is_empty() {
        return Place::Beside(0.0);
    }
    let size = legend_size(entries, plot);
    let has_room = entries.len() <= max_entries(plot);
    if let Some(rect) = free_rect_of_size(size, plot, points).filter(|_| has_room) {
        return Place::Inside(rect);
    }
    let height_below = height_of_lines(entries, panel.width);
    let is_too_large_beside = !has_room || size[0] > MAX_SHARE_BESIDE * panel.width;
    if is_too_large_beside && height_below < MAX_SHARE_BELOW * panel.height {
        return Place::Below(height_below);
    }
    Place::Beside(size[0].min(0.4 * panel.width))
}

/// Height of the entries in lines of this width.
pub(super) fn height_of_lines(entries: &[Entry<'_>], width: f64) -> f64 {
    6.0 + LINE_HEIGHT * lines(entries, width).len() as f64
}

/// The entries of each line of a legend of this width, as indices.
fn lines(entries: &[Entry<'_>], width: f64) -> Vec<Vec<usize>> {
    let mut lines: Vec<Vec<usize>> = Vec::new();
    let mut end_of_line = f64::INFINITY;
    for (index, entry) in entries.iter().enumerate() {
        let entry_width = entry_width(entry);
        if end_of_line + entry_width > width {
            lines.push(Vec::new());
            end_of_line = 0.0;
        }
        lines.last_mut().expect("a line was added").push(index);
        end_of_line += entry_width;
    }
    lines
}

/// Width of an entry with the space after it.
fn entry_width(entry: &Entry<'_>) -> f64 {
    28.0 + text_width(entry.name, TICK_SIZE, Weight::Regular) + 12.0
}

/// Draws the entries, or as many as fit into the height of the plot if they are one below the other.
pub(super) fn draw(
    entries: &[Entry<'_>],
    place: &Place,
    panel: &Rect,
    plot: &Rect,
    svg: &mut SvgWriter,
) {
    match *place {
        Place::Inside(rect) => draw_column(entries, &rect, plot, svg),
        Place::Beside(width) => {
            let rect = Rect {
                x: plot.right() + 8.0,
                width,
                ..*plot
            };
            draw_column(entries, &rect, plot, svg);
        }
        Place::Below(height) => {
            let rect = Rect {
                y: panel.bottom() - height + 6.0,
                height,
                ..*panel
            };
            draw_lines(entries, &rect, svg);
        }
    }
}

/// Draws the entries in lines, one beside the other.
pub(super) fn draw_lines(entries: &[Entry<'_>], rect: &Rect, svg: &mut SvgWriter) {
    for (line, indices) in lines(entries, rect.width).iter().enumerate() {
        let y = rect.y + LINE_HEIGHT * (line as f64 + 0.5);
        let mut x = rect.x;
        for &index in indices {
            draw_entry(&entries[index], [x, y], rect.right() - x, svg);
            x += entry_width(&entries[index]);
        }
    }
}

fn draw_column(entries: &[Entry<'_>], rect: &Rect, plot: &Rect, svg: &mut SvgWriter) {
    if entries.is_empty() {
        return;
    }
    svg.rectangle(
        &Rect {
            height: legend_size(entries, plot)[1],
            ..*rect
        },
        [255; 3],
        0.8,
    );
    for (line, entry) in entries.iter().take(max_entries(plot)).enumerate() {
        let y = rect.y + LINE_HEIGHT * (line as f64 + 0.5) + 2.0;
        draw_entry(entry, [rect.x, y], rect.width, svg);
    }
}

/// A short line in the entry's color, and its name, shortened to `width` with the line.
fn draw_entry(entry: &Entry<'_>, [x, y]: [f64; 2], width: f64, svg: &mut SvgWriter) {
    svg.line(
        &[[x + 5.0, y], [x + 22.0, y]],
        Stroke::new(entry.color, 2.5),
    );
    let name = fit_text(entry.name, width - 28.0, TICK_SIZE, Weight::Regular);
    svg.text(
        [x + 28.0, y + 4.0],
        &name,
        TextStyle::new(TICK_SIZE, Anchor::Start),
    );
}

/// Sample points of the line through `points`, so dense that no legend fits between two of them.
pub(super) fn sample_line(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let points_between = |ends: &[[f64; 2]]| {
        let [[x, y], [to_x, to_y]] = [ends[0], ends[1]];
        let parts = ((to_x - x).hypot(to_y - y) / SAMPLE_DISTANCE)
            .ceil()
            .clamp(1.0, 1000.0) as u32;
        (0..parts)
            .map(move |part| f64::from(part) / f64::from(parts))
            .map(move |share| [x + share * (to_x - x), y + share * (to_y - y)])
    };
    points
        .windows(2)
        .flat_map(points_between)
        .chain(points.last().copied())
        .collect()
}

/// Sample points of the area of a band, so dense that no legend fits between them.
/// `outline`: (x, low, high) on the page.
pub(super) fn sample_band(outline: &[[f64; 3]]) -> Vec<[f64; 2]> {
    let edge_points = |column: usize| {
        sample_line(
            &outline
                .iter()
                .map(|point| [point[0], point[column]])
                .collect::<Vec<_>>(),
        )
    };
    let area_points = |ends: &[[f64; 3]]| {
        let [from, to] = [ends[0], ends[1]];
        let parts = ((to[0] - from[0]).abs() / SAMPLE_DISTANCE)
            .ceil()
            .clamp(1.0, 1000.0) as u32;
        (0..=parts)
            .map(move |part| f64::from(part) / f64::from(parts))
            .flat_map(move |share| {
                let [x, low, high] =
                    [0, 1, 2].map(|column| from[column] + share * (to[column] - from[column]));
                sample_line(&[[x, low], [x, high]])
            })
    };
    outline
        .windows(2)
        .flat_map(area_points)
        .chain(edge_points(1))
        .chain(edge_points(2))
        .collect()
}

/// The first free rectangle of: the upper left, upper right, lower right and lower left corner, the
/// right edge from top to bottom, and the left edge from top to bottom.
fn free_rect_of_size([width, height]: [f64; 2], plot: &Rect, points: &[[f64; 2]]) -> Option<Rect> {
    let (left, right) = (plot.x + MARGIN, plot.right() - width - 2.0);
    let (top, bottom) = (plot.y + 2.0, plot.bottom() - height - MARGIN);
    let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
    let tops_along_edge = || {
        (1..100)
            .map(|line| top + LINE_HEIGHT * f64::from(line))
            .take_while(|&y| y < bottom)
    };
    let edges = [right, left]
        .into_iter()
        .flat_map(|x| tops_along_edge().map(move |y| [x, y]));
    let is_free = |rect: &Rect| {
        let [x, y] = [rect.x..=rect.right(), rect.y..=rect.bottom()];
        !points
            .iter()
            .any(|point| x.contains(&point[0]) && y.contains(&point[1]))
    };
    corners
        .into_iter()
        .chain(edges)
        .map(|[x, y]| Rect {
            x,
            y,
            width,
            height,
        })
        .find(is_free)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLOT: Rect = Rect {
        x: 0.0,
        y: 0.0,
        width: 100.0,
        height: 100.0,
    };

    #[test]
    fn a_legend_covers_no_curve() {
        let free_corner = |points: &[[f64; 2]]| {
            free_rect_of_size([40.0, 20.0], &PLOT, points).map(|rect| [rect.x, rect.y])
        };
        let rising: Vec<[f64; 2]> = (0..100)
            .map(|x| [f64::from(x), 100.0 - f64::from(x)])
            .collect();
        assert_eq!(free_corner(&rising), Some([MARGIN, 2.0]));
        let falling: Vec<[f64; 2]> = rising.iter().map(|[x, y]| [*x, 100.0 - y]).collect();
        assert_eq!(free_corner(&falling), Some([58.0, 2.0]));
        // A line that has no points in the upper left corner still crosses it.
        let steep = sample_line(&[[0.0, -40.0], [30.0, 30.0], [100.0, 90.0]]);
        assert_eq!(free_corner(&steep), Some([58.0, 2.0]));
        // Two lines leave a free rectangle at the right edge; five lines leave none.
        let flat = |y: f64| sample_line(&[[0.0, y], [100.0, y]]);
        assert_eq!(
            free_corner(&[flat(10.0), flat(90.0)].concat()),
            Some([58.0, 18.0])
        );
        assert_eq!(
            free_corner(&[flat(10.0), flat(28.0), flat(46.0), flat(64.0), flat(82.0)].concat()),
            None
        );
    }

    /// A name of five digits is 44 wide, with its line and space 71: 4 × 71 > 200, so two lines. Beside the plot there is
    /// room on wide panels only.
    #[test]
    fn without_a_free_place_legends_are_beside_or_below() {
        let entry = Entry {
            name: "00000",
            color: [0; 3],
        };
        let full: Vec<[f64; 2]> = (0..40)
            .flat_map(|line| {
                sample_line(&[[0.0, 5.0 * f64::from(line)], [900.0, 5.0 * f64::from(line)]])
            })
            .collect();
        let panel = |width| Rect {
            x: 0.0,
            y: 0.0,
            width,
            height: 200.0,
        };
        let place_in = |width| place(&[entry; 4], &panel(width), &panel(width), &full);
        assert_eq!(place_in(200.0), Place::Below(6.0 + 2.0 * LINE_HEIGHT));
        assert!(matches!(place_in(900.0), Place::Beside(width) if (60.0..70.0).contains(&width)));
        assert_eq!(lines(&[entry; 4], 200.0), [[0, 1], [2, 3]]);
        assert_eq!(lines(&[entry; 1], 20.0), [[0]]);
    }

    /// The edges of this band are above and below the plot, so only its area covers the corners.
    #[test]
    fn a_legend_covers_no_band() {
        let band = sample_band(&[[0.0, 120.0, -20.0], [100.0, 120.0, -20.0]]);
        assert_eq!(free_rect_of_size([40.0, 20.0], &PLOT, &band), None);
    }
}
