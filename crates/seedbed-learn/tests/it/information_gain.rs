//! Model and formulas together: what a Bayesian network of some dynamics says about the information
//! in transitions.

use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};
use seedbed_env::random::{Purpose, Stream, stream};
use seedbed_learn::nn::bayesian::{Draws, Pass};
use seedbed_learn::nn::{BayesianNetwork, BayesianSettings, Standardizer};
use seedbed_learn::rl::information_gain;

const INPUTS: usize = 3;
const OUTPUTS: usize = 2;
const BATCH: usize = 64;
const STEP: f32 = 0.01;

/// Transitions (x, v, a) → (Δx, Δv), each a row.
struct Transitions {
    inputs: Vec<f32>,
    targets: Vec<f32>,
}

impl Transitions {
    /// A pendulum about x ∈ `[from, to]`, deterministic, one step of 0.1 s; Δs is given by its root
    /// mean square, as models learn it.
    fn pendulum(random: &mut Stream, count: usize, [from, to]: [f32; 2]) -> Self {
        let (mut inputs, mut changes, mut targets) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..count {
            let (x, v, a) = (
                random.random_range(from..to),
                random.random_range(-1.0..1.0_f32),
                random.random_range(-1.0..1.0_f32),
            );
            inputs.extend([x, v, a]);
            changes.extend([0.1 * v, 0.1 * (a - (2.0 * x).sin())]);
        }
        let mut standardizer = Standardizer::new(OUTPUTS);
        standardizer.update(&changes);
        standardizer.apply_scale(&changes, &mut targets);
        Self { inputs, targets }
    }

    fn len(&self) -> usize {
        self.targets.len() / OUTPUTS
    }
}

fn network() -> BayesianNetwork {
    BayesianNetwork::new(
        &[INPUTS, 32, OUTPUTS],
        &BayesianSettings::default(),
        &mut stream(1, Purpose::InitialParameters, 0, 0),
    )
}

fn normals(random: &mut impl Rng, count: usize) -> Vec<f32> {
    (0..count).map(|_| StandardNormal.sample(random)).collect()
}

/// Bayes by Backprop on `first` transitions, in minibatches with replacement.
fn train(
    network: &mut BayesianNetwork,
    data: &Transitions,
    first: usize,
    steps: usize,
    random: &mut Stream,
) {
    let weights = network.likelihood().weight_count();
    for _ in 0..steps {
        let (mut inputs, mut targets) = (Vec::new(), Vec::new());
        for _ in 0..BATCH {
            let row = random.random_range(0..first);
            inputs.extend_from_slice(&data.inputs[row * INPUTS..(row + 1) * INPUTS]);
            targets.extend_from_slice(&data.targets[row * OUTPUTS..(row + 1) * OUTPUTS]);
        }
        network.descend(&inputs, &targets, &normals(random, weights), first);
    }
}

/// Information gain of each transition by the mean of `draws` gradients, with some form of it.
fn gains(
    network: &BayesianNetwork,
    data: &Transitions,
    draws: usize,
    form: impl Fn(&[f32], &[f32], &[f32]) -> f64,
) -> Vec<f64> {
    let noise = normals(
        &mut stream(9, Purpose::Preview, 0, 0),
        draws * network.likelihood().weight_count(),
    );
    let mut found = Vec::new();
    let visit = |by_mean: &[f32], by_deviation: &[f32]| {
        found.push(form(&network.posterior().deviation, by_mean, by_deviation));
    };
    let data = (&data.inputs[..], &data.targets[..]);
    network.likelihood().expected_gradients(
        (network.posterior(), &noise),
        data,
        &mut Draws::default(),
        visit,
    );
    found
}

fn second_order(step: f32) -> impl Fn(&[f32], &[f32], &[f32]) -> f64 {
    move |deviation, by_mean, by_deviation| {
        f64::from(information_gain::second_order(
            deviation,
            by_mean,
            by_deviation,
            step,
        ))
    }
}

/// By the mean gradient of ten draws.
fn mean_gain(network: &BayesianNetwork, data: &Transitions) -> f64 {
    gains(network, data, 10, second_order(STEP))
        .iter()
        .sum::<f64>()
        / data.len() as f64
}

