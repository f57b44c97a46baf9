//! Pop-Art (thesis §3.2, Alg. 1; van Hasselt et al. 2016): targets are normalized by running
//! moments, and the output layer is rescaled so that updates of the moments do not change the
//! denormalized outputs.

use serde::{Deserialize, Serialize};

/// Running mean and standard deviation of targets. With β = 0, targets stay unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PopArt {
    beta: f64,
    mean: f64,
    second_moment: f64,
}

/// Minimal standard deviation, which keeps σ⁻¹ finite.
const MIN_DEVIATION: f64 = 1e-4;

impl PopArt {
    /// A normalizer with mean 0 and second moment 1, whose moments are updated with step size
    /// `beta`.
    #[must_use]
    pub fn new(beta: f64) -> Self {
        Self {
            beta,
            mean: 0.0,
            second_moment: 1.0,
        }
    }

    /// A normalizer that does not change targets.
    #[must_use]
    pub fn identity() -> Self {
        Self::new(0.0)
    }

    /// Whether the moments are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.mean.is_finite() && self.second_moment.is_finite()
    }

    /// Mean μ.
    #[must_use]
    pub fn mean(&self) -> f32 {
        self.mean as f32
    }

    /// Standard deviation σ = √(ν − μ²), but at least 10⁻⁴.
    #[must_use]
    pub fn deviation(&self) -> f32 {
        self.exact_deviation() as f32
    }

    /// Updates the moments, μ ← (1−β)μ + β mean Y and ν ← (1−β)ν + β mean Y², and rescales the
    /// output layer, W ← σ/σ' W and b ← (σ b + μ − μ')/σ', where σ' and μ' are the new moments.
    ///
    /// `targets: [N]`; `weight` and `bias` are the parameters of the output layer. Does nothing if
    /// there are no targets, or if β = 0.
    pub fn update(&mut self, targets: &[f32], weight: &mut [f32], bias: &mut [f32]) {
        if targets.is_empty() || self.beta == 0.0 {
            return;
        }
        let (old_mean, old_deviation) = (self.mean, self.exact_deviation());
        let mean_power = |power| {
            targets
                .iter()
                .map(|&y| f64::from(y).powi(power))
                .sum::<f64>()
                / targets.len() as f64
        };
        self.mean += self.beta * (mean_power(1) - self.mean);
        self.second_moment += self.beta * (mean_power(2) - self.second_moment);
        let deviation = self.exact_deviation();
        let scale = old_deviation / deviation;
        for w in weight {
            *w = (f64::from(*w) * scale) as f32;
        }
        let shift = (old_mean - self.mean) / deviation;
        for b in bias {
            *b = (f64::from(*b) * scale + shift) as f32;
        }
    }

    fn exact_deviation(&self) -> f64 {
        (self.second_moment - self.mean * self.mean)
            .max(0.0)
            .sqrt()
            .max(MIN_DEVIATION)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// β = 0.1, Y = {10, 20}: μ = 0.1·15 = 1.5, ν = 0.9 + 0.1·250 = 25.9, σ = √(25.9 − 2.25) =
    /// 4.8631266.
    #[test]
    fn moments_by_hand() {
        let mut normalizer = PopArt::new(0.1);
        normalizer.update(&[10.0, 20.0], &mut [], &mut []);
        assert!((normalizer.mean() - 1.5).abs() < 1e-6);
        assert!((normalizer.deviation() - 4.863_126_6).abs() < 1e-5);
    }

    #[test]
    fn the_deviation_of_constant_targets_is_positive() {
        let mut normalizer = PopArt::new(1.0);
        normalizer.update(&[3.0, 3.0], &mut [1.0], &mut [0.0]);
        assert!(normalizer.deviation() >= 1e-4);
    }

    proptest! {
        #[test]
        fn denormalized_outputs_are_preserved(
            targets in prop::collection::vec(-500.0_f32..500.0, 1..50), feature in -1.0_f32..1.0, w in -2.0_f32..2.0, b in -2.0_f32..2.0,
        ) {
            let mut normalizer = PopArt::new(0.1);
            let (mut weight, mut bias) = ([w], [b]);
            let output = |n: &PopArt, w: f32, b: f32| n.deviation() * (w * feature + b) + n.mean();
            for _ in 0..3 {
                let before = output(&normalizer, weight[0], bias[0]);
                normalizer.update(&targets, &mut weight, &mut bias);
                let after = output(&normalizer, weight[0], bias[0]);
                prop_assert!((before - after).abs() < 2e-3 * (1.0 + before.abs()), "{before} {after}");
            }
        }
    }
}
