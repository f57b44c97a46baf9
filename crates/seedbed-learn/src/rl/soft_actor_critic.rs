//! Soft actor-critic (Haarnoja et al. 2018): targets and losses of critics Q(s, a), the value that the
//! policy ascends, and the temperature α. Numbers of equations are those of Haarnoja et al. 2018b,
//! "Soft actor-critic algorithms and applications".
//!
//! Values of several critics are rows `[critics × B]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the values of several critics are combined for the policy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum Combination {
    /// The smallest value (Haarnoja et al. 2018).
    Min,
    /// The mean of all values (REDQ, Chen et al. 2021).
    Mean,
}

/// Targets yᵢ = rᵢ + γᵢ (min Q′(s′ᵢ, a′ᵢ) − α log π(a′ᵢ|s′ᵢ)), the minimum being over critics, where γᵢ
/// is 0 after the end of an episode (Eq. 2 and 3, with clipped double Q-learning).
///
/// `rewards`, `discounts`, `next_log_probs: [B]`, `next_values: [critics × B]` → `targets: [B]`,
/// overwritten
///
/// # Panics
/// If the slices have different numbers of samples.
pub fn targets(
    rewards: &[f32],
    discounts: &[f32],
    next_values: &[f32],
    next_log_probs: &[f32],
    temperature: f32,
    targets: &mut Vec<f32>,
) {
    let batch = rewards.len();
    assert_eq!((discounts.len(), next_log_probs.len()), (batch, batch));
    assert_eq!(next_values.len() % batch, 0);
    targets.clear();
    targets.resize(batch, f32::INFINITY);
    for values in next_values.chunks_exact(batch) {
        for (smallest, value) in targets.iter_mut().zip(values) {
            // Unlike with `f32::min`, NaN stays visible.
            if *value < *smallest || value.is_nan() {
                *smallest = *value;
            }
        }
    }
    for (index, target) in targets.iter_mut().enumerate() {
        let soft_value = *target - temperature * next_log_probs[index];
        *target = rewards[index] + discounts[index] * soft_value;
    }
}

/// Computes the loss L = ½ mean (Q(sᵢ, aᵢ) − yᵢ)² of a critic (Eq. 5) and its gradient ∂L/∂Q for
/// constant targets; returns L.   `values`, `targets: [B]` → `gradient: [B]`, overwritten
pub fn squared_error(values: &[f32], targets: &[f32], gradient: &mut Vec<f32>) -> f32 {
    let share = 1.0 / targets.len() as f32;
    gradient.clear();
    let mut loss = 0.0;
    for (value, target) in values.iter().zip(targets) {
        let error = value - target;
        gradient.push(share * error);
        loss += 0.5 * share * error * error;
    }
    loss
}

/// How much each critic contributes to the combined value of each sample: 1 for the first critic with
/// the smallest value and 0 for the others, or the same share for all. Returns the mean combined value.
/// `values: [critics × B]` → `weights: [critics × B]`, overwritten
pub fn combine(
    values: &[f32],
    batch: usize,
    combination: Combination,
    weights: &mut Vec<f32>,
) -> f32 {
    weights.clear();
    let critics = values.len() / batch;
    match combination {
        Combination::Mean => weights.resize(values.len(), 1.0 / critics as f32),
        Combination::Min => {
            weights.resize(values.len(), 0.0);
            for sample in 0..batch {
                let mut smallest = sample;
                for index in (sample..values.len()).step_by(batch) {
                    if values[index] < values[smallest] {
                        smallest = index;
                    }
                }
                weights[smallest] = 1.0;
            }
        }
    }
    let terms = values.iter().zip(&*weights);
    terms.map(|(value, weight)| value * weight).sum::<f32>() / batch as f32
}

/// The derivative of the temperature's loss −log α (mean log π + H̄) with respect to log α, where H̄ is
/// the target of the entropy: the entropy's excess. It has the sign of the derivative of Eq. 18,
/// which is α times as large.   `log_probs: [B]`
#[must_use]
pub fn log_temperature_slope(log_probs: &[f32], target_entropy: f32) -> f32 {
    let mean = log_probs.iter().sum::<f32>() / log_probs.len() as f32;
    -mean - target_entropy
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two samples: min(5, 3) = 3 and min(1, 2) = 1; soft values 3 − ½·(−1) = 3.5 and 1 − ½·2 = 0;
    /// y = 1 + 0.9·3.5 = 4.15, and 2 after the end of an episode.
    #[test]
    fn targets_by_hand() {
        let mut computed = Vec::new();
        targets(
            &[1.0, 2.0],
            &[0.9, 0.0],
            &[5.0, 1.0, 3.0, 2.0],
            &[-1.0, 2.0],
            0.5,
            &mut computed,
        );
        assert!(
            (computed[0] - 4.15).abs() < 1e-6 && computed[1] == 2.0,
            "{computed:?}"
        );
    }

    #[test]
    fn values_that_are_no_numbers_stay_visible() {
        for next_values in [[f32::NAN, 2.0], [2.0, f32::NAN]] {
            let mut computed = Vec::new();
            targets(&[0.0], &[1.0], &next_values, &[0.0], 0.0, &mut computed);
            assert!(computed[0].is_nan());
        }
    }

    /// Errors 2 and −1: L = ½·½ (4 + 1) = 1.25, derivatives ½·2 and ½·(−1).
    #[test]
    fn squared_errors_by_hand() {
        let mut gradient = vec![9.0];
        let loss = squared_error(&[3.0, 0.5], &[1.0, 1.5], &mut gradient);
        assert_eq!((loss, gradient), (1.25, vec![1.0, -0.5]));
    }

    /// Values (1, 4) of the first critic and (2, 3) of the second: minima 1 and 3, means 1.5 and 3.5.
    #[test]
    fn values_are_combined() {
        let (values, mut weights) = ([1.0, 4.0, 2.0, 3.0], vec![9.0]);
        assert_eq!(combine(&values, 2, Combination::Min, &mut weights), 2.0);
        assert_eq!(weights, [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(combine(&values, 2, Combination::Mean, &mut weights), 2.5);
        assert_eq!(weights, [0.5; 4]);
    }

    /// The entropy −mean(−3, −1) = 2 exceeds the target −1 by 3, so that descent lowers log α.
    #[test]
    fn the_temperature_falls_if_the_entropy_is_above_its_target() {
        assert_eq!(log_temperature_slope(&[-3.0, -1.0], -1.0), 3.0);
    }
}
