//! Multi-layer perceptrons with tanh between the layers and a linear output.

use std::ops::Range;

use rand::{Rng, RngExt};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::kernels;
use seedbed_input::numbers::FiniteNumber;

/// The shape of a network. Its parameters are a flat vector that the caller provides: for each
/// layer the weights `[in × out]`, then the biases `[out]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mlp {
    layers: Vec<Layer>,
    /// Whether the inputs of the network are appended to the inputs of its output layer.
    has_skip_connection: bool,
}

/// How the parameters of a network are initialized.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Initial {
    /// Weights and biases uniform within ±1/√(inputs of the layer).
    Random,
    /// The same number for all parameters (thesis Fig. 6.4c).
    Constant(FiniteNumber),
}

/// The outputs of all layers, which a forward pass keeps for the backward pass, and further
/// buffers. They grow to the largest batch and are then reused without allocation.
#[derive(Clone, Debug, Default)]
pub struct Activations {
    /// Outputs of each layer: `[B × outputs]` each.
    layers: Vec<Vec<f32>>,
    /// Inputs of the output layer of a network with a skip connection: `[B × (hidden + in)]`.
    joined: Vec<f32>,
    /// Derivatives of the loss with respect to the inputs of the activation function: those of the
    /// layer that the backward pass has reached, and those of the layer before it.
    deltas: [Vec<f32>; 2],
    scratch: kernels::Scratch,
}

impl Mlp {
    /// A network with these layer sizes, starting with the inputs.
    ///
    /// # Panics
    /// If there are fewer than two sizes, or if a size is 0.
    #[must_use]
    pub fn new(sizes: &[usize]) -> Self {
        assert!(
            sizes.len() >= 2 && sizes.iter().all(|&size| size > 0),
            "a network needs at least two positive sizes: {sizes:?}"
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
            has_skip_connection: false,
        }
    }

    /// A network whose output layer has as inputs the outputs of the last hidden layer and the
    /// inputs of the network.
    ///
    /// # Panics
    /// If there is no hidden layer, or if a size is 0.
    #[must_use]
    pub fn with_skip_connection(sizes: &[usize]) -> Self {
        assert!(sizes.len() >= 3, "no hidden layer: {sizes:?}");
        let mut network = Self::new(sizes);
        let last = sizes.len() - 2;
        network.layers[last].inputs += sizes[0];
        network.has_skip_connection = true;
        network
    }

    /// Number of parameters.
    #[must_use]
    pub fn parameter_count(&self) -> usize {
        self.last_layer().end()
    }

    /// Number of inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.layers[0].inputs
    }

    /// Number of outputs.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.last_layer().outputs
    }

    /// Initial parameters: `[P]`.
    pub fn initial_parameters(&self, initial: Initial, random: &mut impl Rng) -> Vec<f32> {
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
        let Activations {
            layers,
            joined,
            scratch,
            ..
        } = &mut *activations;
        for layer in &self.layers {
            let (earlier, rest) = layers.split_at_mut(layer.index);
            let mut x = earlier.last().map_or(inputs, Vec::as_slice);
            if self.is_joined(layer) {
                join_rows(x, inputs, batch, joined);
                x = joined;
            }
            let outputs = &mut rest[0];
            outputs.resize(batch * layer.outputs, 0.0);
            let (weight, bias) = (layer.weight(parameters), layer.bias(parameters));
            kernels::affine(weight, bias, x, outputs, scratch);
            if layer.index + 1 < self.layers.len() {
                kernels::tanh_in_place(outputs);
            }
        }
        activations.output()
    }

    /// Computes the gradient of a loss with respect to the parameters from its gradient with
    /// respect to the first B outputs of the latest forward pass, which must have had the same
    /// `inputs`.   `inputs: [B or more × in]`, `output_gradient: [B × out]` → `gradient: [P]`,
    /// overwritten
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
            joined,
            deltas: [deltas, earlier_deltas],
            scratch,
        } = activations;
        let batch = output_gradient.len() / self.outputs();
        deltas.clear();
        deltas.extend_from_slice(output_gradient);
        for layer in self.layers.iter().rev() {
            let x = match layer.index {
                0 => inputs,
                _ if self.is_joined(layer) => joined,
                index => &layers[index - 1],
            };
            let x = &x[..batch * layer.inputs];
            let (dw, db) = layer.split_mut(gradient);
            kernels::parameter_gradient(x, deltas, dw, db, scratch);
            if layer.index > 0 {
                earlier_deltas.resize(x.len(), 0.0);
                kernels::input_gradient(
                    layer.weight(parameters),
                    deltas,
                    earlier_deltas,
                    layer.outputs,
                    scratch,
                );
                let width = self.layers[layer.index - 1].outputs;
                keep_first_columns(earlier_deltas, layer.inputs, width);
                let outputs = &layers[layer.index - 1][..batch * width];
                kernels::tanh_gradient_in_place(outputs, earlier_deltas);
                std::mem::swap(deltas, earlier_deltas);
            }
        }
    }

    /// Whether the inputs of the network are appended to the inputs of a layer.
    fn is_joined(&self, layer: &Layer) -> bool {
        self.has_skip_connection && layer.index + 1 == self.layers.len()
    }

    /// The output layer's weights and biases: `[in × out]` and `[out]`.
    pub fn output_layer<'a>(&self, parameters: &'a mut [f32]) -> (&'a mut [f32], &'a mut [f32]) {
        self.last_layer().split_mut(parameters)
    }

    /// Names, shapes and values of the weights and the biases of each layer.
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

    fn last_layer(&self) -> &Layer {
        &self.layers[self.layers.len() - 1]
    }
}

