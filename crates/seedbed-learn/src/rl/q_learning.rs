//! Q-learning (thesis §1.4.1): what state-action values are regressed on, and the gradient of the
//! squared error.
//!
//! Values of n choices are rows `[B × n]`. With a seed in the reward the same error is Seed TD's
//! (thesis §2.4).

use super::categorical::likeliest;

/// yᵢ = rᵢ + γᵢ Q′(s′ᵢ, argmax_b C(s′ᵢ, b)), where γᵢ is 0 after an end. With C = Q′ this is
/// Q-learning's r + γ max_b Q′(s′, b); with the learning network's own values for C it is double
/// Q-learning's (van Hasselt, Guez & Silver 2016).
///
/// `rewards`, `discounts: [B]`, `judged` (Q′), `chosen_by` (C): `[B × n]` → `targets: [B]`,
/// overwritten
///
/// # Panics
/// If the slices do not belong to the same number of samples.
pub fn targets(
    rewards: &[f32],
    discounts: &[f32],
    judged: &[f32],
    chosen_by: &[f32],
    targets: &mut Vec<f32>,
) {
    assert_eq!(
        (rewards.len(), judged.len()),
        (discounts.len(), chosen_by.len())
    );
    let choices = judged.len() / rewards.len().max(1);
    let rows = judged
        .chunks_exact(choices.max(1))
        .zip(chosen_by.chunks_exact(choices.max(1)));
    let follow = rows.map(|(judged, chosen_by)| judged[likeliest(chosen_by)]);
    targets.clear();
    targets.extend(
        rewards
            .iter()
            .zip(discounts)
            .zip(follow)
            .map(|((reward, discount), value)| discount.mul_add(value, *reward)),
    );
}

/// ∂L/∂Q of L = ½ mean wᵢ (Q(sᵢ, aᵢ) − yᵢ)², the targets held constant; returns L.
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

/// Log-probabilities of the ε-greedy policy: ε spread evenly, the rest on the first of the largest
/// values.   `values: [n]`, in place
pub fn epsilon_greedy(values: &mut [f32], epsilon: f32) {
    let (best, share) = (likeliest(values), epsilon / values.len() as f32);
    values.fill(share.ln());
    values[best] = (1.0 - epsilon + share).ln();
}

/// Log-probabilities of the Gibbs policy π(a|s) ∝ exp(Q(s, a)/τ) (thesis §1.4.2).   `values: [n]`,
/// in place
pub fn gibbs(values: &mut [f32], temperature: f32) {
    super::categorical::temper(values, temperature);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Q′ = (1, 3) and (2, 0), γ = 0.5: y = 1 + 0.5·3 and, after an end, 2. Chosen by (5, 4): y = 1
    /// + 0.5·1.
    #[test]
    fn targets_by_hand() {
        let mut found = Vec::new();
        targets(
            &[1.0, 2.0],
            &[0.5, 0.0],
            &[1.0, 3.0, 2.0, 0.0],
            &[1.0, 3.0, 2.0, 0.0],
            &mut found,
        );
        assert_eq!(found, [2.5, 2.0]);
        targets(&[1.0], &[0.5], &[1.0, 3.0], &[5.0, 4.0], &mut found);
        assert_eq!(found, [1.5]);
    }

    /// Errors 2 and −1 with weights 1 and 3: L = ½·½ (4 + 3) = 1.75, slopes ½·2 and ½·3·(−1).
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

    /// ε = 0.3 over three choices: 0.1, 0.8, 0.1. The first of equals is the greedy one; ε = 0
    /// leaves the others nothing.
    #[test]
    fn epsilon_greedy_by_hand() {
        let probabilities = |mut values: [f32; 3], epsilon| {
            epsilon_greedy(&mut values, epsilon);
            values.map(f32::exp)
        };
        let spread = probabilities([1.0, 2.0, 0.0], 0.3);
        assert!(
            spread
                .iter()
                .zip([0.1, 0.8, 0.1])
                .all(|(ours, expected)| (ours - expected).abs() < 1e-6),
            "{spread:?}"
        );
        assert_eq!(probabilities([2.0, 2.0, 0.0], 0.0), [1.0, 0.0, 0.0]);
    }

    /// Q = 0 and τ ln 3: π = ¼, ¾, whatever τ.
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