#[test]
fn the_factored_form_is_that_of_materialised_gradients() {
    let (network, data) = (
        network(),
        Transitions::pendulum(&mut stream(2, Purpose::Preview, 0, 0), 100, [-1.0, 1.0]),
    );
    let expected = gains(&network, &data, 1, second_order(STEP));
    let (likelihood, posterior) = (network.likelihood(), network.posterior());
    let noise = normals(
        &mut stream(9, Purpose::Preview, 0, 0),
        likelihood.weight_count(),
    );
    let (mut weights, mut coefficients, mut found) =
        (Vec::new(), Vec::new(), vec![0.0; data.len()]);
    posterior.draw(&noise, &mut weights);
    information_gain::one_draw_coefficients(&posterior.deviation, &noise, STEP, &mut coefficients);
    likelihood.weighted_squares(
        (&weights, &coefficients),
        (&data.inputs, &data.targets),
        &mut Pass::default(),
        &mut found,
    );
    for (found, expected) in found.iter().zip(&expected) {
        assert!(
            (f64::from(*found) / expected - 1.0).abs() < 1e-4,
            "{found} {expected}"
        );
    }
}

/// The forms differ by terms of third order in λσg_σ, so that the relative difference is
/// proportional to λ. Mostly the explicit step gives less, as a wider posterior mostly lowers the
/// likelihood (g_σ < 0).
#[test]
fn explicit_and_second_order_gains_agree_for_small_steps() {
    let (network, data) = (
        network(),
        Transitions::pendulum(&mut stream(2, Purpose::Preview, 0, 0), 200, [-1.0, 1.0]),
    );
    let difference = |draws: usize, step: f32| {
        let exact =
            |d: &[f32], m: &[f32], s: &[f32]| information_gain::explicit_step(d, m, s, step);
        let [exact, second] = [
            gains(&network, &data, draws, exact),
            gains(&network, &data, draws, second_order(step)),
        ];
        exact.iter().sum::<f64>() / second.iter().sum::<f64>() - 1.0
    };
    for draws in [1, 10] {
        let [large, middle, small] = [1.0, 0.1, 0.01].map(|step| difference(draws, step));
        assert!(small < 0.0 && small > -1e-3, "{small}");
        assert!((middle / small - 10.0).abs() < 1.0, "{middle} {small}");
        assert!(
            large.abs() < 0.06 && large.abs() > 10.0 * small.abs(),
            "{large} {small}"
        );
    }
}

#[test]
fn what_was_seen_teaches_less_than_what_is_new() {
    let mut random = stream(3, Purpose::Preview, 0, 0);
    let (seen, new) = (
        Transitions::pendulum(&mut random, 2000, [-1.0, 0.0]),
        Transitions::pendulum(&mut random, 2000, [1.0, 2.0]),
    );
    let mut network = network();
    let [seen_before, new_before] = [&seen, &new].map(|data| mean_gain(&network, data));
    train(&mut network, &seen, seen.len(), 3000, &mut random);
    let [seen_after, new_after] = [&seen, &new].map(|data| mean_gain(&network, data));
    assert!(
        seen_after < 0.05 * seen_before,
        "{seen_before} {seen_after}"
    );
    assert!(new_after > 20.0 * seen_after, "{new_after} {seen_after}");
    train(&mut network, &new, new.len(), 3000, &mut random);
    let new_visited = mean_gain(&network, &new);
    assert!(
        new_visited < 0.05 * new_before.min(new_after),
        "{new_before} {new_after} {new_visited}"
    );
}

/// The gain has the posterior's variance, which falls as 1/N, and the squared residual, which falls
/// as the fit improves.
#[test]
fn a_deterministic_world_has_ever_less_to_teach() {
    let mut random = stream(4, Purpose::Preview, 0, 0);
    let data = Transitions::pendulum(&mut random, 20_000, [-1.0, 1.0]);
    let mut network = network();
    let untrained = mean_gain(&network, &data);
    let mut before = f64::INFINITY;
    for count in [20, 200, 2000, 20_000] {
        train(&mut network, &data, count, 3000, &mut random);
        let gain = mean_gain(&network, &data);
        assert!(
            gain < 0.25 * before,
            "{count} transitions: {gain} after {before}"
        );
        before = gain;
    }
    assert!(before < 0.01 * untrained, "{before} {untrained}");
}
