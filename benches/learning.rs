//! Cost of learning on one core: an update of one of 16 agents with 16 cart-pole episodes of 200
//! steps, the choice of one action and of one by each of 16 agents (`python/benches/team_overhead.py`
//! measures the same from Python), forward and backward passes of networks with a batch of 200,
//! and the capped returns of 200 steps.

use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use rand::RngExt;
use seedbed_env::{Physics, Status, TaskDescription, TaskSpec, build, load};
use seedbed_input::numbers::ranged_count;
use seedbed_learn::agent::{ActScratch, Agent, AgentContext, TeamConfig};
use seedbed_learn::algorithms::AlgorithmConfig;
use seedbed_learn::algorithms::seed_pg::SeedPgAgent;
use seedbed_learn::algorithms::seed_pg::config::SeedPg;
use seedbed_learn::experience::{Episode, Experience};
use seedbed_learn::nn::{Activations, Adam, AdamSettings, Initial, Mlp};
use seedbed_learn::rl::returns;
use seedbed_learn::rollout::{ActingAgents, GroupStep, Player};
use seedbed_learn::team::{LearningTiming, TeamContext};
use seedbed_random::{Purpose, stream};

criterion_group!(
    benches,
    update,
    act,
    act_together,
    layers,
    network,
    capped_returns
);
criterion_main!(benches);

/// Number of agents, K.
const AGENTS: u32 = 16;

/// Number of steps per episode, T.
const STEPS: usize = 200;

/// Measures updates with one round of episodes. Every update starts from the same parameters.
fn update(criterion: &mut Criterion) {
    let task = cart_pole();
    let episodes: Vec<Episode> = (0..AGENTS)
        .map(|agent| play_episode(&task, agent))
        .collect();
    let mut learner = build_agent(task.spec(), 0);
    let saved = learner.save();
    let mut group = criterion.benchmark_group("update");
    group.throughput(Throughput::Elements(u64::from(AGENTS) * STEPS as u64));
    group.bench_function("one agent of 16, a round of 16 × 200 steps", |bencher| {
        let lengths: Vec<u32> = episodes
            .iter()
            .map(|episode| episode.length() as u32)
            .collect();
        bencher.iter_custom(|iterations| {
            let update_duration = |_| {
                learner
                    .restore(&saved)
                    .expect("these are the agent's own bytes");
                let start = Instant::now();
                black_box(learner.update(&Experience {
                    new_episodes: &episodes,
                    new_lengths: &lengths,
                    all_episodes: &episodes,
                    earlier_updates: 0,
                }));
                start.elapsed()
            };
            (0..iterations).map(update_duration).sum::<Duration>()
        });
    });
    group.finish();
}

fn act(criterion: &mut Criterion) {
    let task = cart_pole();
    let spec = task.spec();
    let actor = build_agent(spec, 0);
    let mut random = stream(0, Purpose::Action, 0, 0).into();
    let mut scratch = ActScratch::default();
    let (mut action, mut log_prob) = ([0.0], [0.0]);
    criterion.bench_function("act/one step", |bencher| {
        bencher.iter(|| {
            actor.act(
                black_box(&[0.01, -0.2, 0.03, 0.4]),
                &mut random,
                &mut scratch,
                &mut action,
                &mut log_prob,
            );
            action[0]
        });
    });
}

/// One step of all agents of a team, whose actions are added to their episodes.
fn act_together(criterion: &mut Criterion) {
    let task = cart_pole();
    let spec = task.spec();
    let team = SeedPg::default().build(&TeamContext {
        run_seed: 0,
        config: &team_config(),
        local_agents: None,
        spec,
        timing: LearningTiming::AfterEpisodes,
        record_advantages: false,
    });
    let observations = [0.01, -0.2, 0.03, 0.4].repeat(AGENTS as usize);
    let mut agents: Vec<Playing> = (0..AGENTS)
        .map(|agent| Playing(Episode::start(agent, 0, 0, spec)))
        .collect();
    let mut acting = ActingAgents::new(0, 0..AGENTS, 0);
    criterion.bench_function("act/one step of 16 agents", |bencher| {
        bencher.iter(|| {
            for Playing(episode) in &mut agents {
                episode.actions.clear();
                episode.log_probs.clear();
            }
            let step = GroupStep {
                first_agent: 0,
                action_width: spec.action_width(),
                unreported_steps: 0,
                observations: black_box(&observations),
            };
            acting.act(&*team, &step, &mut agents)[0]
        });
    });
}

/// An agent that plays.
struct Playing(Episode);

impl Player for Playing {
    fn playing(&mut self) -> Option<&mut Episode> {
        Some(&mut self.0)
    }
}

/// One linear layer: forward pass, and gradient of all parameters.
fn layers(criterion: &mut Criterion) {
    for (inputs, outputs) in [(4, 32), (32, 32), (32, 2), (64, 64)] {
        bench_network(
            criterion,
            &format!("layer {inputs}-{outputs}"),
            &[inputs, outputs],
        );
    }
}

