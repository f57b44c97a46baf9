//! The categorical policy over n choices (thesis §1.5.4): π(a|s) = softmax(logits).

/// Replaces the logits of each row by log-probabilities: log π(a) = `x_a` − log Σ exp x.
/// `logits: [B × n]`
pub fn log_softmax_in_place(logits: &mut [f32], choices: usize) {
    for row in logits.chunks_exact_mut(choices) {
        let log_sum = log_sum_exp(row);
        for x in row {
            *x -= log_sum;
        }
    }
}

/// log Σ exp x, computed relative to the largest logit to avoid overflow.   `logits: [n]`
fn log_sum_exp(logits: &[f32]) -> f32 {
    // Two choices are the most common case and need a single exponential, because the term of the
    // larger logit is e⁰ = 1.
    if let &[a, b] = logits {
        let largest = if a > b { a } else { b };
        return (1.0 + (-(a - b).abs()).exp()).ln() + largest;
    }
    let largest = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    logits.iter().map(|x| (x - largest).exp()).sum::<f32>().ln() + largest
}

/// The choice at which the cumulative probability first exceeds `uniform`, a number in `[0, 1)`.
/// `log_probs: [n]`
#[must_use]
pub fn choose(log_probs: &[f32], uniform: f32) -> usize {
    let mut cumulative = 0.0;
    let choice = log_probs.iter().position(|log_prob| {
        cumulative += log_prob.exp();
        uniform < cumulative
    });
    // The probabilities may add up to slightly less than 1.
    choice.unwrap_or(log_probs.len() - 1)
}

/// Entropy H = −Σ π log π, nats.   `log_probs: [n]`
#[must_use]
pub fn entropy(log_probs: &[f32]) -> f32 {
    // The term of a choice with probability 0 is 0, but 0 · −∞ would be NaN.
    -log_probs
        .iter()
        .filter(|log_prob| **log_prob != f32::NEG_INFINITY)
        .map(|log_prob| log_prob.exp() * log_prob)
        .sum::<f32>()
}

/// Writes the gradient of w log π(a) with respect to the logits: w (1{i = a} − πᵢ).   `log_probs:
/// [n]` → `gradient: [n]`
pub fn log_prob_gradient(log_probs: &[f32], choice: usize, weight: f32, gradient: &mut [f32]) {
    for (index, (derivative, log_prob)) in gradient.iter_mut().zip(log_probs).enumerate() {
        let indicator = if index == choice { 1.0 } else { 0.0 };
        *derivative = weight * (indicator - log_prob.exp());
    }
}

/// Adds the gradient of w H with respect to the logits: −w πᵢ (log πᵢ + H).   `log_probs: [n]` →
/// `gradient: [n]`
pub fn add_entropy_gradient(log_probs: &[f32], weight: f32, gradient: &mut [f32]) {
    let entropy = entropy(log_probs);
    for (derivative, log_prob) in gradient
        .iter_mut()
        .zip(log_probs)
        .filter(|(_, log_prob)| **log_prob != f32::NEG_INFINITY)
    {
        *derivative -= weight * log_prob.exp() * (log_prob + entropy);
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

    /// Logits 0 and ln 3: π = ¼, ¾; H = ¼ ln 4 + ¾ ln(4/3) = 0.5623351.
    #[test]
    fn two_choices_by_hand() {
        let mut row = [0.0, 3.0_f32.ln()];
        log_softmax_in_place(&mut row, 2);
        assert!((row[0].exp() - 0.25).abs() < 1e-6 && (row[1].exp() - 0.75).abs() < 1e-6);
        assert!((entropy(&row) - 0.562_335_1).abs() < 1e-6);
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
        assert_eq!((row[1], entropy(&row)), (0.0, 0.0));
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
                (entropy(&row), row)
            };
            let mut gradient = vec![0.25; logits.len()];
            add_entropy_gradient(&entropy_and_log_probs(&logits).1, 2.0, &mut gradient);
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
            log_prob_gradient(&log_probs(&logits), choice, 2.0, &mut gradient);
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
