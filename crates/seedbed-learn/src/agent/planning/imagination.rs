//! Imagined rollouts: what a network of the dynamics predicts for sequences of actions.

use crate::agent::dynamics::DynamicsModel;
use crate::agent::dynamics::transitions::{OUTCOME_LIMIT, OUTCOMES};
use crate::nn::bayesian::PassBuffers;
use crate::nn::{Likelihood, STANDARDIZED_LIMIT};

/// Rollouts in one network, whose weights the caller provides.
pub(crate) struct Imagination<'a> {
    pub(crate) likelihood: &'a Likelihood,
    pub(crate) weights: &'a [f32],
    pub(crate) units: &'a ModelUnits,
    /// Discount γ per step.
    pub(crate) discount: f32,
    /// Number of steps for which each action is held.
    pub(crate) hold: usize,
}

/// The units of the inputs and the outputs of a model.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ModelUnits {
    /// Mean and reciprocal of the standard deviation of each input: `[in]`.
    inputs: Vec<[f32; 2]>,
    /// Unit of each change of the observation: `[observation width]`.
    changes: Vec<f32>,
    /// Units of the reward and of the end.
    outcomes: [f32; OUTCOMES],
}

/// Buffers for rollouts, reused from rollout to rollout.
#[derive(Debug, Default)]
pub(crate) struct ImaginationBuffers {
    /// The imagined observations: `[N × observation width]`.
    states: Vec<f32>,
    /// The factor on further rewards of each rollout: γᵗ and the probability that it has not ended.
    weights: Vec<f32>,
    inputs: Vec<f32>,
    pass: PassBuffers,
}

/// Largest absolute value of an input or a predicted change in its unit, as in training.
const LIMIT: f32 = STANDARDIZED_LIMIT as f32;

impl ModelUnits {
    /// The units of a model that predicts outcomes.
    pub(crate) fn of_model(model: &DynamicsModel) -> Self {
        let encoder = model.encoder();
        let [mean, deviation, changes] = encoder.tensors().map(|tensor| tensor.values);
        let inputs = mean.iter().zip(deviation.iter());
        let outcomes = encoder
            .outcome_units()
            .expect("the model predicts outcomes");
        Self {
            inputs: inputs
                .map(|(mean, deviation)| [*mean, 1.0 / deviation])
                .collect(),
            changes: changes.into_owned(),
            outcomes: outcomes.units(),
        }
    }
}

