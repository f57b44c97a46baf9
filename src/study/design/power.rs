//! Numbers of runs that the confirmatory claims of a study need, computed before the runs.

use super::file::{Claim, Expected, Study};
use seedbed_stats::family::{FAMILY_LEVEL, levels_of_looks};
use seedbed_stats::power::{power_of_differences, power_of_means, power_of_shares, runs_needed};

/// Power that is usually asked for.
const USUAL_POWERS: [f64; 2] = [0.8, 0.9];

/// Power of a confirmatory claim.
#[derive(Clone, Debug, PartialEq)]
pub struct ClaimPower {
    /// Error probability at the first step of Holm's procedure: the smallest at which the claim can
    /// be tested at the last look.
    pub level: f64,
    /// What is expected of the runs; `None` if the claim does not say it, and then there is no
    /// power.
    pub expected: Option<Expected>,
    /// Power with the number of runs per cell of the study.
    pub power: Option<f64>,
    /// Numbers of runs per cell for powers of 0.8 and 0.9; `None` if more than
    /// [`MAX_RUNS`](seedbed_stats::power::MAX_RUNS) are needed.
    pub runs_needed: [Option<usize>; 2],
}

/// Power of each confirmatory claim of a study, and its index among the claims.
#[must_use]
pub fn powers(study: &Study) -> Vec<(usize, ClaimPower)> {
    let claims = study.claims.iter().enumerate();
    let confirmatory = claims.filter(|(_, claim)| claim.confirmatory);
    confirmatory
        .map(|(index, claim)| (index, power_of_claim(study, claim)))
        .collect()
}

/// Number of runs per cell with which the claim has a power of 0.8, if the scores of runs, or the differences of pairs,
/// deviate by `deviation`. `None` if more than [`MAX_RUNS`](seedbed_stats::power::MAX_RUNS) are needed.
#[must_use]
pub fn runs_with_deviation(study: &Study, claim: &Claim, deviation: f64) -> Option<usize> {
    let (effect, level) = (
        claim.smallest.get() / deviation,
        level_of_claim(study, claim),
    );
    runs_needed(USUAL_POWERS[0], |runs| {
        power_of_scores(claim, effect, runs, level)
    })
}

/// The smallest error probability at which a claim can be tested at the last look: that of Holm's first step.
fn level_of_claim(study: &Study, claim: &Claim) -> f64 {
    let family = study.family(claim.direction.rule().is_null);
    let levels = levels_of_looks(&study.looks(), FAMILY_LEVEL);
    levels[levels.len() - 1] / family.len() as f64
}

fn power_of_claim(study: &Study, claim: &Claim) -> ClaimPower {
    let level = level_of_claim(study, claim);
    let expected = claim.expected.as_deref().copied();
    let power = |runs: usize| expected.map_or(0.0, |expected| power(claim, expected, runs, level));
    ClaimPower {
        level,
        expected,
        power: expected.map(|_| power(study.repeats.get() as usize)),
        runs_needed: if expected.is_some() {
            USUAL_POWERS.map(|usual| runs_needed(usual, power))
        } else {
            [None; 2]
        },
    }
}

/// Power of a claim with `runs` runs per cell. For claims of an effect, the effect is the smallest of
/// interest or the difference of the expected shares; for claims of no effect it is 0.
fn power(claim: &Claim, expected: Expected, runs: usize, level: f64) -> f64 {
    let smallest = claim.smallest.get();
    match expected {
        Expected::Shares(first, second) if !claim.direction.rule().is_null => {
            power_of_shares([first.get(), second.get()], runs, level)
        }
        Expected::Shares(first, second) => {
            let variance = |share: f64| share * (1.0 - share);
            let deviation = f64::midpoint(variance(first.get()), variance(second.get())).sqrt();
            power_of_scores(claim, smallest / deviation, runs, level)
        }
        Expected::Deviation(deviation) => {
            power_of_scores(claim, smallest / deviation.get(), runs, level)
        }
    }
}

/// Power of a comparison of scores; `effect` is the smallest effect of interest in standard
/// deviations.
fn power_of_scores(claim: &Claim, effect: f64, runs: usize, level: f64) -> f64 {
    let one_sided = if claim.has_one_score_per_pair() {
        power_of_differences(effect, runs, level)
    } else {
        power_of_means(effect, runs, level)
    };
    let rule = claim.direction.rule();
    if rule.above.is_some() && rule.below.is_some() {
        // Both margins must be excluded (Schuirmann 1987).
        (2.0 * one_sided - 1.0).max(0.0)
    } else {
        one_sided
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn study(claims: &str) -> Study {
        let text = format!("Study(title: \"x\", repeats: 60, claims: [{claims}])");
        seedbed_input::parse("x.ron", text).unwrap().value
    }

    /// A family of eleven claims: 0.95 against 0.7 at 0.025 / 11 needs about 60 runs per cell.
    #[test]
    fn eleven_claims_need_about_sixty_runs() {
        let claim = r#"(text: "x", compare: ("a", "b"), measure: Solved, direction: More, smallest: 0.1,
            confirmatory: true, expected: Shares(0.95, 0.7)),"#;
        let powers = powers(&study(&claim.repeat(11)));
        assert_eq!((powers.len(), powers[0].1.level), (11, FAMILY_LEVEL / 11.0));
        let needed = powers[0].1.runs_needed[0].unwrap();
        assert!((55..=70).contains(&needed), "{needed}");
        assert!(powers[0].1.power.unwrap() > 0.7);
    }

    /// An effect of 25 with a deviation of 50 is half a deviation: 64 runs for a power of 0.8.
    /// Exploratory claims do not count. To exclude both margins takes more runs.
    #[test]
    fn means_are_compared_in_deviations() {
        let claim = |direction: &str| {
            format!(
                r#"(text: "x", compare: ("a", "b"), direction: {direction}, smallest: 25, because: "y",
                confirmatory: true, expected: Deviation(50)),"#
            )
        };
        let exploratory = r#"(text: "x", compare: ("a", "b"), direction: Less, smallest: 25),"#;
        let powers = powers(&study(
            &[&claim("Less"), exploratory, &claim("Same")].concat(),
        ));
        let indices: Vec<usize> = powers.iter().map(|(index, _)| *index).collect();
        assert_eq!(indices, [0, 2]);
        assert_eq!(powers[0].1.runs_needed[0], Some(64));
        // 0.9 on each side: 85 runs.
        assert_eq!(powers[1].1.runs_needed[0], powers[0].1.runs_needed[1]);
    }

    /// Runs that deviate by two smallest effects of interest need as many as a claim that expects so; pairs need half.
    #[test]
    fn observed_deviations_give_numbers_of_runs() {
        let claim = |fields: &str| {
            format!(
                r#"(text: "x", compare: ("a", "b"), direction: Less, smallest: 25, confirmatory: true, {fields}),"#
            )
        };
        let study = study(&[claim("expected: Deviation(50)"), claim("paired: true")].concat());
        let runs =
            |claim: usize, deviation| runs_with_deviation(&study, &study.claims[claim], deviation);
        assert_eq!(runs(0, 50.0), powers(&study)[0].1.runs_needed[0]);
        let [unpaired, paired] = [0, 1].map(|claim| runs(claim, 50.0).unwrap());
        assert!((unpaired / 2..unpaired / 2 + 3).contains(&paired));
        assert_eq!(runs(0, 1e6), None);
    }
}
