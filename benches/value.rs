//! Cost of value-based learners on one core: a round of 100 agents of a seed ensemble (30 models)
//! in the swing-up task, without learning and with learning.

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use seedbed::run::Plan;
use seedbed::run::training::RoundPlan;
use seedbed::run::training::Trainer;

criterion_group!(benches, acting, learning);
criterion_main!(benches);

/// Number of steps per agent and round, T.
const STEPS: u64 = 3000;

/// Number of agents, K.
const AGENTS: u64 = 100;

fn acting(criterion: &mut Criterion) {
    let mut trainer = load_trainer();
    let mut group = criterion.benchmark_group("seed ensemble of 100");
    group
        .throughput(Throughput::Elements(AGENTS * STEPS))
        .sample_size(10);
    group.bench_function("acting, a round", |bencher| {
        let plan = RoundPlan {
            run_seed: 0,
            round: 0,
            first_episode: 0,
            episodes: 1,
            scene: None,
        };
        bencher.iter(|| {
            black_box(trainer.play_without_learning(&plan))
                .expect("bodies are simulated in this process")
                .episodes
                .len()
        });
    });
    group.finish();
}

fn learning(criterion: &mut Criterion) {
    let mut trainer = load_trainer();
    let mut group = criterion.benchmark_group("seed ensemble of 100");
    group
        .throughput(Throughput::Elements(AGENTS * STEPS))
        .sample_size(10);
    group.bench_function("acting and learning, a round", |bencher| {
        bencher.iter(|| {
            trainer
                .advance()
                .expect("numbers stay finite")
                .rows
                .episodes
                .len()
        });
    });
    group.finish();
}

fn load_trainer() -> Trainer {
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenarios/swingup_concurrent_seed_ensemble.ron");
    let plan =
        Plan::load(&scenario, &["agents.count=100".to_owned()]).expect("the scenario is valid");
    Trainer::from_scenario(&plan.scenario, &plan.description, 1).expect("the task can be built")
}
