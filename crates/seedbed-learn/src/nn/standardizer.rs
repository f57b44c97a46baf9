//! Running mean and variance of rows of numbers, merged batch by batch in double precision (Chan,
//! Golub & LeVeque 1979).

use serde::{Deserialize, Serialize};

/// Mean and variance of each column over all rows so far. Before the first update, a standardizer
/// does not change rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Standardizer {
    /// Number of rows n so far.
    count: u64,
    /// Mean μ of each column: `[width]`.
    mean: Vec<f64>,
    /// M₂ = Σ (x − μ)² of each column: `[width]`.
    squares: Vec<f64>,
}

/// Maximal absolute value of standardized numbers, to which outliers are clamped.
pub const STANDARDIZED_LIMIT: f64 = 10.0;

/// Minimal standard deviation, which keeps σ⁻¹ finite.
const MIN_DEVIATION: f64 = 1e-4;

impl Standardizer {
    /// A standardizer of rows of `width` numbers, without any rows so far.
    ///
    /// # Panics
    /// If `width` is 0.
    #[must_use]
    pub fn new(width: usize) -> Self {
        assert!(width > 0, "width must be positive");
        Self {
            count: 0,
            mean: vec![0.0; width],
            squares: vec![0.0; width],
        }
    }

    /// Merges the moments of a batch b into the moments a of earlier rows. For each column, with δ
    /// = `μ_b` − `μ_a`: n = `n_a` + `n_b`, μ = `μ_a` + δ `n_b`/n, M₂ = `M₂_a` + `M₂_b` + δ² `n_a`
    /// `n_b`/n. `rows: [B × width]`
    ///
    /// # Panics
    /// If the length of `rows` is not a multiple of the width.
    pub fn update(&mut self, rows: &[f32]) {
        let width = self.width();
        assert_eq!(rows.len() % width, 0, "rows must have {width} numbers");
        let (earlier, batch) = (self.count as f64, (rows.len() / width) as f64);
        if rows.is_empty() {
            return;
        }
        for (column, (mean, squares)) in self.mean.iter_mut().zip(&mut self.squares).enumerate() {
            let numbers = || rows[column..].iter().step_by(width).map(|&x| f64::from(x));
            let batch_mean = numbers().sum::<f64>() / batch;
            let batch_squares: f64 = numbers().map(|x| (x - batch_mean).powi(2)).sum();
            let delta = batch_mean - *mean;
            *mean += delta * batch / (earlier + batch);
            *squares += batch_squares + delta * delta * earlier * batch / (earlier + batch);
        }
        self.count += (rows.len() / width) as u64;
    }

    /// Standardizes rows: (x − μ)/σ, clamped to ±10.   `rows: [B × width]` → `standardized: [B ×
    /// width]`, overwritten
    ///
    /// # Panics
    /// If the length of `rows` is not a multiple of the width.
    pub fn apply(&self, rows: &[f32], standardized: &mut Vec<f32>) {
        self.map_columns(rows, standardized, |column| {
            (self.mean[column], self.exact_deviation(column))
        });
    }

    /// Scales rows without shifting them: x/RMS, clamped to ±10.
    /// `rows: [B × width]` → `scaled: [B × width]`, overwritten
    ///
    /// # Panics
    /// If the length of `rows` is not a multiple of the width.
    pub fn apply_scale(&self, rows: &[f32], scaled: &mut Vec<f32>) {
        self.map_columns(rows, scaled, |column| {
            (0.0, self.exact_root_mean_square(column))
        });
    }

    /// Mean μ of each column; 0 before the first update.
    pub fn mean(&self) -> impl Iterator<Item = f32> {
        self.mean.iter().map(|&mean| mean as f32)
    }

    /// Standard deviation σ = √(M₂/n) of each column, but at least 10⁻⁴; 1 before the first update.
    pub fn deviation(&self) -> impl Iterator<Item = f32> {
        (0..self.width()).map(|column| self.exact_deviation(column) as f32)
    }

    /// Root mean square √(Σ x²/n) = √(μ² + M₂/n) of each column, but at least 10⁻⁴; 1 before the
    /// first update.
    pub fn root_mean_square(&self) -> impl Iterator<Item = f32> {
        (0..self.width()).map(|column| self.exact_root_mean_square(column) as f32)
    }

