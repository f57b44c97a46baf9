//! Calibration: how often claims are falsely supported when there is no effect, and how often they
//! are falsely refuted, or an effect falsely denied, when it is as large as the smallest of interest.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, Exp, StandardNormal};
use seedbed_stats::effect_test::EffectTest;
use seedbed_stats::family::{FAMILY_LEVEL, holm_decisions};
use seedbed_stats::means::{Splits, TwoMeans};
use seedbed_stats::shares::{Share, TwoShares};
use seedbed_stats::survival::TimeToEvent;

/// Number of simulated studies for each number of runs.
const STUDIES: u64 = 1000;

/// Number of simulated studies with effects for each number of runs.
const STUDIES_WITH_EFFECTS: u64 = 500;

/// Largest acceptable rate of studies with a false claim: twice [`FAMILY_LEVEL`], because a claim
/// can have either direction.
const NOMINAL_RATE: f64 = 2.0 * FAMILY_LEVEL;

/// Four standard errors of a rate that is estimated from so many studies.
fn binomial_error(rate: f64, studies: u64) -> f64 {
    4.0 * (rate * (1.0 - rate) / studies as f64).sqrt()
}

/// A number drawn for one run.
type Draw = fn(&mut ChaCha8Rng) -> f64;

/// Scores of runs: normal, log-normal with skewness 6, and restricted mean times of which a fifth
/// are censored.
const SCORES: [Draw; 3] = [
    |random| StandardNormal.sample(random),
    |random| f64::exp(StandardNormal.sample(random)),
    |random| {
        let time = Exp::new(1.0 / 100.0).map_or(0.0, |times| times.sample(random));
        TimeToEvent::observed(time).restricted_to(160.0)
    },
];

fn scores(n: usize, draw: Draw, random: &mut ChaCha8Rng) -> Vec<f64> {
    (0..n).map(|_| draw(random)).collect()
}

fn share(n: usize, share: f64, random: &mut ChaCha8Rng) -> Share {
    let successes = (0..n).filter(|_| random.random::<f64>() < share).count();
    Share { successes, runs: n }
}

/// Effects in a simulated study of six claims, each about two cells.
struct Effects {
    /// What each score of the first cell of a comparison of [`SCORES`] is larger by.
    shifts: [f64; 3],
    /// What the share of the first cell is larger by.
    share: f64,
    /// Shares of the second cells.
    smaller_shares: [f64; 3],
}

const NO_EFFECTS: Effects = Effects {
    shifts: [0.0; 3],
    share: 0.0,
    smaller_shares: [0.05, 0.5, 0.9],
};

/// Scores are shifted by about one standard deviation.
const LARGE_EFFECTS: Effects = Effects {
    shifts: [1.0, 2.0, 60.0],
    share: 0.4,
    smaller_shares: [0.05, 0.3, 0.5],
};

/// A comparison of two cells of which the first is larger by `effect`.
struct Comparison {
    test: Box<dyn EffectTest>,
    effect: f64,
}

/// Comparisons of n runs each: three of means and three of shares.
fn comparisons(
    n: usize,
    effects: &Effects,
    splits: &Splits,
    random: &mut ChaCha8Rng,
) -> Vec<Comparison> {
    let mut comparisons: Vec<Comparison> = Vec::new();
    for (draw, effect) in SCORES.into_iter().zip(effects.shifts) {
        let [mut x, y] = [0, 1].map(|_| scores(n, draw, random));
        for score in &mut x {
            *score += effect;
        }
        let test = Box::new(TwoMeans::with_splits(&x, &y, splits));
        comparisons.push(Comparison { test, effect });
    }
    let effect = effects.share;
    for smaller_share in effects.smaller_shares {
        let [x, y] = [effect, 0.0].map(|more| share(n, smaller_share + more, random));
        let test = Box::new(TwoShares::new(x, y));
        comparisons.push(Comparison { test, effect });
    }
    comparisons
}

/// Runs `check` with each number of runs per cell, in threads.
fn for_each_number_of_runs(check: fn(usize)) {
    std::thread::scope(|scope| {
        for n in [10, 20, 50] {
            scope.spawn(move || check(n));
        }
    });
}

