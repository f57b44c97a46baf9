//! Seed-PG on hand-made episodes of two observations and one binary action.

use std::collections::{BTreeMap, BTreeSet};

use super::config::*;
use super::*;
use crate::agent::TeamConfig;
use crate::agent::bonus::{Bonus, ModelSharing, Rnd, TeamEntropy, Vime};
use crate::agent::policy::ActionSelection;
use crate::agent::scaling::ObservationScaling;
use crate::algorithms::AlgorithmConfig;
use crate::seed::{RewardPerturbation, RewardSeeds};
use crate::team::{
    AgentUpdate, Learner, LearningRequest, LearningTiming, Team, TeamContext, Workers,
};
use seedbed_env::input::numbers::{ranged_count, ranged_number};
use seedbed_env::{Action, Choice, Quantity, Status, TaskSpec};

fn spec() -> TaskSpec {
    let quantity = |name: &str| Quantity {
        name: name.to_owned(),
        unit: String::new(),
        range: [-1.0, 1.0],
    };
    TaskSpec {
        observations: vec![quantity("x"), quantity("y")],
        actions: vec![Action {
            quantity: quantity("push"),
            choice: Choice::Discrete(vec![-1.0, 1.0]),
        }],
        time_limit: 8,
        ..TaskSpec::new("test", Vec::new(), Vec::new())
    }
}

