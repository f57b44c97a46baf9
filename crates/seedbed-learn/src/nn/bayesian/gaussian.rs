//! Weights as independent Gaussians: q(w) = Π 𝒩(wᵢ; μᵢ, σᵢ²) (thesis Eq. 29, with a deviation for
//! each weight).

use serde::{Deserialize, Serialize};

/// A Gaussian over P weights whose covariance is diagonal.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DiagonalGaussian {
    /// `[P]`: μ
    pub mean: Vec<f32>,
    /// `[P]`: σ
    pub deviation: Vec<f32>,
}

impl DiagonalGaussian {
    /// 𝒩(0, σ² I) over `count` weights.
    #[must_use]
    pub fn isotropic(count: usize, deviation: f32) -> Self {
        Self {
            mean: vec![0.0; count],
            deviation: vec![deviation; count],
        }
    }

    /// w = μ + σ ε for standard-normal ε; −ε gives the antithetic draw.   `noise: [P]` →
    /// `weights: [P]`, overwritten
    ///
    /// A noise that stays the same while q moves is a fixed sample of the model.
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

    /// A perturbed copy (thesis Alg. 2): μ ← μ₀, σ ← σ₀ |z|.   `factors: [P]`, the z
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

    /// A perturbed copy (thesis §2.3): μ ← μ₀ + σ₀ z, σ ← σ₀.   `shifts: [P]`, the z
    ///
    /// # Panics
    /// If `shifts` has another length.
    pub fn copy_shifted(&mut self, original: &Self, shifts: &[f32]) {
        original.draw(shifts, &mut self.mean);
        self.deviation.clone_from(&original.deviation);
    }

    /// KL(q‖p) = Σ ½ ((σ/σ')² + (μ − μ')²/σ'² − 1) + log σ' − log σ, nats; q is `self`, p has μ'
    /// and σ' (thesis Eq. 31).
    ///
    /// # Panics
    /// If the lengths differ.
    #[must_use]
    pub fn divergence(&self, from: &Self) -> f64 {
        self.with(from)
            .map(|[mean, deviation, other_mean, other]| {
                divergence(mean, deviation, other_mean, other)
            })
            .sum()
    }

    /// Adds w ∂KL(q‖p)/∂μ = w (μ − μ')/σ'² and w ∂KL(q‖p)/∂σ = w (σ/σ'² − 1/σ).   `mean_slope`,
    /// `deviation_slope`: `[P]`
    pub(super) fn add_divergence_gradient(
        &self,
        from: &Self,
        w: f32,
        mean_slope: &mut [f32],
        deviation_slope: &mut [f32],
    ) {
        let slopes = mean_slope.iter_mut().zip(deviation_slope);
        let ours = self.mean.iter().zip(&self.deviation);
        let theirs = from.mean.iter().zip(&from.deviation);
        for (((by_mean, by_deviation), (mean, deviation)), (other_mean, other)) in
            slopes.zip(ours).zip(theirs)
        {
            let precision = 1.0 / (other * other);
            *by_mean += w * (mean - other_mean) * precision;
            *by_deviation += w * (deviation * precision - 1.0 / deviation);
        }
    }

    /// Weight by weight: μ, σ, μ', σ'.
    fn with<'a>(&'a self, other: &'a Self) -> impl Iterator<Item = [f64; 4]> + 'a {
        assert_eq!(self.mean.len(), other.mean.len());
        let ours = self.mean.iter().zip(&self.deviation);
        let theirs = other.mean.iter().zip(&other.deviation);
        ours.zip(theirs)
            .map(|((a, b), (c, d))| [a, b, c, d].map(|&x| f64::from(x)))
    }
}

/// KL(𝒩(μ, σ²) ‖ 𝒩(μ', σ'²)). In double precision, because its terms cancel where the two are
/// close.
fn divergence(mean: f64, deviation: f64, other_mean: f64, other: f64) -> f64 {
    let (ratio, shift) = (deviation / other, (mean - other_mean) / other);
    0.5 * (ratio * ratio + shift * shift - 1.0) - ratio.ln()
}

/// σ = log(1 + eᵖ).
pub(super) fn softplus(rho: f32) -> f32 {
    rho.max(0.0) + (-rho.abs()).exp().ln_1p()
}

