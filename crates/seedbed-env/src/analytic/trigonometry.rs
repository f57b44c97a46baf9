//! Sine and cosine by arithmetic alone, so that a loop over copies compiles to SIMD instructions
//! and has the same bits on every machine.
//!
//! The angle is reduced to r = x − k π/2 with |r| ≤ π/4 and whole k (Cody and Waite, "Software
//! Manual for the Elementary Functions", 1980). π/2 is the sum of two numbers; with fused
//! multiply-adds the first difference is exact, so that r has one rounding error. The polynomials
//! of r are those of FDLIBM (Sun Microsystems 1993, `k_sin.c` and `k_cos.c`), whose error is below
//! 2⁻⁵⁷.

use std::f64::consts::FRAC_2_PI;

/// How sines and cosines are computed.
pub(super) trait Trigonometry {
    /// Sine and cosine of an angle, rad.
    fn sincos(angle: f64) -> (f64, f64);
}

/// Sine and cosine of angles up to [`MAX_ANGLE`], and NaN beyond: without branches, for loops over
/// copies.
pub(super) struct Bounded;

/// Sine and cosine of all angles: the bits of [`Bounded`] up to [`MAX_ANGLE`], and those of `libm`
/// beyond.
pub(super) struct Unbounded;

/// Largest angle, rad, that is reduced with two parts of π/2. Up to it k has at most 20 bits, and
/// what two parts leave of k π/2 is below 2⁻⁸⁷.
const MAX_ANGLE: f64 = 1e6;

impl Trigonometry for Bounded {
    #[inline(always)]
    fn sincos(angle: f64) -> (f64, f64) {
        /// Adding it to a number below 2⁵¹ leaves no bits behind the point: the sum's last bits are
        /// those of the rounded number.
        const ROUND: f64 = 1.5 * (1_u64 << 52) as f64;
        /// π/2 rounded to f64, and the rest.
        const HALF_PI: [f64; 2] = [std::f64::consts::FRAC_PI_2, 6.123_233_995_736_766e-17];
        let angle = if angle.abs() <= MAX_ANGLE {
            angle
        } else {
            f64::NAN
        };
        let shifted = angle.mul_add(FRAC_2_PI, ROUND);
        let (k, quadrant) = (shifted - ROUND, shifted.to_bits());
        let r = k.mul_add(-HALF_PI[1], k.mul_add(-HALF_PI[0], angle));
        let (sine, cosine) = (sine(r), cosine(r));
        let (s, c) = if quadrant & 1 == 0 {
            (sine, cosine)
        } else {
            (cosine, sine)
        };
        // The sine is negative in the quadrants 2 and 3, the cosine in 1 and 2.
        let sign = |quadrant: u64| (quadrant & 2) << 62;
        (
            f64::from_bits(s.to_bits() ^ sign(quadrant)),
            f64::from_bits(c.to_bits() ^ sign(quadrant.wrapping_add(1))),
        )
    }
}

impl Trigonometry for Unbounded {
    #[inline(always)]
    fn sincos(angle: f64) -> (f64, f64) {
        if angle.abs() <= MAX_ANGLE {
            Bounded::sincos(angle)
        } else {
            libm::sincos(angle)
        }
    }
}

/// sin r for |r| ≤ π/4.
#[inline(always)]
fn sine(r: f64) -> f64 {
    const S: [f64; 6] = [
        -1.666_666_666_666_663_2e-1,
        8.333_333_333_322_49e-3,
        -1.984_126_982_985_795e-4,
        2.755_731_370_707_006_8e-6,
        -2.505_076_025_340_686_3e-8,
        1.589_690_995_211_55e-10,
    ];
    let square = r * r;
    (square * r).mul_add(polynomial(&S, square), r)
}

