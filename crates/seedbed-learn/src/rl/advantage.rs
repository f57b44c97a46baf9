//! Advantages: how much better an action was than the value of its state (thesis §1.5.1, §3.4).
//!
//! Values after the last step are taken as 0. If a time limit does not count as an end, the caller
//! adds γ v(`s_T`) to the last reward.

/// Monte-Carlo advantage with a single importance ratio: Aₜ = rₜ₊₁ + γ G̃ₜ₊₁ − bₜ, `G̃_T` = 0.
/// `rewards`, `returns`, `baseline`: `[T]` → `[T]`
///
/// The baseline b is v(sₜ), the trajectory's mean return, or 0 (thesis §1.5.1). The loss multiplies
/// the advantage by ρₜ, so that the expected loss has ρₜ Q; with the
/// [printed form](monte_carlo_double) of the advantage it has ρₜ² Q.
///
/// # Panics
/// If the slices differ in length.
pub fn monte_carlo_single(
    rewards: &[f32],
    returns: &[f32],
    baseline: &[f32],
    discount: f32,
    advantages: &mut [f32],
) {
    one_step_differences(rewards, returns, baseline, discount, advantages);
}

/// Monte-Carlo advantage as printed in the thesis (Eq. 22, 23): Aₜ = G̃ₜ − bₜ.
/// `returns`, `baseline`: `[T]` → `[T]`
///
/// # Panics
/// If the slices differ in length.
pub fn monte_carlo_double(returns: &[f32], baseline: &[f32], advantages: &mut [f32]) {
    assert_eq!([baseline.len(), advantages.len()], [returns.len(); 2]);
    for ((advantage, baseline), r#return) in advantages.iter_mut().zip(baseline).zip(returns) {
        *advantage = r#return - baseline;
    }
}

/// Temporal-difference errors δₜ = rₜ₊₁ + γ v(sₜ₊₁) − v(sₜ) (thesis §1.3).   `rewards`, `values`:
/// `[T]` → `[T]`
///
/// # Panics
/// If the slices differ in length.
pub fn temporal_difference_errors(
    rewards: &[f32],
    values: &[f32],
    discount: f32,
    errors: &mut [f32],
) {
    one_step_differences(rewards, values, values, discount, errors);
}

/// Sums of TD errors to the end of each segment of Λ steps (thesis Eq. 6): Aₜ = δₜ + γ δₜ₊₁ + … +
/// γ^{Λ−1−t} `δ_{Λ−1}` in the first segment, that is Aₜ = δₜ + γ Aₜ₊₁ within a segment.
/// `rewards`, `values`: `[T]` → `[T]`
///
/// # Panics
/// If the slices differ in length, or if `segment_steps` is 0.
pub fn n_step(
    rewards: &[f32],
    values: &[f32],
    discount: f32,
    segment_steps: usize,
    advantages: &mut [f32],
) {
    temporal_difference_errors(rewards, values, discount, advantages);
    for segment in advantages.chunks_mut(segment_steps) {
        add_decayed_successors(segment, |_| discount);
    }
}

/// Generalized advantage estimation (Schulman et al. 2016, Eq. 16): Aₜ = δₜ + γλ Aₜ₊₁.   `rewards`,
/// `values`: `[T]` → `[T]`
///
/// # Panics
/// If the slices differ in length.
pub fn gae(rewards: &[f32], values: &[f32], discount: f32, lambda: f32, advantages: &mut [f32]) {
    temporal_difference_errors(rewards, values, discount, advantages);
    add_decayed_successors(advantages, |_| discount * lambda);
}

/// Advantages with off-policy traces cut as in Retrace (Munos et al. 2016, c = λ min(1, ρ)), with v
/// in place of Q: Aₜ = δₜ + γ λ min(1, ρₜ₊₁) Aₜ₊₁. If all ρ are 1, it is [`gae`].   `rewards`,
/// `values`, `ratios`: `[T]` → `[T]`
///
/// # Panics
/// If the slices differ in length.
pub fn retrace(
    rewards: &[f32],
    values: &[f32],
    ratios: &[f32],
    discount: f32,
    lambda: f32,
    advantages: &mut [f32],
) {
    assert_eq!(ratios.len(), rewards.len());
    temporal_difference_errors(rewards, values, discount, advantages);
    add_decayed_successors(advantages, |next| discount * lambda * ratios[next].min(1.0));
}

