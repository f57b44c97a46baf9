//! Tests: values of a chain that is solved by hand, and the assignment of models to agents.

use super::config::{BootstrappedDqn, Draw, Fit, Learning, Models, QLearning, SeedTd, ValueBased};
use super::*;
use crate::agent::TeamConfig;
use crate::scaling::ObservationScaling;
use crate::seed::{RewardSeeds, SameInitial};
use crate::team::LearningTiming;
use seedbed_env::{Action, Quantity, Status};
use seedbed_input::numbers::{ranged_count, ranged_number};

/// A chain of three states with one-hot observations: action 0 goes left, action 1 goes right.
/// Leaving state 2 to the right ends the episode with reward 1; leaving state 0 to the left ends it
/// with reward 0.2.
pub(super) fn spec() -> TaskSpec {
    let quantity = |name: &str| Quantity {
        name: name.to_owned(),
        unit: String::new(),
        range: [-1.0, 1.0],
    };
    TaskSpec {
        name: "chain".to_owned(),
        description: String::new(),
        observations: ["first", "second", "third"].map(quantity).to_vec(),
        actions: vec![Action {
            quantity: quantity("move"),
            choice: Choice::Discrete(vec![-1.0, 1.0]),
        }],
        control_step: 0.1,
        time_limit: 10,
        reward_threshold: None,
        info: Vec::new(),
    }
}

pub(super) fn observation(state: usize) -> [f32; 3] {
    std::array::from_fn(|index| if index == state { 1.0 } else { 0.0 })
}

/// An episode of one step: `action` in `state`.
fn one_step_episode(agent: u32, state: usize, action: usize) -> Episode {
    let (next, reward, outcome) = match (state, action) {
        (0, 0) => (0, 0.2, Status::Terminated),
        (2, 1) => (2, 1.0, Status::Terminated),
        (state, 0) => (state - 1, 0.0, Status::Running),
        (state, _) => (state + 1, 0.0, Status::Running),
    };
    Episode {
        observations: [observation(state), observation(next)].concat(),
        actions: vec![action as f32],
        rewards: vec![reward],
        outcome,
        ..Episode::start(agent, (2 * state + action) as u32, 0, &spec())
    }
}

pub(super) fn learning() -> Learning {
    Learning {
        discount: ranged_number(0.8),
        observations: ObservationScaling::Raw,
        hidden: vec![ranged_count(16)].into(),
        minibatch: ranged_count(6).into(),
        target_every: ranged_count(20),
        ..Learning::default()
    }
}

fn team_of(agents: u32, sigma: f64) -> TeamConfig {
    TeamConfig {
        count: ranged_count(agents),
        seeds: RewardSeeds::Normal {
            sigma: ranged_number(sigma),
        }
        .into(),
        ..TeamConfig::default()
    }
}

pub(super) fn team(composition: Composition, agents: u32, sigma: f64) -> ValueTeam {
    team_in_process(composition, agents, sigma, None)
}

pub(super) fn team_in_process(
    composition: Composition,
    agents: u32,
    sigma: f64,
    local_agents: Option<(u32, u32)>,
) -> ValueTeam {
    let mut team = ValueTeam::new(
        composition,
        &TeamContext {
            run_seed: 3,
            config: &team_of(agents, sigma),
            local_agents,
            spec: &spec(),
            timing: LearningTiming::AfterEpisodes,
            record_advantages: false,
        },
    );
    team.begin_round(0);
    (0..3).for_each(|state| {
        (0..2).for_each(|action| team.add_transition(&one_step_episode(0, state, action), 0));
    });
    team
}

pub(super) fn learn(team: &mut ValueTeam, times: usize) {
    (0..times).for_each(|_| team.learn_from_replay(Workers::CURRENT_THREAD));
}

