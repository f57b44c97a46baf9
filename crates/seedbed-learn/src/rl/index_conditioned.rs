//! Values that depend linearly on an index ξ, by which they deviate from their mean (HyperAgent: Li,
//! Xu, Han & Luo 2024; epistemic neural networks: Osband et al. 2023).
//!
//! A row of *heads* has the mean values of n choices, then for each of the M coordinates of ξ the
//! deviations of the n choices: `[(1 + M) × n]`.

/// J indices for each of B rows.
#[derive(Clone, Copy, Debug)]
pub struct Indices<'a> {
    /// The coordinates: `[B × J × M]`.
    pub coordinates: &'a [f32],
    /// Number of coordinates M of an index.
    pub dimension: usize,
    /// Number of indices J of a row.
    pub per_row: usize,
}

impl<'a> Indices<'a> {
    /// The indices of each row: `[B][J × M]`.
    fn rows(self) -> impl ExactSizeIterator<Item = &'a [f32]> {
        let width = self.per_row * self.dimension;
        self.coordinates.chunks_exact(width)
    }
}

/// Appends Q(s, ·; ξ) = o₀(s, ·) + Σₘ ξₘ oₘ(s, ·) for one state s.
///
/// `heads: [(1 + M) × n]`, `index: [M]` → `values`: n more
///
/// # Panics
/// If `heads` has another shape.
pub fn append_values(heads: &[f32], index: &[f32], values: &mut Vec<f32>) {
    let choices = heads.len() / (1 + index.len());
    assert_eq!(heads.len(), choices * (1 + index.len()));
    let (means, deviations) = heads.split_at(choices);
    let start = values.len();
    values.extend_from_slice(means);
    for (coordinate, deviations) in index.iter().zip(deviations.chunks_exact(choices)) {
        for (value, deviation) in values[start..].iter_mut().zip(deviations) {
            *value += coordinate * deviation;
        }
    }
}

/// Computes Q(s, ·; ξ) for the J indices of each of B states.
///
/// `heads: [B × (1 + M) n]` → `values: [B × J × n]`, overwritten
///
/// # Panics
/// If `heads` has another shape.
pub fn values(heads: &[f32], indices: Indices<'_>, values: &mut Vec<f32>) {
    values.clear();
    let width = heads.len() / indices.rows().len().max(1);
    for (heads, row) in heads.chunks_exact(width.max(1)).zip(indices.rows()) {
        for index in row.chunks_exact(indices.dimension) {
            append_values(heads, index, values);
        }
    }
}

/// Computes the gradient of a loss with respect to heads from its gradient with respect to the
/// [values](values()): ∂L/∂o₀ = Σⱼ ∂L/∂Qⱼ and ∂L/∂oₘ = Σⱼ ξⱼₘ ∂L/∂Qⱼ.
///
/// `value_gradient: [B × J × n]` → `gradient: [B × (1 + M) n]`, overwritten
///
/// # Panics
/// If `value_gradient` has another shape.
pub fn heads_gradient(value_gradient: &[f32], indices: Indices<'_>, gradient: &mut Vec<f32>) {
    let rows = indices.rows().len();
    let choices = value_gradient.len() / (rows * indices.per_row).max(1);
    assert_eq!(value_gradient.len(), rows * indices.per_row * choices);
    gradient.clear();
    gradient.resize(rows * (1 + indices.dimension) * choices, 0.0);
    let width = (1 + indices.dimension) * choices;
    let value_rows = value_gradient.chunks_exact(indices.per_row * choices);
    for ((heads, slopes), row) in gradient
        .chunks_exact_mut(width)
        .zip(value_rows)
        .zip(indices.rows())
    {
        let samples = slopes.chunks_exact(choices);
        for (slopes, index) in samples.zip(row.chunks_exact(indices.dimension)) {
            add_heads_gradient(slopes, index, heads);
        }
    }
}

/// Adds the gradient for one index.   `slopes: [n]`, `index: [M]` → `heads: [(1 + M) × n]`
fn add_heads_gradient(slopes: &[f32], index: &[f32], heads: &mut [f32]) {
    let coordinates = std::iter::once(&1.0).chain(index);
    for (head, coordinate) in heads.chunks_exact_mut(slopes.len()).zip(coordinates) {
        for (sum, slope) in head.iter_mut().zip(slopes) {
            *sum += coordinate * slope;
        }
    }
}

