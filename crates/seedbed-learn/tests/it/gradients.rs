//! Every hand-written gradient against automatic differentiation: `gradients/reference.py` made the
//! numbers of `gradients/reference.json`, and tells how to make them again.

use seedbed_learn::nn::{Activations, Adam, AdamSettings, Mlp, PopArt};
use seedbed_learn::rl::policy_loss::{self, Surrogate};
use seedbed_learn::rl::{categorical, gaussian, q_learning};
use serde::Deserialize;

/// How far a number may lie from its reference, as a share of its scale.
///
/// Single precision rounds by 6·10⁻⁸ and `nn`'s tanh errs by up to 4·10⁻⁷. Through three layers and
/// a sum over forty samples the gradients of networks come within 2·10⁻⁶ of the largest number of
/// their tensor; this is ten times that. A term left out, a wrong sign or factor shows in the first
/// digits.
const TOLERANCE: f64 = 2e-5;

#[derive(Deserialize)]
struct Reference {
    networks: Vec<NetworkCase>,
    categorical: Vec<CategoricalCase>,
    gaussian: Vec<GaussianCase>,
    policy_losses: Vec<PolicyLossCase>,
    policies: Vec<PolicyCase>,
    values: Vec<ValueCase>,
    action_values: Vec<ActionValueCase>,
    adam: Vec<AdamCase>,
    pop_art: Vec<PopArtCase>,
}

fn reference() -> Reference {
    serde_json::from_str(include_str!("../gradients/reference.json")).unwrap()
}

/// Runs `check` on every case, of which there are this many at least.
fn each<Case>(cases: &[Case], least: usize, check: impl Fn(&Case)) {
    assert!(
        cases.len() >= least,
        "{} cases of at least {least}",
        cases.len()
    );
    cases.iter().for_each(check);
}

/// Numbers whose terms are about 1 or less, or about as large as the number itself.
fn assert_close(name: &str, ours: &[f32], reference: &[f64]) {
    assert_close_at_scale(name, ours, reference, 1.0);
}

/// The gradient of a network, tensor by tensor at the scale of the tensor's largest number.
fn assert_gradient(name: &str, network: &Mlp, ours: &[f32], reference: &[f64]) {
    assert_eq!(ours.len(), reference.len(), "{name}");
    let mut rest = reference;
    for (tensor, _, ours) in network.tensors(ours) {
        let (reference, next) = rest.split_at(ours.len());
        let largest = reference
            .iter()
            .fold(0.0, |largest: f64, number| largest.max(number.abs()));
        assert_close_at_scale(
            &format!("{name}: gradient of {tensor}"),
            ours,
            reference,
            largest,
        );
        rest = next;
    }
}

