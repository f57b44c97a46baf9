//! Whether a claim held, by a rule that is fixed before the runs.

use super::Interval;

/// Which way a claim says an effect goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Above 0.
    Positive,
    /// Below 0.
    Negative,
}

/// What became of a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The interval excludes 0 in the claimed direction.
    Replicated,
    /// It does not, and it excludes the claimed size.
    NotReplicated,
    /// The data leave both open, or are too few.
    Inconclusive,
}

/// The verdict on a claim that an effect has this direction and size, from the 95 % interval of the effect. `size` has no sign.
///
/// The first of the two rules decides: an effect that is there but smaller than claimed is replicated.
///
/// # Panics
/// If `size` is not above 0.
#[must_use]
pub fn verdict(effect: Interval, direction: Direction, size: f64) -> Verdict {
    assert!(size > 0.0, "a claimed effect of size {size}");
    match known(effect, direction, size) {
        Some([true, _]) => Verdict::Replicated,
        Some([false, true]) => Verdict::NotReplicated,
        Some([false, false]) | None => Verdict::Inconclusive,
    }
}

/// Whether an effect is there in the claimed direction, and smaller than claimed: its 95 % interval excludes 0 and the claimed size.
#[must_use]
pub fn is_smaller_than_claimed(effect: Interval, direction: Direction, size: f64) -> bool {
    known(effect, direction, size) == Some([true, true])
}

/// Whether the whole interval lies above 0, and whether it lies below `size`, in the claimed direction. `None` of too few runs.
fn known(effect: Interval, direction: Direction, size: f64) -> Option<[bool; 2]> {
    let Interval::Known { low, high } = effect else {
        return None;
    };
    let [least, most] = match direction {
        Direction::Positive => [low, high],
        Direction::Negative => [-high, -low],
    };
    Some([least > 0.0, most < size])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on(low: f64, high: f64) -> [Verdict; 2] {
        [Direction::Positive, Direction::Negative]
            .map(|direction| verdict(Interval::Known { low, high }, direction, 2.0))
    }

    /// The claim is an effect of +2, and of −2.
    #[test]
    fn zero_and_the_claimed_size_decide() {
        use Verdict::{Inconclusive, NotReplicated, Replicated};
        assert_eq!(on(0.5, 3.0), [Replicated, NotReplicated]);
        assert_eq!(on(-3.0, -0.5), [NotReplicated, Replicated]);
        assert_eq!(on(0.5, 1.0), [Replicated, NotReplicated]);
        assert_eq!(on(-1.0, 1.0), [NotReplicated, NotReplicated]);
        assert_eq!(on(-1.0, 3.0), [Inconclusive, NotReplicated]);
        assert_eq!(on(-3.0, 3.0), [Inconclusive, Inconclusive]);
    }

    /// From ½ to 1 the effect is there and is not 2; up to 3 it may be 2; from −1 on it may be none.
    #[test]
    fn an_effect_may_be_there_and_smaller() {
        let on = |low: f64, high: f64| {
            [Direction::Positive, Direction::Negative].map(|direction| {
                is_smaller_than_claimed(Interval::Known { low, high }, direction, 2.0)
            })
        };
        assert_eq!(
            [on(0.5, 1.0), on(-1.0, -0.5)],
            [[true, false], [false, true]]
        );
        assert_eq!(
            [on(0.5, 2.0), on(0.5, 3.0), on(-1.0, 1.0), on(3.0, 4.0)],
            [[false; 2]; 4]
        );
        assert!(!is_smaller_than_claimed(
            Interval::TooFewRuns { n: 4 },
            Direction::Positive,
            2.0
        ));
    }

    #[test]
    fn an_end_belongs_to_the_interval() {
        assert_eq!(on(0.0, 2.0)[0], Verdict::Inconclusive);
    }

    #[test]
    fn few_runs_decide_nothing() {
        assert_eq!(
            verdict(Interval::TooFewRuns { n: 4 }, Direction::Positive, 1.0),
            Verdict::Inconclusive
        );
    }
}
