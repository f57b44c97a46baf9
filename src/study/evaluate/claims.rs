//! Verdicts on the claims of a study. The rules are fixed before the runs.
//!
//! Confirmatory claims of an effect are one family, confirmatory claims of no effect another. In each,
//! Holm's procedure decides; the interval that is shown has the error probability at which Holm's
//! procedure tested the claim, so that interval and decision agree. All other claims are
//! exploratory: they get the interval of a single comparison, and no verdict.

use std::collections::HashSet;

use rayon::prelude::*;

use super::comparison::{Comparison, Samples};
use super::results::{CellResults, Results, default_horizon};
use super::rules::Quantity;
use crate::study::design::direction::{Bound, ClaimDirection, Rule};
use crate::study::design::file::Claim;
use seedbed_input::numbers::Positive;
use seedbed_stats::effect_test::EffectTest;
use seedbed_stats::family::{holm_correction, holm_decisions};
use seedbed_stats::{Direction, Interval, Verdict, verdict_on_effect, verdict_on_no_effect};

/// Result of comparing a claim with the runs of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct ClaimResult {
    /// Direction of the claim.
    pub direction: ClaimDirection,
    /// Comparison of the two cells of the claim; `None` if a cell has no runs.
    pub comparison: Option<Comparison>,
    /// Interval of the effect: of confirmatory claims the one that decides, of others the 95 %
    /// interval of a single comparison.
    pub interval: Interval,
    /// One-sided p-value of a confirmatory claim after Holm's correction over its family. The claim
    /// is supported if it is at most the level of the look, which is
    /// [`FAMILY_LEVEL`](seedbed_stats::family::FAMILY_LEVEL) if there is one look only.
    pub p: Option<f64>,
    /// Verdict on a confirmatory claim.
    pub verdict: Option<Verdict>,
    /// Whether the whole interval is below the claimed size of the effect.
    pub is_smaller_than_claimed: bool,
    /// Whether the claim was added or changed after both of its cells had runs.
    pub is_late: bool,
}

/// A claim with the runs that it compares.
#[derive(Debug)]
struct ComparedClaim<'a> {
    claim: &'a Claim,
    samples: Samples,
    test: Box<dyn EffectTest>,
    comparison: Comparison,
}

/// Evaluates all claims of a study with its runs. Results are in the order of the claims.
///
/// Confirmatory claims of registered results are evaluated at each look, with a part of the error
/// probability, and keep the first verdict that is not open.
#[must_use]
pub fn evaluate(results: &Results) -> Vec<ClaimResult> {
    let claims = &results.study.claims;
    let all_runs = compared_claims(results, None);
    let mut claim_results: Vec<ClaimResult> = claims
        .iter()
        .zip(&all_runs)
        .map(|(claim, compared)| result_without_verdict(results, claim, compared.as_ref()))
        .collect();
    for (runs, level) in results.looks() {
        let of_look = runs.map(|runs| compared_claims(results, Some(runs)));
        let compared = of_look.as_ref().unwrap_or(&all_runs);
        for is_null in [false, true] {
            let family = results.study.family(is_null);
            decide_family(&family, compared, level, &mut claim_results);
        }
    }
    for (claim, claim_result) in claims.iter().zip(&mut claim_results) {
        claim_result.is_smaller_than_claimed =
            is_smaller_than_claimed(claim, claim_result.interval);
    }
    claim_results
}

/// Claims with the first `runs` runs of each cell, or with all; `None` for claims without runs. Results
/// of others have no order and one look, at all of them.
fn compared_claims(results: &Results, runs: Option<u64>) -> Vec<Option<ComparedClaim<'_>>> {
    let mut run_seeds = results.manifest.run_seeds();
    run_seeds.truncate(runs.unwrap_or(u64::MAX) as usize);
    let run_seeds: HashSet<u64> = run_seeds.into_iter().collect();
    let claims = results.study.claims.par_iter();
    claims
        .map(|claim| ComparedClaim::new(results, claim, &run_seeds))
        .collect()
}

/// The result of a claim before any look at confirmatory claims: they are open.
fn result_without_verdict(
    results: &Results,
    claim: &Claim,
    compared: Option<&ComparedClaim<'_>>,
) -> ClaimResult {
    let comparison = compared.map(|compared| compared.comparison);
    let late_claims = &results.manifest.late_claims;
    ClaimResult {
        direction: claim.direction,
        interval: comparison.map_or(Interval::TooFewRuns { n: 0 }, |found| found.effect.interval),
        comparison,
        p: None,
        verdict: claim.confirmatory.then_some(Verdict::Open),
        is_smaller_than_claimed: false,
        is_late: late_claims.contains(&claim.canonical_text(&results.study)),
    }
}

