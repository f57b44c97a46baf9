//! What became of each claim of a study, by rules that are fixed before the runs.

use super::comparison::{Comparison, compare};
use super::file::{Claim, Claimed};
use super::results::Results;
use super::statistics::comparison::holm;
use super::statistics::{Direction, Interval, Verdict, is_smaller_than_claimed, verdict};

/// Fewer runs do not bear out that there is no effect.
pub const LEAST_RUNS_OF_A_NULL: usize = 30;

/// What became of a claim.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// What the data say; none where a cell has no runs.
    pub comparison: Option<Comparison>,
    /// The test's p among those of all claims of the study, after Holm.
    pub p: f64,
    /// The verdict.
    pub verdict: Verdict,
    /// Whether it is replicated, but the claimed size is excluded.
    pub smaller: bool,
    /// Whether it was written or changed when there were runs of what it compares already.
    pub late: bool,
}

/// Judges all claims of a study, in their order.
#[must_use]
pub fn judge(results: &Results) -> Vec<Judgement> {
    let comparisons: Vec<Option<Comparison>> = results
        .study
        .claims
        .iter()
        .map(|claim| comparison(results, claim))
        .collect();
    let p: Vec<f64> = comparisons
        .iter()
        .map(|comparison| comparison.map_or(1.0, |comparison| comparison.p))
        .collect();
    let judged = results.study.claims.iter().zip(comparisons).zip(holm(&p));
    let judge = |((claim, comparison), p): ((&Claim, Option<Comparison>), f64)| {
        let late = results
            .manifest
            .late_claims
            .contains(&claim.spelled_out(&results.study));
        Judgement {
            comparison,
            p,
            verdict: verdict_on(claim, comparison),
            smaller: is_smaller(claim, comparison),
            late,
        }
    };
    judged.map(judge).collect()
}

fn comparison(results: &Results, claim: &Claim) -> Option<Comparison> {
    let measure = results.study.measure_of(claim);
    let scores = |cell: &str| {
        results
            .cell(cell)
            .map(|cell| cell.scores(measure))
            .unwrap_or_default()
    };
    compare(
        &scores(&claim.compare.0),
        &scores(&claim.compare.1),
        measure.is_time(),
        claim.test,
    )
}

fn verdict_on(claim: &Claim, comparison: Option<Comparison>) -> Verdict {
    let Some(comparison) = comparison else {
        return Verdict::Inconclusive;
    };
    let (effect, size) = (comparison.effect.interval, claim.size.get());
    match claim.direction {
        Claimed::More => verdict(effect, Direction::Positive, size),
        Claimed::Less => verdict(effect, Direction::Negative, size),
        Claimed::Same => verdict_on_a_null(effect, [-size, size], &comparison),
        Claimed::NotMore => verdict_on_a_null(effect, [f64::NEG_INFINITY, size], &comparison),
        Claimed::NotLess => verdict_on_a_null(effect, [-size, f64::INFINITY], &comparison),
    }
}

/// Only a claim of an effect has a size that an effect can fall short of.
fn is_smaller(claim: &Claim, comparison: Option<Comparison>) -> bool {
    let direction = if claim.direction.is_upwards() {
        Direction::Positive
    } else {
        Direction::Negative
    };
    let falls_short = |found: Comparison| {
        is_smaller_than_claimed(found.effect.interval, direction, claim.size.get())
    };
    !claim.direction.is_null() && comparison.is_some_and(falls_short)
}

/// That an effect lies between `least` and `most`: borne out if its whole interval does and runs are many, not if none of it does.
fn verdict_on_a_null(
    effect: Interval,
    [least, most]: [f64; 2],
    comparison: &Comparison,
) -> Verdict {
    let Interval::Known { low, high } = effect else {
        return Verdict::Inconclusive;
    };
    let inside = (low > least || least.is_infinite()) && (high < most || most.is_infinite());
    let outside = low >= most || high <= least;
    match (
        inside && comparison.n.iter().all(|&n| n >= LEAST_RUNS_OF_A_NULL),
        outside && !inside,
    ) {
        (true, _) => Verdict::Replicated,
        (_, true) => Verdict::NotReplicated,
        _ => Verdict::Inconclusive,
    }
}

impl Judgement {
    /// Such as `replicated`.
    #[must_use]
    pub fn in_words(&self) -> &'static str {
        match self.verdict {
            Verdict::Replicated if self.smaller => "replicated, smaller than claimed",
            Verdict::Replicated => "replicated",
            Verdict::NotReplicated => "not replicated",
            Verdict::Inconclusive => "inconclusive",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::statistics::Estimate;

    fn null(low: f64, high: f64, bounds: [f64; 2], n: usize) -> Verdict {
        let interval = Interval::Known { low, high };
        let estimate = Estimate {
            value: f64::midpoint(low, high),
            interval,
        };
        let (between, horizon) = ([estimate.value; 2], f64::INFINITY);
        let comparison = Comparison {
            n: [n; 2],
            effect: estimate,
            between,
            below: estimate,
            p: 1.0,
            horizon,
        };
        verdict_on_a_null(interval, bounds, &comparison)
    }

    /// That an effect is smaller than 2 is borne out from −1 to 1, refuted from 3 to 5, and open from 1 to 3.
    #[test]
    fn an_effect_is_absent_when_all_that_matters_is_excluded() {
        use Verdict::{Inconclusive, NotReplicated, Replicated};
        let same = [-2.0, 2.0];
        assert_eq!(
            [
                null(-1.0, 1.0, same, 30),
                null(3.0, 5.0, same, 30),
                null(1.0, 3.0, same, 30)
            ],
            [Replicated, NotReplicated, Inconclusive]
        );
        assert_eq!(
            [null(-1.0, 1.0, same, 29), null(3.0, 5.0, same, 29)],
            [Inconclusive, NotReplicated]
        );
        let not_more = [f64::NEG_INFINITY, 2.0];
        assert_eq!(
            [
                null(f64::NEG_INFINITY, 1.0, not_more, 30),
                null(-9.0, -5.0, not_more, 30)
            ],
            [Replicated; 2]
        );
        assert_eq!(
            [null(2.0, 9.0, not_more, 30), null(1.0, 3.0, not_more, 30)],
            [NotReplicated, Inconclusive]
        );
        assert_eq!(null(-5.0, -3.0, [-2.0, f64::INFINITY], 30), NotReplicated);
    }
}
