//! A critic of continuous actions: a trained network Q(s, a), its target network, and optionally a
//! fixed random network (prior) that is added to both.
//!
//! Inputs are rows of a scaled observation and a relative action: `[B × (observation + action width)]`.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::network::{Descent, LearnedState, Network};
use crate::nn::{Activations, Mlp, Tensor, move_towards, network_tensors};

/// A critic with its target network.
pub(crate) struct Critic {
    network: Network,
    /// Parameters of the target network.
    target: Vec<f32>,
    prior: Option<Prior>,
}

/// A fixed random network that is added to the learned values.
struct Prior {
    parameters: Vec<f32>,
    /// Factor on its outputs.
    scale: f32,
    activations: Activations,
}

/// What a checkpoint holds of a critic.
#[derive(Serialize, Deserialize)]
pub(crate) struct SavedCritic<L, V> {
    learned: L,
    target: V,
}

impl Critic {
    /// A critic that has not been trained. `prior`: parameters of the prior, and the factor on its
    /// outputs
    pub(crate) fn new(network: Network, prior: Option<(Vec<f32>, f32)>) -> Self {
        Self {
            target: network.parameters().to_vec(),
            network,
            prior: prior.map(|(parameters, scale)| Prior {
                parameters,
                scale,
                activations: Activations::default(),
            }),
        }
    }

    /// Approximate number of bytes that a critic of this shape needs: in addition to the network, its
    /// target with a copy for checkpoints, and the prior.
    pub(crate) fn memory(mlp: &Mlp) -> u64 {
        Network::memory(mlp) + 16 * mlp.parameter_count() as u64
    }

    /// Appends the values of the inputs, for [`descend`](Self::descend) or
    /// [`add_input_gradient`](Self::add_input_gradient).   → `values: [… + B]`
    pub(crate) fn append_values(&mut self, inputs: &[f32], values: &mut Vec<f32>) {
        let start = values.len();
        values.extend_from_slice(self.network.forward(inputs));
        self.add_prior_values(inputs, &mut values[start..]);
    }

    /// Appends the values of the inputs by the target network.   → `values: [… + B]`
    pub(crate) fn append_target_values(
        &mut self,
        inputs: &[f32],
        activations: &mut Activations,
        values: &mut Vec<f32>,
    ) {
        let start = values.len();
        let mlp = self.network.mlp();
        values.extend_from_slice(mlp.forward(&self.target, inputs, activations));
        self.add_prior_values(inputs, &mut values[start..]);
    }

    fn add_prior_values(&mut self, inputs: &[f32], values: &mut [f32]) {
        let Some(prior) = &mut self.prior else { return };
        let mlp = self.network.mlp();
        let prior_values = mlp.forward(&prior.parameters, inputs, &mut prior.activations);
        for (value, prior_value) in values.iter_mut().zip(prior_values) {
            *value += prior.scale * prior_value;
        }
    }

    /// One gradient step on a loss.   `inputs`: of the latest values, `value_gradient: [B]`
    pub(crate) fn descend(&mut self, inputs: &[f32], value_gradient: &[f32], descent: &Descent) {
        self.network.descend(inputs, value_gradient, descent);
    }

    /// Adds the derivatives of Σ weight · value with respect to columns of the inputs of the latest
    /// values.   `weights: [B]` → `sum: [B × columns]`
    pub(crate) fn add_input_gradient(
        &mut self,
        weights: &[f32],
        columns: Range<usize>,
        sum: &mut [f32],
    ) {
        let slopes = self.network.input_gradient(weights, columns.clone());
        for (sum, slope) in sum.iter_mut().zip(slopes) {
            *sum += slope;
        }
        let Some(prior) = &mut self.prior else { return };
        let (mlp, activations) = (self.network.mlp(), &mut prior.activations);
        let slopes = mlp.input_gradient(&prior.parameters, activations, weights, columns);
        for (sum, slope) in sum.iter_mut().zip(slopes) {
            *sum += prior.scale * slope;
        }
    }

    /// Moves the target network towards the trained one: θ′ ← θ′ + τ (θ − θ′).
    pub(crate) fn move_target(&mut self, rate: f32) {
        move_towards(self.network.parameters(), rate, &mut self.target);
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.network.is_finite()
    }

    /// The networks, named e.g. `critic_0`, `target_0` and `prior_0`.
    pub(crate) fn tensors(&self, number: usize) -> Vec<Tensor<'_>> {
        let mlp = self.network.mlp();
        let prior = self.prior.as_ref().map(|prior| &prior.parameters[..]);
        let networks = [
            ("critic", Some(self.network.parameters())),
            ("target", Some(&self.target[..])),
            ("prior", prior),
        ];
        let mut tensors = Vec::new();
        for (role, parameters) in networks {
            if let Some(parameters) = parameters {
                let name = format!("{role}_{number}");
                tensors.extend(network_tensors(mlp, parameters, name));
            }
        }
        tensors
    }

    /// The initial parameters, named e.g. `initial.critic_0`.
    pub(crate) fn initial_tensors(&self, number: usize) -> Vec<Tensor<'_>> {
        let name = format!("initial.critic_{number}");
        self.network.initial_tensors(name).collect()
    }

    pub(crate) fn saved(&self) -> SavedCritic<&LearnedState, &[f32]> {
        SavedCritic {
            learned: self.network.learned_state(),
            target: &self.target,
        }
    }

    pub(crate) fn restore(
        &mut self,
        saved: SavedCritic<LearnedState, Vec<f32>>,
    ) -> Result<(), String> {
        if saved.target.len() != self.target.len() {
            return Err(format!(
                "the checkpoint has {} parameters of a target network; expected {}",
                saved.target.len(),
                self.target.len()
            ));
        }
        self.network.restore(saved.learned)?;
        self.target = saved.target;
        Ok(())
    }
}
