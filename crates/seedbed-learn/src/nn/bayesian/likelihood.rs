//! The likelihood p(y|x; w) = 𝒩(y; `f_w`(x), s² I), where f is a network with ReLU between the
//! layers and a linear output, and the gradients of its logarithm for each sample.
//!
//! A likelihood is immutable, and the caller provides the buffers, so that several threads can
//! evaluate one likelihood in parallel.

#![expect(
    clippy::inline_always,
    reason = "a loop is compiled for a SIMD instruction set only if it is inlined into the dispatch"
)]

use pulp::{Arch, Simd, WithSimd};

use super::gaussian::DiagonalGaussian;
use crate::nn::kernels;
use crate::nn::mlp::{Layer, Mlp};

/// ½ log 2π.
const HALF_LOG_TAU: f64 = 0.918_938_533_204_672_7;

/// The shape of f and the standard deviation s. The caller provides the weights, in the layout of
/// an [`Mlp`].
#[derive(Clone, Debug, PartialEq)]
pub struct Likelihood {
    mlp: Mlp,
    deviation: f32,
}

/// Buffers for evaluating one draw of weights on a batch. They grow to the largest batch and are
/// then reused without allocation.
#[derive(Clone, Debug, Default)]
pub struct PassBuffers {
    /// Outputs of each layer: `[B × outputs]` each.
    layers: Vec<Vec<f32>>,
    /// δ of each layer, the derivative with respect to the inputs of its activation function:
    /// `[B × outputs]` each.
    deltas: Vec<Vec<f32>>,
    /// x² of one layer, where x are the layer's inputs, and the product of x² with the layer's
    /// coefficients.
    squares: [Vec<f32>; 2],
    /// Buffer for matrix products.
    scratch: kernels::Scratch,
}

/// Samples of the weights, with buffers for their passes and gradients.
#[derive(Clone, Debug, Default)]
pub struct Draws {
    weights: Vec<Vec<f32>>,
    passes: Vec<PassBuffers>,
    gradient: Vec<f32>,
    mean_gradient: Vec<f32>,
    deviation_gradient: Vec<f32>,
}

/// Number of samples that are evaluated together: small enough that the outputs of all layers stay
/// in the first-level cache.
const BLOCK_SAMPLES: usize = 64;

impl Likelihood {
    /// A network with these layer sizes, starting with the inputs, and the standard deviation s.
    ///
    /// # Panics
    /// If there are fewer than two sizes, or if a size is 0.
    #[must_use]
    pub fn new(sizes: &[usize], deviation: f32) -> Self {
        Self {
            mlp: Mlp::new(sizes),
            deviation,
        }
    }

    /// The shape of the network.
    pub(crate) fn mlp(&self) -> &Mlp {
        &self.mlp
    }

