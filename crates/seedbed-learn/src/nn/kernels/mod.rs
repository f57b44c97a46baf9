//! The innermost loops, compiled for several SIMD instruction sets, of which one is selected at run
//! time.
//!
//! Matrices are row-major with one row per sample: `x: [B × in]`, `weight: [in × out]`,
//! `y: [B × out]`. The bits of results do not depend on the instruction set.

#![expect(
    clippy::inline_always,
    reason = "a loop is compiled for a SIMD instruction set only if it is inlined into the dispatch"
)]

mod elementwise;
#[cfg(test)]
mod instruction_sets;
mod normalization;
mod products;
mod transpose;

use pulp::Arch;

pub(crate) use elementwise::move_towards;
pub(super) use elementwise::{
    AdamStep, relu_gradient_in_place, relu_in_place, tanh_gradient_in_place, tanh_in_place,
};
pub(super) use normalization::{normalization_gradient, normalize_rows, normalize_rows_gradient};
pub(super) use products::Scratch;
use products::{Affine, BiasGradient, InputGradient, WeightGradient};

/// y = x W + b.   `x: [B × in]`, `weight: [in × out]`, `bias: [out]` → `y: [B × out]`
pub(super) fn affine(
    weight: &[f32],
    bias: &[f32],
    x: &[f32],
    y: &mut [f32],
    scratch: &mut Scratch,
) {
    let (inputs, outputs) = (weight.len() / bias.len(), bias.len());
    let batch = y.len() / outputs;
    assert_eq!(
        (x.len(), y.len(), weight.len()),
        (batch * inputs, batch * outputs, inputs * outputs)
    );
    Arch::new().dispatch(Affine {
        weight,
        bias,
        x,
        y,
        scratch,
    });
}

/// ∂L/∂x = ∂L/∂y Wᵀ.   `weight: [in × out]`, `dy: [B × out]` → `dx: [B × in]`
pub(super) fn input_gradient(
    weight: &[f32],
    dy: &[f32],
    dx: &mut [f32],
    outputs: usize,
    scratch: &mut Scratch,
) {
    let (inputs, batch) = (weight.len() / outputs, dy.len() / outputs);
    assert_eq!(
        (dx.len(), dy.len(), weight.len()),
        (batch * inputs, batch * outputs, inputs * outputs)
    );
    Arch::new().dispatch(InputGradient {
        weight,
        dy,
        dx,
        outputs,
        scratch,
    });
}

/// ∂L/∂W = xᵀ ∂L/∂y and ∂L/∂b = Σ ∂L/∂y.   `x: [B × in]`, `dy: [B × out]` → `dw: [in × out]`,
/// `db: [out]`
pub(super) fn parameter_gradient(
    x: &[f32],
    dy: &[f32],
    dw: &mut [f32],
    db: &mut [f32],
    scratch: &mut Scratch,
) {
    let (inputs, outputs) = (dw.len() / db.len(), db.len());
    let batch = dy.len() / outputs;
    assert_eq!(
        (x.len(), dy.len(), dw.len()),
        (batch * inputs, batch * outputs, inputs * outputs)
    );
    Arch::new().dispatch(BiasGradient { dy, db, scratch });
    Arch::new().dispatch(WeightGradient {
        x,
        dy,
        dw,
        outputs,
        scratch,
    });
}

#[cfg(test)]
mod tests {
    use super::instruction_sets::InstructionSet;
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
        let mut scratch = Scratch::default();
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

    /// Sizes just below and above those of tiles, of vectors and of the threshold for panels.
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

    #[test]
    fn large_layers_agree_with_nalgebra() {
        for (batch, inputs, outputs) in [(13, 80, 77), (40, 96, 64), (40, 64, 96), (33, 150, 41)] {
            check_layer(batch, inputs, outputs, 6);
        }
    }

    /// The bits of a layer: outputs, and gradients of inputs, weights and biases.
    fn layer_bits([batch, inputs, outputs]: [usize; 3], set: InstructionSet) -> Vec<u32> {
        let (x, weight, bias, dy) = (
            pseudo_random(batch * inputs, 1),
            pseudo_random(inputs * outputs, 2),
            pseudo_random(outputs, 3),
            pseudo_random(batch * outputs, 4),
        );
        let mut scratch = Scratch::default();
        let (mut y, mut dx) = (vec![0.0; batch * outputs], vec![0.0; batch * inputs]);
        let (mut dw, mut db) = (vec![0.0; inputs * outputs], vec![0.0; outputs]);
        let affine = Affine {
            weight: &weight,
            bias: &bias,
            x: &x,
            y: &mut y,
            scratch: &mut scratch,
        };
        set.run(affine);
        let input_gradient = InputGradient {
            weight: &weight,
            dy: &dy,
            dx: &mut dx,
            outputs,
            scratch: &mut scratch,
        };
        set.run(input_gradient);
        let weight_gradient = WeightGradient {
            x: &x,
            dy: &dy,
            dw: &mut dw,
            outputs,
            scratch: &mut scratch,
        };
        set.run(weight_gradient);
        let bias_gradient = BiasGradient {
            dy: &dy,
            db: &mut db,
            scratch: &mut scratch,
        };
        set.run(bias_gradient);
        let numbers = [y, dx, dw, db].concat();
        numbers.into_iter().map(f32::to_bits).collect()
    }

    #[test]
    fn bits_do_not_depend_on_the_instruction_set() {
        for batch in [1, 3, 5, 16, 33] {
            for inputs in [1, 3, 8, 11, 32, 100] {
                for outputs in [1, 2, 7, 8, 13, 32, 100] {
                    let shape = [batch, inputs, outputs];
                    let expected = layer_bits(shape, InstructionSet::Scalar);
                    for set in InstructionSet::WITH_SIMD {
                        let is_same = layer_bits(shape, set) == expected;
                        assert!(is_same, "{set:?}: {batch} × {inputs} × {outputs}");
                    }
                }
            }
        }
    }

    /// The bits of a row's output do not depend on the rows around it.
    #[test]
    fn rows_of_layers_are_independent() {
        for outputs in [1, 2, 8, 13, 32, 100] {
            let wave = |count: usize| {
                (0..count)
                    .map(|i| (i as f32 * 0.7).sin())
                    .collect::<Vec<f32>>()
            };
            let (x, weight, bias) = (wave(13 * 9), wave(9 * outputs), wave(outputs));
            let (mut together, mut alone) = (vec![0.0; 13 * outputs], vec![0.0; outputs]);
            affine(&weight, &bias, &x, &mut together, &mut Scratch::default());
            for (x, expected) in x.chunks_exact(9).zip(together.chunks_exact(outputs)) {
                affine(&weight, &bias, x, &mut alone, &mut Scratch::default());
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
