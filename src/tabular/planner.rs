//! Planning: the optimal policy of an MDP over the remaining steps, by backward induction.

use seedbed_env::tabular::{Mdp, Model};
use seedbed_learn::cancellation::cancellation_point;

/// Finds optimal policies of MDPs of one model.
///
/// For step h, only those states are considered that can be reached from the start in h steps.
#[derive(Clone, Debug)]
pub struct Planner {
    /// States that can be reached in h steps and have actions: `[horizon][…]`.
    layers: Vec<Vec<u32>>,
    states: usize,
    /// State values at the next step and at the current step: `[states]` each. After planning, the
    /// first has the values at the first planned step.
    values: [Vec<f64>; 2],
    /// Mean reward of each outcome: `[outcomes]`.
    rewards: Vec<f64>,
}

/// Optimal action for each step and state, as its index among the state's actions:
/// `[horizon × states]`. Unreachable states have action 0.
pub type Policy = Vec<u8>;

impl Planner {
    /// A planner for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let states = model.state_count();
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

    /// Number of entries of a policy.
    #[must_use]
    pub fn policy_length(&self) -> usize {
        self.layers.len() * self.states
    }

    /// Sets the optimal actions of `policy` for `first_step` and all later steps; the first action
    /// if several are equally good. Values are 0 after the last step, and before that
    ///
    /// Vₕ(s) = maxₐ Σ p (r + Vₕ₊₁(s′)) over the outcomes (p, r, s′) of (s, a).
    ///
    /// `optimism` may make pairs better than they are in `mdp`.
    pub fn plan(
        &mut self,
        model: &Model,
        mdp: &Mdp,
        optimism: Optimism<'_>,
        first_step: u32,
        policy: &mut Policy,
    ) {
        for (outcome, reward) in self.rewards.iter_mut().enumerate() {
            *reward = model.mean_reward(outcome, &mdp.values);
        }
        self.values[0].fill(0.0);
        for step in (first_step as usize..self.layers.len()).rev() {
            cancellation_point();
            let [next_values, values] = &mut self.values;
            for &state in &self.layers[step] {
                let backup = Backup {
                    model,
                    mdp,
                    optimism,
                    rewards: &self.rewards,
                    next_values,
                };
                let (action, value) = backup.best_action(state);
                values[state as usize] = value;
                policy[step * self.states + state as usize] = action;
            }
            self.values.swap(0, 1);
        }
    }

    /// Value of a state at the `first_step` of the latest call of [`plan`](Self::plan).
    #[must_use]
    pub fn value(&self, state: u32) -> f64 {
        self.values[0][state as usize]
    }

    /// Action that a policy chooses in a state at a step, as its index among the state's actions.
    #[must_use]
    pub fn action(&self, policy: &Policy, step: u32, state: u32) -> usize {
        usize::from(policy[step as usize * self.states + state as usize])
    }

    /// State-action pairs that an agent in `state` at step `first_step` chooses in later steps, if it
    /// follows a policy in `mdp`, each with the expected number of choices in one of these steps.
    #[must_use]
    pub fn expected_choices(
        &self,
        model: &Model,
        mdp: &Mdp,
        policy: &Policy,
        (first_step, state): (u32, u32),
    ) -> Vec<(usize, f64)> {
        let (mut choices, mut shares) = (Vec::new(), vec![0.0; self.states]);
        shares[state as usize] = 1.0;
        for step in first_step..self.layers.len() as u32 {
            cancellation_point();
            let mut next_shares = vec![0.0; self.states];
            for &state in &self.layers[step as usize] {
                let share = shares[state as usize];
                if share == 0.0 {
                    continue;
                }
                let pair = model.pairs(state).start + self.action(policy, step, state);
                if step > first_step {
                    choices.push((pair, share));
                }
                for outcome in model.outcomes_of(pair) {
                    let next = model.outcomes()[outcome].state as usize;
                    next_shares[next] += share * mdp.probabilities[outcome];
                }
            }
            shares = next_shares;
        }
        choices
    }

    /// Expected return of an episode under the optimal policy of `mdp`.
    #[must_use]
    pub fn optimal_value(&mut self, model: &Model, mdp: &Mdp) -> f64 {
        let mut policy = self.empty_policy();
        self.plan(model, mdp, Optimism::default(), 0, &mut policy);
        self.value(model.start)
    }
}

/// How much better than in an MDP an agent imagines its task.
#[derive(Clone, Copy, Debug, Default)]
pub struct Optimism<'a> {
    /// The share of each outcome, `[outcomes]`, or empty: the best outcome of a pair takes its share of
    /// the probability of all others, as in the extended value iteration of Jaksch et al. 2010, §3.1.2.
    pub outcomes: &'a [f64],
    /// What is added to the value of each state-action pair, `[pairs]`, or empty.
    pub bonuses: &'a [f64],
}

/// Inputs of one step of backward induction.
struct Backup<'a> {
    model: &'a Model,
    mdp: &'a Mdp,
    optimism: Optimism<'a>,
    rewards: &'a [f64],
    /// State values at the next step.
    next_values: &'a [f64],
}

impl Backup<'_> {
    /// The optimal action of a state, and its value.
    fn best_action(&self, state: u32) -> (u8, f64) {
        let mut best = (0, f64::NEG_INFINITY);
        for (pair, action) in self.model.pairs(state).zip(0..) {
            let value = self.pair_value(pair);
            if value > best.1 {
                best = (action, value);
            }
        }
        best
    }

    /// Value of a state-action pair.
    fn pair_value(&self, pair: usize) -> f64 {
        let bonus = self.optimism.bonuses.get(pair).copied();
        bonus.unwrap_or(0.0) + self.value_of_outcomes(pair)
    }

    /// Value of a pair without its bonus.
    fn value_of_outcomes(&self, pair: usize) -> f64 {
        let outcomes = self.model.outcomes_of(pair);
        if outcomes.len() == 1 {
            return self.outcome_value(outcomes.start);
        }
        let (mut mean, mut best) = (0.0, (f64::NEG_INFINITY, 0));
        for outcome in outcomes {
            let value = self.outcome_value(outcome);
            mean += self.mdp.probabilities[outcome] * value;
            if value > best.0 {
                best = (value, outcome);
            }
        }
        if self.optimism.outcomes.is_empty() {
            mean
        } else {
            mean + self.optimism.outcomes[best.1] * (best.0 - mean)
        }
    }

    /// Reward of an outcome plus the value of its next state.
    fn outcome_value(&self, outcome: usize) -> f64 {
        self.rewards[outcome] + self.next_values[self.model.outcomes()[outcome].state as usize]
    }
}

/// Entry h has the states with actions that can be reached in h steps, sorted: `[horizon][…]`.
fn layers(model: &Model) -> Vec<Vec<u32>> {
    let mut layers: Vec<Vec<u32>> = Vec::with_capacity(model.horizon as usize);
    let mut layer = vec![model.start];
    for _ in 0..model.horizon {
        cancellation_point();
        let next = next_layer(model, &layer);
        layers.push(std::mem::replace(&mut layer, next));
    }
    layers
}

/// States with actions that can be reached from `layer` in one step, sorted.
fn next_layer(model: &Model, layer: &[u32]) -> Vec<u32> {
    let pairs = layer.iter().flat_map(|&state| model.pairs(state));
    let mut states: Vec<u32> = pairs
        .flat_map(|pair| model.outcomes_of(pair))
        .map(|outcome| model.outcomes()[outcome].state)
        .filter(|&state| !model.pairs(state).is_empty())
        .collect();
    states.sort_unstable();
    states.dedup();
    states
}