/// Values Q of all states by the model of `agent`, in a team of `agents`: `[3 × 2]`.
pub(super) fn values(team: &mut ValueTeam, agent: usize, agents: usize) -> Vec<f32> {
    let mut values = Vec::new();
    for state in 0..3 {
        let observations: Vec<f32> = (0..agents).flat_map(|_| observation(state)).collect();
        let mut buffers = ValueScratch::default();
        team.evaluate(0, &observations, &vec![true; agents], &mut buffers);
        values.extend_from_slice(&buffers.values[2 * agent..2 * agent + 2]);
    }
    values
}

/// By hand, γ = 0.8: Q(2, right) = 1; Q(1, right) = 0.8; Q(0, right) = 0.64, so V = 0.64, 0.8, 1
/// and Q(0, left) = 0.2, Q(1, left) = 0.8 V(0) = 0.512, Q(2, left) = 0.8 V(1) = 0.64.
const OPTIMAL_VALUES: [f32; 6] = [0.2, 0.64, 0.512, 0.8, 0.64, 1.0];

pub(super) fn assert_optimal_values(values: &[f32], tolerance: f32) {
    let largest_error = values
        .iter()
        .zip(OPTIMAL_VALUES)
        .map(|(value, exact)| (value - exact).abs())
        .fold(0.0, f32::max);
    assert!(
        largest_error < tolerance,
        "{values:?}; expected {OPTIMAL_VALUES:?}"
    );
}

#[test]
fn q_learning_finds_the_exact_values_of_a_chain() {
    for double in [false, true] {
        let config = QLearning {
            double,
            learning: learning(),
            ..QLearning::default()
        };
        let mut team = team(config.compose(1), 1, 0.0);
        learn(&mut team, 6000);
        assert_optimal_values(&values(&mut team, 0, 1), 0.02);
    }
}

/// After ten regressions, values have converged to within 0.8¹⁰.
#[test]
fn least_squares_value_iteration_finds_the_exact_values() {
    let learning = Learning {
        minibatches: ranged_count(1000),
        ..learning()
    };
    let fit = Fit::Lsvi {
        iterations: ranged_count(10),
    }
    .into();
    let config = SeedTd {
        fit,
        prior_scale: ranged_number(0.0),
        learning,
        ..SeedTd::default()
    };
    let mut team = team(config.compose(1), 1, 0.0);
    learn(&mut team, 1);
    assert_optimal_values(&values(&mut team, 0, 1), 0.03);
}

/// The learned network compensates for the prior: their sum converges to the same values.
#[test]
fn values_converge_with_a_prior() {
    let config = SeedTd {
        learning: learning(),
        ..SeedTd::default()
    };
    let mut team = team(config.compose(2), 2, 0.0);
    let before = values(&mut team, 0, 2);
    assert!(
        before
            .iter()
            .zip(OPTIMAL_VALUES)
            .any(|(value, exact)| (value - exact).abs() > 0.3),
        "{before:?}"
    );
    learn(&mut team, 6000);
    (0..2).for_each(|agent| assert_optimal_values(&values(&mut team, agent, 2), 0.03));
}

/// Seed TD learns the values of the chain with rewards r + z: Q(2, right) = 1 + z, where z is the
/// seed of that transition.
#[test]
fn seeds_shift_learned_values() {
    let config = SeedTd {
        learning: learning(),
        prior_scale: ranged_number(0.0),
        ..SeedTd::default()
    };
    let mut team = team(config.compose(2), 2, 0.3);
    learn(&mut team, 6000);
    for model in 0..2 {
        let perturbation = perturbation::Perturbation {
            run_seed: 3,
            model,
            seed_distribution: Some(*team_of(2, 0.3).seeds),
            mask: 1.0,
        };
        let z = perturbation.reward_seed(team.replay.get(5).origin);
        let value = values(&mut team, model as usize, 2)[5];
        assert!((value - 1.0 - z).abs() < 0.03, "{value} with z = {z}");
    }
}

