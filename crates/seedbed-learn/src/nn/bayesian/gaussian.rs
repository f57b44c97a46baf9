//! Independent Gaussian weights: q(w) = Π 𝒩(wᵢ; μᵢ, σᵢ²) (thesis Eq. 29, with one deviation per
//! weight).

#![expect(
    clippy::inline_always,
    reason = "a loop is compiled for a SIMD instruction set only if it is inlined into the dispatch"
)]

use serde::{Deserialize, Serialize};

use pulp::{Arch, Simd, WithSimd};

use crate::math::{exp, ln_1p};

/// A Gaussian distribution of P weights with diagonal covariance.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DiagonalGaussian {
    /// Means μ: `[P]`.
    pub mean: Vec<f32>,
    /// Standard deviations σ: `[P]`.
    pub deviation: Vec<f32>,
}

impl DiagonalGaussian {
    /// The distribution 𝒩(0, σ² I) of `count` weights.
    #[must_use]
    pub fn isotropic(count: usize, deviation: f32) -> Self {
        Self {
            mean: vec![0.0; count],
            deviation: vec![deviation; count],
        }
    }

    /// Weights w = μ + σ ε for standard-normal noise ε; −ε gives the antithetic draw.   `noise:
    /// [P]` → `weights: [P]`, overwritten
    ///
    /// # Panics
    /// If `noise` has another length.
    pub fn draw(&self, noise: &[f32], weights: &mut Vec<f32>) {
        assert_eq!(noise.len(), self.mean.len());
        weights.clear();
        weights.extend(
            self.mean
                .iter()
                .zip(&self.deviation)
                .zip(noise)
                .map(|((mean, deviation), noise)| mean + deviation * noise),
        );
    }

    /// Becomes a copy with scaled deviations (thesis Alg. 2): μ ← μ₀, σ ← σ₀ |z|, where z are the
    /// `factors: [P]`.
    ///
    /// # Panics
    /// If `factors` has another length.
    pub fn copy_scaled(&mut self, original: &Self, factors: &[f32]) {
        assert_eq!(factors.len(), original.mean.len());
        self.mean.clone_from(&original.mean);
        self.deviation.clear();
        self.deviation.extend(
            original
                .deviation
                .iter()
                .zip(factors)
                .map(|(deviation, factor)| deviation * factor.abs()),
        );
    }

    /// Becomes a copy with shifted means (thesis §2.3): μ ← μ₀ + σ₀ z, σ ← σ₀, where z are the
    /// `shifts: [P]`.
    ///
    /// # Panics
    /// If `shifts` has another length.
    pub fn copy_shifted(&mut self, original: &Self, shifts: &[f32]) {
        original.draw(shifts, &mut self.mean);
        self.deviation.clone_from(&original.deviation);
    }

    /// Divergence KL(q‖p) = Σ ½ ((σ/σ')² + (μ − μ')²/σ'² − 1) + log σ' − log σ, nats, where q is
    /// `self` and `other` is p with μ' and σ' (thesis Eq. 31).
    ///
    /// # Panics
    /// If the lengths differ.
    #[must_use]
    pub fn divergence(&self, other: &Self) -> f64 {
        assert_eq!(self.mean.len(), other.mean.len());
        let own_moments = self.mean.iter().zip(&self.deviation);
        let other_moments = other.mean.iter().zip(&other.deviation);
        let mut sum = 0.0;
        for ((mean, deviation), (other_mean, other_deviation)) in own_moments.zip(other_moments) {
            let [mean, deviation] = [*mean, *deviation].map(f64::from);
            let [other_mean, other_deviation] = [*other_mean, *other_deviation].map(f64::from);
            sum += divergence(mean, deviation, other_mean, other_deviation);
        }
        sum
    }

    /// Adds w ∂KL(q‖p)/∂μ = w (μ − μ')/σ'² to `mean_gradient` and w ∂KL(q‖p)/∂σ = w (σ/σ'² − 1/σ)
    /// to `deviation_gradient`: `[P]` each. q is `self`, p is `other`, w is `weight`.
    pub(super) fn add_divergence_gradient(
        &self,
        other: &Self,
        weight: f32,
        mean_gradient: &mut [f32],
        deviation_gradient: &mut [f32],
    ) {
        let gradients = mean_gradient.iter_mut().zip(deviation_gradient);
        let own_moments = self.mean.iter().zip(&self.deviation);
        let other_moments = other.mean.iter().zip(&other.deviation);
        for (((mean_slope, deviation_slope), (mean, deviation)), (other_mean, other_deviation)) in
            gradients.zip(own_moments).zip(other_moments)
        {
            let precision = 1.0 / (other_deviation * other_deviation);
            *mean_slope += weight * (mean - other_mean) * precision;
            *deviation_slope += weight * (deviation * precision - 1.0 / deviation);
        }
    }
}

