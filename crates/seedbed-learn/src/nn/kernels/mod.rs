//! The innermost loops, compiled for several SIMD instruction sets, of which one is selected at run
//! time.
//!
//! Matrices are row-major with one row per sample: `x: [B × in]`, `weight: [in × out]`,
//! `y: [B × out]`. Small matrices are multiplied here, large ones by `gemm` of nalgebra
//! (matrixmultiply). `scratch` is a buffer that grows to the size of the largest layer.

#![expect(
    clippy::inline_always,
    reason = "a loop is compiled for a SIMD instruction set only if it is inlined into the dispatch"
)]

mod elementwise;
mod products;

use nalgebra::{DMatrixView, DMatrixViewMut, Dyn};
use pulp::Arch;

pub(super) use elementwise::{AdamStep, tanh_gradient_in_place, tanh_in_place};
use products::{Affine, BiasGradient, InputGradient, WeightGradient};

/// y = x W + b.   `x: [B × in]`, `weight: [in × out]`, `bias: [out]` → `y: [B × out]`
pub(super) fn affine(
    weight: &[f32],
    bias: &[f32],
    x: &[f32],
    y: &mut [f32],
    scratch: &mut Vec<f32>,
) {
    let (inputs, outputs) = (weight.len() / bias.len(), bias.len());
    let batch = y.len() / outputs;
    assert_eq!(
        (x.len(), y.len(), weight.len()),
        (batch * inputs, batch * outputs, inputs * outputs)
    );
    if !is_large(batch, inputs, outputs) {
        return Arch::new().dispatch(Affine {
            weight,
            bias,
            x,
            y,
            scratch,
        });
    }
    for row in y.chunks_exact_mut(outputs) {
        row.copy_from_slice(bias);
    }
    // Row-major [B × n] is nalgebra's column-major [n × B]: yᵀ ← Wᵀ xᵀ + yᵀ.
    let transposed_weight = DMatrixView::from_slice(weight, outputs, inputs);
    DMatrixViewMut::from_slice(y, outputs, batch).gemm(
        1.0,
        &transposed_weight,
        &DMatrixView::from_slice(x, inputs, batch),
        1.0,
    );
}

/// ∂L/∂x = ∂L/∂y Wᵀ.   `weight: [in × out]`, `dy: [B × out]` → `dx: [B × in]`
pub(super) fn input_gradient(
    weight: &[f32],
    dy: &[f32],
    dx: &mut [f32],
    outputs: usize,
    scratch: &mut Vec<f32>,
) {
    let (inputs, batch) = (weight.len() / outputs, dy.len() / outputs);
    assert_eq!(
        (dx.len(), dy.len(), weight.len()),
        (batch * inputs, batch * outputs, inputs * outputs)
    );
    if !is_large(batch, inputs, outputs) {
        return Arch::new().dispatch(InputGradient {
            weight,
            dy,
            dx,
            outputs,
            scratch,
        });
    }
    let weight =
        DMatrixView::<f32, Dyn, Dyn>::from_slice_with_strides(weight, inputs, outputs, outputs, 1);
    DMatrixViewMut::from_slice(dx, inputs, batch).gemm(
        1.0,
        &weight,
        &DMatrixView::from_slice(dy, outputs, batch),
        0.0,
    );
}

/// ∂L/∂W = xᵀ ∂L/∂y and ∂L/∂b = Σ ∂L/∂y.   `x: [B × in]`, `dy: [B × out]` → `dw: [in × out]`,
/// `db: [out]`
pub(super) fn parameter_gradient(
    x: &[f32],
    dy: &[f32],
    dw: &mut [f32],
    db: &mut [f32],
    scratch: &mut Vec<f32>,
) {
    let (inputs, outputs) = (dw.len() / db.len(), db.len());
    let batch = dy.len() / outputs;
    assert_eq!(
        (x.len(), dy.len(), dw.len()),
        (batch * inputs, batch * outputs, inputs * outputs)
    );
    Arch::new().dispatch(BiasGradient { dy, db });
    if !is_large(batch, inputs, outputs) {
        return Arch::new().dispatch(WeightGradient {
            x,
            dy,
            dw,
            outputs,
            scratch,
        });
    }
    let x = DMatrixView::<f32, Dyn, Dyn>::from_slice_with_strides(x, batch, inputs, inputs, 1);
    DMatrixViewMut::from_slice(dw, outputs, inputs).gemm(
        1.0,
        &DMatrixView::from_slice(dy, outputs, batch),
        &x,
        0.0,
    );
}

