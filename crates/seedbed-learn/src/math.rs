//! Elementary functions whose bits are the same on every processor.
//!
//! The functions of the standard library call those of the operating system, which choose an
//! implementation by the processor. The functions here are sums and products in a fixed order, so
//! that the compiler can compute several at once in SIMD lanes. Coefficients are those of the Cephes
//! library (Moshier 1989).

#![expect(
    clippy::inline_always,
    reason = "a loop is compiled for a SIMD instruction set only if it is inlined into the dispatch"
)]

use pulp::{Arch, Simd, WithSimd};

/// ln 2 as a sum of two numbers, the first of which has few digits, so that its products with small
/// integers are exact.
const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];

/// 1.5 · 2²³: adding it to a small number rounds the number to an integer, which is then in the last
/// bits of the sum.
const ROUNDING: f32 = 12_582_912.0;

/// Numbers below give a result of 0, because f32 has no normal number for it.
const MIN_EXPONENT: f32 = -87.336_54;

/// Numbers above give an infinite result. (The largest f32 is e^88.72.)
const MAX_EXPONENT: f32 = 88.0;

/// eˣ, with a relative error of at most 2·10⁻⁷; 0 below −87.3, and ∞ above 88.
#[inline(always)]
#[must_use]
pub fn exp(x: f32) -> f32 {
    const COEFFICIENTS: [f32; 6] = [
        1.987_569_1e-4,
        1.398_199_9e-3,
        8.333_452e-3,
        4.166_579_6e-2,
        1.666_666_5e-1,
        0.5,
    ];
    let clamped = x.clamp(MIN_EXPONENT, MAX_EXPONENT);
    let rounded = clamped * std::f32::consts::LOG2_E + ROUNDING;
    let integer = rounded - ROUNDING;
    // eˣ = 2ⁿ eʳ with an integer n and |r| ≤ ½ ln 2.
    let r = clamped - integer * LN_2[0] - integer * LN_2[1];
    let mut sum = 0.0;
    for coefficient in COEFFICIENTS {
        sum = sum * r + coefficient;
    }
    let power = f32::from_bits((rounded.to_bits() << 23).wrapping_add(1.0_f32.to_bits()));
    let value = (sum * r * r + r + 1.0) * power;
    let value = if x < MIN_EXPONENT { 0.0 } else { value };
    if x > MAX_EXPONENT {
        f32::INFINITY
    } else {
        value
    }
}

/// ln x, with an error of at most 2·10⁻⁷ or a relative error of the same size; −∞ for 0 and positive
/// numbers that are not normal, NaN for negative numbers.
#[inline(always)]
#[must_use]
pub fn ln(x: f32) -> f32 {
    const COEFFICIENTS: [f32; 9] = [
        7.037_683_6e-2,
        -1.151_461e-1,
        1.167_699_9e-1,
        -1.242_014_1e-1,
        1.424_932_3e-1,
        -1.666_805_8e-1,
        2.000_071_5e-1,
        -2.499_999_4e-1,
        3.333_333e-1,
    ];
    const FRACTION_BITS: u32 = 0x007f_ffff;
    // x = 2ⁿ (1 + m) with 1 + m between √½ and √2.
    let exponent = (x.to_bits() >> 23) as i32 - 126;
    let fraction = f32::from_bits((x.to_bits() & FRACTION_BITS) | 0.5_f32.to_bits());
    let is_small = fraction < std::f32::consts::FRAC_1_SQRT_2;
    let n = exponent as f32 - if is_small { 1.0 } else { 0.0 };
    let m = fraction + if is_small { fraction } else { 0.0 } - 1.0;
    let mut sum = 0.0;
    for coefficient in COEFFICIENTS {
        sum = sum * m + coefficient;
    }
    let square = m * m;
    let small_terms = sum * m * square + n * LN_2[1] - 0.5 * square;
    let value = m + small_terms + n * LN_2[0];
    let value = if x < f32::MIN_POSITIVE {
        f32::NEG_INFINITY
    } else {
        value
    };
    let value = if x < 0.0 { f32::NAN } else { value };
    if x < f32::INFINITY { value } else { x }
}

/// ln(1 + x) for x ≥ 0, with a relative error of at most 3·10⁻⁷.
#[inline(always)]
#[must_use]
pub fn ln_1p(x: f32) -> f32 {
    let sum = 1.0 + x;
    // The correction is the derivative of ln times what rounding took from x.
    ln(sum) + (x - (sum - 1.0)) / sum
}

/// x ← eˣ for each number; see [`exp`].
pub fn exp_in_place(numbers: &mut [f32]) {
    Arch::new().dispatch(ExpInPlace(numbers));
}

struct ExpInPlace<'a>(&'a mut [f32]);

impl WithSimd for ExpInPlace<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for x in self.0 {
            *x = exp(*x);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn exp_is_accurate(x in -87.0_f32..88.0) {
            let exact = f64::from(x).exp();
            prop_assert!((f64::from(exp(x)) / exact - 1.0).abs() < 2e-7, "{x}: {} {exact}", exp(x));
        }

        #[test]
        fn ln_is_accurate(logarithm in -87.0_f64..88.0) {
            let x = logarithm.exp() as f32;
            let exact = f64::from(x).ln();
            prop_assert!((f64::from(ln(x)) - exact).abs() < 2e-7 * exact.abs().max(1.0), "{x}: {} {exact}", ln(x));
        }

        #[test]
        fn ln_1p_is_accurate(exponent in -40.0_f64..20.0) {
            let x = exponent.exp() as f32;
            let exact = f64::from(x).ln_1p();
            prop_assert!((f64::from(ln_1p(x)) / exact - 1.0).abs() < 3e-7, "{x}: {} {exact}", ln_1p(x));
        }

        #[test]
        fn ln_is_accurate_near_1(x in 0.5_f32..2.0) {
            let exact = f64::from(x).ln();
            prop_assert!((f64::from(ln(x)) - exact).abs() < 1e-7, "{x}: {} {exact}", ln(x));
        }
    }

    #[test]
    fn limits_are_exact() {
        assert_eq!((exp(0.0), ln(1.0)), (1.0, 0.0));
        assert_eq!((exp(-100.0), exp(f32::NEG_INFINITY)), (0.0, 0.0));
        assert_eq!(
            (exp(100.0), exp(f32::INFINITY)),
            (f32::INFINITY, f32::INFINITY)
        );
        assert_eq!(
            (ln(0.0), ln(f32::INFINITY)),
            (f32::NEG_INFINITY, f32::INFINITY)
        );
        assert!(exp(f32::NAN).is_nan() && ln(f32::NAN).is_nan() && ln(-1.0).is_nan());
    }
}