/// Claims of the direction that the data happen to have are the worst case: the rate of false
/// support is up to twice the level.
#[test]
fn studies_without_effects_rarely_support_a_claim() {
    for_each_number_of_runs(|n| {
        let rate = rate_of_false_support(n);
        println!("{n} runs: {rate}");
        let allowed = NOMINAL_RATE + binomial_error(NOMINAL_RATE, STUDIES);
        assert!(rate <= allowed, "{n} runs: {rate}");
        // A test that never rejects would pass, too.
        assert!(rate >= 0.01, "{n} runs: {rate}");
    });
}

/// Share of studies with `n` runs per cell and no effect in which any claim is supported.
fn rate_of_false_support(n: usize) -> f64 {
    let splits = Splits::new(n, n);
    let is_false = |study: &u64| {
        let mut random = ChaCha8Rng::seed_from_u64(1000 * n as u64 + study);
        supports_a_claim(&comparisons(n, &NO_EFFECTS, &splits, &mut random))
    };
    (0..STUDIES).filter(is_false).count() as f64 / STUDIES as f64
}

/// Whether any claim of an effect is supported. Each claim has the direction of its data.
fn supports_a_claim(comparisons: &[Comparison]) -> bool {
    let p_of_likelier_direction =
        |Comparison { test, .. }: &Comparison| test.p_above(0.0).min(test.p_below(0.0));
    rejects_any(comparisons.iter().map(p_of_likelier_direction))
}

/// Whether Holm's procedure rejects any of the hypotheses of a family.
fn rejects_any(p: impl Iterator<Item = f64>) -> bool {
    let p: Vec<f64> = p.collect();
    holm_decisions(&p, FAMILY_LEVEL)
        .are_rejected()
        .contains(&true)
}

/// Whether any claim of an effect is refuted whose effect is the smallest of interest: the upper end
/// of its interval has Bonferroni's level.
fn refutes_a_claim(comparisons: &[Comparison]) -> bool {
    let level = FAMILY_LEVEL / comparisons.len() as f64;
    let is_refuted = |comparison: &Comparison| comparison.test.p_below(comparison.effect) <= level;
    comparisons.iter().any(is_refuted)
}

/// Whether any claim of no effect is supported whose effect is as large as its margin.
fn denies_an_effect(comparisons: &[Comparison]) -> bool {
    let p_within_margins = |comparison: &Comparison| {
        let [below, above] = [
            comparison.test.p_below(comparison.effect),
            comparison.test.p_above(-comparison.effect),
        ];
        below.max(above)
    };
    rejects_any(comparisons.iter().map(p_within_margins))
}

#[test]
fn studies_with_effects_rarely_refute_or_deny_them() {
    for_each_number_of_runs(|n| {
        let rates = rates_of_false_denial(n);
        println!("{n} runs: refuted {}, denied {}", rates[0], rates[1]);
        let allowed = FAMILY_LEVEL + binomial_error(FAMILY_LEVEL, STUDIES_WITH_EFFECTS);
        assert!(rates.iter().all(|&rate| rate <= allowed), "{n}: {rates:?}");
        assert!(rates[0] >= 0.003, "{n} runs: {rates:?}");
    });
}

/// Shares of studies with `n` runs per cell in which any claim of an effect is falsely refuted, and
/// in which any claim of no effect is falsely supported.
fn rates_of_false_denial(n: usize) -> [f64; 2] {
    let splits = Splits::new(n, n);
    let mut counts = [0.0, 0.0];
    for study in 0..STUDIES_WITH_EFFECTS {
        let mut random = ChaCha8Rng::seed_from_u64(1_000_000 + 1000 * n as u64 + study);
        let comparisons = comparisons(n, &LARGE_EFFECTS, &splits, &mut random);
        counts[0] += f64::from(u8::from(refutes_a_claim(&comparisons)));
        counts[1] += f64::from(u8::from(denies_an_effect(&comparisons)));
    }
    counts.map(|count| count / STUDIES_WITH_EFFECTS as f64)
}