    /// Number of inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.mlp.inputs()
    }

    /// Number of weights P, including biases.
    #[must_use]
    pub fn weight_count(&self) -> usize {
        self.mlp.parameter_count()
    }

    /// Outputs `f_w`(x) of the network.   `weights: [P]`, `inputs: [B × in]` → `[B × out]`
    ///
    /// # Panics
    /// If a slice has another shape.
    pub fn forward<'a>(
        &self,
        weights: &[f32],
        inputs: &[f32],
        pass: &'a mut PassBuffers,
    ) -> &'a [f32] {
        assert_eq!(
            (weights.len(), inputs.len() % self.inputs()),
            (self.weight_count(), 0)
        );
        let (batch, last) = (inputs.len() / self.inputs(), self.mlp.layers().len() - 1);
        pass.layers.resize_with(last + 1, Vec::new);
        for layer in self.mlp.layers() {
            let (earlier, rest) = pass.layers.split_at_mut(layer.index);
            let outputs = &mut rest[0];
            outputs.resize(batch * layer.outputs, 0.0);
            let x = earlier.last().map_or(inputs, Vec::as_slice);
            kernels::affine(
                layer.weight(weights),
                layer.bias(weights),
                x,
                outputs,
                &mut pass.scratch,
            );
            if layer.index < last {
                for y in outputs {
                    *y = y.max(0.0);
                }
            }
        }
        &pass.layers[last]
    }

    /// Computes Σᵢ cᵢ (∂ log p(y|x; w)/∂wᵢ)² of each sample without storing the gradients.
    /// `weights`, `coefficients`: `[P]`, `inputs: [B × in]`, `targets: [B × out]` → `sums: [B]`
    ///
    /// The gradient with respect to the weights of a layer is x δᵀ, so the sum over that layer is
    /// (x²)ᵀ C δ², where C are the layer's coefficients and the last entry of x is 1, the
    /// factor of the bias.
    ///
    /// # Panics
    /// If a slice has another shape.
    pub fn weighted_squares(
        &self,
        (weights, coefficients): (&[f32], &[f32]),
        (inputs, targets): (&[f32], &[f32]),
        pass: &mut PassBuffers,
        sums: &mut [f32],
    ) {
        assert_eq!(coefficients.len(), weights.len());
        self.assert_samples(inputs, targets, sums.len());
        let [input_width, target_width] = [self.mlp.inputs(), self.mlp.outputs()];
        let blocks = inputs
            .chunks(BLOCK_SAMPLES * input_width)
            .zip(targets.chunks(BLOCK_SAMPLES * target_width));
        for ((inputs, targets), sums) in blocks.zip(sums.chunks_mut(BLOCK_SAMPLES)) {
            self.forward_and_backward(weights, inputs, targets, 1.0, pass);
            sums.fill(0.0);
            for layer in self.mlp.layers() {
                pass.add_weighted_squares(layer, coefficients, inputs, sums);
            }
        }
    }

    /// Passes ∇_μ and ∇_σ of `E_q`[log p(y|x; w)] of each sample to `visit`, estimated by the means
    /// of ∂ log p/∂w and ε ∂ log p/∂w over N draws w = μ + σ ε.   `noise: [N × P]`, `inputs: [B ×
    /// in]`, `targets: [B × out]` → B times `visit([P], [P])`
    ///
    /// # Panics
    /// If a slice has another shape, or if there is no draw.
    pub fn expected_gradients(
        &self,
        (gaussian, noise): (&DiagonalGaussian, &[f32]),
        (inputs, targets): (&[f32], &[f32]),
        draws: &mut Draws,
        mut visit: impl FnMut(&[f32], &[f32]),
    ) {
        self.assert_samples(inputs, targets, inputs.len() / self.inputs());
        draws.prepare(gaussian, noise);
        let [input_width, target_width] = [self.mlp.inputs(), self.mlp.outputs()];
        for (inputs, targets) in inputs
            .chunks(BLOCK_SAMPLES * input_width)
            .zip(targets.chunks(BLOCK_SAMPLES * target_width))
        {
            for (weights, pass) in draws.weights.iter().zip(&mut draws.passes) {
                self.forward_and_backward(
                    weights,
                    inputs,
                    targets,
                    1.0 / draws.weights.len() as f32,
                    pass,
                );
            }
            for (sample, input) in inputs.chunks_exact(input_width).enumerate() {
                draws.sum_gradients(self.mlp.layers(), noise, sample, input);
                visit(&draws.mean_gradient, &draws.deviation_gradient);
            }
        }
    }

    /// Evaluates the network, and sets δ = `scale` · ∂ log p/∂a for the inputs a of each layer's
    /// activation function. Returns Σ log p(y|x; w), without `scale`.
    pub(super) fn forward_and_backward(
        &self,
        weights: &[f32],
        inputs: &[f32],
        targets: &[f32],
        scale: f32,
        pass: &mut PassBuffers,
    ) -> f64 {
        self.forward(weights, inputs, pass);
        pass.deltas.resize_with(pass.layers.len(), Vec::new);
        let log_likelihood = self.set_output_deltas(targets, scale, pass);
        for layer in self.mlp.layers().iter().skip(1).rev() {
            let (earlier, rest) = pass.deltas.split_at_mut(layer.index);
            let (deltas, outputs) = (&mut earlier[layer.index - 1], &pass.layers[layer.index - 1]);
            deltas.resize(outputs.len(), 0.0);
            kernels::input_gradient(
                layer.weight(weights),
                &rest[0],
                deltas,
                layer.outputs,
                &mut pass.scratch,
            );
            for (delta, y) in deltas.iter_mut().zip(outputs) {
                *delta = if *y > 0.0 { *delta } else { 0.0 };
            }
        }
        log_likelihood
    }

    /// The gradient with respect to the weights, summed over the batch of the latest
    /// [`forward_and_backward`](Self::forward_and_backward).   `gradient: [P]`, overwritten
    pub(super) fn gradient(&self, inputs: &[f32], pass: &mut PassBuffers, gradient: &mut [f32]) {
        let PassBuffers {
            layers,
            deltas,
            scratch,
            ..
        } = pass;
        for layer in self.mlp.layers() {
            let (weight_gradient, bias_gradient) = layer.split_mut(gradient);
            kernels::parameter_gradient(
                layer_inputs(layer, layers, inputs),
                &deltas[layer.index],
                weight_gradient,
                bias_gradient,
                scratch,
            );
        }
    }

    /// Sets δ of the output layer to `scale` · (y − f)/s². Returns Σ log p = −½ Σ ((y − f)/s)² − n
    /// (log s + ½ log 2π) over n targets.
    fn set_output_deltas(&self, targets: &[f32], scale: f32, pass: &mut PassBuffers) -> f64 {
        let last = pass.layers.len() - 1;
        assert_eq!(pass.layers[last].len(), targets.len());
        let precision = 1.0 / (self.deviation * self.deviation);
        let mut squares = 0.0;
        pass.deltas[last].clear();
        pass.deltas[last].extend(
            targets
                .iter()
                .zip(&pass.layers[last])
                .map(|(target, output)| {
                    let residual = target - output;
                    squares += residual * residual;
                    scale * precision * residual
                }),
        );
        let constant = libm::log(f64::from(self.deviation)) + HALF_LOG_TAU;
        -0.5 * f64::from(squares * precision) - targets.len() as f64 * constant
    }

    fn assert_samples(&self, inputs: &[f32], targets: &[f32], samples: usize) {
        assert_eq!(
            (inputs.len(), targets.len()),
            (samples * self.mlp.inputs(), samples * self.mlp.outputs())
        );
    }
}

