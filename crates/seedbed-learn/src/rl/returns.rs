//! Returns (thesis §1.3, §3.1) and targets of value functions.

#![expect(
    clippy::inline_always,
    reason = "a loop is compiled for a SIMD instruction set only if it is inlined into the dispatch"
)]

use pulp::{Arch, Simd, WithSimd};

use super::advantage;

/// Maximal absolute value of importance-weighted sums, so that their squares are finite in f32.
const LIMIT: f32 = 1e15;

/// Return-to-go (thesis §1.3): Gₜ = rₜ₊₁ + γ Gₜ₊₁, `G_T` = 0.   `rewards: [T]` → `returns: [T]`
///
/// # Panics
/// If the slices differ in length.
pub fn discounted(rewards: &[f32], discount: f32, returns: &mut [f32]) {
    assert_eq!(rewards.len(), returns.len());
    let mut next = 0.0;
    for (reward, value) in rewards.iter().zip(returns).rev() {
        next = discount * next + reward;
        *value = next;
    }
}

/// Per-decision importance-sampled return (thesis Eq. 12, 18):
/// G̃ₜ = Σ_{k≥t} γᵏ⁻ᵗ min(c, Π_{j=t..k} ρⱼ) rₖ₊₁.   `ratios`, `rewards`: `[T]` → `returns: [T]`
///
/// `cap` is c, the maximum of each product of ratios (not of each ratio). `None` gives the form
/// printed in the thesis, for which G̃ₜ = ρₜ (rₜ₊₁ + γ G̃ₜ₊₁). With a cap there is no such
/// recursion, and the cost is O(T²). `scratch` is a buffer that grows to the longest trajectory.
///
/// # Panics
/// If the slices differ in length.
pub fn per_decision(
    ratios: &[f32],
    rewards: &[f32],
    discount: f32,
    cap: Option<f32>,
    scratch: &mut Vec<f32>,
    returns: &mut [f32],
) {
    assert_eq!(ratios.len(), rewards.len());
    assert_eq!(ratios.len(), returns.len());
    match cap {
        None => per_decision_uncapped(ratios, rewards, discount, returns),
        Some(cap) => per_decision_capped(ratios, rewards, discount, cap, scratch, returns),
    }
}

/// Ordinary importance sampling (thesis Eq. 11): ρ_{t:T−1} Gₜ.   `ratios`, `rewards`: `[T]` →
/// `returns: [T]`
///
/// `cap` is the maximum of the product of ratios.
///
/// # Panics
/// If the slices differ in length.
pub fn ordinary(
    ratios: &[f32],
    rewards: &[f32],
    discount: f32,
    cap: Option<f32>,
    returns: &mut [f32],
) {
    discounted(rewards, discount, returns);
    let mut product = 1.0_f32;
    for (ratio, value) in ratios.iter().zip(returns).rev() {
        product = (product * ratio).min(LIMIT);
        *value = (*value * product.min(cap.unwrap_or(LIMIT))).clamp(-LIMIT, LIMIT);
    }
}

/// Targets of TD(0) (thesis Eq. 2, 14, 19): rₜ₊₁ + γ v(sₜ₊₁), `v(s_T)` = 0.   `rewards`, `values`:
/// `[T]` → `targets: [T]`
///
/// # Panics
/// If the slices differ in length.
pub fn temporal_difference(rewards: &[f32], values: &[f32], discount: f32, targets: &mut [f32]) {
    advantage::temporal_difference_errors(rewards, values, discount, targets);
    targets
        .iter_mut()
        .zip(values)
        .for_each(|(target, value)| *target += value);
}

/// λ-returns (Schulman et al. 2016): v(sₜ) + Aₜ with the [advantages](advantage::gae) of the same
/// λ. `rewards`, `values`: `[T]` → `targets: [T]`
///
/// # Panics
/// If the slices differ in length.
pub fn lambda(rewards: &[f32], values: &[f32], discount: f32, lambda: f32, targets: &mut [f32]) {
    advantage::gae(rewards, values, discount, lambda, targets);
    targets
        .iter_mut()
        .zip(values)
        .for_each(|(target, value)| *target += value);
}

/// Truncation of importance ratios in V-trace (Espeholt et al. 2018, Eq. 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truncation {
    /// Maximum ρ̄ of the ratio that weights a TD error; it affects the fixed point of learning.
    pub ratio: f32,
    /// Maximum c̄ of the ratios of a trace; it affects the speed of learning.
    pub trace: f32,
    /// Trace parameter λ.
    pub lambda: f32,
}

/// Targets of V-trace (Espeholt et al. 2018, Remark 1): vsₜ = v(sₜ) + Δₜ with Δₜ = min(ρ̄, ρₜ) δₜ +
/// γ λ min(c̄, ρₜ) Δₜ₊₁. If all ρ are 1 and no maximum is below 1, they are the
/// [λ-returns](lambda). `rewards`, `values`, `ratios`: `[T]` → `targets: [T]`
///
/// # Panics
/// If the slices differ in length.
pub fn v_trace(
    rewards: &[f32],
    values: &[f32],
    ratios: &[f32],
    discount: f32,
    truncation: Truncation,
    targets: &mut [f32],
) {
    assert_eq!(ratios.len(), rewards.len());
    advantage::temporal_difference_errors(rewards, values, discount, targets);
    let mut correction = 0.0_f32;
    for ((target, value), ratio) in targets.iter_mut().zip(values).zip(ratios).rev() {
        let trace = discount * truncation.lambda * ratio.min(truncation.trace);
        correction = ratio.min(truncation.ratio) * *target + trace * correction;
        *target = value + correction;
    }
}

