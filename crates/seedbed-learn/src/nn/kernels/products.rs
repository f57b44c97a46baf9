//! Products of matrices of all sizes.
//!
//! Sums are computed in tiles that stay in registers: several rows by one or two vectors of
//! columns. If the size of a matrix is not a multiple of the tile's size, the last tile overlaps
//! the one before and computes some numbers a second time, so that all tiles have the same size.
//! Columns of large matrices are copied to a panel, in which a tile reads consecutive memory.
//!
//! The order of all additions is fixed, and products are added by fused multiply-adds (in software
//! if the processor has none), so that the bits are the same for every SIMD instruction set and do
//! not depend on the other rows of a batch. In most products the terms of a number are added one
//! after the other; sums of columns have two partial sums, and products with fewer than [`NARROW`]
//! columns have [`PARTIAL_SUMS`].

use std::array::from_fn;

use pulp::{Simd, WithSimd};

use super::transpose::{transpose, transpose_into};

/// Products with fewer columns than this are computed as inner products of rows.
const NARROW: usize = 8;

/// Number of partial sums of an inner product.
const PARTIAL_SUMS: usize = 8;

/// Matrices with more numbers than this are copied to panels: they do not fit into the first-level
/// cache.
const LARGE: usize = 8192;

/// Buffers of the products, which grow to the size of the largest layer.
#[derive(Clone, Debug, Default)]
pub(in crate::nn) struct Scratch {
    /// A transposed matrix.
    transposed: Vec<f32>,
    /// Some columns of a large matrix, or all columns of a narrow one and zeros.
    panel: Vec<f32>,
}

/// y = x W + b.   `x: [B × in]`, `weight: [in × out]`, `bias: [out]` → `y: [B × out]`
pub(super) struct Affine<'a> {
    pub(super) weight: &'a [f32],
    pub(super) bias: &'a [f32],
    pub(super) x: &'a [f32],
    pub(super) y: &'a mut [f32],
    pub(super) scratch: &'a mut Scratch,
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
        if outputs < NARROW {
            transpose(weight, outputs, &mut scratch.transposed);
            inner_products(simd, x, &scratch.transposed, Some(bias), y, outputs);
        } else {
            let product = RowsTimesMatrix {
                x,
                inner: weight.len() / outputs,
                matrix: weight,
                bias: Some(bias),
                y,
                columns: outputs,
            };
            compute(simd, product, &mut scratch.panel);
        }
    }
}

/// ∂L/∂x = ∂L/∂y Wᵀ.   `weight: [in × out]`, `dy: [B × out]` → `dx: [B × in]`
pub(super) struct InputGradient<'a> {
    pub(super) weight: &'a [f32],
    pub(super) dy: &'a [f32],
    pub(super) dx: &'a mut [f32],
    pub(super) outputs: usize,
    pub(super) scratch: &'a mut Scratch,
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
        if inputs < NARROW {
            inner_products(simd, dy, weight, None, dx, inputs);
        } else {
            transpose(weight, outputs, &mut scratch.transposed);
            let product = RowsTimesMatrix {
                x: dy,
                inner: outputs,
                matrix: &scratch.transposed,
                bias: None,
                y: dx,
                columns: inputs,
            };
            compute(simd, product, &mut scratch.panel);
        }
    }
}

/// ∂L/∂W = xᵀ ∂L/∂y.   `x: [B × in]`, `dy: [B × out]` → `dw: [in × out]`
pub(super) struct WeightGradient<'a> {
    pub(super) x: &'a [f32],
    pub(super) dy: &'a [f32],
    pub(super) dw: &'a mut [f32],
    pub(super) outputs: usize,
    pub(super) scratch: &'a mut Scratch,
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
        if outputs >= S::F32_LANES || inputs < S::F32_LANES {
            let product = OuterProducts {
                left: x,
                right: dy,
                sum: dw,
                columns: outputs,
            };
            compute(simd, product, &mut scratch.panel);
        } else {
            let mut transposed = std::mem::take(&mut scratch.transposed);
            transposed.resize(dw.len(), 0.0);
            let product = OuterProducts {
                left: dy,
                right: x,
                sum: &mut transposed,
                columns: inputs,
            };
            compute(simd, product, &mut scratch.panel);
            transpose_into(&transposed, inputs, dw);
            scratch.transposed = transposed;
        }
    }
}