impl PassBuffers {
    /// Adds (x²)ᵀ C δ² of one layer to the sum of each sample.   `sums: [B]`
    fn add_weighted_squares(
        &mut self,
        layer: &Layer,
        coefficients: &[f32],
        inputs: &[f32],
        sums: &mut [f32],
    ) {
        let Self {
            layers,
            deltas,
            squares: [squares, products],
            scratch,
        } = self;
        squares.clear();
        squares.extend(layer_inputs(layer, layers, inputs).iter().map(|x| x * x));
        products.resize(sums.len() * layer.outputs, 0.0);
        kernels::affine(
            layer.weight(coefficients),
            layer.bias(coefficients),
            squares,
            products,
            scratch,
        );
        let rows = products
            .chunks_exact(layer.outputs)
            .zip(deltas[layer.index].chunks_exact(layer.outputs));
        for (sum, (products, deltas)) in sums.iter_mut().zip(rows) {
            *sum += products
                .iter()
                .zip(deltas)
                .map(|(product, delta)| product * delta * delta)
                .sum::<f32>();
        }
    }
}

impl Draws {
    /// Draws the weights.   `noise: [N × P]`
    fn prepare(&mut self, gaussian: &DiagonalGaussian, noise: &[f32]) {
        let count = gaussian.mean.len();
        assert!(
            !noise.is_empty() && noise.len().is_multiple_of(count),
            "noise must have a multiple of {count} numbers"
        );
        let draws = noise.len() / count;
        self.weights.resize_with(draws, Vec::new);
        self.passes.resize_with(draws, PassBuffers::default);
        for (weights, noise) in self.weights.iter_mut().zip(noise.chunks_exact(count)) {
            gaussian.draw(noise, weights);
        }
    }

    /// Sums x δᵀ and ε x δᵀ of one sample of the block over all draws.
    fn sum_gradients(&mut self, layers: &[Layer], noise: &[f32], sample: usize, input: &[f32]) {
        let Self {
            weights,
            passes,
            gradient,
            mean_gradient,
            deviation_gradient,
        } = self;
        let count = weights[0].len();
        for sums in [&mut *gradient, mean_gradient, deviation_gradient] {
            sums.clear();
            sums.resize(count, 0.0);
        }
        for (pass, noise) in passes.iter().zip(noise.chunks_exact(count)) {
            for layer in layers {
                let x = if layer.index == 0 {
                    input
                } else {
                    row(&pass.layers[layer.index - 1], layer.inputs, sample)
                };
                Arch::new().dispatch(WriteOuterProduct {
                    x,
                    delta: row(&pass.deltas[layer.index], layer.outputs, sample),
                    outer: &mut gradient[layer.range()],
                });
            }
            add_gradient_of_draw(gradient, noise, mean_gradient, deviation_gradient);
        }
    }
}

/// Adds the gradient of one draw with respect to w to the gradients with respect to μ and σ:
/// ∂w/∂μ = 1 and ∂w/∂σ = ε.   All slices: `[P]`
pub(super) fn add_gradient_of_draw(
    gradient: &[f32],
    noise: &[f32],
    mean_gradient: &mut [f32],
    deviation_gradient: &mut [f32],
) {
    Arch::new().dispatch(AddGradientOfDraw {
        gradient,
        noise,
        mean_gradient,
        deviation_gradient,
    });
}