/// Advantages of V-trace (Espeholt et al. 2018, §4.2): Aₜ = rₜ₊₁ + γ vsₜ₊₁ − v(sₜ), where vs are
/// the [targets](super::returns::v_trace) of V-trace.   `rewards`, `targets`, `values`: `[T]` →
/// `[T]`
///
/// # Panics
/// If the slices differ in length.
pub fn v_trace(
    rewards: &[f32],
    targets: &[f32],
    values: &[f32],
    discount: f32,
    advantages: &mut [f32],
) {
    monte_carlo_single(rewards, targets, values, discount, advantages);
}

/// The mean return of a trajectory as the baseline of every step (thesis §1.5.1).
/// `returns: [T]` → `baseline: [T]`
pub fn mean_baseline(returns: &[f32], baseline: &mut Vec<f32>) {
    baseline.clear();
    baseline.resize(returns.len(), mean(returns));
}

/// Standardizes advantages in place: A ← (A − mean A) / (deviation of A + 10⁻⁸). Constant
/// advantages become 0.   `advantages: [N]`
pub fn standardize(advantages: &mut [f32]) {
    standardize_rows(advantages, |_| true);
}

/// The same for some of the advantages only; others do not count, and stay as they are.
pub fn standardize_rows(advantages: &mut [f32], is_included: impl Fn(usize) -> bool) {
    let rows = 0..advantages.len();
    let included = || rows.clone().filter(|&row| is_included(row));
    let count = included().count().max(1) as f32;
    let center = included().map(|row| advantages[row]).sum::<f32>() / count;
    for row in included() {
        advantages[row] -= center;
    }
    let squares = included().map(|row| advantages[row] * advantages[row]);
    let variance = squares.sum::<f32>() / count;
    let scale = 1.0 / (variance.sqrt() + 1e-8);
    for row in included() {
        advantages[row] *= scale;
    }
}

/// Computes rₜ₊₁ + γ nₜ₊₁ − bₜ, where n is `successors` and `n_T` = 0.
fn one_step_differences(
    rewards: &[f32],
    successors: &[f32],
    baseline: &[f32],
    discount: f32,
    differences: &mut [f32],
) {
    assert_eq!(
        [successors.len(), baseline.len(), differences.len()],
        [rewards.len(); 3]
    );
    let successors = successors[1.min(successors.len())..]
        .iter()
        .copied()
        .chain([0.0]);
    for (((difference, reward), baseline), successor) in differences
        .iter_mut()
        .zip(rewards)
        .zip(baseline)
        .zip(successors)
    {
        *difference = reward + discount * successor - baseline;
    }
}

/// xₜ ← xₜ + dₜ₊₁ xₜ₊₁ from the second last step to the first, where x are the `errors` and d is
/// `decay`.
fn add_decayed_successors(errors: &mut [f32], decay: impl Fn(usize) -> f32) {
    for step in (0..errors.len().saturating_sub(1)).rev() {
        errors[step] += decay(step + 1) * errors[step + 1];
    }
}

