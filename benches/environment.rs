//! Control steps per second on one core, for every task in `envs/` with 16 copies and random
//! actions, including observations, rewards, terminations and resets, with rigid bodies and with
//! the analytic model. For the cart-pole also with other numbers of copies, and for its rigid
//! bodies alone.

use std::path::Path;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use rand::RngExt;
use seedbed_env::expression::{Evaluator, Previous, Type, ValueTable, Variable, compile};
use seedbed_env::{Action, Choice, Physics, Status, TaskDescription, build, build_dynamics, load};
use seedbed_random::{Purpose, stream};

criterion_group!(benches, tasks, cart_pole, idle_copies, formulas);
criterion_main!(benches);

/// Numbers of copies for which the cart-pole is measured.
const COPY_COUNTS: [usize; 4] = [1, 16, 64, 1024];

/// Number of steps whose random actions are drawn before the measurement. After the last of these
/// steps, the same actions are used again.
const STEPS: usize = 1024;

fn tasks(criterion: &mut Criterion) {
    const COPIES: usize = 16;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("envs");
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .expect("the folder can be listed")
        .flatten()
        .map(|entry| entry.path())
        .collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "ron"));
    files.sort();
    let mut group = criterion.benchmark_group("tasks");
    group.throughput(Throughput::Elements(COPIES as u64));
    for task in files
        .iter()
        .map(|path| load(path).expect("the task file is valid"))
    {
        let analytic = task.has_analytic_model().then_some(Physics::Analytic);
        for physics in [Physics::Rapier].into_iter().chain(analytic) {
            let name = format!("{physics:?}").to_lowercase();
            group.bench_function(BenchmarkId::new(&task.spec().name, name), |bencher| {
                bencher.iter(step_environment(&task, physics, COPIES));
            });
        }
    }
    group.finish();
}

fn cart_pole(criterion: &mut Criterion) {
    let task = load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("envs/cartpole.ron"))
        .expect("the task file is valid");
    let mut group = criterion.benchmark_group("cartpole");
    for copies in COPY_COUNTS {
        group.throughput(Throughput::Elements(copies as u64));
        group.bench_function(BenchmarkId::new("bare", copies), |bencher| {
            bencher.iter(step_bodies(&task, copies));
        });
        for physics in [Physics::Rapier, Physics::Analytic] {
            let name = format!("{physics:?}").to_lowercase();
            group.bench_function(BenchmarkId::new(name, copies), |bencher| {
                bencher.iter(step_environment(&task, physics, copies));
            });
        }
    }
    group.finish();
}

/// Cost of idle copies: one control step with one active copy and 63 copies whose episodes have
/// ended.
fn idle_copies(criterion: &mut Criterion) {
    let task = load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("envs/cartpole.ron"))
        .expect("the task file is valid");
    let task = task.body_task().expect("the task is not tabular");
    let mut bodies = build_dynamics(task, Physics::Rapier, 64).expect("every task has bodies");
    bodies.start(20, &[0.0, 0.05], &[0.0, 0.0]);
    criterion.bench_function("cartpole/one live of 64", |bencher| {
        bencher.iter(|| bodies.step(&[1.0; 64]));
    });
}

/// Evaluation of formulas with three variables for 16 copies.
fn formulas(criterion: &mut Criterion) {
    const COPIES: usize = 16;
    let names = ["x", "v", "a"].map(str::to_owned);
    let variables: Vec<_> = names
        .into_iter()
        .enumerate()
        .map(|(column, name)| Variable {
            name,
            column,
            previous: Previous::Nowhere,
        })
        .collect();
    let mut table = ValueTable::new(3, COPIES);
    table
        .values_mut()
        .iter_mut()
        .enumerate()
        .for_each(|(index, value)| *value = 0.03 * index as f32);
    let mut group = criterion.benchmark_group("formula");
    group.throughput(Throughput::Elements(COPIES as u64));
    for (value_type, formula) in [
        (
            Type::Boolean,
            "abs(x) > 2.4 || abs(a) > 12 * degree || v > 10",
        ),
        (
            Type::Number,
            "1 - 0.1 * x * x - 0.01 * v * v - if abs(a) > 0.2 { 1 } else { 0 }",
        ),
        (Type::Number, "cos(a) - 0.1 * x * x - 0.01 * v * v"),
    ] {
        let program = compile(formula, value_type, &variables).expect("the formula is valid");
        let mut evaluator = Evaluator::new(&program, COPIES);
        group.bench_function(formula, |bencher| {
            bencher.iter(|| evaluator.evaluate(table.view(), 0..COPIES)[0]);
        });
    }
    group.finish();
}

/// Returns a function that performs one control step of all copies under random forces, without
/// terminations and observations.
fn step_bodies(task: &TaskDescription, copies: usize) -> impl FnMut() {
    let task = task.body_task().expect("the task is not tabular");
    let mut bodies = build_dynamics(task, Physics::Rapier, copies).expect("every task has bodies");
    (0..copies).for_each(|copy| bodies.start(copy, &[0.0, 0.05], &[0.0, 0.0]));
    let forces: Vec<_> = random_choices(copies)
        .iter()
        .map(|choice| 20.0 * choice - 10.0)
        .collect();
    let mut step = 0;
    move || {
        bodies.step(&forces[step * copies..][..copies]);
        step = (step + 1) % STEPS;
    }
}

/// Returns a function that performs one control step of all copies with random actions, and resets
/// copies whose episode has ended.
fn step_environment(task: &TaskDescription, physics: Physics, copies: usize) -> impl FnMut() {
    let mut environment = build(task, physics, copies).expect("the task has this physics");
    let mut random = stream(0, Purpose::Preview, 1, 0);
    (0..copies).for_each(|copy| environment.reset(copy, &mut random));
    let values_per_step = copies * task.spec().action_width();
    let actions = random_actions(&task.spec().actions, copies);
    let mut step = 0;
    move || {
        environment.step(&actions[step * values_per_step..][..values_per_step]);
        for copy in 0..copies {
            if environment.statuses()[copy] != Status::Running {
                environment.reset(copy, &mut random);
            }
        }
        step = (step + 1) % STEPS;
    }
}

/// Random zeros and ones: `[STEPS × copies]`.
fn random_choices(copies: usize) -> Vec<f32> {
    let mut random = stream(0, Purpose::Preview, 0, 0);
    (0..STEPS * copies)
        .map(|_| f32::from(u8::from(random.random::<bool>())))
        .collect()
}

/// Random actions: `[STEPS × copies × action components]`.
fn random_actions(actions: &[Action], copies: usize) -> Vec<f32> {
    let mut random = stream(0, Purpose::Preview, 2, 0);
    let mut choose = |action: &Action| match &action.choice {
        Choice::Discrete(values) => random.random_range(0..values.len()) as f32,
        Choice::Continuous => {
            let [low, high] = action.quantity.range;
            low + (high - low) * random.random::<f32>()
        }
    };
    (0..STEPS * copies)
        .flat_map(|_| actions.iter().map(&mut choose).collect::<Vec<_>>())
        .collect()
}
