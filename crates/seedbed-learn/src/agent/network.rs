//! A network that learns: its shape, parameters, optimizer, and the seed that it may be pulled back
//! to.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::Tensor;

use crate::nn::{Activations, Adam, AdamSettings, Mlp};

/// A network with everything that one gradient step needs.
pub(crate) struct Network {
    mlp: Mlp,
    /// Parameters at instantiation: θ̂ or φ̂.
    seed: Vec<f32>,
    learned: Learned,
    activations: Activations,
    gradient: Vec<f32>,
}

/// What learning changes.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Learned {
    parameters: Vec<f32>,
    optimiser: Adam,
}

/// How a gradient becomes a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Descent {
    /// λ
    pub(crate) regularisation: f32,
    /// A bound on the gradient's Euclidean norm.
    pub(crate) gradient_clip: Option<f32>,
    /// On the optimizer's step size.
    pub(crate) step_size_factor: f64,
}

impl Network {
    /// A network that starts at `seed`: `[parameter count]`.
    pub(crate) fn new(mlp: Mlp, seed: Vec<f32>, optimiser: AdamSettings) -> Self {
        let learned = Learned {
            parameters: seed.clone(),
            optimiser: Adam::new(optimiser, seed.len()),
        };
        Self {
            mlp,
            gradient: vec![0.0; seed.len()],
            seed,
            learned,
            activations: Activations::default(),
        }
    }

    pub(crate) fn mlp(&self) -> &Mlp {
        &self.mlp
    }

    pub(crate) fn parameters(&self) -> &[f32] {
        &self.learned.parameters
    }

    /// `inputs: [B × in]` → `[B × out]`, kept for [`descend`](Self::descend).
    pub(crate) fn forward(&mut self, inputs: &[f32]) -> &[f32] {
        self.mlp
            .forward(&self.learned.parameters, inputs, &mut self.activations)
    }

    /// One step of Adam along ∇L + λ (θ − θ̂), the seed regulariser being ψ = ½‖θ − θ̂‖² (thesis
    /// §3.4.3).
    ///
    /// `output_gradient: [B × out]` belongs to the latest forward pass, of these `inputs`.
    pub(crate) fn descend(&mut self, inputs: &[f32], output_gradient: &[f32], descent: &Descent) {
        let parameters = &mut self.learned.parameters;
        self.mlp.backward(
            parameters,
            inputs,
            &mut self.activations,
            output_gradient,
            &mut self.gradient,
        );
        if descent.regularisation > 0.0 {
            for ((slope, parameter), seed) in self
                .gradient
                .iter_mut()
                .zip(parameters.iter())
                .zip(&self.seed)
            {
                *slope += descent.regularisation * (parameter - seed);
            }
        }
        if let Some(most) = descent.gradient_clip {
            clip_norm(&mut self.gradient, most);
        }
        self.learned
            .optimiser
            .descend(parameters, &self.gradient, descent.step_size_factor);
    }

    /// The output layer's weights and biases.
    pub(crate) fn output_layer(&mut self) -> (&mut [f32], &mut [f32]) {
        self.mlp.output_layer(&mut self.learned.parameters)
    }

    /// The parameters layer by layer, named after the network's `role`.
    pub(crate) fn tensors<'a>(&'a self, role: &'a str) -> impl Iterator<Item = Tensor<'a>> {
        let tensors = self.mlp.tensors(&self.learned.parameters);
        tensors.map(move |(name, shape, values)| Tensor {
            name: format!("{role}.{name}"),
            shape,
            values: Cow::Borrowed(values),
        })
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.learned
            .parameters
            .iter()
            .all(|parameter| parameter.is_finite())
    }

    pub(crate) fn learned(&self) -> &Learned {
        &self.learned
    }

    /// Goes back to where it once stood.
    pub(crate) fn restart(&mut self, learned: &Learned) {
        self.learned.clone_from(learned);
    }

    pub(crate) fn restore(&mut self, learned: Learned) -> Result<(), String> {
        if learned.parameters.len() != self.seed.len() {
            return Err(format!(
                "{} parameters stored for a network of {}",
                learned.parameters.len(),
                self.seed.len()
            ));
        }
        self.learned = learned;
        Ok(())
    }
}

/// g ← g min(1, c / ‖g‖).
fn clip_norm(gradient: &mut [f32], most: f32) {
    let norm = gradient
        .iter()
        .map(|slope| f64::from(*slope).powi(2))
        .sum::<f64>()
        .sqrt() as f32;
    if norm > most {
        for slope in gradient {
            *slope *= most / norm;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ‖(3, 4)‖ = 5: bounded by 2.5 it is halved, bounded by 6 it stays.
    #[test]
    fn norms_are_clipped() {
        let clipped = |most| {
            let mut gradient = [3.0, 4.0];
            clip_norm(&mut gradient, most);
            gradient
        };
        assert_eq!((clipped(2.5), clipped(6.0)), ([1.5, 2.0], [3.0, 4.0]));
    }

    /// Adam's first step is α wherever the gradient points, so a factor on α shows.
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
                    regularisation: 0.0,
                    gradient_clip: None,
                    step_size_factor,
                },
            );
            0.5 - network.parameters()[0]
        };
        assert!((moved(1.0) - 1e-3).abs() < 1e-6 && (moved(0.25) - 2.5e-4).abs() < 1e-6);
    }
}
