//! Cost of the VIME bonus on one core, with a dynamics model of mountain car: 3 inputs (position, velocity, action),
//! 32 hidden units, 2 outputs. Measured are the information gain of the 200 steps of an episode, with one and with
//! ten samples of the weights, and one training step with a minibatch of 64 and an antithetic pair of samples.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rand_distr::{Distribution, StandardNormal};
use seedbed_env::random::{Purpose, stream};
use seedbed_learn::nn::bayesian::{Draws, Pass};
use seedbed_learn::nn::{BayesianNetwork, BayesianSettings};
use seedbed_learn::rl::information_gain;

criterion_group!(benches, information_gain_of_an_episode, training_step);
criterion_main!(benches);

const SIZES: [usize; 3] = [3, 32, 2];
const STEPS: usize = 200;

fn information_gain_of_an_episode(criterion: &mut Criterion) {
    let (network, inputs, targets) = (
        network(),
        normals(1, STEPS * SIZES[0]),
        normals(2, STEPS * SIZES[2]),
    );
    let (likelihood, posterior) = (network.likelihood(), network.posterior());
    let noise = normals(3, 10 * likelihood.weight_count());
    let mut group = criterion.benchmark_group("information gain of 200 steps");
    group.throughput(Throughput::Elements(STEPS as u64));
    group.bench_function("one draw", |bencher| {
        let (mut weights, mut coefficients, mut pass, mut gains) =
            (Vec::new(), Vec::new(), Pass::default(), [0.0; STEPS]);
        bencher.iter(|| {
            let noise = &noise[..likelihood.weight_count()];
            posterior.draw(noise, &mut weights);
            information_gain::one_draw_coefficients(
                &posterior.deviation,
                noise,
                0.1,
                &mut coefficients,
            );
            likelihood.weighted_squares(
                (&weights, &coefficients),
                (&inputs, &targets),
                &mut pass,
                &mut gains,
            );
            gains[0]
        });
    });
    group.bench_function("ten draws", |bencher| {
        let mut draws = Draws::default();
        bencher.iter(|| {
            let mut total = 0.0;
            likelihood.expected_gradients(
                (posterior, &noise),
                (&inputs, &targets),
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
    });
    group.finish();
}

fn training_step(criterion: &mut Criterion) {
    const BATCH: usize = 64;
    let (mut network, inputs, targets) = (
        network(),
        normals(1, BATCH * SIZES[0]),
        normals(2, BATCH * SIZES[2]),
    );
    let noise = normals(3, network.likelihood().weight_count());
    let mut group = criterion.benchmark_group("training step");
    group.bench_function("minibatch of 64", |bencher| {
        bencher.iter(|| network.descend(&inputs, &targets, &noise, 10_000));
    });
    group.finish();
}

fn network() -> BayesianNetwork {
    BayesianNetwork::new(
        &SIZES,
        &BayesianSettings::default(),
        &mut stream(0, Purpose::Preview, 0, 0),
    )
}

fn normals(seed: u64, count: usize) -> Vec<f32> {
    let mut random = stream(seed, Purpose::Preview, 0, 0);
    (0..count)
        .map(|_| StandardNormal.sample(&mut random))
        .collect()
}
