//! Posteriors and the samples that agent seeds draw from them, compared with values derived by
//! hand.

use approx::assert_relative_eq;
use seedbed::tabular::belief::{Belief, Posterior};
use seedbed::tabular::seed::{RewardSeeds, Seed, draw_posterior};
use seedbed_env::tabular::{
    BipolarChain, DeepSea, Mdp, Model, Outcome, ParallelChains, Prior, Reward, TaskFamily,
};

/// An MDP with one state and one action, whose reward θ is unknown.
fn model_with_one_unknown_reward(prior: Prior) -> Model {
    let repeated = Outcome {
        state: 0,
        reward: Reward::unknown(0, 1.0),
    };
    let mut model = Model::new(0, 1, &[vec![vec![repeated]]]);
    model.parameters = vec![prior];
    model
}

/// An MDP with one state and one action with three outcomes of prior weight `weight`.
fn model_with_three_outcomes(weight: f64) -> Model {
    let outcomes = vec![
        Outcome {
            state: 0,
            reward: Reward::known(0.0)
        };
        3
    ];
    let mut model = Model::new(0, 1, &[vec![outcomes]]);
    model.outcome_weight = weight;
    model
}

fn empty_mdp(model: &Model) -> Mdp {
    Mdp {
        values: vec![0.0; model.parameters.len()],
        probabilities: vec![1.0; model.outcomes().len()],
    }
}

/// Prior N(1, 2²), noise 1, observations 3 and 5: 1/σ² = 1/4 + 2 = 9/4, μ = (1/4 + 3 + 5) / (9/4) =
/// 11/3.
#[test]
fn gaussian_posteriors_weight_observations_by_precision() {
    let model = model_with_one_unknown_reward(Prior::Normal {
        mean: 1.0,
        deviation: 2.0,
        noise: 1.0,
    });
    let mut belief = Belief::new(&model);
    for observed in [3.0, 5.0] {
        belief.take_in(&model, 0, 0, observed);
    }
    let Posterior::Gaussian { mean, variance } = belief.posterior(0) else {
        panic!("{belief:?}")
    };
    assert_relative_eq!(mean, 11.0 / 3.0, max_relative = 1e-14);
    assert_relative_eq!(variance, 4.0 / 9.0, max_relative = 1e-14);
}

/// Prior ln θ ~ N(0, 1), noise 1, observation r = e⁰·⁵, so ln r + 1/2 = 1. The posterior has σ² =
/// 1/2 and μ = 1/2, by (σ² μ + σₑ² (ln r + σ²/2)) / (σₑ² + σ²) of the paper. The mean of θ is exp(μ
/// + σ²/2) = e^{3/4}.
#[test]
fn log_normal_posteriors_are_gaussian_in_the_logarithm() {
    let prior = Prior::LogNormal {
        mean: 0.0,
        deviation: 1.0,
        noise: 1.0,
    };
    let model = model_with_one_unknown_reward(prior);
    let mut belief = Belief::new(&model);
    belief.take_in(&model, 0, 0, libm::exp(0.5));
    let Posterior::Gaussian { mean, variance } = belief.posterior(0) else {
        panic!("{belief:?}")
    };
    assert_relative_eq!(mean, 0.5, max_relative = 1e-14);
    assert_relative_eq!(variance, 0.5, max_relative = 1e-14);
    assert_relative_eq!(
        belief.posterior(0).mean(prior),
        libm::exp(0.75),
        max_relative = 1e-14
    );
}

/// Prior Dirichlet(½, ½, ½), outcomes observed 2, 1 and 0 times: α = (2.5, 1.5, 0.5), mean 2.5/4.5
/// = 5/9, variance 5/9 · 4/9 / 5.5.
#[test]
fn transition_posteriors_are_dirichlet() {
    let model = model_with_three_outcomes(0.5);
    let mut belief = Belief::new(&model);
    for outcome in [0, 0, 1] {
        belief.take_in(&model, 0, outcome, 0.0);
    }
    let (mean, deviation) = belief.likelihood(&model, 0, 0);
    assert_relative_eq!(mean, 5.0 / 9.0, max_relative = 1e-14);
    assert_relative_eq!(
        deviation * deviation,
        20.0 / 81.0 / 5.5,
        max_relative = 1e-14
    );
}

