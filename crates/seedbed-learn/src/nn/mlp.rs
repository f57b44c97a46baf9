//! Multi-layer perceptrons: an activation function between the layers, on request after layer
//! normalization (Ba, Kiros & Hinton 2016), and a linear output.

use std::ops::Range;

use rand::{Rng, RngExt};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::kernels;
use seedbed_input::numbers::FiniteNumber;

/// The shape of a network. Its parameters are a flat vector that the caller provides: for each
/// layer the weights `[in × out]`, then the biases `[out]`, and for each normalized layer then the
/// gains `[out]` and the shifts `[out]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mlp {
    layers: Vec<Layer>,
    activation: Activation,
    /// Whether the inputs of the network are appended to the inputs of its output layer.
    has_skip_connection: bool,
}

/// The function that is applied to the outputs of hidden layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum Activation {
    /// tanh x.
    Tanh,
    /// max(0, x).
    Relu,
}

/// How the parameters of a network are initialized.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Initial {
    /// Weights and biases uniform within ±1/√(inputs of the layer); gains 1 and shifts 0.
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
    /// Outputs of each layer with mean 0 and deviation 1; empty for layers that are not normalized.
    normalized: Vec<Normalized>,
    /// Inputs of the output layer of a network with a skip connection: `[B × (hidden + in)]`.
    joined: Vec<f32>,
    /// Derivatives of the loss with respect to the inputs of the activation function: those of the
    /// layer that the backward pass has reached, and those of the layer before it.
    deltas: [Vec<f32>; 2],
    scratch: kernels::Scratch,
}