/// ∂σ/∂ρ = 1/(1 + e⁻ᵖ).
pub(super) fn softplus_slope(rho: f32) -> f32 {
    1.0 / (1.0 + (-rho).exp())
}

/// ρ = log(eˢ − 1) for s = σ.
pub(super) fn softplus_inverse(deviation: f32) -> f32 {
    deviation.exp_m1().ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand_distr::{Distribution, StandardNormal};
    use seedbed_env::random::{Purpose, stream};

    fn one(mean: f32, deviation: f32) -> DiagonalGaussian {
        DiagonalGaussian {
            mean: vec![mean],
            deviation: vec![deviation],
        }
    }

    /// ½ (¼ + 1 − 1) + ln 2 = 0.8181472 for 𝒩(0, 1) against 𝒩(2, 4); 0 of one against itself.
    #[test]
    fn divergence_by_hand() {
        assert!((one(0.0, 1.0).divergence(&one(2.0, 2.0)) - 0.818_147_2).abs() < 1e-6);
        assert_eq!(one(3.0, 0.7).divergence(&one(3.0, 0.7)), 0.0);
    }

    /// The mean of log q(w) − log p(w) over 20,000 draws w ~ q of three weights, within four
    /// standard errors.
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
        let log_density = |of: &DiagonalGaussian, w: &[f32]| -> f64 {
            let each = of.mean.iter().zip(&of.deviation).zip(w);
            each.map(|((mean, deviation), w)| {
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
    fn hessian_of_the_divergence() {
        let sigma = |rho: f64| rho.exp().ln_1p();
        let second = |f: &dyn Fn(f64) -> f64| (f(1e-3) - 2.0 * f(0.0) + f(-1e-3)) / 1e-6;
        let start = sigma(0.0);
        assert!((second(&|h| divergence(0.0, sigma(h), 0.0, start)) - 1.040_684).abs() < 1e-5);
        assert!((second(&|h| divergence(0.0, start + h, 0.0, start)) - 4.162_738).abs() < 1e-4);
        assert!((second(&|h| divergence(h, start, 0.0, start)) - 2.081_369).abs() < 1e-5);
    }

    /// At ρ = −9 σ = 1.2340e−4; where ρ = 0 it is log 2; far out it is ρ.
    #[test]
    fn softplus_and_its_inverse() {
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

    /// μ = 1, σ = 0.5, z = −2: scaled (1, 1), shifted (0, 0.5); a draw with ε = 1 from each.
    #[test]
    fn perturbed_copies_by_hand() {
        let (original, mut copy, mut weights) =
            (one(1.0, 0.5), DiagonalGaussian::default(), Vec::new());
        copy.copy_scaled(&original, &[-2.0]);
        assert_eq!(copy, one(1.0, 1.0));
        copy.draw(&[1.0], &mut weights);
        assert_eq!(weights, [2.0]);
        copy.copy_shifted(&original, &[-2.0]);
        assert_eq!(copy, one(0.0, 0.5));
        copy.draw(&[1.0], &mut weights);
        assert_eq!(weights, [0.5]);
    }

    proptest! {
        #[test]
        fn gradient_agrees_with_central_differences(
            mean in -2.0_f32..2.0, deviation in 0.05_f32..1.3, other_mean in -2.0_f32..2.0, other in 0.05_f32..1.3, w in 0.1_f32..3.0,
        ) {
            let (mut by_mean, mut by_deviation) = ([1.0], [2.0]);
            one(mean, deviation).add_divergence_gradient(&one(other_mean, other), w, &mut by_mean, &mut by_deviation);
            let [mean, deviation, other_mean, other] = [mean, deviation, other_mean, other].map(f64::from);
            let numeric = |f: &dyn Fn(f64) -> f64| f64::from(w) * (f(1e-6) - f(-1e-6)) / 2e-6;
            let mean_slope = numeric(&|h| divergence(mean + h, deviation, other_mean, other));
            let deviation_slope = numeric(&|h| divergence(mean, deviation + h, other_mean, other));
            prop_assert!((f64::from(by_mean[0]) - 1.0 - mean_slope).abs() < 1e-4 * (1.0 + mean_slope.abs()));
            prop_assert!((f64::from(by_deviation[0]) - 2.0 - deviation_slope).abs() < 1e-4 * (1.0 + deviation_slope.abs()));
        }
    }
}
