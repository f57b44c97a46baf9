//! The optimizer Adam (Kingma & Ba 2015), which the thesis uses (§6).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::kernels::AdamStep;
use seedbed_input::numbers::{FractionBelowOne, NonNegative, Positive, ranged_number};

/// Parameters of Adam (Kingma & Ba 2015).
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AdamSettings {
    /// Step size α.
    pub step_size: NonNegative,
    /// Decay β₁ of the mean of gradients.
    pub beta1: FractionBelowOne,
    /// Decay β₂ of the mean of squared gradients.
    pub beta2: FractionBelowOne,
    /// Number ε that is added to the root of the second moment.
    pub epsilon: Positive,
}

impl Default for AdamSettings {
    fn default() -> Self {
        Self {
            step_size: ranged_number(1e-3),
            beta1: ranged_number(0.9),
            beta2: ranged_number(0.999),
            epsilon: ranged_number(1e-8),
        }
    }
}

/// The optimizer's state for one parameter vector.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Adam {
    settings: AdamSettings,
    first_moment: Vec<f32>,
    second_moment: Vec<f32>,
    steps: i32,
}

impl Adam {
    /// An optimizer for `count` parameters that has not taken a step.
    #[must_use]
    pub fn new(settings: AdamSettings, count: usize) -> Self {
        Self {
            settings,
            first_moment: vec![0.0; count],
            second_moment: vec![0.0; count],
            steps: 0,
        }
    }

    /// One step with the step size α times `factor`: m ← β₁m + (1−β₁)g, v ← β₂v + (1−β₂)g², θ ← θ −
    /// α m̂ / (√v̂ + ε), with m̂ = m/(1−β₁ᵗ), v̂ = v/(1−β₂ᵗ).
    ///
    /// # Panics
    /// If the slices do not have the optimizer's length.
    pub fn descend(&mut self, parameters: &mut [f32], gradient: &[f32], factor: f64) {
        let AdamSettings {
            step_size,
            beta1,
            beta2,
            epsilon,
        } = self.settings;
        self.steps = self.steps.saturating_add(1);
        let bias_correction = (1.0 - beta2.get().powi(self.steps)).sqrt();
        let rate = (step_size.get() * factor * bias_correction
            / (1.0 - beta1.get().powi(self.steps))) as f32;
        let epsilon = (epsilon.get() * bias_correction) as f32;
        let (beta1, beta2) = (beta1.get_f32(), beta2.get_f32());
        let (first_moment, second_moment) =
            (&mut self.first_moment[..], &mut self.second_moment[..]);
        AdamStep {
            parameters,
            gradient,
            first_moment,
            second_moment,
            beta1,
            beta2,
            rate,
            epsilon,
        }
        .run();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand, α = 0.1, β₁ = 0.9, β₂ = 0.999, ε ≈ 0: the first step moves by α·sign g; then with g
    /// = 1, 3: m = 0.09 + 0.3 = 0.39, m̂ = 0.39/0.19; v = 0.000999 + 0.009 = 0.009999, v̂ =
    /// 0.009999/0.001999; step 2 = 0.1·2.0526316/2.2365110 = 0.0917783.
    #[test]
    fn two_steps_by_hand() {
        let settings = AdamSettings {
            step_size: ranged_number(0.1),
            epsilon: ranged_number(1e-30),
            ..AdamSettings::default()
        };
        let mut adam = Adam::new(settings, 2);
        let mut parameters = [1.0, -1.0];
        adam.descend(&mut parameters, &[1.0, -2.0], 1.0);
        assert!((parameters[0] - 0.9).abs() < 1e-6 && (parameters[1] + 0.9).abs() < 1e-6);
        adam.descend(&mut parameters, &[3.0, 0.0], 1.0);
        assert!(
            (parameters[0] - (0.9 - 0.091_778_3)).abs() < 1e-5,
            "{}",
            parameters[0]
        );
    }
}
