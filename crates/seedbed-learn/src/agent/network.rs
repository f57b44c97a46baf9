//! A trainable network: shape, parameters, optimizer, and the initial parameters, towards which
//! training may be regularized.

use std::fmt::Display;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::nn::{Activations, Adam, AdamSettings, Mlp, Tensor, network_tensors};

/// A network with all that a gradient step needs.
pub(crate) struct Network {
    mlp: Mlp,
    /// Initial parameters θ̂ or φ̂ from the agent seed: `[P]`.
    initial_parameters: Vec<f32>,
    /// The parameters towards which training is regularized: the initial ones, with the output
    /// layer [normalized](Self::normalize_regularization) like that of the network: `[P]`.
    regularization_center: Vec<f32>,
    learned: LearnedState,
    activations: Activations,
    gradient: Vec<f32>,
}

/// The part of a network that training changes.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct LearnedState {
    parameters: Vec<f32>,
    optimizer: Adam,
}

/// How a gradient step is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Descent {
    /// Weight λ of the regularization towards the initial parameters.
    pub(crate) regularization: f32,
    /// Maximal Euclidean norm of the gradient.
    pub(crate) gradient_clip: Option<f32>,
    /// Factor on the optimizer's step size.
    pub(crate) step_size_factor: f64,
}

impl Network {
    /// A network that has not been trained yet.   `initial_parameters: [P]`
    pub(crate) fn new(mlp: Mlp, initial_parameters: Vec<f32>, optimizer: AdamSettings) -> Self {
        let learned = LearnedState {
            parameters: initial_parameters.clone(),
            optimizer: Adam::new(optimizer, initial_parameters.len()),
        };
        Self {
            mlp,
            gradient: vec![0.0; initial_parameters.len()],
            regularization_center: initial_parameters.clone(),
            initial_parameters,
            learned,
            activations: Activations::default(),
        }
    }

    /// Approximate number of bytes that a network of this shape needs: six numbers per parameter, and
    /// at a checkpoint ten for what is written (measured: 62 bytes per parameter).
    pub(crate) fn memory(mlp: &Mlp) -> u64 {
        64 * mlp.parameter_count() as u64
    }

    pub(crate) fn mlp(&self) -> &Mlp {
        &self.mlp
    }

    pub(crate) fn parameters(&self) -> &[f32] {
        &self.learned.parameters
    }

    pub(crate) fn parameters_mut(&mut self) -> &mut [f32] {
        &mut self.learned.parameters
    }

    /// Evaluates the network, and stores the activations for [`descend`](Self::descend).
    /// `inputs: [B × in]` → `[B × out]`
    pub(crate) fn forward(&mut self, inputs: &[f32]) -> &[f32] {
        self.mlp
            .forward(&self.learned.parameters, inputs, &mut self.activations)
    }

    /// One step of Adam along ∇L + λ (θ − θ̂): the regularization term is λψ with ψ = ½‖θ − θ̂‖²
    /// (thesis §3.4.3).
    ///
    /// `output_gradient: [B × out]` is the gradient of L with respect to the first B outputs of the
    /// latest forward pass, which must have had the same `inputs`.
    pub(crate) fn descend(&mut self, inputs: &[f32], output_gradient: &[f32], descent: &Descent) {
        let parameters = &mut self.learned.parameters;
        self.mlp.backward(
            parameters,
            inputs,
            &mut self.activations,
            output_gradient,
            &mut self.gradient,
        );
        if descent.regularization > 0.0 {
            for ((slope, parameter), initial) in self
                .gradient
                .iter_mut()
                .zip(parameters.iter())
                .zip(&self.regularization_center)
            {
                *slope += descent.regularization * (parameter - initial);
            }
        }
        if let Some(max_norm) = descent.gradient_clip {
            clip_norm(&mut self.gradient, max_norm);
        }
        self.learned
            .optimizer
            .descend(parameters, &self.gradient, descent.step_size_factor);
    }

    /// The gradient with respect to some inputs of the latest forward pass: see
    /// [`Mlp::input_gradient`].   `output_gradient: [B × out]` → `[B × columns]`
    pub(crate) fn input_gradient(
        &mut self,
        output_gradient: &[f32],
        columns: Range<usize>,
    ) -> &[f32] {
        let (parameters, activations) = (&self.learned.parameters, &mut self.activations);
        self.mlp
            .input_gradient(parameters, activations, output_gradient, columns)
    }

