//! The Gaussian policy over one continuous action (thesis §1.5.4): π(a|s) = 𝒩(μ(s), σ(s)²). σ is
//! represented by its logarithm.

use crate::math::exp;

/// ½ log 2π.
const HALF_LOG_TAU: f32 = 0.918_938_5;

/// Log-density log π(a) = −½ ((a − μ)/σ)² − log σ − ½ log 2π.
#[must_use]
pub fn log_density(action: f32, mean: f32, log_deviation: f32) -> f32 {
    let standardized = (action - mean) / exp(log_deviation);
    -0.5 * standardized * standardized - log_deviation - HALF_LOG_TAU
}

/// Derivatives of log π(a) with respect to μ and log σ: (a − μ)/σ² and ((a − μ)/σ)² − 1.
#[must_use]
pub fn log_density_gradient(action: f32, mean: f32, log_deviation: f32) -> [f32; 2] {
    let deviation = exp(log_deviation);
    let standardized = (action - mean) / deviation;
    [standardized / deviation, standardized * standardized - 1.0]
}

/// Entropy H = log σ + ½ log 2πe, nats.
#[must_use]
pub fn entropy(log_deviation: f32) -> f32 {
    log_deviation + HALF_LOG_TAU + 0.5
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// At a = μ + σ, σ = 2: −½ − ln 2 − ½ ln 2π = −2.1120857; H = ln 2 + 1.4189385 = 2.1120857.
    #[test]
    fn density_and_entropy_by_hand() {
        assert!((log_density(3.0, 1.0, 2.0_f32.ln()) + 2.112_085_7).abs() < 1e-6);
        assert!((entropy(2.0_f32.ln()) - 2.112_085_7).abs() < 1e-6);
    }

    proptest! {
        #[test]
        fn gradient_agrees_with_central_differences(action in -2.0_f32..2.0, mean in -2.0_f32..2.0, log_deviation in -1.0_f32..1.0) {
            let h = 1e-2;
            let mean_difference = (log_density(action, mean + h, log_deviation) - log_density(action, mean - h, log_deviation)) / (2.0 * h);
            let log_difference = (log_density(action, mean, log_deviation + h) - log_density(action, mean, log_deviation - h)) / (2.0 * h);
            let [mean_gradient, log_gradient] = log_density_gradient(action, mean, log_deviation);
            let scale = 1.0 + mean_gradient.abs() + log_gradient.abs();
            prop_assert!((mean_difference - mean_gradient).abs() < 1e-2 * scale, "{mean_difference} {mean_gradient}");
            prop_assert!((log_difference - log_gradient).abs() < 1e-2 * scale, "{log_difference} {log_gradient}");
        }
    }
}