/// Decides the claims of a family, given by their indices, that are still open. `level` is the error
/// probability of the family on each side. A claim without runs has p = 1.
fn decide_family(
    family: &[usize],
    compared: &[Option<ComparedClaim<'_>>],
    level: f64,
    claim_results: &mut [ClaimResult],
) {
    let p_of = |&index: &usize| compared[index].as_ref().map_or(1.0, ComparedClaim::p);
    let p: Vec<f64> = family.iter().map(p_of).collect();
    let (decisions, corrected) = (holm_decisions(&p, level).0, holm_correction(&p));
    for ((&index, decision), corrected) in family.iter().zip(decisions).zip(corrected) {
        let (claim_result, compared) = (&mut claim_results[index], &compared[index]);
        if claim_result.verdict != Some(Verdict::Open) {
            continue;
        }
        claim_result.p = Some(corrected);
        let Some(compared) = compared else {
            continue;
        };
        let comparison = compared.comparison;
        let interval = compared.interval(decision.level, level / family.len() as f64);
        (claim_result.comparison, claim_result.interval) = (Some(comparison), interval);
        // Runs that all have the same value do not show that there is no effect: they may be at a
        // floor or a ceiling.
        if !comparison.is_constant {
            claim_result.verdict = Some(compared.verdict(interval));
        }
    }
}

impl<'a> ComparedClaim<'a> {
    fn new(results: &Results, claim: &'a Claim, run_seeds: &HashSet<u64>) -> Option<Self> {
        let measure = results.study.measure_of(claim);
        let scores = |cell: &str| {
            let Some(cell) = results.cell(cell) else {
                return Vec::new();
            };
            let mut scores = cell.scores(measure).to_vec();
            let is_external = cell.description.external.is_some();
            scores.retain(|score| is_external || run_seeds.contains(&score.run_seed));
            scores
        };
        let quantity = Quantity::of(measure, horizon(results, claim));
        let first = scores(&claim.compare.0);
        let number = claim
            .number()
            .filter(|_| results.cell(&claim.compare.1).is_none());
        let samples = if let Some(number) = number {
            Samples::against(&first, number, quantity)?
        } else {
            let names = [claim.compare.0.as_str(), claim.compare.1.as_str()];
            let is_reversed = results
                .study
                .compares_in_reverse(measure, names[0], names[1]);
            let second = scores(&claim.compare.1);
            Samples::in_direction(is_reversed, &first, &second, quantity, *claim.paired)?
        };
        let test = samples.test();
        Some(Self {
            claim,
            comparison: samples.compare(&*test),
            samples,
            test,
        })
    }

    /// p-value of the hypothesis that the claim is false, apart from the smallest effect of
    /// interest.
    fn p(&self) -> f64 {
        let rule = self.claim.direction.rule();
        let value = |bound: Bound| bound.value(self.claim.smallest.get());
        let above = rule
            .above
            .map_or(0.0, |bound| self.test.p_above(value(bound)));
        let below = rule
            .below
            .map_or(0.0, |bound| self.test.p_below(value(bound)));
        above.max(below)
    }

    /// Interval of the effect. Ends on which p depends have the error probability `level`, an end
    /// on which it does not depend has `other_level`.
    fn interval(&self, level: f64, other_level: f64) -> Interval {
        let rule = self.claim.direction.rule();
        let level_of = |bound: Option<Bound>| bound.map_or(other_level, |_| level);
        let levels = [rule.above, rule.below].map(level_of);
        let thresholds = rule
            .compared_ends
            .map(|bound| bound.value(self.claim.smallest.get()));
        self.samples.interval(&*self.test, levels, thresholds)
    }

    fn verdict(&self, interval: Interval) -> Verdict {
        let (rule, smallest) = (self.claim.direction.rule(), self.claim.smallest.get());
        if !rule.is_null {
            return verdict_on_effect(interval, direction(rule), smallest);
        }
        let margin = |bound: Option<Bound>, none| bound.map_or(none, |bound| bound.value(smallest));
        let margins = [
            margin(rule.above, f64::NEG_INFINITY),
            margin(rule.below, f64::INFINITY),
        ];
        verdict_on_no_effect(interval, margins)
    }
}

fn direction(rule: &Rule) -> Direction {
    if rule.is_upwards {
        Direction::Positive
    } else {
        Direction::Negative
    }
}

/// Time up to which the times of two cells are compared: that of the claim, or the default.
fn horizon(results: &Results, claim: &Claim) -> f64 {
    let cells: Vec<&CellResults> = claim
        .cells()
        .filter_map(|cell| results.cell(cell))
        .collect();
    let default = || default_horizon(&cells, results.study.measure_of(claim));
    claim.horizon.map_or_else(default, Positive::get)
}

/// Whether an effect is in the claimed direction, but its whole interval is below the claimed size.
fn is_smaller_than_claimed(claim: &Claim, interval: Interval) -> bool {
    let (Some(claimed), Some([low, high])) = (claim.claimed, interval.ends()) else {
        return false;
    };
    match claim.direction.rule() {
        rule if rule.is_null => false,
        rule if rule.is_upwards => high < claimed.get(),
        _ => low > -claimed.get(),
    }
}

impl ClaimResult {
    /// Verdict as text, such as `supported`.
    #[must_use]
    pub fn verdict_text(&self) -> String {
        let verdict = match self.verdict {
            None => return "exploratory".to_owned(),
            Some(Verdict::Supported) => "supported",
            Some(Verdict::Negligible) => "supported but negligible",
            Some(Verdict::NoRelevantEffect) => self.direction.rule().words_without_effect,
            Some(Verdict::Refuted) => "refuted",
            Some(Verdict::Open) => "open",
        };
        let is_supported = self.verdict == Some(Verdict::Supported);
        let smaller = if is_supported && self.is_smaller_than_claimed {
            ", smaller than claimed"
        } else {
            ""
        };
        format!("{verdict}{smaller}")
    }
}