fn agent(config: &SeedPg, number: u32, sigma: f64) -> SeedPgAgent {
    let seeds = RewardSeeds::Normal {
        sigma: ranged_number(sigma),
    };
    let team = TeamConfig {
        count: ranged_count(2),
        seeds: seeds.into(),
        ..TeamConfig::default()
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

/// An episode of six steps, each with an action of probability ½ under the policy that acted.
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

fn update_on(learner: &mut SeedPgAgent, episodes: &[Episode], round: u32) -> Update {
    let lengths: Vec<u32> = episodes
        .iter()
        .map(|episode| episode.length() as u32)
        .collect();
    learner.update(&Experience {
        new_episodes: episodes,
        new_lengths: &lengths,
        all_episodes: episodes,
        earlier_updates: round,
    })
}

fn parameters(agent: &SeedPgAgent) -> Vec<f32> {
    agent
        .tensors()
        .iter()
        .flat_map(|tensor| tensor.values.to_vec())
        .collect()
}

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
    let largest_change = |regularisation| {
        let config = SeedPg {
            regularisation: ranged_number(regularisation),
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
    let distance = |regularisation| {
        let config = SeedPg {
            regularisation: ranged_number(regularisation),
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
    config.policy_optimiser.step_size = ranged_number(0.01);
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
        standardise: Standardization::PerTrajectory,
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
            standardise: Standardization::PerTrajectory,
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
            standardise: Standardization::PerTrajectory,
            ..own_data()
        },
        SeedPg {
            standardise: Standardization::PerMinibatch,
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
            returns: ReturnNormalisation::Raw,
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
    config.policy_optimiser.step_size = ranged_number(0.01);
    config.value_optimiser.step_size = ranged_number(0.01);
    let mut learner = agent(&config, 0, 0.0);
    let mut random = stream(3, Purpose::Action, 0, 0);
    let before = probability_of_action_0(&learner);
    for round in 0..40 {
        let played = play(&learner, &mut random);
        update_on(&mut learner, &[played], round);
    }
    probability_of_action_0(&learner) - before
}

/// An episode of six steps played by the present policy, with reward 1 for action 0 and −1 for
/// action 1.
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

/// Mean probability of action 0 in the six states of [`episode`].
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
        let probability = log_prob[0].exp();
        probabilities.push(if action[0] == 0.0 {
            probability
        } else {
            1.0 - probability
        });
    }
    probabilities.iter().sum::<f32>() / probabilities.len() as f32
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

/// With two sampled trajectories, an agent learns from its own episode and from two of the others,
/// which differ from round to round.
#[test]
fn sampled_sharing_chooses_the_given_number_of_other_trajectories() {
    let config = SeedPg {
        sharing: Sharing::Sampled {
            trajectories: ranged_count(2),
        },
        ..SeedPg::default()
    };
    let mut learner = agent(&config, 3, 0.0);
    let new_episodes: Vec<Episode> = (0..8).map(episode).collect();
    let infos: Vec<EpisodeInfo> = new_episodes.iter().map(EpisodeInfo::from).collect();
    let mut chosen = |round| {
        update_on(&mut learner, &new_episodes, round);
        let chosen = learner.work.chosen_episodes.clone();
        let foretold = Agent::choose_episodes(&learner, &infos, round);
        let as_set = |indices: &[usize]| BTreeSet::from_iter(indices.to_vec());
        assert_eq!(foretold.as_deref().map(as_set), Some(as_set(&chosen)));
        chosen
    };
    let chosen_per_round: Vec<Vec<usize>> = (0..20)
        .map(&mut chosen)
        .map(|mut chosen: Vec<usize>| {
            chosen.sort_unstable();
            chosen
        })
        .collect();
    assert!(
        chosen_per_round
            .iter()
            .all(|chosen| chosen.len() == 3 && chosen.contains(&3) && chosen.is_sorted())
    );
    assert!(
        (0..8).all(|agent| {
            chosen_per_round
                .iter()
                .any(|chosen| chosen.contains(&agent))
        }),
        "{chosen_per_round:?}"
    );
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

fn own_data() -> SeedPg {
    SeedPg {
        value_data: Data::Own,
        policy_data: Data::Own,
        ..SeedPg::default()
    }
}

const UNWEIGHTED: ValueTarget = ValueTarget::MonteCarlo {
    importance: Importance::Off,
    ratio_product_cap: None,
};

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

/// A team of five agents, or a part of it.
fn team_in_process(config: &SeedPg, local_agents: Option<(u32, u32)>) -> Box<dyn Team> {
    let team = TeamConfig {
        count: ranged_count(5),
        ..TeamConfig::default()
    };
    config.build(&TeamContext {
        run_seed: 1,
        config: &team,
        local_agents,
        spec: &spec(),
        timing: LearningTiming::AfterEpisodes,
        record_advantages: true,
    })
}

/// Lets agents learn twice from one episode each. Episodes of other agents that they did not choose
/// have no steps. `model`: what agent 0 has learned for the team, after each round
fn learn_in_process(
    team: &mut dyn Team,
    local_agents: std::ops::Range<u32>,
    models: &mut Vec<Option<Vec<u8>>>,
) -> Vec<AgentUpdate> {
    let workers = Workers::CURRENT_THREAD;
    let mut updates = Vec::new();
    for round in 0..2 {
        let mut episodes: Vec<Episode> = (0..5).map(episode).collect();
        let infos: Vec<EpisodeInfo> = episodes.iter().map(EpisodeInfo::from).collect();
        let lengths: Vec<u32> = infos.iter().map(|info| info.length).collect();
        if let Some(chosen) = team.choose_episodes(&infos, round) {
            for (index, episode) in episodes.iter_mut().enumerate() {
                if !chosen.contains(&index) {
                    *episode = Episode::start(index as u32, 0, 0, &spec());
                }
            }
        }
        let learners: Vec<Learner> = local_agents
            .clone()
            .map(|agent| Learner {
                agent,
                first_new_episode: 0,
                earlier_updates: round,
            })
            .collect();
        let request = LearningRequest {
            episodes: &episodes,
            lengths: &lengths,
            learners: &learners,
        };
        updates.extend(team.learn(&request, workers));
        if local_agents.start == 0 {
            models.push(team.shared_model());
        } else if let Some(model) = &models[round as usize] {
            team.set_shared_model(model, workers).unwrap();
        }
    }
    updates
}

/// Agents 0 and 1 in one process, 2 to 4 in another, as in one process.
#[test]
fn processes_have_the_bits_of_a_team_in_one() {
    let sampled = Sharing::Sampled {
        trajectories: ranged_count(1),
    };
    let vime = |model| {
        Bonus::Vime(Vime {
            model,
            ..Vime::default()
        })
    };
    let entropy = |model| {
        Bonus::TeamEntropy(TeamEntropy {
            model,
            references: ranged_count(10),
            ..TeamEntropy::default()
        })
    };
    for (sharing, bonus) in [
        (Sharing::All, Bonus::None),
        (sampled, Bonus::None),
        (sampled, vime(ModelSharing::Shared)),
        (sampled, vime(ModelSharing::Independent)),
        (sampled, vime(ModelSharing::Frozen)),
        (sampled, Bonus::Rnd(Rnd::default())),
        (sampled, entropy(ModelSharing::Shared)),
        (sampled, entropy(ModelSharing::Independent)),
    ] {
        let config = SeedPg {
            sharing,
            bonus: bonus.clone().into(),
            ..SeedPg::default()
        };
        let [mut whole, mut first, mut second] =
            [None, Some((0, 2)), Some((2, 5))].map(|local| team_in_process(&config, local));
        let expected = learn_in_process(&mut *whole, 0..5, &mut Vec::new());
        let mut models = Vec::new();
        let updates = learn_in_process(&mut *first, 0..2, &mut models);
        let later_updates = learn_in_process(&mut *second, 2..5, &mut models);
        assert_eq!(models[0].is_some(), bonus.has_shared_model());
        let of_agents = |agents: std::ops::Range<u32>| {
            let updates = expected.iter().cloned();
            let mut updates: Vec<_> = updates
                .filter(|update| agents.contains(&update.agent))
                .collect();
            if agents.start > 0 && bonus.has_shared_model() {
                // The trainer of the whole run adds the error of agent 0.
                for update in &mut updates {
                    update.update.report.prediction_error = None;
                }
            }
            updates
        };
        assert_eq!(updates, of_agents(0..2));
        assert_eq!(later_updates, of_agents(2..5));
        let tensors = [first.tensors(), second.tensors()].concat();
        let as_map = |tensors: Vec<Tensor<'_>>| -> BTreeMap<String, Vec<f32>> {
            let tensors = tensors.into_iter();
            tensors
                .map(|tensor| (tensor.name, tensor.values.into_owned()))
                .collect()
        };
        assert_eq!(as_map(tensors), as_map(whole.tensors()));
    }
}
