//! Multi-layer perceptrons with tanh between the layers and a linear output.

use std::ops::Range;

use rand::{Rng, RngExt};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::kernels;
use seedbed_env::input::numbers::FiniteNumber;

/// The shape of a network; its parameters live elsewhere, as one flat vector.
///
/// Layer by layer: weight `[in × out]`, then bias `[out]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mlp {
    layers: Vec<Layer>,
}

/// Initial parameters.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Initial {
    /// Uniform within ±1/√(inputs of the layer), weights and biases.
    Random,
    /// Every parameter the same (thesis Fig. 6.4c).
    Constant(FiniteNumber),
}

/// What a forward pass leaves for the backward pass, and scratch space. Grows to the largest batch,
/// then allocates no more.
#[derive(Clone, Debug, Default)]
pub struct Activations {
    /// `[B × size]` of every layer after the input.
    layers: Vec<Vec<f32>>,
    /// ∂L/∂(what enters the layer's activation), of the layer at hand and of the one below.
    deltas: [Vec<f32>; 2],
    scratch: Vec<f32>,
}

impl Mlp {
    /// A network with these layer sizes, the input first.
    ///
    /// # Panics
    /// With fewer than two layers or an empty one.
    #[must_use]
    pub fn new(sizes: &[usize]) -> Self {
        assert!(
            sizes.len() >= 2 && sizes.iter().all(|&size| size > 0),
            "an input and an output, none empty: {sizes:?}"
        );
        let mut start = 0;
        let layer = |(index, pair): (usize, &[usize])| {
            let layer = Layer {
                index,
                inputs: pair[0],
                outputs: pair[1],
                start,
            };
            start = layer.end();
            layer
        };
        Self {
            layers: sizes.windows(2).enumerate().map(layer).collect(),
        }
    }

    /// Number of parameters.
    #[must_use]
    pub fn parameter_count(&self) -> usize {
        self.output().end()
    }

    /// Numbers that enter.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.layers[0].inputs
    }

    /// Numbers that come out.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.output().outputs
    }

    /// Fresh parameters: `[parameter count]`.
    pub fn initial(&self, initial: Initial, random: &mut impl Rng) -> Vec<f32> {
        match initial {
            Initial::Constant(value) => vec![value.get_f32(); self.parameter_count()],
            Initial::Random => {
                let mut parameters = Vec::with_capacity(self.parameter_count());
                for layer in &self.layers {
                    let bound = 1.0 / (layer.inputs as f32).sqrt();
                    let count = layer.inputs * layer.outputs + layer.outputs;
                    parameters.extend((0..count).map(|_| random.random_range(-bound..=bound)));
                }
                parameters
            }
        }
    }

    /// The network's outputs.   `inputs: [B × in]` → `[B × out]`
    ///
    /// # Panics
    /// If a slice has another shape.
    pub fn forward<'a>(
        &self,
        parameters: &[f32],
        inputs: &[f32],
        activations: &'a mut Activations,
    ) -> &'a [f32] {
        assert_eq!(parameters.len(), self.parameter_count());
        let batch = inputs.len() / self.inputs();
        activations.layers.resize_with(self.layers.len(), Vec::new);
        for layer in &self.layers {
            let (below, here) = activations.layers.split_at_mut(layer.index);
            let x = below.last().map_or(inputs, Vec::as_slice);
            here[0].resize(batch * layer.outputs, 0.0);
            kernels::affine(
                layer.weight(parameters),
                layer.bias(parameters),
                x,
                &mut here[0],
                &mut activations.scratch,
            );
            if layer.index + 1 < self.layers.len() {
                kernels::tanh_in_place(&mut here[0]);
            }
        }
        activations.output()
    }

    /// The gradient of a loss with respect to the parameters, from its gradient with respect to the
    /// outputs of the latest forward pass.   `inputs: [B × in]`, `output_gradient: [B × out]` →
    /// `gradient: [parameter count]`, overwritten.
    ///
    /// # Panics
    /// If a slice has another shape.
    pub fn backward(
        &self,
        parameters: &[f32],
        inputs: &[f32],
        activations: &mut Activations,
        output_gradient: &[f32],
        gradient: &mut [f32],
    ) {
        assert_eq!(gradient.len(), self.parameter_count());
        let Activations {
            layers,
            deltas: [delta, below],
            scratch,
        } = activations;
        delta.clear();
        delta.extend_from_slice(output_gradient);
        for layer in self.layers.iter().rev() {
            let x = if layer.index == 0 {
                inputs
            } else {
                &layers[layer.index - 1]
            };
            let (dw, db) = layer.split_mut(gradient);
            kernels::parameter_gradient(x, delta, dw, db, scratch);
            if layer.index > 0 {
                below.resize(x.len(), 0.0);
                kernels::input_gradient(
                    layer.weight(parameters),
                    delta,
                    below,
                    layer.outputs,
                    scratch,
                );
                kernels::tanh_gradient_in_place(x, below);
                std::mem::swap(delta, below);
            }
        }
    }

    /// The output layer's weights and biases: `[in × out]` and `[out]`.
    pub fn output_layer<'a>(&self, parameters: &'a mut [f32]) -> (&'a mut [f32], &'a mut [f32]) {
        self.output().split_mut(parameters)
    }

    /// Names, shapes and values of the parameters, layer by layer.
    pub fn tensors<'a>(
        &self,
        parameters: &'a [f32],
    ) -> impl Iterator<Item = (String, Vec<usize>, &'a [f32])> {
        self.layers.iter().flat_map(move |layer| {
            [
                (
                    format!("layer_{}.weight", layer.index),
                    vec![layer.inputs, layer.outputs],
                    layer.weight(parameters),
                ),
                (
                    format!("layer_{}.bias", layer.index),
                    vec![layer.outputs],
                    layer.bias(parameters),
                ),
            ]
        })
    }

    pub(super) fn layers(&self) -> &[Layer] {
        &self.layers
    }

    fn output(&self) -> &Layer {
        &self.layers[self.layers.len() - 1]
    }
}

