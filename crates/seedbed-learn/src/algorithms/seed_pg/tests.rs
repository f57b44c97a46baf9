//! Seed-PG on hand-made episodes of two observations and one binary action.

use super::config::*;
use super::*;
use crate::agent::TeamConfig;
use crate::agent::policy::ActionSelection;
use crate::agent::scaling::ObservationScaling;
use crate::algorithms::AlgorithmConfig;
use crate::nn::Initial;
use crate::seed::SeedDistribution;
use seedbed_env::input::numbers::{known, known_count};
use seedbed_env::{Action, Choice, Quantity, Spec, Status};

fn spec() -> Spec {
    let quantity = |name: &str| Quantity {
        name: name.to_owned(),
        unit: String::new(),
        range: [-1.0, 1.0],
    };
    Spec {
        observations: vec![quantity("x"), quantity("y")],
        actions: vec![Action {
            quantity: quantity("push"),
            choice: Choice::Discrete(vec![-1.0, 1.0]),
        }],
        time_limit: 8,
        ..Spec::new("test", Vec::new(), Vec::new())
    }
}

fn agent(config: &SeedPg, number: u32, sigma: f64) -> SeedPgAgent {
    let seeds = SeedDistribution::Normal {
        sigma: known(sigma),
    };
    let team = TeamConfig {
        count: known_count(2),
        seeds,
        initial: Initial::Random,
    };
    SeedPgAgent::new(
        config,
        &AgentContext {
            run_seed: 1,
            agent: number,
            team: &team,
            spec: &spec(),
            record_advantages: false,
        },
    )
}

/// Six steps; every behaviour probability is a half.
fn episode(agent: u32) -> Episode {
    let wave =
        |count: usize, phase: f32| (0..count).map(|i| (i as f32 * 0.9 + phase).sin()).collect();
    Episode {
        observations: wave(14, agent as f32),
        actions: vec![0.0, 1.0, 1.0, 0.0, 1.0, 0.0],
        rewards: wave(6, 0.3),
        log_probs: vec![0.5_f32.ln(); 6],
        outcome: Status::Terminated,
        ..Episode::start(agent, 0, 0, &spec())
    }
}

fn update(learner: &mut SeedPgAgent, agents: impl IntoIterator<Item = u32>, round: u32) -> Update {
    update_on(
        learner,
        &agents.into_iter().map(episode).collect::<Vec<_>>(),
        round,
    )
}

fn update_on(learner: &mut SeedPgAgent, fresh: &[Episode], round: u32) -> Update {
    learner.update(&Experience {
        fresh,
        kept: fresh,
        round,
    })
}

fn parameters(agent: &SeedPgAgent) -> Vec<f32> {
    agent
        .tensors()
        .iter()
        .flat_map(|tensor| tensor.values.to_vec())
        .collect()
}

/// G̃ of another agent's trajectory is that of its rewards plus one's own seeds, by the step within
/// the episode (Eq. 18).
#[test]
fn ones_own_seeds_perturb_anybodys_rewards() {
    let mut seeded = agent(&SeedPg::default(), 0, 0.5);
    let mut plain = agent(&SeedPg::default(), 0, 0.0);
    let mut shifted = episode(1);
    shifted
        .rewards
        .iter_mut()
        .zip(&seeded.reward_seeds)
        .for_each(|(reward, seed)| *reward += seed);
    for (learner, episode) in [(&mut seeded, &episode(1)), (&mut plain, &shifted)] {
        learner.estimate(episode, 0);
    }
    assert_eq!(seeded.work.samples.targets, plain.work.samples.targets);
    assert_eq!(
        seeded.work.samples.advantages,
        plain.work.samples.advantages
    );
    assert!(
        seeded.reward_seeds.iter().any(|seed| seed.abs() > 0.1),
        "{:?}",
        seeded.reward_seeds
    );
}

#[test]
fn ratios_are_those_of_the_two_policies() {
    let mut learner = agent(&SeedPg::default(), 0, 0.0);
    learner.estimate(&episode(1), 0);
    let expected: Vec<f32> = learner
        .work
        .log_probs
        .iter()
        .map(|log_prob| log_prob.exp() / 0.5)
        .collect();
    assert!(
        learner
            .work
            .ratios
            .iter()
            .zip(&expected)
            .all(|(ratio, expected)| (ratio - expected).abs() < 1e-5)
    );
}

