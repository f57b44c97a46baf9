//! Every estimate and loss that a scenario can select.

use super::*;
use crate::agent::action_selection::ActionSelection;
use crate::algorithms::AlgorithmConfig;

const UNWEIGHTED: ValueTarget = ValueTarget::MonteCarlo {
    importance: Importance::Off,
    ratio_product_cap: None,
};

/// With every estimate and loss that is allowed on the agent's own data, a rewarded action becomes
/// more likely.
#[test]
fn every_combination_learns_from_own_data() {
    for (target, advantage, loss) in
        combinations(&value_targets(), &advantage_estimates(), &policy_losses())
    {
        let config = SeedPg {
            value_target: target.into(),
            advantage: advantage.into(),
            policy_loss: loss.into(),
            ..own_data()
        };
        assert_eq!(config.check(), Ok(()), "{target:?} {advantage:?} {loss:?}");
        let increase = probability_increase(config);
        assert!(
            increase > 0.02,
            "{target:?} {advantage:?} {loss:?}: {increase}"
        );
    }
}

/// Every kind of value target that is allowed on the agent's own data.
fn value_targets() -> [ValueTarget; 5] {
    [
        ValueTarget::MonteCarlo {
            importance: Importance::Off,
            ratio_product_cap: None,
        },
        ValueTarget::MonteCarlo {
            importance: Importance::Ordinary,
            ratio_product_cap: Some(ranged_number(1.0)),
        },
        ValueTarget::Td {
            importance: Importance::PerDecision,
            ratio_cap: None,
        },
        ValueTarget::Gae {
            lambda: ranged_number(0.95),
        },
        ValueTarget::VTrace(VTrace::default()),
    ]
}

/// Every kind of advantage estimate that is allowed on the agent's own data.
fn advantage_estimates() -> [AdvantageEstimate; 6] {
    [
        AdvantageEstimate::MonteCarlo {
            importance: RatioCount::Double,
            baseline: Baseline::Off,
        },
        AdvantageEstimate::MonteCarlo {
            importance: RatioCount::Single,
            baseline: Baseline::Mean,
        },
        AdvantageEstimate::NStep {
            segment: ranged_count(3),
        },
        AdvantageEstimate::Gae {
            lambda: ranged_number(0.95),
        },
        AdvantageEstimate::Retrace {
            lambda: ranged_number(0.95),
        },
        AdvantageEstimate::VTrace(VTrace::default()),
    ]
}

/// Every kind of policy loss.
fn policy_losses() -> [PolicyLoss; 4] {
    [
        PolicyLoss::Ppo {
            clip: ranged_number(0.2),
            clipping: Clipping::Joint,
        },
        PolicyLoss::Ppo {
            clip: ranged_number(0.2),
            clipping: Clipping::DimensionWise,
        },
        PolicyLoss::SimplePg,
        PolicyLoss::OffPac { ratio_cap: None },
    ]
}

/// With other minibatches, scalings, time limits and optimizer settings, a rewarded action becomes
/// more likely.
#[test]
fn other_settings_learn_from_own_data() {
    let variants = [
        SeedPg {
            minibatch: Minibatch::Steps(ranged_count(4)),
            epochs: ranged_count(2),
            ..own_data()
        },
        SeedPg {
            standardize: Standardization::PerTrajectory,
            ..own_data()
        },
        SeedPg {
            standardize: Standardization::PerMinibatch,
            minibatch: Minibatch::Steps(ranged_count(3)),
            ..own_data()
        },
        SeedPg {
            time_limit: TimeLimit::Bootstraps,
            ..own_data()
        },
        SeedPg {
            observations: ObservationScaling::Running,
            ..own_data()
        },
        SeedPg {
            observations: ObservationScaling::Range,
            gradient_clip: Some(ranged_number(0.1)),
            ..own_data()
        },
        SeedPg {
            returns: ReturnNormalization::Raw,
            entropy_bonus: ranged_number(0.001),
            ..own_data()
        },
    ];
    for config in variants {
        let increase = probability_increase(config.clone());
        assert!(increase > 0.02, "{config:?}: {increase}");
    }
}

fn combinations<A: Copy, B: Copy, C: Copy>(a: &[A], b: &[B], c: &[C]) -> Vec<(A, B, C)> {
    a.iter()
        .flat_map(|&a| {
            b.iter()
                .flat_map(move |&b| c.iter().map(move |&c| (a, b, c)))
        })
        .collect()
}

