//! When a task counts as solved.

use serde::{Deserialize, Serialize};

/// When a task counts as solved: the mean over agents and over a full trailing window of episodes
/// reaches a return.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Threshold {
    /// Mean return to reach.
    pub r#return: f64,
    /// Number of episodes per agent in the window.
    pub window: usize,
}

/// How returns were rounded before they are compared with a threshold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Rounding {
    /// Returns are sums of rewards in single precision, as those of runs of seedbed.
    #[default]
    SingleRewards,
    /// Returns are in single precision, as in event files of TensorBoard.
    SingleReturns,
    /// Returns are in double precision.
    Double,
}

/// Error of sums of numbers in double precision, relative to the mean of their magnitudes: that of
/// 2¹³ additions, or of many more whose errors have random signs.
const ERROR_OF_SUMS: f64 = 1.0 / (1_u64 << 40) as f64;

impl Threshold {
    /// Whether the mean of `returns` reaches the return. Numbers that differ only by the rounding of
    /// what was added up are equal: 100 rewards of 0.01 reach a return of 1.
    ///
    /// This is the only place that compares returns with a threshold.
    #[must_use]
    pub fn is_reached_by(&self, returns: &[f64], rounding: Rounding) -> bool {
        let mean_of = |magnitude: fn(f64) -> f64| {
            let sum: f64 = returns.iter().map(|&value| magnitude(value)).sum();
            sum / returns.len() as f64
        };
        let scale = mean_of(f64::abs).max(self.r#return.abs());
        mean_of(|value| value) >= self.r#return - rounding.error(scale)
    }

    /// Number of values up to the first full window that reaches the return.
    #[must_use]
    pub fn first_window(&self, returns: &[f64], rounding: Rounding) -> Option<usize> {
        let mut windows = returns.windows(self.window.max(1));
        let start = windows.position(|window| self.is_reached_by(window, rounding))?;
        Some(start + self.window.max(1))
    }
}

impl Rounding {
    /// Maximum error of a mean of returns of this magnitude; 0 if it is not finite.
    pub(crate) fn error(self, scale: f64) -> f64 {
        let of_numbers = match self {
            Self::SingleRewards => f64::from(f32::EPSILON) * scale,
            Self::SingleReturns => {
                let single = scale as f32;
                f64::from(single.next_up() - single) / 2.0
            }
            Self::Double => 0.0,
        };
        let error = of_numbers + ERROR_OF_SUMS * scale;
        if error.is_finite() { error } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_reached(threshold: f64, returns: &[f64], rounding: Rounding) -> bool {
        let threshold = Threshold {
            r#return: threshold,
            window: returns.len(),
        };
        threshold.is_reached_by(returns, rounding)
    }

    /// Sums that NumPy gives, one after the other: `sum([0.1] * 10)` = 0.9999999999999999,
    /// `sum([0.7] * 25) / 25` = 0.6999999999999998, `sum([0.1] * 1000)` = 99.9999999999986.
    #[test]
    fn equal_numbers_reach_a_threshold() {
        use Rounding::{Double, SingleReturns, SingleRewards};
        let tenths = (0..10).map(|_| 0.1).sum::<f64>();
        assert!(tenths < 1.0);
        let many_tenths = (0..1000).map(|_| 0.1).sum::<f64>();
        let cases = [
            (1.0, vec![tenths], Double),
            (100.0, vec![many_tenths], Double),
            (0.7, vec![0.7; 25], Double),
            (-0.7, vec![-0.7; 25], Double),
            (0.0, vec![0.3, -0.1, -0.2], Double),
            (1e6 + 0.1, vec![1e6 + 0.1; 7], Double),
            (1e39, vec![1e39; 3], Double),
            (1e-300, vec![1e-300; 3], Double),
            (0.7, vec![f64::from(0.7_f32); 25], SingleReturns),
            (-123.456, vec![f64::from(-123.456_f32); 3], SingleReturns),
            (
                1e6 + 0.1,
                vec![f64::from((1e6 + 0.1) as f32)],
                SingleReturns,
            ),
            (0.5, [0.1_f32, 0.9].map(f64::from).to_vec(), SingleReturns),
            (1.0, vec![100.0 * f64::from(0.01_f32)], SingleRewards),
            (-7.0, vec![-70.0 * f64::from(0.1_f32); 25], SingleRewards),
        ];
        for (threshold, returns, rounding) in cases {
            assert!(
                is_reached(threshold, &returns, rounding),
                "{threshold} {rounding:?} {returns:?}"
            );
        }
    }

    /// The next number of single precision below 1 000 000.1, which is 1 000 000.125 there, is
    /// 1 000 000.0625.
    #[test]
    fn smaller_numbers_do_not_reach_a_threshold() {
        use Rounding::{Double, SingleReturns, SingleRewards};
        let cases = [
            (1.0, vec![1.0 - 1e-11], Double),
            (0.7, vec![f64::from(0.7_f32); 25], Double),
            (1e6 + 0.1, vec![1e6 + 0.099_99], Double),
            (1e6 + 0.02, vec![1e6], Double),
            (0.0, vec![-1e-300], Double),
            (1e39, vec![9.99e38], Double),
            (1e6 + 0.1, vec![1e6 + 0.0625], SingleReturns),
            (0.7, vec![f64::from(0.7_f32.next_down())], SingleReturns),
            (1.0, vec![1.0 - 1e-6], SingleRewards),
            (0.0, vec![f64::NAN], SingleRewards),
        ];
        for (threshold, returns, rounding) in cases {
            assert!(
                !is_reached(threshold, &returns, rounding),
                "{threshold} {rounding:?} {returns:?}"
            );
        }
    }

    #[test]
    fn the_first_full_window_counts() {
        let threshold = Threshold {
            r#return: 4.0,
            window: 2,
        };
        let first = |returns: &[f64]| threshold.first_window(returns, Rounding::Double);
        assert_eq!(first(&[2.0, 3.0, 5.0, 9.0]), Some(3));
        assert_eq!(first(&[9.0]), None);
        assert_eq!(first(&[]), None);
    }
}
