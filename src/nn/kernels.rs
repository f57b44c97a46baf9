//! The innermost loops, compiled once for every level of SIMD that the processor may have and chosen as the program runs.
//!
//! Matrices are row-major by sample: `x: [B × in]`, `weight: [in × out]`, `y: [B × out]`. Products in which every side is wide go
//! to nalgebra (whose `gemm` is matrixmultiply's); it has no fast way for narrow ones, such as an output layer of two
//! units or a batch of one, which run here.

#![expect(clippy::inline_always, reason = "a loop is compiled for a level of SIMD only where it is inlined into the dispatch")]

use nalgebra::{DMatrixView, DMatrixViewMut, Dyn};
use pulp::{Arch, Simd, WithSimd};

/// nalgebra multiplies matrices with a side of 5 or less column by column.
const NARROW: usize = 5;

/// y = x W + b.   `x: [B × in]`, `weight: [in × out]`, `bias: [out]` → `y: [B × out]`
pub(super) fn affine(weight: &[f32], bias: &[f32], x: &[f32], y: &mut [f32]) {
    let (inputs, outputs) = (weight.len() / bias.len(), bias.len());
    let batch = y.len() / outputs;
    assert_eq!((x.len(), y.len(), weight.len()), (batch * inputs, batch * outputs, inputs * outputs));
    if [batch, inputs, outputs].iter().any(|&side| side <= NARROW) {
        return Arch::new().dispatch(Affine { weight, bias, x, y });
    }
    for row in y.chunks_exact_mut(outputs) {
        row.copy_from_slice(bias);
    }
    // Row-major [B × n] is nalgebra's column-major [n × B]: yᵀ ← Wᵀ xᵀ + yᵀ.
    let transposed_weight = DMatrixView::from_slice(weight, outputs, inputs);
    DMatrixViewMut::from_slice(y, outputs, batch).gemm(1.0, &transposed_weight, &DMatrixView::from_slice(x, inputs, batch), 1.0);
}

/// ∂L/∂x = ∂L/∂y Wᵀ.   `weight: [in × out]`, `dy: [B × out]` → `dx: [B × in]`
pub(super) fn input_gradient(weight: &[f32], dy: &[f32], dx: &mut [f32], outputs: usize) {
    let (inputs, batch) = (weight.len() / outputs, dy.len() / outputs);
    assert_eq!((dx.len(), dy.len(), weight.len()), (batch * inputs, batch * outputs, inputs * outputs));
    if [batch, inputs, outputs].iter().any(|&side| side <= NARROW) {
        return Arch::new().dispatch(InputGradient { weight, dy, dx, outputs });
    }
    let weight = DMatrixView::<f32, Dyn, Dyn>::from_slice_with_strides(weight, inputs, outputs, outputs, 1);
    DMatrixViewMut::from_slice(dx, inputs, batch).gemm(1.0, &weight, &DMatrixView::from_slice(dy, outputs, batch), 0.0);
}

/// ∂L/∂W = xᵀ ∂L/∂y and ∂L/∂b = Σ ∂L/∂y.   `x: [B × in]`, `dy: [B × out]` → `dw: [in × out]`, `db: [out]`
pub(super) fn parameter_gradient(x: &[f32], dy: &[f32], dw: &mut [f32], db: &mut [f32]) {
    let (inputs, outputs) = (dw.len() / db.len(), db.len());
    let batch = dy.len() / outputs;
    assert_eq!((x.len(), dy.len(), dw.len()), (batch * inputs, batch * outputs, inputs * outputs));
    Arch::new().dispatch(BiasGradient { dy, db });
    if [batch, inputs, outputs].iter().any(|&side| side <= NARROW) {
        return Arch::new().dispatch(WeightGradient { x, dy, dw, outputs });
    }
    let x = DMatrixView::<f32, Dyn, Dyn>::from_slice_with_strides(x, batch, inputs, inputs, 1);
    DMatrixViewMut::from_slice(dw, outputs, inputs).gemm(1.0, &DMatrixView::from_slice(dy, outputs, batch), &x, 0.0);
}

/// y ← tanh y, to 4·10⁻⁷.
pub(super) fn tanh_in_place(y: &mut [f32]) {
    Arch::new().dispatch(TanhInPlace(y));
}

