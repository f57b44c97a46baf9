//! Tests of the Bayesian network together with the formulas of information gain, on transitions of
//! a pendulum.

use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};
use seedbed_learn::nn::bayesian::{Draws, PassBuffers};
use seedbed_learn::nn::{BayesianNetwork, BayesianSettings, Standardizer};
use seedbed_learn::rl::information_gain;
use seedbed_random::{Purpose, Stream, stream};

const INPUTS: usize = 3;
const OUTPUTS: usize = 2;
const BATCH: usize = 64;
const STEP: f32 = 0.01;

/// Transitions of a pendulum: inputs (x, v, a) and targets (Δx, Δv), one row per transition.
struct Transitions {
    inputs: Vec<f32>,
    targets: Vec<f32>,
}

impl Transitions {
    /// Single steps of 0.1 s of a deterministic pendulum from states with x ∈ `[from, to]`. Targets
    /// are in units of their root mean square, as bonus models learn them.
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

/// Bayes by Backprop on the first `count` transitions, in minibatches drawn with replacement.
fn train(
    network: &mut BayesianNetwork,
    data: &Transitions,
    count: usize,
    steps: usize,
    random: &mut Stream,
) {
    let weights = network.likelihood().weight_count();
    for _ in 0..steps {
        let (mut inputs, mut targets) = (Vec::new(), Vec::new());
        for _ in 0..BATCH {
            let row = random.random_range(0..count);
            inputs.extend_from_slice(&data.inputs[row * INPUTS..(row + 1) * INPUTS]);
            targets.extend_from_slice(&data.targets[row * OUTPUTS..(row + 1) * OUTPUTS]);
        }
        network.descend(&inputs, &targets, &normals(random, weights), count);
    }
}

/// Information gain of each transition, computed by `gain` from σ and the mean gradients over
/// `draws` draws of the weights with respect to μ and σ.
fn gains(
    network: &BayesianNetwork,
    data: &Transitions,
    draws: usize,
    gain: impl Fn(&[f32], &[f32], &[f32]) -> f64,
) -> Vec<f64> {
    let noise = normals(
        &mut stream(9, Purpose::Preview, 0, 0),
        draws * network.likelihood().weight_count(),
    );
    let mut gains = Vec::new();
    let visit = |mean_gradient: &[f32], deviation_gradient: &[f32]| {
        let deviation = &network.posterior().deviation;
        gains.push(gain(deviation, mean_gradient, deviation_gradient));
    };
    let data = (&data.inputs[..], &data.targets[..]);
    network.likelihood().expected_gradients(
        (network.posterior(), &noise),
        data,
        &mut Draws::default(),
        visit,
    );
    gains
}

fn second_order(step: f32) -> impl Fn(&[f32], &[f32], &[f32]) -> f64 {
    move |deviation, mean_gradient, deviation_gradient| {
        f64::from(information_gain::second_order(
            deviation,
            mean_gradient,
            deviation_gradient,
            step,
        ))
    }
}

/// Mean information gain of the transitions, to second order, from the mean gradients over ten
/// draws.
fn mean_gain(network: &BayesianNetwork, data: &Transitions) -> f64 {
    gains(network, data, 10, second_order(STEP))
        .iter()
        .sum::<f64>()
        / data.len() as f64
}

/// Sums with the coefficients of one draw equal the second-order gain computed from the gradients
/// of the same draw.
#[test]
fn gains_without_stored_gradients_equal_gains_from_gradients() {
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
        &mut PassBuffers::default(),
        &mut found,
    );
    for (found, expected) in found.iter().zip(&expected) {
        assert!(
            (f64::from(*found) / expected - 1.0).abs() < 1e-4,
            "{found} {expected}"
        );
    }
}

/// The gain of an explicit step and the second-order gain differ by terms of third order in λσg_σ,
/// so their relative difference is proportional to λ. For small steps the explicit gain is smaller,
/// because a wider posterior mostly lowers the likelihood (g_σ < 0).
#[test]
fn explicit_and_second_order_gains_agree_for_small_steps() {
    let (network, data) = (
        network(),
        Transitions::pendulum(&mut stream(2, Purpose::Preview, 0, 0), 200, [-1.0, 1.0]),
    );
    let difference = |draws: usize, step: f32| {
        let exact =
            |d: &[f32], m: &[f32], s: &[f32]| information_gain::explicit_step(d, m, s, step);
        let [exact_gains, second_order_gains] = [
            gains(&network, &data, draws, exact),
            gains(&network, &data, draws, second_order(step)),
        ];
        exact_gains.iter().sum::<f64>() / second_order_gains.iter().sum::<f64>() - 1.0
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
fn transitions_that_the_model_learned_from_give_less_information_than_new_ones() {
    let mut random = stream(3, Purpose::Preview, 0, 0);
    let (seen, new) = (
        Transitions::pendulum(&mut random, 2000, [-1.0, 0.0]),
        Transitions::pendulum(&mut random, 2000, [1.0, 2.0]),
    );
    let mut network = network();
    let [seen_untrained, new_untrained] = [&seen, &new].map(|data| mean_gain(&network, data));
    train(&mut network, &seen, seen.len(), 3000, &mut random);
    let [seen_after, new_after] = [&seen, &new].map(|data| mean_gain(&network, data));
    assert!(
        seen_after < 0.05 * seen_untrained,
        "{seen_untrained} {seen_after}"
    );
    assert!(new_after > 20.0 * seen_after, "{new_after} {seen_after}");
    train(&mut network, &new, new.len(), 3000, &mut random);
    let new_learned = mean_gain(&network, &new);
    assert!(
        new_learned < 0.05 * new_untrained.min(new_after),
        "{new_untrained} {new_after} {new_learned}"
    );
}

/// The gain is proportional to the posterior's variance, which falls as 1/N, and to the squared
/// residual, which falls as the fit improves.
#[test]
fn information_decreases_with_the_number_of_transitions() {
    let mut random = stream(4, Purpose::Preview, 0, 0);
    let data = Transitions::pendulum(&mut random, 20_000, [-1.0, 1.0]);
    let mut network = network();
    let untrained = mean_gain(&network, &data);
    let mut previous = f64::INFINITY;
    for count in [20, 200, 2000, 20_000] {
        train(&mut network, &data, count, 3000, &mut random);
        let gain = mean_gain(&network, &data);
        assert!(
            gain < 0.25 * previous,
            "{count} transitions: {gain} after {previous}"
        );
        previous = gain;
    }
    assert!(previous < 0.01 * untrained, "{previous} {untrained}");
}
