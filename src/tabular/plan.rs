//! Planning: the best policy of an MDP over the steps that are left, by backward induction.

use seedbed_env::tabular::{Mdp, Model};

/// Finds best policies in MDPs of one model.
///
/// Only states that can be reached from the start in h steps are looked at for step h.
#[derive(Clone, Debug)]
pub struct Planner {
    /// States that can be reached in h steps and have actions: `[horizon][…]`.
    layers: Vec<Vec<u32>>,
    states: usize,
    /// Of the next step and of the step at hand: `[states]` each.
    values: [Vec<f64>; 2],
    /// Mean reward of each outcome: `[outcomes]`.
    rewards: Vec<f64>,
}

/// A best action for each step and state: `[horizon × states]`. Unreachable states have action 0.
pub type Policy = Vec<u8>;

impl Planner {
    /// A planner for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let states = model.states();
        Self {
            layers: layers(model),
            states,
            values: [vec![0.0; states], vec![0.0; states]],
            rewards: vec![0.0; model.outcomes().len()],
        }
    }

    /// A policy for [`plan`](Self::plan) to fill.
    #[must_use]
    pub fn empty_policy(&self) -> Policy {
        vec![0; self.policy_length()]
    }

    /// Entries of a policy.
    #[must_use]
    pub fn policy_length(&self) -> usize {
        self.layers.len() * self.states
    }

    /// Fills the best actions from step `from` on; the first one where several are as good. With V
    /// of the step after the last 0,
    ///
    /// Vₕ(s) = maxₐ Σ p (r + Vₕ₊₁(s′)) over the outcomes (p, r, s′) of (s, a).
    ///
    /// Where there is `optimism`, `[outcomes]`, each pair's best outcome takes that share of the
    /// likelihood of all others, as in the extended value iteration of Jaksch et al. 2010, §3.1.2.
    pub fn plan(
        &mut self,
        model: &Model,
        mdp: &Mdp,
        optimism: &[f64],
        from: u32,
        policy: &mut Policy,
    ) {
        (0..self.rewards.len())
            .for_each(|outcome| self.rewards[outcome] = model.mean_reward(outcome, &mdp.values));
        self.values[0].fill(0.0);
        for step in (from as usize..self.layers.len()).rev() {
            let [after, now] = &mut self.values;
            for &state in &self.layers[step] {
                let backup = Backup {
                    model,
                    mdp,
                    optimism,
                    rewards: &self.rewards,
                    after,
                };
                let (action, value) = backup.best(state);
                now[state as usize] = value;
                policy[step * self.states + state as usize] = action;
            }
            self.values.swap(0, 1);
        }
    }

    /// The value of a state at the step from which the latest plan was made.
    #[must_use]
    pub fn value(&self, state: u32) -> f64 {
        self.values[0][state as usize]
    }

    /// What a policy does.
    #[must_use]
    pub fn action(&self, policy: &Policy, step: u32, state: u32) -> usize {
        usize::from(policy[step as usize * self.states + state as usize])
    }

    /// What the best policy of `mdp` earns in an episode on average.
    #[must_use]
    pub fn optimal_value(&mut self, model: &Model, mdp: &Mdp) -> f64 {
        let mut policy = self.empty_policy();
        self.plan(model, mdp, &[], 0, &mut policy);
        self.value(model.start)
    }
}

/// What one step of backward induction looks at.
struct Backup<'a> {
    model: &'a Model,
    mdp: &'a Mdp,
    optimism: &'a [f64],
    rewards: &'a [f64],
    after: &'a [f64],
}

impl Backup<'_> {
    fn best(&self, state: u32) -> (u8, f64) {
        let mut best = (0, f64::NEG_INFINITY);
        for (pair, action) in self.model.pairs(state).zip(0..) {
            let value = self.value(pair);
            if value > best.1 {
                best = (action, value);
            }
        }
        best
    }

    fn value(&self, pair: usize) -> f64 {
        let outcomes = self.model.outcomes_of(pair);
        if outcomes.len() == 1 {
            return self.worth(outcomes.start);
        }
        let (mut mean, mut best) = (0.0, (f64::NEG_INFINITY, 0));
        for outcome in outcomes {
            let worth = self.worth(outcome);
            mean += self.mdp.probabilities[outcome] * worth;
            best = if worth > best.0 {
                (worth, outcome)
            } else {
                best
            };
        }
        if self.optimism.is_empty() {
            mean
        } else {
            mean + self.optimism[best.1] * (best.0 - mean)
        }
    }

    /// The reward of an outcome, and all that may follow.
    fn worth(&self, outcome: usize) -> f64 {
        self.rewards[outcome] + self.after[self.model.outcomes()[outcome].state as usize]
    }
}

/// States that can be reached in 0, 1, … steps and have actions, in order.
fn layers(model: &Model) -> Vec<Vec<u32>> {
    let next = |layer: &Vec<u32>| {
        let mut states: Vec<u32> = layer
            .iter()
            .flat_map(|&state| model.pairs(state))
            .flat_map(|pair| model.outcomes_of(pair))
            .map(|outcome| model.outcomes()[outcome].state)
            .filter(|&state| !model.pairs(state).is_empty())
            .collect();
        states.sort_unstable();
        states.dedup();
        Some(states)
    };
    std::iter::successors(Some(vec![model.start]), next)
        .take(model.horizon as usize)
        .collect()
}
