//! The range of the bonuses (intrinsic rewards) of a run.

/// Whether the steps of a run have a bonus (an intrinsic reward), and the range of the bonus.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum BonusRange {
    /// No step has a bonus.
    #[default]
    None,
    /// The bonus of each step is between 0 and this value.
    UpTo(f32),
}

impl BonusRange {
    /// Whether steps have a bonus.
    #[must_use]
    pub fn exists(self) -> bool {
        self != Self::None
    }

    /// The largest bonus that a step can have; `None` if no step has a bonus.
    #[must_use]
    pub fn max(self) -> Option<f32> {
        match self {
            Self::None => None,
            Self::UpTo(max) => Some(max),
        }
    }

    /// The range of bonuses of two runs together; none unless both have bonuses.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        let max = |one: f32| Some(one.max(other.max()?));
        self.max().and_then(max).into()
    }

    /// The upper end of color scales and axes of bonuses: the largest bonus, or 1 if all bonuses
    /// are 0 because their weight is 0.
    #[must_use]
    pub fn scale_end(self) -> Option<f32> {
        self.max().map(|max| if max > 0.0 { max } else { 1.0 })
    }
}

impl From<Option<f32>> for BonusRange {
    fn from(max: Option<f32>) -> Self {
        max.map_or(Self::None, Self::UpTo)
    }
}