    /// Number of columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.mean.len()
    }

    /// Whether all moments are those of `width` columns, also if they were read from a file.
    #[must_use]
    pub fn has_width(&self, width: usize) -> bool {
        self.mean.len() == width && self.squares.len() == width
    }

    /// Transforms each column by (x − shift)/scale, clamped to ±10.
    fn map_columns(
        &self,
        rows: &[f32],
        out: &mut Vec<f32>,
        shift_and_scale: impl Fn(usize) -> (f64, f64),
    ) {
        let width = self.width();
        assert_eq!(rows.len() % width, 0, "rows must have {width} numbers");
        out.clear();
        out.extend_from_slice(rows);
        if self.count == 0 || rows.is_empty() {
            return;
        }
        for column in 0..width {
            let (shift, scale) = shift_and_scale(column);
            for x in out[column..].iter_mut().step_by(width) {
                *x = ((f64::from(*x) - shift) / scale)
                    .clamp(-STANDARDIZED_LIMIT, STANDARDIZED_LIMIT) as f32;
            }
        }
    }

    fn exact_deviation(&self, column: usize) -> f64 {
        self.root_mean_square_with_minimum(self.squares[column], 0.0)
    }

    fn exact_root_mean_square(&self, column: usize) -> f64 {
        self.root_mean_square_with_minimum(self.squares[column], self.mean[column])
    }

    /// √(squares/n + center²), but at least 10⁻⁴.
    fn root_mean_square_with_minimum(&self, squares: f64, center: f64) -> f64 {
        if self.count == 0 {
            return 1.0;
        }
        (squares / self.count as f64 + center * center)
            .sqrt()
            .max(MIN_DEVIATION)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn standardized(standardizer: &Standardizer, rows: &[f32]) -> Vec<f32> {
        let mut out = vec![f32::NAN; 3];
        standardizer.apply(rows, &mut out);
        out
    }

    /// Columns {1, 3, 5, 7} and {2, 2, 2, 2}: μ = 4, 2; σ² = (9 + 1 + 1 + 9)/4 = 5; RMS² = 84/4 =
    /// 21, 4.
    #[test]
    fn moments_by_hand() {
        let mut standardizer = Standardizer::new(2);
        standardizer.update(&[1.0, 2.0, 3.0, 2.0]);
        standardizer.update(&[5.0, 2.0, 7.0, 2.0]);
        assert_eq!(standardizer.mean().collect::<Vec<_>>(), [4.0, 2.0]);
        assert_eq!(
            standardizer.deviation().collect::<Vec<_>>(),
            [5.0_f32.sqrt(), 1e-4]
        );
        assert_eq!(
            standardizer.root_mean_square().collect::<Vec<_>>(),
            [21.0_f32.sqrt(), 2.0]
        );
        assert_eq!(
            standardized(&standardizer, &[9.0, 2.0]),
            [5.0_f32.sqrt(), 0.0]
        );
        let mut scaled = Vec::new();
        standardizer.apply_scale(&[-42.0, 1.0], &mut scaled);
        assert_eq!(scaled, [-(84.0_f32.sqrt()), 0.5]);
    }

    #[test]
    fn a_new_standardizer_is_the_identity() {
        let mut standardizer = Standardizer::new(2);
        standardizer.update(&[]);
        assert_eq!(standardized(&standardizer, &[3.0, -400.0]), [3.0, -400.0]);
        assert_eq!(
            standardizer
                .deviation()
                .chain(standardizer.root_mean_square())
                .collect::<Vec<_>>(),
            [1.0; 4]
        );
    }

    /// A number that differs from a constant column by a part in 10⁷ becomes about 0.1, because of
    /// the minimal deviation; numbers that differ much are clamped.
    #[test]
    fn constant_columns_and_outliers_stay_within_bounds() {
        let mut standardizer = Standardizer::new(1);
        standardizer.update(&[100.0; 50]);
        let near = standardized(&standardizer, &[100.000_01])[0];
        assert!(near.abs() < 0.2, "{near}");
        assert_eq!(standardized(&standardizer, &[1e30, -1e30]), [10.0, -10.0]);
    }

    proptest! {
        /// Moments do not depend on how rows are split into batches, even if the mean is 10⁴ times
        /// the deviation.
        #[test]
        fn moments_do_not_depend_on_batches(
            rows in prop::collection::vec((-1.0_f32..1.0, 9_999.0_f32..10_001.0), 2..80), cut in 0..80_usize,
        ) {
            let numbers: Vec<f32> = rows.iter().flat_map(|&(a, b)| [a, b]).collect();
            let (mut one_batch, mut two_batches) = (Standardizer::new(2), Standardizer::new(2));
            one_batch.update(&numbers);
            let (first, second) = numbers.split_at(2 * cut.min(rows.len()));
            two_batches.update(first);
            two_batches.update(second);
            for (a, b) in one_batch.squares.iter().zip(&two_batches.squares) {
                prop_assert!((a - b).abs() <= 1e-9 * (1.0 + a), "{a} {b}");
            }
            let variance = rows.iter().map(|row| (f64::from(row.1) - one_batch.mean[1]).powi(2)).sum::<f64>() / rows.len() as f64;
            prop_assert!((two_batches.exact_deviation(1) - variance.sqrt().max(1e-4)).abs() < 1e-6);
        }
    }
}
