//! Ties: values of runs that differ only by the rounding of what was added up are one value.

use super::score::RunScore;
use crate::scenario::Rounding;

/// The scores of two cells, in which values that differ only by rounding are replaced by the smallest
/// of them. Otherwise the rounding of equal means would be an effect.
pub(super) fn with_equal_ties(mut cells: [Vec<RunScore>; 2]) -> [Vec<RunScore>; 2] {
    let mut scores: Vec<&mut RunScore> = cells.iter_mut().flatten().collect();
    scores.sort_by(|one, other| one.value.total_cmp(&other.value));
    let mut smallest: Option<RunScore> = None;
    for score in scores {
        match smallest {
            Some(smallest) if are_equal(&smallest, score) => score.value = smallest.value,
            _ => smallest = Some(*score),
        }
    }
    cells
}

fn are_equal(smaller: &RunScore, larger: &RunScore) -> bool {
    let magnitude = smaller.magnitude.max(larger.magnitude);
    larger.value - smaller.value <= Rounding::Double.error(magnitude)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn score(value: f64, magnitude: f64) -> RunScore {
        RunScore {
            run_seed: 0,
            value,
            observed_until: f64::INFINITY,
            magnitude,
        }
    }

    fn values(first: &[RunScore], second: &[RunScore]) -> [Vec<f64>; 2] {
        with_equal_ties([first.to_vec(), second.to_vec()])
            .map(|scores| scores.iter().map(|score| score.value).collect())
    }

    /// The mean of 25 numbers 0.1 is 0.10000000000000003 in double precision, that of ten numbers
    /// 0.09999999999999999.
    #[test]
    fn values_that_differ_by_rounding_are_one() {
        let [many, few] = [25, 10].map(|n| vec![0.1; n].iter().sum::<f64>() / f64::from(n as u8));
        assert_ne!(many, few);
        let found = values(&[score(many, 0.1), score(0.2, 0.2)], &[score(few, 0.1)]);
        assert_eq!(found, [vec![few, 0.2], vec![few]]);
    }

    /// Returns of ±1000 that cancel each other leave their rounding errors, which are equal; so small
    /// returns are not.
    #[test]
    fn the_error_is_that_of_what_was_added_up() {
        let [one, other] = [1e-13, -1e-13];
        let of = |magnitude| values(&[score(one, magnitude)], &[score(other, magnitude)]);
        assert_eq!(of(1000.0), [[other], [other]]);
        assert_eq!(of(1e-13), [[one], [other]]);
    }

    #[test]
    fn infinite_values_are_kept() {
        let [small, large] = [f64::NEG_INFINITY, f64::INFINITY];
        let found = values(
            &[score(large, large), score(1.0, 1.0)],
            &[score(small, large)],
        );
        assert_eq!(found, [vec![large, 1.0], vec![small]]);
    }
}
