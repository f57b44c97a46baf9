//! Figures for publications: pure functions from data to SVG text and to PNG bytes.
//!
//! A [`Figure`] is rows of panels on a white page. [`Figure::svg`] writes it as text that any browser shows and any editor changes;
//! [`Figure::png`] draws that very text, with lettering that comes along in the binary, so that no machine's fonts matter. The same data
//! give the same bytes. What numbers mean, files and training may not enter.
//!
//! | Panel | For |
//! |---|---|
//! | [`Curves`] | curves with bands, step and survival curves; [`Figure::of_curves`] lays several out on common axes |
//! | [`ParallelCoordinates`] | visited states: lines, or their density |
//! | [`Scatter`], [`HeatMap`] | a pair of dimensions |
//! | [`Intervals`] | a table of estimates with their intervals |

pub mod color;
mod curves;
mod drawing;
mod font;
mod frame;
mod intervals;
mod key;
mod legend;
mod page;
mod pair;
mod parallel;
mod pixels;
mod scale;

pub use color::Color;
pub use curves::{Curves, Series, Threshold};
pub use font::font_faces;
pub use intervals::{IntervalRow, Intervals};
pub use key::Key;
pub use pair::{HeatMap, Scatter, ScatterPoint};
pub use parallel::{DensityPicture, ParallelCoordinates, StateLine, States};
pub use pixels::PngError;

/// Rows of panels on a white page. Lengths are CSS pixels, 1/96 inch.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Stands above all panels, unless empty, and is the alternative text of the picture.
    pub title: String,
    /// What can be seen, for those who cannot see it.
    pub description: String,
    /// The page's width.
    pub width: f64,
    /// From top to bottom.
    pub rows: Vec<Row>,
}

/// Panels side by side, of the same width.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The row's height, titles included.
    pub height: f64,
    /// From left to right.
    pub panels: Vec<Panel>,
    /// What the colours of these panels mean; stands to their right.
    pub key: Option<Key>,
}

/// One picture.
#[derive(Clone, Debug, PartialEq)]
pub enum Panel {
    /// Curves over a common abscissa.
    Curves(Curves),
    /// Visited states across upright axes.
    ParallelCoordinates(ParallelCoordinates),
    /// Points of two dimensions.
    Scatter(Scatter),
    /// Counts of two dimensions.
    HeatMap(HeatMap),
    /// Estimates with their intervals.
    Intervals(Intervals),
    /// Room left free, so that panels of several rows stand below each other.
    Blank,
}
