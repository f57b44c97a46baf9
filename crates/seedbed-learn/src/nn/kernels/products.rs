//! Products of matrices that are too small for a general `gemm`, whose packing would take longer
//! than the arithmetic.
//!
//! Sums are computed in tiles that stay in registers: several rows by one or two vectors of
//! columns. If the size of a matrix is not a multiple of the tile's size, the last tile overlaps
//! the one before and computes some numbers a second time, so that all tiles have the same size.
//! Products with fewer columns than a vector has lanes are computed with rows and columns
//! exchanged.

use std::array::from_fn;

use pulp::{Simd, WithSimd};

/// y = x W + b.   `x: [B × in]`, `weight: [in × out]`, `bias: [out]` → `y: [B × out]`
pub(super) struct Affine<'a> {
    pub(super) weight: &'a [f32],
    pub(super) bias: &'a [f32],
    pub(super) x: &'a [f32],
    pub(super) y: &'a mut [f32],
    pub(super) scratch: &'a mut Vec<f32>,
}

impl WithSimd for Affine<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self {
            weight,
            bias,
            x,
            y,
            scratch,
        } = self;
        let outputs = bias.len();
        if outputs < S::F32_LANES {
            scratch.resize(weight.len(), 0.0);
            transpose(weight, outputs, scratch);
            inner_products(simd, x, scratch, Some(bias), y, outputs);
        } else {
            compute_tiles(
                simd,
                &mut RowsTimesMatrix {
                    x,
                    matrix: weight,
                    bias: Some(bias),
                    y,
                    columns: outputs,
                },
            );
        }
    }
}

/// ∂L/∂x = ∂L/∂y Wᵀ.   `weight: [in × out]`, `dy: [B × out]` → `dx: [B × in]`
pub(super) struct InputGradient<'a> {
    pub(super) weight: &'a [f32],
    pub(super) dy: &'a [f32],
    pub(super) dx: &'a mut [f32],
    pub(super) outputs: usize,
    pub(super) scratch: &'a mut Vec<f32>,
}

impl WithSimd for InputGradient<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self {
            weight,
            dy,
            dx,
            outputs,
            scratch,
        } = self;
        let inputs = weight.len() / outputs;
        if inputs < S::F32_LANES {
            inner_products(simd, dy, weight, None, dx, inputs);
        } else {
            scratch.resize(weight.len(), 0.0);
            transpose(weight, outputs, scratch);
            compute_tiles(
                simd,
                &mut RowsTimesMatrix {
                    x: dy,
                    matrix: scratch,
                    bias: None,
                    y: dx,
                    columns: inputs,
                },
            );
        }
    }
}

/// ∂L/∂W = xᵀ ∂L/∂y.   `x: [B × in]`, `dy: [B × out]` → `dw: [in × out]`
pub(super) struct WeightGradient<'a> {
    pub(super) x: &'a [f32],
    pub(super) dy: &'a [f32],
    pub(super) dw: &'a mut [f32],
    pub(super) outputs: usize,
    pub(super) scratch: &'a mut Vec<f32>,
}

impl WithSimd for WeightGradient<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self {
            x,
            dy,
            dw,
            outputs,
            scratch,
        } = self;
        let inputs = dw.len() / outputs;
        if outputs >= S::F32_LANES {
            compute_tiles(
                simd,
                &mut OuterProducts {
                    left: x,
                    right: dy,
                    sum: dw,
                    columns: outputs,
                },
            );
        } else if inputs >= S::F32_LANES {
            scratch.resize(dw.len(), 0.0);
            compute_tiles(
                simd,
                &mut OuterProducts {
                    left: dy,
                    right: x,
                    sum: scratch,
                    columns: inputs,
                },
            );
            transpose(scratch, inputs, dw);
        } else {
            dw.fill(0.0);
            for (x, dy) in x.chunks_exact(inputs).zip(dy.chunks_exact(outputs)) {
                for (row, x) in dw.chunks_exact_mut(outputs).zip(x) {
                    row.iter_mut().zip(dy).for_each(|(sum, dy)| *sum += x * dy);
                }
            }
        }
    }
}

/// ∂L/∂b = Σ ∂L/∂y, over the batch.   `dy: [B × out]` → `db: [out]`
pub(super) struct BiasGradient<'a> {
    pub(super) dy: &'a [f32],
    pub(super) db: &'a mut [f32],
}

impl WithSimd for BiasGradient<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let outputs = self.db.len();
        if outputs < S::F32_LANES {
            for (output, sum) in self.db.iter_mut().enumerate() {
                *sum = self.dy.chunks_exact(outputs).map(|row| row[output]).sum();
            }
        } else {
            compute_tiles(
                simd,
                &mut ColumnSums {
                    rows: self.dy,
                    sum: self.db,
                },
            );
        }
    }
}

/// A matrix that is computed tile by tile. It has at least as many columns as a vector has lanes.
trait Tiled {
    /// Number of rows and of columns of the matrix.
    fn shape(&self) -> [usize; 2];