/// Appends each row of `right` to the row of `left`.   `[rows × a]`, `[rows × b]` → `joined: [rows
/// × (a + b)]`
fn join_rows(left: &[f32], right: &[f32], rows: usize, joined: &mut Vec<f32>) {
    joined.clear();
    let (left_width, right_width) = (left.len() / rows.max(1), right.len() / rows.max(1));
    for row in 0..rows {
        joined.extend_from_slice(&left[row * left_width..][..left_width]);
        joined.extend_from_slice(&right[row * right_width..][..right_width]);
    }
}

/// Removes all but the first `kept` columns.   `matrix: [rows × width]` → `[rows × kept]`
fn keep_first_columns(matrix: &mut Vec<f32>, width: usize, kept: usize) {
    if kept == width {
        return;
    }
    let rows = matrix.len() / width;
    for row in 1..rows {
        matrix.copy_within(row * width..row * width + kept, row * kept);
    }
    matrix.truncate(rows * kept);
}

impl Activations {
    /// Outputs of the latest forward pass: `[B × out]`.
    #[must_use]
    pub fn output(&self) -> &[f32] {
        self.layers.last().map_or(&[], Vec::as_slice)
    }
}

/// The range of one layer's parameters in the flat vector.
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

    /// Weights and biases as mutable slices.
    pub(super) fn split_mut<'a>(
        &self,
        parameters: &'a mut [f32],
    ) -> (&'a mut [f32], &'a mut [f32]) {
        parameters[self.range()].split_at_mut(self.inputs * self.outputs)
    }

    /// The range of weights and biases: `[(in + 1) × out]`, with the biases as the last row.
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
    use seedbed_random::{Purpose, stream};

    /// A network 2 → 1 (tanh) → 1: y = w₂ tanh(w₁₁ x₁ + w₁₂ x₂ + b₁) + b₂ = 2 tanh(0.5·1 − 0.25·2 +
    /// 0.1) − 1 = 2 tanh 0.1 − 1.
    #[test]
    fn forward_by_hand() {
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

    /// The same network whose output layer has the inputs too: y = 2 tanh 0.1 + 3·1 + 4·2 − 1.
    #[test]
    fn skip_connection_by_hand() {
        let network = Mlp::with_skip_connection(&[2, 1, 1]);
        let parameters = [0.5, -0.25, 0.1, 2.0, 3.0, 4.0, -1.0];
        assert_eq!(network.parameter_count(), parameters.len());
        let mut activations = Activations::default();
        let output = network.forward(&parameters, &[1.0, 2.0], &mut activations);
        assert!((output[0] - (2.0 * 0.1_f32.tanh() + 10.0)).abs() < 1e-5);
    }

    #[test]
    fn single_samples_agree_with_a_batch() {
        let network = Mlp::with_skip_connection(&[3, 16, 16, 2]);
        let parameters = network.initial_parameters(
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
        /// L = ½ Σ y², so ∂L/∂y = y. The gradient is compared with (L(θ + h) − L(θ − h)) / 2h,
        /// whose error in f32 is about 10⁻³ for h = 10⁻².
        #[test]
        fn gradient_agrees_with_central_differences(seed: u64, batch in 1..12_usize, width in 1..20_usize, skip: bool) {
            let build = if skip { Mlp::with_skip_connection } else { Mlp::new };
            let network = build(&[3, width, 7, 2]);
            let mut parameters = network.initial_parameters(Initial::Random, &mut stream(seed, Purpose::InitialParameters, 0, 0));
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
