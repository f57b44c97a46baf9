//! Information that one transition gives about the dynamics: the divergence KL(q(θ; φ + λΔφ) ‖
//! q(θ; φ)), nats, of the posterior q over the weights θ of a model p(s'|s, a; θ) after a gradient
//! step on the transition from the posterior before it (thesis §4.2.1; Houthooft et al. 2016,
//! VIME).
//!
//! q has an independent Gaussian 𝒩(μᵢ, σᵢ²) for each weight. The step is Δφ = H⁻¹ ∇ℓ with ℓ =
//! `E_q`[log p(s'|s, a; θ)] and the Hessian H of the divergence, ∂²/∂μ² = 1/σ² and ∂²/∂σ² = 2/σ².
//! The model provides the gradients `g_μ` and `g_σ` of ℓ.

/// Information gain to second order (thesis Eq. 32, in which ρ cancels): I = ½ λ² Σᵢ σᵢ² (`g_μᵢ`² +
/// ½ `g_σᵢ`²).   All slices: `[P]`
///
/// With N draws θ = μ + σ ε of the weights, g is the mean gradient over the draws; this mean is
/// squared.
///
/// # Panics
/// If the slices differ in length.
#[must_use]
pub fn second_order(
    deviation: &[f32],
    mean_gradient: &[f32],
    deviation_gradient: &[f32],
    step: f32,
) -> f32 {
    assert_eq!(
        [mean_gradient.len(), deviation_gradient.len()],
        [deviation.len(); 2]
    );
    let gradients = mean_gradient.iter().zip(deviation_gradient);
    let term = |(sigma, (mean_slope, sigma_slope)): (&f32, (&f32, &f32))| {
        sigma * sigma * (mean_slope * mean_slope + 0.5 * sigma_slope * sigma_slope)
    };
    0.5 * step * step * deviation.iter().zip(gradients).map(term).sum::<f32>()
}

/// Computes the coefficients c for which [`second_order`] with one draw θ = μ + σ ε is Σᵢ cᵢ (∂ log
/// p/∂θᵢ)²: since `g_μ` = ∂ log p/∂θ and `g_σ` = ε `g_μ`, cᵢ = ½ λ² σᵢ² (1 + ½ εᵢ²).
/// `deviation`, `noise`: `[P]` → `coefficients: [P]`, overwritten
///
/// A model can sum squares of gradients layer by layer, for many transitions at once and without
/// storing gradients. The estimate from one draw is biased upwards by the variance of the gradient:
/// the mean of ĝ² is g² + Var ĝ.
///
/// # Panics
/// If the slices differ in length.
pub fn one_draw_coefficients(
    deviation: &[f32],
    noise: &[f32],
    step: f32,
    coefficients: &mut Vec<f32>,
) {
    assert_eq!(deviation.len(), noise.len());
    let half_square = 0.5 * step * step;
    coefficients.clear();
    coefficients.extend(
        deviation
            .iter()
            .zip(noise)
            .map(|(sigma, noise)| half_square * sigma * sigma * (1.0 + 0.5 * noise * noise)),
    );
}

/// Information gain KL(q(φ + λΔφ) ‖ q(φ)) of an explicit step in φ = (μ, ρ) with σ = log(1 + eᵖ):
/// Δμ = σ² `g_μ`, Δρ = σ² `g_σ`/(2σ'), σ' = ∂σ/∂ρ.   All slices: `[P]`
///
/// With u = σ(ρ + λΔρ)/σ(ρ) − 1 the gain is Σ ½ λ² σ² `g_μ`² + u + ½ u² − log(1 + u). The terms of
/// the means equal those of [`second_order`] for any λ; the terms of the deviations converge to
/// those of [`second_order`] as λ → 0. Computed in double precision, because terms cancel if λ is
/// small.
///
/// # Panics
/// If the slices differ in length.
#[must_use]
pub fn explicit_step(
    deviation: &[f32],
    mean_gradient: &[f32],
    deviation_gradient: &[f32],
    step: f32,
) -> f64 {
    assert_eq!(
        [mean_gradient.len(), deviation_gradient.len()],
        [deviation.len(); 2]
    );
    let gradients = mean_gradient.iter().zip(deviation_gradient);
    let term = |(&sigma, (&mean_slope, &sigma_slope)): (&f32, (&f32, &f32))| {
        let [sigma, mean_slope, sigma_slope, step] =
            [sigma, mean_slope, sigma_slope, step].map(f64::from);
        let shift = step * sigma * mean_slope;
        let growth = relative_growth(sigma, sigma_slope, step);
        0.5 * shift * shift + growth + 0.5 * growth * growth - libm::log1p(growth)
    };
    deviation.iter().zip(gradients).map(term).sum()
}

