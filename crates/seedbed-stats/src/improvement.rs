//! Win probability: probability that a run of one algorithm has a higher score than a run of
//! another (Mann–Whitney's U over the number of pairs; in Agarwal et al. 2021, §4.3, the probability
//! of improvement).
//!
//! ```
//! use seedbed_stats::improvement::win_probability;
//!
//! // 3 is above both scores of y; 2 is above 1 and equal to 2, which counts half.
//! assert_eq!(win_probability(&[3.0, 2.0], &[1.0, 2.0]).value, 3.5 / 4.0);
//! ```

use statrs::distribution::{ContinuousCDF, Normal};

use super::aggregate::sorted;
use super::effect_test::bisect;
use super::{Estimate, Interval};

/// P(X > Y) with its 95 % interval. A tie counts half.   `x: [n]`, `y: [m]`
///
/// The interval is Newcombe's (2006, method 5): all θ with |θ̂ − θ| ≤ 1.96 √V(θ), where V(θ) is the
/// variance if both scores are exponential,
/// V(θ) = θ (1 − θ) (1 + ((n + m)/2 − 1) ((1 − θ)/(2 − θ) + θ/(1 + θ))) / (n m).
/// At θ = ½ it is the variance of the Mann–Whitney test, (n + m + 1) / (12 n m). Unlike bootstrap
/// intervals it has a width if all scores of x are above those of y.
///
/// Higher scores count as better. If lower scores are better, exchange `x` and `y`.
///
/// # Panics
/// If a sample is empty.
#[must_use]
pub fn win_probability(x: &[f64], y: &[f64]) -> Estimate {
    let value = share_of_wins(x, y);
    let (n, m) = (x.len() as f64, y.len() as f64);
    let z = Normal::standard().inverse_cdf(0.975);
    let is_excluded = |theta: f64| (value - theta).abs() > z * variance(theta, n, m).sqrt();
    let end = |limit: f64| {
        if is_excluded(limit) {
            bisect(value, limit, is_excluded)
        } else {
            limit
        }
    };
    Estimate {
        value,
        interval: Interval::of_runs(x.len().min(y.len()), end(0.0), end(1.0)),
    }
}

fn variance(theta: f64, n: f64, m: f64) -> f64 {
    let correlation = (1.0 - theta) / (2.0 - theta) + theta / (1.0 + theta);
    theta * (1.0 - theta) * (1.0 + (f64::midpoint(n, m) - 1.0) * correlation) / (n * m)
}

/// Share of pairs (x, y) with x > y, a tie counting half. Scores of y are sorted once instead of
/// comparing n m pairs.
fn share_of_wins(x: &[f64], y: &[f64]) -> f64 {
    let y = sorted(y);
    let half_wins_of = |x: &f64| y.partition_point(|y| y < x) + y.partition_point(|y| y <= x);
    let half_wins: usize = x.iter().map(half_wins_of).sum();
    half_wins as f64 / (2 * x.len() * y.len()) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The definition: the share of wins among all pairs, a tie counting half.
    fn share_of_pairs(x: &[f64], y: &[f64]) -> f64 {
        let pairs = x.iter().flat_map(|x| y.iter().map(move |y| (x, y)));
        let half_wins = pairs.map(|(x, y)| u32::from(x > y) + u32::from(x >= y));
        f64::from(half_wins.sum::<u32>()) / (2 * x.len() * y.len()) as f64
    }

    #[test]
    fn wins_are_counted_as_over_all_pairs() {
        let scores = |n: u32, factor: u32| -> Vec<f64> {
            (0..n)
                .map(|run| f64::from(run * run * factor % 13) / 3.0 - 1.0)
                .collect()
        };
        let infinite = [
            f64::INFINITY,
            1.0,
            f64::NEG_INFINITY,
            0.0,
            -0.0,
            f64::INFINITY,
        ];
        for (x, y) in [
            (scores(9, 5), scores(14, 7)),
            (scores(6, 3), infinite.to_vec()),
        ] {
            assert_eq!(win_probability(&x, &y).value, share_of_pairs(&x, &y));
        }
    }

    /// At θ = ½ the variance is (n + m + 1) / (12 n m): 26 / (12 · 10 · 15).
    #[test]
    fn without_difference_the_variance_is_that_of_the_rank_test() {
        assert!((variance(0.5, 10.0, 15.0) - 26.0 / 1800.0).abs() < 1e-15);
    }

    /// All of x are above all of y: the interval ends at 1 and has a width. An end θ fulfills
    /// (1 − θ)² = 1.96² V(θ).
    #[test]
    fn separated_samples_have_an_interval_with_a_width() {
        let (x, y): (Vec<f64>, Vec<f64>) = (
            (10..20).map(f64::from).collect(),
            (0..10).map(f64::from).collect(),
        );
        let [low, high] = win_probability(&x, &y).interval.ends().unwrap();
        let z = Normal::standard().inverse_cdf(0.975);
        assert!(((1.0 - low) - z * variance(low, 10.0, 10.0).sqrt()).abs() < 1e-9);
        assert!(high == 1.0 && (0.6..0.9).contains(&low), "{low}");
    }

    /// P(X > Y) and P(Y > X) are mirror images.
    #[test]
    fn exchanged_samples_have_the_mirrored_interval() {
        let (x, y) = ([1.0, 4.0, 5.0, 9.0, 9.5], [2.0, 3.0, 4.0, 6.0, 7.0, 8.0]);
        let [wins, losses] = [win_probability(&x, &y), win_probability(&y, &x)];
        let ([low, high], mirrored) = (
            wins.interval.ends().unwrap(),
            losses.interval.ends().unwrap(),
        );
        assert!((wins.value + losses.value - 1.0).abs() < 1e-15);
        assert!((low + mirrored[1] - 1.0).abs() < 1e-9 && (high + mirrored[0] - 1.0).abs() < 1e-9);
    }
}
