//! Tests of unpaired samples, and what many tests at once are worth.

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::aggregate::mean;

/// Welch's test of equal means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Welch {
    /// (x̄ − ȳ) over its standard error.
    pub t: f64,
    /// Degrees of freedom after Welch and Satterthwaite.
    pub degrees: f64,
    /// The two-sided p.
    pub p: f64,
}

/// Welch's t-test, two-sided, for samples of unequal variance, as `scipy.stats.ttest_ind(x, y, equal_var=False)`:
/// t = (x̄ − ȳ) / √(a + b), ν = (a + b)² / (a² / (n − 1) + b² / (m − 1)) with a = s²ₓ / n, b = s²ᵧ / m.   `x: [n]`, `y: [m]`
///
/// `None` where a sample has fewer than two numbers, or both scatter not at all.
#[must_use]
pub fn welch(x: &[f64], y: &[f64]) -> Option<Welch> {
    if x.len() < 2 || y.len() < 2 {
        return None;
    }
    let (a, b) = (variance_of_mean(x), variance_of_mean(y));
    let t = (mean(x) - mean(y)) / (a + b).sqrt();
    let degrees =
        (a + b).powi(2) / (a.powi(2) / (x.len() - 1) as f64 + b.powi(2) / (y.len() - 1) as f64);
    let distribution = StudentsT::new(0.0, 1.0, degrees).ok()?;
    Some(Welch {
        t,
        degrees,
        p: 2.0 * distribution.sf(t.abs()),
    })
}

/// Σ (x − x̄)² / (n (n − 1)).
fn variance_of_mean(sample: &[f64]) -> f64 {
    let centre = mean(sample);
    let squares: f64 = sample.iter().map(|x| (x - centre).powi(2)).sum();
    squares / (sample.len() * (sample.len() - 1)) as f64
}

/// Holm's correction (1979): the p of m tests such that rejecting those below α errs in any of them with probability α at most.
/// From small to large p̃₍ᵢ₎ = max(p̃₍ᵢ₋₁₎, min(1, (m − i + 1) p₍ᵢ₎)).   `p: [m]` → `[m]`, in the same order
#[must_use]
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let mut corrected = vec![0.0; p.len()];
    let mut largest = 0.0_f64;
    for (smaller, index) in order.into_iter().enumerate() {
        largest = largest.max(((p.len() - smaller) as f64 * p[index]).min(1.0));
        corrected[index] = largest;
    }
    corrected
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From small to large 0.01 · 4 = 0.04, 0.02 · 3 = 0.06, then 0.025 · 2 = 0.05 is raised to 0.06, and 0.9 · 1 stays.
    #[test]
    fn corrected_values_never_fall() {
        let corrected = holm(&[0.025, 0.01, 0.9, 0.02]);
        for (corrected, expected) in corrected.iter().zip([0.06, 0.04, 0.9, 0.06]) {
            assert!((corrected - expected).abs() < 1e-15);
        }
        assert_eq!(holm(&[0.7, 0.8]), [1.0, 1.0]);
    }

    /// Means 2 and 6, variances 1 and 4 of three each: a = 1/3, b = 4/3, t = −4 / √(5/3),
    /// ν = (5/3)² / ((1/9) / 2 + (16/9) / 2) = (25/9) / (17/18) = 50/17.
    #[test]
    fn welch_weighs_variances() {
        let test = welch(&[1.0, 2.0, 3.0], &[4.0, 6.0, 8.0]).unwrap();
        assert!((test.t + 4.0 / (5.0_f64 / 3.0).sqrt()).abs() < 1e-12);
        assert!((test.degrees - 50.0 / 17.0).abs() < 1e-12);
    }

    #[test]
    fn samples_that_do_not_scatter_have_no_test() {
        assert_eq!(welch(&[1.0, 1.0], &[2.0, 2.0]), None);
        assert_eq!(welch(&[1.0], &[2.0, 3.0]), None);
    }
}
