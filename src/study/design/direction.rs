//! The table of claimed directions: what each says of an effect, how it is tested, and in which words.
//!
//! A new kind of claim is a variant of [`ClaimDirection`] and a row of the table.

use serde::{Deserialize, Serialize};

/// Claimed direction of an effect, which is the measure of the first cell minus the measure of the
/// second.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ClaimDirection {
    /// Above 0.
    More,
    /// Below 0.
    Less,
    /// Smaller than `smallest` in both directions.
    Same,
    /// Below `smallest`: the first cell is not relevantly larger.
    NotMore,
    /// Above −`smallest`: the first cell is not relevantly smaller.
    NotLess,
}

/// An effect that others are compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
    /// No effect.
    Zero,
    /// The smallest effect of interest.
    Smallest,
    /// The smallest effect of interest in the other direction.
    MinusSmallest,
}

impl Bound {
    /// Its value, in the unit of the measure.
    #[must_use]
    pub fn value(self, smallest: f64) -> f64 {
        match self {
            Self::Zero => 0.0,
            Self::Smallest => smallest,
            Self::MinusSmallest => -smallest,
        }
    }
}

/// What is to be known of a claimed direction.
#[derive(Clone, Copy, Debug)]
pub struct Rule {
    /// Whether the claim is that there is no relevant effect, in both directions or in one. Such claims are a family of
    /// their own.
    pub is_null: bool,
    /// Whether the claim is that the first cell is above the second, or not below it.
    pub is_upwards: bool,
    /// The effect is above this bound; `None` if the claim does not say it.
    pub above: Option<Bound>,
    /// The effect is below this bound; `None` if the claim does not say it.
    pub below: Option<Bound>,
    /// The effects below and above the estimate with which the ends of its interval are compared.
    pub compared_ends: [Bound; 2],
    /// The claimed effect, where `{}` is the smallest effect of interest.
    pub words: &'static str,
    /// The verdict that there is no effect beyond the margins: one on one side says nothing of the other.
    pub words_without_effect: &'static str,
}

const EFFECT: &str = "no relevant effect";

/// Each direction with its rule.
const RULES: [(ClaimDirection, Rule); 5] = [
    (
        ClaimDirection::More,
        Rule {
            is_null: false,
            is_upwards: true,
            above: Some(Bound::Zero),
            below: None,
            compared_ends: [Bound::Zero, Bound::Smallest],
            words: "above 0; smallest effect of interest {}",
            words_without_effect: EFFECT,
        },
    ),
    (
        ClaimDirection::Less,
        Rule {
            is_null: false,
            is_upwards: false,
            above: None,
            below: Some(Bound::Zero),
            compared_ends: [Bound::MinusSmallest, Bound::Zero],
            words: "below 0; smallest effect of interest {}",
            words_without_effect: EFFECT,
        },
    ),
    (
        ClaimDirection::Same,
        Rule {
            is_null: true,
            is_upwards: false,
            above: Some(Bound::MinusSmallest),
            below: Some(Bound::Smallest),
            compared_ends: [Bound::MinusSmallest, Bound::Smallest],
            words: "between −{} and {}",
            words_without_effect: EFFECT,
        },
    ),
    (
        ClaimDirection::NotMore,
        Rule {
            is_null: true,
            is_upwards: false,
            above: None,
            below: Some(Bound::Smallest),
            compared_ends: [Bound::Smallest, Bound::Smallest],
            words: "below {}",
            words_without_effect: "no relevant increase",
        },
    ),
    (
        ClaimDirection::NotLess,
        Rule {
            is_null: true,
            is_upwards: true,
            above: Some(Bound::MinusSmallest),
            below: None,
            compared_ends: [Bound::MinusSmallest, Bound::MinusSmallest],
            words: "above −{}",
            words_without_effect: "no relevant decrease",
        },
    ),
];

impl ClaimDirection {
    /// Its name in study files and locks, such as `More`.
    ///
    /// # Panics
    /// Never: a variant without fields always serializes.
    #[must_use]
    pub fn name(self) -> String {
        ron::to_string(&self).expect("plain data always serializes")
    }

    /// Its row of the table.
    ///
    /// # Panics
    /// Never: each direction has a row.
    #[must_use]
    pub fn rule(self) -> &'static Rule {
        let mut rules = RULES.iter();
        let found = rules.find(|(direction, _)| *direction == self);
        &found.expect("each direction has a rule").1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_direction_has_one_rule() {
        use ClaimDirection::{Less, More, NotLess, NotMore, Same};
        for direction in [More, Less, Same, NotMore, NotLess] {
            let rows = RULES.iter().filter(|(other, _)| *other == direction);
            assert_eq!(rows.count(), 1, "{direction:?}");
            let rule = direction.rule();
            assert!(rule.above.is_some() || rule.below.is_some());
        }
    }
}
