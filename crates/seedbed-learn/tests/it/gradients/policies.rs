//! Losses of policies, and their gradients through the network.

use seedbed_learn::nn::{Activations, Mlp};
use seedbed_learn::rl::policy_loss::{self, Surrogate};
use seedbed_learn::rl::{categorical, gaussian};
use serde::Deserialize;

use super::{assert_close, assert_parameter_gradient, check_cases, reference};

#[derive(Clone, Copy, Debug, Deserialize)]
enum Loss {
    Simple,
    Ppo { clip: f32 },
    OffPac { cap: Option<f32> },
}

impl Loss {
    fn surrogate(self, log_prob: f32, behavior: f32, advantage: f32) -> Surrogate {
        let ratio = (log_prob - behavior).exp();
        match self {
            Self::Simple => policy_loss::simple(log_prob, advantage),
            Self::Ppo { clip } => policy_loss::ppo(ratio, advantage, clip),
            Self::OffPac { cap } => policy_loss::off_pac(log_prob, ratio, advantage, cap),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PolicyLossCase {
    loss: Loss,
    log_prob: f32,
    behavior: f32,
    advantage: f32,
    value: f64,
    slope: f64,
}

#[test]
fn policy_losses_match_the_reference() {
    check_cases(&reference().policy_losses, 60, |case| {
        let &PolicyLossCase {
            loss,
            log_prob,
            behavior,
            advantage,
            ..
        } = case;
        let surrogate = loss.surrogate(log_prob, behavior, advantage);
        let name =
            |what| format!("{loss:?} at log π {log_prob}, log μ {behavior}, A {advantage}: {what}");
        assert_close(&name("loss"), &[surrogate.loss], &[case.value]);
        assert_close(&name("slope"), &[surrogate.slope], &[case.slope]);
        assert_eq!(
            surrogate.is_clipped,
            case.slope == 0.0,
            "{}",
            name("clipped")
        );
    });
}

#[derive(Clone, Copy, Deserialize)]
enum Head {
    Categorical {
        choices: usize,
    },
    Gaussian {
        range: [f32; 2],
        initial_deviation: f32,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PolicyCase {
    name: String,
    head: Head,
    loss: Loss,
    entropy_bonus: f32,
    sizes: Vec<usize>,
    parameters: Vec<f32>,
    states: Vec<f32>,
    actions: Vec<f32>,
    behavior: Vec<f32>,
    advantages: Vec<f32>,
    value: f64,
    gradient: Vec<f64>,
}

impl PolicyCase {
    /// The terms of one sample in the objective. Sets `gradient` to their gradient with respect to
    /// the network's outputs, as `agent::policy` computes it.
    fn sample(&self, index: usize, outputs: &[f32], gradient: &mut [f32]) -> f32 {
        match self.head {
            Head::Categorical { choices } => {
                self.categorical_sample(index, outputs, choices, gradient)
            }
            Head::Gaussian {
                range,
                initial_deviation,
            } => self.gaussian_sample(index, outputs, range, initial_deviation, gradient),
        }
    }

    fn surrogate(&self, index: usize, log_prob: f32) -> Surrogate {
        let (behavior, advantage) = (self.behavior[index], self.advantages[index]);
        self.loss.surrogate(log_prob, behavior, advantage)
    }

    /// Weight of each sample in the mean.
    fn weight(&self) -> f32 {
        1.0 / self.actions.len() as f32
    }

    fn categorical_sample(
        &self,
        index: usize,
        outputs: &[f32],
        choices: usize,
        gradient: &mut [f32],
    ) -> f32 {
        let (choice, weight) = (self.actions[index] as usize, self.weight());
        let mut log_probs = outputs.to_vec();
        categorical::log_softmax_in_place(&mut log_probs, choices);
        let Surrogate { loss, slope, .. } = self.surrogate(index, log_probs[choice]);
        let probabilities: Vec<f32> = log_probs.iter().copied().map(f32::exp).collect();
        let entropy = categorical::entropy(&log_probs, &probabilities);
        let entropy_weight = -weight * self.entropy_bonus;
        categorical::log_prob_gradient(&probabilities, choice, weight * slope, gradient);
        categorical::add_entropy_gradient(&log_probs, &probabilities, entropy_weight, gradient);
        weight * (loss - self.entropy_bonus * entropy)
    }

    fn gaussian_sample(
        &self,
        index: usize,
        outputs: &[f32],
        [low, high]: [f32; 2],
        initial_deviation: f32,
        gradient: &mut [f32],
    ) -> f32 {
        let (action, weight) = (self.actions[index], self.weight());
        let (center, half_range) = (0.5 * (low + high), 0.5 * (high - low));
        let relative_log_deviation = outputs[1] + initial_deviation.ln();
        let is_within_bounds = (-4.0..=1.0).contains(&relative_log_deviation);
        let (mean, log_deviation) = (
            half_range.mul_add(outputs[0], center),
            relative_log_deviation.clamp(-4.0, 1.0) + half_range.ln(),
        );
        let log_density = gaussian::log_density(action, mean, log_deviation);
        let Surrogate { loss, slope, .. } = self.surrogate(index, log_density);
        let [mean_slope, log_deviation_slope] =
            gaussian::log_density_gradient(action, mean, log_deviation);
        gradient[0] = weight * slope * mean_slope * half_range;
        // The derivative of the entropy with respect to log σ is 1.
        gradient[1] = if is_within_bounds {
            weight * (slope * log_deviation_slope - self.entropy_bonus)
        } else {
            0.0
        };
        weight * (loss - self.entropy_bonus * gaussian::entropy(log_deviation))
    }
}

/// Gradients of mean loss − entropy bonus · mean entropy with respect to the network's parameters.
#[test]
fn gradients_of_policies_match_the_reference() {
    check_cases(&reference().policies, 8, |case| {
        let (network, mut activations) = (Mlp::new(&case.sizes), Activations::default());
        let outputs = network
            .forward(&case.parameters, &case.states, &mut activations)
            .to_vec();
        let mut output_gradient = vec![f32::NAN; outputs.len()];
        let width = network.outputs();
        let rows = outputs
            .chunks_exact(width)
            .zip(output_gradient.chunks_exact_mut(width))
            .enumerate();
        let value: f32 = rows
            .map(|(index, (outputs, gradient))| case.sample(index, outputs, gradient))
            .sum();
        assert_close(
            &format!("{}: objective", case.name),
            &[value],
            &[case.value],
        );

        let point = (&case.parameters[..], &case.states[..]);
        assert_parameter_gradient(
            &case.name,
            &network,
            point,
            &mut activations,
            &output_gradient,
            &case.gradient,
        );
    });
}
