//! The squashed Gaussian policy of soft actor-critic over continuous actions from −1 to 1 (Haarnoja et
//! al. 2018, appendix C): a = tanh u with u = μ(s) + σ(s) ε and ε from 𝒩(0, 1).
//!
//! A network has two outputs per component of an action: μ and log σ, which is clamped to
//! [`LOG_DEVIATION_BOUNDS`]. Densities are those of the squashed action:
//! log π(a) = log 𝒩(u; μ, σ²) − log(1 − tanh² u).

#![expect(
    clippy::inline_always,
    reason = "a loop is compiled for a SIMD instruction set only if it is inlined into the dispatch"
)]

use pulp::{Arch, Simd, WithSimd};

use crate::math::{exp, ln_1p};

/// Bounds of log σ; beyond them its gradient is 0.
pub const LOG_DEVIATION_BOUNDS: [f32; 2] = [-20.0, 2.0];

/// ½ log 2π.
const HALF_LOG_TAU: f32 = 0.918_938_5;

/// tanh u, with an error of at most 2·10⁻⁷.
#[inline(always)]
#[must_use]
pub fn squash(u: f32) -> f32 {
    let power = exp(-2.0 * u.abs());
    ((1.0 - power) / (1.0 + power)).copysign(u)
}

/// One component of an action, a = tanh(μ + σ ε), and log π(a).
///
/// log(1 − tanh² u) = 2 log 2 − 2|u| − 2 log(1 + e^(−2|u|)) is exact also where tanh u rounds to 1.
#[inline(always)]
#[must_use]
pub fn sample_one(mean: f32, log_deviation: f32, noise: f32) -> (f32, f32) {
    const LOG_4: f32 = 2.0 * std::f32::consts::LN_2;
    let u = exp(log_deviation).mul_add(noise, mean);
    let power = exp(-2.0 * u.abs());
    let log_slope = LOG_4 - 2.0 * u.abs() - 2.0 * ln_1p(power);
    let action = ((1.0 - power) / (1.0 + power)).copysign(u);
    let log_density = -0.5 * noise * noise - log_deviation - HALF_LOG_TAU - log_slope;
    (action, log_density)
}

/// The actions a = tanh(μ + σ ε), and log π of each of their d components.
///
/// `outputs` (μ, log σ): `[B × 2d]`, `noise` (ε): `[B × d]` → `actions`, `log_densities`: `[B × d]`,
/// both overwritten
///
/// # Panics
/// If there are not two outputs for each number of noise.
pub fn sample(
    outputs: &[f32],
    noise: &[f32],
    actions: &mut Vec<f32>,
    log_densities: &mut Vec<f32>,
) {
    assert_eq!(outputs.len(), 2 * noise.len());
    actions.resize(noise.len(), 0.0);
    log_densities.resize(noise.len(), 0.0);
    Arch::new().dispatch(Sample {
        outputs: outputs.as_chunks().0,
        noise,
        actions,
        log_densities,
    });
}

/// The gradient of L = mean(α log π(a|s) − Q(s, a)) for a = tanh(μ + σ ε) with constant ε: the loss of
/// the policy, reparameterized (Haarnoja et al. 2018b, Eq. 9). By the chain rule through u,
/// ∂L/∂μ = α 2a − (1 − a²) ∂Q/∂a and ∂L/∂log σ = σ ε ∂L/∂μ − α, each divided by B.
///
/// `outputs: [B × 2d]`, `noise`, `actions`, `value_slopes` (∂Q/∂a): `[B × d]` → `gradient: [B × 2d]`,
/// overwritten
///
/// # Panics
/// If the slices have different numbers of samples.
pub fn policy_gradient(
    outputs: &[f32],
    (noise, actions): (&[f32], &[f32]),
    value_slopes: &[f32],
    (temperature, batch): (f32, usize),
    gradient: &mut Vec<f32>,
) {
    assert_eq!(outputs.len(), 2 * noise.len());
    assert_eq!([actions.len(), value_slopes.len()], [noise.len(); 2]);
    gradient.resize(outputs.len(), 0.0);
    Arch::new().dispatch(PolicyGradient {
        outputs: outputs.as_chunks().0,
        samples: (noise, actions),
        value_slopes,
        temperature,
        share: 1.0 / batch as f32,
        gradient: gradient.as_chunks_mut().0,
    });
}

struct Sample<'a> {
    outputs: &'a [[f32; 2]],
    noise: &'a [f32],
    actions: &'a mut [f32],
    log_densities: &'a mut [f32],
}

impl WithSimd for Sample<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let results = self.actions.iter_mut().zip(self.log_densities);
        let samples = self.outputs.iter().zip(self.noise);
        for (([mean, output], noise), (action, log_density)) in samples.zip(results) {
            (*action, *log_density) = sample_one(*mean, clamp(*output), *noise);
        }
    }
}

struct PolicyGradient<'a> {
    outputs: &'a [[f32; 2]],
    samples: (&'a [f32], &'a [f32]),
    value_slopes: &'a [f32],
    temperature: f32,
    share: f32,
    gradient: &'a mut [[f32; 2]],
}

impl WithSimd for PolicyGradient<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (noise, actions) = self.samples;
        let samples = self.outputs.iter().zip(noise.iter().zip(actions));
        let rows = samples.zip(self.value_slopes.iter().zip(self.gradient));
        for (([_, output], (noise, action)), (value_slope, gradient)) in rows {
            let slope = (1.0 - action * action) * value_slope;
            let mean_slope = (2.0 * self.temperature).mul_add(*action, -slope);
            let log_deviation = clamp(*output);
            let deviation_slope = mean_slope * exp(log_deviation) * noise - self.temperature;
            gradient[0] = self.share * mean_slope;
            gradient[1] = if log_deviation == *output {
                self.share * deviation_slope
            } else {
                0.0
            };
        }
    }
}

