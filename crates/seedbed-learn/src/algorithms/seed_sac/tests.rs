//! Tests: two whole gradient steps against an independent computation, what is drawn from the replay
//! buffer, seeds, and a task of one step that is solved by hand.

use super::config::{Learners, SeedSac, Temperature};
use super::*;
use crate::agent::TeamConfig;
use crate::agent::bonus::Bonus;
use crate::algorithms::AlgorithmConfig;
use crate::experience::Episode;
use crate::nn::AdamSettings;
use crate::scaling::ObservationScaling;
use crate::seed::{RewardSeeds, SameInitial};
use crate::team::{
    ActionRequest, Learner, LearningRequest, LearningTiming, Team, TeamContext, Workers,
};
use seedbed_env::{Action, Choice, Quantity, Status, TaskSpec};
use seedbed_input::numbers::{Count, Fraction, ranged_count, ranged_number};

/// A task with three observations and two actions, all from −1 to 1.
fn spec() -> TaskSpec {
    let quantity = |name: &str| Quantity {
        name: name.to_owned(),
        unit: String::new(),
        range: [-1.0, 1.0],
    };
    let action = |name: &str| Action {
        quantity: quantity(name),
        choice: Choice::Continuous,
    };
    TaskSpec {
        time_limit: 10,
        ..TaskSpec::new(
            "test",
            ["a", "b", "c"].map(quantity).to_vec(),
            ["u", "v"].map(action).to_vec(),
        )
    }
}

fn config() -> SeedSac {
    SeedSac {
        observations: ObservationScaling::Raw,
        hidden: vec![ranged_count(8); 2].into(),
        minibatch: ranged_count(5).into(),
        random_steps: ranged_count(0),
        ..SeedSac::default()
    }
}

fn team_config(agents: u32, sigma: f64) -> TeamConfig {
    TeamConfig {
        count: ranged_count(agents),
        seeds: RewardSeeds::Normal {
            sigma: ranged_number(sigma),
        }
        .into(),
        ..TeamConfig::default()
    }
}

fn learner(config: &SeedSac, team: &TeamConfig, agent: u32) -> SoftLearner {
    let agent = AgentContext {
        run_seed: 3,
        agent,
        team,
        spec: &spec(),
        record_advantages: false,
    };
    SoftLearner::new(config, &agent)
}

/// Episode 0 of an agent: step t leads from (t, 0, 0) to (t + 1, 0, 0) by action (0.1 t, 0) with reward
/// 10ᵗ.
fn episode(agent: u32, steps: usize, outcome: Status) -> Episode {
    Episode {
        observations: (0..=steps).flat_map(|t| [t as f32, 0.0, 0.0]).collect(),
        actions: (0..steps).flat_map(|t| [0.1 * t as f32, 0.0]).collect(),
        rewards: (0..steps).map(|t| 10.0_f32.powi(t as i32)).collect(),
        log_probs: vec![0.0; 2 * steps],
        outcome,
        ..Episode::start(agent, 0, 0, &spec())
    }
}

fn replay_of(episodes: &[Episode]) -> Replay {
    let mut replay = Replay::new(1000, (&spec()).into());
    for episode in episodes {
        (0..episode.length()).for_each(|step| replay.push(episode, step));
    }
    replay
}

#[derive(Deserialize)]
struct GoldenUpdate {
    settings: Settings,
    hidden: u64,
    policy: Vec<f32>,
    critics: Vec<Vec<f32>>,
    priors: Vec<Vec<f32>>,
    steps: Vec<Step>,
    after: After,
}

#[derive(Deserialize)]
struct Settings {
    target_rate: f64,
    regularization: f64,
    prior_scale: f64,
    initial_alpha: f64,
    target_entropy: f64,
    step_size: f64,
    epsilon: f64,
}

#[derive(Deserialize)]
struct Step {
    states: Vec<[f32; 3]>,
    next_states: Vec<[f32; 3]>,
    actions: Vec<[f32; 2]>,
    rewards: Vec<f32>,
    discounts: Vec<f32>,
    noise: Vec<[f32; 2]>,
    next_noise: Vec<[f32; 2]>,
}

#[derive(Deserialize)]
struct After {
    policy: Vec<f64>,
    critics: Vec<Vec<f64>>,
    targets: Vec<Vec<f64>>,
    log_alpha: Vec<f64>,
}

