//! Formats numbers, intervals and comparisons as text.

use crate::study::claims::ClaimResult;
use crate::study::comparison::Comparison;
use crate::study::file::{Claim, ClaimDirection};
use crate::study::measure::Measure;
use crate::text::{pluralize, without_trailing_zeros};
use seedbed_stats::{Estimate, Interval};

/// Numbers with a smaller magnitude are rounding errors and are shown as 0.
const MIN_SHOWN_MAGNITUDE: f64 = 1e-9;

/// A number with three or four significant digits, no trailing zeros, and the minus sign `−`
/// instead of a hyphen.
pub(in crate::study) fn number(value: f64) -> String {
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

/// A number, or `unknown`.
pub(super) fn number_or_unknown(value: Option<f64>) -> String {
    value.map_or("unknown".to_owned(), number)
}

/// A time, or `not reached`.
pub(super) fn time(value: f64) -> String {
    if value.is_finite() {
        number(value)
    } else {
        "not reached".to_owned()
    }
}

/// Bounds with a smaller magnitude than this share of the width of their interval are errors of the
/// search for them, and are shown as 0.
const ERROR_OF_BOUNDS: f64 = 1e-6;

/// An interval, such as `80 to 134`.
pub(super) fn interval(interval: Interval) -> String {
    match interval {
        Interval::Known { low, high } => {
            let width = if (high - low).is_finite() {
                high - low
            } else {
                0.0
            };
            let bound = |value: f64| {
                let is_error = value.abs() < ERROR_OF_BOUNDS * width;
                number(if is_error { 0.0 } else { value })
            };
            format!("{} to {}", bound(low), bound(high))
        }
        Interval::TooFewRuns { n: 1 } => "none: 1 run is too few".to_owned(),
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

/// The effect of a claim with its interval and the values of both cells, such as `−0.25 (−0.4 to
/// −0.1), 0.7 against 0.95`.
pub(super) fn effect(comparison: &Comparison, interval: Interval) -> String {
    let [first, second] = comparison.values.map(number);
    format!(
        "{}, {first} against {second}",
        difference(comparison, interval)
    )
}

/// The effect of a comparison with its interval, such as `−0.25 (−0.4 to −0.1)`. An interval without a width says
/// nothing of other runs, if all have the same value.
pub(super) fn difference(comparison: &Comparison, interval: Interval) -> String {
    let has_no_width = interval.ends().is_some_and(|[low, high]| low == high);
    let interval = if comparison.is_constant && has_no_width {
        "no interval: all runs have the same value".to_owned()
    } else {
        self::interval(interval)
    };
    format!("{} ({interval})", number(comparison.effect.value))
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

/// The p-value of a confirmatory claim, or `–` for exploratory claims.
pub(super) fn p_value_of_claim(claim_result: &ClaimResult) -> String {
    claim_result.p.map_or("–".to_owned(), p_value)
}

/// Summary of the verdicts on all claims, such as `3 confirmatory claims: 2 supported, 1 open; 5
/// exploratory comparisons`.
#[must_use]
pub fn summarize_claims(claim_results: &[ClaimResult]) -> String {
    let mut verdicts: Vec<(String, usize)> = Vec::new();
    for claim_result in claim_results
        .iter()
        .filter(|result| result.verdict.is_some())
    {
        let text = claim_result.verdict_text();
        match verdicts.iter_mut().find(|(other, _)| *other == text) {
            Some((_, count)) => *count += 1,
            None => verdicts.push((text, 1)),
        }
    }
    let confirmatory: usize = verdicts.iter().map(|(_, count)| count).sum();
    let counts: Vec<String> = verdicts
        .iter()
        .map(|(verdict, count)| format!("{count} {verdict}"))
        .collect();
    let mut parts = Vec::new();
    if confirmatory > 0 {
        let claims = pluralize(confirmatory, "confirmatory claim");
        parts.push(format!("{claims}: {}", counts.join(", ")));
    }
    if claim_results.len() > confirmatory {
        parts.push(pluralize(
            claim_results.len() - confirmatory,
            "exploratory comparison",
        ));
    }
    parts.join("; ")
}

/// The claimed effect, such as `above 0; smallest effect of interest 25; claimed 120`.
pub(super) fn claimed_effect(claim: &Claim) -> String {
    let smallest = number(claim.smallest.get());
    let claimed = match claim.claimed {
        Some(claimed) => format!("; claimed {}", number(claimed.get())),
        None => String::new(),
    };
    match claim.direction {
        ClaimDirection::More => format!("above 0; smallest effect of interest {smallest}{claimed}"),
        ClaimDirection::Less => format!("below 0; smallest effect of interest {smallest}{claimed}"),
        ClaimDirection::Same => format!("between −{smallest} and {smallest}"),
        ClaimDirection::NotMore => format!("below {smallest}"),
        ClaimDirection::NotLess => format!("above −{smallest}"),
    }
}

/// Definition of the effect, and name of the test.
pub(super) fn effect_and_test(measure: Measure, claim: &Claim) -> [&'static str; 2] {
    if claim.number().is_some() {
        return [
            "mean minus the number",
            "permutation test (changes of sign)",
        ];
    }
    match (measure, *claim.paired) {
        (measure, _) if measure.is_yes_or_no() => [
            "difference between the shares of runs",
            "exact unconditional score test (Chan and Zhang)",
        ],
        (measure, false) if measure.is_time() => [
            "difference between restricted mean times",
            "studentized permutation test",
        ],
        (_, false) => [
            "difference between the means",
            "studentized permutation test",
        ],
        (measure, true) if measure.is_time() => [
            "mean difference between restricted times of the same run seed",
            "permutation test (changes of sign)",
        ],
        (_, true) => [
            "mean difference between runs of the same run seed",
            "permutation test (changes of sign)",
        ],
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

    /// The exact interval of shares has a width also if all runs are solved.
    #[test]
    fn equal_values_of_all_runs_have_no_interval_without_a_width() {
        let estimate = |low, high| Estimate {
            value: 0.0,
            interval: Interval::Known { low, high },
        };
        let comparison = |is_constant| Comparison {
            n: [5, 5],
            values: [7.0, 7.0],
            horizon: f64::INFINITY,
            ended_early: [0, 0],
            effect: estimate(0.0, 0.0),
            probability_below: estimate(0.0, 1.0),
            is_constant,
        };
        for (is_constant, [low, high], expected) in [
            (
                true,
                [0.0, 0.0],
                "0 (no interval: all runs have the same value), 7 against 7",
            ),
            (true, [-0.4, 0.4], "0 (−0.4 to 0.4), 7 against 7"),
            (false, [-2.0, 3.0], "0 (−2 to 3), 7 against 7"),
        ] {
            let found = effect(&comparison(is_constant), Interval::Known { low, high });
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn bounds_near_0_are_0() {
        let texts = [
            [-9.2e-9, 0.5],
            [-3.0, 2e-7],
            [-9.2e-9, 1e-8],
            [f64::NEG_INFINITY, -1e-8],
            [0.0, 0.0],
        ]
        .map(|[low, high]| interval(Interval::Known { low, high }));
        assert_eq!(
            texts,
            [
                "0 to 0.5",
                "−3 to 0",
                "−0.0000000092 to 0.00000001",
                "−∞ to −0.00000001",
                "0 to 0"
            ]
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