/// ∂L/∂x ← ∂L/∂y · (1 − y²) for y = tanh x.
pub(super) fn tanh_gradient_in_place(y: &[f32], dy: &mut [f32]) {
    assert_eq!(y.len(), dy.len());
    Arch::new().dispatch(TanhGradientInPlace { y, dy });
}

/// What one step of Adam needs besides the parameters.
pub(super) struct AdamStep<'a> {
    pub(super) parameters: &'a mut [f32],
    pub(super) gradient: &'a [f32],
    pub(super) first_moment: &'a mut [f32],
    pub(super) second_moment: &'a mut [f32],
    pub(super) beta1: f32,
    pub(super) beta2: f32,
    /// α √(1 − β₂ᵗ) / (1 − β₁ᵗ)
    pub(super) rate: f32,
    /// ε √(1 − β₂ᵗ)
    pub(super) epsilon: f32,
}

impl AdamStep<'_> {
    pub(super) fn run(self) {
        let count = self.parameters.len();
        assert_eq!([self.gradient.len(), self.first_moment.len(), self.second_moment.len()], [count; 3]);
        Arch::new().dispatch(self);
    }
}

struct Affine<'a> {
    weight: &'a [f32],
    bias: &'a [f32],
    x: &'a [f32],
    y: &'a mut [f32],
}

impl WithSimd for Affine<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let outputs = self.bias.len();
        let inputs = self.weight.len() / outputs;
        for (x, y) in self.x.chunks_exact(inputs).zip(self.y.chunks_exact_mut(outputs)) {
            let wide = outputs - outputs % LANES;
            for from in (0..wide).step_by(LANES) {
                let mut sum = [0.0; LANES];
                sum.copy_from_slice(&self.bias[from..from + LANES]);
                for (row, &x) in self.weight.chunks_exact(outputs).zip(x) {
                    multiply_add(&mut sum, x, &row[from..from + LANES]);
                }
                y[from..from + LANES].copy_from_slice(&sum);
            }
            for (column, y) in y.iter_mut().enumerate().skip(wide) {
                let terms = x.iter().zip(self.weight[column..].iter().step_by(outputs));
                *y = terms.fold(self.bias[column], |sum, (x, weight)| x.mul_add(*weight, sum));
            }
        }
    }
}

struct InputGradient<'a> {
    weight: &'a [f32],
    dy: &'a [f32],
    dx: &'a mut [f32],
    outputs: usize,
}

impl WithSimd for InputGradient<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let inputs = self.weight.len() / self.outputs;
        for (dy, dx) in self.dy.chunks_exact(self.outputs).zip(self.dx.chunks_exact_mut(inputs)) {
            for (dx, row) in dx.iter_mut().zip(self.weight.chunks_exact(self.outputs)) {
                *dx = row.iter().zip(dy).fold(0.0, |sum, (weight, dy)| weight.mul_add(*dy, sum));
            }
        }
    }
}

struct WeightGradient<'a> {
    x: &'a [f32],
    dy: &'a [f32],
    dw: &'a mut [f32],
    outputs: usize,
}

impl WithSimd for WeightGradient<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let inputs = self.dw.len() / self.outputs;
        self.dw.fill(0.0);
        for (x, dy) in self.x.chunks_exact(inputs).zip(self.dy.chunks_exact(self.outputs)) {
            for (row, &x) in self.dw.chunks_exact_mut(self.outputs).zip(x) {
                multiply_add(row, x, dy);
            }
        }
    }
}

struct BiasGradient<'a> {
    dy: &'a [f32],
    db: &'a mut [f32],
}

impl WithSimd for BiasGradient<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.db.fill(0.0);
        for row in self.dy.chunks_exact(self.db.len()) {
            self.db.iter_mut().zip(row).for_each(|(sum, dy)| *sum += dy);
        }
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
        self.dy.iter_mut().zip(self.y).for_each(|(dy, y)| *dy *= (-y).mul_add(*y, 1.0));
    }
}

