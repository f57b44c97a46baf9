//! Values that an axis cannot show at their place.

use std::ops::AddAssign;

/// Numbers or shares of values that are not within the range of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unplaced<N = u64> {
    /// Below the range, where −∞ is, too. They are drawn at the lower end.
    pub below: N,
    /// Above the range, where ∞ is, too. They are drawn at the upper end.
    pub above: N,
    /// Not a number (NaN). They are not drawn.
    pub nan: N,
}

impl Unplaced {
    /// Counts a value if it is not within the range.
    pub fn count(&mut self, value: f32, [low, high]: [f32; 2]) {
        self.below += u64::from(value < low);
        self.above += u64::from(value > high);
        self.nan += u64::from(value.is_nan());
    }

    /// The shares of `values` values.
    #[must_use]
    pub fn shares(&self, values: u64) -> Unplaced<f64> {
        let share = |count: u64| count as f64 / values.max(1) as f64;
        Unplaced {
            below: share(self.below),
            above: share(self.above),
            nan: share(self.nan),
        }
    }
}

impl AddAssign for Unplaced {
    fn add_assign(&mut self, other: Self) {
        self.below += other.below;
        self.above += other.above;
        self.nan += other.nan;
    }
}

impl Unplaced<f64> {
    /// Below, above and NaN.
    #[must_use]
    pub fn to_array(self) -> [f64; 3] {
        [self.below, self.above, self.nan]
    }

    /// Adds shares of a part that has this weight.
    pub fn add_weighted(&mut self, part: &Self, weight: f64) {
        self.below += weight * part.below;
        self.above += weight * part.above;
        self.nan += weight * part.nan;
    }
}
