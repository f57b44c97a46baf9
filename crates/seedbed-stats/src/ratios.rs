//! Ratios of means and slopes of logarithms, with intervals by the delta method.
//!
//! Both are sums of logarithms of means: a ratio is exp(ln m₁ − ln m₂), and a slope is a sum with the
//! weights of a least-squares line. The logarithm of a mean m of n runs has the variance
//! Var(x / m) / n to first order, from which the interval follows.
//!
//! ```
//! use seedbed_stats::ratios::ratio_of_means;
//!
//! let (alone, team) = ([40.0, 44.0, 36.0, 42.0, 38.0], [10.0, 11.0, 9.0, 10.0, 10.0]);
//! let speedup = ratio_of_means(&alone, &team, false).unwrap();
//! assert!((speedup.value - 4.0).abs() < 1e-12);
//! assert!(speedup.interval.ends().is_some_and(|[low, high]| low > 3.5 && high < 4.5));
//! ```

use statrs::distribution::{ContinuousCDF, Normal};

use super::aggregate::mean;
use super::{Estimate, Interval};

/// Share of the normal distribution below the upper end of a 95 % interval.
const UPPER_SHARE: f64 = 0.975;

/// Mean of the first sample over the mean of the second. `None` if a mean is not above 0.
///
/// If `paired`, runs with equal indices belong together, and both samples have the same length.
#[must_use]
pub fn ratio_of_means(first: &[f64], second: &[f64], paired: bool) -> Option<Estimate> {
    Some(exponential(weighted_log_means(
        &[first, second],
        &[1.0, -1.0],
        paired,
    )?))
}

/// Mean of a sample, with an interval that is symmetric on a logarithmic axis. `None` if it is not
/// above 0.
#[must_use]
pub fn mean_with_log_interval(sample: &[f64]) -> Option<Estimate> {
    Some(exponential(weighted_log_means(&[sample], &[1.0], false)?))
}

/// Slope of the least-squares line of ln(mean of sample i) over ln(`positions[i]`). `None` with fewer
/// than two different positions, or if a mean is not above 0.
///
/// If `paired`, runs with equal indices belong together, and all samples have the same length.
#[must_use]
pub fn log_log_slope(positions: &[f64], samples: &[&[f64]], paired: bool) -> Option<Estimate> {
    let logarithms: Vec<f64> = positions.iter().map(|position| position.ln()).collect();
    let center = mean(&logarithms);
    let squares: f64 = logarithms.iter().map(|x| (x - center).powi(2)).sum();
    if squares == 0.0 {
        return None;
    }
    let weights: Vec<f64> = logarithms.iter().map(|x| (x - center) / squares).collect();
    weighted_log_means(samples, &weights, paired)
}

/// Σ wᵢ ln(mean of sample i), with its 95 % interval. `None` if a mean is not above 0.
fn weighted_log_means(samples: &[&[f64]], weights: &[f64], paired: bool) -> Option<Estimate> {
    let means: Vec<f64> = samples.iter().map(|sample| mean(sample)).collect();
    if !means.iter().all(|mean| *mean > 0.0 && mean.is_finite()) {
        return None;
    }
    let value = weights.iter().zip(&means).map(|(w, m)| w * m.ln()).sum();
    // d ln m = dm / m: a run x of sample i contributes w x / m.
    let scales = || {
        weights
            .iter()
            .zip(&means)
            .map(|(weight, mean)| weight / mean)
    };
    let variance = if paired {
        let contribution = |run: usize| {
            scales()
                .zip(samples)
                .map(|(s, sample)| s * sample[run])
                .sum()
        };
        let contributions: Vec<f64> = (0..samples[0].len()).map(contribution).collect();
        variance_of_mean(&contributions)
    } else {
        let variances = scales()
            .zip(samples)
            .map(|(s, sample)| s * s * variance_of_mean(sample));
        variances.sum()
    };
    let half_width = Normal::standard().inverse_cdf(UPPER_SHARE) * variance.sqrt();
    let n = samples.iter().map(|sample| sample.len()).min()?;
    Some(Estimate {
        value,
        interval: Interval::of_runs(n, value - half_width, value + half_width),
    })
}