struct AddGradientOfDraw<'a> {
    gradient: &'a [f32],
    noise: &'a [f32],
    mean_gradient: &'a mut [f32],
    deviation_gradient: &'a mut [f32],
}

impl WithSimd for AddGradientOfDraw<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (((mean_slope, deviation_slope), slope), noise) in self
            .mean_gradient
            .iter_mut()
            .zip(self.deviation_gradient)
            .zip(self.gradient)
            .zip(self.noise)
        {
            *mean_slope += slope;
            *deviation_slope += noise * slope;
        }
    }
}

/// Writes the outer product x δᵀ, with 1 appended to x for the bias.   `x: [in]`, `delta: [out]` →
/// `outer: [(in + 1) × out]`
struct WriteOuterProduct<'a> {
    x: &'a [f32],
    delta: &'a [f32],
    outer: &'a mut [f32],
}

impl WithSimd for WriteOuterProduct<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let rows = self.outer.chunks_exact_mut(self.delta.len());
        for (x, row) in self.x.iter().chain(&[1.0]).zip(rows) {
            for (product, delta) in row.iter_mut().zip(self.delta) {
                *product = x * delta;
            }
        }
    }
}

/// The inputs of a layer: the outputs of the layer before, or the inputs of the network:
/// `[B × in]`.
fn layer_inputs<'a>(
    layer: &Layer,
    outputs_of_layers: &'a [Vec<f32>],
    network_inputs: &'a [f32],
) -> &'a [f32] {
    if layer.index == 0 {
        network_inputs
    } else {
        &outputs_of_layers[layer.index - 1]
    }
}

fn row(matrix: &[f32], width: usize, index: usize) -> &[f32] {
    &matrix[index * width..(index + 1) * width]
}

#[cfg(test)]
mod tests {
    use super::super::reference::{self, normals};
    use super::*;
    use proptest::prelude::*;

    const SIZES: [usize; 4] = [3, 7, 5, 2];
    const WEIGHT_COUNT: usize = 4 * 7 + 8 * 5 + 6 * 2;

    fn gaussian(seed: u64) -> DiagonalGaussian {
        let deviation = normals(seed + 1, WEIGHT_COUNT)
            .iter()
            .map(|x| 0.05 + 0.3 * x.abs())
            .collect();
        DiagonalGaussian {
            mean: normals(seed, WEIGHT_COUNT)
                .iter()
                .map(|x| 0.5 * x)
                .collect(),
            deviation,
        }
    }

