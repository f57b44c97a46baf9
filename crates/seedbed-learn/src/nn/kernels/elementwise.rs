//! Elementwise operations: activation functions, their derivatives, and steps of parameters.

use pulp::{Arch, Simd, WithSimd};

/// y ← tanh y, with an error of at most 4·10⁻⁷.
pub(in crate::nn) fn tanh_in_place(y: &mut [f32]) {
    Arch::new().dispatch(TanhInPlace(y));
}

/// ∂L/∂x ← ∂L/∂y · (1 − y²) for y = tanh x.
pub(in crate::nn) fn tanh_gradient_in_place(y: &[f32], dy: &mut [f32]) {
    assert_eq!(y.len(), dy.len());
    Arch::new().dispatch(TanhGradientInPlace { y, dy });
}

/// y ← max(0, y).
pub(in crate::nn) fn relu_in_place(y: &mut [f32]) {
    Arch::new().dispatch(ReluInPlace(y));
}

/// ∂L/∂x ← ∂L/∂y where y > 0, and 0 elsewhere, for y = max(0, x).
pub(in crate::nn) fn relu_gradient_in_place(y: &[f32], dy: &mut [f32]) {
    assert_eq!(y.len(), dy.len());
    Arch::new().dispatch(ReluGradientInPlace { y, dy });
}

/// x ← x + share · (target − x).
pub(crate) fn move_towards(target: &[f32], share: f32, x: &mut [f32]) {
    assert_eq!(target.len(), x.len());
    Arch::new().dispatch(MoveTowards { target, share, x });
}

/// One step of Adam on `parameters`; all slices have the same length.
pub(in crate::nn) struct AdamStep<'a> {
    pub(in crate::nn) parameters: &'a mut [f32],
    pub(in crate::nn) gradient: &'a [f32],
    pub(in crate::nn) first_moment: &'a mut [f32],
    pub(in crate::nn) second_moment: &'a mut [f32],
    pub(in crate::nn) beta1: f32,
    pub(in crate::nn) beta2: f32,
    /// Step size with bias correction: α √(1 − β₂ᵗ) / (1 − β₁ᵗ).
    pub(in crate::nn) rate: f32,
    /// ε with bias correction: ε √(1 − β₂ᵗ).
    pub(in crate::nn) epsilon: f32,
}

impl AdamStep<'_> {
    pub(in crate::nn) fn run(self) {
        let count = self.parameters.len();
        assert_eq!(
            [
                self.gradient.len(),
                self.first_moment.len(),
                self.second_moment.len()
            ],
            [count; 3]
        );
        Arch::new().dispatch(self);
    }
}

struct TanhInPlace<'a>(&'a mut [f32]);

impl WithSimd for TanhInPlace<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.0.iter_mut().for_each(|y| *y = tanh(*y));
    }
}

struct TanhGradientInPlace<'a> {
    y: &'a [f32],
    dy: &'a mut [f32],
}

impl WithSimd for TanhGradientInPlace<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.dy
            .iter_mut()
            .zip(self.y)
            .for_each(|(dy, y)| *dy *= (-y).mul_add(*y, 1.0));
    }
}

struct ReluInPlace<'a>(&'a mut [f32]);

impl WithSimd for ReluInPlace<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        // Numbers that are not finite must stay visible.
        self.0
            .iter_mut()
            .for_each(|y| *y = if *y < 0.0 { 0.0 } else { *y });
    }
}

struct ReluGradientInPlace<'a> {
    y: &'a [f32],
    dy: &'a mut [f32],
}

impl WithSimd for ReluGradientInPlace<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (dy, y) in self.dy.iter_mut().zip(self.y) {
            *dy = if *y > 0.0 { *dy } else { 0.0 };
        }
    }
}

struct MoveTowards<'a> {
    target: &'a [f32],
    share: f32,
    x: &'a mut [f32],
}

impl WithSimd for MoveTowards<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (x, target) in self.x.iter_mut().zip(self.target) {
            *x = self.share.mul_add(target - *x, *x);
        }
    }
}

impl WithSimd for AdamStep<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let moments = self
            .first_moment
            .iter_mut()
            .zip(self.second_moment.iter_mut());
        for ((parameter, gradient), (m, v)) in
            self.parameters.iter_mut().zip(self.gradient).zip(moments)
        {
            *m = self.beta1.mul_add(*m - gradient, *gradient);
            *v = self
                .beta2
                .mul_add(*v - gradient * gradient, gradient * gradient);
            *parameter -= self.rate * *m / (v.sqrt() + self.epsilon);
        }
    }
}

/// Approximates tanh by a ratio of polynomials, x p(x²) / q(x²), within the range where tanh
/// differs from ±1 in f32. The coefficients are the minimax fit of degree (13, 6) that numeric
/// libraries commonly use.
#[inline(always)]
fn tanh(x: f32) -> f32 {
    const LIMIT: f32 = 7.905_311;
    const P: [f32; 7] = [
        4.893_525_5e-3,
        6.372_619_3e-4,
        1.485_722_4e-5,
        5.122_297e-8,
        -8.604_672e-11,
        2.000_188e-13,
        -2.760_768_5e-16,
    ];
    const Q: [f32; 4] = [4.893_525e-3, 2.268_434_6e-3, 1.185_347e-4, 1.198_258_4e-6];
    let x = x.clamp(-LIMIT, LIMIT);
    let square = x * x;
    let horner = |coefficients: &[f32]| {
        coefficients
            .iter()
            .rev()
            .fold(0.0_f32, |sum, c| sum.mul_add(square, *c))
    };
    x * horner(&P) / horner(&Q)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn tanh_is_within_a_few_units_in_the_last_place(x in -20.0_f32..20.0, count in 1..40_usize) {
            let mut y = vec![x; count];
            tanh_in_place(&mut y);
            prop_assert!((f64::from(y[0]) - f64::from(x).tanh()).abs() < 4e-7);
            prop_assert!(y[0].abs() <= 1.0);
            prop_assert!(y.iter().all(|other| *other == y[0]), "bits depend on the position in the batch: {y:?}");
        }
    }
}