/// Increase of the mean probability of a rewarded action after 40 updates, each on an episode
/// played by the present policy.
fn probability_increase(mut config: SeedPg) -> f32 {
    config.policy_optimizer.step_size = ranged_number(0.01);
    config.value_optimizer.step_size = ranged_number(0.01);
    let mut learner = agent(&config, 0, 0.0);
    let mut random = stream(3, Purpose::Action, 0, 0).into();
    let before = probability_of_action_0(&learner);
    for round in 0..40 {
        let played = play(&learner, &mut random);
        update_on(&mut learner, &[played], round);
    }
    probability_of_action_0(&learner) - before
}

/// An episode of six steps played by the present policy, with reward 1 for action 0 and −1 for
/// action 1.
fn play(learner: &SeedPgAgent, random: &mut ActionRandom) -> Episode {
    let mut played = Episode {
        outcome: Status::Truncated,
        ..episode(0)
    };
    let mut scratch = ActScratch::default();
    for step in 0..6 {
        let observation = &played.observations[2 * step..2 * step + 2];
        let (action, log_prob) = (
            &mut played.actions[step..=step],
            &mut played.log_probs[step..=step],
        );
        learner.act(observation, random, &mut scratch, action, log_prob);
        played.rewards[step] = 1.0 - 2.0 * action[0];
    }
    played
}

/// Mean probability of action 0 in the six states of [`episode`].
fn probability_of_action_0(learner: &SeedPgAgent) -> f32 {
    let mut probabilities = vec![];
    let (mut action, mut log_prob) = ([0.0], [0.0]);
    let episode = episode(0);
    for (step, observation) in episode.states().chunks_exact(2).enumerate() {
        let mut random = stream(4, Purpose::Action, 0, step as u32).into();
        learner.act(
            observation,
            &mut random,
            &mut ActScratch::default(),
            &mut action,
            &mut log_prob,
        );
        let probability = log_prob[0].exp();
        probabilities.push(if action[0] == 0.0 {
            probability
        } else {
            1.0 - probability
        });
    }
    probabilities.iter().sum::<f32>() / probabilities.len() as f32
}

fn with_value_target(target: ValueTarget, config: SeedPg) -> SeedPg {
    SeedPg {
        value_target: target.into(),
        ..config
    }
}

fn with_advantage(advantage: AdvantageEstimate, config: SeedPg) -> SeedPg {
    SeedPg {
        advantage: advantage.into(),
        ..config
    }
}

#[test]
fn losses_and_actions_that_do_not_fit_are_errors() {
    let invalid = [
        SeedPg {
            policy_loss: PolicyLoss::SimplePg.into(),
            ..SeedPg::default()
        },
        SeedPg {
            policy_loss: PolicyLoss::SimplePg.into(),
            epochs: ranged_count(2),
            ..own_data()
        },
        SeedPg {
            actions: ActionSelection::Greedy.into(),
            ..own_data()
        },
        SeedPg {
            hidden: Vec::new().into(),
            ..own_data()
        },
    ];
    assert!(invalid.iter().all(|config| config.check().is_err()));
    let greedy = SeedPg {
        actions: ActionSelection::Greedy.into(),
        policy_loss: PolicyLoss::SimplePg.into(),
        ..with_value_target(UNWEIGHTED, own_data())
    };
    assert_eq!(greedy.check(), Ok(()));
}

#[test]
fn estimates_that_do_not_fit_the_data_are_errors() {
    let own_values = SeedPg {
        value_data: Data::Own,
        ..SeedPg::default()
    };
    let n_step = |steps| AdvantageEstimate::NStep {
        segment: ranged_count(steps),
    };
    let lambda = ranged_number(0.9);
    let ordinary_td = ValueTarget::Td {
        importance: Importance::Ordinary,
        ratio_cap: None,
    };
    let invalid = [
        with_value_target(UNWEIGHTED, SeedPg::default()),
        with_value_target(UNWEIGHTED, own_values),
        with_value_target(ValueTarget::Gae { lambda }, SeedPg::default()),
        with_value_target(ordinary_td, own_data()),
        with_advantage(AdvantageEstimate::Gae { lambda }, SeedPg::default()),
        with_advantage(n_step(5), SeedPg::default()),
    ];
    assert!(invalid.iter().all(|config| config.check().is_err()));
    let single_step = with_advantage(n_step(1), SeedPg::default());
    assert_eq!(single_step.check(), Ok(()));
}