#[test]
fn own_data_ignores_the_others() {
    let own = SeedPg {
        value_data: Data::Own,
        policy_data: Data::Own,
        ..SeedPg::default()
    };
    let (mut alone, mut among_others) = (agent(&own, 0, 0.1), agent(&own, 0, 0.1));
    update(&mut alone, [0], 0);
    update(&mut among_others, [0, 1], 0);
    assert_eq!(parameters(&alone), parameters(&among_others));

    let mut shared = agent(&SeedPg::default(), 0, 0.1);
    update(&mut shared, [0, 1], 0);
    assert_ne!(parameters(&alone), parameters(&shared));
}

/// On-policy Seed-PG (§3.4.1): the value function learns from all, the policy from its own.
#[test]
fn value_data_and_policy_data_are_told_apart() {
    let config = SeedPg {
        policy_data: Data::Own,
        ..SeedPg::default()
    };
    let mut learner = agent(&config, 0, 0.1);
    let before = (
        learner.policy.network().parameters().to_vec(),
        learner.value.parameters().to_vec(),
    );
    update(&mut learner, [1], 0);
    assert_eq!(learner.policy.network().parameters(), before.0);
    assert_ne!(learner.value.parameters(), before.1);
}

/// A strong pull keeps parameters nearer to the seed than none does.
#[test]
fn the_regulariser_pulls_to_the_seed() {
    let distance = |regularisation| {
        let config = SeedPg {
            regularisation: known(regularisation),
            ..SeedPg::default()
        };
        let mut learner = agent(&config, 0, 0.1);
        let seed = learner.policy.network().parameters().to_vec();
        for round in 0..50 {
            update(&mut learner, [0, 1], round);
        }
        seed.iter()
            .zip(learner.policy.network().parameters())
            .map(|(a, b)| (a - b).powi(2))
            .sum::<f32>()
            .sqrt()
    };
    assert!(
        distance(10.0) < 0.5 * distance(0.0),
        "{} {}",
        distance(10.0),
        distance(0.0)
    );
}

/// A policy whose first action is rewarded comes to prefer it.
#[test]
fn rewarded_actions_become_likelier() {
    let mut config = SeedPg::default();
    config.policy_optimiser.step_size = known(0.01);
    let mut learner = agent(&config, 0, 0.0);
    let mut rewarded = episode(0);
    rewarded.rewards = rewarded
        .actions
        .iter()
        .map(|&action| 1.0 - 2.0 * action)
        .collect();
    learner.estimate(&rewarded, 0);
    let before = learner.work.log_probs.clone();
    update_on(&mut learner, std::slice::from_ref(&rewarded), 0);
    learner.estimate(&rewarded, 0);
    for (step, action) in rewarded.actions.iter().enumerate() {
        let gained = learner.work.log_probs[step] - before[step];
        assert!(
            if *action == 0.0 {
                gained > 0.0
            } else {
                gained < 0.0
            },
            "step {step}: {gained}"
        );
    }
}

#[test]
fn a_restored_agent_goes_on_to_the_same_bits() {
    let (mut original, mut restored) = (
        agent(&SeedPg::default(), 0, 0.1),
        agent(&SeedPg::default(), 0, 0.1),
    );
    update(&mut original, [0, 1], 0);
    restored.restore(&original.save()).unwrap();
    let reports = [&mut original, &mut restored].map(|learner| update(learner, [0, 1], 1));
    assert_eq!(reports[0], reports[1]);
    assert_eq!(parameters(&original), parameters(&restored));
    assert!(restored.restore(&[1, 2, 3]).is_err());
}