impl WithSimd for AdamStep<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let moments = self.first_moment.iter_mut().zip(self.second_moment.iter_mut());
        for ((parameter, gradient), (m, v)) in self.parameters.iter_mut().zip(self.gradient).zip(moments) {
            *m = self.beta1.mul_add(*m - gradient, *gradient);
            *v = self.beta2.mul_add(*v - gradient * gradient, gradient * gradient);
            *parameter -= self.rate * *m / (v.sqrt() + self.epsilon);
        }
    }
}

/// Sums kept in registers at once: two AVX2 vectors or one of AVX-512.
const LANES: usize = 16;

#[inline(always)]
fn multiply_add(sum: &mut [f32], factor: f32, terms: &[f32]) {
    sum.iter_mut().zip(terms).for_each(|(sum, term)| *sum = factor.mul_add(*term, *sum));
}

/// Ratio of polynomials x p(x²) / q(x²), fitted to tanh where f32 can tell it from ±1; the coefficients are the minimax fit of
/// degree (13, 6) that numeric libraries commonly use.
#[inline(always)]
fn tanh(x: f32) -> f32 {
    const LIMIT: f32 = 7.905_311;
    const P: [f32; 7] =
        [4.893_525_5e-3, 6.372_619_3e-4, 1.485_722_4e-5, 5.122_297e-8, -8.604_672e-11, 2.000_188e-13, -2.760_768_5e-16];
    const Q: [f32; 4] = [4.893_525e-3, 2.268_434_6e-3, 1.185_347e-4, 1.198_258_4e-6];
    let x = x.clamp(-LIMIT, LIMIT);
    let square = x * x;
    let horner = |coefficients: &[f32]| coefficients.iter().rev().fold(0.0_f32, |sum, c| sum.mul_add(square, *c));
    x * horner(&P) / horner(&Q)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use proptest::prelude::*;

    /// Narrow and wide shapes alike against nalgebra's plain products.
    fn check_layer(batch: usize, inputs: usize, outputs: usize, seed: u64) {
        let numbers = |count: usize, salt: u64| -> Vec<f32> {
            let hashed = |i: usize| (i as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15 ^ (seed + salt)).rotate_left(29) >> 40;
            (0..count).map(|i| hashed(i) as f32 / 8_388_608.0 - 1.0).collect()
        };
        let (x, w, b, dy) =
            (numbers(batch * inputs, 1), numbers(inputs * outputs, 2), numbers(outputs, 3), numbers(batch * outputs, 4));
        let matrix = |rows, columns, data: &[f32]| DMatrix::from_row_slice(rows, columns, data);
        let (xm, wm, dym) = (matrix(batch, inputs, &x), matrix(inputs, outputs, &w), matrix(batch, outputs, &dy));
        let close = |ours: &[f32], theirs: DMatrix<f32>| {
            let theirs = theirs.transpose();
            for (a, b) in ours.iter().zip(theirs.iter()) {
                assert!((a - b).abs() < 1e-4, "{a} against {b} at {batch} × {inputs} × {outputs}");
            }
        };

        let mut y = vec![f32::NAN; batch * outputs];
        affine(&w, &b, &x, &mut y);
        let rows_of_bias = DMatrix::from_fn(batch, outputs, |_, column| b[column]);
        close(&y, &xm * &wm + rows_of_bias);

        let mut dx = vec![f32::NAN; batch * inputs];
        input_gradient(&w, &dy, &mut dx, outputs);
        close(&dx, &dym * wm.transpose());

        let (mut dw, mut db) = (vec![f32::NAN; inputs * outputs], vec![f32::NAN; outputs]);
        parameter_gradient(&x, &dy, &mut dw, &mut db);
        close(&dw, xm.transpose() * &dym);
        close(&db, DMatrix::from_fn(1, outputs, |_, column| dym.column(column).sum()));
    }

    proptest! {
        #[test]
        fn layers_agree_with_plain_products(batch in 1..40_usize, inputs in 1..40_usize, outputs in 1..40_usize, seed: u64) {
            check_layer(batch, inputs, outputs, seed >> 8);
        }

        #[test]
        fn tanh_is_within_a_few_units_in_the_last_place(x in -20.0_f32..20.0) {
            let mut y = [x];
            tanh_in_place(&mut y);
            prop_assert!((f64::from(y[0]) - f64::from(x).tanh()).abs() < 4e-7);
            prop_assert!(y[0].abs() <= 1.0);
        }
    }
}