fn per_decision_uncapped(ratios: &[f32], rewards: &[f32], discount: f32, returns: &mut [f32]) {
    let mut next = 0.0_f32;
    for ((ratio, reward), value) in ratios.iter().zip(rewards).zip(returns).rev() {
        next = (ratio * (discount * next + reward)).clamp(-LIMIT, LIMIT);
        *value = next;
    }
}

fn per_decision_capped(
    ratios: &[f32],
    rewards: &[f32],
    discount: f32,
    cap: f32,
    padded: &mut Vec<f32>,
    returns: &mut [f32],
) {
    let length = ratios.len() + BLOCK_STEPS;
    padded.clear();
    for column in [ratios, rewards] {
        padded.extend_from_slice(column);
        padded.extend([0.0; BLOCK_STEPS]);
    }
    let (ratios, rewards) = padded.split_at(length);
    Arch::new().dispatch(CappedReturns {
        ratios,
        rewards,
        discount,
        cap,
        returns,
    });
}

/// Number of steps t whose sums are computed together.
const BLOCK_STEPS: usize = 32;

/// Returns with capped products of ratios.   `ratios`, `rewards`: `[T + BLOCK_STEPS]`, padded with
/// 0 so that all blocks of steps have the same length
struct CappedReturns<'a> {
    ratios: &'a [f32],
    rewards: &'a [f32],
    discount: f32,
    cap: f32,
    returns: &'a mut [f32],
}

impl WithSimd for CappedReturns<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let steps = self.returns.len();
        for (block, returns) in self.returns.chunks_mut(BLOCK_STEPS).enumerate() {
            let start = block * BLOCK_STEPS;
            let (ratios, rewards) = (&self.ratios[start..], &self.rewards[start..]);
            let (mut products, mut sums, mut weight) =
                ([1.0_f32; BLOCK_STEPS], [0.0_f32; BLOCK_STEPS], 1.0_f32);
            // One iteration per lag d, after which a product is Π_{j=t..t+d} ρⱼ.
            for (ratios, rewards) in ratios
                .windows(BLOCK_STEPS)
                .zip(rewards.windows(BLOCK_STEPS))
                .take(steps - start)
            {
                for (((product, sum), ratio), reward) in
                    products.iter_mut().zip(&mut sums).zip(ratios).zip(rewards)
                {
                    *product = lesser(*product * ratio, LIMIT);
                    *sum = (weight * lesser(*product, self.cap)).mul_add(*reward, *sum);
                }
                weight *= self.discount;
            }
            returns.copy_from_slice(&sums[..returns.len()]);
        }
    }
}

