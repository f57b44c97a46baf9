//! Reference implementations for tests: a simple log-likelihood in double precision, with which the
//! optimized code is compared, and noise.

use rand_distr::{Distribution, StandardNormal};

use super::gaussian::DiagonalGaussian;
use seedbed_random::{Purpose, stream};

/// Standard-normal random numbers.
pub(super) fn normals(seed: u64, count: usize) -> Vec<f32> {
    let mut random = stream(seed, Purpose::Preview, 0, 0);
    (0..count)
        .map(|_| StandardNormal.sample(&mut random))
        .collect()
}

/// log p(y|x; w) of one sample.   `weights`: layer by layer `[(in + 1) × out]`, the bias last
pub(super) fn log_likelihood(
    sizes: &[usize],
    deviation: f64,
    weights: &[f64],
    input: &[f32],
    target: &[f32],
) -> f64 {
    let mut x: Vec<f64> = input.iter().map(|&x| f64::from(x)).collect();
    let mut start = 0;
    for (index, pair) in sizes.windows(2).enumerate() {
        let (rows, columns) = (pair[0] + 1, pair[1]);
        let matrix = &weights[start..start + rows * columns];
        x.push(1.0);
        let sum = |column: usize| {
            (0..rows)
                .map(|row| x[row] * matrix[row * columns + column])
                .sum::<f64>()
        };
        let is_hidden = index + 2 < sizes.len();
        x = (0..columns)
            .map(|column| {
                if is_hidden {
                    sum(column).max(0.0)
                } else {
                    sum(column)
                }
            })
            .collect();
        start += rows * columns;
    }
    let residuals = x
        .iter()
        .zip(target)
        .map(|(output, target)| (f64::from(*target) - output) / deviation);
    residuals
        .map(|r| -0.5 * r * r - deviation.ln() - 0.5 * std::f64::consts::TAU.ln())
        .sum()
}

/// Weights w = μ + σ ε.
pub(super) fn draw(gaussian: &DiagonalGaussian, noise: &[f32]) -> Vec<f64> {
    let moments = gaussian.mean.iter().zip(&gaussian.deviation);
    moments
        .zip(noise)
        .map(|((&mean, &deviation), &noise)| {
            f64::from(mean) + f64::from(deviation) * f64::from(noise)
        })
        .collect()
}

/// The gradient ∂f/∂w by central differences.
pub(super) fn gradient(weights: &[f64], f: impl Fn(&[f64]) -> f64) -> Vec<f64> {
    let mut shifted = weights.to_vec();
    let mut derivative = |index: usize| {
        shifted[index] = weights[index] + 1e-7;
        let above = f(&shifted);
        shifted[index] = weights[index] - 1e-7;
        let below = f(&shifted);
        shifted[index] = weights[index];
        (above - below) / 2e-7
    };
    (0..weights.len()).map(&mut derivative).collect()
}