/// Mean and variance of `number(agent)` over `count` agents.
fn moments(count: u32, mut number: impl FnMut(u32) -> f64) -> (f64, f64) {
    let numbers: Vec<f64> = (0..count).map(&mut number).collect();
    let mean = numbers.iter().sum::<f64>() / f64::from(count);
    (
        mean,
        numbers
            .iter()
            .map(|number| (number - mean).powi(2))
            .sum::<f64>()
            / f64::from(count),
    )
}

/// θ̂ of 20 000 agents follows the posterior N(11/3, 4/9), for both kinds of agent seeds and for
/// Thompson resampling. Tolerances are four standard errors: 4 · (2/3)/√20000 = 0.019 for the mean,
/// 4 · (4/9) √(2/20000) = 0.018 for the variance, 1.3 % for the share within one deviation (68.3
/// %).
#[test]
fn sampled_rewards_follow_the_posterior() {
    let model = model_with_one_unknown_reward(Prior::Normal {
        mean: 1.0,
        deviation: 2.0,
        noise: 1.0,
    });
    let mut belief = Belief::new(&model);
    for observed in [3.0, 5.0] {
        belief.take_in(&model, 0, 0, observed);
    }
    let mut mdp = empty_mdp(&model);
    for kind in 0..3 {
        let mut within_one_deviation = 0;
        let (mean, variance) = moments(20_000, |agent| {
            match kind {
                0 => Seed::new(&model, 1, agent).sample(
                    &model,
                    &belief,
                    RewardSeeds::StandardGaussian,
                    &mut mdp,
                ),
                1 => Seed::new(&model, 1, agent).sample(
                    &model,
                    &belief,
                    RewardSeeds::MartingaleGaussian,
                    &mut mdp,
                ),
                _ => {
                    let mut random = seedbed_env::random::stream(
                        1,
                        seedbed_env::random::Purpose::TabularResampling,
                        agent,
                        0,
                    );
                    draw_posterior(&model, &belief, &mut random, &mut mdp);
                }
            }
            within_one_deviation += u32::from((mdp.values[0] - 11.0 / 3.0).abs() < 2.0 / 3.0);
            mdp.values[0]
        });
        assert!((mean - 11.0 / 3.0).abs() < 0.019, "{kind}: mean {mean}");
        assert!(
            (variance - 4.0 / 9.0).abs() < 0.018,
            "{kind}: variance {variance}"
        );
        assert!(
            (f64::from(within_one_deviation) / 20_000.0 - 0.6827).abs() < 0.013,
            "{kind}: {within_one_deviation} within one deviation"
        );
    }
}

/// p̂₀ of 20 000 agents has the moments of Beta(2.5, 2): mean 5/9 ± 4 √(0.0449/20000) = ± 0.006,
/// variance 0.04489 ± 0.002. Sampling after each of two updates gives the same as sampling once.
#[test]
fn sampled_transitions_follow_the_dirichlet_posterior() {
    let model = model_with_three_outcomes(0.5);
    let mut first_belief = Belief::new(&model);
    first_belief.take_in(&model, 0, 0, 0.0);
    let mut second_belief = first_belief.clone();
    for outcome in [0, 1] {
        second_belief.take_in(&model, 0, outcome, 0.0);
    }
    let mut mdp = empty_mdp(&model);
    let (mean, variance) = moments(20_000, |agent| {
        let mut seed = Seed::new(&model, 2, agent);
        seed.sample(
            &model,
            &first_belief,
            RewardSeeds::StandardGaussian,
            &mut mdp,
        );
        seed.sample(
            &model,
            &second_belief,
            RewardSeeds::StandardGaussian,
            &mut mdp,
        );
        let after_two_updates = mdp.clone();
        Seed::new(&model, 2, agent).sample(
            &model,
            &second_belief,
            RewardSeeds::StandardGaussian,
            &mut mdp,
        );
        assert_eq!(after_two_updates, mdp, "agent {agent}");
        mdp.probabilities[0]
    });
    assert!((mean - 5.0 / 9.0).abs() < 0.006, "{mean}");
    assert!((variance - 20.0 / 81.0 / 5.5).abs() < 0.002, "{variance}");
}

