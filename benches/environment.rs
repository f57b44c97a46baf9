//! Control steps per second of the cart-pole, by number of copies M: the bare motion of its rigid bodies, the whole environment with
//! observations, rewards, endings and resets as a run uses it, and the same over the closed-form twin. One core.

#![expect(missing_docs, reason = "criterion's macros make functions without them")]

use std::path::Path;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use rand::RngExt;
use seedbed::env::description::Description;
use seedbed::env::task::dynamics;
use seedbed::env::{Physics, Status, build, load};
use seedbed::random::{Purpose, stream};

criterion_group!(benches, environment);
criterion_main!(benches);

const COPIES: [usize; 3] = [1, 16, 64];

/// Steps of random actions that are drawn beforehand and repeated.
const STEPS: usize = 1024;

fn environment(criterion: &mut Criterion) {
    let task = load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("envs/cartpole.ron")).expect("the task file is right");
    let mut group = criterion.benchmark_group("cartpole");
    for copies in COPIES {
        group.throughput(Throughput::Elements(copies as u64));
        group.bench_function(BenchmarkId::new("bare", copies), |bencher| bencher.iter(bare(&task, copies)));
        for physics in [Physics::Rapier, Physics::Analytic] {
            let name = format!("{physics:?}").to_lowercase();
            group.bench_function(BenchmarkId::new(name, copies), |bencher| bencher.iter(whole(&task, physics, copies)));
        }
    }
    group.finish();
}

/// One control step of all copies under random forces; nothing ends, nothing is observed.
fn bare(task: &Description, copies: usize) -> impl FnMut() {
    let mut bodies = dynamics(task, Physics::Rapier, copies).expect("every task has rigid bodies");
    (0..copies).for_each(|copy| bodies.start(copy, &[0.0, 0.05], &[0.0, 0.0]));
    let forces: Vec<_> = random_choices(copies).iter().map(|choice| 20.0 * choice - 10.0).collect();
    let mut step = 0;
    move || {
        bodies.step(&forces[step * copies..][..copies]);
        step = (step + 1) % STEPS;
    }
}

/// One control step of all copies under random actions; a copy that has ended starts again.
fn whole(task: &Description, physics: Physics, copies: usize) -> impl FnMut() {
    let mut environment = build(task, physics, copies).expect("the cart-pole has a twin");
    let mut random = stream(0, Purpose::Preview, 1, 0);
    (0..copies).for_each(|copy| environment.reset(copy, &mut random));
    let actions = random_choices(copies);
    let mut step = 0;
    move || {
        environment.step(&actions[step * copies..][..copies]);
        for copy in 0..copies {
            if environment.statuses()[copy] != Status::Running {
                environment.reset(copy, &mut random);
            }
        }
        step = (step + 1) % STEPS;
    }
}

/// Zeros and ones: `[STEPS × copies]`.
fn random_choices(copies: usize) -> Vec<f32> {
    let mut random = stream(0, Purpose::Preview, 0, 0);
    (0..STEPS * copies).map(|_| f32::from(u8::from(random.random::<bool>()))).collect()
}
