//! Tests: values that depend on an index, on the chain of [`tests`](super::tests).

use super::hyper_agent::HyperAgent;
use super::index::{IndexDraw, IndexOwner, TargetIndex};
use super::tests::{assert_optimal_values, learn, learning, observation, spec, team};
use super::tests::{team_in_process, values};
use super::*;
use crate::algorithms::value_based::config::ValueBased;
use crate::nn::Activations;
use seedbed_input::numbers::ranged_number;

fn config() -> HyperAgent {
    HyperAgent {
        learning: learning(),
        sigma: ranged_number(0.0),
        ..HyperAgent::default()
    }
}

fn hyper_team(config: &HyperAgent, agents: u32) -> ValueTeam {
    team(config.compose(agents as usize), agents, 0.0)
}

/// σ zᵀξ of the transition `number` of the chain for the index of `agent`.
fn perturbation_of(team: &ValueTeam, number: usize, agent: usize, sigma: f32) -> f32 {
    let perturbation = perturbation::Perturbation {
        run_seed: 3,
        model: 0,
        seed_distribution: None,
        mask: 1.0,
    };
    let mut noise = Vec::new();
    perturbation.append_noise(team.replay.get(number).origin, 4, &mut noise);
    let products = noise.iter().zip(team.index_of(agent)).map(|(z, xi)| z * xi);
    sigma * products.sum::<f32>()
}

/// Without perturbations, values converge to the same for every index, though they differ before.
#[test]
fn values_of_all_indices_converge_to_the_exact_ones() {
    for double in [false, true] {
        let config = HyperAgent { double, ..config() };
        let mut team = hyper_team(&config, 3);
        let before = [0, 1].map(|agent| values(&mut team, agent, 3));
        assert_ne!(before[0], before[1]);
        learn(&mut team, 6000);
        (0..3).for_each(|agent| assert_optimal_values(&values(&mut team, agent, 3), 0.03));
    }
}

/// Agent k learns the values of the chain with rewards r + σ zᵀ`ξ_k`. By hand, with w for the
/// perturbation of each transition: Q(2, right) = 1 + w(2, right) and Q(1, right) = w(1, right) + 0.8
/// Q(2, right) if the target has the same index. If it has another one, the second summand is the
/// same for all agents.
#[test]
fn values_deviate_by_the_perturbations_of_an_index() {
    let (sigma, agents) = (0.05, 8);
    for target_index in [TargetIndex::Same, TargetIndex::Independent] {
        let config = HyperAgent {
            sigma: ranged_number(sigma.into()),
            target_index,
            ..config()
        };
        let mut team = hyper_team(&config, agents as u32);
        learn(&mut team, 12_000);
        let perturbation = |number, agent| perturbation_of(&team, number, agent, sigma);
        let order = |a: &usize, b: &usize| perturbation(5, *a).total_cmp(&perturbation(5, *b));
        let extremes = [
            (0..agents).max_by(order).unwrap(),
            (0..agents).min_by(order).unwrap(),
        ];
        let [second, third] =
            [3, 5].map(|number| extremes.map(|agent| perturbation(number, agent)));
        assert!(third[0] - third[1] > 0.08, "{third:?}");
        let learned = extremes.map(|agent| values(&mut team, agent, agents));
        for (values, perturbation) in learned.iter().zip(third) {
            let error = values[5] - (1.0 + perturbation);
            assert!(error.abs() < 0.02, "{target_index:?}: {error}");
        }
        let passed_on = match target_index {
            TargetIndex::Same => 0.8,
            TargetIndex::Independent => 0.0,
        };
        let expected = second[0] - second[1] + passed_on * (third[0] - third[1]);
        let difference = learned[0][3] - learned[1][3];
        assert!(
            (difference - expected).abs() < 0.02,
            "{target_index:?}: {difference}; expected {expected}"
        );
    }
}

/// Learning has one network and does not know how many agents act.
#[test]
fn what_is_learned_does_not_depend_on_the_number_of_agents() {
    let [few, many] = [2, 50].map(|agents| {
        let mut team = hyper_team(&config(), agents);
        learn(&mut team, 20);
        assert_eq!(team.models.len(), 1);
        assert_eq!(team.agent_update(0).update.report.gradient_steps, Some(20));
        assert_eq!(team.agent_update(1).update.report.gradient_steps, Some(0));
        team.save().parts
    });
    assert_eq!(few, many);
}

#[test]
fn indices_have_norm_one_and_belong_to_agents_and_rounds() {
    let indices = |index, draw, round| {
        let mut team = hyper_team(
            &HyperAgent {
                index,
                draw,
                ..config()
            },
            3,
        );
        team.begin_round(round);
        [0, 1, 2].map(|agent| team.index_of(agent).to_vec())
    };
    let own = indices(IndexOwner::Agent, IndexDraw::Once, 0);
    for index in &own {
        let squares: f32 = index.iter().map(|x| x * x).sum();
        assert!((squares - 1.0).abs() < 1e-5, "{index:?}");
    }
    assert!(own[0] != own[1] && own[1] != own[2]);
    assert_eq!(own, indices(IndexOwner::Agent, IndexDraw::Once, 7));
    assert_ne!(own, indices(IndexOwner::Agent, IndexDraw::EveryRound, 7));
    for draw in [IndexDraw::Once, IndexDraw::EveryRound] {
        let team = indices(IndexOwner::Team, draw, 7);
        assert!(team[0] == team[1] && team[1] == team[2]);
    }
    assert_ne!(
        indices(IndexOwner::Team, IndexDraw::EveryRound, 7),
        indices(IndexOwner::Team, IndexDraw::EveryRound, 8)
    );
}