impl Imagination<'_> {
    /// The imagined return of each sequence of actions, all from the same observation: Σ γᵗ `r_t` Π
    /// (1 − `d_u`) over steps t and earlier steps u, where r is the predicted reward and d the
    /// predicted end, within 0 to 1. Nothing is added beyond the last action.
    /// `sequences: [N × horizon × action inputs]` → `returns: [N]`
    pub(crate) fn compute_returns(
        &self,
        observation: &[f32],
        sequences: &[f32],
        buffers: &mut ImaginationBuffers,
        returns: &mut [f32],
    ) {
        let action_width = self.units.inputs.len() - observation.len();
        let length = sequences.len() / returns.len();
        let ImaginationBuffers {
            states, weights, ..
        } = buffers;
        states.clear();
        for _ in 0..returns.len() {
            states.extend_from_slice(observation);
        }
        weights.clear();
        weights.resize(returns.len(), 1.0);
        returns.fill(0.0);
        for action in (0..length).step_by(action_width) {
            for _ in 0..self.hold {
                let actions = sequences
                    .chunks_exact(length)
                    .map(|sequence| &sequence[action..action + action_width]);
                self.fill_inputs(actions, buffers);
                self.step(buffers, returns);
            }
        }
    }

    /// Writes the inputs of the network: the standardized states and actions.
    fn fill_inputs<'b>(
        &self,
        actions: impl Iterator<Item = &'b [f32]>,
        buffers: &mut ImaginationBuffers,
    ) {
        let ImaginationBuffers { states, inputs, .. } = buffers;
        inputs.clear();
        let states = states.chunks_exact(self.units.changes.len());
        for (state, action) in states.zip(actions) {
            let row = state.iter().chain(action).zip(&self.units.inputs);
            inputs
                .extend(row.map(|(x, [mean, factor])| ((x - mean) * factor).clamp(-LIMIT, LIMIT)));
        }
    }

    /// Advances all rollouts by one step, and adds its rewards to the returns.
    fn step(&self, buffers: &mut ImaginationBuffers, returns: &mut [f32]) {
        let ImaginationBuffers {
            states,
            weights,
            inputs,
            pass,
        } = buffers;
        let outputs = self.likelihood.forward(self.weights, inputs, pass);
        let width = self.units.changes.len();
        let [reward_unit, end_unit] = self.units.outcomes;
        let rows = outputs.chunks_exact(width + OUTCOMES);
        let rows = rows.zip(states.chunks_exact_mut(width));
        for ((outputs, state), (weight, sum)) in rows.zip(weights.iter_mut().zip(returns)) {
            let (changes, outcomes) = outputs.split_at(width);
            for ((x, change), unit) in state.iter_mut().zip(changes).zip(&self.units.changes) {
                *x += unit * change.clamp(-LIMIT, LIMIT);
            }
            let reward = reward_unit * outcomes[0].clamp(-OUTCOME_LIMIT, OUTCOME_LIMIT);
            let end = (end_unit * outcomes[1]).clamp(0.0, 1.0);
            *sum += *weight * reward;
            *weight *= self.discount * (1.0 - end);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One observation, one action, no hidden layer: with u = (2, 3) and outputs
    /// Δ = 0.5 x + 0.25 a, r = x + 0.1 and d = 0.125 (x in its unit, so that d is at most 1).
    /// From x = 4, input mean 1 and deviation 2 (action: mean 0, deviation 1), actions −1, 1, each
    /// held for two steps, γ = 0.5.
    #[test]
    fn returns_agree_with_a_written_out_rollout() {
        let likelihood = Likelihood::new(&[2, 3], 1.0);
        // [in × out], then the biases.
        let weights = [0.5, 1.0, 0.125, 0.25, 0.0, 0.0, 0.0, 0.1, 0.0];
        let units = ModelUnits {
            inputs: vec![[1.0, 0.5], [0.0, 1.0]],
            changes: vec![2.0],
            outcomes: [3.0, 0.5],
        };
        let imagination = Imagination {
            likelihood: &likelihood,
            weights: &weights,
            units: &units,
            discount: 0.5,
            hold: 2,
        };
        let rollout = |actions: [f64; 2]| {
            let (mut x, mut weight, mut sum) = (4.0, 1.0, 0.0);
            for action in [actions[0], actions[0], actions[1], actions[1]] {
                let scaled: f64 = (x - 1.0) / 2.0;
                sum += weight * 3.0 * (scaled + 0.1);
                weight *= 0.5 * (1.0 - (0.5 * 0.125 * scaled).clamp(0.0, 1.0));
                x += 2.0 * (0.5 * scaled + 0.25 * action);
            }
            sum as f32
        };
        let mut returns = [9.0; 2];
        let mut buffers = ImaginationBuffers::default();
        for _ in 0..2 {
            let sequences = [-1.0, 1.0, 0.5, 0.0];
            imagination.compute_returns(&[4.0], &sequences, &mut buffers, &mut returns);
            for (found, expected) in returns.iter().zip([[-1.0, 1.0], [0.5, 0.0]].map(rollout)) {
                assert!((found - expected).abs() < 1e-4, "{found} {expected}");
            }
        }
    }

    /// A reward of 1 per step, and an end that is certain where x > 0: from x = 1, only the first
    /// reward counts; from x = −1, where d is clamped to 0, all three.
    #[test]
    fn no_reward_follows_a_certain_end() {
        let likelihood = Likelihood::new(&[2, 3], 1.0);
        let weights = [0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let units = ModelUnits {
            inputs: vec![[0.0, 1.0]; 2],
            changes: vec![1.0],
            outcomes: [1.0, 1.0],
        };
        let imagination = Imagination {
            likelihood: &likelihood,
            weights: &weights,
            units: &units,
            discount: 1.0,
            hold: 1,
        };
        for (start, expected) in [(1.0, 1.0), (-1.0, 3.0)] {
            let mut returns = [0.0];
            let mut buffers = ImaginationBuffers::default();
            imagination.compute_returns(&[start], &[0.0; 3], &mut buffers, &mut returns);
            assert_eq!(returns, [expected]);
        }
    }
}
