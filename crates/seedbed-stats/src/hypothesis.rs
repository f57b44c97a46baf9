//! Welch's t-test of two unpaired samples, and Holm's correction for many tests.
//!
//! ```
//! use seedbed_stats::hypothesis::{holm_correction, welch_test};
//!
//! let test = welch_test(&[1.0, 2.0, 3.0], &[4.0, 6.0, 8.0]).expect("samples that vary");
//! assert!(test.t < 0.0 && test.p < 0.1);
//!
//! // Of four tests, the smallest p-value is multiplied by four.
//! assert_eq!(holm_correction(&[0.5, 0.01, 0.9, 0.5])[1], 0.04);
//! ```

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::aggregate::mean;

/// Result of Welch's test of equal means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WelchTest {
    /// Test statistic: (x̄ − ȳ) over its standard error.
    pub t: f64,
    /// Degrees of freedom after Welch and Satterthwaite.
    pub degrees_of_freedom: f64,
    /// Two-sided p-value.
    pub p: f64,
}

/// Welch's t-test, two-sided, for samples of unequal variance.   `x: [n]`, `y: [m]`
///
/// Equals `scipy.stats.ttest_ind(x, y, equal_var=False)`: t = (x̄ − ȳ) / √(a + b) with
/// ν = (a + b)² / (a² / (n − 1) + b² / (m − 1)) degrees of freedom, where a = s²ₓ / n and
/// b = s²ᵧ / m.
///
/// `None` if a sample has fewer than two numbers, or if neither sample varies.
#[must_use]
pub fn welch_test(x: &[f64], y: &[f64]) -> Option<WelchTest> {
    if x.len() < 2 || y.len() < 2 {
        return None;
    }
    let (a, b) = (variance_of_mean(x), variance_of_mean(y));
    let t = (mean(x) - mean(y)) / (a + b).sqrt();
    let degrees_of_freedom =
        (a + b).powi(2) / (a.powi(2) / (x.len() - 1) as f64 + b.powi(2) / (y.len() - 1) as f64);
    let distribution = StudentsT::new(0.0, 1.0, degrees_of_freedom).ok()?;
    Some(WelchTest {
        t,
        degrees_of_freedom,
        p: 2.0 * distribution.sf(t.abs()),
    })
}

/// Squared standard error of the mean: Σ (x − x̄)² / (n (n − 1)).
fn variance_of_mean(sample: &[f64]) -> f64 {
    let sample_mean = mean(sample);
    let squared_deviations: f64 = sample.iter().map(|x| (x - sample_mean).powi(2)).sum();
    squared_deviations / (sample.len() * (sample.len() - 1)) as f64
}

/// Holm's correction (1979) of the p-values of m tests.   `p: [m]` → `[m]`, in the same order
///
/// If all tests with a corrected p-value below α are rejected, the probability of any false
/// rejection is at most α. For p-values in ascending order,
/// p̃₍ᵢ₎ = max(p̃₍ᵢ₋₁₎, min(1, (m − i + 1) p₍ᵢ₎)). Equals
/// `statsmodels.stats.multitest.multipletests(p, method="holm")`.
#[must_use]
pub fn holm_correction(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let mut corrected = vec![0.0; p.len()];
    let mut largest_so_far = 0.0_f64;
    for (smaller_count, index) in order.into_iter().enumerate() {
        // The running maximum keeps corrected p-values in the order of the uncorrected ones.
        largest_so_far = largest_so_far.max(((p.len() - smaller_count) as f64 * p[index]).min(1.0));
        corrected[index] = largest_so_far;
    }
    corrected
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In ascending order: 0.01 · 4 = 0.04, 0.02 · 3 = 0.06, 0.025 · 2 = 0.05, which is raised to
    /// 0.06, and 0.9 · 1 = 0.9.
    #[test]
    fn corrected_p_values_keep_their_order() {
        let corrected = holm_correction(&[0.025, 0.01, 0.9, 0.02]);
        for (corrected, expected) in corrected.iter().zip([0.06, 0.04, 0.9, 0.06]) {
            assert!((corrected - expected).abs() < 1e-15);
        }
        assert_eq!(holm_correction(&[0.7, 0.8]), [1.0, 1.0]);
    }

    /// Two samples of three with means 2 and 6 and variances 1 and 4: a = 1/3, b = 4/3,
    /// t = −4 / √(5/3), ν = (5/3)² / ((1/9) / 2 + (16/9) / 2) = (25/9) / (17/18) = 50/17.
    #[test]
    fn the_welch_test_equals_values_derived_by_hand() {
        let test = welch_test(&[1.0, 2.0, 3.0], &[4.0, 6.0, 8.0]).unwrap();
        assert!((test.t + 4.0 / (5.0_f64 / 3.0).sqrt()).abs() < 1e-12);
        assert!((test.degrees_of_freedom - 50.0 / 17.0).abs() < 1e-12);
    }

    #[test]
    fn constant_samples_and_single_numbers_have_no_welch_test() {
        assert_eq!(welch_test(&[1.0, 1.0], &[2.0, 2.0]), None);
        assert_eq!(welch_test(&[1.0], &[2.0, 3.0]), None);
    }
}