    /// A network 1 → 1 (ReLU) → 1 with weights 2, −1, 3, 0.5: x = 1 gives 3 (2 − 1) + 0.5 = 3.5, x
    /// = 0 gives 0.5. For y = 4, s = ½, x = 1: log p = −½ (0.5/0.5)² − log ½ − ½ log 2π =
    /// −0.7257914.
    #[test]
    fn likelihood_by_hand() {
        let (likelihood, weights, mut pass) = (
            Likelihood::new(&[1, 1, 1], 0.5),
            [2.0, -1.0, 3.0, 0.5],
            PassBuffers::default(),
        );
        assert_eq!(
            likelihood.forward(&weights, &[1.0, 0.0], &mut pass),
            [3.5, 0.5]
        );
        let log_likelihood =
            likelihood.forward_and_backward(&weights, &[1.0], &[4.0], 1.0, &mut pass);
        assert!((log_likelihood + 0.725_791_4).abs() < 1e-6);
        // δ₂ = 0.5/0.25 = 2, δ₁ = 2 · 3: gradient 6, 6, 2, 2. With c = 1, 2, 3, 4: 36 + 72 + 12 +
        // 16.
        let mut sums = [0.0];
        likelihood.weighted_squares(
            (&weights, &[1.0, 2.0, 3.0, 4.0]),
            (&[1.0], &[4.0]),
            &mut pass,
            &mut sums,
        );
        assert_eq!(sums, [136.0]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// The sum of each sample agrees with its gradient by central differences.
        #[test]
        fn weighted_squares_agree_with_gradients(seed in 0..1_000_000_u64, batch in 1..4_usize) {
            let likelihood = Likelihood::new(&SIZES, 0.7);
            let (q, noise) = (gaussian(seed), normals(seed + 2, WEIGHT_COUNT));
            let coefficients: Vec<f32> = normals(seed + 3, WEIGHT_COUNT).iter().map(|x| x.abs()).collect();
            let (inputs, targets) = (normals(seed + 4, 3 * batch), normals(seed + 5, 2 * batch));
            let (mut weights, mut sums) = (Vec::new(), vec![f32::NAN; batch]);
            q.draw(&noise, &mut weights);
            likelihood.weighted_squares((&weights, &coefficients), (&inputs, &targets), &mut PassBuffers::default(), &mut sums);

            for ((input, target), sum) in inputs.chunks(3).zip(targets.chunks(2)).zip(sums) {
                let f = |w: &[f64]| reference::log_likelihood(&SIZES, f64::from(0.7_f32), w, input, target);
                let slopes = reference::gradient(&reference::draw(&q, &noise), f);
                let expected: f64 = slopes.iter().zip(&coefficients).map(|(g, &c)| f64::from(c) * g * g).sum();
                prop_assert!((f64::from(sum) - expected).abs() < 1e-4 * (1.0 + expected), "{sum} {expected}");
            }
        }

        /// Gradients agree with the derivatives of the mean over draws of log p(y|x; μ + σ ε) with
        /// respect to μ and σ by central differences.
        #[test]
        fn expected_gradients_agree_with_central_differences(seed in 0..1_000_000_u64, draws in 1..4_usize) {
            let likelihood = Likelihood::new(&SIZES, 0.7);
            let (q, noise) = (gaussian(seed), normals(seed + 2, draws * WEIGHT_COUNT));
            let (inputs, targets) = (normals(seed + 4, 6), normals(seed + 5, 4));
            let mut found = Vec::new();
            let collect = |mean: &[f32], deviation: &[f32]| found.push([mean.to_vec(), deviation.to_vec()].concat());
            likelihood.expected_gradients((&q, &noise), (&inputs, &targets), &mut Draws::default(), collect);

            let moments: Vec<f64> = q.mean.iter().chain(&q.deviation).map(|&x| f64::from(x)).collect();
            for ((input, target), found) in inputs.chunks(3).zip(targets.chunks(2)).zip(found) {
                let f = |moments: &[f64]| -> f64 {
                    let (mean, deviation) = moments.split_at(WEIGHT_COUNT);
                    let log_likelihoods = noise.chunks(WEIGHT_COUNT).map(|noise| {
                        let draw = mean.iter().zip(deviation).zip(noise).map(|((m, d), &e)| m + d * f64::from(e));
                        reference::log_likelihood(&SIZES, f64::from(0.7_f32), &draw.collect::<Vec<_>>(), input, target)
                    });
                    log_likelihoods.sum::<f64>() / draws as f64
                };
                let expected = reference::gradient(&moments, f);
                let scale = expected.iter().map(|g| g.abs()).fold(1.0, f64::max);
                for (found, expected) in found.iter().zip(expected) {
                    prop_assert!((f64::from(*found) - expected).abs() < 1e-4 * scale, "{found} {expected}");
                }
            }
        }
    }

    /// 150 samples in three blocks give the same sums as each sample alone, both by
    /// `weighted_squares` and by summing the squares of `expected_gradients`.
    #[test]
    fn results_do_not_depend_on_blocks() {
        let (likelihood, q, noise) = (
            Likelihood::new(&SIZES, 1.0),
            gaussian(1),
            normals(3, WEIGHT_COUNT),
        );
        let (inputs, targets, mut weights) = (normals(4, 450), normals(5, 300), Vec::new());
        q.draw(&noise, &mut weights);
        let weighted_squares = |inputs: &[f32], targets: &[f32]| {
            let mut sums = vec![0.0; targets.len() / 2];
            likelihood.weighted_squares(
                (&weights, &q.deviation),
                (inputs, targets),
                &mut PassBuffers::default(),
                &mut sums,
            );
            sums
        };
        let sums = weighted_squares(&inputs, &targets);
        let mut sums_of_gradients = Vec::new();
        let visit = |mean_gradient: &[f32], _: &[f32]| {
            sums_of_gradients.push(
                mean_gradient
                    .iter()
                    .zip(&q.deviation)
                    .map(|(g, c)| c * g * g)
                    .sum::<f32>(),
            );
        };
        likelihood.expected_gradients(
            (&q, &noise),
            (&inputs, &targets),
            &mut Draws::default(),
            visit,
        );
        for (index, (input, target)) in inputs.chunks(3).zip(targets.chunks(2)).enumerate() {
            let alone = weighted_squares(input, target)[0];
            for in_block in [sums[index], sums_of_gradients[index]] {
                assert!((alone - in_block).abs() < 1e-4 * (1.0 + alone), "{index}");
            }
        }
    }
}
