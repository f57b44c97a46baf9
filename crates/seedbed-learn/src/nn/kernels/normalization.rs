//! Layer normalization: the numbers of each row get mean 0 and deviation 1, then gains and shifts.
//!
//! Sums over a row have [`LANES`] partial sums, so that their bits are the same for every SIMD
//! instruction set.

use pulp::{Arch, Simd, WithSimd};

/// Number of partial sums.
const LANES: usize = 8;

/// Number that is added to variances.
const EPSILON: f32 = 1e-5;

/// y ← gain · x̂ + shift with x̂ = (y − mean y)/√(variance of y + ε) for each row.
/// `gains`, `shifts: [n]`, `y: [B × n]` → `normalized` (x̂): `[B × n]`, `reciprocals`
/// (1/√(variance + ε)): `[B]`, both overwritten
pub(in crate::nn) fn normalize_rows(
    gains: &[f32],
    shifts: &[f32],
    y: &mut [f32],
    normalized: &mut Vec<f32>,
    reciprocals: &mut Vec<f32>,
) {
    normalized.resize(y.len(), 0.0);
    reciprocals.resize(y.len() / gains.len(), 0.0);
    Arch::new().dispatch(NormalizeRows {
        gains,
        shifts,
        y,
        normalized,
        reciprocals,
    });
}

/// From ∂L/∂(gain · x̂ + shift) to ∂L/∂y: with d = gain · ∂L, it is (d − mean d − x̂ mean(d x̂)) times the
/// reciprocal deviation.   `normalized`, `dy`: `[B × n]` (the first B rows of `normalized`)
pub(in crate::nn) fn normalize_rows_gradient(
    gains: &[f32],
    normalized: &[f32],
    reciprocals: &[f32],
    dy: &mut [f32],
) {
    Arch::new().dispatch(NormalizeRowsGradient {
        gains,
        normalized,
        reciprocals,
        dy,
    });
}

/// ∂L/∂gain = Σ x̂ ∂L and ∂L/∂shift = Σ ∂L, over the batch.   `dy: [B × n]` → `gains`, `shifts: [n]`,
/// overwritten
pub(in crate::nn) fn normalization_gradient(
    normalized: &[f32],
    dy: &[f32],
    gains: &mut [f32],
    shifts: &mut [f32],
) {
    Arch::new().dispatch(NormalizationGradient {
        normalized,
        dy,
        gains,
        shifts,
    });
}

struct NormalizeRows<'a> {
    gains: &'a [f32],
    shifts: &'a [f32],
    y: &'a mut [f32],
    normalized: &'a mut [f32],
    reciprocals: &'a mut [f32],
}

impl WithSimd for NormalizeRows<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let width = self.gains.len();
        let share = 1.0 / width as f32;
        let rows = self.y.chunks_exact_mut(width);
        let rows = rows.zip(self.normalized.chunks_exact_mut(width));
        for ((y, normalized), reciprocal) in rows.zip(self.reciprocals) {
            let mean = share * sum(y);
            for (x, y) in normalized.iter_mut().zip(&*y) {
                *x = *y - mean;
            }
            *reciprocal = 1.0 / (share * sum_of_products(normalized, normalized) + EPSILON).sqrt();
            let terms = self.gains.iter().zip(self.shifts);
            for ((y, x), (gain, shift)) in y.iter_mut().zip(normalized).zip(terms) {
                *x *= *reciprocal;
                *y = gain.mul_add(*x, *shift);
            }
        }
    }
}

struct NormalizeRowsGradient<'a> {
    gains: &'a [f32],
    normalized: &'a [f32],
    reciprocals: &'a [f32],
    dy: &'a mut [f32],
}

impl WithSimd for NormalizeRowsGradient<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let width = self.gains.len();
        let share = 1.0 / width as f32;
        let rows = self.dy.chunks_exact_mut(width);
        let rows = rows.zip(self.normalized.chunks_exact(width));
        for ((dy, normalized), reciprocal) in rows.zip(self.reciprocals) {
            for (dy, gain) in dy.iter_mut().zip(self.gains) {
                *dy *= gain;
            }
            let mean = share * sum(dy);
            let slope = share * sum_of_products(dy, normalized);
            for (dy, x) in dy.iter_mut().zip(normalized) {
                *dy = reciprocal * (-slope).mul_add(*x, *dy - mean);
            }
        }
    }
}

struct NormalizationGradient<'a> {
    normalized: &'a [f32],
    dy: &'a [f32],
    gains: &'a mut [f32],
    shifts: &'a mut [f32],
}

impl WithSimd for NormalizationGradient<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let width = self.gains.len();
        self.gains.fill(0.0);
        self.shifts.fill(0.0);
        let rows = self.dy.chunks_exact(width);
        for (dy, normalized) in rows.zip(self.normalized.chunks_exact(width)) {
            let sums = self.gains.iter_mut().zip(self.shifts.iter_mut());
            for ((dy, x), (gain, shift)) in dy.iter().zip(normalized).zip(sums) {
                *gain = dy.mul_add(*x, *gain);
                *shift += dy;
            }
        }
    }
}

#[inline(always)]
fn sum(numbers: &[f32]) -> f32 {
    let (rows, rest) = numbers.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for row in rows {
        for (sum, number) in sums.iter_mut().zip(row) {
            *sum += number;
        }
    }
    total(sums) + rest.iter().sum::<f32>()
}

#[inline(always)]
fn sum_of_products(a: &[f32], b: &[f32]) -> f32 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    let mut sums = [0.0_f32; LANES];
    for (a, b) in a.iter().zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum = a.mul_add(*b, *sum);
        }
    }
    let rest = a_rest.iter().zip(b_rest).map(|(a, b)| a * b);
    total(sums) + rest.sum::<f32>()
}

#[inline(always)]
fn total(sums: [f32; LANES]) -> f32 {
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::kernels::instruction_sets::InstructionSet;

    /// The bits of a normalization and of its gradients, with an instruction set.
    fn bits(width: usize, set: InstructionSet) -> Vec<u32> {
        let wave = |count: usize, step: f32| -> Vec<f32> {
            (0..count).map(|i| (i as f32 * step).sin()).collect()
        };
        let (gains, shifts) = (wave(width, 0.3), wave(width, 0.9));
        let (mut y, mut dy) = (wave(5 * width, 0.7), wave(5 * width, 1.1));
        let (mut normalized, mut reciprocals) = (vec![0.0; 5 * width], vec![0.0; 5]);
        let (mut gain_slopes, mut shift_slopes) = (vec![7.0; width], vec![7.0; width]);
        let forward = NormalizeRows {
            gains: &gains,
            shifts: &shifts,
            y: &mut y,
            normalized: &mut normalized,
            reciprocals: &mut reciprocals,
        };
        set.run(forward);
        let parameters = NormalizationGradient {
            normalized: &normalized,
            dy: &dy,
            gains: &mut gain_slopes,
            shifts: &mut shift_slopes,
        };
        set.run(parameters);
        let backward = NormalizeRowsGradient {
            gains: &gains,
            normalized: &normalized,
            reciprocals: &reciprocals,
            dy: &mut dy,
        };
        set.run(backward);
        let numbers = [y, dy, gain_slopes, shift_slopes].concat();
        numbers.into_iter().map(f32::to_bits).collect()
    }

    #[test]
    fn bits_do_not_depend_on_the_instruction_set() {
        for width in [1, 3, 8, 17, 64, 100] {
            let expected = bits(width, InstructionSet::Scalar);
            for set in InstructionSet::WITH_SIMD {
                assert_eq!(bits(width, set), expected, "{set:?}: {width}");
            }
        }
    }
}