/// With a large weight of ½ ‖θ − θ̂‖², a model stays at its initial parameters.
#[test]
fn regularization_keeps_a_model_at_its_initial_parameters() {
    let largest_change = |regularization| {
        let config = SeedTd {
            learning: learning(),
            regularization: ranged_number(regularization),
            ..SeedTd::default()
        };
        let mut team = team(config.compose(1), 1, 0.0);
        let before = values(&mut team, 0, 1);
        learn(&mut team, 2000);
        values(&mut team, 0, 1)
            .iter()
            .zip(before)
            .map(|(after, before)| (after - before).abs())
            .fold(0.0, f32::max)
    };
    assert!(
        largest_change(100.0) < 0.1 && largest_change(0.0) > 0.3,
        "{} {}",
        largest_change(100.0),
        largest_change(0.0)
    );
}

/// With at most 30 models, agents 5, 35 and 65 of 70 act by model 5; each of 4 agents has its own
/// model.
#[test]
fn agents_of_an_ensemble_share_its_models() {
    let models = Models::Ensemble {
        most: ranged_count(30),
    };
    let config = SeedTd {
        models,
        learning: learning(),
        ..SeedTd::default()
    };
    let mut large_team = team(config.compose(70), 70, 0.1);
    assert_eq!(
        (large_team.models.len(), large_team.followers[5].as_slice()),
        (30, &[5, 35, 65][..])
    );
    assert_eq!(
        values(&mut large_team, 5, 70),
        values(&mut large_team, 65, 70)
    );
    assert_ne!(
        values(&mut large_team, 5, 70),
        values(&mut large_team, 6, 70)
    );
    assert_eq!(team(config.compose(4), 4, 0.1).models.len(), 4);
}

/// The values of an agent depend only on its own observation, not on which other agents play.
#[test]
fn values_do_not_depend_on_other_agents() {
    let config = SeedTd {
        models: Models::Ensemble {
            most: ranged_count(2),
        },
        learning: learning(),
        ..SeedTd::default()
    };
    let mut team = team(config.compose(5), 5, 0.1);
    let observations: Vec<f32> = [0, 1, 2, 1, 0].into_iter().flat_map(observation).collect();
    let mut together = ValueScratch::default();
    let playing = [false, true, true, true, true];
    team.evaluate(0, &observations, &playing, &mut together);
    let mut second_group = ValueScratch::default();
    let width = observations.len() / 5;
    team.evaluate(
        3,
        &observations[3 * width..],
        &[true, true],
        &mut second_group,
    );
    assert_eq!(together.values[6..], second_group.values);
    for (agent, state) in [(1, 1), (2, 2), (3, 1), (4, 0)] {
        let alone = values(&mut team, agent, 5)[2 * state..2 * state + 2].to_vec();
        assert_eq!(together.values[2 * agent..2 * agent + 2], alone);
    }
}

#[test]
fn drawn_models_depend_on_the_round_only() {
    let config = config::BootstrappedDqn {
        learning: learning(),
        ..config::BootstrappedDqn::default()
    };
    let mut team = team(config.compose(4), 4, 0.0);
    let mut models_of_round = |round| {
        team.begin_round(round);
        team.model_of_agent.clone()
    };
    let rounds: Vec<Vec<usize>> = (0..20).map(&mut models_of_round).collect();
    assert_eq!(models_of_round(7), rounds[7]);
    assert!(rounds.iter().any(|models| *models != rounds[0]));
    assert!(rounds.iter().flatten().all(|&model| model < 10));
}

#[test]
fn a_restored_team_continues_with_the_same_bits() {
    let bonus = Bonus::Rnd(crate::agent::bonus::Rnd::default());
    for bonus in [Bonus::None, bonus] {
        let config = SeedTd {
            learning: learning(),
            bonus: bonus.into(),
            ..SeedTd::default()
        };
        let [mut original, mut restored] = [0, 1].map(|_| team(config.compose(3), 3, 0.1));
        learn(&mut original, 30);
        restored.restore(&original.save()).unwrap();
        let (numbers, mut transitions) = (original.replay.numbers(), Vec::new());
        original.replay.encode(numbers.clone(), &mut transitions);
        let replay = restored.replay_mut().unwrap();
        replay.restore(numbers.start, &transitions).unwrap();
        for team in [&mut original, &mut restored] {
            team.begin_round(1);
            learn(team, 30);
        }
        assert_eq!(original.save(), restored.save());
        assert_eq!(original.replay, restored.replay);
        let (saved, other) = (original.save(), SavedTeam::default());
        let without_models = SavedTeam {
            parts: Vec::new(),
            ..saved
        };
        assert!(restored.restore(&without_models).is_err());
        assert!(restored.restore(&other).is_err());
    }
}

