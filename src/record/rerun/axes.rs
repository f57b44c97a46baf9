//! `/visitation/axes/…`: the upright axes with their names, units and ends, and where words have room.

use rerun::components::Radius;
use rerun::log::Chunk;
use rerun::{LineStrips2D, Points2D};

use super::rows::{rgb, timeless};
use super::sink::Fault;
use crate::env::Quantity;
use crate::record::visitation::{Axes, HEIGHT};

const AXIS_COLOR: [u8; 3] = [150, 150, 160];
const NAME_COLOR: [u8; 3] = [235, 235, 240];
const END_COLOR: [u8; 3] = [165, 165, 175];

/// `/visitation/axes`, with names and ends at `/visitation/axes/labels` and for small views with bare `/visitation/axes/names`.
pub(super) fn furniture(axes: &Axes, wide: Lettering, narrow: Lettering) -> Result<[Chunk; 3], Fault> {
    let stands = (0..axes.all().len()).map(|axis| axes.x(axis));
    let uprights = LineStrips2D::new(stands.map(|x| [[x, 0.0], [x, HEIGHT as f32]]));
    let uprights = uprights.with_colors([rgb(AXIS_COLOR)]).with_radii([Radius::new_ui_points(0.8)]).with_draw_order(50.0);
    Ok([
        timeless("visitation/axes", &uprights)?,
        timeless("visitation/axes/labels", &texts(wide.names(axes).chain(wide.ends(axes))))?,
        timeless("visitation/axes/names", &texts(narrow.names(axes)))?,
    ])
}

/// Words, where they stand, and their colour.
type Label = (String, [f32; 2], [u8; 3]);

fn texts(labels: impl Iterator<Item = Label>) -> Points2D {
    let labels: Vec<Label> = labels.collect();
    Points2D::new(labels.iter().map(|(_, place, _)| *place))
        .with_colors(labels.iter().map(|(_, _, color)| rgb(*color)))
        .with_labels(labels.into_iter().map(|(text, ..)| text))
        .with_radii([Radius::ZERO])
        .with_show_labels(true)
        .with_draw_order(60.0)
}

/// At most three decimals, none of them an idle zero.
fn number(value: f32) -> String {
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Where words stand. Their size is fixed in points of the screen, whereas everything else grows with the view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lettering {
    /// Height of a line of words, in pixels of the density image.
    line: f32,
    /// Whether numbers stand at the ends of the axes.
    with_ends: bool,
    /// Whether units have room beside names.
    with_units: bool,
    /// Whether every other name stands one line higher.
    staggered: bool,
}

impl Lettering {
    /// Points of the screen that a line of words takes.
    pub(super) const LINE: f32 = 19.0;

    /// Points of the screen that a letter takes.
    const LETTER: f32 = 6.7;

    /// For views in which a pixel of the density image is `scale` points of the screen.
    pub(super) fn new(axes: &Axes, scale: f32, with_ends: bool) -> Self {
        let room = (axes.x(1) - axes.x(0)) * scale;
        let widest = |with_units| {
            let letters = axes.all().iter().map(|axis| name(&axis.quantity, with_units).chars().count());
            letters.max().unwrap_or(0) as f32 * Self::LETTER + 8.0
        };
        let with_units = with_ends && widest(true) <= 2.0 * room;
        Self { line: Self::LINE / scale, with_ends, with_units, staggered: widest(with_units) > room }
    }

    fn names(self, axes: &Axes) -> impl Iterator<Item = Label> {
        let below = if self.with_ends { 2.1 } else { 1.05 };
        (0..).zip(axes.all()).map(move |(index, axis)| {
            let lines = if self.staggered && index % 2 == 1 { below + 1.0 } else { below };
            (name(&axis.quantity, self.with_units), [axes.x(index), -lines * self.line], NAME_COLOR)
        })
    }

    fn ends(self, axes: &Axes) -> impl Iterator<Item = Label> {
        let bottom = HEIGHT as f32 + 0.05 * self.line;
        (0..).zip(axes.all()).flat_map(move |(index, axis)| {
            let [low, high] = axis.quantity.range.map(number);
            let x = axes.x(index);
            [(high, [x, -1.05 * self.line], END_COLOR), (low, [x, bottom], END_COLOR)]
        })
    }

    /// What is written, from the uppermost to the lowest end.
    pub(super) fn y_range(self) -> [f64; 2] {
        let above = if self.staggered { 2.2 } else { 1.2 } + if self.with_ends { 1.0 } else { 0.0 };
        let below = if self.with_ends { 1.2 } else { 0.2 };
        [f64::from(-above * self.line), f64::from(HEIGHT as f32 + below * self.line)]
    }
}

fn name(quantity: &Quantity, with_unit: bool) -> String {
    if quantity.unit.is_empty() || !with_unit { quantity.name.clone() } else { format!("{} [{}]", quantity.name, quantity.unit) }
}
