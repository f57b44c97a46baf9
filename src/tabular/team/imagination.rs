//! What an agent takes for the truth before it plans, as its algorithm says.

use super::TabularTeam;
use crate::tabular::Algorithm;
use crate::tabular::belief::{Belief, Posterior};
use crate::tabular::seed::draw_posterior;
use seedbed_env::random::{Purpose, stream};
use seedbed_env::tabular::{Mdp, Model};

impl TabularTeam {
    /// What an agent takes for the truth, of the latest belief.
    pub(super) fn imagine(&mut self, number: u32) {
        let (model, belief, mdp) = (&self.model, &self.belief, &mut self.imagined);
        let agent = &mut self.agents[number as usize];
        let fresh = |action| {
            stream(
                self.scenario.seed,
                Purpose::TabularResampling,
                number,
                action,
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
                draw_posterior(model, belief, &mut fresh(agent.actions), mdp)
            }
            Algorithm::SampleOnce => {
                draw_posterior(model, belief, &mut fresh(agent.episode.episode), mdp)
            }
            Algorithm::Ucrl { width } => self.hope(number, width.get()),
            Algorithm::EpsilonGreedy { .. } | Algorithm::Random => expect(model, belief, mdp),
        }
    }

    /// The best MDP within so many standard deviations. Of an unknown sign, the one with the better
    /// prospects from where the agent is.
    fn hope(&mut self, number: u32, width: f64) {
        let (model, belief, mdp) = (&self.model, &self.belief, &mut self.imagined);
        expect(model, belief, mdp);
        for (parameter, &prior) in model.parameters.iter().enumerate() {
            mdp.values[parameter] = belief.posterior(parameter).quantile(prior, width);
        }
        self.optimism.clear();
        for pair in 0..model.pair_count() {
            let share = |(mean, deviation): (f64, f64)| (width * deviation / (1.0 - mean)).min(1.0);
            let likelihoods = model
                .outcomes_of(pair)
                .map(|outcome| belief.likelihood(model, pair, outcome));
            self.optimism.extend(likelihoods.map(|likelihood| {
                if likelihood.0 < 1.0 {
                    share(likelihood)
                } else {
                    0.0
                }
            }));
        }
        for parameter in 0..self.model.parameters.len() {
            if self.belief.posterior(parameter) == Posterior::UnknownSign {
                self.hope_for_sign(number, parameter);
            }
        }
    }

    fn hope_for_sign(&mut self, number: u32, parameter: usize) {
        let agent = &self.agents[number as usize];
        let mut policy = self.planner.empty_policy();
        let mut prospects = |sign: f64| {
            self.imagined.values[parameter] = sign;
            self.planner.plan(
                &self.model,
                &self.imagined,
                &self.optimism,
                agent.step,
                &mut policy,
            );
            self.planner.value(agent.state)
        };
        let sign = if prospects(-1.0) > prospects(1.0) {
            -1.0
        } else {
            1.0
        };
        self.imagined.values[parameter] = sign;
    }
}

/// The mean of a belief.
fn expect(model: &Model, belief: &Belief, mdp: &mut Mdp) {
    for (parameter, &prior) in model.parameters.iter().enumerate() {
        mdp.values[parameter] = belief.posterior(parameter).mean(prior);
    }
    for pair in 0..model.pair_count() {
        for outcome in model.outcomes_of(pair) {
            mdp.probabilities[outcome] = belief.likelihood(model, pair, outcome).0;
        }
    }
}
