//! How likely a run of one algorithm beats a run of another (Agarwal et al. 2021, §4.3).

use super::{Estimate, estimate};

/// P(X > Y), averaged over tasks, with the interval of redrawing the runs of both.   `x: [task][run]`, `y: [task][run]`
///
/// # Panics
/// If the tasks differ in number, or one has no runs.
#[must_use]
pub fn probability_of_improvement(x: &[Vec<f64>], y: &[Vec<f64>]) -> Estimate {
    assert_eq!(x.len(), y.len());
    let both = [x, y].concat();
    estimate(&both, |both| {
        let (x, y) = both.split_at(x.len());
        x.iter()
            .zip(y)
            .map(|(x, y)| share_of_wins(x, y))
            .sum::<f64>()
            / x.len() as f64
    })
}

/// The share of pairs (x, y) with x > y, a tie counting half: Mann and Whitney's U / (n m).   `x: [n]`, `y: [m]`
fn share_of_wins(x: &[f64], y: &[f64]) -> f64 {
    let halves = |x: &f64| {
        y.iter()
            .map(|y| u32::from(x > y) + u32::from(x >= y))
            .sum::<u32>()
    };
    f64::from(x.iter().map(halves).sum::<u32>()) / (2 * x.len() * y.len()) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::statistics::Interval;

    /// 3 beats 1 and 2; 2 beats 1 and ties with 2: (2 + 1 + ½) of 4 pairs.
    #[test]
    fn a_tie_counts_half() {
        assert_eq!(share_of_wins(&[3.0, 2.0], &[1.0, 2.0]), 3.5 / 4.0);
        assert_eq!(share_of_wins(&[f64::INFINITY], &[f64::INFINITY]), 0.5);
    }

    /// In the first task x always wins, in the second never: ½, and no redrawing changes that.
    #[test]
    fn tasks_are_averaged() {
        let (low, high) = (vec![0.0; 5], vec![1.0; 6]);
        let half = probability_of_improvement(&[high.clone(), low.clone()], &[low, high]);
        assert_eq!(
            half,
            Estimate {
                value: 0.5,
                interval: Interval::Known {
                    low: 0.5,
                    high: 0.5
                }
            }
        );
    }
}