/// A network with tanh: forward pass, gradient of all parameters, and one step of Adam.
fn network(criterion: &mut Criterion) {
    bench_network(criterion, "network 4-32-32-2", &[4, 32, 32, 2]);
    bench_network(criterion, "network 4-64-64-1", &[4, 64, 64, 1]);
    let network = Mlp::new(&[4, 32, 32, 2]);
    let (mut parameters, gradient) = (
        initial_parameters(&network),
        random_numbers(network.parameter_count()),
    );
    let mut optimizer = Adam::new(AdamSettings::default(), parameters.len());
    criterion.bench_function("network 4-32-32-2/adam", |bencher| {
        bencher.iter(|| optimizer.descend(&mut parameters, black_box(&gradient), 1.0));
    });
}

fn bench_network(criterion: &mut Criterion, name: &str, sizes: &[usize]) {
    let network = Mlp::new(sizes);
    let parameters = initial_parameters(&network);
    let (inputs, output_gradient) = (
        random_numbers(STEPS * network.inputs()),
        random_numbers(STEPS * network.outputs()),
    );
    let (mut activations, mut gradient) = (Activations::default(), vec![0.0; parameters.len()]);
    let mut group = criterion.benchmark_group(name);
    group.throughput(Throughput::Elements(STEPS as u64));
    group.bench_function(BenchmarkId::new("forward", STEPS), |bencher| {
        bencher.iter(|| network.forward(&parameters, black_box(&inputs), &mut activations)[0]);
    });
    network.forward(&parameters, &inputs, &mut activations);
    group.bench_function(BenchmarkId::new("backward", STEPS), |bencher| {
        bencher.iter(|| {
            network.backward(
                &parameters,
                black_box(&inputs),
                &mut activations,
                &output_gradient,
                &mut gradient,
            );
            gradient[0]
        });
    });
    group.finish();
}

fn capped_returns(criterion: &mut Criterion) {
    let ratios: Vec<f32> = random_numbers(STEPS)
        .iter()
        .map(|number| (0.2 * number).exp())
        .collect();
    let (rewards, mut products, mut returns) = (vec![1.0; STEPS], Vec::new(), vec![0.0; STEPS]);
    let mut group = criterion.benchmark_group("returns");
    group.throughput(Throughput::Elements(STEPS as u64));
    group.bench_function("per decision, capped", |bencher| {
        bencher.iter(|| {
            returns::per_decision(
                black_box(&ratios),
                &rewards,
                0.99,
                Some(1.0),
                &mut products,
                &mut returns,
            );
            returns[0]
        });
    });
    group.finish();
}

fn cart_pole() -> TaskDescription {
    load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("envs/cartpole.ron"))
        .expect("the task file is valid")
}

fn team_config() -> TeamConfig {
    TeamConfig {
        count: ranged_count(AGENTS),
        ..TeamConfig::default()
    }
}

fn build_agent(spec: &TaskSpec, agent: u32) -> Box<dyn Agent> {
    let team = team_config();
    let context = AgentContext {
        run_seed: 0,
        agent,
        team: &team,
        spec,
        record_advantages: false,
    };
    Box::new(SeedPgAgent::new(&SeedPg::default(), &context))
}

/// An episode of [`STEPS`] steps with the initial policy of an agent. When the pole falls, the
/// environment is reset and the episode continues.
fn play_episode(task: &TaskDescription, agent: u32) -> Episode {
    let mut environment =
        build(task, Physics::Analytic, 1).expect("the task has an analytic model");
    let (mut resets, mut actions) = (
        stream(0, Purpose::Reset, agent, 0),
        stream(0, Purpose::Action, agent, 0).into(),
    );
    let (actor, mut scratch) = (build_agent(task.spec(), agent), ActScratch::default());
    let mut episode = Episode {
        outcome: Status::Truncated,
        ..Episode::start(agent, 0, 0, task.spec())
    };
    let (mut action, mut log_prob) = ([0.0], [0.0]);
    environment.reset(0, &mut resets);
    for _ in 0..STEPS {
        episode
            .observations
            .extend_from_slice(environment.observations());
        actor.act(
            environment.observations(),
            &mut actions,
            &mut scratch,
            &mut action,
            &mut log_prob,
        );
        environment.step(&action);
        episode.actions.extend_from_slice(&action);
        episode.log_probs.extend_from_slice(&log_prob);
        episode.rewards.push(environment.rewards()[0]);
        if environment.statuses()[0] != Status::Running {
            environment.reset(0, &mut resets);
        }
    }
    episode
        .observations
        .extend_from_slice(environment.observations());
    episode
}

fn initial_parameters(network: &Mlp) -> Vec<f32> {
    network.initial_parameters(
        Initial::Random,
        &mut stream(0, Purpose::InitialParameters, 0, 0),
    )
}

/// Random numbers, uniform between −1 and 1.
fn random_numbers(count: usize) -> Vec<f32> {
    let mut random = stream(0, Purpose::Preview, 0, 0);
    (0..count)
        .map(|_| random.random_range(-1.0..=1.0))
        .collect()
}
