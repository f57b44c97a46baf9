//! Numbers as people read them.

use crate::study::claims::Judgement;
use crate::study::comparison::Comparison;
use crate::study::file::{Claim, Claimed, Test};
use crate::study::statistics::{Estimate, Interval, Verdict};

/// Less than this is 0 and an error of rounding.
const ROUNDING: f64 = 1e-9;

/// Three or four digits that count, without trailing zeros; a true minus sign.
pub(super) fn number(value: f64) -> String {
    if value.is_nan() {
        return "unknown".to_owned();
    }
    if value.is_infinite() {
        return if value > 0.0 {
            "∞".to_owned()
        } else {
            "−∞".to_owned()
        };
    }
    let decimals = match value.abs() {
        1000.0.. => 0,
        100.0.. => 1,
        10.0.. => 2,
        0.1.. => 3,
        ROUNDING.. => (2.0 - value.abs().log10().floor()) as usize,
        _ => 0,
    };
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        &text
    };
    if text == "-0" {
        "0".to_owned()
    } else {
        text.replace('-', "−")
    }
}

/// Such as `3 runs`.
#[must_use]
pub fn counted(count: usize, what: &str) -> String {
    if count == 1 {
        format!("1 {what}")
    } else {
        format!("{count} {what}s")
    }
}

/// A median time; beyond all that was watched where fewer than half of the runs got there.
pub(super) fn time(value: f64) -> String {
    if value.is_finite() {
        number(value)
    } else {
        "not reached".to_owned()
    }
}

/// Such as `80 to 134`.
pub(super) fn interval(interval: Interval) -> String {
    match interval {
        Interval::Known { low, high } => format!("{} to {}", number(low), number(high)),
        Interval::TooFewRuns { n } => format!("none: n = {n} is too few"),
    }
}

/// The same of a time.
pub(super) fn interval_of_time(interval: Interval) -> String {
    match interval {
        Interval::Known { low, high } if low.is_infinite() && high.is_infinite() => {
            "not reached".to_owned()
        }
        Interval::Known { low, high } if high.is_infinite() => format!("from {}", number(low)),
        other => self::interval(other),
    }
}

/// Such as `−6 (−37 to 29)`.
pub(super) fn estimate(estimate: Estimate) -> String {
    format!(
        "{} ({})",
        number(estimate.value),
        interval(estimate.interval)
    )
}

/// The effect of a comparison: where it is not known but to lie between two numbers, such as `between 4 and 8 (−15.5 to 32)`.
pub(super) fn effect(comparison: &Comparison) -> String {
    let [least, most] = comparison.between;
    if comparison.effect.value.is_nan() && least.is_finite() && most.is_finite() {
        return format!(
            "between {} and {} ({})",
            number(least),
            number(most),
            interval(comparison.effect.interval)
        );
    }
    estimate(comparison.effect)
}

/// A test's p.
pub(super) fn p(p: f64) -> String {
    if p < 0.0001 {
        "< 0.0001".to_owned()
    } else {
        format!("{p:.4}")
    }
}

/// Such as `p = 0.0312` and `p < 0.0001`.
pub(super) fn p_is(p: f64) -> String {
    let p = self::p(p);
    if p.starts_with('<') {
        format!("p {p}")
    } else {
        format!("p = {p}")
    }
}

/// The p of a claim. The test is for a difference: how high its p is says nothing for a claim of none.
pub(super) fn p_of_claim(claim: &Claim, p: f64) -> String {
    if claim.direction.is_null() {
        "–".to_owned()
    } else {
        self::p(p)
    }
}

/// Why claims of no effect have no p.
pub(super) const NO_P: &str = "The p is of a test for a difference, after Holm. Claims of no effect have none: a high p is no evidence for them.";

/// What became of all claims, such as `5 of 8 claims replicated, 2 of them smaller than claimed`.
#[must_use]
pub fn tally(judgements: &[Judgement]) -> String {
    let held = judgements
        .iter()
        .filter(|judgement| judgement.verdict == Verdict::Replicated)
        .count();
    let smaller = judgements
        .iter()
        .filter(|judgement| judgement.smaller)
        .count();
    let smaller = if smaller > 0 {
        format!(", {smaller} of them smaller than claimed")
    } else {
        String::new()
    };
    format!(
        "{held} of {} replicated{smaller}",
        counted(judgements.len(), "claim")
    )
}

/// What a claim says of its effect.
pub(super) fn claimed(claim: &Claim) -> String {
    let size = number(claim.size.get());
    match claim.direction {
        Claimed::More => format!("above 0, by {size}"),
        Claimed::Less => format!("below 0, by {size}"),
        Claimed::Same => format!("between −{size} and {size}"),
        Claimed::NotMore => format!("below {size}"),
        Claimed::NotLess => format!("above −{size}"),
    }
}

/// What is taken for the effect, and how it is tested.
pub(super) fn test(test: Test, are_times: bool) -> [&'static str; 2] {
    match (test, are_times) {
        (Test::Paired, true) => [
            "median of differences seed by seed",
            "Wilcoxon's signed-rank test",
        ],
        (Test::Paired, false) => [
            "mean of differences seed by seed",
            "Wilcoxon's signed-rank test",
        ],
        (Test::Independent, true) => ["difference of medians of two samples", "log-rank test"],
        (Test::Independent, false) => ["difference of means of two samples", "Welch's test"],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_p_has_one_sign() {
        assert_eq!([0.03125, 0.00002].map(p_is), ["p = 0.0312", "p < 0.0001"]);
    }

    #[test]
    fn numbers_have_the_digits_that_count() {
        let written = [
            0.0,
            -1e-10,
            -0.00001,
            0.09345,
            1.0 / 3.0,
            -12.345,
            127.5,
            195.0,
            1234.5,
        ]
        .map(number);
        assert_eq!(
            written,
            [
                "0",
                "0",
                "−0.00001",
                "0.0935",
                "0.333",
                "−12.35",
                "127.5",
                "195",
                "1234"
            ]
        );
        assert_eq!([f64::NEG_INFINITY, f64::NAN].map(number), ["−∞", "unknown"]);
    }
}