/// The bonus that is added to a reward (thesis Eq. 28): η min(c, I/scale), or 0 if there is no
/// scale yet.
///
/// Gains I are divided by their typical size in earlier updates, such as the mean of their medians,
/// and bounded by c, because their distribution has a heavy tail and decreases by orders of
/// magnitude as the model learns.
#[must_use]
pub fn bonus(gain: f32, scale: Option<f32>, cap: f32, weight: f32) -> f32 {
    scale.map_or(0.0, |scale| weight * (gain / scale).min(cap))
}

/// Relative growth of a standard deviation in a step: u = σ(ρ + λΔρ)/σ(ρ) − 1 = log(1 + σ' (e^(λΔρ)
/// − 1))/σ, where σ' = eᵖ/(1 + eᵖ) = 1 − e⁻ˢ for s = σ.
fn relative_growth(sigma: f64, sigma_slope: f64, step: f64) -> f64 {
    // e^x would overflow for larger exponents x.
    const MAX_EXPONENT: f64 = 700.0;
    let slope = -libm::expm1(-sigma);
    let rho_step = step * sigma * sigma * sigma_slope / (2.0 * slope);
    libm::log1p(slope * libm::expm1(rho_step.min(MAX_EXPONENT))) / sigma
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// σ = ½, 2, g_μ = 4, 1, g_σ = 2, −1, λ = ½: ½·¼·(¼ (16 + 2) + 4 (1 + ½)) = 1.3125.
    #[test]
    fn second_order_by_hand() {
        assert_eq!(
            second_order(&[0.5, 2.0], &[4.0, 1.0], &[2.0, -1.0], 0.5),
            1.3125
        );
    }

    /// For ρ = 0, σ = log 2 and σ' = ½. g_σ = 2/σ² gives Δρ = 2: with λ = ½, ρ becomes 1 and σ
    /// becomes log(1 + e) = 1.3132617, which is r = 1.8946361 times as large. With r = 1 + u, u + ½
    /// u² − ln(1 + u) = ½ (r² − 1) − ln r = 0.6557962; g_μ = 2 adds ½·¼·σ²·4 = 0.2402265.
    #[test]
    fn explicit_step_by_hand() {
        let sigma = 2.0_f32.ln();
        let exact = explicit_step(&[sigma], &[2.0], &[2.0 / (sigma * sigma)], 0.5);
        assert!((exact - 0.655_796_2 - 0.240_226_5).abs() < 1e-5, "{exact}");
    }

    /// I/scale = 3 and 300, with a cap of 10 and η = 0.001.
    #[test]
    fn bonus_by_hand() {
        assert_eq!(bonus(6.0, None, 10.0, 1e-3), 0.0);
        assert!((bonus(6.0, Some(2.0), 10.0, 1e-3) - 0.003).abs() < 1e-9);
        assert!((bonus(600.0, Some(2.0), 10.0, 1e-3) - 0.01).abs() < 1e-9);
    }

    proptest! {
        #[test]
        fn one_draw_agrees_with_second_order(
            weights in prop::collection::vec((0.01_f32..1.3, -3.0_f32..3.0, -5.0_f32..5.0), 1..40), step in 0.01_f32..2.0,
        ) {
            let sigma: Vec<f32> = weights.iter().map(|w| w.0).collect();
            let noise: Vec<f32> = weights.iter().map(|w| w.1).collect();
            let slope: Vec<f32> = weights.iter().map(|w| w.2).collect();
            let sigma_slope: Vec<f32> = noise.iter().zip(&slope).map(|(noise, slope)| noise * slope).collect();
            let mut coefficients = Vec::new();
            one_draw_coefficients(&sigma, &noise, step, &mut coefficients);
            let factored: f32 = coefficients.iter().zip(&slope).map(|(c, g)| c * g * g).sum();
            let expected = second_order(&sigma, &slope, &sigma_slope, step);
            prop_assert!((factored - expected).abs() < 1e-4 * (1e-6 + expected), "{factored} {expected}");
        }

        /// The relative difference from the second-order gain is proportional to λ for small λ.
        #[test]
        fn small_explicit_steps_agree_with_second_order(sigma in 0.01_f32..1.3, mean_slope in -2.0_f32..2.0, sigma_slope in -2.0_f32..2.0) {
            prop_assume!(sigma_slope.abs() > 0.1);
            let difference = |step: f32| {
                let second = f64::from(second_order(&[sigma], &[0.0], &[sigma_slope], step));
                (explicit_step(&[sigma], &[0.0], &[sigma_slope], step) / second - 1.0).abs()
            };
            prop_assert!(difference(1e-2) < 2e-2 && difference(1e-4) < 2e-4, "{} {}", difference(1e-2), difference(1e-4));
            let with_mean = explicit_step(&[sigma], &[mean_slope], &[sigma_slope], 1.0) - explicit_step(&[sigma], &[0.0], &[sigma_slope], 1.0);
            prop_assert!((with_mean - f64::from(0.5 * (sigma * mean_slope).powi(2))).abs() < 1e-5);
        }
    }
}