/// Perturbs the rewards of B transitions for the J indices of each: r + σ zᵀξ, where z is a fixed
/// random vector of the transition.
///
/// `rewards: [B]`, `noise` (z): `[B × M]` → `perturbed: [B × J]`, overwritten
///
/// # Panics
/// If `noise` has another shape.
pub fn perturbed_rewards(
    rewards: &[f32],
    noise: &[f32],
    sigma: f32,
    indices: Indices<'_>,
    perturbed: &mut Vec<f32>,
) {
    assert_eq!(noise.len(), rewards.len() * indices.dimension);
    perturbed.clear();
    let noise = noise.chunks_exact(indices.dimension);
    for ((reward, noise), row) in rewards.iter().zip(noise).zip(indices.rows()) {
        for index in row.chunks_exact(indices.dimension) {
            let product: f32 = noise.iter().zip(index).map(|(z, xi)| z * xi).sum();
            perturbed.push(reward + sigma * product);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Two states, two choices, M = 2, two indices each.
    const HEADS: [f32; 12] = [
        1.0, 2.0, 10.0, 20.0, 100.0, 200.0, // means, first and second deviations of state 0
        0.0, 1.0, 2.0, 3.0, 4.0, 5.0, // of state 1
    ];
    const INDICES: Indices<'static> = Indices {
        coordinates: &[0.0, 0.0, 1.0, -0.5, 2.0, 0.0, 0.5, 1.0],
        dimension: 2,
        per_row: 2,
    };

    /// State 0: ξ = 0 gives the means; ξ = (1, −½) gives 1 + 10 − 50 and 2 + 20 − 100. State 1: ξ =
    /// (2, 0) gives 0 + 4 and 1 + 6; ξ = (½, 1) gives 0 + 1 + 4 and 1 + 1.5 + 5.
    #[test]
    fn values_by_hand() {
        let mut computed = vec![9.0];
        values(&HEADS, INDICES, &mut computed);
        assert_eq!(computed, [1.0, 2.0, -39.0, -78.0, 4.0, 7.0, 5.0, 7.5]);
        append_values(&HEADS[..6], &[0.0, 1.0], &mut computed);
        assert_eq!(computed[8..], [101.0, 202.0]);
    }

    /// State 0 with slopes (1, 2) for ξ = 0 and (4, 0) for ξ = (1, −½): means 5 and 2, first
    /// deviations 4 and 0, second −2 and 0. State 1 with slopes (0, 1) for (2, 0) and (2, 0) for (½,
    /// 1): means 2 and 1, first deviations 1 and 2, second 2 and 0.
    #[test]
    fn heads_gradients_by_hand() {
        let mut gradient = vec![9.0];
        let slopes = [1.0, 2.0, 4.0, 0.0, 0.0, 1.0, 2.0, 0.0];
        heads_gradient(&slopes, INDICES, &mut gradient);
        assert_eq!(
            gradient,
            [5.0, 2.0, 4.0, 0.0, -2.0, 0.0, 2.0, 1.0, 1.0, 2.0, 2.0, 0.0]
        );
    }

    /// z = (1, 2) with ξ = 0 and (1, −½): zᵀξ = 0 and 0. z = (−1, ½) with ξ = (2, 0) and (½, 1): zᵀξ
    /// = −2 and 0.
    #[test]
    fn perturbed_rewards_by_hand() {
        let mut perturbed = vec![9.0];
        let noise = [1.0, 2.0, -1.0, 0.5];
        perturbed_rewards(&[3.0, 5.0], &noise, 0.5, INDICES, &mut perturbed);
        assert_eq!(perturbed, [3.0, 3.0, 4.0, 5.0]);
    }

    proptest! {
        /// L = ½ Σ Q², so ∂L/∂Q = Q.
        #[test]
        fn gradient_agrees_with_central_differences(
            heads in prop::collection::vec(-2.0_f32..2.0, 2 * 4 * 3),
            coordinates in prop::collection::vec(-1.0_f32..1.0, 2 * 5 * 3),
        ) {
            let indices = Indices { coordinates: &coordinates, dimension: 3, per_row: 5 };
            let values_of = |heads: &[f32]| {
                let mut computed = Vec::new();
                values(heads, indices, &mut computed);
                computed
            };
            let loss = |heads: &[f32]| -> f64 {
                values_of(heads).iter().map(|value| 0.5 * f64::from(*value).powi(2)).sum()
            };
            let mut gradient = Vec::new();
            heads_gradient(&values_of(&heads), indices, &mut gradient);
            prop_assert_eq!(gradient.len(), heads.len());
            for position in 0..heads.len() {
                let (mut above, mut below) = (heads.clone(), heads.clone());
                above[position] += 1e-2;
                below[position] -= 1e-2;
                let numeric = (loss(&above) - loss(&below)) / 2e-2;
                prop_assert!((numeric - f64::from(gradient[position])).abs() < 5e-3, "{}: {} {}", position, numeric, gradient[position]);
            }
        }
    }
}
