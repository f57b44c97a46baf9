//! What one update does to the networks, and what it reports.

use super::*;

/// The learning agent adds its own reward seed `z_{k,t+1}` to the reward of step t of another
/// agent's episode (Eq. 18): targets equal those of an episode whose rewards already include the
/// seeds.
#[test]
fn seeds_of_the_learning_agent_perturb_the_rewards_of_all_agents() {
    let mut seeded = agent(&SeedPg::default(), 0, 0.5);
    let mut plain = agent(&SeedPg::default(), 0, 0.0);
    let RewardPerturbation::Steps(seeds) = seeded.perturbation.clone() else {
        panic!("{:?}", seeded.perturbation);
    };
    let mut shifted = episode(1);
    let rewards = shifted.rewards.iter_mut().zip(&seeds);
    rewards.for_each(|(reward, seed)| *reward += seed);
    for (learner, episode) in [(&mut seeded, &episode(1)), (&mut plain, &shifted)] {
        learner.estimate(episode, 0);
    }
    assert_eq!(seeded.work.samples.targets, plain.work.samples.targets);
    assert_eq!(
        seeded.work.samples.advantages,
        plain.work.samples.advantages
    );
    assert!(seeds.iter().any(|seed| seed.abs() > 0.1), "{seeds:?}");
}

/// Ratios of another agent's steps are clipped around those before the update, also after the policy
/// has changed; own ones around 1. The losses of the other's steps have the given weight.
#[test]
fn ratios_of_others_are_clipped_around_earlier_ones() {
    let mut leader = agent(&SeedPg::default(), 0, 0.0).with_weight_of_others(0.5);
    let episodes = [episode(0), episode(1)];
    leader.work.chosen_episodes = vec![0, 1];
    leader.compute_earlier_ratios(&episodes);
    leader.load_trajectory(&episodes[1], 1);
    let earlier_ratios = leader.work.ratios.clone();
    assert!(
        earlier_ratios
            .iter()
            .any(|ratio| (ratio - 1.0).abs() > 0.01)
    );
    leader.improve_policy(&leader.descent(0), &mut Totals::default());
    leader.load_trajectory(&episodes[1], 1);
    let samples = &leader.work.samples;
    assert_eq!(samples.centers, earlier_ratios);
    assert_ne!(leader.work.ratios, earlier_ratios);
    assert_eq!([&samples.loss_weights, &samples.weights], [&[0.5; 6]; 2]);
    leader.load_trajectory(&episodes[0], 0);
    let samples = &leader.work.samples;
    assert_eq!(samples.centers, [1.0; 6]);
    assert_eq!([&samples.loss_weights, &samples.weights], [&[1.0; 6]; 2]);
}

