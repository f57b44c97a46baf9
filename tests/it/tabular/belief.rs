//! Beliefs, and the MDPs that seeds sample from them, compared with posteriors derived by hand.

use approx::assert_relative_eq;
use seedbed::tabular::belief::{Belief, Posterior};
use seedbed::tabular::seed::{AgentSeed, RewardSeeds, sample_posterior};
use seedbed_env::tabular::{
    BipolarChain, DeepSea, Mdp, Model, Outcome, ParallelChains, Prior, Reward, TaskFamily,
};

/// One state, one action, whose reward is θ.
fn one_reward(prior: Prior) -> Model {
    let again = Outcome {
        state: 0,
        reward: Reward::unknown(0, 1.0),
    };
    let mut model = Model::new(0, 1, &[vec![vec![again]]]);
    model.parameters = vec![prior];
    model
}

/// One state, one action with three outcomes of prior weight `weight`.
fn three_outcomes(weight: f64) -> Model {
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

fn empty(model: &Model) -> Mdp {
    Mdp {
        values: vec![0.0; model.parameters.len()],
        probabilities: vec![1.0; model.outcomes().len()],
    }
}

/// Prior N(1, 2²), noise 1, observations 3 and 5. 1/σ² = 1/4 + 2 = 9/4; μ = (1/4 + 3 + 5) / (9/4) =
/// 11/3.
#[test]
fn gaussian_posteriors_weigh_by_precision() {
    let model = one_reward(Prior::Normal {
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

/// ln θ ~ N(0, 1), noise 1; r = e⁰·⁵ means ln r + 1/2 = 1. σ² = 1/2, μ = 1/2: (σ² μ + σₑ² (ln r +
/// σ²/2)) / (σₑ² + σ²) of the paper. The mean of θ is exp(μ + σ²/2) = e^{3/4}.
#[test]
fn log_normal_posteriors_are_gaussian_in_the_logarithm() {
    let prior = Prior::LogNormal {
        mean: 0.0,
        deviation: 1.0,
        noise: 1.0,
    };
    let model = one_reward(prior);
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

/// Dirichlet(½, ½, ½) after 2, 1, 0: α = (2.5, 1.5, 0.5), mean 2.5/4.5 = 5/9, variance 5/9 · 4/9 /
/// 5.5.
#[test]
fn outcome_probabilities_are_dirichlet() {
    let model = three_outcomes(0.5);
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

/// Mean and variance of `number` over the first `count` agents.
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

/// Over 20 000 seeds, θ̂ is distributed as the posterior N(11/3, 4/9): the mean to 4 · (2/3)/√20000
/// = 0.019, the variance to 4 · (4/9) √(2/20000) = 0.018; 68.3 % within one deviation, to 1.3 %. This
/// holds for both kinds of seeds, and for independent samples.
#[test]
fn over_seeds_rewards_are_distributed_as_the_posterior() {
    let model = one_reward(Prior::Normal {
        mean: 1.0,
        deviation: 2.0,
        noise: 1.0,
    });
    let mut belief = Belief::new(&model);
    for observation in [3.0, 5.0] {
        belief.update(&model, 0, 0, observation);
    }
    let mut mdp = empty(&model);
    for kind in 0..3 {
        let mut within = 0;
        let (mean, variance) = moments(20_000, |agent| {
            match kind {
                0 => AgentSeed::new(&model, 1, agent).sample(
                    &model,
                    &belief,
                    RewardSeeds::StandardGaussian,
                    &mut mdp,
                ),
                1 => AgentSeed::new(&model, 1, agent).sample(
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
                    sample_posterior(&model, &belief, &mut random, &mut mdp);
                }
            }
            within += u32::from((mdp.values[0] - 11.0 / 3.0).abs() < 2.0 / 3.0);
            mdp.values[0]
        });
        assert!((mean - 11.0 / 3.0).abs() < 0.019, "{kind}: mean {mean}");
        assert!(
            (variance - 4.0 / 9.0).abs() < 0.018,
            "{kind}: variance {variance}"
        );
        assert!(
            (f64::from(within) / 20_000.0 - 0.6827).abs() < 0.013,
            "{kind}: {within} within"
        );
    }
}

/// Over 20 000 seeds, p̂₀ has the moments of Beta(2.5, 2): mean 5/9 to 4 √(0.0449/20000) = 0.006,
/// variance 0.04489 to 0.002. The agents have sampled from an earlier belief before, so that their
/// sums are extended.
#[test]
fn over_seeds_transitions_are_distributed_as_the_dirichlet() {
    let model = three_outcomes(0.5);
    let mut early = Belief::new(&model);
    early.update(&model, 0, 0, 0.0);
    let mut late = early.clone();
    for outcome in [0, 1] {
        late.update(&model, 0, outcome, 0.0);
    }
    let mut mdp = empty(&model);
    let (mean, variance) = moments(20_000, |agent| {
        let mut seed = AgentSeed::new(&model, 2, agent);
        seed.sample(&model, &early, RewardSeeds::StandardGaussian, &mut mdp);
        seed.sample(&model, &late, RewardSeeds::StandardGaussian, &mut mdp);
        let stepwise = mdp.clone();
        AgentSeed::new(&model, 2, agent).sample(
            &model,
            &late,
            RewardSeeds::StandardGaussian,
            &mut mdp,
        );
        assert_eq!(stepwise, mdp, "agent {agent}");
        mdp.probabilities[0]
    });
    assert!((mean - 5.0 / 9.0).abs() < 0.006, "{mean}");
    assert!((variance - 20.0 / 81.0 / 5.5).abs() < 0.002, "{variance}");
}

/// A martingale has the same value after every observation was followed by a sample, and after one
/// sample at the end.
#[test]
fn martingale_seeds_are_extended() {
    let model = one_reward(Prior::Normal {
        mean: 0.0,
        deviation: 3.0,
        noise: 2.0,
    });
    let mut belief = Belief::new(&model);
    let (mut seed, mut mdp) = (AgentSeed::new(&model, 3, 0), empty(&model));
    for observation in [1.0, -2.0, 4.0] {
        belief.update(&model, 0, 0, observation);
        seed.sample(&model, &belief, RewardSeeds::MartingaleGaussian, &mut mdp);
    }
    let stepwise = mdp.clone();
    AgentSeed::new(&model, 3, 0).sample(&model, &belief, RewardSeeds::MartingaleGaussian, &mut mdp);
    assert_eq!(stepwise, mdp);
}

/// Without observations both kinds of seeds sample μ₀ + σ₀ z, even if observations have no noise;
/// afterwards they return the observation.
#[test]
fn seeds_of_exactly_observed_rewards() {
    let model = one_reward(Prior::Normal {
        mean: 2.0,
        deviation: 3.0,
        noise: 0.0,
    });
    let mut belief = Belief::new(&model);
    let (mut seed, mut mdp) = (AgentSeed::new(&model, 4, 0), empty(&model));
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
    belief.update(&model, 0, 0, 7.0);
    assert_eq!(sample(&belief, RewardSeeds::MartingaleGaussian), 7.0);
    assert_eq!(sample(&belief, RewardSeeds::StandardGaussian), 7.0);
}

/// Adaptivity, commitment, diversity (arXiv 1802.01282 §2).
#[test]
fn seeds_adapt_commit_and_differ() {
    for task in [
        TaskFamily::BipolarChain(BipolarChain::default()),
        TaskFamily::ParallelChains(ParallelChains::default()),
    ] {
        let model = task.model(0);
        let mut belief = Belief::new(&model);
        let (mut mdp, mut again) = (empty(&model), empty(&model));
        let sample = |agent: u32, belief: &Belief, mdp: &mut Mdp| {
            AgentSeed::new(&model, 0, agent).sample(
                &model,
                belief,
                RewardSeeds::StandardGaussian,
                mdp,
            );
        };
        let mut distinct: Vec<f64> = (0..20)
            .map(|agent| {
                sample(agent, &belief, &mut mdp);
                sample(agent, &belief, &mut again);
                assert_eq!(
                    mdp, again,
                    "an agent samples the same MDP from the same belief"
                );
                mdp.values[0]
            })
            .collect();
        distinct.sort_by(f64::total_cmp);
        distinct.dedup();
        assert!(distinct.len() >= 2, "agents differ");
        let observed = (0..model.outcomes().len())
            .find(|&outcome| model.outcomes()[outcome].reward.unknown.is_some())
            .unwrap();
        (0..1000).for_each(|_| belief.update(&model, observed, observed, -1.0));
        for agent in 0..20 {
            sample(agent, &belief, &mut mdp);
            assert!(
                (mdp.values[0] + 1.0).abs() < 0.15,
                "all agents agree after a thousand observations: {}",
                mdp.values[0]
            );
        }
    }
}

/// Before the first move both directions of an action have equal probability, and agents sample
/// different ones.
#[test]
fn the_directions_of_deep_sea_are_unknown() {
    let model = TaskFamily::DeepSea(DeepSea::default()).model(0);
    let belief = Belief::new(&model);
    assert_eq!(belief.outcome_probability(&model, 0, 0).0, 0.5);
    let mut mdp = empty(&model);
    let (mean, variance) = moments(4000, |agent| {
        AgentSeed::new(&model, 0, agent).sample(
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