/// γ is ½, and nothing is weighed, added or subtracted: rewards of 4, 2, 8 return 4 + ½ (2 + ½ 8) =
/// 7, 2 + ½ 8 = 6 and 8; the agent's other episode of a single 1 returns 1. What others did is not
/// recorded_advantages, and neither is what standardising makes of it.
#[test]
fn advantages_of_ones_own_steps_are_noted() {
    let config = SeedPg {
        value_data: Data::Own,
        policy_data: Data::Own,
        value_target: ValueTarget::MonteCarlo {
            importance: Importance::Off,
            ratio_product_cap: None,
        }
        .into(),
        advantage: AdvantageEstimate::MonteCarlo {
            importance: RatioCount::Single,
            baseline: Baseline::Off,
        }
        .into(),
        standardise: Standardization::PerTrajectory,
        discount: known(0.5),
        ..SeedPg::default()
    };
    let rewarded = |agent, rewards: &[f32]| Episode {
        observations: vec![0.1; 2 * rewards.len() + 2],
        actions: vec![1.0; rewards.len()],
        log_probs: vec![0.5_f32.ln(); rewards.len()],
        rewards: rewards.to_vec(),
        ..episode(agent)
    };
    let mut learner = with_recorded_advantages(agent(&config, 1, 0.0));
    let first = update_on(
        &mut learner,
        &[
            rewarded(0, &[3.0]),
            rewarded(1, &[4.0, 2.0, 8.0]),
            rewarded(1, &[]),
            rewarded(1, &[1.0]),
        ],
        0,
    );
    assert_eq!(advantages(&first), [7.0, 6.0, 8.0, 1.0]);
    let second = update_on(&mut learner, &[rewarded(1, &[5.0])], 1);
    assert_eq!(advantages(&second), [5.0]);
}

/// Recorded advantages are what the agent estimated before it learned, and it learns the same as
/// one that records nothing.
#[test]
fn noting_advantages_changes_nothing() {
    let variants = [
        SeedPg {
            sharing: Sharing::Sampled {
                trajectories: known_count(1),
            },
            epochs: known_count(3),
            ..SeedPg::default()
        },
        SeedPg {
            minibatch: Minibatch::Steps(known_count(4)),
            observations: ObservationScaling::Running,
            ..SeedPg::default()
        },
        SeedPg {
            standardise: Standardization::PerTrajectory,
            time_limit: TimeLimit::Bootstraps,
            ..SeedPg::default()
        },
    ];
    for config in variants {
        let (mut with, mut without) = (
            with_recorded_advantages(agent(&config, 1, 0.5)),
            agent(&config, 1, 0.5),
        );
        for round in 0..3 {
            let mut before = agent(&config, 1, 0.5);
            before.restore(&without.save()).unwrap();
            before.estimate(&episode(1), 1);
            let [ours, theirs] =
                [&mut with, &mut without].map(|learner| update(learner, 0..3, round));
            assert_eq!((ours.report, with.save()), (theirs.report, without.save()));
            let expected = &before.work.samples.advantages;
            assert_eq!(&advantages(&ours), expected, "{config:?}");
            assert!(theirs.step_data.is_empty());
        }
    }
}

fn with_recorded_advantages(agent: SeedPgAgent) -> SeedPgAgent {
    SeedPgAgent {
        record_advantages: true,
        ..agent
    }
}

/// The advantages of all own episodes, one episode after the other.
fn advantages(update: &Update) -> Vec<f32> {
    let step_data = update.step_data.iter();
    step_data
        .flat_map(|data| data.advantages.iter().copied())
        .collect()
}

/// Every estimator, loss and minibatch that goes with the agent's own data makes a rewarded action
/// likelier.
#[test]
fn every_combination_learns_from_own_data() {
    let targets = [
        ValueTarget::MonteCarlo {
            importance: Importance::Off,
            ratio_product_cap: None,
        },
        ValueTarget::MonteCarlo {
            importance: Importance::Ordinary,
            ratio_product_cap: Some(known(1.0)),
        },
        ValueTarget::Td {
            importance: Importance::PerDecision,
            ratio_cap: None,
        },
        ValueTarget::Gae {
            lambda: known(0.95),
        },
        ValueTarget::VTrace(VTrace::default()),
    ];
    let advantages = [
        AdvantageEstimate::MonteCarlo {
            importance: RatioCount::Double,
            baseline: Baseline::Off,
        },
        AdvantageEstimate::MonteCarlo {
            importance: RatioCount::Single,
            baseline: Baseline::Mean,
        },
        AdvantageEstimate::NStep {
            segment: known_count(3),
        },
        AdvantageEstimate::Gae {
            lambda: known(0.95),
        },
        AdvantageEstimate::Retrace {
            lambda: known(0.95),
        },
        AdvantageEstimate::VTrace(VTrace::default()),
    ];
    let losses = [
        PolicyLoss::Ppo {
            clip: known(0.2),
            clipping: Clipping::Joint,
        },
        PolicyLoss::Ppo {
            clip: known(0.2),
            clipping: Clipping::DimensionWise,
        },
        PolicyLoss::SimplePg,
        PolicyLoss::OffPac { ratio_cap: None },
    ];
    for (target, advantage, loss) in every(&targets, &advantages, &losses) {
        let config = SeedPg {
            value_data: Data::Own,
            policy_data: Data::Own,
            value_target: target.into(),
            advantage: advantage.into(),
            policy_loss: loss.into(),
            ..SeedPg::default()
        };
        assert_eq!(config.check(), Ok(()), "{target:?} {advantage:?} {loss:?}");
        let gained = gain_of_a_rewarded_action(config);
        assert!(gained > 0.02, "{target:?} {advantage:?} {loss:?}: {gained}");
    }
}