/// Each observation moves a martingale seed by v (y + w − θ̂) / s². Sampling after each observation
/// gives the same as sampling once after all observations.
#[test]
fn martingale_seeds_give_the_same_sample_in_one_or_several_updates() {
    let model = model_with_one_unknown_reward(Prior::Normal {
        mean: 0.0,
        deviation: 3.0,
        noise: 2.0,
    });
    let mut belief = Belief::new(&model);
    let (mut seed, mut mdp) = (Seed::new(&model, 3, 0), empty_mdp(&model));
    for observed in [1.0, -2.0, 4.0] {
        belief.take_in(&model, 0, 0, observed);
        seed.sample(&model, &belief, RewardSeeds::MartingaleGaussian, &mut mdp);
    }
    let after_two_updates = mdp.clone();
    Seed::new(&model, 3, 0).sample(&model, &belief, RewardSeeds::MartingaleGaussian, &mut mdp);
    assert_eq!(after_two_updates, mdp);
}

/// Without observations both kinds of seeds give μ₀ + σ₀ z. After an observation without noise they
/// give the observed value.
#[test]
fn noise_free_observations_determine_the_sample() {
    let model = model_with_one_unknown_reward(Prior::Normal {
        mean: 2.0,
        deviation: 3.0,
        noise: 0.0,
    });
    let mut belief = Belief::new(&model);
    let (mut seed, mut mdp) = (Seed::new(&model, 4, 0), empty_mdp(&model));
    let mut sample = |belief: &Belief, rewards| {
        seed.sample(&model, belief, rewards, &mut mdp);
        mdp.values[0]
    };
    let standard = sample(&belief, RewardSeeds::StandardGaussian);
    assert_relative_eq!(
        sample(&belief, RewardSeeds::MartingaleGaussian),
        standard,
        max_relative = 1e-14
    );
    belief.take_in(&model, 0, 0, 7.0);
    assert_eq!(sample(&belief, RewardSeeds::MartingaleGaussian), 7.0);
    assert_eq!(sample(&belief, RewardSeeds::StandardGaussian), 7.0);
}

/// The properties adaptivity, commitment and diversity (arXiv 1802.01282 §2).
#[test]
fn seed_samples_adapt_commit_and_differ() {
    for task in [
        TaskFamily::BipolarChain(BipolarChain::default()),
        TaskFamily::ParallelChains(ParallelChains::default()),
    ] {
        let model = task.model(0);
        let mut belief = Belief::new(&model);
        let (mut mdp, mut repeated) = (empty_mdp(&model), empty_mdp(&model));
        let sample = |agent: u32, belief: &Belief, mdp: &mut Mdp| {
            Seed::new(&model, 0, agent).sample(&model, belief, RewardSeeds::StandardGaussian, mdp);
        };
        let mut distinct: Vec<f64> = (0..20)
            .map(|agent| {
                sample(agent, &belief, &mut mdp);
                sample(agent, &belief, &mut repeated);
                assert_eq!(
                    mdp, repeated,
                    "without new observations an agent must keep its sample"
                );
                mdp.values[0]
            })
            .collect();
        distinct.sort_by(f64::total_cmp);
        distinct.dedup();
        assert!(distinct.len() >= 2, "agents must have different samples");
        let outcome_with_unknown_reward = (0..model.outcomes().len())
            .find(|&outcome| model.outcomes()[outcome].reward.unknown.is_some())
            .unwrap();
        (0..1000).for_each(|_| {
            belief.take_in(
                &model,
                outcome_with_unknown_reward,
                outcome_with_unknown_reward,
                -1.0,
            )
        });
        for agent in 0..20 {
            sample(agent, &belief, &mut mdp);
            assert!(
                (mdp.values[0] + 1.0).abs() < 0.15,
                "after a thousand observations all agents must agree: {}",
                mdp.values[0]
            );
        }
    }
}

/// Without observations, both directions of an action have probability ½, and the samples of agents
/// follow Beta(1, 1).
#[test]
fn prior_directions_of_deep_sea_actions_are_uniform() {
    let model = TaskFamily::DeepSea(DeepSea::default()).model(0);
    let belief = Belief::new(&model);
    assert_eq!(belief.likelihood(&model, 0, 0).0, 0.5);
    let mut mdp = empty_mdp(&model);
    let (mean, variance) = moments(4000, |agent| {
        Seed::new(&model, 0, agent).sample(
            &model,
            &belief,
            RewardSeeds::StandardGaussian,
            &mut mdp,
        );
        mdp.probabilities[0]
    });
    // Beta(1, 1): mean 1/2, variance 1/12; 4 deviations are 0.018 and 0.005.
    assert!(
        (mean - 0.5).abs() < 0.018 && (variance - 1.0 / 12.0).abs() < 0.005,
        "{mean}, {variance}"
    );
}