fn mean(values: &[f32]) -> f32 {
    values.iter().sum::<f32>() / values.len().max(1) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// γ = ½, r = 1, 2, 4, G̃ = 6, 4, 12, v = 1, 1, 1: A = 1 + 2 − 1, 2 + 6 − 1, 4 − 1.
    #[test]
    fn monte_carlo_single_by_hand() {
        let mut advantages = [0.0; 3];
        monte_carlo_single(
            &[1.0, 2.0, 4.0],
            &[6.0, 4.0, 12.0],
            &[1.0; 3],
            0.5,
            &mut advantages,
        );
        assert_eq!(advantages, [2.0, 7.0, 3.0]);
    }

    #[test]
    fn monte_carlo_double_by_hand() {
        let mut advantages = [0.0; 3];
        monte_carlo_double(&[6.0, 4.0, 12.0], &[1.0, 2.0, 3.0], &mut advantages);
        assert_eq!(advantages, [5.0, 2.0, 9.0]);
    }

    /// γ = ½, r = 1, 2, 4, v = 2, 4, 6: δ = 1 + 2 − 2, 2 + 3 − 4, 4 − 6 = 1, 1, −2.
    const REWARDS: [f32; 3] = [1.0, 2.0, 4.0];
    const VALUES: [f32; 3] = [2.0, 4.0, 6.0];

    fn computed_by(estimate: impl Fn(&mut [f32])) -> [f32; 3] {
        let mut advantages = [f32::NAN; 3];
        estimate(&mut advantages);
        advantages
    }

    #[test]
    fn temporal_difference_errors_by_hand() {
        assert_eq!(
            computed_by(|a| temporal_difference_errors(&REWARDS, &VALUES, 0.5, a)),
            [1.0, 1.0, -2.0]
        );
    }

    /// Λ = 2: A₀ = 1 + ½·1, A₁ = 1, and a new segment: A₂ = −2. Λ = 3: A₁ = 1 − 1 = 0, A₀ = 1 + 0.
    #[test]
    fn n_step_by_hand() {
        assert_eq!(
            computed_by(|a| n_step(&REWARDS, &VALUES, 0.5, 2, a)),
            [1.5, 1.0, -2.0]
        );
        assert_eq!(
            computed_by(|a| n_step(&REWARDS, &VALUES, 0.5, 3, a)),
            [1.0, 0.0, -2.0]
        );
        assert_eq!(
            computed_by(|a| n_step(&REWARDS, &VALUES, 0.5, 100, a)),
            [1.0, 0.0, -2.0]
        );
    }

    /// λ = ½, γλ = ¼: A₂ = −2, A₁ = 1 − ½ = ½, A₀ = 1 + ⅛. λ = 0 gives δ, λ = 1 the return minus v:
    /// 3 − 2, 4 − 4, 4 − 6.
    #[test]
    fn gae_by_hand() {
        assert_eq!(
            computed_by(|a| gae(&REWARDS, &VALUES, 0.5, 0.5, a)),
            [1.125, 0.5, -2.0]
        );
        assert_eq!(
            computed_by(|a| gae(&REWARDS, &VALUES, 0.5, 0.0, a)),
            [1.0, 1.0, -2.0]
        );
        assert_eq!(
            computed_by(|a| gae(&REWARDS, &VALUES, 0.5, 1.0, a)),
            [1.0, 0.0, -2.0]
        );
    }

    /// λ = ½, ρ = 9, ½, 3: A₂ = −2, A₁ = 1 − ¼·1·2 = ½, A₀ = 1 + ¼·½·½ = 1.0625; ρ₀ is not used.
    #[test]
    fn retrace_by_hand() {
        assert_eq!(
            computed_by(|a| retrace(&REWARDS, &VALUES, &[9.0, 0.5, 3.0], 0.5, 0.5, a)),
            [1.0625, 0.5, -2.0]
        );
        assert_eq!(
            computed_by(|a| retrace(&REWARDS, &VALUES, &[1.0; 3], 0.5, 0.5, a)),
            computed_by(|a| gae(&REWARDS, &VALUES, 0.5, 0.5, a))
        );
    }

    /// G = 3, 6: mean 4.5. A = 1, 3, 8 has mean 4 and variance (9 + 1 + 16)/3 = 26/3.
    #[test]
    fn mean_baseline_and_standardization_by_hand() {
        let mut baseline = vec![];
        mean_baseline(&[3.0, 6.0], &mut baseline);
        assert_eq!(baseline, [4.5, 4.5]);
        let standardized = computed_by(|a| {
            a.copy_from_slice(&[1.0, 3.0, 8.0]);
            standardize(a);
        });
        let deviation = (26.0_f32 / 3.0).sqrt();
        assert!(
            standardized
                .iter()
                .zip([-3.0, -1.0, 4.0])
                .all(|(a, b)| (a - b / deviation).abs() < 1e-6)
        );
        assert_eq!(
            computed_by(|a| {
                a.fill(7.0);
                standardize(a);
            }),
            [0.0; 3]
        );
        standardize(&mut []);
        let mut some = [1.0, 50.0, 3.0];
        standardize_rows(&mut some, |row| row != 1);
        assert_eq!(some, [-1.0, 50.0, 1.0]);
    }
}