/// ρ is π(a|s) of the learning agent over ½, the probability under the policy that acted.
#[test]
fn ratios_compare_the_learning_policy_with_the_acting_policy() {
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
fn own_data_excludes_other_agents() {
    let own = own_data();
    let (mut alone, mut among_others) = (agent(&own, 0, 0.1), agent(&own, 0, 0.1));
    update(&mut alone, [0], 0);
    update(&mut among_others, [0, 1], 0);
    assert_eq!(parameters(&alone), parameters(&among_others));

    let mut shared = agent(&SeedPg::default(), 0, 0.1);
    update(&mut shared, [0, 1], 0);
    assert_ne!(parameters(&alone), parameters(&shared));
}

/// On-policy Seed-PG (§3.4.1): the value function learns from all agents, the policy from its own
/// episodes.
#[test]
fn value_data_and_policy_data_are_independent() {
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

/// With strong regularization, parameters stay closer to their initial values than without.
/// The value function is regularized towards its initial function, not towards the initial
/// parameters of the normalized network: with returns of about 30, Pop-Art's mean and deviation are
/// far from 0 and 1, but the values stay those of φ̂.
#[test]
fn regularization_keeps_the_initial_value_function_despite_pop_art() {
    let mut rewarded = episode(0);
    rewarded
        .rewards
        .iter_mut()
        .for_each(|reward| *reward += 10.0);
    let largest_change = |regularization| {
        let config = SeedPg {
            regularization: ranged_number(regularization),
            ..SeedPg::default()
        };
        let mut learner = agent(&config, 0, 0.0);
        learner.estimate(&rewarded, 0);
        let before = learner.work.values.clone();
        for round in 0..200 {
            update_on(&mut learner, std::slice::from_ref(&rewarded), round);
        }
        learner.estimate(&rewarded, 0);
        assert!(learner.normalizer.mean() > 20.0);
        let changes = learner.work.values.iter().zip(before);
        changes
            .map(|(after, before)| (after - before).abs())
            .fold(0.0, f32::max)
    };
    let (with, without) = (largest_change(1e4), largest_change(0.0));
    assert!(with < 1.0 && without > 10.0, "{with} {without}");
}

#[test]
fn regularization_keeps_parameters_near_their_initial_values() {
    let distance = |regularization| {
        let config = SeedPg {
            regularization: ranged_number(regularization),
            ..SeedPg::default()
        };
        let mut learner = agent(&config, 0, 0.1);
        let initial = learner.policy.network().parameters().to_vec();
        for round in 0..50 {
            update(&mut learner, [0, 1], round);
        }
        initial
            .iter()
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

/// A policy learns to prefer action 0 if action 0 is rewarded.
#[test]
fn rewarded_actions_become_more_likely() {
    let mut config = SeedPg::default();
    config.policy_optimizer.step_size = ranged_number(0.01);
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
        let change = learner.work.log_probs[step] - before[step];
        assert!(
            if *action == 0.0 {
                change > 0.0
            } else {
                change < 0.0
            },
            "step {step}: {change}"
        );
    }
}

/// Actions of another agent become more likely if they are imitated, whatever they earn; own ones that earn
/// nothing do not matter.
#[test]
fn imitated_actions_become_more_likely() {
    let mut config = own_data();
    config.policy_optimizer.step_size = ranged_number(0.01);
    config.minibatch = Minibatch::Steps(ranged_count(4));
    let imitation = Imitation {
        agent: 1,
        weight: 2.0,
    };
    let mut learner = agent(&config, 0, 0.0).with_imitation(imitation);
    let mut imitated = episode_with_rewards(1, 1.7);
    imitated.actions.fill(1.0);
    let mut own = episode(0);
    own.rewards.fill(0.0);
    let log_probs = |learner: &mut SeedPgAgent| {
        learner.estimate(&imitated, 0);
        learner.work.log_probs.clone()
    };
    let before = log_probs(&mut learner);
    for round in 0..5 {
        update_on(&mut learner, &[own.clone(), imitated.clone()], round);
    }
    let after = log_probs(&mut learner);
    assert!(
        before
            .iter()
            .zip(&after)
            .all(|(before, after)| after > before),
        "{before:?} {after:?}"
    );
}

#[test]
fn a_restored_agent_continues_with_the_same_bits() {
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

/// With γ = ½ and neither ratios, seeds nor a baseline, advantages are discounted returns: rewards
/// of 4, 2, 8 give 4 + ½ (2 + ½ 8) = 7, 2 + ½ 8 = 6 and 8; the agent's other episode has the single
/// reward 1. No advantages are recorded for other agents' episodes, and recorded advantages are not
/// standardized.
#[test]
fn advantages_of_own_steps_are_recorded() {
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
        standardize: Standardization::PerTrajectory,
        discount: ranged_number(0.5),
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

/// Recorded advantages are those that the agent estimates before it learns, and recording them does
/// not change what it learns.
#[test]
fn recording_advantages_does_not_change_learning() {
    let variants = [
        SeedPg {
            sharing: Sharing::Sampled {
                trajectories: ranged_count(1),
            },
            epochs: ranged_count(3),
            ..SeedPg::default()
        },
        SeedPg {
            minibatch: Minibatch::Steps(ranged_count(4)),
            observations: ObservationScaling::Running,
            ..SeedPg::default()
        },
        SeedPg {
            standardize: Standardization::PerTrajectory,
            time_limit: TimeLimit::Bootstraps,
            ..SeedPg::default()
        },
    ];
    for config in variants {
        let (mut recording, mut not_recording) = (
            with_recorded_advantages(agent(&config, 1, 0.5)),
            agent(&config, 1, 0.5),
        );
        for round in 0..3 {
            let mut before = agent(&config, 1, 0.5);
            before.restore(&not_recording.save()).unwrap();
            before.estimate(&episode(1), 1);
            let [recorded, plain] =
                [&mut recording, &mut not_recording].map(|learner| update(learner, 0..3, round));
            assert_eq!(recorded.report, plain.report);
            assert_eq!(recording.save(), not_recording.save());
            let expected = &before.work.samples.advantages;
            assert_eq!(&advantages(&recorded), expected, "{config:?}");
            assert!(plain.step_data.is_empty());
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

/// If the time limit bootstraps, the last target is r + γ v(`s_T`), otherwise r. After a
/// termination it is always r.
#[test]
fn a_time_limit_bootstraps_if_configured() {
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

/// Linear from 1 to 0.1 over 10 rounds: 0.55 after 5, and 0.1 from 10 on.
#[test]
fn step_sizes_follow_their_schedule() {
    let schedule = StepSizeSchedule::Linear {
        rounds: ranged_count(10),
        to: ranged_number(0.1),
    };
    assert!((schedule.factor(5) - 0.55).abs() < 1e-12 && (schedule.factor(10) - 0.1).abs() < 1e-12);
    assert_eq!(
        (schedule.factor(0), schedule.factor(99)),
        (1.0, schedule.factor(10))
    );
}
