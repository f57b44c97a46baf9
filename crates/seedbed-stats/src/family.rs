//! Families of claims: Holm's step-down procedure, and error probabilities of several looks.
//!
//! ```
//! use seedbed_stats::family::{FAMILY_LEVEL, holm_decisions};
//!
//! let decisions = holm_decisions(&[0.02, 0.001, 0.4], FAMILY_LEVEL);
//! // 0.001 is below 0.025 / 3; 0.02 is not below 0.025 / 2.
//! assert_eq!(decisions.are_rejected(), [false, true, false]);
//! ```

use statrs::distribution::{ContinuousCDF, Normal};

/// Error probability of each end of the intervals of a family: the probability that any of its
/// claims is falsely supported. Both ends together have 5 %.
pub const FAMILY_LEVEL: f64 = 0.025;

/// Decision on one hypothesis of a family.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decision {
    /// Whether the hypothesis is rejected.
    pub is_rejected: bool,
    /// Level at which the hypothesis was tested. An interval whose end has this error probability
    /// excludes the hypothesis exactly if it is rejected.
    pub level: f64,
}

/// Decisions on the hypotheses of a family.
#[derive(Clone, Debug, PartialEq)]
pub struct Decisions(pub Vec<Decision>);

impl Decisions {
    /// Whether each hypothesis is rejected.
    #[must_use]
    pub fn are_rejected(&self) -> Vec<bool> {
        self.0.iter().map(|decision| decision.is_rejected).collect()
    }
}

/// Holm's step-down procedure (1979): decisions on m hypotheses, such that the probability of any
/// false rejection is at most `level`, whatever the dependence between the tests.
/// `p: [m]` → `[m]`, in the same order
///
/// The hypotheses with the smallest p-values are rejected as long as p₍ᵢ₎ ≤ level / (m − i + 1), in
/// ascending order. All that follow the first that is not rejected were tested at its level.
/// Rejected are those for which
/// `statsmodels.stats.multitest.multipletests(p, level, method="holm")` says so.
#[must_use]
pub fn holm_decisions(p: &[f64], level: f64) -> Decisions {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let mut decisions = vec![
        Decision {
            is_rejected: false,
            level
        };
        p.len()
    ];
    let mut step = 0;
    for index in order {
        let level = level / (p.len() - step) as f64;
        let is_rejected = p[index] <= level;
        decisions[index] = Decision { is_rejected, level };
        step += usize::from(is_rejected);
    }
    Decisions(decisions)
}

/// p-values after Holm's correction: a hypothesis is rejected at a level exactly if its corrected
/// p-value is at most this level.   `p: [m]` → `[m]`, in the same order
///
/// For p-values in ascending order, p̃₍ᵢ₎ = max(p̃₍ᵢ₋₁₎, min(1, (m − i + 1) p₍ᵢ₎)). Equals
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

/// Levels of several looks at growing data, which sum to `level`: the increments of the spending
/// function of Lan and DeMets (1983) that is like O'Brien and Fleming's boundaries,
/// α(t) = 2 − 2 Φ(z / √t) with z = Φ⁻¹(1 − level / 2).   `runs: [looks]`, ascending → `[looks]`
///
/// t is the share of the runs of the last look. Early looks get little, so that looking costs the
/// last look hardly anything. The sum bounds the probability of a false rejection at any look,
/// whatever the dependence between looks.
///
/// # Panics
/// If there are no looks, or if `runs` do not ascend from at least 1.
#[must_use]
pub fn levels_of_looks(runs: &[u64], level: f64) -> Vec<f64> {
    assert!(
        runs.first().is_some_and(|&first| first > 0),
        "no runs at the first look"
    );
    assert!(
        runs.is_sorted_by(|a, b| a < b),
        "looks with fewer runs than earlier ones"
    );
    let normal = Normal::standard();
    let z = normal.inverse_cdf(1.0 - level / 2.0);
    let mut spent_before = 0.0;
    let increment = |&runs_of_look: &u64| {
        let share = runs_of_look as f64 / runs[runs.len() - 1] as f64;
        // At the last look the formula gives `level`, apart from rounding.
        let spent = if share < 1.0 {
            2.0 * normal.sf(z / share.sqrt())
        } else {
            level
        };
        let increment = spent - spent_before;
        spent_before = spent;
        increment
    };
    runs.iter().map(increment).collect()
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

    /// 0.001 ≤ 0.03/3, but 0.016 > 0.03/2: the third is tested at 0.03/2, too, although 0.02 is
    /// below 0.03.
    #[test]
    fn nothing_is_rejected_after_the_first_that_is_not() {
        let decisions = holm_decisions(&[0.02, 0.001, 0.016], 0.03);
        assert_eq!(decisions.are_rejected(), [false, true, false]);
        let levels: Vec<f64> = decisions.0.iter().map(|decision| decision.level).collect();
        assert_eq!(levels, [0.015, 0.01, 0.015]);
    }

    /// With the last p-value at 0.015 both of the others are rejected as well.
    #[test]
    fn decisions_agree_with_corrected_p_values() {
        for p in [
            [0.02, 0.001, 0.015],
            [0.02, 0.001, 0.016],
            [0.5, 0.01, 0.03],
        ] {
            let expected: Vec<bool> = holm_correction(&p).iter().map(|p| *p <= 0.03).collect();
            assert_eq!(holm_decisions(&p, 0.03).are_rejected(), expected, "{p:?}");
        }
    }

    /// z = Φ⁻¹(0.9875) = 2.2414; half of the runs: 2 − 2 Φ(2.2414 · √2 = 3.1698) = 0.001525, as
    /// `gsDesign::sfLDOF(0.025, 0.5)` says. All looks together have the whole level.
    #[test]
    fn an_early_look_has_a_small_part_of_the_level() {
        let levels = levels_of_looks(&[10, 20], 0.025);
        assert!((levels[0] - 0.001_525).abs() < 1e-6, "{levels:?}");
        assert!((levels.iter().sum::<f64>() - 0.025).abs() < 1e-12);
        assert_eq!(levels_of_looks(&[30], 0.025), [0.025]);
    }
}
