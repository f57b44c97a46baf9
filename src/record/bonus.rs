//! Whether steps have a bonus.

/// Whether the agents of a run have a bonus (an intrinsic reward), and how large it can be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum BonusRange {
    /// No step has a bonus.
    #[default]
    None,
    /// The bonus of a step is between 0 and this.
    UpTo(f32),
}

impl BonusRange {
    /// Whether agents have a bonus.
    #[must_use]
    pub fn exists(self) -> bool {
        self != Self::None
    }

    /// The largest bonus that a step can have.
    #[must_use]
    pub fn max(self) -> Option<f32> {
        match self {
            Self::None => None,
            Self::UpTo(max) => Some(max),
        }
    }

    /// The upper end of scales of bonuses: the largest one, or 1 if bonuses have weight 0, because
    /// a scale needs an extent.
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