/// The values of the prior are odd in the index: those of ξ and of −ξ add up to 0.
#[test]
fn the_mean_of_the_prior_over_indices_is_zero() {
    let mlp = Mlp::new(&[3, 8, 2 * 3]);
    let initial = crate::nn::Initial::Random;
    let random = &mut stream(1, Purpose::ValuePrior, 0, 0);
    let mut parameters = mlp.initial_parameters(initial, random);
    index::remove_mean(&mlp, 2, &mut parameters);
    let mut activations = Activations::default();
    let heads = mlp.forward(&parameters, &[0.5, -1.0, 2.0], &mut activations);
    let mut values = Vec::new();
    index_conditioned::append_values(heads, &[0.6, 0.8], &mut values);
    index_conditioned::append_values(heads, &[-0.6, -0.8], &mut values);
    assert!(values.iter().all(|value| *value != 0.0));
    assert!((values[0] + values[2]).abs() < 1e-6 && (values[1] + values[3]).abs() < 1e-6);
}

/// The tensors of an agent are networks of the plain kind, whose weighted sum it acts by.
#[test]
fn tensors_of_an_agent_have_its_values() {
    let mut skipping = learning();
    skipping.skip_connection = true;
    for learning in [learning(), skipping] {
        let config = HyperAgent {
            learning,
            ..config()
        };
        let mut team = hyper_team(&config, 3);
        learn(&mut team, 50);
        let expected = values(&mut team, 1, 3);
        let states: Vec<f32> = (0..3).flat_map(observation).collect();
        let tensors = team.tensors();
        let outputs = ["value", "prior"].map(|role| {
            let prefix = format!("agent_1.{role}.");
            let own = tensors
                .iter()
                .filter(|tensor| tensor.name.starts_with(&prefix));
            let parameters: Vec<f32> = own.flat_map(|tensor| tensor.values.to_vec()).collect();
            let mut activations = Activations::default();
            team.folded_shape
                .forward(&parameters, &states, &mut activations)
                .to_vec()
        });
        for (position, value) in expected.iter().enumerate() {
            let sum = outputs[0][position] + 3.0 * outputs[1][position];
            assert!((sum - value).abs() < 1e-5, "{position}: {sum} {value}");
        }
        let info = crate::algorithms::AlgorithmConfig::network_info(&config, &spec(), 3).unwrap();
        let terms: Vec<(&str, f32)> = info
            .outputs
            .iter()
            .map(|term| (term.network, term.factor))
            .collect();
        assert_eq!(
            terms,
            [("agent_{agent}.value", 1.0), ("agent_{agent}.prior", 3.0)]
        );
        assert!(info.models.is_none());
    }
}

/// Also if the restored team has not begun a round.
#[test]
fn a_restored_team_continues_with_the_same_bits() {
    let config = HyperAgent {
        draw: IndexDraw::EveryRound,
        sigma: ranged_number(0.1),
        ..config()
    };
    let [mut original, mut restored] = [0, 1].map(|_| hyper_team(&config, 3));
    original.begin_round(5);
    learn(&mut original, 30);
    restored.restore(&original.save()).unwrap();
    assert_eq!(original.tensors(), restored.tensors());
    for team in [&mut original, &mut restored] {
        team.begin_round(6);
        learn(team, 30);
    }
    assert_eq!(original.save(), restored.save());
    let mut other = team(super::config::QLearning::default().compose(3), 3, 0.0);
    assert!(other.restore(&original.save()).is_err());
    assert!(original.restore(&other.save()).is_err());
}

/// Every process trains the network with the same bits; the one of agent 0 passes it on, and each has
/// the indices of its own agents.
#[test]
fn processes_have_the_bits_of_a_team_in_one() {
    let composition = config().compose(5);
    let [mut whole, mut first, mut second] = [None, Some((0, 2)), Some((2, 5))]
        .map(|local| team_in_process(composition.clone(), 5, 0.0, local));
    for team in [&mut whole, &mut first, &mut second] {
        learn(team, 3);
    }
    assert_eq!(whole.save().parts, first.save().parts);
    assert_eq!(second.save().parts, Vec::<Vec<u8>>::new());
    for agent in 0..5 {
        assert_eq!(values(&mut whole, agent, 5), values(&mut second, agent, 5));
    }
    let names = |team: &ValueTeam| -> std::collections::BTreeSet<String> {
        team.tensors()
            .into_iter()
            .map(|tensor| tensor.name)
            .collect()
    };
    let both: std::collections::BTreeSet<String> =
        names(&first).union(&names(&second)).cloned().collect();
    assert_eq!(names(&whole), both);
    assert!(names(&first).is_disjoint(&names(&second)));
    assert!(names(&second).contains("agent_4.index"));
}

#[test]
fn agents_act_greedily_by_their_own_values() {
    let mut team = hyper_team(&config(), 2);
    let own = [0, 1].map(|agent| values(&mut team, agent, 2));
    let mut random = [0, 1].map(|agent| stream(3, Purpose::Action, agent, 0).into());
    let (mut actions, mut log_probs) = ([9.0; 2], [9.0; 2]);
    for state in 0..3 {
        let observations = [observation(state), observation(state)].concat();
        let mut request = ActionRequest {
            first_agent: 0,
            unreported_steps: 0,
            steps: &[0, 0],
            observations: &observations,
            playing: &[true, true],
            random: &mut random,
            actions: &mut actions,
            log_probs: &mut log_probs,
        };
        team.act(&mut request, &mut ActScratch::default());
        for agent in 0..2 {
            let [left, right] = [own[agent][2 * state], own[agent][2 * state + 1]];
            assert_eq!(
                actions[agent],
                f32::from(u8::from(right > left)),
                "{state} {agent}"
            );
        }
    }
}