/// The outputs of a layer before gains and shifts.
#[derive(Clone, Debug, Default)]
struct Normalized {
    /// Outputs with mean 0 and deviation 1 in each row: `[B × outputs]`.
    outputs: Vec<f32>,
    /// Reciprocals of the deviations of the rows: `[B]`.
    reciprocals: Vec<f32>,
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
                is_normalized: false,
            };
            start = layer.end();
            layer
        };
        Self {
            layers: sizes.windows(2).enumerate().map(layer).collect(),
            activation: Activation::Tanh,
            has_skip_connection: false,
        }
    }

    /// The same network with another activation function.
    #[must_use]
    pub fn with_activation(self, activation: Activation) -> Self {
        Self { activation, ..self }
    }

    /// The same network with layer normalization: the outputs of each hidden layer are
    /// gain · (y − mean y)/√(variance of y + 10⁻⁵) + shift before the activation function.
    #[must_use]
    pub fn with_layer_normalization(mut self) -> Self {
        let (mut start, last) = (0, self.layers.len() - 1);
        for layer in &mut self.layers {
            layer.start = start;
            layer.is_normalized = layer.index < last;
            start = layer.end();
        }
        self
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

    /// The same network with `count` further inputs, after the others.
    pub(crate) fn with_further_inputs(&self, count: usize) -> Self {
        let units = self.layers.iter().map(|layer| layer.outputs);
        let sizes: Vec<usize> = [self.inputs() + count].into_iter().chain(units).collect();
        Self::new(&sizes).with_activation(self.activation)
    }

    /// Number of units of the first layer.
    pub(crate) fn units_of_first_layer(&self) -> usize {
        self.layers[0].outputs
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
                    if layer.is_normalized {
                        parameters.extend(std::iter::repeat_n(1.0, layer.outputs));
                        parameters.extend(std::iter::repeat_n(0.0, layer.outputs));
                    }
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
        let count = self.layers.len();
        activations.layers.resize_with(count, Vec::new);
        activations
            .normalized
            .resize_with(count, Normalized::default);
        let Activations {
            layers,
            normalized,
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
            if layer.is_normalized {
                let Normalized {
                    outputs: rows,
                    reciprocals,
                } = &mut normalized[layer.index];
                let (gains, shifts) = layer.gains_and_shifts(parameters);
                kernels::normalize_rows(gains, shifts, outputs, rows, reciprocals);
            }
            if layer.index + 1 < count {
                self.activation.apply(outputs);
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
        let batch = output_gradient.len() / self.outputs();
        activations.deltas[0].clear();
        activations.deltas[0].extend_from_slice(output_gradient);
        for layer in self.layers.iter().rev() {
            if layer.is_normalized {
                let (gain_gradient, shift_gradient) = layer.gains_and_shifts_mut(gradient);
                activations.normalization_gradient(layer, gain_gradient, shift_gradient);
                activations.step_back_over_normalization(layer, parameters);
            }
            let Activations {
                layers,
                joined,
                deltas,
                scratch,
                ..
            } = &mut *activations;
            let x = match layer.index {
                0 => inputs,
                _ if self.is_joined(layer) => joined,
                index => &layers[index - 1],
            };
            let (dw, db) = layer.split_mut(gradient);
            kernels::parameter_gradient(&x[..batch * layer.inputs], &deltas[0], dw, db, scratch);
            if layer.index > 0 {
                self.step_back(layer, parameters, activations);
            }
        }
    }

    /// Computes the gradient of a loss with respect to some of the inputs, those of the columns
    /// `columns`, from its gradient with respect to the first B outputs of the latest forward pass.
    /// `output_gradient: [B × out]` → `[B × columns]`
    ///
    /// # Panics
    /// If a slice has another shape, or if the network has a skip connection.
    pub fn input_gradient<'a>(
        &self,
        parameters: &[f32],
        activations: &'a mut Activations,
        output_gradient: &[f32],
        columns: Range<usize>,
    ) -> &'a [f32] {
        assert!(!self.has_skip_connection, "not for skip connections");
        activations.deltas[0].clear();
        activations.deltas[0].extend_from_slice(output_gradient);
        for layer in self.layers.iter().skip(1).rev() {
            if layer.is_normalized {
                activations.step_back_over_normalization(layer, parameters);
            }
            self.step_back(layer, parameters, activations);
        }
        let first = &self.layers[0];
        if first.is_normalized {
            activations.step_back_over_normalization(first, parameters);
        }
        let rows = columns.start * first.outputs..columns.end * first.outputs;
        let weight = &first.weight(parameters)[rows];
        let Activations {
            deltas: [deltas, earlier_deltas],
            scratch,
            ..
        } = activations;
        earlier_deltas.resize(deltas.len() / first.outputs * columns.len(), 0.0);
        kernels::input_gradient(weight, deltas, earlier_deltas, first.outputs, scratch);
        earlier_deltas
    }

    /// From the derivatives with respect to the outputs of a layer, before its activation function,
    /// to those of the layer before it.
    fn step_back(&self, layer: &Layer, parameters: &[f32], activations: &mut Activations) {
        let Activations {
            layers,
            deltas: [deltas, earlier_deltas],
            scratch,
            ..
        } = activations;
        let batch = deltas.len() / layer.outputs;
        earlier_deltas.resize(batch * layer.inputs, 0.0);
        let weight = layer.weight(parameters);
        kernels::input_gradient(weight, deltas, earlier_deltas, layer.outputs, scratch);
        let width = self.layers[layer.index - 1].outputs;
        keep_first_columns(earlier_deltas, layer.inputs, width);
        let outputs = &layers[layer.index - 1][..batch * width];
        self.activation.apply_gradient(outputs, earlier_deltas);
        std::mem::swap(deltas, earlier_deltas);
    }

    /// Whether the inputs of the network are appended to the inputs of a layer.
    fn is_joined(&self, layer: &Layer) -> bool {
        self.has_skip_connection && layer.index + 1 == self.layers.len()
    }

    /// The output layer's weights and biases: `[in × out]` and `[out]`.
    pub fn output_layer<'a>(&self, parameters: &'a mut [f32]) -> (&'a mut [f32], &'a mut [f32]) {
        self.last_layer().split_mut(parameters)
    }

    /// Names, shapes and values of the weights and the biases of each layer, and of the gains and
    /// shifts of normalized layers.
    pub fn tensors<'a>(
        &self,
        parameters: &'a [f32],
    ) -> impl Iterator<Item = (String, Vec<usize>, &'a [f32])> {
        self.layers.iter().flat_map(move |layer| {
            let (inputs, outputs) = (layer.inputs, layer.outputs);
            let tensor = |name: &str, shape: Vec<usize>, values: &'a [f32]| {
                (format!("layer_{}.{name}", layer.index), shape, values)
            };
            let affine = [
                tensor("weight", vec![inputs, outputs], layer.weight(parameters)),
                tensor("bias", vec![outputs], layer.bias(parameters)),
            ];
            let normalization = layer.is_normalized.then(|| {
                let (gains, shifts) = layer.gains_and_shifts(parameters);
                [
                    tensor("gain", vec![outputs], gains),
                    tensor("shift", vec![outputs], shifts),
                ]
            });
            affine
                .into_iter()
                .chain(normalization.into_iter().flatten())
        })
    }

    pub(super) fn layers(&self) -> &[Layer] {
        &self.layers
    }

    fn last_layer(&self) -> &Layer {
        &self.layers[self.layers.len() - 1]
    }
}

impl Activation {
    /// The name of the function in files of tensors.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Tanh => "tanh",
            Self::Relu => "relu",
        }
    }

    fn apply(self, y: &mut [f32]) {
        match self {
            Self::Tanh => kernels::tanh_in_place(y),
            Self::Relu => kernels::relu_in_place(y),
        }
    }

    /// Multiplies derivatives with respect to outputs y by the derivative of the function.
    fn apply_gradient(self, y: &[f32], dy: &mut [f32]) {
        match self {
            Self::Tanh => kernels::tanh_gradient_in_place(y, dy),
            Self::Relu => kernels::relu_gradient_in_place(y, dy),
        }
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

    /// The derivatives with respect to the gains and the shifts of a layer.
    fn normalization_gradient(&self, layer: &Layer, gains: &mut [f32], shifts: &mut [f32]) {
        let rows = &self.normalized[layer.index].outputs;
        kernels::normalization_gradient(rows, &self.deltas[0], gains, shifts);
    }

    /// From the derivatives with respect to normalized outputs to those with respect to outputs
    /// before the normalization.
    fn step_back_over_normalization(&mut self, layer: &Layer, parameters: &[f32]) {
        let (gains, _) = layer.gains_and_shifts(parameters);
        let Normalized {
            outputs,
            reciprocals,
        } = &self.normalized[layer.index];
        kernels::normalize_rows_gradient(gains, outputs, reciprocals, &mut self.deltas[0]);
    }
}