/// KL(𝒩(μ, σ²) ‖ 𝒩(μ', σ'²)), nats. Computed in double precision, because the terms cancel if the
/// distributions are similar.
fn divergence(mean: f64, deviation: f64, other_mean: f64, other_deviation: f64) -> f64 {
    let ratio = deviation / other_deviation;
    let shift = (mean - other_mean) / other_deviation;
    0.5 * (ratio * ratio + shift * shift - 1.0) - libm::log(ratio)
}

/// σ = log(1 + eᵖ) in place of each ρ.
pub(super) fn softplus_in_place(rho: &mut [f32]) {
    Arch::new().dispatch(SoftplusInPlace(rho));
}

struct SoftplusInPlace<'a>(&'a mut [f32]);

impl WithSimd for SoftplusInPlace<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for rho in self.0 {
            *rho = rho.max(0.0) + ln_1p(exp(-rho.abs()));
        }
    }
}

/// Multiplies each of the `slopes` by ∂σ/∂ρ = 1/(1 + e⁻ᵖ).
pub(super) fn multiply_by_softplus_slope(rho: &[f32], slopes: &mut [f32]) {
    Arch::new().dispatch(MultiplyBySoftplusSlope { rho, slopes });
}

struct MultiplyBySoftplusSlope<'a> {
    rho: &'a [f32],
    slopes: &'a mut [f32],
}

impl WithSimd for MultiplyBySoftplusSlope<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (slope, rho) in self.slopes.iter_mut().zip(self.rho) {
            *slope *= 1.0 / (1.0 + exp(-*rho));
        }
    }
}

