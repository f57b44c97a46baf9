//! Names of curves, in that corner of a plot where the fewest points are.

use super::color::Color;
use super::drawing::{Anchor, Area, Drawing, Lettering, Stroke};
use super::font::{Weight, width};
use super::frame::TICK;

/// One name in a legend.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry<'a> {
    pub(super) name: &'a str,
    pub(super) color: Color,
}

const LINE: f64 = 16.0;
const MARGIN: f64 = 6.0;

/// Draws as many entries as have room.   `points`: places on the page that should stay visible
pub(super) fn draw(entries: &[Entry<'_>], plot: &Area, points: &[[f64; 2]], drawing: &mut Drawing) {
    let room = ((plot.height - 2.0 * MARGIN) / LINE) as usize;
    let entries = &entries[..entries.len().min(room)];
    if entries.is_empty() {
        return;
    }
    let widest = entries.iter().map(|entry| width(entry.name, TICK, Weight::Regular)).fold(0.0, f64::max);
    let size = [widest + 34.0, LINE * entries.len() as f64 + 4.0];
    let corner = freest_corner(size, plot, points);
    drawing.rectangle(&corner, [255; 3], 0.8);
    for (line, entry) in entries.iter().enumerate() {
        let y = corner.y + LINE * (line as f64 + 0.5) + 2.0;
        drawing.line(&[[corner.x + 5.0, y], [corner.x + 22.0, y]], Stroke::new(entry.color, 2.5));
        drawing.text([corner.x + 28.0, y + 4.0], entry.name, Lettering::new(TICK, Anchor::Start));
    }
}

/// Places along a line through `points`, so close that no legend fits between them.
pub(super) fn traced(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let between = |ends: &[[f64; 2]]| {
        let [[x, y], [to_x, to_y]] = [ends[0], ends[1]];
        let parts = ((to_x - x).hypot(to_y - y) / LINE).ceil().clamp(1.0, 1000.0) as u32;
        (0..parts)
            .map(move |part| f64::from(part) / f64::from(parts))
            .map(move |share| [x + share * (to_x - x), y + share * (to_y - y)])
    };
    points.windows(2).flat_map(between).chain(points.last().copied()).collect()
}

/// Of the four corners; among equals the upper left, upper right, lower right, lower left one.
fn freest_corner([width, height]: [f64; 2], plot: &Area, points: &[[f64; 2]]) -> Area {
    let (left, right) = (plot.x + MARGIN, plot.right() - width - 2.0);
    let (top, bottom) = (plot.y + 2.0, plot.bottom() - height - MARGIN);
    let corners = [[left, top], [right, top], [right, bottom], [left, bottom]].map(|[x, y]| Area { x, y, width, height });
    let hidden = |corner: &Area| {
        let [x, y] = [corner.x..corner.right(), corner.y..corner.bottom()];
        points.iter().filter(|point| x.contains(&point[0]) && y.contains(&point[1])).count()
    };
    corners.into_iter().min_by_key(hidden).unwrap_or(corners[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_legend_stands_where_nothing_is() {
        let plot = Area { x: 0.0, y: 0.0, width: 100.0, height: 100.0 };
        let rising: Vec<[f64; 2]> = (0..100).map(|x| [f64::from(x), 100.0 - f64::from(x)]).collect();
        assert_eq!(freest_corner([40.0, 20.0], &plot, &rising).x, MARGIN);
        let falling: Vec<[f64; 2]> = rising.iter().map(|[x, y]| [*x, 100.0 - y]).collect();
        assert_eq!(freest_corner([40.0, 20.0], &plot, &falling).x, 58.0);
        // A line of two points hides behind a legend between them as well.
        let steep = traced(&[[0.0, -40.0], [30.0, 30.0], [100.0, 90.0]]);
        assert_eq!(freest_corner([40.0, 20.0], &plot, &steep).x, 58.0);
    }
}
