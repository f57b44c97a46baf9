//! Names of curves: where no curve is, in a corner or at an edge of a plot, or beside it.

use super::color::Color;
use super::drawing::{Anchor, Area, Drawing, Lettering, Stroke};
use super::font::{Weight, fitted, width};
use super::frame::TICK;

/// One name in a legend.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry<'a> {
    pub(super) name: &'a str,
    pub(super) color: Color,
}

const LINE: f64 = 16.0;
const MARGIN: f64 = 6.0;
/// Half the height of the smallest legend.
const NEAR: f64 = 8.0;

/// The room that a legend takes: its width, and the height of as many entries as fit beside `plot`.
fn size(entries: &[Entry<'_>], plot: &Area) -> [f64; 2] {
    let widest = entries
        .iter()
        .map(|entry| width(entry.name, TICK, Weight::Regular))
        .fold(0.0, f64::max);
    [
        widest + 34.0,
        LINE * entries.len().min(room(plot)) as f64 + 4.0,
    ]
}

fn room(plot: &Area) -> usize {
    ((plot.height - 2.0 * MARGIN) / LINE) as usize
}

/// Where in a plot a legend hides nothing, if there is such a place.   `points`: places on the page that must stay visible
pub(super) fn free_place(entries: &[Entry<'_>], plot: &Area, points: &[[f64; 2]]) -> Option<Area> {
    place_without(size(entries, plot), plot, points)
}

/// The width of a legend beside a plot.
pub(super) fn width_beside(entries: &[Entry<'_>], panel: &Area) -> f64 {
    size(entries, panel)[0].min(0.4 * panel.width)
}

/// Draws as many entries as have room in `plot`, from the upper left of `place` on.
pub(super) fn draw(entries: &[Entry<'_>], place: &Area, plot: &Area, drawing: &mut Drawing) {
    if entries.is_empty() {
        return;
    }
    drawing.rectangle(
        &Area {
            height: size(entries, plot)[1],
            ..*place
        },
        [255; 3],
        0.8,
    );
    for (line, entry) in entries.iter().take(room(plot)).enumerate() {
        let y = place.y + LINE * (line as f64 + 0.5) + 2.0;
        drawing.line(
            &[[place.x + 5.0, y], [place.x + 22.0, y]],
            Stroke::new(entry.color, 2.5),
        );
        let name = fitted(entry.name, place.width - 28.0, TICK, Weight::Regular);
        drawing.text(
            [place.x + 28.0, y + 4.0],
            &name,
            Lettering::new(TICK, Anchor::Start),
        );
    }
}

/// Places along a line through `points`, so close that no legend fits between them.
pub(super) fn traced(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let between = |ends: &[[f64; 2]]| {
        let [[x, y], [to_x, to_y]] = [ends[0], ends[1]];
        let parts = ((to_x - x).hypot(to_y - y) / NEAR)
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

/// Places all over a band between two edges, so close that no legend fits between them.   `outline`: (x, low, high) on the page
pub(super) fn covered(outline: &[[f64; 3]]) -> Vec<[f64; 2]> {
    let edge = |which: usize| {
        traced(
            &outline
                .iter()
                .map(|point| [point[0], point[which]])
                .collect::<Vec<_>>(),
        )
    };
    let across = |ends: &[[f64; 3]]| {
        let [from, to] = [ends[0], ends[1]];
        let parts = ((to[0] - from[0]).abs() / NEAR).ceil().clamp(1.0, 1000.0) as u32;
        (0..=parts)
            .map(move |part| f64::from(part) / f64::from(parts))
            .flat_map(move |share| {
                let [x, low, high] =
                    [0, 1, 2].map(|which| from[which] + share * (to[which] - from[which]));
                traced(&[[x, low], [x, high]])
            })
    };
    outline
        .windows(2)
        .flat_map(across)
        .chain(edge(1))
        .chain(edge(2))
        .collect()
}

/// The upper left, upper right, lower right or lower left corner, or else the uppermost place at the right or at the left edge.
fn place_without([width, height]: [f64; 2], plot: &Area, points: &[[f64; 2]]) -> Option<Area> {
    let (left, right) = (plot.x + MARGIN, plot.right() - width - 2.0);
    let (top, bottom) = (plot.y + 2.0, plot.bottom() - height - MARGIN);
    let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
    let heights = || {
        (1..100)
            .map(|line| top + LINE * f64::from(line))
            .take_while(|&y| y < bottom)
    };
    let edges = [right, left]
        .into_iter()
        .flat_map(|x| heights().map(move |y| [x, y]));
    let is_free = |place: &Area| {
        let [x, y] = [place.x..=place.right(), place.y..=place.bottom()];
        !points
            .iter()
            .any(|point| x.contains(&point[0]) && y.contains(&point[1]))
    };
    corners
        .into_iter()
        .chain(edges)
        .map(|[x, y]| Area {
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

    const PLOT: Area = Area {
        x: 0.0,
        y: 0.0,
        width: 100.0,
        height: 100.0,
    };

    #[test]
    fn a_legend_stands_where_nothing_is() {
        let corner = |points: &[[f64; 2]]| {
            place_without([40.0, 20.0], &PLOT, points).map(|corner| [corner.x, corner.y])
        };
        let rising: Vec<[f64; 2]> = (0..100)
            .map(|x| [f64::from(x), 100.0 - f64::from(x)])
            .collect();
        assert_eq!(corner(&rising), Some([MARGIN, 2.0]));
        let falling: Vec<[f64; 2]> = rising.iter().map(|[x, y]| [*x, 100.0 - y]).collect();
        assert_eq!(corner(&falling), Some([58.0, 2.0]));
        // A line of two points hides behind a legend between them as well.
        let steep = traced(&[[0.0, -40.0], [30.0, 30.0], [100.0, 90.0]]);
        assert_eq!(corner(&steep), Some([58.0, 2.0]));
        // Two lines leave room between them at the edge, one line of words below the corner; five leave none.
        let flat = |y: f64| traced(&[[0.0, y], [100.0, y]]);
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
        let band = covered(&[[0.0, 120.0, -20.0], [100.0, 120.0, -20.0]]);
        assert_eq!(place_without([40.0, 20.0], &PLOT, &band), None);
    }
}