    /// Computes the tile of `HEIGHT` rows by `WIDTH` vectors of columns that starts at `row` and
    /// `column`.
    fn tile<S: Simd, const HEIGHT: usize, const WIDTH: usize>(
        &mut self,
        simd: S,
        row: usize,
        column: usize,
    );
}

/// y = x M, plus `bias` in every row if there is one.   `x: [B × n]`, `matrix: [n × columns]`,
/// `bias: [columns]` → `y: [B × columns]`
struct RowsTimesMatrix<'a> {
    x: &'a [f32],
    matrix: &'a [f32],
    bias: Option<&'a [f32]>,
    y: &'a mut [f32],
    columns: usize,
}

impl Tiled for RowsTimesMatrix<'_> {
    fn shape(&self) -> [usize; 2] {
        [self.y.len() / self.columns, self.columns]
    }

    #[inline(always)]
    fn tile<S: Simd, const HEIGHT: usize, const WIDTH: usize>(
        &mut self,
        simd: S,
        row: usize,
        column: usize,
    ) {
        let inner = self.matrix.len() / self.columns;
        let mut x = [&self.x[..inner]; HEIGHT];
        for (x, row) in x.iter_mut().zip(self.x[row * inner..].chunks_exact(inner)) {
            *x = row;
        }
        let initial = self.bias.map_or([simd.splat_f32s(0.0); WIDTH], |bias| {
            load::<S, WIDTH>(&bias[column..])
        });
        let mut sums = [initial; HEIGHT];
        for (terms, index) in self.matrix.chunks_exact(self.columns).zip(0..inner) {
            multiply_add(
                simd,
                &mut sums,
                from_fn(|r| x[r][index]),
                load::<S, WIDTH>(&terms[column..]),
            );
        }
        store::<S, HEIGHT, WIDTH>(
            sums,
            &mut self.y[row * self.columns + column..],
            self.columns,
        );
    }
}

/// Σ leftᵀ right, over the batch.   `left: [B × rows]`, `right: [B × columns]` →
/// `sum: [rows × columns]`
struct OuterProducts<'a> {
    left: &'a [f32],
    right: &'a [f32],
    sum: &'a mut [f32],
    columns: usize,
}

impl Tiled for OuterProducts<'_> {
    fn shape(&self) -> [usize; 2] {
        [self.sum.len() / self.columns, self.columns]
    }

    #[inline(always)]
    fn tile<S: Simd, const HEIGHT: usize, const WIDTH: usize>(
        &mut self,
        simd: S,
        row: usize,
        column: usize,
    ) {
        let [rows, columns] = self.shape();
        let mut sums = [[simd.splat_f32s(0.0); WIDTH]; HEIGHT];
        for (left, right) in self
            .left
            .chunks_exact(rows)
            .zip(self.right.chunks_exact(columns))
        {
            let left = &left[row..][..HEIGHT];
            multiply_add(
                simd,
                &mut sums,
                from_fn(|r| left[r]),
                load::<S, WIDTH>(&right[column..]),
            );
        }
        store::<S, HEIGHT, WIDTH>(sums, &mut self.sum[row * columns + column..], columns);
    }
}

/// Sums over the rows of each column.   `rows: [B × columns]` → `sum: [columns]`
struct ColumnSums<'a> {
    rows: &'a [f32],
    sum: &'a mut [f32],
}

impl Tiled for ColumnSums<'_> {
    fn shape(&self) -> [usize; 2] {
        [1, self.sum.len()]
    }

    /// Sums even and odd rows separately, so that an addition need not wait for the one before.
    #[inline(always)]
    fn tile<S: Simd, const HEIGHT: usize, const WIDTH: usize>(
        &mut self,
        simd: S,
        _: usize,
        column: usize,
    ) {
        let columns = self.sum.len();
        let mut sums = [[simd.splat_f32s(0.0); WIDTH]; 2];
        let pairs = self.rows.chunks_exact(2 * columns);
        for row in pairs.remainder().chunks_exact(columns) {
            add(simd, &mut sums[0], load::<S, WIDTH>(&row[column..]));
        }
        for rows in pairs {
            for (row, sums) in sums.iter_mut().enumerate() {
                add(
                    simd,
                    sums,
                    load::<S, WIDTH>(&rows[row * columns + column..]),
                );
            }
        }
        let [mut sum, odd] = sums;
        add(simd, &mut sum, odd);
        store::<S, 1, WIDTH>([sum], &mut self.sum[column..], columns);
    }
}

/// Computes all tiles of a matrix. Tiles of a single row are wider, so that an addition need not
/// wait for the one before.
#[inline(always)]
fn compute_tiles<S: Simd, T: Tiled>(simd: S, work: &mut T) {
    let [rows, columns] = work.shape();
    match (rows, columns / S::F32_LANES) {
        (..4, 4..) => compute_tiles_of_size::<S, T, 1, 4>(simd, work),
        (..4, 2..4) => compute_tiles_of_size::<S, T, 1, 2>(simd, work),
        (..4, ..2) => compute_tiles_of_size::<S, T, 1, 1>(simd, work),
        (4..6, 2..) => compute_tiles_of_size::<S, T, 4, 2>(simd, work),
        (4..6, ..2) => compute_tiles_of_size::<S, T, 4, 1>(simd, work),
        (6.., 2..) => compute_tiles_of_size::<S, T, 6, 2>(simd, work),
        (6.., ..2) => compute_tiles_of_size::<S, T, 6, 1>(simd, work),
    }
}