/// Whether `gemm` is faster in spite of its packing: from about 48 × 48 weights on, if no dimension
/// is small.
fn is_large(batch: usize, inputs: usize, outputs: usize) -> bool {
    batch >= 16 && inputs >= 16 && outputs >= 16 && inputs * outputs > 48 * 48
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use proptest::prelude::*;

    /// Pseudo-random numbers from −1 to 1, a hash of `seed` and their index.
    fn pseudo_random(count: usize, seed: u64) -> Vec<f32> {
        let hash = |i: usize| {
            (i as u64 + 1)
                .wrapping_mul(0x9E37_79B9_7F4A_7C15 ^ seed)
                .rotate_left(29)
                >> 40
        };
        (0..count)
            .map(|i| hash(i) as f32 / 8_388_608.0 - 1.0)
            .collect()
    }

    /// Compares the outputs and the gradients of a layer with nalgebra's products.
    fn check_layer(batch: usize, inputs: usize, outputs: usize, seed: u64) {
        let (x, w, b, dy) = (
            pseudo_random(batch * inputs, seed + 1),
            pseudo_random(inputs * outputs, seed + 2),
            pseudo_random(outputs, seed + 3),
            pseudo_random(batch * outputs, seed + 4),
        );
        let matrix = |rows, columns, data: &[f32]| DMatrix::from_row_slice(rows, columns, data);
        let (x_matrix, w_matrix, dy_matrix) = (
            matrix(batch, inputs, &x),
            matrix(inputs, outputs, &w),
            matrix(batch, outputs, &dy),
        );
        let assert_close = |result: &[f32], expected: DMatrix<f32>| {
            let expected = expected.transpose();
            for (a, b) in result.iter().zip(expected.iter()) {
                assert!(
                    (a - b).abs() < 1e-4,
                    "{a} against {b} at {batch} × {inputs} × {outputs}"
                );
            }
        };

        // The initial contents of buffers must not matter.
        let mut scratch = vec![f32::NAN; 7];
        let mut y = vec![f32::NAN; batch * outputs];
        affine(&w, &b, &x, &mut y, &mut scratch);
        let rows_of_bias = DMatrix::from_fn(batch, outputs, |_, column| b[column]);
        assert_close(&y, &x_matrix * &w_matrix + rows_of_bias);

        let mut dx = vec![f32::NAN; batch * inputs];
        input_gradient(&w, &dy, &mut dx, outputs, &mut scratch);
        assert_close(&dx, &dy_matrix * w_matrix.transpose());

        let (mut dw, mut db) = (vec![f32::NAN; inputs * outputs], vec![f32::NAN; outputs]);
        parameter_gradient(&x, &dy, &mut dw, &mut db, &mut scratch);
        assert_close(&dw, x_matrix.transpose() * &dy_matrix);
        assert_close(
            &db,
            DMatrix::from_fn(1, outputs, |_, column| dy_matrix.column(column).sum()),
        );
    }

    /// Sizes just below and above those of tiles, of vectors and of the threshold for `gemm`.
    #[test]
    fn layers_of_edge_sizes_agree_with_nalgebra() {
        const SIZES: [usize; 12] = [1, 2, 3, 4, 5, 7, 8, 15, 16, 17, 31, 33];
        for batch in [1, 3, 4, 5, 6, 7, 16, 33] {
            for inputs in SIZES.into_iter().chain([64]) {
                for outputs in SIZES.into_iter().chain([64]) {
                    check_layer(batch, inputs, outputs, 5);
                }
            }
        }
    }

    /// The bits of a row's output do not depend on the rows around it.
    #[test]
    fn rows_of_small_layers_are_independent() {
        for outputs in [1, 2, 8, 13, 32] {
            let wave = |count: usize| {
                (0..count)
                    .map(|i| (i as f32 * 0.7).sin())
                    .collect::<Vec<f32>>()
            };
            let (x, weight, bias) = (wave(13 * 9), wave(9 * outputs), wave(outputs));
            let (mut together, mut alone) = (vec![0.0; 13 * outputs], vec![0.0; outputs]);
            affine(&weight, &bias, &x, &mut together, &mut Vec::new());
            for (x, expected) in x.chunks_exact(9).zip(together.chunks_exact(outputs)) {
                affine(&weight, &bias, x, &mut alone, &mut Vec::new());
                assert_eq!(alone, expected);
            }
        }
    }

    proptest! {
        #[test]
        fn layers_agree_with_nalgebra(batch in 1..40_usize, inputs in 1..40_usize, outputs in 1..40_usize, seed: u64) {
            check_layer(batch, inputs, outputs, seed >> 8);
        }
    }
}
