//! A network that learns: its shape, parameters, optimiser, and the seed that it may be pulled back to.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::Tensor;

use crate::nn::{Activations, Adam, AdamSettings, Mlp};

/// A network with everything that one gradient step needs.
pub(super) struct Network {
    mlp: Mlp,
    /// Parameters at instantiation: θ̂ or φ̂.
    seed: Vec<f32>,
    learned: Learned,
    activations: Activations,
    gradient: Vec<f32>,
}

/// What learning changes.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Learned {
    parameters: Vec<f32>,
    optimiser: Adam,
}

impl Network {
    /// A network that starts at `seed`: `[parameter count]`.
    pub(super) fn new(mlp: Mlp, seed: Vec<f32>, optimiser: AdamSettings) -> Self {
        let learned = Learned { parameters: seed.clone(), optimiser: Adam::new(optimiser, seed.len()) };
        Self { mlp, gradient: vec![0.0; seed.len()], seed, learned, activations: Activations::default() }
    }

    pub(super) fn mlp(&self) -> &Mlp {
        &self.mlp
    }

    pub(super) fn parameters(&self) -> &[f32] {
        &self.learned.parameters
    }

    /// `inputs: [B × in]` → `[B × out]`, kept for [`descend`](Self::descend).
    pub(super) fn forward(&mut self, inputs: &[f32]) -> &[f32] {
        self.mlp.forward(&self.learned.parameters, inputs, &mut self.activations)
    }

    /// One step of Adam along ∇L + λ (θ − θ̂), the seed regulariser being ψ = ½‖θ − θ̂‖² (thesis §3.4.3).
    ///
    /// `output_gradient: [B × out]` belongs to the latest forward pass, of these `inputs`.
    pub(super) fn descend(&mut self, inputs: &[f32], output_gradient: &[f32], regularisation: f32) {
        let parameters = &mut self.learned.parameters;
        self.mlp.backward(parameters, inputs, &mut self.activations, output_gradient, &mut self.gradient);
        if regularisation > 0.0 {
            for ((slope, parameter), seed) in self.gradient.iter_mut().zip(parameters.iter()).zip(&self.seed) {
                *slope += regularisation * (parameter - seed);
            }
        }
        self.learned.optimiser.descend(parameters, &self.gradient);
    }

    /// The output layer's weights and biases.
    pub(super) fn output_layer(&mut self) -> (&mut [f32], &mut [f32]) {
        self.mlp.output_layer(&mut self.learned.parameters)
    }

    /// The parameters layer by layer, named after the network's `role`.
    pub(super) fn tensors<'a>(&'a self, role: &'a str) -> impl Iterator<Item = Tensor<'a>> {
        let tensors = self.mlp.tensors(&self.learned.parameters);
        tensors.map(move |(name, shape, values)| Tensor { name: format!("{role}.{name}"), shape, values: Cow::Borrowed(values) })
    }

    pub(super) fn learned(&self) -> &Learned {
        &self.learned
    }

    pub(super) fn restore(&mut self, learned: Learned) -> Result<(), String> {
        if learned.parameters.len() != self.seed.len() {
            return Err(format!("{} parameters stored for a network of {}", learned.parameters.len(), self.seed.len()));
        }
        self.learned = learned;
        Ok(())
    }
}
