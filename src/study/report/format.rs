//! Formats numbers, intervals and comparisons as text.

use crate::experiment::measure::Measure;
use crate::study::design::file::Claim;
use crate::study::evaluate::claims::ClaimResult;
use crate::study::evaluate::comparison::Comparison;
use crate::study::evaluate::rules::{Pairing, Quantity, Rule};
use crate::text::pluralize;
pub(super) use crate::text::short_number as number;
use seedbed_stats::{Estimate, Interval};

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
        Interval::TooFewRuns { n } => format!("none: {}", too_few_runs(n)),
    }
}

/// Such as `4 runs are too few`.
pub(super) fn too_few_runs(n: usize) -> String {
    let verb = if n == 1 { "is" } else { "are" };
    format!("{} {verb} too few", pluralize(n, "run"))
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
    let rule = claim.direction.rule();
    let words = rule.words.replace("{}", &smallest);
    if rule.is_null {
        words
    } else {
        words + &claimed
    }
}

/// How the two cells of a claim are compared in a measure.
pub(super) fn comparison_rule(measure: Measure, claim: &Claim) -> &'static Rule {
    let pairing = if claim.number().is_some() {
        Pairing::WithNumber
    } else if *claim.paired {
        Pairing::ByRunSeed
    } else {
        Pairing::Independent
    };
    Rule::of(Quantity::of(measure, f64::INFINITY), pairing)
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
}