/// The smaller number, compiled to one instruction. Returns `b` if `a` is NaN.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn per_decision_of(
        ratios: &[f32],
        rewards: &[f32],
        discount: f32,
        cap: Option<f32>,
    ) -> Vec<f32> {
        let mut returns = vec![f32::NAN; ratios.len()];
        per_decision(
            ratios,
            rewards,
            discount,
            cap,
            &mut Vec::new(),
            &mut returns,
        );
        returns
    }

    /// γ = 0.5, r = 1, 2, 4: G₂ = 4, G₁ = 2 + 2 = 4, G₀ = 1 + 2 = 3.
    #[test]
    fn discounted_by_hand() {
        let mut returns = [0.0; 3];
        discounted(&[1.0, 2.0, 4.0], 0.5, &mut returns);
        assert_eq!(returns, [3.0, 4.0, 4.0]);
    }

    /// γ = 0.5, r = 1, 2, 4, ρ = 2, 0.5, 3, no cap: G̃₂ = 3·4 = 12, G̃₁ = ½(2 + 6) = 4, G̃₀ = 2(1 +
    /// 2) = 6.
    #[test]
    fn per_decision_by_hand() {
        assert_eq!(
            per_decision_of(&[2.0, 0.5, 3.0], &[1.0, 2.0, 4.0], 0.5, None),
            [6.0, 4.0, 12.0]
        );
    }

    /// γ = 0.5, r = 1, 2, 4, ρ = 2, 0.5, 3, with products of ratios capped at c = 1.
    /// From step 0 on, the products are 2, 1, 3, capped 1, 1, 1, so G̃₀ = 1 + ½·2 + ¼·4 = 3.
    /// From step 1 on, they are ½, 3/2, capped ½, 1, so G̃₁ = ½·2 + ½·4 = 3.
    /// From step 2 on, the product is 3, capped 1, so G̃₂ = 4.
    /// If ratios were capped instead of products, G̃₀ would be 1 + ½·½·2 + ¼·½·4 = 2.
    #[test]
    fn products_of_ratios_are_capped() {
        assert_eq!(
            per_decision_of(&[2.0, 0.5, 3.0], &[1.0, 2.0, 4.0], 0.5, Some(1.0)),
            [3.0, 3.0, 4.0]
        );
    }

    /// γ = 0.5, ρ = 2, 0.5, 3: ρ_{0:2} = 3, ρ_{1:2} = 1.5, ρ_2 = 3, times G = 3, 4, 4.
    #[test]
    fn ordinary_by_hand() {
        let mut returns = [0.0; 3];
        ordinary(&[2.0, 0.5, 3.0], &[1.0, 2.0, 4.0], 0.5, None, &mut returns);
        assert_eq!(returns, [9.0, 6.0, 12.0]);
        ordinary(
            &[2.0, 0.5, 3.0],
            &[1.0, 2.0, 4.0],
            0.5,
            Some(1.0),
            &mut returns,
        );
        assert_eq!(returns, [3.0, 4.0, 4.0]);
    }

    proptest! {
        #[test]
        fn on_policy_returns_are_discounted_returns(rewards in prop::collection::vec(-2.0_f32..2.0, 1..60)) {
            let ones = vec![1.0; rewards.len()];
            let mut plain = ones.clone();
            discounted(&rewards, 0.97, &mut plain);
            for cap in [None, Some(1.0)] {
                let weighted = per_decision_of(&ones, &rewards, 0.97, cap);
                prop_assert!(plain.iter().zip(&weighted).all(|(a, b)| (a - b).abs() < 1e-3));
            }
        }

        /// Returns agree with the sum of the definition in double precision.
        #[test]
        fn capped_returns_agree_with_the_definition(
            steps in prop::collection::vec((0.2_f32..3.0, -1.0_f32..1.0), 1..100), cap in 0.5_f32..3.0,
        ) {
            let (ratios, rewards): (Vec<f32>, Vec<f32>) = steps.into_iter().unzip();
            let expected = |start: usize| -> f64 {
                let mut product = 1.0;
                let terms = ratios.iter().zip(&rewards).skip(start).enumerate().map(|(lag, (ratio, reward))| {
                    product *= f64::from(*ratio);
                    0.95_f64.powi(lag as i32) * product.min(f64::from(cap)) * f64::from(*reward)
                });
                terms.sum()
            };
            for (start, value) in per_decision_of(&ratios, &rewards, 0.95, Some(cap)).into_iter().enumerate() {
                prop_assert!((f64::from(value) - expected(start)).abs() < 1e-3, "{start}: {value} {}", expected(start));
            }
        }

        #[test]
        fn a_large_cap_changes_nothing(
            steps in prop::collection::vec((0.2_f32..1.8, -1.0_f32..1.0), 1..20),
        ) {
            let (ratios, rewards): (Vec<f32>, Vec<f32>) = steps.into_iter().unzip();
            let uncapped = per_decision_of(&ratios, &rewards, 0.9, None);
            let capped = per_decision_of(&ratios, &rewards, 0.9, Some(1e9));
            prop_assert!(uncapped.iter().zip(&capped).all(|(a, b)| (a - b).abs() < 1e-3 * (1.0 + a.abs())));
        }
    }

    /// Targets for γ = ½, r = 1, 2, 4 and v = 2, 4, 6, for which δ = 1, 1, −2.
    fn target_of(estimate: impl Fn(&[f32], &[f32], &mut [f32])) -> [f32; 3] {
        let mut targets = [f32::NAN; 3];
        estimate(&[1.0, 2.0, 4.0], &[2.0, 4.0, 6.0], &mut targets);
        targets
    }

    /// TD: 1 + 2, 2 + 3, 4. λ = ½: A = 1.125, 0.5, −2 plus v.
    #[test]
    fn bootstrapped_targets_by_hand() {
        assert_eq!(
            target_of(|r, v, y| temporal_difference(r, v, 0.5, y)),
            [3.0, 5.0, 4.0]
        );
        assert_eq!(
            target_of(|r, v, y| lambda(r, v, 0.5, 0.5, y)),
            [3.125, 4.5, 4.0]
        );
    }

    /// ρ = 4, ½, 3, ρ̄ = 2, c̄ = 1, λ = 1: Δ₂ = 2·(−2) = −4; Δ₁ = ½·1 + ½·½·(−4) = −½; Δ₀ = 2·1 +
    /// ½·1·(−½) = 1.75.
    #[test]
    fn v_trace_by_hand() {
        let truncation = Truncation {
            ratio: 2.0,
            trace: 1.0,
            lambda: 1.0,
        };
        assert_eq!(
            target_of(|r, v, y| v_trace(r, v, &[4.0, 0.5, 3.0], 0.5, truncation, y)),
            [3.75, 3.5, 2.0]
        );
        let on_policy = Truncation {
            lambda: 0.5,
            ..truncation
        };
        assert_eq!(
            target_of(|r, v, y| v_trace(r, v, &[1.0; 3], 0.5, on_policy, y)),
            target_of(|r, v, y| lambda(r, v, 0.5, 0.5, y))
        );
    }
}
