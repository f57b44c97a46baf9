//! Cost of soft actor-critic on one core: an agent acts, its transition enters the replay buffer, and its
//! learner takes a gradient step. The task has 17 observations and 6 actions, as MuJoCo's half cheetah.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rand::RngExt;
use seedbed_env::{Action, Choice, Quantity, Status, TaskSpec};
use seedbed_input::numbers::{Count, ranged_count, ranged_number};
use seedbed_learn::agent::{ActScratch, TeamConfig};
use seedbed_learn::algorithms::AlgorithmConfig;
use seedbed_learn::algorithms::seed_sac::config::SeedSac;
use seedbed_learn::experience::Episode;
use seedbed_learn::seed::RewardSeeds;
use seedbed_learn::team::{ActionRequest, LearningTiming, Team, TeamContext, Workers};
use seedbed_random::{Purpose, stream};

criterion_group!(benches, steps);
criterion_main!(benches);

const OBSERVATIONS: usize = 17;
const ACTIONS: usize = 6;

/// Number of transitions in the replay buffer before the measurement.
const EARLIER_TRANSITIONS: usize = 100_000;

fn steps(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("step of soft actor-critic");
    group.throughput(Throughput::Elements(1));
    for (units, minibatch) in [(256, 256), (128, 128), (64, 128)] {
        let name = format!("{units}-{units}, minibatch of {minibatch}");
        let mut team = team(units, minibatch);
        let episode = episode();
        (0..EARLIER_TRANSITIONS).for_each(|step| team.add_transition(&episode, step % 1000));
        group.bench_function(name, |bencher| {
            let mut step = 0;
            bencher.iter(|| {
                step = (step + 1) % 1000;
                act(
                    &*team,
                    black_box(&episode.observations[step * OBSERVATIONS..]),
                );
                team.add_transition(&episode, step);
                team.end_step(Workers::CURRENT_THREAD);
            });
        });
    }
    group.finish();
}

fn act(team: &dyn Team, observations: &[f32]) {
    let (mut actions, mut log_probs) = ([0.0; ACTIONS], [0.0; ACTIONS]);
    let mut request = ActionRequest {
        first_agent: 0,
        unreported_steps: 0,
        steps: &[0],
        observations: &observations[..OBSERVATIONS],
        playing: &[true],
        random: &mut [stream(0, Purpose::Action, 0, 0).into()],
        actions: &mut actions,
        log_probs: &mut log_probs,
    };
    team.act(&mut request, &mut ActScratch::default());
    black_box(actions);
}

fn team(units: u64, minibatch: u64) -> Box<dyn Team> {
    let config = SeedSac {
        hidden: vec![Count::try_from(units).expect("a small number"); 2].into(),
        minibatch: Count::try_from(minibatch).expect("a small number").into(),
        random_steps: ranged_count(0),
        ..SeedSac::default()
    };
    let team = TeamConfig {
        count: ranged_count(1),
        seeds: RewardSeeds::Normal {
            sigma: ranged_number(0.0),
        }
        .into(),
        ..TeamConfig::default()
    };
    config.build(&TeamContext {
        run_seed: 0,
        config: &team,
        local_agents: None,
        spec: &spec(),
        timing: LearningTiming::EverySteps(1),
        record_advantages: false,
    })
}

fn spec() -> TaskSpec {
    let quantity = |index: usize| Quantity {
        name: format!("x{index}"),
        unit: String::new(),
        range: [-1.0, 1.0],
    };
    let action = |index| Action {
        quantity: quantity(index),
        choice: Choice::Continuous,
    };
    TaskSpec {
        time_limit: 1000,
        ..TaskSpec::new(
            "bench",
            (0..OBSERVATIONS).map(quantity).collect(),
            (0..ACTIONS).map(action).collect(),
        )
    }
}

/// An episode of 1000 steps of random numbers.
fn episode() -> Episode {
    let mut random = stream(0, Purpose::Preview, 0, 0);
    let mut numbers = |count: usize| -> Vec<f32> {
        (0..count)
            .map(|_| random.random_range(-1.0..=1.0))
            .collect()
    };
    Episode {
        observations: numbers(1001 * OBSERVATIONS),
        actions: numbers(1000 * ACTIONS),
        rewards: numbers(1000),
        log_probs: vec![0.0; 1000 * ACTIONS],
        outcome: Status::Truncated,
        ..Episode::start(0, 0, 0, &spec())
    }
}