/// Variance of the mean of runs; 0 for a single run, which gets no interval.
fn variance_of_mean(runs: &[f64]) -> f64 {
    let (n, center) = (runs.len() as f64, mean(runs));
    let squares: f64 = runs.iter().map(|run| (run - center).powi(2)).sum();
    squares / (n * (n - 1.0).max(1.0))
}

fn exponential(logarithm: Estimate) -> Estimate {
    let interval = match logarithm.interval {
        Interval::Known { low, high } => Interval::Known {
            low: low.exp(),
            high: high.exp(),
        },
        too_few @ Interval::TooFewRuns { .. } => too_few,
    };
    Estimate {
        value: logarithm.value.exp(),
        interval,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, Exp};

    #[test]
    fn a_ratio_has_the_interval_of_the_delta_method() {
        // Means 2 and 4, variances of the means (4 · ¼ · 2) / (5 · 4) … by hand: squares of
        // [1, 2, 3, 2, 2] about 2 are 2, so the variance of the mean is 2 / 20 = 0.1; twice the
        // numbers give 0.4. Var ln = 0.1 / 4 + 0.4 / 16 = 0.05.
        let (one, other) = ([1.0, 2.0, 3.0, 2.0, 2.0], [2.0, 4.0, 6.0, 4.0, 4.0]);
        let ratio = ratio_of_means(&one, &other, false).unwrap();
        let half_width = 1.959_963_984_540_054 * 0.05_f64.sqrt();
        let [low, high] = ratio.interval.ends().unwrap();
        assert!((ratio.value - 0.5).abs() < 1e-12);
        assert!((low - 0.5 * (-half_width).exp()).abs() < 1e-9, "{low}");
        assert!((high - 0.5 * half_width.exp()).abs() < 1e-9, "{high}");
        // Pairs are proportional, so that their ratio is certain.
        let [low, high] = ratio_of_means(&one, &other, true)
            .unwrap()
            .interval
            .ends()
            .unwrap();
        assert!((high - low).abs() < 1e-9, "{low} to {high}");
    }

    #[test]
    fn a_power_law_has_its_exponent_as_slope() {
        let positions = [1.0, 4.0, 16.0, 64.0];
        let samples = positions.map(|k: f64| vec![12.0 * k.powf(-0.5); 5]);
        let samples: Vec<&[f64]> = samples.iter().map(Vec::as_slice).collect();
        let slope = log_log_slope(&positions, &samples, false).unwrap();
        assert!((slope.value + 0.5).abs() < 1e-12, "{slope:?}");
        assert_eq!(log_log_slope(&[4.0, 4.0], &samples[..2], false), None);
    }

    #[test]
    fn means_that_are_not_above_0_have_no_ratio() {
        assert_eq!(ratio_of_means(&[1.0; 5], &[0.0; 5], false), None);
        assert_eq!(mean_with_log_interval(&[-1.0; 5]), None);
    }

    /// Intervals of the ratio of two means of exponentially distributed runs contain the true ratio
    /// in 95 % of 2,000 samples, up to a Monte-Carlo error of 4 · √(0.05 · 0.95 / 2000) = 0.02 and the
    /// error of the first order with 40 runs.
    #[test]
    fn intervals_contain_the_true_ratio() {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut sample = |mean: f64| -> Vec<f64> {
            let runs = Exp::new(1.0 / mean).unwrap();
            (0..40).map(|_| runs.sample(&mut random)).collect()
        };
        let contains = (0..2000)
            .filter(|_| {
                let ratio = ratio_of_means(&sample(3.0), &sample(1.0), false).unwrap();
                ratio
                    .interval
                    .ends()
                    .is_some_and(|[low, high]| low < 3.0 && 3.0 < high)
            })
            .count();
        let share = contains as f64 / 2000.0;
        assert!((0.92..0.97).contains(&share), "{share}");
    }
}
