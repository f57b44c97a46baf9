//! Transposed matrices, in blocks of 8 × 8 numbers where the processor can exchange them in registers.

/// `matrix: [rows × columns]` → `transposed: [columns × rows]`
#[inline(always)]
pub(super) fn transpose(matrix: &[f32], columns: usize, transposed: &mut Vec<f32>) {
    transposed.resize(matrix.len(), 0.0);
    transpose_into(matrix, columns, transposed);
}

/// `matrix: [rows × columns]` → `transposed: [columns × rows]`
pub(super) fn transpose_into(matrix: &[f32], columns: usize, transposed: &mut [f32]) {
    let rows = matrix.len() / columns;
    #[cfg(target_arch = "x86_64")]
    if rows >= x86::SIZE
        && columns >= x86::SIZE
        && let Some(simd) = pulp::x86::V3::try_new()
    {
        let blocks = x86::Blocks {
            simd,
            matrix,
            columns,
            transposed,
        };
        pulp::Simd::vectorize(simd, blocks);
        return;
    }
    transpose_numbers(matrix, columns, transposed);
}

fn transpose_numbers(matrix: &[f32], columns: usize, transposed: &mut [f32]) {
    let rows = matrix.len() / columns;
    for (column, target) in transposed.chunks_exact_mut(rows).enumerate() {
        for (target, row) in target.iter_mut().zip(matrix.chunks_exact(columns)) {
            *target = row[column];
        }
    }
}

/// Blocks for processors with AVX.
#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::__m256;
    use std::array::from_fn;

    use pulp::x86::V3;
    use pulp::{NullaryFnOnce, bytemuck};

    /// Number of rows and columns of a block.
    pub(super) const SIZE: usize = 8;

    /// A matrix with at least one whole block, and the place of its transpose.
    pub(super) struct Blocks<'a> {
        pub(super) simd: V3,
        pub(super) matrix: &'a [f32],
        pub(super) columns: usize,
        pub(super) transposed: &'a mut [f32],
    }

    impl NullaryFnOnce for Blocks<'_> {
        type Output = ();

        /// Transposes block by block. If the size of a block does not divide that of the matrix, the
        /// last block overlaps the one before.
        #[inline(always)]
        fn call(self) {
            let Self {
                simd,
                matrix,
                columns,
                transposed,
            } = self;
            let rows = matrix.len() / columns;
            for row in (0..rows).step_by(SIZE) {
                let row = row.min(rows - SIZE);
                for column in (0..columns).step_by(SIZE) {
                    let column = column.min(columns - SIZE);
                    let block = from_fn(|r| {
                        let numbers = &matrix[(row + r) * columns + column..][..SIZE];
                        bytemuck::pod_read_unaligned(bytemuck::cast_slice(numbers))
                    });
                    for (c, numbers) in transpose_block(simd, block).iter().enumerate() {
                        let target = &mut transposed[(column + c) * rows + row..][..SIZE];
                        target.copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(numbers)));
                    }
                }
            }
        }
    }

    /// Exchanges rows and columns of a block.
    #[inline(always)]
    fn transpose_block(simd: V3, rows: [__m256; SIZE]) -> [__m256; SIZE] {
        let avx = simd.avx;
        let pairs: [__m256; SIZE] = from_fn(|i| {
            let (a, b) = (rows[i / 2 * 2], rows[i / 2 * 2 + 1]);
            if i % 2 == 0 {
                avx._mm256_unpacklo_ps(a, b)
            } else {
                avx._mm256_unpackhi_ps(a, b)
            }
        });
        // Quad i has column i of four rows in its lower half, and column i + 4 in its upper half.
        let quads: [__m256; SIZE] = from_fn(|i| {
            let (a, b) = (
                pairs[i / 4 * 4 + i % 4 / 2],
                pairs[i / 4 * 4 + i % 4 / 2 + 2],
            );
            if i % 2 == 0 {
                avx._mm256_shuffle_ps::<0b0100_0100>(a, b)
            } else {
                avx._mm256_shuffle_ps::<0b1110_1110>(a, b)
            }
        });
        from_fn(|i| {
            if i < 4 {
                avx._mm256_permute2f128_ps::<0x20>(quads[i], quads[i + 4])
            } else {
                avx._mm256_permute2f128_ps::<0x31>(quads[i - 4], quads[i])
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_become_columns() {
        for rows in 1..20 {
            for columns in 1..20 {
                let number = |row: usize, column: usize| (100 * row + column) as f32;
                let index = |i: usize| number(i / columns, i % columns);
                let matrix: Vec<f32> = (0..rows * columns).map(index).collect();
                let expected = (0..rows * columns).map(|i| number(i % rows, i / rows));
                let mut transposed = Vec::new();
                transpose(&matrix, columns, &mut transposed);
                assert_eq!(transposed, expected.collect::<Vec<_>>());
            }
        }
    }
}
