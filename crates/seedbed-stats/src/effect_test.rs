//! Tests of an effect, and the confidence bounds that they imply.
//!
//! An [`EffectTest`] gives a p-value for every possible effect. A confidence bound is where this
//! p-value crosses a level, so that a bound excludes an effect exactly if the test rejects it: the
//! decision on a claim and the interval that is shown with it cannot contradict each other.

use std::fmt::Debug;

/// A family of one-sided tests: one pair of p-values for every hypothetical effect.
pub trait EffectTest: Debug + Send + Sync {
    /// Estimate of the effect.
    fn estimate(&self) -> f64;

    /// p-value of the hypothesis that the effect is at most `effect`, against a larger effect.
    fn p_above(&self, effect: f64) -> f64;

    /// p-value of the hypothesis that the effect is at least `effect`, against a smaller effect.
    fn p_below(&self, effect: f64) -> f64;

    /// Smallest and largest effect that are possible.
    fn limits(&self) -> [f64; 2];

    /// Distance from the estimate within which bounds are searched, if the limits are farther.
    fn search_distance(&self) -> f64;
}

/// The test of the opposite effect: of second minus first, from a test of first minus second. Its
/// bounds are those of that test with the opposite sign, to the bit.
#[derive(Debug)]
pub struct Opposite(pub Box<dyn EffectTest>);

impl EffectTest for Opposite {
    fn estimate(&self) -> f64 {
        -self.0.estimate()
    }

    fn p_above(&self, effect: f64) -> f64 {
        self.0.p_below(-effect)
    }

    fn p_below(&self, effect: f64) -> f64 {
        self.0.p_above(-effect)
    }

    fn limits(&self) -> [f64; 2] {
        let [low, high] = self.0.limits();
        [-high, -low]
    }

    fn search_distance(&self) -> f64 {
        self.0.search_distance()
    }
}

/// The test of an effect of which the data give only a range, from tests of its smallest and of its
/// largest possible value. Whatever in the range is true, its bounds hold (Manski 2003, "Partial
/// identification of probability distributions"). The estimate is the middle of the range.
#[derive(Debug)]
pub struct OfRange {
    /// Test of the smallest possible effect.
    pub smallest: Box<dyn EffectTest>,
    /// Test of the largest possible effect.
    pub largest: Box<dyn EffectTest>,
}

impl EffectTest for OfRange {
    fn estimate(&self) -> f64 {
        f64::midpoint(self.smallest.estimate(), self.largest.estimate())
    }

    fn p_above(&self, effect: f64) -> f64 {
        self.smallest.p_above(effect)
    }

    fn p_below(&self, effect: f64) -> f64 {
        self.largest.p_below(effect)
    }

    fn limits(&self) -> [f64; 2] {
        [self.smallest.limits()[0], self.largest.limits()[1]]
    }

    fn search_distance(&self) -> f64 {
        let range = self.largest.estimate() - self.smallest.estimate();
        let distances = [&self.smallest, &self.largest].map(|test| test.search_distance());
        range + distances[0].max(distances[1])
    }
}

/// Number of bisections of a bound: the error is 2⁻⁴⁰ of the searched range.
const BISECTIONS: u32 = 40;

/// Lower confidence bound of an effect with error probability `level`: effects below it are
/// rejected by the test. The lower limit of the effect if the test rejects no effect.
///
/// The bound is above `threshold` exactly if `test.p_above(threshold) <= level`, for thresholds
/// below the estimate. p-values of some tests are not quite monotonic, so that there may be several
/// crossings: the bound is one on the side of `threshold` that agrees with its p-value.
#[must_use]
pub fn lower_bound(test: &(impl EffectTest + ?Sized), level: f64, threshold: f64) -> f64 {
    let far = test.limits()[0].max(test.estimate() - test.search_distance());
    let is_rejected = |effect: f64| test.p_above(effect) <= level;
    let bound = find_bound(is_rejected, [test.estimate(), far], threshold);
    bound.unwrap_or(test.limits()[0])
}

/// Upper confidence bound of an effect with error probability `level`, like [`lower_bound`].
#[must_use]
pub fn upper_bound(test: &(impl EffectTest + ?Sized), level: f64, threshold: f64) -> f64 {
    let far = test.limits()[1].min(test.estimate() + test.search_distance());
    let is_rejected = |effect: f64| test.p_below(effect) <= level;
    let bound = find_bound(is_rejected, [test.estimate(), far], threshold);
    bound.unwrap_or(test.limits()[1])
}

/// The effect between `estimate` and `far` at which effects begin to be rejected; `None` if `far`
/// is not rejected.
fn find_bound(
    is_rejected: impl Fn(f64) -> bool,
    [estimate, far]: [f64; 2],
    threshold: f64,
) -> Option<f64> {
    let is_between = (estimate - threshold) * (threshold - far) > 0.0;
    if is_between && is_rejected(threshold) {
        Some(bisect(estimate, threshold, is_rejected))
    } else if is_rejected(far) {
        let inside = if is_between { threshold } else { estimate };
        Some(bisect(inside, far, is_rejected))
    } else {
        None
    }
}

