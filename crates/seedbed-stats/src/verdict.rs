//! Verdict on a claim that was registered before the runs and has a direction and a size.
//!
//! ```
//! use seedbed_stats::{Direction, Interval, Verdict, verdict};
//!
//! // Claim: the effect is positive, and 2 in size.
//! let claim = |low, high| verdict(Interval::Known { low, high }, Direction::Positive, 2.0);
//! assert_eq!(claim(0.5, 3.0), Verdict::Replicated); // excludes 0
//! assert_eq!(claim(-1.0, 1.0), Verdict::NotReplicated); // includes 0, excludes 2
//! assert_eq!(claim(-1.0, 3.0), Verdict::Inconclusive); // includes both
//! ```

use super::Interval;

/// Claimed sign of an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Above 0.
    Positive,
    /// Below 0.
    Negative,
}

/// Verdict on a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The interval excludes 0 in the claimed direction.
    Replicated,
    /// The interval includes 0 or values against the claim, and is entirely below the claimed size.
    NotReplicated,
    /// The interval includes both 0 and the claimed size, or there are too few runs.
    Inconclusive,
}

/// Verdict on the claim that an effect has this direction and size, from the 95 % interval of the
/// effect. `size` is above 0 for both directions.
///
/// An effect in the claimed direction that is smaller than claimed is replicated; see
/// [`is_smaller_than_claimed`].
///
/// # Panics
/// If `size` is not above 0.
#[must_use]
pub fn verdict(effect: Interval, direction: Direction, size: f64) -> Verdict {
    assert!(size > 0.0, "a claimed effect of size {size}");
    match is_above_zero_and_below_size(effect, direction, size) {
        Some([true, _]) => Verdict::Replicated,
        Some([false, true]) => Verdict::NotReplicated,
        Some([false, false]) | None => Verdict::Inconclusive,
    }
}

/// Whether the effect has the claimed direction but is smaller than claimed: its 95 % interval
/// excludes both 0 and the claimed size.
#[must_use]
pub fn is_smaller_than_claimed(effect: Interval, direction: Direction, size: f64) -> bool {
    is_above_zero_and_below_size(effect, direction, size) == Some([true, true])
}

/// Whether the whole interval is above 0, and whether the whole interval is below `size`; both in
/// the claimed direction. `None` with too few runs.
fn is_above_zero_and_below_size(
    effect: Interval,
    direction: Direction,
    size: f64,
) -> Option<[bool; 2]> {
    let Interval::Known { low, high } = effect else {
        return None;
    };
    let [low, high] = match direction {
        Direction::Positive => [low, high],
        Direction::Negative => [-high, -low],
    };
    Some([low > 0.0, high < size])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Verdicts on the claims that the effect is +2 and that it is −2, for an interval.
    fn verdicts(low: f64, high: f64) -> [Verdict; 2] {
        [Direction::Positive, Direction::Negative]
            .map(|direction| verdict(Interval::Known { low, high }, direction, 2.0))
    }

    #[test]
    fn verdicts_depend_on_zero_and_the_claimed_size() {
        use Verdict::{Inconclusive, NotReplicated, Replicated};
        assert_eq!(verdicts(0.5, 3.0), [Replicated, NotReplicated]);
        assert_eq!(verdicts(-3.0, -0.5), [NotReplicated, Replicated]);
        assert_eq!(verdicts(0.5, 1.0), [Replicated, NotReplicated]);
        assert_eq!(verdicts(-1.0, 1.0), [NotReplicated, NotReplicated]);
        assert_eq!(verdicts(-1.0, 3.0), [Inconclusive, NotReplicated]);
        assert_eq!(verdicts(-3.0, 3.0), [Inconclusive, Inconclusive]);
    }

    /// An effect between ½ and 1 is smaller than the claimed 2. An effect between ½ and 3 may be 2,
    /// and an effect between −1 and 1 may be 0.
    #[test]
    fn an_effect_smaller_than_claimed_excludes_zero_and_the_claimed_size() {
        let is_smaller = |low: f64, high: f64| {
            [Direction::Positive, Direction::Negative].map(|direction| {
                is_smaller_than_claimed(Interval::Known { low, high }, direction, 2.0)
            })
        };
        assert_eq!(
            [is_smaller(0.5, 1.0), is_smaller(-1.0, -0.5)],
            [[true, false], [false, true]]
        );
        assert_eq!(
            [
                is_smaller(0.5, 2.0),
                is_smaller(0.5, 3.0),
                is_smaller(-1.0, 1.0),
                is_smaller(3.0, 4.0)
            ],
            [[false; 2]; 4]
        );
        assert!(!is_smaller_than_claimed(
            Interval::TooFewRuns { n: 4 },
            Direction::Positive,
            2.0
        ));
    }

    #[test]
    fn the_ends_of_an_interval_are_included() {
        assert_eq!(verdicts(0.0, 2.0)[0], Verdict::Inconclusive);
    }

    #[test]
    fn fewer_than_five_runs_are_inconclusive() {
        assert_eq!(
            verdict(Interval::TooFewRuns { n: 4 }, Direction::Positive, 1.0),
            Verdict::Inconclusive
        );
    }
}
