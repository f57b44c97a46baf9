//! The categorical policy over n choices (thesis §1.5.4): π(a|s) = softmax(logits).

#![expect(
    clippy::inline_always,
    reason = "a loop is compiled for a SIMD instruction set only if it is inlined into the dispatch"
)]

use pulp::{Arch, Simd, WithSimd};

use crate::math::{exp, ln};

/// Replaces the logits of each row by log-probabilities: log π(a) = `x_a` − log Σ exp x.
/// `logits: [B × n]`
pub fn log_softmax_in_place(logits: &mut [f32], choices: usize) {
    Arch::new().dispatch(LogSoftmax { logits, choices });
}

struct LogSoftmax<'a> {
    logits: &'a mut [f32],
    choices: usize,
}

impl WithSimd for LogSoftmax<'_> {
    type Output = ();

    /// If the number of choices is known, the compiler computes several rows at once.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        match self.choices {
            2 => log_softmax_of_rows::<2>(self.logits),
            3 => log_softmax_of_rows::<3>(self.logits),
            choices => {
                for row in self.logits.chunks_exact_mut(choices) {
                    log_softmax_of_row(row);
                }
            }
        }
    }
}

#[inline(always)]
fn log_softmax_of_rows<const CHOICES: usize>(logits: &mut [f32]) {
    for row in logits.as_chunks_mut::<CHOICES>().0 {
        log_softmax_of_row(row);
    }
}

/// Exponentials are relative to the largest logit, so that they do not overflow.
#[inline(always)]
fn log_softmax_of_row(logits: &mut [f32]) {
    let mut largest = f32::NEG_INFINITY;
    for x in &*logits {
        largest = if *x > largest { *x } else { largest };
    }
    let mut sum = 0.0;
    for x in &*logits {
        sum += exp(*x - largest);
    }
    let log_sum = ln(sum) + largest;
    for x in logits {
        *x -= log_sum;
    }
}

/// The choice at which the cumulative probability first exceeds `uniform`, a number in `[0, 1)`.
/// `log_probs: [n]`
#[must_use]
pub fn choose(log_probs: &[f32], uniform: f32) -> usize {
    let mut cumulative = 0.0;
    let choice = log_probs.iter().position(|log_prob| {
        cumulative += exp(*log_prob);
        uniform < cumulative
    });
    // The probabilities may add up to slightly less than 1.
    choice.unwrap_or(log_probs.len() - 1)
}

/// Entropy H = −Σ π log π, nats.   `log_probs`, `probabilities`: `[n]`
#[must_use]
pub fn entropy(log_probs: &[f32], probabilities: &[f32]) -> f32 {
    let terms = log_probs.iter().zip(probabilities);
    -terms
        .map(|(log_prob, p)| entropy_term(*log_prob, *p))
        .sum::<f32>()
}

/// π log π. The term of a choice with probability 0 is 0, but 0 · −∞ would be NaN.
fn entropy_term(log_prob: f32, probability: f32) -> f32 {
    if log_prob == f32::NEG_INFINITY {
        0.0
    } else {
        probability * log_prob
    }
}

/// Writes the gradient of w log π(a) with respect to the logits: w (1{i = a} − πᵢ).
/// `probabilities: [n]` → `gradient: [n]`
pub fn log_prob_gradient(probabilities: &[f32], choice: usize, weight: f32, gradient: &mut [f32]) {
    for (index, (derivative, p)) in gradient.iter_mut().zip(probabilities).enumerate() {
        let indicator = if index == choice { 1.0 } else { 0.0 };
        *derivative = weight * (indicator - p);
    }
}

/// Adds the gradient of w H with respect to the logits: −w πᵢ (log πᵢ + H).   `log_probs`,
/// `probabilities`: `[n]` → `gradient: [n]`
pub fn add_entropy_gradient(
    log_probs: &[f32],
    probabilities: &[f32],
    weight: f32,
    gradient: &mut [f32],
) {
    let entropy = entropy(log_probs, probabilities);
    for (derivative, (log_prob, p)) in gradient.iter_mut().zip(log_probs.iter().zip(probabilities))
    {
        *derivative -= weight * (entropy_term(*log_prob, *p) + p * entropy);
    }
}

/// Replaces log π(a) by the logarithm of π(a)^{1/τ} / Σ π^{1/τ}: a temperature τ below 1 makes
/// choices greedier.   `log_probs: [n]`
pub fn temper(log_probs: &mut [f32], temperature: f32) {
    for log_prob in &mut *log_probs {
        *log_prob /= temperature;
    }
    log_softmax_in_place(log_probs, log_probs.len());
}