/// The value between `inside`, which is not rejected, and `outside`, which is, at which values begin
/// to be rejected.
pub(crate) fn bisect(mut inside: f64, mut outside: f64, is_rejected: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..BISECTIONS {
        let middle = f64::midpoint(inside, outside);
        if is_rejected(middle) {
            outside = middle;
        } else {
            inside = middle;
        }
    }
    inside
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An effect whose p-values are those of an estimate `0` that is uniform within ±1.
    #[derive(Debug)]
    struct Uniform;

    impl EffectTest for Uniform {
        fn estimate(&self) -> f64 {
            0.0
        }

        fn p_above(&self, effect: f64) -> f64 {
            (f64::midpoint(1.0, effect)).clamp(0.0, 1.0)
        }

        fn p_below(&self, effect: f64) -> f64 {
            1.0 - self.p_above(effect)
        }

        fn limits(&self) -> [f64; 2] {
            [-2.0, f64::INFINITY]
        }

        fn search_distance(&self) -> f64 {
            100.0
        }
    }

    /// p = (1 + e) / 2 equals 0.05 at e = −0.9, wherever the threshold is.
    #[test]
    fn bounds_are_where_p_crosses_the_level() {
        for threshold in [-5.0, -1.5, -0.95, -0.5, 0.0, 3.0] {
            assert!((lower_bound(&Uniform, 0.05, threshold) + 0.9).abs() < 1e-9);
            assert!((upper_bound(&Uniform, 0.05, -threshold) - 0.9).abs() < 1e-9);
        }
    }

    #[test]
    fn a_level_that_rejects_nothing_gives_the_limit() {
        assert_eq!(lower_bound(&Uniform, -1.0, 0.0), -2.0);
        assert_eq!(upper_bound(&Uniform, -1.0, 0.0), f64::INFINITY);
    }

    #[test]
    fn bounds_of_the_opposite_effect_have_the_opposite_sign() {
        let opposite = Opposite(Box::new(Uniform));
        for threshold in [-5.0, -0.95, 0.0, 3.0] {
            let low = lower_bound(&opposite, 0.05, threshold);
            assert_eq!(low, -upper_bound(&Uniform, 0.05, -threshold));
            let high = upper_bound(&opposite, 0.05, threshold);
            assert_eq!(high, -lower_bound(&Uniform, 0.05, -threshold));
        }
        assert_eq!(upper_bound(&opposite, -1.0, 0.0), 2.0);
    }

    /// An effect from −3 to 5 with p-values that are uniform within ±1 has the bounds −3.9 and 5.9.
    #[test]
    fn bounds_of_a_range_hold_for_all_of_it() {
        #[derive(Debug)]
        struct Shifted(f64);

        impl EffectTest for Shifted {
            fn estimate(&self) -> f64 {
                self.0
            }

            fn p_above(&self, effect: f64) -> f64 {
                Uniform.p_above(effect - self.0)
            }

            fn p_below(&self, effect: f64) -> f64 {
                Uniform.p_below(effect - self.0)
            }

            fn limits(&self) -> [f64; 2] {
                [f64::NEG_INFINITY, f64::INFINITY]
            }

            fn search_distance(&self) -> f64 {
                1.0
            }
        }

        let test = OfRange {
            smallest: Box::new(Shifted(-3.0)),
            largest: Box::new(Shifted(5.0)),
        };
        assert_eq!(test.estimate(), 1.0);
        for threshold in [-9.0, -3.95, -3.0, 0.0, 2.0] {
            assert!((lower_bound(&test, 0.05, threshold) + 3.9).abs() < 1e-9);
            assert!((upper_bound(&test, 0.05, 2.0 - threshold) - 5.9).abs() < 1e-9);
        }
    }

    /// A p-value that falls, rises and falls again: it crosses 0.05 at −1, −2 and −3.
    #[derive(Debug)]
    struct SeveralCrossings;

    impl EffectTest for SeveralCrossings {
        fn estimate(&self) -> f64 {
            0.0
        }

        fn p_above(&self, effect: f64) -> f64 {
            if effect > -1.0 || (-3.0..-2.0).contains(&effect) {
                0.1
            } else {
                0.01
            }
        }

        fn p_below(&self, _effect: f64) -> f64 {
            1.0
        }

        fn limits(&self) -> [f64; 2] {
            [-9.0, 9.0]
        }

        fn search_distance(&self) -> f64 {
            9.0
        }
    }

    /// The threshold −1.5 is rejected, so the bound is above it; −2.5 is not, so it is below.
    #[test]
    fn bounds_agree_with_the_p_value_of_the_threshold() {
        assert!((lower_bound(&SeveralCrossings, 0.05, -1.5) + 1.0).abs() < 1e-9);
        assert!((lower_bound(&SeveralCrossings, 0.05, -2.5) + 3.0).abs() < 1e-9);
    }
}
