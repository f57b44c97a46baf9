//! Parallel coordinates: one upright axis for each quantity, one line across them for each state.

use super::color::{AXIS, Color, GREY, of_count};
use super::drawing::{Anchor, Area, Drawing, Lettering, Stroke};
use super::font::{Weight, fitted, width};
use super::frame::{HEAD, LABEL, TICK, title};
use super::pair::name;
use super::pixels;
use super::scale::written;
use crate::env::Quantity;

/// Visited states across upright axes.
#[derive(Clone, Debug, PartialEq)]
pub struct ParallelCoordinates {
    /// Stands above the panel.
    pub title: String,
    /// From left to right: name, unit, and the values at the lower and the upper end.
    pub axes: Vec<Quantity>,
    /// What crosses the axes.
    pub states: States,
}

/// States as lines, or as their density where there are too many to be told apart.
#[derive(Clone, Debug, PartialEq)]
pub enum States {
    /// One line a state, the later ones on top.
    Lines(Vec<StateLine>),
    /// How many lines pass each pixel.
    Density(DensityPicture),
}

/// One state.
#[derive(Clone, Debug, PartialEq)]
pub struct StateLine {
    /// Where it crosses each axis, 0 at the lower and 1 at the upper end: `[axes]`.
    pub fractions: Vec<f32>,
    /// Its colour.
    pub color: Color,
}

/// How many lines pass each pixel between the first and the last axis. Colours are those of [`Key::Counts`](super::Key::Counts).
#[derive(Clone, Debug, PartialEq)]
pub struct DensityPicture {
    /// Row by row from the top: `[height × width]`.
    pub pixels: Vec<u32>,
    /// Pixels to the right.
    pub width: usize,
    /// The count that has the darkest colour.
    pub most: u32,
}

impl ParallelCoordinates {
    pub(super) fn draw(&self, panel: &Area, drawing: &mut Drawing) {
        let staggered = self.names_are_crowded(panel);
        let names = if staggered { 30.0 } else { 15.0 };
        let side = (0.5 * panel.width / self.axes.len().max(1) as f64).min(46.0);
        let area = panel.within([HEAD + names + 17.0, side, 22.0, side]);
        title(&self.title, panel, panel.x + 4.0, drawing);
        match &self.states {
            States::Lines(lines) => draw_lines(lines, &area, drawing),
            States::Density(density) => density.draw(&area, drawing),
        }
        for (index, axis) in self.axes.iter().enumerate() {
            let x = self.x(index, &area);
            let raised = staggered && index % 2 == 1;
            draw_axis(axis, x, &area, drawing);
            let y = area.y - if raised { 35.0 } else { 20.0 };
            draw_name(axis, [x, y], panel, self.room(panel, staggered), drawing);
        }
    }

    fn x(&self, axis: usize, area: &Area) -> f64 {
        area.x + area.width * axis as f64 / (self.axes.len() - 1).max(1) as f64
    }

    /// What a name may take.
    fn room(&self, panel: &Area, staggered: bool) -> f64 {
        let each = panel.width / self.axes.len().max(1) as f64;
        if staggered {
            2.0 * each - 6.0
        } else {
            each - 4.0
        }
    }

    /// Whether names do not stand beside each other, so that every other one stands one line higher.
    fn names_are_crowded(&self, panel: &Area) -> bool {
        let room = self.room(panel, false);
        self.axes
            .iter()
            .any(|axis| width(&name(axis), LABEL, Weight::Regular) > room)
    }
}

fn draw_lines(lines: &[StateLine], area: &Area, drawing: &mut Drawing) {
    let opacity = match lines.len() {
        0..50 => 0.9,
        50..300 => 0.55,
        _ => 0.35,
    };
    for line in lines {
        let gap = area.width / (line.fractions.len() - 1).max(1) as f64;
        let place = |(index, fraction): (usize, &f32)| {
            [
                area.x + gap * index as f64,
                area.bottom() - f64::from(*fraction) * area.height,
            ]
        };
        let places: Vec<[f64; 2]> = line.fractions.iter().enumerate().map(place).collect();
        drawing.line(
            &places,
            Stroke {
                opacity,
                ..Stroke::new(line.color, 0.7)
            },
        );
    }
}

impl DensityPicture {
    fn draw(&self, area: &Area, drawing: &mut Drawing) {
        let colors: Vec<Color> = self
            .pixels
            .iter()
            .map(|&count| of_count(count, self.most))
            .collect();
        if !colors.is_empty() {
            drawing.image(area, &pixels::picture(&colors, self.width), false);
        }
    }
}

/// The axis with its ends above and below it.
fn draw_axis(axis: &Quantity, x: f64, area: &Area, drawing: &mut Drawing) {
    drawing.line(&[[x, area.y], [x, area.bottom()]], Stroke::new(AXIS, 1.2));
    let [low, high] = axis.range.map(|end| written(f64::from(end)));
    let ends = Lettering::new(TICK, Anchor::Middle).color(GREY);
    drawing.text([x, area.y - 5.0], &high, ends);
    drawing.text([x, area.bottom() + 14.0], &low, ends);
}

/// With its unit where there is room; those of the outer axes are moved into the panel.
fn draw_name(axis: &Quantity, [x, y]: [f64; 2], panel: &Area, room: f64, drawing: &mut Drawing) {
    let full = name(axis);
    let name = if width(&full, LABEL, Weight::Regular) > room {
        &axis.name
    } else {
        &full
    };
    let name = fitted(name, room.min(panel.width), LABEL, Weight::Regular);
    let half = 0.5 * width(&name, LABEL, Weight::Regular);
    let x = x.clamp(panel.x + half, (panel.right() - half).max(panel.x + half));
    drawing.text([x, y], &name, Lettering::new(LABEL, Anchor::Middle));
}