impl Activations {
    /// The latest forward pass's outputs: `[B × out]`.
    #[must_use]
    pub fn output(&self) -> &[f32] {
        self.layers.last().map_or(&[], Vec::as_slice)
    }
}

/// Where one layer's parameters lie in the flat vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layer {
    pub(super) index: usize,
    pub(super) inputs: usize,
    pub(super) outputs: usize,
    start: usize,
}

impl Layer {
    pub(super) fn weight<'a>(&self, parameters: &'a [f32]) -> &'a [f32] {
        &parameters[self.start..self.start + self.inputs * self.outputs]
    }

    pub(super) fn bias<'a>(&self, parameters: &'a [f32]) -> &'a [f32] {
        &parameters[self.start + self.inputs * self.outputs..self.end()]
    }

    /// Weight and bias of a vector that is to change.
    pub(super) fn split_mut<'a>(
        &self,
        parameters: &'a mut [f32],
    ) -> (&'a mut [f32], &'a mut [f32]) {
        parameters[self.range()].split_at_mut(self.inputs * self.outputs)
    }

    /// Weight and bias together: `[(in + 1) × out]`, the bias being the last row.
    pub(super) fn range(&self) -> Range<usize> {
        self.start..self.end()
    }

    fn end(&self) -> usize {
        self.start + (self.inputs + 1) * self.outputs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use seedbed_env::random::{Purpose, stream};

    /// 2 → 1 (tanh) → 1: y = w₂ tanh(w₁₁ x₁ + w₁₂ x₂ + b₁) + b₂ = 2 tanh(0.5·1 − 0.25·2 + 0.1) − 1
    /// = 2 tanh 0.1 − 1.
    #[test]
    fn forward_is_the_formula() {
        let network = Mlp::new(&[2, 1, 1]);
        let output = network
            .forward(
                &[0.5, -0.25, 0.1, 2.0, -1.0],
                &[1.0, 2.0],
                &mut Activations::default(),
            )
            .to_vec();
        assert!((output[0] - (2.0 * 0.1_f32.tanh() - 1.0)).abs() < 1e-6);
    }

    #[test]
    fn one_sample_and_a_batch_agree() {
        let network = Mlp::new(&[3, 16, 16, 2]);
        let parameters = network.initial(
            Initial::Random,
            &mut stream(1, Purpose::InitialParameters, 0, 0),
        );
        let inputs: Vec<f32> = (0..60).map(|i| (i as f32 * 0.37).sin()).collect();
        let mut activations = Activations::default();
        let batch = network
            .forward(&parameters, &inputs, &mut activations)
            .to_vec();
        for (row, expected) in inputs.chunks(3).zip(batch.chunks(2)) {
            let single = network.forward(&parameters, row, &mut activations);
            assert!(
                single
                    .iter()
                    .zip(expected)
                    .all(|(a, b)| (a - b).abs() < 1e-6)
            );
        }
    }

    proptest! {
        /// L = ½ Σ y², so ∂L/∂y = y; against (L(θ + h) − L(θ − h)) / 2h, whose error in f32 is
        /// about 10⁻³ at h = 10⁻².
        #[test]
        fn gradient_agrees_with_central_differences(seed: u64, batch in 1..12_usize, width in 1..20_usize) {
            let network = Mlp::new(&[3, width, 7, 2]);
            let mut parameters = network.initial(Initial::Random, &mut stream(seed, Purpose::InitialParameters, 0, 0));
            let inputs: Vec<f32> = (0..3 * batch).map(|i| (i as f32 * 0.7 + (seed % 97) as f32).cos()).collect();
            let mut activations = Activations::default();
            let output = network.forward(&parameters, &inputs, &mut activations).to_vec();
            let mut gradient = vec![f32::NAN; parameters.len()];
            network.backward(&parameters, &inputs, &mut activations, &output, &mut gradient);

            let mut loss = |parameters: &[f32]| -> f64 {
                let output = network.forward(parameters, &inputs, &mut activations);
                output.iter().map(|y| 0.5 * f64::from(*y).powi(2)).sum()
            };
            for index in 0..parameters.len() {
                let (original, h) = (parameters[index], 1e-2);
                parameters[index] = original + h;
                let above = loss(&parameters);
                parameters[index] = original - h;
                let below = loss(&parameters);
                parameters[index] = original;
                let numeric = (above - below) / f64::from(2.0 * h);
                let tolerance = 2e-3 * (1.0 + batch as f64);
                prop_assert!((numeric - f64::from(gradient[index])).abs() < tolerance, "{index}: {numeric} {}", gradient[index]);
            }
        }
    }
}