/// The most likely choice; the first one of several with the same probability.   `log_probs: [n]`
#[must_use]
pub fn most_likely(log_probs: &[f32]) -> usize {
    let mut most_likely = 0;
    for index in 1..log_probs.len() {
        if log_probs[index] > log_probs[most_likely] {
            most_likely = index;
        }
    }
    most_likely
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn probabilities(log_probs: &[f32]) -> Vec<f32> {
        log_probs.iter().copied().map(exp).collect()
    }

    /// Logits 0 and ln 3: π = ¼, ¾; H = ¼ ln 4 + ¾ ln(4/3) = 0.5623351.
    #[test]
    fn two_choices_by_hand() {
        let mut row = [0.0, 3.0_f32.ln()];
        log_softmax_in_place(&mut row, 2);
        assert!((row[0].exp() - 0.25).abs() < 1e-6 && (row[1].exp() - 0.75).abs() < 1e-6);
        assert!((entropy(&row, &row.map(exp)) - 0.562_335_1).abs() < 1e-6);
        assert_eq!(
            [
                choose(&row, 0.0),
                choose(&row, 0.24),
                choose(&row, 0.26),
                choose(&row, 0.999_999_9)
            ],
            [0, 0, 1, 1]
        );
    }

    #[test]
    fn extreme_logits_have_finite_log_probs() {
        let mut row = [-1e4, 1e4];
        log_softmax_in_place(&mut row, 2);
        assert_eq!((row[1], entropy(&row, &row.map(exp))), (0.0, 0.0));
        assert!(row[0].is_finite());
    }

    /// π = ¼, ¾ at τ = ½: π² = 1/16, 9/16, so 0.1 and 0.9. At τ = 1 nothing changes.
    #[test]
    fn temper_by_hand() {
        let log_probs = [0.25_f32.ln(), 0.75_f32.ln()];
        let tempered = |temperature| {
            let mut row = log_probs;
            temper(&mut row, temperature);
            row.map(f32::exp)
        };
        assert!((tempered(0.5)[0] - 0.1).abs() < 1e-6 && (tempered(1.0)[0] - 0.25).abs() < 1e-6);
        assert_eq!(
            (most_likely(&log_probs), most_likely(&[0.0, 0.0, -1.0])),
            (1, 0)
        );
    }

    proptest! {
        /// Rows that are computed together have the bits of rows that are computed alone.
        #[test]
        fn rows_are_independent(choices in 2..6_usize, logits in prop::collection::vec(-30.0_f32..30.0, 60)) {
            let mut together = logits.clone();
            log_softmax_in_place(&mut together, choices);
            let mut alone = logits;
            for row in alone.chunks_exact_mut(choices) {
                log_softmax_in_place(row, choices);
            }
            prop_assert_eq!(together, alone);
        }

        /// A third choice with probability 0 does not change the others.
        #[test]
        fn two_choices_agree_with_three(a in -30.0_f32..30.0, b in -30.0_f32..30.0) {
            let (mut two, mut three) = ([a, b], [a, b, f32::NEG_INFINITY]);
            log_softmax_in_place(&mut two, 2);
            log_softmax_in_place(&mut three, 3);
            prop_assert_eq!(two, [three[0], three[1]]);
        }

        #[test]
        fn entropy_gradient_agrees_with_central_differences(logits in prop::collection::vec(-3.0_f32..3.0, 2..6)) {
            let entropy_and_log_probs = |logits: &[f32]| {
                let mut row = logits.to_vec();
                log_softmax_in_place(&mut row, logits.len());
                (entropy(&row, &probabilities(&row)), row)
            };
            let mut gradient = vec![0.25; logits.len()];
            let row = entropy_and_log_probs(&logits).1;
            add_entropy_gradient(&row, &probabilities(&row), 2.0, &mut gradient);
            for index in 0..logits.len() {
                let (mut above, mut below) = (logits.clone(), logits.clone());
                above[index] += 1e-2;
                below[index] -= 1e-2;
                let numeric = 0.25 + 2.0 * (entropy_and_log_probs(&above).0 - entropy_and_log_probs(&below).0) / 2e-2;
                prop_assert!((numeric - gradient[index]).abs() < 2e-3, "{} {}", numeric, gradient[index]);
            }
        }

        #[test]
        fn gradient_agrees_with_central_differences(logits in prop::collection::vec(-3.0_f32..3.0, 2..6), pick: usize) {
            let choice = pick % logits.len();
            let log_probs = |logits: &[f32]| {
                let mut row = logits.to_vec();
                log_softmax_in_place(&mut row, logits.len());
                row
            };
            let mut gradient = vec![0.0; logits.len()];
            log_prob_gradient(&probabilities(&log_probs(&logits)), choice, 2.0, &mut gradient);
            for index in 0..logits.len() {
                let (mut above, mut below) = (logits.clone(), logits.clone());
                above[index] += 1e-2;
                below[index] -= 1e-2;
                let numeric = 2.0 * (log_probs(&above)[choice] - log_probs(&below)[choice]) / 2e-2;
                prop_assert!((numeric - gradient[index]).abs() < 2e-3);
            }
        }
    }
}