/// The range of one layer's parameters in the flat vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layer {
    pub(super) index: usize,
    pub(super) inputs: usize,
    pub(super) outputs: usize,
    start: usize,
    /// Whether the layer has gains and shifts.
    is_normalized: bool,
}

impl Layer {
    pub(super) fn weight<'a>(&self, parameters: &'a [f32]) -> &'a [f32] {
        &parameters[self.start..self.start + self.inputs * self.outputs]
    }

    pub(super) fn bias<'a>(&self, parameters: &'a [f32]) -> &'a [f32] {
        &parameters[self.start + self.inputs * self.outputs..self.affine_end()]
    }

    /// Gains and shifts of a normalized layer: `[out]` each.
    fn gains_and_shifts<'a>(&self, parameters: &'a [f32]) -> (&'a [f32], &'a [f32]) {
        parameters[self.affine_end()..self.end()].split_at(self.outputs)
    }

    fn gains_and_shifts_mut<'a>(
        &self,
        parameters: &'a mut [f32],
    ) -> (&'a mut [f32], &'a mut [f32]) {
        parameters[self.affine_end()..self.end()].split_at_mut(self.outputs)
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
        self.start..self.affine_end()
    }

    fn affine_end(&self) -> usize {
        self.start + (self.inputs + 1) * self.outputs
    }

    fn end(&self) -> usize {
        let normalization = if self.is_normalized {
            2 * self.outputs
        } else {
            0
        };
        self.affine_end() + normalization
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

    /// A row with mean 3 and variance 4 becomes (−1, 1); gains 2, 3 and shifts 1, −1 make it (−1, 2), of
    /// which max(0, x) keeps 2: y = 10·0 + 100·2 + 5.
    #[test]
    fn layer_normalization_by_hand() {
        let network = Mlp::new(&[1, 2, 1])
            .with_activation(Activation::Relu)
            .with_layer_normalization();
        let parameters = [1.0, 5.0, 0.0, 0.0, 2.0, 3.0, 1.0, -1.0, 10.0, 100.0, 5.0];
        assert_eq!(network.parameter_count(), parameters.len());
        let mut activations = Activations::default();
        let output = network.forward(&parameters, &[1.0], &mut activations);
        assert!((output[0] - 205.0).abs() < 1e-2, "{output:?}");
        let names: Vec<String> = network
            .tensors(&parameters)
            .map(|(name, ..)| name)
            .collect();
        assert_eq!(
            names[..4],
            ["weight", "bias", "gain", "shift"].map(|name| format!("layer_0.{name}"))
        );
        assert_eq!(names.len(), 6);
    }

    proptest! {
        /// The gradient of L = ½ Σ y² with respect to the last two of three inputs, with every kind of
        /// hidden layer. Gains and shifts that are not 1 and 0 come from a step along a gradient.
        #[test]
        fn input_gradients_agree_with_central_differences(seed: u64, batch in 1..6_usize, width in 8..20_usize, normalized: bool) {
            let mut network = Mlp::new(&[3, width, 7, 2]);
            if normalized {
                network = network.with_layer_normalization();
            }
            let mut random = stream(seed, Purpose::InitialParameters, 0, 0);
            let mut parameters = network.initial_parameters(Initial::Random, &mut random);
            for parameter in &mut parameters {
                *parameter += random.random_range(-0.2_f32..=0.2);
            }
            let mut inputs: Vec<f32> = (0..3 * batch).map(|_| random.random_range(-2.0..=2.0)).collect();
            let mut activations = Activations::default();
            let output = network.forward(&parameters, &inputs, &mut activations).to_vec();
            let gradient = network.input_gradient(&parameters, &mut activations, &output, 1..3).to_vec();
            let mut loss = |inputs: &[f32]| -> f64 {
                let output = network.forward(&parameters, inputs, &mut activations);
                output.iter().map(|y| 0.5 * f64::from(*y).powi(2)).sum()
            };
            for (index, slope) in gradient.iter().enumerate() {
                let place = index / 2 * 3 + 1 + index % 2;
                let (original, h) = (inputs[place], 3e-3);
                inputs[place] = original + h;
                let above = loss(&inputs);
                inputs[place] = original - h;
                let below = loss(&inputs);
                inputs[place] = original;
                let numeric = (above - below) / f64::from(2.0 * h);
                // The curvature of a normalized row grows as its deviation falls.
                let tolerance = if normalized { 0.05 } else { 5e-3 };
                prop_assert!((numeric - f64::from(*slope)).abs() < tolerance * (1.0 + numeric.abs()), "{index}: {numeric} {slope}");
            }
        }

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