fn assert_close_at_scale(name: &str, ours: &[f32], reference: &[f64], scale: f64) {
    assert_eq!(ours.len(), reference.len(), "{name}");
    for (index, (&ours, &reference)) in ours.iter().zip(reference).enumerate() {
        let error = (f64::from(ours) - reference).abs() / reference.abs().max(scale);
        assert!(
            error <= TOLERANCE,
            "{name}[{index}]: {ours}, by automatic differentiation {reference}: off by {error:.1e} of its scale"
        );
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NetworkCase {
    name: String,
    sizes: Vec<usize>,
    parameters: Vec<f32>,
    inputs: Vec<f32>,
    outputs: Vec<f64>,
    gradient: Vec<f64>,
}

/// L = ½ Σ y², so ∂L/∂y = y.
#[test]
fn networks() {
    each(&reference().networks, 2, |case| {
        let (network, mut activations) = (Mlp::new(&case.sizes), Activations::default());
        let outputs = network
            .forward(&case.parameters, &case.inputs, &mut activations)
            .to_vec();
        assert_close(&format!("{}: output", case.name), &outputs, &case.outputs);
        let mut gradient = vec![f32::NAN; network.parameter_count()];
        network.backward(
            &case.parameters,
            &case.inputs,
            &mut activations,
            &outputs,
            &mut gradient,
        );
        assert_gradient(&case.name, &network, &gradient, &case.gradient);
    });
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CategoricalCase {
    name: String,
    logits: Vec<f32>,
    log_probs: Vec<f64>,
    entropy: f64,
    /// `[choice × logit]`
    log_prob_gradients: Vec<f64>,
    entropy_gradient: Vec<f64>,
}

#[test]
fn categorical_distributions() {
    each(&reference().categorical, 7, |case| {
        let (name, choices) = (&case.name, case.logits.len());
        let mut log_probs = case.logits.clone();
        categorical::log_softmax_in_place(&mut log_probs, choices);
        assert_close(
            &format!("{name}: log-probability"),
            &log_probs,
            &case.log_probs,
        );
        assert_close(
            &format!("{name}: entropy"),
            &[categorical::entropy(&log_probs)],
            &[case.entropy],
        );

        let mut gradients = vec![f32::NAN; choices * choices];
        for (choice, gradient) in gradients.chunks_exact_mut(choices).enumerate() {
            categorical::log_prob_gradient(&log_probs, choice, 1.0, gradient);
        }
        assert_close(
            &format!("{name}: gradient of log-probability"),
            &gradients,
            &case.log_prob_gradients,
        );
        let mut gradient = vec![0.0; choices];
        categorical::add_entropy_gradient(&log_probs, 1.0, &mut gradient);
        assert_close(
            &format!("{name}: gradient of entropy"),
            &gradient,
            &case.entropy_gradient,
        );
    });
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GaussianCase {
    action: f32,
    mean: f32,
    log_deviation: f32,
    log_density: f64,
    /// With respect to μ and log σ.
    gradient: [f64; 2],
    entropy: f64,
}

#[test]
fn gaussian_distributions() {
    each(&reference().gaussian, 7, |case| {
        let &GaussianCase {
            action,
            mean,
            log_deviation,
            ..
        } = case;
        let name =
            |what| format!("action {action}, mean {mean}, log-deviation {log_deviation}: {what}");
        assert_close(
            &name("log-density"),
            &[gaussian::log_density(action, mean, log_deviation)],
            &[case.log_density],
        );
        assert_close(
            &name("gradient"),
            &gaussian::log_density_gradient(action, mean, log_deviation),
            &case.gradient,
        );
        assert_close(
            &name("entropy"),
            &[gaussian::entropy(log_deviation)],
            &[case.entropy],
        );
    });
}

#[derive(Clone, Copy, Debug, Deserialize)]
enum Loss {
    Simple,
    Ppo { clip: f32 },
    OffPac { cap: Option<f32> },
}

impl Loss {
    fn at(self, log_prob: f32, behaviour: f32, advantage: f32) -> Surrogate {
        let ratio = (log_prob - behaviour).exp();
        match self {
            Self::Simple => policy_loss::simple(log_prob, advantage),
            Self::Ppo { clip } => policy_loss::ppo(ratio, advantage, clip),
            Self::OffPac { cap } => policy_loss::off_pac(log_prob, ratio, advantage, cap),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PolicyLossCase {
    loss: Loss,
    log_prob: f32,
    behaviour: f32,
    advantage: f32,
    value: f64,
    slope: f64,
}

#[test]
fn policy_losses() {
    each(&reference().policy_losses, 60, |case| {
        let &PolicyLossCase {
            loss,
            log_prob,
            behaviour,
            advantage,
            ..
        } = case;
        let surrogate = loss.at(log_prob, behaviour, advantage);
        let name = |what| {
            format!("{loss:?} at log π {log_prob}, log μ {behaviour}, A {advantage}: {what}")
        };
        assert_close(&name("loss"), &[surrogate.loss], &[case.value]);
        assert_close(&name("slope"), &[surrogate.slope], &[case.slope]);
        assert_eq!(surrogate.clipped, case.slope == 0.0, "{}", name("clipped"));
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
struct PolicyCase {
    name: String,
    head: Head,
    loss: Loss,
    entropy_bonus: f32,
    sizes: Vec<usize>,
    parameters: Vec<f32>,
    states: Vec<f32>,
    actions: Vec<f32>,
    behaviour: Vec<f32>,
    advantages: Vec<f32>,
    value: f64,
    gradient: Vec<f64>,
}

impl PolicyCase {
    /// The objective's terms of one sample, and their gradient with respect to the network's
    /// outputs, as `agent::policy` composes it.
    fn sample(&self, index: usize, outputs: &[f32], gradient: &mut [f32]) -> f32 {
        let (action, weight) = (self.actions[index], 1.0 / self.actions.len() as f32);
        let surrogate = |log_prob| {
            self.loss
                .at(log_prob, self.behaviour[index], self.advantages[index])
        };
        match self.head {
            Head::Categorical { choices } => {
                let mut log_probs = outputs.to_vec();
                categorical::log_softmax_in_place(&mut log_probs, choices);
                let Surrogate { loss, slope, .. } = surrogate(log_probs[action as usize]);
                categorical::log_prob_gradient(
                    &log_probs,
                    action as usize,
                    weight * slope,
                    gradient,
                );
                categorical::add_entropy_gradient(
                    &log_probs,
                    -weight * self.entropy_bonus,
                    gradient,
                );
                weight * (loss - self.entropy_bonus * categorical::entropy(&log_probs))
            }
            Head::Gaussian {
                range: [low, high],
                initial_deviation,
            } => {
                let (center, half_range) = (0.5 * (low + high), 0.5 * (high - low));
                let relative = outputs[1] + initial_deviation.ln();
                // ∂H/∂log σ = 1.
                let free = if (-4.0..=1.0).contains(&relative) {
                    1.0
                } else {
                    0.0
                };
                let (mean, log_deviation) = (
                    half_range.mul_add(outputs[0], center),
                    relative.clamp(-4.0, 1.0) + half_range.ln(),
                );
                let Surrogate { loss, slope, .. } =
                    surrogate(gaussian::log_density(action, mean, log_deviation));
                let [by_mean, by_log_deviation] =
                    gaussian::log_density_gradient(action, mean, log_deviation);
                gradient[0] = weight * slope * by_mean * half_range;
                gradient[1] = free * weight * (slope * by_log_deviation - self.entropy_bonus);
                weight * (loss - self.entropy_bonus * gaussian::entropy(log_deviation))
            }
        }
    }
}

/// Mean loss − bonus · mean entropy, from the network's parameters on.
#[test]
fn whole_policies() {
    each(&reference().policies, 8, |case| {
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

        let mut gradient = vec![f32::NAN; network.parameter_count()];
        network.backward(
            &case.parameters,
            &case.states,
            &mut activations,
            &output_gradient,
            &mut gradient,
        );
        assert_gradient(&case.name, &network, &gradient, &case.gradient);
    });
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ValueCase {
    name: String,
    sizes: Vec<usize>,
    parameters: Vec<f32>,
    states: Vec<f32>,
    targets: Vec<f32>,
    weights: Vec<f32>,
    value: f64,
    gradient: Vec<f64>,
}

/// L = ½ mean w (Ŷ − Y)², so ∂L/∂Ŷ = w (Ŷ − Y) / B.
#[test]
fn whole_value_functions() {
    each(&reference().values, 2, |case| {
        let (network, mut activations) = (Mlp::new(&case.sizes), Activations::default());
        let outputs = network.forward(&case.parameters, &case.states, &mut activations);
        let errors: Vec<f32> = outputs
            .iter()
            .zip(&case.targets)
            .map(|(output, target)| output - target)
            .collect();
        let share = 1.0 / errors.len() as f32;
        let slopes: Vec<f32> = errors
            .iter()
            .zip(&case.weights)
            .map(|(error, weight)| share * weight * error)
            .collect();
        let value: f32 = errors
            .iter()
            .zip(&slopes)
            .map(|(error, slope)| 0.5 * error * slope)
            .sum();
        assert_close(&format!("{}: loss", case.name), &[value], &[case.value]);

        let mut gradient = vec![f32::NAN; network.parameter_count()];
        network.backward(
            &case.parameters,
            &case.states,
            &mut activations,
            &slopes,
            &mut gradient,
        );
        assert_gradient(&case.name, &network, &gradient, &case.gradient);
    });
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ActionValueCase {
    name: String,
    sizes: Vec<usize>,
    parameters: Vec<f32>,
    target: Vec<f32>,
    prior: Vec<f32>,
    /// θ̂
    start: Vec<f32>,
    states: Vec<f32>,
    next_states: Vec<f32>,
    actions: Vec<usize>,
    rewards: Vec<f32>,
    /// z
    seeds: Vec<f32>,
    discounts: Vec<f32>,
    weights: Vec<f32>,
    double: bool,
    /// β
    prior_scale: f32,
    /// λ
    regularisation: f32,
    value: f64,
    gradient: Vec<f64>,
}

impl ActionValueCase {
    /// Q = f + β p.
    fn values(&self, parameters: &[f32], states: &[f32]) -> Vec<f32> {
        let (network, mut activations) = (Mlp::new(&self.sizes), Activations::default());
        let learned = network
            .forward(parameters, states, &mut activations)
            .to_vec();
        let prior = network.forward(&self.prior, states, &mut activations);
        learned
            .iter()
            .zip(prior)
            .map(|(learned, prior)| self.prior_scale.mul_add(*prior, *learned))
            .collect()
    }

    /// r + z + γ Q′(s′, ·)
    fn targets(&self) -> Vec<f32> {
        let rewards: Vec<f32> = self
            .rewards
            .iter()
            .zip(&self.seeds)
            .map(|(reward, z)| reward + z)
            .collect();
        let judged = self.values(&self.target, &self.next_states);
        let online = self.values(&self.parameters, &self.next_states);
        let mut targets = Vec::new();
        q_learning::targets(
            &rewards,
            &self.discounts,
            &judged,
            if self.double { &online } else { &judged },
            &mut targets,
        );
        targets
    }
}

/// The loss of Seed TD (thesis §2.4), from the network's parameters on.
#[test]
fn whole_action_values() {
    each(&reference().action_values, 3, |case| {
        let (values, mut slopes) = (case.values(&case.parameters, &case.states), Vec::new());
        let loss = q_learning::squared_error(
            &values,
            &case.actions,
            &case.targets(),
            &case.weights,
            &mut slopes,
        );
        let pull: Vec<f32> = case
            .parameters
            .iter()
            .zip(&case.start)
            .map(|(now, start)| case.regularisation * (now - start))
            .collect();
        let penalty: f32 = pull
            .iter()
            .zip(&case.parameters)
            .zip(&case.start)
            .map(|((pull, now), start)| 0.5 * pull * (now - start))
            .sum();
        assert_close(
            &format!("{}: loss", case.name),
            &[loss + penalty],
            &[case.value],
        );

        let (network, mut activations) = (Mlp::new(&case.sizes), Activations::default());
        network.forward(&case.parameters, &case.states, &mut activations);
        let mut gradient = vec![f32::NAN; network.parameter_count()];
        network.backward(
            &case.parameters,
            &case.states,
            &mut activations,
            &slopes,
            &mut gradient,
        );
        gradient
            .iter_mut()
            .zip(pull)
            .for_each(|(slope, pull)| *slope += pull);
        assert_gradient(&case.name, &network, &gradient, &case.gradient);
    });
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AdamCase {
    name: String,
    settings: AdamSettings,
    factor: f64,
    start: Vec<f32>,
    /// `[step × parameter]`
    gradients: Vec<f32>,
    /// `[step × parameter]`
    trajectory: Vec<f64>,
}

/// The scale is that of a step. Most of the error is that of β₂ = 0.999 in single precision.
#[test]
fn steps_of_adam() {
    each(&reference().adam, 3, |case| {
        let (count, mut parameters) = (case.start.len(), case.start.clone());
        let mut optimiser = Adam::new(case.settings, count);
        let mut trajectory = Vec::new();
        for gradient in case.gradients.chunks_exact(count) {
            optimiser.descend(&mut parameters, gradient, case.factor);
            trajectory.extend_from_slice(&parameters);
        }
        assert_close_at_scale(
            &format!("{}: parameter", case.name),
            &trajectory,
            &case.trajectory,
            0.1,
        );
    });
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PopArtCase {
    name: String,
    beta: f64,
    sizes: Vec<usize>,
    parameters: Vec<f32>,
    inputs: Vec<f32>,
    /// Those of each update.
    targets: Vec<Vec<f32>>,
    means: Vec<f64>,
    deviations: Vec<f64>,
    /// σ Ŷ + μ, which no update may change.
    denormalized: Vec<f64>,
}

/// Denormalised outputs are differences of numbers as large as the moments, so that is their scale.
#[test]
fn updates_of_pop_art() {
    each(&reference().pop_art, 2, |case| {
        let (network, mut activations) = (Mlp::new(&case.sizes), Activations::default());
        let (mut parameters, mut normalizer) = (case.parameters.clone(), PopArt::new(case.beta));
        assert_eq!(case.means.len(), case.targets.len());
        for (update, targets) in case.targets.iter().enumerate() {
            let (weight, bias) = network.output_layer(&mut parameters);
            normalizer.update(targets, weight, bias);
            let (mean, deviation, name) = (
                normalizer.mean(),
                normalizer.deviation(),
                format!("{}: update {update}", case.name),
            );
            assert_close(
                &format!("{name}: mean"),
                &[mean],
                &case.means[update..=update],
            );
            assert_close(
                &format!("{name}: deviation"),
                &[deviation],
                &case.deviations[update..=update],
            );
            let normalized = network
                .forward(&parameters, &case.inputs, &mut activations)
                .iter();
            let outputs: Vec<f32> = normalized
                .map(|output| deviation.mul_add(*output, mean))
                .collect();
            assert_close_at_scale(
                &format!("{name}: output"),
                &outputs,
                &case.denormalized,
                case.means[update],
            );
        }
    });
}
