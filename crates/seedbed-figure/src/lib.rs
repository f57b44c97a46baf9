//! Figures for publications: pure functions from data to SVG text and PNG bytes.
//!
//! A [`Figure`] is rows of panels on a white page. [`Figure::svg`] returns an SVG file, which
//! browsers show and vector editors can change. [`Figure::png`] and [`PrintLayout::encode`] render it with fonts that are part
//! of this crate, so that the result does not depend on the fonts of the machine. The same data
//! give the same bytes.
//!
//! ```
//! use seedbed_figure::{Curves, Figure, Panel, Row, Series, color};
//!
//! let returns = Series {
//!     name: "agent 0".to_owned(),
//!     color: color::categorical_color(0),
//!     points: vec![[0.0, 12.0], [1.0, 35.0], [2.0, 180.0], [3.0, 200.0]],
//!     ..Series::default()
//! };
//! let curves = Curves {
//!     title: "Learning curve".to_owned(),
//!     x_label: "episode".to_owned(),
//!     y_label: "return".to_owned(),
//!     series: vec![returns],
//!     has_legend: true,
//!     ..Curves::default()
//! };
//! let figure = Figure {
//!     title: "One agent".to_owned(),
//!     description: "The return rises from 12 to 200 within four episodes.".to_owned(),
//!     width: 480.0,
//!     rows: vec![Row { height: 250.0, panels: vec![Panel::Curves(curves)], key: None }],
//! };
//! let path = std::env::temp_dir().join("seedbed-figure-example.svg");
//! std::fs::write(&path, figure.svg())?;
//! # assert!(std::fs::read_to_string(&path)?.starts_with("<svg"));
//! # std::fs::remove_file(&path)?;
//! # Ok::<(), std::io::Error>(())
//! ```
//!
//! | Panel | Shows |
//! |---|---|
//! | [`Curves`] | curves with bands, step and survival curves; [`Figure::from_curves`] arranges several with common axes |
//! | [`ParallelCoordinates`] | points of many dimensions, as lines or as their density |
//! | [`Scatter`], [`HeatMap`] | two dimensions, as points, or as counts or differences over cells |
//! | [`NumberGrid`] | numbers over two dimensions, as text on colors |
//! | [`Drawing`] | shapes in a plane, drawn to scale |
//! | [`Picture`] | a picture with its own proportions |
//! | [`Intervals`] | a table of estimates with their intervals |
//!
//! This crate must not depend on the meaning of numbers, on files, or on training.

pub mod color;
mod curves;
mod drawing;
mod font;
mod intervals;
mod key;
mod legend;
mod number_grid;
mod page;
mod pair;
mod panel_axes;
mod parallel;
mod pdf;
mod picture;
mod pixels;
mod print;
mod scale;
mod svg;
mod theme;

pub use color::Color;
pub use curves::{Curves, Series, Threshold};
pub use drawing::{Drawing, DrawnShape};
pub use font::font_faces;
pub use intervals::{IntervalRow, Intervals};
pub use key::Key;
pub use number_grid::{GridNumber, NumberGrid};
pub use page::MAX_SHARE_OF_KEY;
pub use pair::{Cells, HeatMap, Scatter, ScatterPoint};
pub use parallel::{DensityImage, DifferenceImage, ParallelCoordinates, StateLine, States};
pub use picture::Picture;
pub use pixels::{Pixels, RenderError};
pub use print::{Format, PrintLayout};
pub use theme::Theme;

/// One dimension of a panel: its name, its unit, and the range that is shown.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Name of the dimension.
    pub name: String,
    /// Unit, such as `m/s`; empty for a pure number.
    pub unit: String,
    /// Values at the lower and the upper end. Values outside this range are drawn at the ends.
    pub range: [f32; 2],
    /// Shares of the drawn values that are below and above the range, 0 to 1; marked at the ends of
    /// axes of parallel coordinates.
    pub outside: [f64; 2],
    /// Share of the values that are not a number (NaN), 0 to 1. They have no place on the axis, so that
    /// they are not drawn; the share is written at the axis.
    pub nan: f64,
}

impl Axis {
    /// The value at a fraction of the range.
    #[must_use]
    pub fn value_at(&self, fraction: f32) -> f32 {
        let [low, high] = self.range;
        low + fraction * (high - low)
    }

    /// Name and unit, such as `angle [rad]`.
    fn label(&self) -> String {
        if self.unit.is_empty() {
            self.name.clone()
        } else {
            format!("{} [{}]", self.name, self.unit)
        }
    }
}

/// Rows of panels on a white page. Lengths are CSS pixels, 1/96 inch.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Title above all panels, also used as alternative text of the figure; may be empty.
    pub title: String,
    /// Description of the content, for readers who cannot see it.
    pub description: String,
    /// Width of the page.
    pub width: f64,
    /// Rows of panels, from top to bottom.
    pub rows: Vec<Row>,
}

/// Panels side by side, of the same width.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Height of the row, including titles.
    pub height: f64,
    /// Panels, from left to right.
    pub panels: Vec<Panel>,
    /// Color key of these panels, drawn to their right.
    pub key: Option<Key>,
}

/// One plot, or an empty space.
#[derive(Clone, Debug, PartialEq)]
pub enum Panel {
    /// Curves over a common x axis.
    Curves(Curves),
    /// Points of many dimensions, each as a line across vertical axes.
    ParallelCoordinates(ParallelCoordinates),
    /// Points of two dimensions.
    Scatter(Scatter),
    /// Counts over two dimensions.
    HeatMap(HeatMap),
    /// Estimates with their intervals.
    Intervals(Intervals),
    /// Numbers over two dimensions.
    NumberGrid(NumberGrid),
    /// Shapes in a plane, drawn to scale.
    Drawing(Drawing),
    /// A picture with its own proportions.
    Picture(Picture),
    /// The color key of the rows above, on a narrow page.
    Key(Key),
    /// An empty space, so that the panels of several rows are aligned.
    Blank,
}