impl GoldenUpdate {
    fn config(&self) -> SeedSac {
        let settings = &self.settings;
        let optimizer = AdamSettings {
            step_size: ranged_number(settings.step_size),
            epsilon: ranged_number(settings.epsilon),
            ..AdamSettings::default()
        };
        SeedSac {
            hidden: vec![Count::try_from(self.hidden).unwrap(); 2].into(),
            target_rate: ranged_number(settings.target_rate),
            regularization: ranged_number(settings.regularization),
            prior_scale: ranged_number(settings.prior_scale),
            temperature: Temperature::Automatic {
                initial: ranged_number(settings.initial_alpha),
                entropy: ranged_number(settings.target_entropy / 2.0),
                ladder: ranged_number(0.0),
            },
            policy_optimizer: optimizer,
            critic_optimizer: optimizer,
            ..config()
        }
    }

    /// The learner before its steps.
    fn learner(&self, config: &SeedSac) -> SoftLearner {
        let mut learner = learner(config, &team_config(1, 0.0), 0);
        let policy = config.policy_shape(&spec());
        let policy = Network::new(policy, self.policy.clone(), config.policy_optimizer);
        learner.policy = SquashedPolicy::new(&spec(), policy);
        let critics = self.critics.iter().zip(&self.priors);
        let critic = |(parameters, prior): (&Vec<f32>, &Vec<f32>)| {
            let shape = config.critic_shape(&spec());
            let network = Network::new(shape, parameters.clone(), config.critic_optimizer);
            Critic::new(network, Some((prior.clone(), config.prior_scale.get_f32())))
        };
        learner.critics = critics.map(critic).collect();
        learner
    }
}