/// cos r for |r| ≤ π/4.
#[inline(always)]
fn cosine(r: f64) -> f64 {
    const C: [f64; 6] = [
        4.166_666_666_666_66e-2,
        -1.388_888_888_887_411e-3,
        2.480_158_728_947_673e-5,
        -2.755_731_435_139_066_3e-7,
        2.087_572_321_298_175e-9,
        -1.135_964_755_778_819_5e-11,
    ];
    let square = r * r;
    (square * square).mul_add(polynomial(&C, square), square.mul_add(-0.5, 1.0))
}

/// Σ cₙ xⁿ of six coefficients, as (c₀ + c₁ x) + (c₂ + c₃ x) x² + (c₄ + c₅ x) x⁴: fewer operations
/// wait for each other than in Horner's form.
#[inline(always)]
fn polynomial(c: &[f64; 6], x: f64) -> f64 {
    let pair = |n: usize| c[n + 1].mul_add(x, c[n]);
    let square = x * x;
    square.mul_add(square.mul_add(pair(4), pair(2)), pair(0))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Error bound of one sine or cosine: one step of an f64 at 1.
    const MAX_ERROR: f64 = f64::EPSILON;

    fn assert_close(angle: f64) {
        let ((s, c), (sine, cosine)) = (Unbounded::sincos(angle), libm::sincos(angle));
        assert!(
            (s - sine).abs() <= MAX_ERROR && (c - cosine).abs() <= MAX_ERROR,
            "{angle}: {s}, {c} instead of {sine}, {cosine}"
        );
    }

    /// Known values: sin and cos of 0, of π/6 (½ √3 = 0.866 025 403 784 438 6), and of multiples of
    /// the f64 next to π/2, which lies 6.123…e-17 below π/2.
    #[test]
    fn known_angles_have_known_values() {
        assert_eq!(Bounded::sincos(0.0), (0.0, 1.0));
        let (s, c) = Bounded::sincos(std::f64::consts::FRAC_PI_6);
        assert!((s - 0.5).abs() <= MAX_ERROR && (c - 0.75_f64.sqrt()).abs() <= MAX_ERROR);
        let rest = 6.123_233_995_736_766e-17;
        for (turns, expected) in [
            (1.0, (1.0, rest)),
            (2.0, (2.0 * rest, -1.0)),
            (3.0, (-1.0, -3.0 * rest)),
            (4.0, (-4.0 * rest, 1.0)),
        ] {
            let (s, c) = Bounded::sincos(turns * std::f64::consts::FRAC_PI_2);
            // The product of 3 and π/2 is rounded.
            assert!(
                (s - expected.0).abs() < 2.3e-16 && (c - expected.1).abs() < 2.3e-16,
                "{turns}: {s}, {c}"
            );
        }
    }

    #[test]
    fn quarter_turns_and_their_neighbors_are_close_to_libm() {
        for k in (-700_000..700_000).step_by(37) {
            let angle = f64::from(k) * std::f64::consts::FRAC_PI_4;
            for angle in [angle, angle.next_up(), angle.next_down()] {
                assert_close(angle);
            }
        }
    }

    #[test]
    fn angles_beyond_the_bound_are_those_of_libm() {
        for angle in [1e6, -1e6, 1e6_f64.next_up(), 1e9, -3e15, 1e300, f64::MAX] {
            assert_close(angle);
            assert_eq!(Bounded::sincos(angle).0.is_nan(), angle.abs() > 1e6);
        }
        for angle in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(Bounded::sincos(angle).0.is_nan() && Unbounded::sincos(angle).1.is_nan());
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn sines_and_cosines_are_close_to_libm(turn in -4.0_f64..4.0, angle in -1e6_f64..1e6) {
            for angle in [turn, 10.0 * turn, angle] {
                assert_close(angle);
            }
        }

        /// Also for tiny results the relative error is small: sin x against x − x³/6 for small x.
        #[test]
        fn small_angles_are_their_sines(angle in -1e-5_f64..1e-5) {
            let expected = angle - angle * angle * angle / 6.0;
            prop_assert!((Bounded::sincos(angle).0 - expected).abs() <= f64::EPSILON * expected.abs());
        }
    }
}
