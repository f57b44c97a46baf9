//! Q-learning (thesis §1.4.1): targets of state-action values, and the gradient of the squared
//! error.
//!
//! Values of n choices are rows `[B × n]`. If rewards include reward seeds, the error is the error
//! of Seed TD (thesis §2.4).

use super::categorical::most_likely;
use crate::math::ln;

/// Targets yᵢ = rᵢ + γᵢ Q′(s′ᵢ, argmax_b C(s′ᵢ, b)), where γᵢ is 0 after the end of an episode.
/// With C = Q′ they are the targets r + γ max_b Q′(s′, b) of Q-learning; with the values of the
/// trained network as C, the targets of double Q-learning (van Hasselt, Guez & Silver 2016).
///
/// `rewards`, `discounts: [B]`, `next_values` (Q′), `choosing_values` (C): `[B × n]` → `targets:
/// [B]`, overwritten
///
/// # Panics
/// If the slices have different numbers of samples.
pub fn targets(
    rewards: &[f32],
    discounts: &[f32],
    next_values: &[f32],
    choosing_values: &[f32],
    targets: &mut Vec<f32>,
) {
    assert_eq!(
        (rewards.len(), next_values.len()),
        (discounts.len(), choosing_values.len())
    );
    let choices = next_values.len() / rewards.len().max(1);
    let rows = next_values
        .chunks_exact(choices.max(1))
        .zip(choosing_values.chunks_exact(choices.max(1)));
    let bootstrapped_values = rows.map(|(values, choosing)| values[most_likely(choosing)]);
    targets.clear();
    targets.extend(
        rewards
            .iter()
            .zip(discounts)
            .zip(bootstrapped_values)
            .map(|((reward, discount), value)| reward + discount * value),
    );
}

/// Computes the loss L = ½ mean wᵢ (Q(sᵢ, aᵢ) − yᵢ)² and its gradient ∂L/∂Q for constant targets;
/// returns L.
///
/// `values: [B × n]`, `actions`, `targets`, `weights: [B]` → `gradient: [B × n]`, overwritten
///
/// # Panics
/// If an action is not among the choices.
pub fn squared_error(
    values: &[f32],
    actions: &[usize],
    targets: &[f32],
    weights: &[f32],
    gradient: &mut Vec<f32>,
) -> f32 {
    let share = 1.0 / actions.len() as f32;
    let choices = values.len() / actions.len().max(1);
    gradient.clear();
    gradient.resize(values.len(), 0.0);
    let rows = values
        .chunks_exact(choices)
        .zip(gradient.chunks_exact_mut(choices));
    let mut loss = 0.0;
    for (((values, gradient), &action), (target, weight)) in
        rows.zip(actions).zip(targets.iter().zip(weights))
    {
        let error = values[action] - target;
        gradient[action] = share * weight * error;
        loss += 0.5 * share * weight * error * error;
    }
    loss
}

/// Replaces values by the log-probabilities of the ε-greedy policy: probability ε is spread evenly
/// over all choices, and the first choice with the largest value gets the remaining 1 − ε.
/// `values: [n]`
pub fn epsilon_greedy(values: &mut [f32], epsilon: f32) {
    let greedy_choice = most_likely(values);
    let share = epsilon / values.len() as f32;
    values.fill(ln(share));
    values[greedy_choice] = ln(1.0 - epsilon + share);
}

/// Replaces values by the log-probabilities of the Gibbs policy π(a|s) ∝ exp(Q(s, a)/τ) (thesis
/// §1.4.2).   `values: [n]`
pub fn gibbs(values: &mut [f32], temperature: f32) {
    super::categorical::temper(values, temperature);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Q′ = (1, 3) and (2, 0), γ = 0.5: y = 1 + 0.5·3 and, after the end of an episode, 2. With C =
    /// (5, 4), y = 1 + 0.5·1.
    #[test]
    fn targets_by_hand() {
        let mut computed = Vec::new();
        targets(
            &[1.0, 2.0],
            &[0.5, 0.0],
            &[1.0, 3.0, 2.0, 0.0],
            &[1.0, 3.0, 2.0, 0.0],
            &mut computed,
        );
        assert_eq!(computed, [2.5, 2.0]);
        targets(&[1.0], &[0.5], &[1.0, 3.0], &[5.0, 4.0], &mut computed);
        assert_eq!(computed, [1.5]);
    }

    /// Errors 2 and −1 with weights 1 and 3: L = ½·½ (4 + 3) = 1.75, derivatives ½·2 and ½·3·(−1).
    #[test]
    fn squared_errors_by_hand() {
        let mut gradient = vec![9.0];
        let loss = squared_error(
            &[7.0, 3.0, 0.5, 8.0],
            &[1, 0],
            &[1.0, 1.5],
            &[1.0, 3.0],
            &mut gradient,
        );
        assert_eq!((loss, gradient), (1.75, vec![0.0, 1.0, -1.5, 0.0]));
    }

    /// ε = 0.3 with three choices: 0.1, 0.8, 0.1. Of two equal values the first is the greedy
    /// choice; with ε = 0 all other choices have probability 0.
    #[test]
    fn epsilon_greedy_by_hand() {
        let probabilities = |mut values: [f32; 3], epsilon| {
            epsilon_greedy(&mut values, epsilon);
            values.map(f32::exp)
        };
        let exploring = probabilities([1.0, 2.0, 0.0], 0.3);
        assert!(
            exploring
                .iter()
                .zip([0.1, 0.8, 0.1])
                .all(|(probability, expected)| (probability - expected).abs() < 1e-6),
            "{exploring:?}"
        );
        assert_eq!(probabilities([2.0, 2.0, 0.0], 0.0), [1.0, 0.0, 0.0]);
    }

    /// Q = 0 and τ ln 3 give π = ¼, ¾ for every τ.
    #[test]
    fn gibbs_by_hand() {
        for temperature in [0.1, 1.0, 7.0] {
            let mut row = [0.0, temperature * 3.0_f32.ln()];
            gibbs(&mut row, temperature);
            assert!(
                (row[0].exp() - 0.25).abs() < 1e-6 && (row[1].exp() - 0.75).abs() < 1e-6,
                "{temperature}: {row:?}"
            );
        }
    }

    proptest! {
        #[test]
        fn gradient_agrees_with_central_differences(
            values in prop::collection::vec(-3.0_f32..3.0, 12),
            samples in prop::collection::vec((0..3_usize, -3.0_f32..3.0, 0.0_f32..2.0), 4),
        ) {
            let actions: Vec<usize> = samples.iter().map(|sample| sample.0).collect();
            let targets: Vec<f32> = samples.iter().map(|sample| sample.1).collect();
            let weights: Vec<f32> = samples.iter().map(|sample| sample.2).collect();
            let loss = |values: &[f32]| squared_error(values, &actions, &targets, &weights, &mut Vec::new());
            let mut gradient = Vec::new();
            squared_error(&values, &actions, &targets, &weights, &mut gradient);
            for index in 0..values.len() {
                let (mut above, mut below) = (values.clone(), values.clone());
                above[index] += 1e-2;
                below[index] -= 1e-2;
                let numeric = (loss(&above) - loss(&below)) / 2e-2;
                prop_assert!((numeric - gradient[index]).abs() < 2e-3, "{}: {} {}", index, numeric, gradient[index]);
            }
        }
    }
}
