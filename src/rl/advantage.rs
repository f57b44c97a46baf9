//! Advantages: how much better an action turned out than the state's value (thesis §1.5.1, §3.4).

/// Monte-Carlo with the ratio once: Aₜ = rₜ₊₁ + γ G̃ₜ₊₁ − v(sₜ), `G̃_T` = 0.   `rewards`, `returns`, `values`: `[T]` → `[T]`
///
/// The loss multiplies by ρₜ, so that its expectation is ρₜ Q, where the [printed form](monte_carlo_double) has ρₜ² Q.
///
/// # Panics
/// If the slices differ in length.
pub fn monte_carlo_single(rewards: &[f32], returns: &[f32], values: &[f32], discount: f32, advantages: &mut [f32]) {
    assert_eq!([returns.len(), values.len(), advantages.len()], [rewards.len(); 3]);
    let next = returns[1.min(returns.len())..].iter().copied().chain([0.0]);
    for (((advantage, reward), value), next) in advantages.iter_mut().zip(rewards).zip(values).zip(next) {
        *advantage = discount.mul_add(next, *reward) - value;
    }
}

/// Monte-Carlo as printed (thesis Eq. 22, 23): Aₜ = G̃ₜ − v(sₜ).   `returns`, `values`: `[T]` → `[T]`
///
/// # Panics
/// If the slices differ in length.
pub fn monte_carlo_double(returns: &[f32], values: &[f32], advantages: &mut [f32]) {
    assert_eq!([values.len(), advantages.len()], [returns.len(); 2]);
    for ((advantage, value), r#return) in advantages.iter_mut().zip(values).zip(returns) {
        *advantage = r#return - value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// γ = ½, r = 1, 2, 4, G̃ = 6, 4, 12, v = 1, 1, 1: A = 1 + 2 − 1, 2 + 6 − 1, 4 − 1.
    #[test]
    fn single_by_hand() {
        let mut advantages = [0.0; 3];
        monte_carlo_single(&[1.0, 2.0, 4.0], &[6.0, 4.0, 12.0], &[1.0; 3], 0.5, &mut advantages);
        assert_eq!(advantages, [2.0, 7.0, 3.0]);
    }

    #[test]
    fn double_by_hand() {
        let mut advantages = [0.0; 3];
        monte_carlo_double(&[6.0, 4.0, 12.0], &[1.0, 2.0, 3.0], &mut advantages);
        assert_eq!(advantages, [5.0, 2.0, 9.0]);
    }
}