/// Agents 0 and 1 in one process, 2 to 4 in another, as in one process: each process trains the models
/// of its agents, and passes on those that no process before it does. With more models than agents, the
/// last process has the rest.
#[test]
fn processes_have_the_bits_of_a_team_in_one() {
    for models in [2, 5, 7] {
        let bootstrapped = BootstrappedDqn {
            models: ranged_count(models),
            learning: learning(),
            ..BootstrappedDqn::default()
        };
        let ensemble = SeedTd {
            models: Models::Ensemble {
                most: ranged_count(models),
            },
            learning: learning(),
            ..SeedTd::default()
        };
        for composition in [bootstrapped.compose(5), ensemble.compose(5)] {
            let [mut whole, mut first, mut second] = [None, Some((0, 2)), Some((2, 5))]
                .map(|local| team_in_process(composition.clone(), 5, 0.1, local));
            for team in [&mut whole, &mut first, &mut second] {
                learn(team, 3);
            }
            let [whole, first, second] = [&whole, &first, &second].map(Team::save);
            assert_eq!(
                whole.parts,
                [first.parts, second.parts].concat(),
                "{models}"
            );
            assert_eq!(whole.shared, first.shared);
            assert_eq!(whole.shared, second.shared);
        }
    }
}

#[test]
fn a_task_must_have_one_discrete_action() {
    let discrete = spec();
    assert_eq!(choice_count(&discrete), Ok(2));
    let continuous = TaskSpec {
        actions: vec![Action {
            choice: Choice::Continuous,
            ..discrete.actions[0].clone()
        }],
        ..spec()
    };
    assert_eq!(
        choice_count(&continuous),
        Err("the action `move` of `chain` is continuous".to_owned())
    );
    let two_actions = TaskSpec {
        actions: vec![discrete.actions[0].clone(), discrete.actions[0].clone()],
        ..spec()
    };
    assert_eq!(
        choice_count(&two_actions),
        Err("`chain` has 2 actions per step".to_owned())
    );
}

#[test]
fn one_draw_for_the_team_gives_all_agents_the_same_model() {
    let models_in_round = |draw, round| {
        let config = BootstrappedDqn {
            draw,
            learning: learning(),
            ..BootstrappedDqn::default()
        };
        let mut team = team(config.compose(8), 8, 0.0);
        team.begin_round(round);
        team.model_of_agent.clone()
    };
    let rounds: Vec<Vec<usize>> = (0..8)
        .map(|round| models_in_round(Draw::Team, round))
        .collect();
    let is_uniform = |models: &Vec<usize>| models.iter().all(|model| *model == models[0]);
    assert!(rounds.iter().all(is_uniform));
    assert!(rounds.iter().any(|models| *models != rounds[0]));
    assert!(!is_uniform(&models_in_round(Draw::Agent, 0)));
}

#[test]
fn models_with_the_same_initial_parameters_have_the_same_values() {
    let config = SeedTd {
        prior_scale: ranged_number(0.0),
        learning: learning(),
        ..SeedTd::default()
    };
    let values_are_equal = |same_initial: SameInitial| {
        let team_config = TeamConfig {
            same_initial: same_initial.into(),
            ..team_of(2, 0.1)
        };
        let context = TeamContext {
            run_seed: 3,
            config: &team_config,
            local_agents: None,
            spec: &spec(),
            timing: LearningTiming::AfterEpisodes,
            record_advantages: false,
        };
        let mut team = ValueTeam::new(config.compose(2), &context);
        team.begin_round(0);
        values(&mut team, 0, 2) == values(&mut team, 1, 2)
    };
    assert!(values_are_equal(SameInitial::Value) && !values_are_equal(SameInitial::Off));
}
