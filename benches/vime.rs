//! Cost of the VIME bonus on one core, with a dynamics model of mountain car: 3 inputs (position,
//! velocity, action), 32 hidden units, 2 outputs. Measures the information gain of each of the 200
//! steps of an episode, with one and with ten samples of the weights, and one training step with a
//! minibatch of 64 and an antithetic pair of samples.

use criterion::{Bencher, Criterion, Throughput, criterion_group, criterion_main};
use rand_distr::{Distribution, StandardNormal};
use seedbed_learn::nn::bayesian::{Draws, PassBuffers};
use seedbed_learn::nn::{BayesianNetwork, BayesianSettings};
use seedbed_learn::rl::information_gain;
use seedbed_random::{Purpose, stream};

criterion_group!(benches, information_gain_of_an_episode, training_step);
criterion_main!(benches);

/// Widths of the input, hidden and output layers.
const LAYER_SIZES: [usize; 3] = [3, 32, 2];
/// Number of steps per episode.
const STEPS: usize = 200;

fn information_gain_of_an_episode(criterion: &mut Criterion) {
    let (network, inputs, targets) = (
        network(),
        standard_normals(1, STEPS * LAYER_SIZES[0]),
        standard_normals(2, STEPS * LAYER_SIZES[2]),
    );
    let noise = standard_normals(3, 10 * network.likelihood().weight_count());
    let mut group = criterion.benchmark_group("information gain of 200 steps");
    group.throughput(Throughput::Elements(STEPS as u64));
    group.bench_function("one draw", |bencher| {
        bench_one_draw(bencher, &network, (&inputs, &targets), &noise);
    });
    group.bench_function("ten draws", |bencher| {
        bench_ten_draws(bencher, &network, (&inputs, &targets), &noise);
    });
    group.finish();
}

/// The information gain of each step, by one sample of the weights.
fn bench_one_draw(
    bencher: &mut Bencher<'_>,
    network: &BayesianNetwork,
    batch: (&[f32], &[f32]),
    noise: &[f32],
) {
    let (likelihood, posterior) = (network.likelihood(), network.posterior());
    let noise = &noise[..likelihood.weight_count()];
    let (mut weights, mut coefficients, mut pass, mut gains) =
        (Vec::new(), Vec::new(), PassBuffers::default(), [0.0; STEPS]);
    bencher.iter(|| {
        posterior.draw(noise, &mut weights);
        information_gain::one_draw_coefficients(
            &posterior.deviation,
            noise,
            0.1,
            &mut coefficients,
        );
        likelihood.weighted_squares((&weights, &coefficients), batch, &mut pass, &mut gains);
        gains[0]
    });
}

/// The total information gain of all steps, each by the mean gradient of ten samples of the
/// weights.
fn bench_ten_draws(
    bencher: &mut Bencher<'_>,
    network: &BayesianNetwork,
    batch: (&[f32], &[f32]),
    noise: &[f32],
) {
    let (likelihood, posterior) = (network.likelihood(), network.posterior());
    let mut draws = Draws::default();
    bencher.iter(|| {
        let mut total = 0.0;
        likelihood.expected_gradients(
            (posterior, noise),
            batch,
            &mut draws,
            |by_mean, by_deviation| {
                total += information_gain::second_order(
                    &posterior.deviation,
                    by_mean,
                    by_deviation,
                    0.1,
                );
            },
        );
        total
    });
}

fn training_step(criterion: &mut Criterion) {
    const MINIBATCH: usize = 64;
    let (mut network, inputs, targets) = (
        network(),
        standard_normals(1, MINIBATCH * LAYER_SIZES[0]),
        standard_normals(2, MINIBATCH * LAYER_SIZES[2]),
    );
    let noise = standard_normals(3, network.likelihood().weight_count());
    let mut group = criterion.benchmark_group("training step");
    group.bench_function("minibatch of 64", |bencher| {
        bencher.iter(|| network.descend(&inputs, &targets, &noise, 10_000));
    });
    group.finish();
}

fn network() -> BayesianNetwork {
    BayesianNetwork::new(
        &LAYER_SIZES,
        &BayesianSettings::default(),
        &mut stream(0, Purpose::Preview, 0, 0),
    )
}

fn standard_normals(run_seed: u64, count: usize) -> Vec<f32> {
    let mut random = stream(run_seed, Purpose::Preview, 0, 0);
    (0..count)
        .map(|_| StandardNormal.sample(&mut random))
        .collect()
}