/// ∂L/∂b = Σ ∂L/∂y, over the batch.   `dy: [B × out]` → `db: [out]`
pub(super) struct BiasGradient<'a> {
    pub(super) dy: &'a [f32],
    pub(super) db: &'a mut [f32],
    pub(super) scratch: &'a mut Scratch,
}

impl WithSimd for BiasGradient<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let product = ColumnSums {
            rows: self.dy,
            sum: self.db,
        };
        compute(simd, product, &mut self.scratch.panel);
    }
}

/// A product that is computed tile by tile.
trait Product<'a> {
    /// Number of rows and of columns of the result.
    fn shape(&self) -> [usize; 2];

    /// The operand whose columns belong to the columns of the result: `[n × columns]`.
    fn matrix(&self) -> &'a [f32];

    /// Computes the tile of `HEIGHT` rows by `WIDTH` vectors of columns that starts at `row` and
    /// `column`. `terms` are these columns of the [matrix](Self::matrix).
    fn tile<S: Simd, const HEIGHT: usize, const WIDTH: usize>(
        &mut self,
        simd: S,
        row: usize,
        column: usize,
        terms: Columns<'_>,
    );
}

/// Some consecutive columns of a matrix.
#[derive(Clone, Copy)]
struct Columns<'a> {
    /// The whole matrix, or a panel.
    numbers: &'a [f32],
    /// Number of columns of the whole matrix, or of the panel.
    stride: usize,
    /// The first of the columns.
    first: usize,
}

/// y = x M, plus `bias` in every row if there is one.   `x: [B × n]`, `matrix: [n × columns]`,
/// `bias: [columns]` → `y: [B × columns]`
struct RowsTimesMatrix<'a> {
    x: &'a [f32],
    /// The number n.
    inner: usize,
    matrix: &'a [f32],
    bias: Option<&'a [f32]>,
    y: &'a mut [f32],
    columns: usize,
}

