//! Beliefs, and the MDPs that agent seeds sample from them, compared with posteriors derived by
//! hand.

use approx::assert_relative_eq;
use seedbed::tabular::belief::{Belief, Posterior};
use seedbed::tabular::seed::{AgentSeed, RewardSeeds, sample_posterior};
use seedbed_env::tabular::{
    BipolarChain, DeepSea, Mdp, Model, Outcome, ParallelChains, Prior, Reward, TaskFamily,
};
use seedbed_random::{Purpose, stream};

/// A model with one state and one action, whose unknown mean reward is θ.
fn model_of_one_reward(prior: Prior) -> Model {
    let outcome = Outcome {
        state: 0,
        reward: Reward::unknown(0, 1.0),
    };
    let mut model = Model::new(0, 1, &[vec![vec![outcome]]]);
    model.parameters = vec![prior];
    model
}

/// A model with one state and one action with three outcomes. `outcome_weight` is the
/// concentration α₀ of their symmetric Dirichlet prior.
fn model_of_three_outcomes(outcome_weight: f64) -> Model {
    let outcomes = vec![
        Outcome {
            state: 0,
            reward: Reward::known(0.0)
        };
        3
    ];
    let mut model = Model::new(0, 1, &[vec![outcomes]]);
    model.outcome_weight = outcome_weight;
    model
}

/// An MDP of the right size, to be overwritten by samples.
fn empty_mdp(model: &Model) -> Mdp {
    Mdp {
        values: vec![0.0; model.parameters.len()],
        probabilities: vec![1.0; model.outcomes().len()],
    }
}

/// Prior N(1, 2²), noise 1, observations 3 and 5. 1/σ² = 1/4 + 2 = 9/4; μ = (1/4 + 3 + 5) / (9/4) =
/// 11/3.
#[test]
fn gaussian_posteriors_weigh_by_precision() {
    let model = model_of_one_reward(Prior::Normal {
        mean: 1.0,
        deviation: 2.0,
        noise: 1.0,
    });
    let mut belief = Belief::new(&model);
    for observation in [3.0, 5.0] {
        belief.update(&model, 0, 0, observation);
    }
    let Posterior::Gaussian { mean, variance } = belief.posterior(0) else {
        panic!("{belief:?}")
    };
    assert_relative_eq!(mean, 11.0 / 3.0, max_relative = 1e-14);
    assert_relative_eq!(variance, 4.0 / 9.0, max_relative = 1e-14);
}

