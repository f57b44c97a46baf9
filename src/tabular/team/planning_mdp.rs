//! The MDP that an agent plans in: sampled from the belief, optimistic, or the posterior mean.

use super::TabularTeam;
use crate::tabular::Algorithm;
use crate::tabular::belief::{Belief, Posterior};
use crate::tabular::planner::Optimism;
use crate::tabular::seed::sample_posterior;
use seedbed_env::tabular::{Mdp, Model};
use seedbed_random::{Purpose, stream};

impl TabularTeam {
    /// Sets `self.mdp` to the MDP that the algorithm derives for an agent from the latest belief.
    pub(super) fn derive_mdp(&mut self, agent_index: u32) {
        let (model, belief, mdp) = (&self.model, &self.belief, &mut self.mdp);
        let agent = &mut self.agents[agent_index as usize];
        let resampling_stream = |index| {
            stream(
                self.scenario.seed,
                Purpose::TabularResampling,
                agent_index,
                index,
            )
        };
        match self.scenario.algorithm {
            Algorithm::SeedSampling { rewards } | Algorithm::SharedSeed { rewards } => {
                let seed = agent
                    .seed
                    .as_mut()
                    .expect("agents of these algorithms have seeds");
                seed.sample(model, belief, rewards, mdp);
            }
            Algorithm::ThompsonResampling => {
                sample_posterior(model, belief, &mut resampling_stream(agent.actions), mdp);
            }
            Algorithm::SampleOnce => {
                sample_posterior(
                    model,
                    belief,
                    &mut resampling_stream(agent.episode.episode),
                    mdp,
                );
            }
            Algorithm::Ucrl { width } => self.set_optimistic_mdp(agent_index, width.get()),
            Algorithm::CountBonus { .. } | Algorithm::EpsilonGreedy { .. } | Algorithm::Random => {
                set_posterior_mean(model, belief, mdp);
            }
        }
    }

    /// Sets `self.mdp` and `self.optimism` to the best MDP within `width` standard deviations of
    /// the posterior mean. An unknown sign is set to the one of −1 and 1 with which the agent's state
    /// has the larger value.
    fn set_optimistic_mdp(&mut self, agent_index: u32, width: f64) {
        let (model, belief, mdp) = (&self.model, &self.belief, &mut self.mdp);
        set_posterior_mean(model, belief, mdp);
        for (parameter, &prior) in model.parameters.iter().enumerate() {
            mdp.values[parameter] = belief.posterior(parameter).quantile(prior, width);
        }
        self.optimism.clear();
        for pair in 0..model.pair_count() {
            for outcome in model.outcomes_of(pair) {
                let (mean, deviation) = belief.outcome_probability(model, pair, outcome);
                self.optimism.push(if mean < 1.0 {
                    (width * deviation / (1.0 - mean)).min(1.0)
                } else {
                    0.0
                });
            }
        }
        for parameter in 0..self.model.parameters.len() {
            if self.belief.posterior(parameter) == Posterior::UnknownSign {
                self.choose_optimistic_sign(agent_index, parameter);
            }
        }
    }

    /// Sets an unknown sign to the one of −1 and 1 with which the agent's state has the larger value.
    fn choose_optimistic_sign(&mut self, agent_index: u32, parameter: usize) {
        let agent = &self.agents[agent_index as usize];
        let mut policy = self.planner.empty_policy();
        let mut value_with = |sign: f64| {
            self.mdp.values[parameter] = sign;
            self.planner.plan(
                &self.model,
                &self.mdp,
                Optimism {
                    outcomes: &self.optimism,
                    bonuses: &[],
                },
                agent.step,
                &mut policy,
            );
            self.planner.value(agent.state)
        };
        let sign = if value_with(-1.0) > value_with(1.0) {
            -1.0
        } else {
            1.0
        };
        self.mdp.values[parameter] = sign;
    }
}

/// Sets `mdp` to the mean of a belief.
fn set_posterior_mean(model: &Model, belief: &Belief, mdp: &mut Mdp) {
    for (parameter, &prior) in model.parameters.iter().enumerate() {
        mdp.values[parameter] = belief.posterior(parameter).mean(prior);
    }
    for pair in 0..model.pair_count() {
        for outcome in model.outcomes_of(pair) {
            mdp.probabilities[outcome] = belief.outcome_probability(model, pair, outcome).0;
        }
    }
}