impl<'a> Product<'a> for RowsTimesMatrix<'a> {
    fn shape(&self) -> [usize; 2] {
        [self.y.len() / self.columns, self.columns]
    }

    fn matrix(&self) -> &'a [f32] {
        self.matrix
    }

    #[inline(always)]
    fn tile<S: Simd, const HEIGHT: usize, const WIDTH: usize>(
        &mut self,
        simd: S,
        row: usize,
        column: usize,
        terms: Columns<'_>,
    ) {
        let inner = self.inner;
        let mut x = [&self.x[..inner]; HEIGHT];
        for (x, row) in x.iter_mut().zip(self.x[row * inner..].chunks_exact(inner)) {
            *x = row;
        }
        let initial = self.bias.map_or([simd.splat_f32s(0.0); WIDTH], |bias| {
            load_any(simd, &bias[column..])
        });
        let mut sums = [initial; HEIGHT];
        for (terms_row, index) in terms.numbers.chunks_exact(terms.stride).zip(0..inner) {
            let factors = from_fn(|r| x[r][index]);
            multiply_add(
                simd,
                &mut sums,
                factors,
                load::<S, WIDTH>(&terms_row[terms.first..]),
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

impl<'a> Product<'a> for OuterProducts<'a> {
    fn shape(&self) -> [usize; 2] {
        [self.sum.len() / self.columns, self.columns]
    }

    fn matrix(&self) -> &'a [f32] {
        self.right
    }

    #[inline(always)]
    fn tile<S: Simd, const HEIGHT: usize, const WIDTH: usize>(
        &mut self,
        simd: S,
        row: usize,
        column: usize,
        terms: Columns<'_>,
    ) {
        let [rows, columns] = self.shape();
        let mut sums = [[simd.splat_f32s(0.0); WIDTH]; HEIGHT];
        let rights = terms.numbers.chunks_exact(terms.stride);
        for (left, right) in self.left.chunks_exact(rows).zip(rights) {
            let left = &left[row..][..HEIGHT];
            let factors = from_fn(|r| left[r]);
            multiply_add(
                simd,
                &mut sums,
                factors,
                load::<S, WIDTH>(&right[terms.first..]),
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

impl<'a> Product<'a> for ColumnSums<'a> {
    fn shape(&self) -> [usize; 2] {
        [1, self.sum.len()]
    }

    fn matrix(&self) -> &'a [f32] {
        self.rows
    }

    /// Sums even and odd rows separately, so that an addition need not wait for the one before.
    #[inline(always)]
    fn tile<S: Simd, const HEIGHT: usize, const WIDTH: usize>(
        &mut self,
        simd: S,
        _: usize,
        column: usize,
        terms: Columns<'_>,
    ) {
        let columns = self.sum.len();
        let mut sums = [[simd.splat_f32s(0.0); WIDTH]; 2];
        let pairs = terms.numbers.chunks_exact(2 * terms.stride);
        let last = pairs.remainder();
        for rows in pairs {
            let (even, odd) = rows.split_at(terms.stride);
            add(simd, &mut sums[0], load::<S, WIDTH>(&even[terms.first..]));
            add(simd, &mut sums[1], load::<S, WIDTH>(&odd[terms.first..]));
        }
        if !last.is_empty() {
            add(simd, &mut sums[0], load::<S, WIDTH>(&last[terms.first..]));
        }
        let [mut sum, odd] = sums;
        add(simd, &mut sum, odd);
        store::<S, 1, WIDTH>([sum], &mut self.sum[column..], columns);
    }
}

/// Computes all tiles of a product. Tiles of a single row are wider, so that an addition need not
/// wait for the one before; so are those of a single vector higher.
#[inline(always)]
fn compute<'a, S: Simd, P: Product<'a>>(simd: S, mut product: P, panel: &mut Vec<f32>) {
    let [rows, columns] = product.shape();
    let product = &mut product;
    match (rows, columns / S::F32_LANES) {
        (..4, 4..) => compute_tiles::<S, P, 1, 4>(simd, product, panel),
        (..4, 2..4) => compute_tiles::<S, P, 1, 2>(simd, product, panel),
        (..4, ..2) => compute_tiles::<S, P, 1, 1>(simd, product, panel),
        (4..8, ..2) => compute_tiles::<S, P, 4, 1>(simd, product, panel),
        (8.., ..2) => compute_tiles::<S, P, 8, 1>(simd, product, panel),
        (4.., 2..) => match tile_height(rows) {
            4 => compute_tiles::<S, P, 4, 2>(simd, product, panel),
            5 => compute_tiles::<S, P, 5, 2>(simd, product, panel),
            _ => compute_tiles::<S, P, 6, 2>(simd, product, panel),
        },
    }
}

/// The number of rows of a tile for which a product takes the least time, if each row of a tile
/// takes two units and its other work five.
fn tile_height(rows: usize) -> usize {
    let duration = |height: &usize| rows.div_ceil(*height) * (2 * height + 5);
    let candidates = [6, 5, 4].into_iter().filter(|height| *height <= rows);
    candidates.min_by_key(duration).unwrap_or(4)
}

#[inline(always)]
fn compute_tiles<'a, S: Simd, P: Product<'a>, const HEIGHT: usize, const WIDTH: usize>(
    simd: S,
    product: &mut P,
    panel: &mut Vec<f32>,
) {
    let [rows, columns] = product.shape();
    let matrix = product.matrix();
    let width = WIDTH * S::F32_LANES;
    let needs_panel = columns < width || (matrix.len() > LARGE && rows > 2 * HEIGHT);
    // A closure that is passed to an iterator would not be compiled for the SIMD instruction set.
    for column in blocks(columns, width) {
        let terms = if needs_panel {
            copy_columns(matrix, columns, column, width, panel);
            Columns {
                numbers: &*panel,
                stride: width,
                first: 0,
            }
        } else {
            Columns {
                numbers: matrix,
                stride: columns,
                first: column,
            }
        };
        for row in blocks(rows, HEIGHT) {
            product.tile::<S, HEIGHT, WIDTH>(simd, row, column, terms);
        }
    }
}

/// Copies `width` columns of a matrix, from `column` on, or all and zeros if it has fewer:
/// `[n × columns]` → `panel: [n × width]`
#[inline(always)]
fn copy_columns(matrix: &[f32], columns: usize, column: usize, width: usize, panel: &mut Vec<f32>) {
    let count = width.min(columns);
    panel.clear();
    panel.resize(matrix.len() / columns * width, 0.0);
    for (target, row) in panel
        .chunks_exact_mut(width)
        .zip(matrix.chunks_exact(columns))
    {
        for (target, number) in target[..count].iter_mut().zip(&row[column..]) {
            *target = *number;
        }
    }
}

/// Start indices of blocks of `size` that cover `0..length`; the last block overlaps the one before
/// if `size` does not divide `length`.
#[inline(always)]
fn blocks(length: usize, size: usize) -> impl Iterator<Item = usize> {
    (0..length.div_ceil(size)).map(move |index| (index * size).min(length.saturating_sub(size)))
}

/// sums of row r ← sums of row r + factor of row r · terms
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
            *sum = simd.mul_add_f32s(factor, *term, *sum);
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

/// The same, with zeros in place of what the slice lacks.
#[inline(always)]
fn load_any<S: Simd, const WIDTH: usize>(simd: S, source: &[f32]) -> [S::f32s; WIDTH] {
    if WIDTH == 1 && source.len() < S::F32_LANES {
        [simd.partial_load_f32s(source); WIDTH]
    } else {
        load::<S, WIDTH>(source)
    }
}

/// Writes a tile to rows that are `stride` numbers apart; of a single vector, at most `stride`
/// numbers.
#[inline(always)]
fn store<S: Simd, const HEIGHT: usize, const WIDTH: usize>(
    tile: [[S::f32s; WIDTH]; HEIGHT],
    target: &mut [f32],
    stride: usize,
) {
    for (row, vectors) in tile.iter().enumerate() {
        let target = &mut target[row * stride..];
        if WIDTH == 1 && stride < S::F32_LANES {
            let lanes: &[f32] = pulp::bytemuck::cast_slice(vectors);
            for (target, number) in target[..stride].iter_mut().zip(lanes) {
                *target = *number;
            }
        } else {
            S::as_mut_simd_f32s(&mut target[..WIDTH * S::F32_LANES])
                .0
                .copy_from_slice(vectors);
        }
    }
}

/// y = x Rᵀ, or x Rᵀ + bias.   `x: [B × n]`, `rows: [columns × n]` → `y: [B × columns]`
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

/// The inner product of two vectors. Partial sum p has the terms p, p + 8, p + 16, … of as many
/// terms as are a multiple of 8; the others are added to the sum of the partial sums.
#[inline(always)]
fn inner_product<S: Simd>(simd: S, a: &[f32], b: &[f32]) -> f32 {
    let (a_terms, a_rest) = a.as_chunks::<PARTIAL_SUMS>();
    let (b_terms, b_rest) = b.as_chunks::<PARTIAL_SUMS>();
    let mut sum = if S::F32_LANES == PARTIAL_SUMS {
        let mut sums = simd.splat_f32s(0.0);
        for (a, b) in S::as_simd_f32s(a).0.iter().zip(S::as_simd_f32s(b).0) {
            sums = simd.mul_add_f32s(*a, *b, sums);
        }
        simd.reduce_sum_f32s(sums)
    } else {
        partial_sums(a_terms, b_terms)
    };
    for (a, b) in a_rest.iter().zip(b_rest) {
        sum = a.mul_add(*b, sum);
    }
    sum
}

/// The sum of the partial sums, in the order in which the vectors of eight lanes are summed.
#[inline(always)]
fn partial_sums(a: &[[f32; PARTIAL_SUMS]], b: &[[f32; PARTIAL_SUMS]]) -> f32 {
    let mut sums = [0.0_f32; PARTIAL_SUMS];
    for (a, b) in a.iter().zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum = a.mul_add(*b, *sum);
        }
    }
    let [s0, s1, s2, s3, s4, s5, s6, s7] = sums;
    ((s0 + s4) + (s2 + s6)) + ((s1 + s5) + (s3 + s7))
}