/// Prior ln θ ~ N(0, 1), noise 1, one observation r = e^{1/2}, so ln r + 1/2 = 1. The posterior of
/// ln θ has variance 1/2 and mean 1/2 (Dimakopoulou and Van Roy 2018). The mean of θ is
/// exp(1/2 + 1/4) = e^{3/4}.
#[test]
fn log_normal_posteriors_are_gaussian_in_the_logarithm() {
    let prior = Prior::LogNormal {
        mean: 0.0,
        deviation: 1.0,
        noise: 1.0,
    };
    let model = model_of_one_reward(prior);
    let mut belief = Belief::new(&model);
    belief.update(&model, 0, 0, libm::exp(0.5));
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

/// Prior Dirichlet(½, ½, ½); the outcomes are observed 2, 1 and 0 times. The posterior
/// has α = (2.5, 1.5, 0.5), mean 2.5/4.5 = 5/9 and variance 5/9 · 4/9 / 5.5.
#[test]
fn outcome_probabilities_are_dirichlet() {
    let model = model_of_three_outcomes(0.5);
    let mut belief = Belief::new(&model);
    for outcome in [0, 0, 1] {
        belief.update(&model, 0, outcome, 0.0);
    }
    let (mean, deviation) = belief.outcome_probability(&model, 0, 0);
    assert_relative_eq!(mean, 5.0 / 9.0, max_relative = 1e-14);
    assert_relative_eq!(
        deviation * deviation,
        20.0 / 81.0 / 5.5,
        max_relative = 1e-14
    );
}

/// Mean and variance of the samples of agents 0 to `agent_count` − 1.
fn moments(agent_count: u32, mut sample_of_agent: impl FnMut(u32) -> f64) -> (f64, f64) {
    let samples: Vec<f64> = (0..agent_count).map(&mut sample_of_agent).collect();
    let mean = samples.iter().sum::<f64>() / f64::from(agent_count);
    (
        mean,
        samples
            .iter()
            .map(|sample| (sample - mean).powi(2))
            .sum::<f64>()
            / f64::from(agent_count),
    )
}

/// The 20 000 samples θ̂ of as many agents are distributed as the posterior N(11/3, 4/9), within
/// four standard errors: the mean within 4 · (2/3)/√20000 = 0.019, the variance within
/// 4 · (4/9) √(2/20000) = 0.018, and the share within one standard deviation, 68.3 %, within 1.3 %.
/// This holds for both kinds of reward seeds, and for independent samples from the posterior.
#[test]
fn over_seeds_rewards_are_distributed_as_the_posterior() {
    let model = model_of_one_reward(Prior::Normal {
        mean: 1.0,
        deviation: 2.0,
        noise: 1.0,
    });
    let mut belief = Belief::new(&model);
    for observation in [3.0, 5.0] {
        belief.update(&model, 0, 0, observation);
    }
    for reward_seeds in [
        Some(RewardSeeds::StandardGaussian),
        Some(RewardSeeds::MartingaleGaussian),
        None,
    ] {
        let mut count_within_deviation = 0;
        let (mean, variance) = moments(20_000, |agent| {
            let reward = sampled_reward(&model, &belief, reward_seeds, agent);
            count_within_deviation += u32::from((reward - 11.0 / 3.0).abs() < 2.0 / 3.0);
            reward
        });
        assert!(
            (mean - 11.0 / 3.0).abs() < 0.019,
            "{reward_seeds:?}: mean {mean}"
        );
        assert!(
            (variance - 4.0 / 9.0).abs() < 0.018,
            "{reward_seeds:?}: variance {variance}"
        );
        assert!(
            (f64::from(count_within_deviation) / 20_000.0 - 0.6827).abs() < 0.013,
            "{reward_seeds:?}: {count_within_deviation} within one standard deviation"
        );
    }
}

/// The reward θ̂ that an agent samples with its reward seeds, or, for `None`, with new random
/// numbers.
fn sampled_reward(
    model: &Model,
    belief: &Belief,
    reward_seeds: Option<RewardSeeds>,
    agent: u32,
) -> f64 {
    let mut mdp = empty_mdp(model);
    if let Some(reward_seeds) = reward_seeds {
        AgentSeed::new(model, 1, agent).sample(model, belief, reward_seeds, &mut mdp);
    } else {
        let mut random = stream(1, Purpose::TabularResampling, agent, 0);
        sample_posterior(model, belief, &mut random, &mut mdp);
    }
    mdp.values[0]
}

/// The 20 000 samples p̂₀ of as many agents have the moments of Beta(2.5, 2): mean 5/9 within
/// 4 √(0.0449/20000) = 0.006, variance 0.04489 within 0.002. Each agent samples from an earlier
/// belief first, which must not change its later sample.
#[test]
fn over_seeds_transitions_are_distributed_as_the_dirichlet() {
    let model = model_of_three_outcomes(0.5);
    let mut earlier_belief = Belief::new(&model);
    earlier_belief.update(&model, 0, 0, 0.0);
    let mut later_belief = earlier_belief.clone();
    for outcome in [0, 1] {
        later_belief.update(&model, 0, outcome, 0.0);
    }
    let mut mdp = empty_mdp(&model);
    let (mean, variance) = moments(20_000, |agent| {
        let mut seed = AgentSeed::new(&model, 2, agent);
        seed.sample(
            &model,
            &earlier_belief,
            RewardSeeds::StandardGaussian,
            &mut mdp,
        );
        seed.sample(
            &model,
            &later_belief,
            RewardSeeds::StandardGaussian,
            &mut mdp,
        );
        let second_sample = mdp.clone();
        AgentSeed::new(&model, 2, agent).sample(
            &model,
            &later_belief,
            RewardSeeds::StandardGaussian,
            &mut mdp,
        );
        assert_eq!(second_sample, mdp, "agent {agent}");
        mdp.probabilities[0]
    });
    assert!((mean - 5.0 / 9.0).abs() < 0.006, "{mean}");
    assert!((variance - 20.0 / 81.0 / 5.5).abs() < 0.002, "{variance}");
}

/// Sampling after every observation gives the same last sample as sampling only after the last
/// observation.
#[test]
fn martingale_samples_do_not_depend_on_earlier_samples() {
    let model = model_of_one_reward(Prior::Normal {
        mean: 0.0,
        deviation: 3.0,
        noise: 2.0,
    });
    let mut belief = Belief::new(&model);
    let (mut seed, mut mdp) = (AgentSeed::new(&model, 3, 0), empty_mdp(&model));
    for observation in [1.0, -2.0, 4.0] {
        belief.update(&model, 0, 0, observation);
        seed.sample(&model, &belief, RewardSeeds::MartingaleGaussian, &mut mdp);
    }
    let last_sample = mdp.clone();
    AgentSeed::new(&model, 3, 0).sample(&model, &belief, RewardSeeds::MartingaleGaussian, &mut mdp);
    assert_eq!(last_sample, mdp);
}

/// Before the first observation, both kinds of reward seeds sample μ₀ + σ₀ z. After an observation
/// without noise, they return the observation.
#[test]
fn noiseless_observations_determine_the_sampled_reward() {
    let model = model_of_one_reward(Prior::Normal {
        mean: 2.0,
        deviation: 3.0,
        noise: 0.0,
    });
    let mut belief = Belief::new(&model);
    let (mut seed, mut mdp) = (AgentSeed::new(&model, 4, 0), empty_mdp(&model));
    let mut sample = |belief: &Belief, rewards| {
        seed.sample(&model, belief, rewards, &mut mdp);
        mdp.values[0]
    };
    let standard_sample = sample(&belief, RewardSeeds::StandardGaussian);
    assert_relative_eq!(
        sample(&belief, RewardSeeds::MartingaleGaussian),
        standard_sample,
        max_relative = 1e-14
    );
    belief.update(&model, 0, 0, 7.0);
    assert_eq!(sample(&belief, RewardSeeds::MartingaleGaussian), 7.0);
    assert_eq!(sample(&belief, RewardSeeds::StandardGaussian), 7.0);
}

/// Adaptivity, commitment and diversity (Dimakopoulou and Van Roy 2018, arXiv 1802.01282 §2).
#[test]
fn seeds_adapt_commit_and_differ() {
    for task in [
        TaskFamily::BipolarChain(BipolarChain::default()),
        TaskFamily::ParallelChains(ParallelChains::default()),
    ] {
        let model = task.model(0);
        let mut belief = Belief::new(&model);
        let mut distinct_rewards: Vec<f64> = (0..20)
            .map(|agent| {
                let mdp = sampled_mdp(&model, &belief, agent);
                assert_eq!(
                    mdp,
                    sampled_mdp(&model, &belief, agent),
                    "an agent must sample the same MDP from the same belief"
                );
                mdp.values[0]
            })
            .collect();
        distinct_rewards.sort_by(f64::total_cmp);
        distinct_rewards.dedup();
        assert!(distinct_rewards.len() >= 2, "agents must differ");
        // Each pair of these tasks has one outcome, with the same index.
        let pair = (0..model.outcomes().len())
            .find(|&outcome| model.outcomes()[outcome].reward.unknown.is_some())
            .unwrap();
        (0..1000).for_each(|_| belief.update(&model, pair, pair, -1.0));
        for agent in 0..20 {
            let reward = sampled_mdp(&model, &belief, agent).values[0];
            assert!(
                (reward + 1.0).abs() < 0.15,
                "all agents must agree after a thousand observations: {reward}"
            );
        }
    }
}

/// The MDP that an agent samples with standard-Gaussian reward seeds.
fn sampled_mdp(model: &Model, belief: &Belief, agent: u32) -> Mdp {
    let mut mdp = empty_mdp(model);
    AgentSeed::new(model, 0, agent).sample(model, belief, RewardSeeds::StandardGaussian, &mut mdp);
    mdp
}

/// Before the first move, both directions of an action have the same expected probability. The
/// probabilities that agents sample are distributed uniformly.
#[test]
fn agents_sample_the_unknown_directions_of_deep_sea() {
    let model = TaskFamily::DeepSea(DeepSea::default()).model(0);
    let belief = Belief::new(&model);
    assert_eq!(belief.outcome_probability(&model, 0, 0).0, 0.5);
    let mut mdp = empty_mdp(&model);
    let (mean, variance) = moments(4000, |agent| {
        AgentSeed::new(&model, 0, agent).sample(
            &model,
            &belief,
            RewardSeeds::StandardGaussian,
            &mut mdp,
        );
        mdp.probabilities[0]
    });
    // Beta(1, 1) has mean 1/2 and variance 1/12; four standard errors are 0.018 and 0.005.
    assert!(
        (mean - 0.5).abs() < 0.018 && (variance - 1.0 / 12.0).abs() < 0.005,
        "{mean}, {variance}"
    );
}
