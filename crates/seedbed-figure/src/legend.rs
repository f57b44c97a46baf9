//! The legend of curves: in a corner or at an edge of a plot where there is no curve, or beside it.
//!
//! A free rectangle is one without sample points, and curves and bands are sampled so densely that no
//! legend fits between two samples.

use super::color::Color;
use super::font::{Weight, fit_text, text_width};
use super::frame::TICK_SIZE;
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

/// Width of a legend, and height of as many entries as fit into `plot`.
fn legend_size(entries: &[Entry<'_>], plot: &Rect) -> [f64; 2] {
    let widest = entries
        .iter()
        .map(|entry| text_width(entry.name, TICK_SIZE, Weight::Regular))
        .fold(0.0, f64::max);
    [
        widest + 34.0,
        LINE_HEIGHT * entries.len().min(max_entries(plot)) as f64 + 4.0,
    ]
}

fn max_entries(plot: &Rect) -> usize {
    ((plot.height - 2.0 * MARGIN) / LINE_HEIGHT) as usize
}

/// A rectangle in a plot where a legend covers none of `points`, if there is one.
pub(super) fn find_free_rect(
    entries: &[Entry<'_>],
    plot: &Rect,
    points: &[[f64; 2]],
) -> Option<Rect> {
    free_rect_of_size(legend_size(entries, plot), plot, points)
}

/// Width of a legend beside a plot.
pub(super) fn width_beside(entries: &[Entry<'_>], panel: &Rect) -> f64 {
    legend_size(entries, panel)[0].min(0.4 * panel.width)
}

/// Draws as many entries as fit into `plot`, from the upper left of `place`.
pub(super) fn draw(entries: &[Entry<'_>], place: &Rect, plot: &Rect, svg: &mut SvgWriter) {
    if entries.is_empty() {
        return;
    }
    svg.rectangle(
        &Rect {
            height: legend_size(entries, plot)[1],
            ..*place
        },
        [255; 3],
        0.8,
    );
    for (line, entry) in entries.iter().take(max_entries(plot)).enumerate() {
        let y = place.y + LINE_HEIGHT * (line as f64 + 0.5) + 2.0;
        svg.line(
            &[[place.x + 5.0, y], [place.x + 22.0, y]],
            Stroke::new(entry.color, 2.5),
        );
        let name = fit_text(entry.name, place.width - 28.0, TICK_SIZE, Weight::Regular);
        svg.text(
            [place.x + 28.0, y + 4.0],
            &name,
            TextStyle::new(TICK_SIZE, Anchor::Start),
        );
    }
}

/// Points along a line through `points`, so close that no legend fits between two of them.
pub(super) fn sample_line(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let between = |ends: &[[f64; 2]]| {
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
        .flat_map(between)
        .chain(points.last().copied())
        .collect()
}

/// Points all over a band between two edges, so close that no legend fits between them.
/// `outline`: (x, low, high) on the page.
pub(super) fn sample_band(outline: &[[f64; 3]]) -> Vec<[f64; 2]> {
    let edge = |which: usize| {
        sample_line(
            &outline
                .iter()
                .map(|point| [point[0], point[which]])
                .collect::<Vec<_>>(),
        )
    };
    let across = |ends: &[[f64; 3]]| {
        let [from, to] = [ends[0], ends[1]];
        let parts = ((to[0] - from[0]).abs() / SAMPLE_DISTANCE)
            .ceil()
            .clamp(1.0, 1000.0) as u32;
        (0..=parts)
            .map(move |part| f64::from(part) / f64::from(parts))
            .flat_map(move |share| {
                let [x, low, high] =
                    [0, 1, 2].map(|which| from[which] + share * (to[which] - from[which]));
                sample_line(&[[x, low], [x, high]])
            })
    };
    outline
        .windows(2)
        .flat_map(across)
        .chain(edge(1))
        .chain(edge(2))
        .collect()
}

/// The upper left, upper right, lower right or lower left corner, or otherwise the uppermost free
/// rectangle at the right or at the left edge.
fn free_rect_of_size([width, height]: [f64; 2], plot: &Rect, points: &[[f64; 2]]) -> Option<Rect> {
    let (left, right) = (plot.x + MARGIN, plot.right() - width - 2.0);
    let (top, bottom) = (plot.y + 2.0, plot.bottom() - height - MARGIN);
    let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
    let heights = || {
        (1..100)
            .map(|line| top + LINE_HEIGHT * f64::from(line))
            .take_while(|&y| y < bottom)
    };
    let edges = [right, left]
        .into_iter()
        .flat_map(|x| heights().map(move |y| [x, y]));
    let is_free = |place: &Rect| {
        let [x, y] = [place.x..=place.right(), place.y..=place.bottom()];
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
    fn a_legend_is_where_nothing_else_is() {
        let corner = |points: &[[f64; 2]]| {
            free_rect_of_size([40.0, 20.0], &PLOT, points).map(|corner| [corner.x, corner.y])
        };
        let rising: Vec<[f64; 2]> = (0..100)
            .map(|x| [f64::from(x), 100.0 - f64::from(x)])
            .collect();
        assert_eq!(corner(&rising), Some([MARGIN, 2.0]));
        let falling: Vec<[f64; 2]> = rising.iter().map(|[x, y]| [*x, 100.0 - y]).collect();
        assert_eq!(corner(&falling), Some([58.0, 2.0]));
        // A line of two points hides behind a legend between them as well.
        let steep = sample_line(&[[0.0, -40.0], [30.0, 30.0], [100.0, 90.0]]);
        assert_eq!(corner(&steep), Some([58.0, 2.0]));
        // Two lines leave room between them at the edge, one line of words below the corner; five
        // leave none.
        let flat = |y: f64| sample_line(&[[0.0, y], [100.0, y]]);
        assert_eq!(
            corner(&[flat(10.0), flat(90.0)].concat()),
            Some([58.0, 18.0])
        );
        assert_eq!(
            corner(&[flat(10.0), flat(28.0), flat(46.0), flat(64.0), flat(82.0)].concat()),
            None
        );
    }

    /// The edges of this band pass above and below each corner.
    #[test]
    fn a_band_must_stay_visible_as_well() {
        let band = sample_band(&[[0.0, 120.0, -20.0], [100.0, 120.0, -20.0]]);
        assert_eq!(free_rect_of_size([40.0, 20.0], &PLOT, &band), None);
    }
}
