//! A stochastic policy: a network and the distribution over actions that its outputs describe (thesis §1.5.4).

use rand::RngExt;

use super::network::Network;
use super::{ActScratch, Tensor};
use crate::env::{Choice, Spec};
use crate::nn::{AdamSettings, Mlp};
use crate::random::Stream;
use crate::rl::categorical;

/// A categorical policy over the values of one discrete action.
pub(super) struct Policy {
    network: Network,
    choices: usize,
    /// `[T × choices]` of the latest [`evaluate`](Policy::evaluate).
    log_probs: Vec<f32>,
    output_gradient: Vec<f32>,
}

/// Says why no policy fits a task's actions, if none does.
pub(super) fn check(spec: &Spec) -> Result<(), String> {
    match spec.actions.as_slice() {
        [action] => match &action.choice {
            Choice::Discrete(_) => Ok(()),
            Choice::Continuous => Err(format!(
                "action `{}` of `{}` is continuous; SeedPg's policy is categorical and needs a discrete one",
                action.quantity.name, spec.name
            )),
        },
        actions => Err(format!("`{}` has {} actions at once; SeedPg needs exactly one", spec.name, actions.len())),
    }
}

/// The policy network of a task.
pub(super) fn shape(spec: &Spec, hidden: &[usize]) -> Mlp {
    let sizes: Vec<usize> = [spec.observation_width()].into_iter().chain(hidden.iter().copied()).chain([choices(spec)]).collect();
    Mlp::new(&sizes)
}

impl Policy {
    pub(super) fn new(spec: &Spec, mlp: Mlp, seed: Vec<f32>, optimiser: AdamSettings) -> Self {
        let network = Network::new(mlp, seed, optimiser);
        Self { network, choices: choices(spec), log_probs: Vec::new(), output_gradient: Vec::new() }
    }

    /// Samples an action and returns its log-probability.
    pub(super) fn sample(&self, observation: &[f32], random: &mut Stream, scratch: &mut ActScratch, action: &mut [f32]) -> f32 {
        let logits = self.network.mlp().forward(self.network.parameters(), observation, &mut scratch.activations);
        scratch.log_probs.clear();
        scratch.log_probs.extend_from_slice(logits);
        categorical::log_softmax_in_place(&mut scratch.log_probs, self.choices);
        let choice = categorical::choose(&scratch.log_probs, random.random());
        action[0] = choice as f32;
        scratch.log_probs[choice]
    }

    /// log π(aₜ|sₜ) for a trajectory.   `states: [T × observation width]`, `actions: [T]` → `log_probs: [T]`
    pub(super) fn evaluate(&mut self, states: &[f32], actions: &[f32], log_probs: &mut Vec<f32>) {
        let logits = self.network.forward(states);
        self.log_probs.clear();
        self.log_probs.extend_from_slice(logits);
        categorical::log_softmax_in_place(&mut self.log_probs, self.choices);
        log_probs.clear();
        let rows = self.log_probs.chunks_exact(self.choices);
        log_probs.extend(rows.zip(actions).map(|(row, &action)| row[action as usize]));
    }

    /// Mean entropy over the latest evaluated trajectory, nats.
    pub(super) fn mean_entropy(&self) -> f32 {
        let rows = self.log_probs.chunks_exact(self.choices);
        let count = rows.len().max(1) as f32;
        rows.map(categorical::entropy).sum::<f32>() / count
    }

    /// One step along the gradient of mean loss, given `slopes: [T]` = ∂lossₜ/∂log π(aₜ|sₜ) on the latest evaluated trajectory.
    pub(super) fn descend(&mut self, states: &[f32], actions: &[f32], slopes: &[f32], regularisation: f32) {
        self.output_gradient.resize(self.log_probs.len(), 0.0);
        let weight = 1.0 / slopes.len() as f32;
        let rows = self.log_probs.chunks_exact(self.choices).zip(self.output_gradient.chunks_exact_mut(self.choices));
        for ((row, gradient), (&action, slope)) in rows.zip(actions.iter().zip(slopes)) {
            categorical::log_prob_gradient(row, action as usize, weight * slope, gradient);
        }
        self.network.descend(states, &self.output_gradient, regularisation);
    }

    pub(super) fn tensors(&self) -> impl Iterator<Item = Tensor<'_>> {
        let named = |(name, shape, values)| Tensor { name: format!("policy.{name}"), shape, values };
        self.network.mlp().tensors(self.network.parameters()).map(named)
    }

    pub(super) fn network(&self) -> &Network {
        &self.network
    }

    pub(super) fn network_mut(&mut self) -> &mut Network {
        &mut self.network
    }
}

fn choices(spec: &Spec) -> usize {
    match &spec.actions[0].choice {
        Choice::Discrete(values) => values.len(),
        Choice::Continuous => unreachable!("checked before agents are built"),
    }
}
