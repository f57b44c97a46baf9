//! Networks that the team shares.

use super::*;
use crate::nn::AdamSettings;
use crate::seed::SameInitial;
use seedbed_input::numbers::Positive;

const AGENTS: u32 = 2;
/// Number of parameters of the first layer of `config`: weights, biases.
const WEIGHTS: usize = 2 * 4;
const BIASES: usize = 4;

/// One gradient step on all own steps. ε is so large that the first step of Adam is α g/ε: a step along
/// the gradient.
fn config(networks: Networks) -> SeedPg {
    let optimizer = AdamSettings {
        step_size: ranged_number::<NonNegative>(1e3),
        epsilon: ranged_number::<Positive>(1e5),
        ..AdamSettings::default()
    };
    SeedPg {
        networks: networks.into(),
        hidden: vec![ranged_count(4)].into(),
        minibatch: Minibatch::Steps(ranged_count(100)),
        returns: ReturnNormalization::Raw,
        policy_optimizer: optimizer,
        value_optimizer: optimizer,
        entropy_bonus: ranged_number(0.1),
        ..own_data()
    }
}

fn team(config: &SeedPg, same_initial: SameInitial) -> Box<dyn Team> {
    let team = TeamConfig {
        count: ranged_count(AGENTS),
        same_initial: same_initial.into(),
        ..TeamConfig::default()
    };
    build_team(config, &team, None)
}

fn learn(team: &mut dyn Team, round: u32) -> Vec<AgentUpdate> {
    let episodes: Vec<Episode> = (0..AGENTS).map(episode).collect();
    let lengths = [6; AGENTS as usize];
    learn_in_round(team, 0..AGENTS, (&episodes, &lengths), round)
}

/// All parameters of an agent's network, in their order.
fn network(team: &dyn Team, agent: u32, role: &str) -> Vec<f32> {
    let prefix = format!("agent_{agent}.{role}.layer_");
    let tensors = team.tensors().into_iter();
    let of_network = tensors.filter(|tensor| tensor.name.starts_with(&prefix));
    of_network
        .flat_map(|tensor| tensor.values.to_vec())
        .collect()
}

/// How far each parameter moved in a gradient step.
fn moves(networks: Networks, role: &str) -> [Vec<f32>; 2] {
    let mut team = team(&config(networks), SameInitial::Both);
    let before = [0, 1].map(|agent| network(&*team, agent, role));
    learn(&mut *team, 0);
    let after = [0, 1].map(|agent| network(&*team, agent, role));
    [0, 1].map(|agent: usize| {
        let pairs = after[agent].iter().zip(&before[agent]);
        pairs.map(|(after, before)| after - before).collect()
    })
}

/// The loss is the mean over the steps of both agents, which have as many. So shared parameters move by
/// the mean m of the moves a and b of two agents that begin with the same networks of their own; a bias of
/// agent k in the first layer also moves by half of its own move, as its code is 1 in half of the steps.
#[test]
fn shared_networks_follow_the_gradient_of_all_losses() {
    for role in ["policy", "value"] {
        let own = moves(Networks::Own, role);
        let shared = moves(Networks::Shared, role);
        let biases = WEIGHTS..WEIGHTS + BIASES;
        for agent in 0..2 {
            for index in 0..own[0].len() {
                let mean = 0.5 * (own[0][index] + own[1][index]);
                let further = if biases.contains(&index) {
                    0.5 * own[agent][index]
                } else {
                    0.0
                };
                let (moved, expected) = (shared[agent][index], mean + further);
                let tolerance = 0.02 * expected.abs().max(1e-4);
                assert!(
                    (moved - expected).abs() < tolerance,
                    "{role} of agent {agent}, parameter {index}: {moved}; expected {expected}"
                );
            }
        }
        assert!(own[0].iter().all(|moved| moved.abs() < 0.02), "{own:?}");
        assert!(own[0].iter().any(|moved| moved.abs() > 1e-4), "{own:?}");
    }
}

/// Only biases of the first layer are an agent's own, at the start (those that it would have with networks of
/// its own) and later. Gradient steps are counted once.
#[test]
fn only_first_biases_are_an_agents_own() {
    let config = config(Networks::Shared);
    let mut shared = team(&config, SameInitial::Off);
    let own = team(&self::config(Networks::Own), SameInitial::Off);
    let own_biases = WEIGHTS..WEIGHTS + BIASES;
    for round in 0..3 {
        for role in ["policy", "value"] {
            let [first, second] = [0, 1].map(|agent| network(&*shared, agent, role));
            for (index, (first, second)) in first.iter().zip(&second).enumerate() {
                assert_eq!(
                    first != second,
                    own_biases.contains(&index),
                    "{role} {index}"
                );
            }
            if round == 0 {
                let expected = network(&*own, 1, role);
                let pairs = second[own_biases.clone()]
                    .iter()
                    .zip(&expected[own_biases.clone()]);
                assert!(
                    pairs
                        .into_iter()
                        .all(|(bias, own)| (bias - own).abs() < 1e-6)
                );
            }
        }
        let updates = learn(&mut *shared, round);
        let steps = updates
            .iter()
            .map(|update| update.update.report.gradient_steps);
        assert!(steps.eq([Some(2), Some(0)]));
    }
}

/// A saved team continues with the same bits.
#[test]
fn shared_networks_are_restored() {
    let config = SeedPg {
        observations: ObservationScaling::Running,
        returns: ReturnNormalization::PopArt {
            beta: ranged_number(0.1),
        },
        ..config(Networks::Shared)
    };
    let mut uninterrupted = team(&config, SameInitial::Off);
    learn(&mut *uninterrupted, 0);
    let saved = uninterrupted.save();
    let expected = learn(&mut *uninterrupted, 1);
    let mut restored = team(&config, SameInitial::Off);
    restored.restore(&saved).unwrap();
    assert_eq!(learn(&mut *restored, 1), expected);
    assert_eq!(restored.tensors(), uninterrupted.tensors());
    assert_ne!(restored.save(), saved);
}

#[test]
fn shared_networks_need_minibatches_of_steps() {
    let whole = SeedPg {
        minibatch: Minibatch::Trajectory,
        ..config(Networks::Shared)
    };
    assert!(whole.check().is_err() && config(Networks::Shared).check().is_ok());
}
