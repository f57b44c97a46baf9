//! Ground that is drawn at the start of each episode.

use super::DrawnNumber;
use crate::expression::Program;

/// A line of points at equal distances along x, whose heights are drawn at the start of each episode.
///
/// Formulas read these columns: the constants of the run and the numbers of the episode, the index of
/// the point, the numbers that are drawn for the point, and the values that go from point to point.
#[derive(Clone, Debug, PartialEq)]
pub struct Terrain {
    /// x of the first point, m.
    pub from: f64,
    /// Distance of neighboring points along x, m.
    pub spacing: f64,
    /// Number of points.
    pub points: usize,
    /// Numbers that are drawn for each point.
    pub drawn: Vec<DrawnNumber>,
    /// Values that go from point to point.
    pub values: Vec<TerrainValue>,
    /// Height of a point, m.
    pub height: Program,
    /// Column of the index of the point.
    pub index_column: usize,
}

/// A value that a point of a terrain takes over from the point before it and changes.
#[derive(Clone, Debug, PartialEq)]
pub struct TerrainValue {
    /// Its value at the first point.
    pub start: Program,
    /// Its value at each further point: it reads the values of the point before, and the new ones of
    /// the values that are listed before it.
    pub next: Program,
}

impl Terrain {
    /// Column of the first number that is drawn for a point.
    #[must_use]
    pub fn first_drawn(&self) -> usize {
        self.index_column + 1
    }

    /// Column of the first value.
    #[must_use]
    pub fn first_value(&self) -> usize {
        self.first_drawn() + self.drawn.len()
    }

    /// The line through points of these heights, from right to left: it can be touched from above.
    #[must_use]
    pub fn line(
        &self,
        heights: impl DoubleEndedIterator<Item = f32> + ExactSizeIterator,
    ) -> Vec<[f32; 2]> {
        let x = |index: usize| (self.from + self.spacing * index as f64) as f32;
        let points = heights
            .enumerate()
            .map(|(index, height)| [x(index), height]);
        points.rev().collect()
    }
}