#[test]
fn other_ways_to_learn_learn_too() {
    let base = SeedPg {
        value_data: Data::Own,
        policy_data: Data::Own,
        ..SeedPg::default()
    };
    let variants = [
        SeedPg {
            minibatch: Minibatch::Steps(known_count(4)),
            epochs: known_count(2),
            ..base.clone()
        },
        SeedPg {
            standardise: Standardization::PerTrajectory,
            ..base.clone()
        },
        SeedPg {
            standardise: Standardization::PerMinibatch,
            minibatch: Minibatch::Steps(known_count(3)),
            ..base.clone()
        },
        SeedPg {
            time_limit: TimeLimit::Bootstraps,
            ..base.clone()
        },
        SeedPg {
            observations: ObservationScaling::Running,
            ..base.clone()
        },
        SeedPg {
            observations: ObservationScaling::Range,
            gradient_clip: Some(known(0.1)),
            ..base.clone()
        },
        SeedPg {
            returns: ReturnNormalisation::Raw,
            entropy_bonus: known(0.001),
            ..base
        },
    ];
    for config in variants {
        let gained = gain_of_a_rewarded_action(config.clone());
        assert!(gained > 0.02, "{config:?}: {gained}");
    }
}

fn every<A: Copy, B: Copy, C: Copy>(a: &[A], b: &[B], c: &[C]) -> Vec<(A, B, C)> {
    a.iter()
        .flat_map(|&a| {
            b.iter()
                .flat_map(move |&b| c.iter().map(move |&c| (a, b, c)))
        })
        .collect()
}

/// By how much π of the rewarded action grew, on average, in 40 updates on episodes drawn from the
/// policy as it goes.
fn gain_of_a_rewarded_action(mut config: SeedPg) -> f32 {
    config.policy_optimiser.step_size = known(0.01);
    config.value_optimiser.step_size = known(0.01);
    let mut learner = agent(&config, 0, 0.0);
    let mut random = stream(3, Purpose::Action, 0, 0);
    let before = probability_of_action_0(&learner);
    for round in 0..40 {
        let played = play(&learner, &mut random);
        update_on(&mut learner, &[played], round);
    }
    probability_of_action_0(&learner) - before
}