/// ρ = log(eˢ − 1) for s = σ.
pub(super) fn softplus_inverse(deviation: f32) -> f32 {
    libm::logf(libm::expm1f(deviation))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand_distr::{Distribution, StandardNormal};
    use seedbed_random::{Purpose, stream};

    fn gaussian(mean: f32, deviation: f32) -> DiagonalGaussian {
        DiagonalGaussian {
            mean: vec![mean],
            deviation: vec![deviation],
        }
    }

    /// KL(𝒩(0, 1) ‖ 𝒩(2, 4)) = ½ (¼ + 1 − 1) + ln 2 = 0.8181472; it is 0 for equal distributions.
    #[test]
    fn divergence_by_hand() {
        assert!((gaussian(0.0, 1.0).divergence(&gaussian(2.0, 2.0)) - 0.818_147_2).abs() < 1e-6);
        assert_eq!(gaussian(3.0, 0.7).divergence(&gaussian(3.0, 0.7)), 0.0);
    }

    /// The mean of log q(w) − log p(w) over 20,000 draws w ~ q of three weights; the tolerance is
    /// four standard errors.
    #[test]
    fn divergence_agrees_with_monte_carlo() {
        let q = DiagonalGaussian {
            mean: vec![0.3, -1.0, 0.0],
            deviation: vec![0.5, 0.2, 1.5],
        };
        let p = DiagonalGaussian {
            mean: vec![0.0, -0.8, 0.4],
            deviation: vec![0.7, 0.3, 1.0],
        };
        let log_density = |gaussian: &DiagonalGaussian, w: &[f32]| -> f64 {
            let terms = gaussian.mean.iter().zip(&gaussian.deviation).zip(w);
            terms
                .map(|((mean, deviation), w)| {
                    -0.5 * f64::from((w - mean) / deviation).powi(2) - f64::from(deviation.ln())
                })
                .sum()
        };
        let mut random = stream(3, Purpose::Preview, 0, 0);
        let mut weights = Vec::new();
        let samples: Vec<f64> = (0..20_000)
            .map(|_| {
                let noise: [f32; 3] = std::array::from_fn(|_| StandardNormal.sample(&mut random));
                q.draw(&noise, &mut weights);
                log_density(&q, &weights) - log_density(&p, &weights)
            })
            .collect();
        let mean = samples.iter().sum::<f64>() / 20_000.0;
        let variance = samples.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 19_999.0;
        let standard_error = (variance / 20_000.0).sqrt();
        assert!(
            standard_error < 0.02 && (mean - q.divergence(&p)).abs() < 4.0 * standard_error,
            "{mean} {}",
            q.divergence(&p)
        );
    }

    /// At φ' = φ, ρ = 0: ∂²KL/∂ρ² = 2 e²ᵖ/(1 + eᵖ)² / log²(1 + eᵖ) = ½/log² 2 = 1.040684 (Eq. 31's
    /// text lacks the square); ∂²KL/∂σ² = 2/σ² = 4.162738; ∂²KL/∂μ² = 1/σ² = 2.081369. By second
    /// differences (f(h) − 2f(0) + f(−h))/h², h = 10⁻³.
    #[test]
    fn hessian_of_the_divergence_by_hand() {
        let sigma = |rho: f64| rho.exp().ln_1p();
        let second_derivative = |f: &dyn Fn(f64) -> f64| (f(1e-3) - 2.0 * f(0.0) + f(-1e-3)) / 1e-6;
        let start = sigma(0.0);
        assert!(
            (second_derivative(&|h| divergence(0.0, sigma(h), 0.0, start)) - 1.040_684).abs()
                < 1e-5
        );
        assert!(
            (second_derivative(&|h| divergence(0.0, start + h, 0.0, start)) - 4.162_738).abs()
                < 1e-4
        );
        assert!(
            (second_derivative(&|h| divergence(h, start, 0.0, start)) - 2.081_369).abs() < 1e-5
        );
    }

    fn softplus(rho: f32) -> f32 {
        let mut deviation = [rho];
        softplus_in_place(&mut deviation);
        deviation[0]
    }

    fn softplus_slope(rho: f32) -> f32 {
        let mut slope = [1.0];
        multiply_by_softplus_slope(&[rho], &mut slope);
        slope[0]
    }

    /// σ is 1.2340e−4 for ρ = −9, log 2 for ρ = 0, and ρ for large ρ.
    #[test]
    fn softplus_its_inverse_and_its_slope_agree() {
        assert!((softplus(-9.0) / 1.234_021_9e-4 - 1.0).abs() < 1e-5);
        assert!((softplus(0.0) - 2.0_f32.ln()).abs() < 1e-7 && softplus(80.0) == 80.0);
        for rho in [-9.0_f32, -3.0, 0.0, 1.0] {
            assert!(
                (softplus_inverse(softplus(rho)) - rho).abs() < 1e-4,
                "{rho}"
            );
            let numeric = (softplus(rho + 1e-2) - softplus(rho - 1e-2)) / 2e-2;
            assert!((numeric - softplus_slope(rho)).abs() < 1e-4, "{rho}");
        }
    }

    /// μ = 1, σ = 0.5, z = −2: the scaled copy has moments (1, 1), the shifted copy (0, 0.5). Draws
    /// with ε = 1 are μ + σ: 2 and 0.5.
    #[test]
    fn perturbed_copies_by_hand() {
        let (original, mut copy, mut weights) =
            (gaussian(1.0, 0.5), DiagonalGaussian::default(), Vec::new());
        copy.copy_scaled(&original, &[-2.0]);
        assert_eq!(copy, gaussian(1.0, 1.0));
        copy.draw(&[1.0], &mut weights);
        assert_eq!(weights, [2.0]);
        copy.copy_shifted(&original, &[-2.0]);
        assert_eq!(copy, gaussian(0.0, 0.5));
        copy.draw(&[1.0], &mut weights);
        assert_eq!(weights, [0.5]);
    }

    proptest! {
        #[test]
        fn gradient_agrees_with_central_differences(
            mean in -2.0_f32..2.0, deviation in 0.05_f32..1.3, other_mean in -2.0_f32..2.0, other in 0.05_f32..1.3, w in 0.1_f32..3.0,
        ) {
            let (mut mean_gradient, mut deviation_gradient) = ([1.0], [2.0]);
            gaussian(mean, deviation).add_divergence_gradient(&gaussian(other_mean, other), w, &mut mean_gradient, &mut deviation_gradient);
            let [mean, deviation, other_mean, other] = [mean, deviation, other_mean, other].map(f64::from);
            let numeric = |f: &dyn Fn(f64) -> f64| f64::from(w) * (f(1e-6) - f(-1e-6)) / 2e-6;
            let mean_slope = numeric(&|h| divergence(mean + h, deviation, other_mean, other));
            let deviation_slope = numeric(&|h| divergence(mean, deviation + h, other_mean, other));
            prop_assert!((f64::from(mean_gradient[0]) - 1.0 - mean_slope).abs() < 1e-4 * (1.0 + mean_slope.abs()));
            prop_assert!((f64::from(deviation_gradient[0]) - 2.0 - deviation_slope).abs() < 1e-4 * (1.0 + deviation_slope.abs()));
        }
    }
}