    /// The output layer's weights and biases.
    pub(crate) fn output_layer(&mut self) -> (&mut [f32], &mut [f32]) {
        self.mlp.output_layer(&mut self.learned.parameters)
    }

    /// Regularizes towards the same function as before when outputs are normalized with other
    /// moments: the output layer W = Ŵ/σ, b = (b̂ − μ)/σ has the denormalized outputs of Ŵ and b̂.
    pub(crate) fn normalize_regularization(&mut self, mean: f32, deviation: f32) {
        self.regularization_center
            .clone_from(&self.initial_parameters);
        let (weight, bias) = self.mlp.output_layer(&mut self.regularization_center);
        for w in weight {
            *w /= deviation;
        }
        for b in bias {
            *b = (*b - mean) / deviation;
        }
    }

    /// The parameters layer by layer, named after the network's `role`.
    pub(crate) fn tensors<'a>(
        &'a self,
        role: impl Display + 'a,
    ) -> impl Iterator<Item = Tensor<'a>> {
        network_tensors(&self.mlp, &self.learned.parameters, role)
    }

    /// The initial parameters layer by layer, named after the network's `role`.
    pub(crate) fn initial_tensors<'a>(
        &'a self,
        role: impl Display + 'a,
    ) -> impl Iterator<Item = Tensor<'a>> {
        network_tensors(&self.mlp, &self.initial_parameters, role)
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.learned
            .parameters
            .iter()
            .all(|parameter| parameter.is_finite())
    }

    pub(crate) fn learned_state(&self) -> &LearnedState {
        &self.learned
    }

    /// Copies the parameters of a network of the same shape.
    pub(crate) fn copy_parameters(&mut self, other: &Self) {
        self.learned
            .parameters
            .clone_from(&other.learned.parameters);
    }

    /// Returns to an earlier state.
    pub(crate) fn reset_to(&mut self, learned: &LearnedState) {
        self.learned.clone_from(learned);
    }

    pub(crate) fn restore(&mut self, learned: LearnedState) -> Result<(), String> {
        if learned.parameters.len() != self.initial_parameters.len() {
            return Err(format!(
                "the checkpoint has {} parameters of a network; expected {}",
                learned.parameters.len(),
                self.initial_parameters.len()
            ));
        }
        self.learned = learned;
        Ok(())
    }
}

/// Scales a gradient down to the norm c = `max_norm` if it is longer: g ← g min(1, c / ‖g‖).
fn clip_norm(gradient: &mut [f32], max_norm: f32) {
    let norm = gradient
        .iter()
        .map(|slope| f64::from(*slope).powi(2))
        .sum::<f64>()
        .sqrt() as f32;
    if norm > max_norm {
        for slope in gradient {
            *slope *= max_norm / norm;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ‖(3, 4)‖ = 5: a maximal norm of 2.5 halves the gradient; a maximal norm of 6 does not change
    /// it.
    #[test]
    fn norms_are_clipped() {
        let clipped = |max_norm| {
            let mut gradient = [3.0, 4.0];
            clip_norm(&mut gradient, max_norm);
            gradient
        };
        assert_eq!((clipped(2.5), clipped(6.0)), ([1.5, 2.0], [3.0, 4.0]));
    }

    /// The length of Adam's first step is α for any gradient, so a factor on α is visible.
    #[test]
    fn the_step_size_factor_scales_a_step() {
        let moved = |step_size_factor| {
            let mut network =
                Network::new(Mlp::new(&[1, 1]), vec![0.5, 0.5], AdamSettings::default());
            network.forward(&[1.0]);
            network.descend(
                &[1.0],
                &[1.0],
                &Descent {
                    regularization: 0.0,
                    gradient_clip: None,
                    step_size_factor,
                },
            );
            0.5 - network.parameters()[0]
        };
        assert!((moved(1.0) - 1e-3).abs() < 1e-6 && (moved(0.25) - 2.5e-4).abs() < 1e-6);
    }
}