fn play(learner: &SeedPgAgent, random: &mut Stream) -> Episode {
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

fn probability_of_action_0(learner: &SeedPgAgent) -> f32 {
    let mut probabilities = vec![];
    let (mut action, mut log_prob) = ([0.0], [0.0]);
    let episode = episode(0);
    for (step, observation) in episode.states().chunks_exact(2).enumerate() {
        let mut random = stream(4, Purpose::Action, 0, step as u32);
        learner.act(
            observation,
            &mut random,
            &mut ActScratch::default(),
            &mut action,
            &mut log_prob,
        );
        let chosen = log_prob[0].exp();
        probabilities.push(if action[0] == 0.0 {
            chosen
        } else {
            1.0 - chosen
        });
    }
    probabilities.iter().sum::<f32>() / probabilities.len() as f32
}

/// Where a time limit bootstraps, the last return is r + γ v(`s_T`); where it ends, r alone. A
/// termination always ends.
#[test]
fn a_time_limit_bootstraps_if_asked() {
    let last_target = |time_limit, outcome| {
        let config = SeedPg {
            time_limit,
            value_data: Data::Own,
            value_target: ValueTarget::MonteCarlo {
                importance: Importance::Off,
                ratio_product_cap: None,
            }
            .into(),
            ..SeedPg::default()
        };
        let mut learner = agent(&config, 0, 0.0);
        let episode = Episode {
            outcome,
            ..episode(0)
        };
        learner.estimate(&episode, 0);
        let value = learner.value.forward(episode.last_observation())[0];
        (
            learner.work.samples.targets[5] - episode.rewards[5],
            0.99 * value,
        )
    };
    let (bootstrapped, value) = last_target(TimeLimit::Bootstraps, Status::Truncated);
    assert!(
        (bootstrapped - value).abs() < 1e-6 && value.abs() > 1e-3,
        "{bootstrapped} {value}"
    );
    assert_eq!(
        last_target(TimeLimit::Bootstraps, Status::Terminated).0,
        0.0
    );
    assert_eq!(last_target(TimeLimit::Ends, Status::Truncated).0, 0.0);
}

/// With sharing limited to two, an agent learns from its own episode and two of the others, not the
/// same ones each round.
#[test]
fn sharing_can_be_limited() {
    let config = SeedPg {
        sharing: Sharing::Sampled {
            trajectories: known_count(2),
        },
        ..SeedPg::default()
    };
    let mut learner = agent(&config, 3, 0.0);
    let fresh: Vec<Episode> = (0..8).map(episode).collect();
    let mut chosen = |round| {
        learner.choose_episodes(&fresh, &mut stream(1, Purpose::Shuffle, 3, round));
        learner.work.order.clone()
    };
    let rounds: Vec<Vec<usize>> = (0..20).map(&mut chosen).collect();
    assert!(
        rounds
            .iter()
            .all(|order| order.len() == 3 && order.contains(&3) && order.is_sorted())
    );
    assert!(
        (0..8).all(|agent| rounds.iter().any(|order| order.contains(&agent))),
        "{rounds:?}"
    );
}

/// Linear from 1 to 0.1 over 10 rounds: 0.55 after 5, and 0.1 from 10 on.
#[test]
fn step_sizes_follow_their_schedule() {
    let schedule = StepSizeSchedule::Linear {
        rounds: known_count(10),
        to: known(0.1),
    };
    assert!((schedule.factor(5) - 0.55).abs() < 1e-12 && (schedule.factor(10) - 0.1).abs() < 1e-12);
    assert_eq!(
        (schedule.factor(0), schedule.factor(99)),
        (1.0, schedule.factor(10))
    );
}

/// What the mathematics forbids, by the first words of the error.
#[test]
fn contradictions_are_told() {
    let own = SeedPg {
        value_data: Data::Own,
        policy_data: Data::Own,
        ..SeedPg::default()
    };
    let unweighed = ValueTarget::MonteCarlo {
        importance: Importance::Off,
        ratio_product_cap: None,
    };
    let wrong = [
        SeedPg {
            policy_loss: PolicyLoss::SimplePg.into(),
            ..SeedPg::default()
        },
        SeedPg {
            policy_loss: PolicyLoss::SimplePg.into(),
            epochs: known_count(2),
            ..own.clone()
        },
        SeedPg {
            value_target: unweighed.into(),
            ..SeedPg::default()
        },
        SeedPg {
            value_target: unweighed.into(),
            value_data: Data::Own,
            ..SeedPg::default()
        },
        SeedPg {
            value_target: ValueTarget::Gae { lambda: known(0.9) }.into(),
            ..SeedPg::default()
        },
        SeedPg {
            advantage: AdvantageEstimate::Gae { lambda: known(0.9) }.into(),
            ..SeedPg::default()
        },
        SeedPg {
            advantage: AdvantageEstimate::NStep {
                segment: known_count(5),
            }
            .into(),
            ..SeedPg::default()
        },
        SeedPg {
            value_target: ValueTarget::Td {
                importance: Importance::Ordinary,
                ratio_cap: None,
            }
            .into(),
            ..own.clone()
        },
        SeedPg {
            actions: ActionSelection::Greedy.into(),
            ..own.clone()
        },
        SeedPg {
            hidden: Vec::new().into(),
            ..own.clone()
        },
    ];
    assert!(wrong.iter().all(|config| config.check().is_err()));
    let greedy = SeedPg {
        actions: ActionSelection::Greedy.into(),
        policy_loss: PolicyLoss::SimplePg.into(),
        value_target: unweighed.into(),
        ..own
    };
    assert_eq!(greedy.check(), Ok(()));
    assert_eq!(
        SeedPg {
            advantage: AdvantageEstimate::NStep {
                segment: known_count(1)
            }
            .into(),
            ..SeedPg::default()
        }
        .check(),
        Ok(())
    );
}
