//! Formats numbers, intervals and comparisons as text.

use crate::study::claims::ClaimResult;
use crate::study::comparison::Comparison;
use crate::study::file::{Claim, ClaimDirection, Test};
use crate::text::{pluralize, without_trailing_zeros};
use seedbed_stats::{Estimate, Interval, Verdict};

/// Numbers with a smaller magnitude are rounding errors and are shown as 0.
const MIN_SHOWN_MAGNITUDE: f64 = 1e-9;

/// A number with three or four significant digits, no trailing zeros, and the minus sign `−`
/// instead of a hyphen.
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
        MIN_SHOWN_MAGNITUDE.. => (2.0 - value.abs().log10().floor()) as usize,
        _ => 0,
    };
    let text = format!("{value:.decimals$}");
    without_trailing_zeros(&text).replace('-', "−")
}

/// A time, or `not reached`.
pub(super) fn time(value: f64) -> String {
    if value.is_finite() {
        number(value)
    } else {
        "not reached".to_owned()
    }
}

/// An interval, such as `80 to 134`.
pub(super) fn interval(interval: Interval) -> String {
    match interval {
        Interval::Known { low, high } => format!("{} to {}", number(low), number(high)),
        Interval::TooFewRuns { n } => format!("none: {n} runs are too few"),
    }
}

/// An interval of a time, such as `80 to 134`, `from 80`, or `not reached`.
pub(super) fn interval_of_time(interval: Interval) -> String {
    match interval {
        Interval::Known { low, high } if low.is_infinite() && high.is_infinite() => {
            "not reached".to_owned()
        }
        Interval::Known { low, high } if high.is_infinite() => format!("from {}", number(low)),
        other => self::interval(other),
    }
}

/// An estimate with its interval, such as `−6 (−37 to 29)`.
pub(super) fn estimate(estimate: Estimate) -> String {
    format!(
        "{} ({})",
        number(estimate.value),
        interval(estimate.interval)
    )
}

/// The effect of a comparison with its interval. If only bounds of the effect are known, it has the
/// form `between 4 and 8 (−15.5 to 32)`.
pub(super) fn effect(comparison: &Comparison) -> String {
    let [low, high] = comparison.effect_bounds;
    if comparison.effect.value.is_nan() && low.is_finite() && high.is_finite() {
        return format!(
            "between {} and {} ({})",
            number(low),
            number(high),
            interval(comparison.effect.interval)
        );
    }
    estimate(comparison.effect)
}

/// A p-value, such as `0.0312` or `< 0.0001`.
pub(super) fn p_value(p: f64) -> String {
    if p < 0.0001 {
        "< 0.0001".to_owned()
    } else {
        format!("{p:.4}")
    }
}

/// A p-value as an equation, such as `p = 0.0312` or `p < 0.0001`.
pub(super) fn p_equation(p: f64) -> String {
    let p = p_value(p);
    if p.starts_with('<') {
        format!("p {p}")
    } else {
        format!("p = {p}")
    }
}

/// The p-value of a claim, or `–` for claims of no effect: a high p-value of a test for a
/// difference is not evidence that there is no difference.
pub(super) fn p_value_of_claim(claim: &Claim, p: f64) -> String {
    if claim.direction.is_null() {
        "–".to_owned()
    } else {
        p_value(p)
    }
}

/// Note that explains the p-values of claims.
pub(super) const P_VALUE_NOTE: &str = "p-values are from tests for a difference, with Holm's correction over \
    all claims. Claims of no effect have no p-value: a high p-value would be no evidence for them.";

/// Summary of the verdicts on all claims, such as `5 of 8 claims replicated, 2 of them smaller than
/// claimed`.
#[must_use]
pub fn summarize_claims(claim_results: &[ClaimResult]) -> String {
    let replicated = claim_results
        .iter()
        .filter(|claim_result| claim_result.verdict == Verdict::Replicated)
        .count();
    let smaller_than_claimed = claim_results
        .iter()
        .filter(|claim_result| claim_result.is_smaller)
        .count();
    let smaller_than_claimed = if smaller_than_claimed > 0 {
        format!(", {smaller_than_claimed} of them smaller than claimed")
    } else {
        String::new()
    };
    format!(
        "{replicated} of {} replicated{smaller_than_claimed}",
        pluralize(claim_results.len(), "claim")
    )
}

/// The claimed effect, such as `above 0, by 25`.
pub(super) fn claimed_effect(claim: &Claim) -> String {
    let size = number(claim.size.get());
    match claim.direction {
        ClaimDirection::More => format!("above 0, by {size}"),
        ClaimDirection::Less => format!("below 0, by {size}"),
        ClaimDirection::Same => format!("between −{size} and {size}"),
        ClaimDirection::NotMore => format!("below {size}"),
        ClaimDirection::NotLess => format!("above −{size}"),
    }
}

/// Definition of the effect, and name of the test.
pub(super) fn effect_and_test(test: Test, are_times: bool) -> [&'static str; 2] {
    match (test, are_times) {
        (Test::Paired, true) => [
            "median difference between runs of the same seed",
            "Wilcoxon signed-rank test",
        ],
        (Test::Paired, false) => [
            "mean difference between runs of the same seed",
            "Wilcoxon signed-rank test",
        ],
        (Test::Independent, true) => ["difference between the medians", "log-rank test"],
        (Test::Independent, false) => ["difference between the means", "Welch's t-test"],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_p_values_are_formatted_as_bounds() {
        assert_eq!(
            [0.03125, 0.00002].map(p_equation),
            ["p = 0.0312", "p < 0.0001"]
        );
    }

    #[test]
    fn numbers_have_three_or_four_significant_digits() {
        let formatted = [
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
            formatted,
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