#[inline(always)]
fn compute_tiles_of_size<S: Simd, T: Tiled, const HEIGHT: usize, const WIDTH: usize>(
    simd: S,
    work: &mut T,
) {
    let [rows, columns] = work.shape();
    // A closure that is passed to an iterator would not be compiled for the SIMD instruction set.
    for column in blocks(columns, WIDTH * S::F32_LANES) {
        for row in blocks(rows, HEIGHT) {
            work.tile::<S, HEIGHT, WIDTH>(simd, row, column);
        }
    }
}

/// Start indices of blocks of `size` that cover `0..length`; the last block overlaps the one before
/// if `size` does not divide `length`.
#[inline(always)]
fn blocks(length: usize, size: usize) -> impl Iterator<Item = usize> {
    (0..length.div_ceil(size)).map(move |index| (index * size).min(length - size))
}

/// For each row r of a tile: sums of row r ← sums of row r + factor of row r · terms.
#[inline(always)]
fn multiply_add<S: Simd, const HEIGHT: usize, const WIDTH: usize>(
    simd: S,
    sums: &mut [[S::f32s; WIDTH]; HEIGHT],
    factors: [f32; HEIGHT],
    terms: [S::f32s; WIDTH],
) {
    for (sums, factor) in sums.iter_mut().zip(&factors) {
        let factor = simd.splat_f32s(*factor);
        for (sum, term) in sums.iter_mut().zip(&terms) {
            *sum = simd.mul_add_e_f32s(factor, *term, *sum);
        }
    }
}

#[inline(always)]
fn add<S: Simd, const WIDTH: usize>(simd: S, sums: &mut [S::f32s; WIDTH], terms: [S::f32s; WIDTH]) {
    for (sum, term) in sums.iter_mut().zip(&terms) {
        *sum = simd.add_f32s(*sum, *term);
    }
}

#[inline(always)]
fn load<S: Simd, const WIDTH: usize>(source: &[f32]) -> [S::f32s; WIDTH] {
    *S::as_simd_f32s(&source[..WIDTH * S::F32_LANES])
        .0
        .first_chunk()
        .expect("the slice has WIDTH vectors")
}

/// Writes a tile to rows that are `stride` numbers apart.
#[inline(always)]
fn store<S: Simd, const HEIGHT: usize, const WIDTH: usize>(
    tile: [[S::f32s; WIDTH]; HEIGHT],
    target: &mut [f32],
    stride: usize,
) {
    for (row, vectors) in tile.iter().enumerate() {
        S::as_mut_simd_f32s(&mut target[row * stride..][..WIDTH * S::F32_LANES])
            .0
            .copy_from_slice(vectors);
    }
}

/// y = x Wᵀ, or x Wᵀ + bias, where `rows` are the rows of W.   `x: [B × n]`,
/// `rows: [columns × n]` → `y: [B × columns]`
#[inline(always)]
fn inner_products<S: Simd>(
    simd: S,
    x: &[f32],
    rows: &[f32],
    bias: Option<&[f32]>,
    y: &mut [f32],
    columns: usize,
) {
    let inner = rows.len() / columns;
    for (x, y) in x.chunks_exact(inner).zip(y.chunks_exact_mut(columns)) {
        for (column, (row, y)) in rows.chunks_exact(inner).zip(y).enumerate() {
            *y = inner_product(simd, x, row) + bias.map_or(0.0, |bias| bias[column]);
        }
    }
}

#[inline(always)]
fn inner_product<S: Simd>(simd: S, a: &[f32], b: &[f32]) -> f32 {
    let ((a, a_rest), (b, b_rest)) = (S::as_simd_f32s(a), S::as_simd_f32s(b));
    let mut sums = simd.splat_f32s(0.0);
    for (a, b) in a.iter().zip(b) {
        sums = simd.mul_add_e_f32s(*a, *b, sums);
    }
    a_rest
        .iter()
        .zip(b_rest)
        .fold(simd.reduce_sum_f32s(sums), |sum, (a, b)| a.mul_add(*b, sum))
}

/// `matrix: [rows × columns]` → `transposed: [columns × rows]`
#[inline(always)]
fn transpose(matrix: &[f32], columns: usize, transposed: &mut [f32]) {
    let rows = matrix.len() / columns;
    for (column, target) in transposed.chunks_exact_mut(rows).enumerate() {
        for (target, number) in target
            .iter_mut()
            .zip(matrix[column..].iter().step_by(columns))
        {
            *target = *number;
        }
    }
}
