//! Calibration: how often claims are falsely supported when there is no effect.

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
const STUDIES: u64 = 2000;

/// Largest acceptable rate of studies with a false claim: twice [`FAMILY_LEVEL`], because a claim
/// can have either direction.
const NOMINAL_RATE: f64 = 2.0 * FAMILY_LEVEL;

/// Four standard errors of the rate of [`STUDIES`] studies.
fn binomial_error() -> f64 {
    4.0 * (NOMINAL_RATE * (1.0 - NOMINAL_RATE) / STUDIES as f64).sqrt()
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

/// Shares of successful runs.
const SHARES: [f64; 3] = [0.05, 0.5, 0.9];

fn scores(n: usize, draw: Draw, random: &mut ChaCha8Rng) -> Vec<f64> {
    (0..n).map(|_| draw(random)).collect()
}

fn share(n: usize, share: f64, random: &mut ChaCha8Rng) -> Share {
    let successes = (0..n).filter(|_| random.random::<f64>() < share).count();
    Share { successes, runs: n }
}

/// p-values of a study of six claims, three on means and three on shares, each about two cells of
/// n runs from equal distributions. Each claim has the direction of its data.
fn p_values_without_effects(n: usize, splits: &Splits, random: &mut ChaCha8Rng) -> Vec<f64> {
    let mut p = Vec::new();
    for draw in SCORES {
        let [x, y] = [0, 1].map(|_| scores(n, draw, random));
        let test = TwoMeans::with_splits(&x, &y, splits);
        p.push(test.p_above(0.0).min(test.p_below(0.0)));
    }
    for true_share in SHARES {
        let [x, y] = [0, 1].map(|_| share(n, true_share, random));
        let test = TwoShares::new(x, y);
        p.push(test.p_above(0.0).min(test.p_below(0.0)));
    }
    p
}

/// Claims of the direction that the data happen to have are the worst case: the rate of false
/// support is up to twice the level.
#[test]
fn studies_without_effects_rarely_support_a_claim() {
    std::thread::scope(|scope| {
        for n in [10, 20, 50] {
            scope.spawn(move || {
                let rate = rate_of_false_support(n);
                println!("{n} runs: {rate}");
                assert!(rate <= NOMINAL_RATE + binomial_error(), "{n} runs: {rate}");
                // A test that never rejects would pass, too.
                assert!(rate >= 0.01, "{n} runs: {rate}");
            });
        }
    });
}

/// Share of studies with `n` runs per cell and no effect in which any claim is supported.
fn rate_of_false_support(n: usize) -> f64 {
    let splits = Splits::new(n, n);
    let supports_a_claim = |study: &u64| {
        let mut random = ChaCha8Rng::seed_from_u64(1000 * n as u64 + study);
        let p = p_values_without_effects(n, &splits, &mut random);
        let decisions = holm_decisions(&p, FAMILY_LEVEL);
        decisions.are_rejected().contains(&true)
    };
    (0..STUDIES).filter(supports_a_claim).count() as f64 / STUDIES as f64
}