/// The numbers of all tensors of one network.
fn numbers(tensors: &[Tensor<'_>], network: &str) -> Vec<f32> {
    let prefix = format!("{network}.");
    let tensors = tensors
        .iter()
        .filter(|tensor| tensor.name.starts_with(&prefix));
    tensors.flat_map(|tensor| tensor.values.to_vec()).collect()
}

/// `tests/gradients/soft_update.py` computes two steps in double precision, and says how. Errors of f32
/// are below 10⁻⁶; a wrong sign, a missing term or another order of the steps changes the first digits of
/// what is compared, steps of up to 0.06.
#[test]
fn two_gradient_steps_agree_with_an_independent_computation() {
    let golden: GoldenUpdate =
        serde_json::from_str(include_str!("../../../tests/gradients/soft_update.json")).unwrap();
    let config = golden.config();
    let mut learner = golden.learner(&config);
    for step in &golden.steps {
        learner.work.states = [step.states.concat(), step.next_states.concat()].concat();
        learner.work.actions = step.actions.concat();
        learner.work.rewards.clone_from(&step.rewards);
        learner.work.discounts.clone_from(&step.discounts);
        let noise = [step.noise.concat(), step.next_noise.concat()].concat();
        learner.policy.sample_with(&learner.work.states, &noise);
        learner.descend(&config, true);
    }
    let tensors = learner.tensors();
    let assert_close = |name: &str, ours: &[f32], expected: &[f64]| {
        assert_eq!(ours.len(), expected.len(), "{name}");
        for (index, (a, b)) in ours.iter().zip(expected).enumerate() {
            assert!(
                (f64::from(*a) - b).abs() < 2e-6,
                "{name}[{index}]: {a}, expected {b}"
            );
        }
    };
    let After {
        policy,
        critics,
        targets,
        log_alpha,
    } = &golden.after;
    assert_close("policy", &numbers(&tensors, "policy"), policy);
    for number in 0..2 {
        let name = format!("critic_{number}");
        assert_close(&name, &numbers(&tensors, &name), &critics[number]);
        let name = format!("target_{number}");
        assert_close(&name, &numbers(&tensors, &name), &targets[number]);
    }
    assert_close("log α", &[learner.temperature.log_alpha], log_alpha);
}

/// Sum of rewards, discount and the state after the n steps that begin with the transition at `index`.
fn n_steps(config: &SeedSac, replay: &Replay, index: usize) -> (f32, f32, f32) {
    let mut learner = learner(config, &team_config(1, 0.0), 0);
    let context = LearningContext {
        config,
        replay,
        scaling: &Scaling::Raw,
    };
    learner.push_return(&context, 0, index);
    let work = &learner.work;
    (
        work.rewards[0],
        work.discounts[0],
        work.next_observations[0],
    )
}

/// Rewards 1, 10, 100, 1000 and γ = ½. Three steps from step 0: 1 + 5 + 25, γ³, then state 3. From the
/// last but one step: 100 + 500, then the end: γ² if the time limit ended the episode, 0 if the task did,
/// or if the time limit counts as an end. A running episode has no further steps yet, so that γ¹ follows
/// its last one.
#[test]
fn returns_of_n_steps_by_hand() {
    let three = SeedSac {
        discount: ranged_number(0.5),
        n_step: ranged_count(3),
        ..config()
    };
    let ends = SeedSac {
        time_limit: crate::algorithms::seed_pg::config::TimeLimit::Ends,
        ..three.clone()
    };
    let one = SeedSac {
        n_step: ranged_count(1),
        ..three.clone()
    };
    let replay = |outcome| replay_of(&[episode(0, 4, outcome)]);
    let truncated = replay(Status::Truncated);
    assert_eq!(n_steps(&three, &truncated, 0), (31.0, 0.125, 3.0));
    assert_eq!(n_steps(&one, &truncated, 1), (10.0, 0.5, 2.0));
    assert_eq!(n_steps(&three, &truncated, 2), (600.0, 0.25, 4.0));
    assert_eq!(n_steps(&ends, &truncated, 2), (600.0, 0.0, 4.0));
    let terminated = replay(Status::Terminated);
    assert_eq!(n_steps(&three, &terminated, 2), (600.0, 0.0, 4.0));
    assert_eq!(n_steps(&three, &terminated, 0), (31.0, 0.125, 3.0));
    assert_eq!(
        n_steps(&three, &replay(Status::Running), 3),
        (1000.0, 0.5, 4.0)
    );
}

/// A learner adds its own fixed number to each reward of a return: with σ = 0.1 and γ = 1, sums of two
/// rewards differ from 11 by z₀ + z₁, in the same way each time, and differently for another learner.
#[test]
fn each_reward_has_its_seed() {
    let config = SeedSac {
        discount: ranged_number(1.0),
        n_step: ranged_count(2),
        ..config()
    };
    let replay = replay_of(&[episode(0, 3, Status::Truncated)]);
    let context = LearningContext {
        config: &config,
        replay: &replay,
        scaling: &Scaling::Raw,
    };
    let seeds = |agent| {
        let mut learner = learner(&config, &team_config(2, 0.1), agent);
        (0..2).for_each(|row| learner.push_return(&context, row, 0));
        let z = |step| learner.perturbation.reward_seed(replay.origin(step));
        let expected = 11.0 + z(0) + z(1);
        assert!(
            learner
                .work
                .rewards
                .iter()
                .all(|sum| (sum - expected).abs() < 1e-5)
        );
        expected
    };
    assert!((seeds(0) - 11.0).abs() > 1e-3 && seeds(0) != seeds(1));
}

/// Half of 40 transitions are the agent's own at least; with a share of 1 all are. In the buffer, one in
/// ten is.
#[test]
fn a_share_of_the_minibatch_is_the_agents_own() {
    let replay = replay_of(&[
        episode(0, 90, Status::Truncated),
        episode(1, 10, Status::Truncated),
    ]);
    let own_count = |share: f64| {
        let config = SeedSac {
            own_share: ranged_number::<Fraction>(share).into(),
            ..config()
        };
        let mut learner = learner(&config, &team_config(2, 0.0), 1);
        let own = (0..40).filter(|row| {
            let index = learner.draw_index(&replay, f64::from(*row) < share * 40.0);
            replay.origin(index).agent == 1
        });
        own.count()
    };
    assert_eq!(own_count(1.0), 40);
    assert!((20..30).contains(&own_count(0.5)), "{}", own_count(0.5));
    assert!(own_count(0.0) < 13, "{}", own_count(0.0));
}

/// Two of five critics: each pair of different ones is drawn about as often, 100 times of 2,000 for each
/// of 20 ordered pairs, ±4 √95.
#[test]
fn critics_are_drawn_without_replacement() {
    let mut random = stream(0, Purpose::UpdateNoise, 0, 0);
    let (mut counts, mut drawn) = ([[0; 5]; 5], Vec::new());
    for _ in 0..2000 {
        draw_without_replacement(2, 5, &mut random, &mut drawn);
        counts[drawn[0]][drawn[1]] += 1;
    }
    for (first, counts) in counts.iter().enumerate() {
        for (second, &count) in counts.iter().enumerate() {
            let is_expected = if first == second {
                count == 0
            } else {
                (61..=139).contains(&count)
            };
            assert!(is_expected, "{first} {second}: {count}");
        }
    }
    draw_without_replacement(5, 5, &mut random, &mut drawn);
    assert_eq!(drawn, [0, 1, 2, 3, 4]);
}

/// With two components, entropy −1 and a ladder of 0.5, agents 0, 1, 2 of three have targets −2, −1.5,
/// −1; an agent alone has −2.
#[test]
fn targets_of_entropies_are_a_ladder() {
    let config = SeedSac {
        temperature: Temperature::Automatic {
            initial: ranged_number(0.2),
            entropy: ranged_number(-1.0),
            ladder: ranged_number(0.5),
        },
        ..config()
    };
    let target = |agents, agent| {
        let learner = learner(&config, &team_config(agents, 0.0), agent);
        learner.temperature.target_entropy
    };
    assert_eq!([0, 1, 2].map(|agent| target(3, agent)), [-2.0, -1.5, -1.0]);
    assert_eq!(target(1, 0), -2.0);
}

/// Agents differ by policies and critics, and the critics of one agent from each other, unless the team
/// says that they are the same.
#[test]
fn initial_networks_are_part_of_the_agent_seed() {
    let network = |same: SameInitial, agent, name: &str| {
        let team = TeamConfig {
            same_initial: same.into(),
            ..team_config(2, 0.0)
        };
        numbers(&learner(&config(), &team, agent).tensors(), name)
    };
    for (same, policy_is_same, critic_is_same) in [
        (SameInitial::Off, false, false),
        (SameInitial::Policy, true, false),
        (SameInitial::Value, false, true),
        (SameInitial::Both, true, true),
    ] {
        let is_same = |name| network(same, 0, name) == network(same, 1, name);
        assert_eq!(
            (is_same("policy"), is_same("critic_1")),
            (policy_is_same, critic_is_same)
        );
        assert_ne!(network(same, 0, "critic_0"), network(same, 0, "critic_1"));
    }
}

/// A team with the transitions of `episodes`.
fn team(config: &SeedSac, team: &TeamConfig, episodes: &[Episode]) -> Box<dyn Team> {
    team_of_process(config, team, None, episodes)
}

/// The part of a team that belongs to one process.
fn team_of_process(
    config: &SeedSac,
    team: &TeamConfig,
    local_agents: Option<(u32, u32)>,
    episodes: &[Episode],
) -> Box<dyn Team> {
    let mut team = config.build(&TeamContext {
        run_seed: 3,
        config: team,
        local_agents,
        spec: &spec(),
        timing: LearningTiming::EverySteps(1),
        record_advantages: false,
    });
    for episode in episodes {
        (0..episode.length()).for_each(|step| team.add_transition(episode, step));
    }
    team
}

/// A restored learner takes the same next steps, to the bit, with drawn critics, delayed policies and a
/// bonus.
#[test]
fn a_restored_team_continues_with_the_same_bits() {
    let config = SeedSac {
        critics: ranged_count(4),
        layer_normalization: true,
        policy_every: ranged_count(2),
        updates: ranged_count(3),
        bonus: ron::from_str::<Bonus>("Rnd((hidden: [4], outputs: 3))")
            .unwrap()
            .into(),
        observations: ObservationScaling::Running,
        ..config()
    };
    let episodes = [
        episode(0, 9, Status::Truncated),
        episode(1, 9, Status::Truncated),
    ];
    let learn = |team: &mut Box<dyn Team>, round: u32| {
        team.begin_round(round);
        (0..2).for_each(|_| team.end_step(Workers::CURRENT_THREAD));
        let learners = [0, 1].map(|agent| Learner {
            agent,
            first_new_episode: 0,
            earlier_updates: round,
        });
        let request = LearningRequest {
            episodes: &episodes,
            lengths: &[9, 9],
            learners: &learners,
        };
        team.learn(&request, Workers::CURRENT_THREAD)
    };
    let mut original = team(&config, &team_config(2, 0.1), &episodes);
    learn(&mut original, 0);
    let mut restored = team(&config, &team_config(2, 0.1), &episodes);
    restored.restore(&original.save()).unwrap();
    assert_eq!(learn(&mut original, 1), learn(&mut restored, 1));
    assert!(original.save() == restored.save());
    let other = SeedSac {
        critics: ranged_count(2),
        ..config
    };
    assert!(
        team(&other, &team_config(2, 0.1), &[])
            .restore(&original.save())
            .is_err()
    );
}

/// Two processes, one with agent 0 and one with agents 1 and 2, learn together what one process learns,
/// to the bit: from their copies of the replay buffer, each for the learners of its agents.
#[test]
fn a_team_over_two_processes_learns_the_same() {
    let episodes = [0, 1, 2].map(|agent| episode(agent, 9, Status::Truncated));
    for learners in [Learners::Own, Learners::Shared] {
        let config = SeedSac {
            learners,
            ..config()
        };
        let learned = |local_agents| {
            let team_config = team_config(3, 0.1);
            let mut team = team_of_process(&config, &team_config, local_agents, &episodes);
            team.begin_round(1);
            (0..3).for_each(|_| team.end_step(Workers::CURRENT_THREAD));
            let names = team.tensors().into_iter().map(|tensor| tensor.name);
            (team.save().parts, names.collect::<Vec<_>>())
        };
        let (parts, names) = learned(None);
        let (first_parts, first_names) = learned(Some((0, 1)));
        let (second_parts, second_names) = learned(Some((1, 3)));
        assert!(parts == [first_parts, second_parts].concat());
        let mut names_of_both = [first_names, second_names].concat();
        names_of_both.sort();
        let mut names = names;
        names.sort();
        assert_eq!(names, names_of_both);
    }
}

/// Episodes of one step with reward −(u − ½)² − (v + ¼)²: the best action is (½, −¼). Actions are
/// uniformly random.
fn one_step_episodes(count: u32) -> Vec<Episode> {
    let mut random = stream(5, Purpose::Trial, 0, 0);
    let mut episodes = Vec::new();
    for number in 0..count {
        let action = [(); 2].map(|()| random.random_range(-1.0..=1.0_f32));
        let reward = -(action[0] - 0.5).powi(2) - (action[1] + 0.25).powi(2);
        episodes.push(Episode {
            episode: number,
            observations: vec![1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            actions: action.to_vec(),
            rewards: vec![reward],
            log_probs: vec![0.0; 2],
            outcome: Status::Terminated,
            ..Episode::start(0, number, 0, &spec())
        });
    }
    episodes
}

/// The greedy action of agent 0 in state (1, 0, 0) after `steps` gradient steps.
fn learned_action(config: &SeedSac, agents: u32, steps: u32) -> (Vec<f32>, f32) {
    let episodes = one_step_episodes(400);
    let mut config = SeedSac {
        hidden: vec![ranged_count(32); 2].into(),
        minibatch: ranged_count(32).into(),
        updates: Count::try_from(u64::from(steps)).unwrap(),
        policy_optimizer: AdamSettings::default(),
        critic_optimizer: AdamSettings {
            step_size: ranged_number(3e-3),
            ..AdamSettings::default()
        },
        ..config.clone()
    };
    config.set_action_selection(crate::agent::action_selection::ActionSelection::Greedy);
    let mut team = team(&config, &team_config(agents, 0.0), &episodes);
    team.begin_round(0);
    team.end_step(Workers::CURRENT_THREAD);
    let (mut actions, mut log_probs) = (vec![0.0; 2], vec![0.0; 2]);
    let mut request = ActionRequest {
        first_agent: 0,
        unreported_steps: 0,
        steps: &[0],
        observations: &[1.0, 0.0, 0.0],
        playing: &[true],
        random: &mut [stream(0, Purpose::Action, 0, 0).into()],
        actions: &mut actions,
        log_probs: &mut log_probs,
    };
    team.act(&mut request, &mut crate::agent::ActScratch::default());
    let learner = [Learner {
        agent: 0,
        first_new_episode: 0,
        earlier_updates: 0,
    }];
    let request = LearningRequest {
        episodes: &[],
        lengths: &[],
        learners: &learner,
    };
    let updates = team.learn(&request, Workers::CURRENT_THREAD);
    (actions, updates[0].update.report.entropy.unwrap())
}

/// The best action is found, with each kind of critics; untrained policies are far from it.
#[test]
fn the_best_action_of_a_task_of_one_step_is_learned() {
    let distance = |action: &[f32]| (action[0] - 0.5).hypot(action[1] + 0.25);
    let redq = SeedSac {
        critics: ranged_count(5),
        policy_value: soft_actor_critic::Combination::Mean,
        layer_normalization: true,
        prior_scale: ranged_number(0.3),
        ..config()
    };
    let shared = SeedSac {
        learners: Learners::Shared,
        ..config()
    };
    for (config, agents) in [(config(), 1), (redq, 1), (shared, 3)] {
        let (before, _) = learned_action(&config, agents, 1);
        let (after, _) = learned_action(&config, agents, 1500);
        assert!(distance(&before) > 0.3, "{before:?}");
        assert!(distance(&after) < 0.1, "{after:?}");
    }
}
