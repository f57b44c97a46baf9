//! Verdict on a claim, from the confidence interval of its effect.
//!
//! ```
//! use seedbed_stats::{Direction, Interval, Verdict, verdict_on_effect};
//!
//! // Claim: the effect is positive. Effects below 2 are of no interest.
//! let claim = |low, high| verdict_on_effect(Interval::Known { low, high }, Direction::Positive, 2.0);
//! assert_eq!(claim(0.5, 3.0), Verdict::Supported); // excludes 0
//! assert_eq!(claim(0.5, 1.5), Verdict::Negligible); // excludes 0 and 2
//! assert_eq!(claim(-1.0, 1.0), Verdict::Refuted); // excludes 2 only
//! assert_eq!(claim(-1.0, 3.0), Verdict::Open); // excludes neither
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
    /// There is an effect in the claimed direction, and it may be of interest.
    Supported,
    /// There is an effect in the claimed direction, but it is smaller than the smallest effect of
    /// interest.
    Negligible,
    /// For claims of no effect: there is no effect beyond the margin.
    NoRelevantEffect,
    /// The claim is false: there is no effect of interest in the claimed direction or, for claims
    /// of no effect, there is an effect beyond the margin.
    Refuted,
    /// The runs do not decide the claim.
    Open,
}

/// Verdict on the claim that an effect has this direction. `smallest` is the smallest effect of
/// interest, above 0 for both directions.
///
/// # Panics
/// If `smallest` is not above 0.
#[must_use]
pub fn verdict_on_effect(effect: Interval, direction: Direction, smallest: f64) -> Verdict {
    assert!(
        smallest > 0.0,
        "a smallest effect of interest of {smallest}"
    );
    let Some([low, high]) = effect.ends() else {
        return Verdict::Open;
    };
    let [low, high] = match direction {
        Direction::Positive => [low, high],
        Direction::Negative => [-high, -low],
    };
    match (low > 0.0, high < smallest) {
        (true, false) => Verdict::Supported,
        (true, true) => Verdict::Negligible,
        (false, true) => Verdict::Refuted,
        (false, false) => Verdict::Open,
    }
}

/// Verdict on the claim that an effect is between two margins, either of which may be infinite:
/// then there is no margin on this side.
#[must_use]
pub fn verdict_on_no_effect(effect: Interval, [low_margin, high_margin]: [f64; 2]) -> Verdict {
    let Some([low, high]) = effect.ends() else {
        return Verdict::Open;
    };
    let is_inside = (low > low_margin || low_margin.is_infinite())
        && (high < high_margin || high_margin.is_infinite());
    if is_inside {
        Verdict::NoRelevantEffect
    } else if low >= high_margin || high <= low_margin {
        Verdict::Refuted
    } else {
        Verdict::Open
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Verdicts on the claims that the effect is positive and that it is negative, for an interval.
    fn verdicts(low: f64, high: f64) -> [Verdict; 2] {
        [Direction::Positive, Direction::Negative]
            .map(|direction| verdict_on_effect(Interval::Known { low, high }, direction, 2.0))
    }

    #[test]
    fn verdicts_depend_on_zero_and_the_smallest_effect_of_interest() {
        use Verdict::{Negligible, Open, Refuted, Supported};
        assert_eq!(verdicts(0.5, 3.0), [Supported, Refuted]);
        assert_eq!(verdicts(-3.0, -0.5), [Refuted, Supported]);
        assert_eq!(verdicts(0.5, 1.0), [Negligible, Refuted]);
        assert_eq!(verdicts(-1.0, 1.0), [Refuted, Refuted]);
        assert_eq!(verdicts(-1.0, 3.0), [Open, Refuted]);
        assert_eq!(verdicts(-3.0, 3.0), [Open, Open]);
    }

    #[test]
    fn the_ends_of_an_interval_are_included() {
        assert_eq!(verdicts(0.0, 2.0)[0], Verdict::Open);
    }

    /// The claim that an effect is within ±2 is supported by −1 to 1, refuted by 3 to 5, and open
    /// for 1 to 3. With a margin on one side only, any effect on the other side is inside.
    #[test]
    fn claims_of_no_effect_need_intervals_within_their_margins() {
        use Verdict::{NoRelevantEffect, Open, Refuted};
        let verdict =
            |low, high, margins| verdict_on_no_effect(Interval::Known { low, high }, margins);
        let both = [-2.0, 2.0];
        assert_eq!(
            [
                verdict(-1.0, 1.0, both),
                verdict(3.0, 5.0, both),
                verdict(1.0, 3.0, both)
            ],
            [NoRelevantEffect, Refuted, Open]
        );
        let one = [f64::NEG_INFINITY, 2.0];
        assert_eq!(
            [
                verdict(f64::NEG_INFINITY, 1.0, one),
                verdict(2.0, 9.0, one),
                verdict(1.0, 3.0, one)
            ],
            [NoRelevantEffect, Refuted, Open]
        );
    }

    #[test]
    fn fewer_than_five_runs_decide_nothing() {
        let few = Interval::TooFewRuns { n: 4 };
        assert_eq!(
            verdict_on_effect(few, Direction::Positive, 1.0),
            Verdict::Open
        );
        assert_eq!(verdict_on_no_effect(few, [-1.0, 1.0]), Verdict::Open);
    }
}