/// log σ of an output.
#[inline(always)]
#[must_use]
pub fn clamp(log_deviation: f32) -> f32 {
    log_deviation.clamp(LOG_DEVIATION_BOUNDS[0], LOG_DEVIATION_BOUNDS[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sampled(outputs: &[f32], noise: &[f32]) -> (Vec<f32>, Vec<f32>) {
        let (mut actions, mut log_densities) = (vec![7.0], vec![7.0]);
        sample(outputs, noise, &mut actions, &mut log_densities);
        (actions, log_densities)
    }

    /// μ = ½, σ = 2, ε = −1: u = −1.5, a = tanh(−1.5) = −0.905148, 1 − a² = 0.180707, and
    /// log π = −½ − ln 2 − 0.918939 + 1.710880 = −0.401206.
    #[test]
    fn a_sample_by_hand() {
        let (actions, log_densities) = sampled(&[0.5, 2.0_f32.ln()], &[-1.0]);
        assert!((actions[0] + 0.905_148_3).abs() < 1e-6, "{actions:?}");
        assert!(
            (log_densities[0] + 0.401_206).abs() < 1e-5,
            "{log_densities:?}"
        );
    }

    /// ∫ π(a) da = 1: the sum over a grid of actions, for three policies.
    #[test]
    fn densities_integrate_to_one() {
        for (mean, log_deviation) in [(0.0_f64, 0.0_f64), (0.8, -1.0), (-1.5, 0.5)] {
            let count = 40_000;
            let grid = (0..count).map(|i| (2.0 * (f64::from(i) + 0.5) / f64::from(count)) - 1.0);
            let noise = grid.map(|a| ((a.atanh() - mean) / log_deviation.exp()) as f32);
            let noise: Vec<f32> = noise.collect();
            let outputs = [mean as f32, log_deviation as f32].repeat(noise.len());
            let (_, log_densities) = sampled(&outputs, &noise);
            let sum: f64 = log_densities.iter().map(|d| f64::from(*d).exp()).sum();
            let integral = sum * 2.0 / f64::from(count);
            assert!(
                (integral - 1.0).abs() < 2e-3,
                "{mean} {log_deviation}: {integral}"
            );
        }
    }

    /// Far in the tail, where tanh is 1 in f32, densities are finite: u = 30 has
    /// log(1 − tanh² u) = 2 log 2 − 60.
    #[test]
    fn densities_of_saturated_actions_are_finite() {
        let (actions, log_densities) = sampled(&[30.0, 0.0, -30.0, 0.0], &[0.0, 0.0]);
        assert_eq!(actions, [1.0, -1.0]);
        for density in log_densities {
            assert!(
                (density - (60.0 - 4.0_f32.ln() - HALF_LOG_TAU)).abs() < 1e-4,
                "{density}"
            );
        }
    }

    proptest! {
        #[test]
        fn squash_is_tanh(u in -20.0_f32..20.0) {
            prop_assert!((f64::from(squash(u)) - f64::from(u).tanh()).abs() < 2e-7);
        }

        /// L = mean(α log π − Q) with Q(a) = 3a − a², so that ∂Q/∂a = 3 − 2a.
        #[test]
        fn policy_gradients_agree_with_central_differences(
            means in prop::collection::vec(-1.5_f32..1.5, 4), log_deviations in prop::collection::vec(-1.5_f32..1.0, 4),
            noise in prop::collection::vec(-2.0_f32..2.0, 4), temperature in 0.0_f32..2.0,
        ) {
            let mut outputs: Vec<f32> = means.iter().zip(&log_deviations).flat_map(|(a, b)| [*a, *b]).collect();
            let loss = |outputs: &[f32]| -> f64 {
                let (actions, densities) = sampled(outputs, &noise);
                let terms = actions.iter().zip(&densities).map(|(a, d)| f64::from(temperature * d - (3.0 * a - a * a)));
                terms.sum::<f64>() / 2.0
            };
            let (actions, _) = sampled(&outputs, &noise);
            let slopes: Vec<f32> = actions.iter().map(|a| 3.0 - 2.0 * a).collect();
            let mut gradient = Vec::new();
            policy_gradient(&outputs, (&noise, &actions), &slopes, (temperature, 2), &mut gradient);
            for index in 0..outputs.len() {
                let (original, h) = (outputs[index], 1e-2);
                outputs[index] = original + h;
                let above = loss(&outputs);
                outputs[index] = original - h;
                let below = loss(&outputs);
                outputs[index] = original;
                let numeric = (above - below) / f64::from(2.0 * h);
                prop_assert!((numeric - f64::from(gradient[index])).abs() < 1e-2 * (1.0 + numeric.abs()), "{index}: {numeric} {}", gradient[index]);
            }
        }
    }

    /// Beyond the bounds, log σ has no gradient.
    #[test]
    fn clamped_deviations_have_no_gradient() {
        let outputs = [0.1, 5.0, 0.1, -30.0, 0.1, 0.0];
        let noise = [1.0, 1.0, 1.0];
        let (actions, _) = sampled(&outputs, &noise);
        let mut gradient = Vec::new();
        policy_gradient(
            &outputs,
            (&noise, &actions),
            &[1.0; 3],
            (0.5, 3),
            &mut gradient,
        );
        assert!(
            gradient[1] == 0.0 && gradient[3] == 0.0 && gradient[5] != 0.0,
            "{gradient:?}"
        );
    }
}
