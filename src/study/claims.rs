//! Verdicts on the claims of a study. The rules are fixed before the runs.

use super::comparison::{Comparison, compare};
use super::file::{Claim, ClaimDirection};
use super::results::Results;
use seedbed_stats::hypothesis::holm_correction;
use seedbed_stats::{Direction, Interval, Verdict, is_smaller_than_claimed, verdict};

/// Minimum number of runs per cell for the verdict that a claim of no effect is replicated.
pub const MIN_RUNS_FOR_NULL_CLAIM: usize = 30;

/// Result of comparing a claim with the runs of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct ClaimResult {
    /// Comparison of the two cells of the claim; `None` if a cell has no runs.
    pub comparison: Option<Comparison>,
    /// p-value of the claim's test after Holm's correction over all claims of the study.
    pub p: f64,
    /// Verdict on the claim.
    pub verdict: Verdict,
    /// Whether the claim is replicated, but with an effect smaller than claimed.
    pub is_smaller: bool,
    /// Whether the claim was added or changed after both of its cells had runs.
    pub is_late: bool,
}

/// Evaluates all claims of a study with its runs. Results are in the order of the claims.
#[must_use]
pub fn evaluate(results: &Results) -> Vec<ClaimResult> {
    let claims = &results.study.claims;
    let comparisons: Vec<Option<Comparison>> = claims
        .iter()
        .map(|claim| compare_cells(results, claim))
        .collect();
    let uncorrected: Vec<f64> = comparisons
        .iter()
        .map(|comparison| comparison.map_or(1.0, |comparison| comparison.p))
        .collect();
    let corrected = holm_correction(&uncorrected);
    let mut claim_results = Vec::with_capacity(claims.len());
    for ((claim, comparison), p) in claims.iter().zip(comparisons).zip(corrected) {
        let late_claims = &results.manifest.late_claims;
        claim_results.push(ClaimResult {
            comparison,
            p,
            verdict: verdict_of_claim(claim, comparison),
            is_smaller: is_smaller(claim, comparison),
            is_late: late_claims.contains(&claim.canonical_text(&results.study)),
        });
    }
    claim_results
}

fn compare_cells(results: &Results, claim: &Claim) -> Option<Comparison> {
    let measure = results.study.measure_of(claim);
    let scores = |cell: &str| {
        let cell = results.cell(cell);
        cell.map(|cell| cell.scores(measure)).unwrap_or_default()
    };
    compare(
        &scores(&claim.compare.0),
        &scores(&claim.compare.1),
        measure.is_time(),
        claim.test,
    )
}

fn verdict_of_claim(claim: &Claim, comparison: Option<Comparison>) -> Verdict {
    let Some(comparison) = comparison else {
        return Verdict::Inconclusive;
    };
    let (effect, size) = (comparison.effect.interval, claim.size.get());
    match claim.direction {
        ClaimDirection::More => verdict(effect, Direction::Positive, size),
        ClaimDirection::Less => verdict(effect, Direction::Negative, size),
        ClaimDirection::Same => verdict_of_null_claim(effect, [-size, size], &comparison),
        ClaimDirection::NotMore => {
            verdict_of_null_claim(effect, [f64::NEG_INFINITY, size], &comparison)
        }
        ClaimDirection::NotLess => {
            verdict_of_null_claim(effect, [-size, f64::INFINITY], &comparison)
        }
    }
}

/// Whether an effect is in the claimed direction but smaller than claimed; false for claims of no
/// effect.
fn is_smaller(claim: &Claim, comparison: Option<Comparison>) -> bool {
    let Some(comparison) = comparison else {
        return false;
    };
    let direction = if claim.direction.is_upwards() {
        Direction::Positive
    } else {
        Direction::Negative
    };
    !claim.direction.is_null()
        && is_smaller_than_claimed(comparison.effect.interval, direction, claim.size.get())
}

/// Verdict on the claim that an effect is between `low_bound` and `high_bound`: replicated if its
/// whole interval is within the bounds and there are enough runs, not replicated if its whole
/// interval is outside the bounds, otherwise inconclusive.
fn verdict_of_null_claim(
    effect: Interval,
    [low_bound, high_bound]: [f64; 2],
    comparison: &Comparison,
) -> Verdict {
    let Interval::Known { low, high } = effect else {
        return Verdict::Inconclusive;
    };
    // An infinite bound means that there is no bound, so an infinite end of the interval is inside.
    let is_inside = (low > low_bound || low_bound.is_infinite())
        && (high < high_bound || high_bound.is_infinite());
    let is_outside = low >= high_bound || high <= low_bound;
    let has_enough_runs = comparison.n.iter().all(|&n| n >= MIN_RUNS_FOR_NULL_CLAIM);
    if is_inside && has_enough_runs {
        Verdict::Replicated
    } else if is_outside && !is_inside {
        Verdict::NotReplicated
    } else {
        Verdict::Inconclusive
    }
}

impl ClaimResult {
    /// Verdict as text, such as `replicated`.
    #[must_use]
    pub fn verdict_text(&self) -> &'static str {
        match self.verdict {
            Verdict::Replicated if self.is_smaller => "replicated, smaller than claimed",
            Verdict::Replicated => "replicated",
            Verdict::NotReplicated => "not replicated",
            Verdict::Inconclusive => "inconclusive",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_stats::Estimate;

    fn null_claim_verdict(low: f64, high: f64, bounds: [f64; 2], n: usize) -> Verdict {
        let interval = Interval::Known { low, high };
        let estimate = Estimate {
            value: f64::midpoint(low, high),
            interval,
        };
        let comparison = Comparison {
            n: [n; 2],
            effect: estimate,
            effect_bounds: [estimate.value; 2],
            probability_below: estimate,
            p: 1.0,
            horizon: f64::INFINITY,
        };
        verdict_of_null_claim(interval, bounds, &comparison)
    }

    /// The claim that an effect is smaller than 2 in magnitude is replicated by the interval −1 to
    /// 1, not replicated by 3 to 5, and inconclusive for 1 to 3.
    #[test]
    fn null_claims_need_intervals_within_their_bounds() {
        use Verdict::{Inconclusive, NotReplicated, Replicated};
        let same = [-2.0, 2.0];
        assert_eq!(
            [
                null_claim_verdict(-1.0, 1.0, same, 30),
                null_claim_verdict(3.0, 5.0, same, 30),
                null_claim_verdict(1.0, 3.0, same, 30)
            ],
            [Replicated, NotReplicated, Inconclusive]
        );
        assert_eq!(
            [
                null_claim_verdict(-1.0, 1.0, same, 29),
                null_claim_verdict(3.0, 5.0, same, 29)
            ],
            [Inconclusive, NotReplicated]
        );
        let not_more = [f64::NEG_INFINITY, 2.0];
        assert_eq!(
            [
                null_claim_verdict(f64::NEG_INFINITY, 1.0, not_more, 30),
                null_claim_verdict(-9.0, -5.0, not_more, 30)
            ],
            [Replicated; 2]
        );
        assert_eq!(
            [
                null_claim_verdict(2.0, 9.0, not_more, 30),
                null_claim_verdict(1.0, 3.0, not_more, 30)
            ],
            [NotReplicated, Inconclusive]
        );
        assert_eq!(
            null_claim_verdict(-5.0, -3.0, [-2.0, f64::INFINITY], 30),
            NotReplicated
        );
    }
}
