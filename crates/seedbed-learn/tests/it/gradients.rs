//! Compares every hand-written gradient with automatic differentiation, whose results
//! `gradients/reference.py` stores in `gradients/reference.json`; its first lines explain how to
//! run it.

use seedbed_learn::nn::{Activation, Activations, Adam, AdamSettings, Mlp, PopArt};
use seedbed_learn::rl::index_conditioned::{self, Indices};
use seedbed_learn::rl::policy_loss::{self, Surrogate};
use seedbed_learn::rl::soft_actor_critic::{self, Combination};
use seedbed_learn::rl::{categorical, gaussian, q_learning, squashed_gaussian};
use serde::Deserialize;

/// Tolerance of a number, as a share of its scale.
///
/// Rounding to f32 adds an error of 6·10⁻⁸, and tanh of `nn` has an error of up to 4·10⁻⁷. With
/// three layers and a sum over forty samples, the errors of gradients are at most 2·10⁻⁶ of the
/// largest number of their tensor. The tolerance is ten times as large. A missing term, a wrong
/// sign or a wrong factor would change the first digits.
const TOLERANCE: f64 = 2e-5;

#[derive(Deserialize)]
struct Reference {
    networks: Vec<NetworkCase>,
    hidden_layers: Vec<HiddenLayerCase>,
    categorical: Vec<CategoricalCase>,
    gaussian: Vec<GaussianCase>,
    policy_losses: Vec<PolicyLossCase>,
    policies: Vec<PolicyCase>,
    values: Vec<ValueCase>,
    action_values: Vec<ActionValueCase>,
    indexed_values: Vec<IndexedValueCase>,
    squashed_gaussian: Vec<SquashedGaussianCase>,
    soft_critics: Vec<SoftCriticCase>,
    soft_policies: Vec<SoftPolicyCase>,
    adam: Vec<AdamCase>,
    pop_art: Vec<PopArtCase>,
}

fn reference() -> Reference {
    serde_json::from_str(include_str!("../gradients/reference.json")).unwrap()
}

/// Runs `check` on every case. There must be at least `min_count` cases.
fn check_cases<Case>(cases: &[Case], min_count: usize, check: impl Fn(&Case)) {
    assert!(
        cases.len() >= min_count,
        "{} cases; expected at least {min_count}",
        cases.len()
    );
    cases.iter().for_each(check);
}

/// Compares numbers that are sums of terms of about 1 or less, or of about the number's own size.
fn assert_close(name: &str, ours: &[f32], reference: &[f64]) {
    assert_close_at_scale(name, ours, reference, 1.0);
}

/// Compares the gradient of a network tensor by tensor, relative to each tensor's largest number.
fn assert_gradient(name: &str, network: &Mlp, ours: &[f32], reference: &[f64]) {
    assert_eq!(ours.len(), reference.len(), "{name}");
    let mut remaining = reference;
    for (tensor, _, ours) in network.tensors(ours) {
        let (reference, later) = remaining.split_at(ours.len());
        let largest = reference
            .iter()
            .fold(0.0, |largest: f64, number| largest.max(number.abs()));
        assert_close_at_scale(
            &format!("{name}: gradient of {tensor}"),
            ours,
            reference,
            largest,
        );
        remaining = later;
    }
}

/// Compares numbers with [`TOLERANCE`] relative to `scale`, or to the reference if it is larger.
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
fn gradients_of_networks_match_the_reference() {
    check_cases(&reference().networks, 2, |case| {
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
struct HiddenLayerCase {
    name: String,
    sizes: Vec<usize>,
    activation: Activation,
    normalized: bool,
    parameters: Vec<f32>,
    inputs: Vec<f32>,
    outputs: Vec<f64>,
    gradient: Vec<f64>,
    /// With respect to the second and the third of three inputs.
    input_gradient: Vec<f64>,
}

/// A network with rectified or normalized hidden layers.
fn shape(sizes: &[usize], activation: Activation, normalized: bool) -> Mlp {
    let network = Mlp::new(sizes).with_activation(activation);
    if normalized {
        network.with_layer_normalization()
    } else {
        network
    }
}

/// L = ½ Σ y², so ∂L/∂y = y.
#[test]
fn gradients_of_hidden_layers_match_the_reference() {
    check_cases(&reference().hidden_layers, 3, |case| {
        let network = shape(&case.sizes, case.activation, case.normalized);
        let mut activations = Activations::default();
        let (parameters, inputs) = (&case.parameters, &case.inputs);
        let outputs = network.forward(parameters, inputs, &mut activations);
        let outputs = outputs.to_vec();
        assert_close(&format!("{}: output", case.name), &outputs, &case.outputs);
        let mut gradient = vec![f32::NAN; network.parameter_count()];
        network.backward(
            parameters,
            inputs,
            &mut activations,
            &outputs,
            &mut gradient,
        );
        assert_gradient(&case.name, &network, &gradient, &case.gradient);
        let slopes = network.input_gradient(parameters, &mut activations, &outputs, 1..3);
        assert_largest(
            &format!("{}: inputs", case.name),
            slopes,
            &case.input_gradient,
        );
    });
}

/// Compares numbers relative to the largest of them.
fn assert_largest(name: &str, ours: &[f32], reference: &[f64]) {
    let largest = reference.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    assert_close_at_scale(name, ours, reference, largest);
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
fn categorical_distributions_match_the_reference() {
    check_cases(&reference().categorical, 7, |case| {
        let (name, choices) = (&case.name, case.logits.len());
        let mut log_probs = case.logits.clone();
        categorical::log_softmax_in_place(&mut log_probs, choices);
        let probabilities: Vec<f32> = log_probs.iter().copied().map(f32::exp).collect();
        assert_close(
            &format!("{name}: log-probability"),
            &log_probs,
            &case.log_probs,
        );
        assert_close(
            &format!("{name}: entropy"),
            &[categorical::entropy(&log_probs, &probabilities)],
            &[case.entropy],
        );

        let mut gradients = vec![f32::NAN; choices * choices];
        for (choice, gradient) in gradients.chunks_exact_mut(choices).enumerate() {
            categorical::log_prob_gradient(&probabilities, choice, 1.0, gradient);
        }
        assert_close(
            &format!("{name}: gradient of log-probability"),
            &gradients,
            &case.log_prob_gradients,
        );
        let mut gradient = vec![0.0; choices];
        categorical::add_entropy_gradient(&log_probs, &probabilities, 1.0, &mut gradient);
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
fn gaussian_distributions_match_the_reference() {
    check_cases(&reference().gaussian, 7, |case| {
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
struct PolicyLossCase {
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
struct PolicyCase {
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
fn gradients_of_value_functions_match_the_reference() {
    check_cases(&reference().values, 2, |case| {
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
    /// Initial parameters θ̂.
    start: Vec<f32>,
    states: Vec<f32>,
    next_states: Vec<f32>,
    actions: Vec<usize>,
    rewards: Vec<f32>,
    /// Reward seeds z.
    seeds: Vec<f32>,
    discounts: Vec<f32>,
    weights: Vec<f32>,
    double: bool,
    /// Scale β of the prior.
    prior_scale: f32,
    /// Weight λ of the regularization.
    regularization: f32,
    value: f64,
    gradient: Vec<f64>,
}

impl ActionValueCase {
    /// Values Q = f + β p of the learned network f and the prior p.
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

    /// Targets r + z + γ Q′(s′, ·).
    fn targets(&self) -> Vec<f32> {
        let rewards: Vec<f32> = self
            .rewards
            .iter()
            .zip(&self.seeds)
            .map(|(reward, z)| reward + z)
            .collect();
        let target_values = self.values(&self.target, &self.next_states);
        let online_values = self.values(&self.parameters, &self.next_states);
        let mut targets = Vec::new();
        q_learning::targets(
            &rewards,
            &self.discounts,
            &target_values,
            if self.double {
                &online_values
            } else {
                &target_values
            },
            &mut targets,
        );
        targets
    }

    /// The regularization term ½ λ ‖θ − θ̂‖² and its gradient λ (θ − θ̂).
    fn regularization(&self) -> (f32, Vec<f32>) {
        let gradient: Vec<f32> = self
            .parameters
            .iter()
            .zip(&self.start)
            .map(|(now, start)| self.regularization * (now - start))
            .collect();
        let term = gradient
            .iter()
            .zip(&self.parameters)
            .zip(&self.start)
            .map(|((slope, now), start)| 0.5 * slope * (now - start))
            .sum();
        (term, gradient)
    }
}

/// Gradients of the loss of Seed TD (thesis §2.4) with respect to the network's parameters.
#[test]
fn gradients_of_action_values_match_the_reference() {
    check_cases(&reference().action_values, 3, |case| {
        let (values, mut slopes) = (case.values(&case.parameters, &case.states), Vec::new());
        let loss = q_learning::squared_error(
            &values,
            &case.actions,
            &case.targets(),
            &case.weights,
            &mut slopes,
        );
        let (regularization, regularization_gradient) = case.regularization();
        assert_close(
            &format!("{}: loss", case.name),
            &[loss + regularization],
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
            .zip(regularization_gradient)
            .for_each(|(slope, term)| *slope += term);
        assert_gradient(&case.name, &network, &gradient, &case.gradient);
    });
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct IndexedValueCase {
    name: String,
    sizes: Vec<usize>,
    /// Number of coordinates M of an index.
    dimension: usize,
    /// Number of indices J per transition.
    samples: usize,
    sigma: f32,
    parameters: Vec<f32>,
    target: Vec<f32>,
    states: Vec<f32>,
    next_states: Vec<f32>,
    actions: Vec<usize>,
    rewards: Vec<f32>,
    /// Random vectors z.
    noise: Vec<f32>,
    /// Indices ξ, and ξ⁻ of the target.
    indices: Vec<f32>,
    target_indices: Vec<f32>,
    discounts: Vec<f32>,
    double: bool,
    value: f64,
    gradient: Vec<f64>,
}

impl IndexedValueCase {
    fn indices<'a>(&self, coordinates: &'a [f32]) -> Indices<'a> {
        Indices {
            coordinates,
            dimension: self.dimension,
            per_row: self.samples,
        }
    }

    fn values(&self, parameters: &[f32], states: &[f32], indices: &[f32]) -> Vec<f32> {
        let (network, mut activations) = (Mlp::new(&self.sizes), Activations::default());
        let heads = network.forward(parameters, states, &mut activations);
        let mut values = Vec::new();
        index_conditioned::values(heads, self.indices(indices), &mut values);
        values
    }

    /// Targets r + σ zᵀξ + γ Q′(s′, ·; ξ⁻).
    fn targets(&self) -> Vec<f32> {
        let (mut rewards, mut targets) = (Vec::new(), Vec::new());
        let own = self.indices(&self.indices);
        let (noise, sigma) = (&self.noise, self.sigma);
        index_conditioned::perturbed_rewards(&self.rewards, noise, sigma, own, &mut rewards);
        let next = |parameters| self.values(parameters, &self.next_states, &self.target_indices);
        let judged = next(&self.target);
        let choosing = if self.double {
            next(&self.parameters)
        } else {
            judged.clone()
        };
        let discounts = repeat(&self.discounts, self.samples);
        q_learning::targets(&rewards, &discounts, &judged, &choosing, &mut targets);
        targets
    }
}

/// Repeats each entry `count` times.
fn repeat<T: Copy>(entries: &[T], count: usize) -> Vec<T> {
    let repeated = entries.iter();
    repeated
        .flat_map(|&entry| std::iter::repeat_n(entry, count))
        .collect()
}

/// Gradients of the loss of HyperAgent with respect to the network's parameters.
#[test]
fn gradients_of_indexed_values_match_the_reference() {
    check_cases(&reference().indexed_values, 2, |case| {
        let values = case.values(&case.parameters, &case.states, &case.indices);
        let (mut slopes, mut output_gradient) = (Vec::new(), Vec::new());
        let actions = repeat(&case.actions, case.samples);
        let weights = vec![1.0; actions.len()];
        let targets = case.targets();
        let loss = q_learning::squared_error(&values, &actions, &targets, &weights, &mut slopes);
        assert_close(&format!("{}: loss", case.name), &[loss], &[case.value]);
        let own = case.indices(&case.indices);
        index_conditioned::heads_gradient(&slopes, own, &mut output_gradient);
        let (network, mut activations) = (Mlp::new(&case.sizes), Activations::default());
        network.forward(&case.parameters, &case.states, &mut activations);
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
struct SquashedGaussianCase {
    mean: f32,
    log_deviation: f32,
    noise: f32,
    action: f64,
    log_density: f64,
    /// Of ¾ log π(a) − 2a, with respect to μ and log σ.
    gradient: Vec<f64>,
}

#[test]
fn squashed_gaussian_distributions_match_the_reference() {
    check_cases(&reference().squashed_gaussian, 5, |case| {
        let (outputs, noise) = ([case.mean, case.log_deviation], [case.noise]);
        let name = |what| format!("μ {}, log σ {}: {what}", case.mean, case.log_deviation);
        let (mut actions, mut log_densities) = (Vec::new(), Vec::new());
        squashed_gaussian::sample(&outputs, &noise, &mut actions, &mut log_densities);
        assert_close(&name("action"), &actions, &[case.action]);
        assert_close(&name("log-density"), &log_densities, &[case.log_density]);
        let mut gradient = Vec::new();
        let samples = (&noise[..], &actions[..]);
        squashed_gaussian::policy_gradient(&outputs, samples, &[2.0], (0.75, 1), &mut gradient);
        assert_close(&name("gradient"), &gradient, &case.gradient);
    });
}

/// Rows of states with the actions that belong to them.
fn join(states: &[f32], actions: &[f32], batch: usize) -> Vec<f32> {
    let (width, components) = (states.len() / batch, actions.len() / batch);
    let rows = states.chunks(width).zip(actions.chunks(components));
    rows.flat_map(|(state, action)| [state, action].concat())
        .collect()
}

/// Actions and log π of a policy in some states: [B × d] and [B].
fn sample(
    (sizes, parameters): (&[usize], &[f32]),
    states: &[f32],
    noise: &[f32],
) -> (Vec<f32>, Vec<f32>, Vec<f32>, Activations) {
    let policy = shape(sizes, Activation::Relu, false);
    let mut activations = Activations::default();
    let outputs = policy
        .forward(parameters, states, &mut activations)
        .to_vec();
    let (mut actions, mut log_densities) = (Vec::new(), Vec::new());
    squashed_gaussian::sample(&outputs, noise, &mut actions, &mut log_densities);
    let rows = log_densities.chunks(policy.outputs() / 2);
    let log_probs = rows.map(|row| row.iter().sum()).collect();
    (outputs, actions, log_probs, activations)
}

/// A learned network plus β times a prior.
struct ReferenceCritic<'a> {
    network: Mlp,
    parameters: &'a [f32],
    prior: &'a [f32],
    prior_scale: f32,
}

impl ReferenceCritic<'_> {
    fn values(&self, inputs: &[f32]) -> Vec<f32> {
        let evaluate = |parameters| {
            let mut activations = Activations::default();
            self.network
                .forward(parameters, inputs, &mut activations)
                .to_vec()
        };
        let values = evaluate(self.parameters).into_iter();
        values
            .zip(evaluate(self.prior))
            .map(|(value, prior)| value + self.prior_scale * prior)
            .collect()
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SoftCriticCase {
    name: String,
    normalized: bool,
    prior_scale: f32,
    regularization: f32,
    alpha: f32,
    policy_sizes: Vec<usize>,
    policy: Vec<f32>,
    sizes: Vec<usize>,
    parameters: Vec<f32>,
    start: Vec<f32>,
    targets: Vec<Vec<f32>>,
    priors: Vec<Vec<f32>>,
    states: Vec<f32>,
    next_states: Vec<f32>,
    actions: Vec<f32>,
    noise: Vec<f32>,
    rewards: Vec<f32>,
    discounts: Vec<f32>,
    wanted: Vec<f64>,
    value: f64,
    gradient: Vec<f64>,
}

/// ½ mean (y − Q)² + ½ λ ‖θ − θ̂‖² for constant targets y.
#[test]
fn gradients_of_soft_critics_match_the_reference() {
    check_cases(&reference().soft_critics, 2, |case| {
        let batch = case.rewards.len();
        let network = shape(&case.sizes, Activation::Relu, case.normalized);
        let critic = |parameters, prior| ReferenceCritic {
            network: network.clone(),
            parameters,
            prior,
            prior_scale: case.prior_scale,
        };
        let policy = (&case.policy_sizes[..], &case.policy[..]);
        let (_, actions, log_probs, _) = sample(policy, &case.next_states, &case.noise);
        let inputs = join(&case.next_states, &actions, batch);
        let pairs = case.targets.iter().zip(&case.priors);
        let next_values: Vec<f32> = pairs
            .flat_map(|(target, prior)| critic(target, prior).values(&inputs))
            .collect();
        let mut targets = Vec::new();
        soft_actor_critic::targets(
            &case.rewards,
            &case.discounts,
            &next_values,
            &log_probs,
            case.alpha,
            &mut targets,
        );
        assert_close(&format!("{}: targets", case.name), &targets, &case.wanted);

        let inputs = join(&case.states, &case.actions, batch);
        let values = critic(&case.parameters, &case.priors[0]).values(&inputs);
        let mut output_gradient = Vec::new();
        let loss = soft_actor_critic::squared_error(&values, &targets, &mut output_gradient);
        let mut gradient = vec![f32::NAN; network.parameter_count()];
        let mut activations = Activations::default();
        network.forward(&case.parameters, &inputs, &mut activations);
        network.backward(
            &case.parameters,
            &inputs,
            &mut activations,
            &output_gradient,
            &mut gradient,
        );
        let mut pull = 0.0;
        let pairs = case.parameters.iter().zip(&case.start);
        for (slope, (parameter, start)) in gradient.iter_mut().zip(pairs) {
            *slope += case.regularization * (parameter - start);
            pull += 0.5 * case.regularization * (parameter - start).powi(2);
        }
        assert_close(
            &format!("{}: loss", case.name),
            &[loss + pull],
            &[case.value],
        );
        assert_gradient(&case.name, &network, &gradient, &case.gradient);
    });
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SoftPolicyCase {
    name: String,
    combination: Combination,
    normalized: bool,
    prior_scale: f32,
    alpha: f32,
    target_entropy: f32,
    policy_sizes: Vec<usize>,
    policy: Vec<f32>,
    sizes: Vec<usize>,
    critics: Vec<Vec<f32>>,
    priors: Vec<Vec<f32>>,
    states: Vec<f32>,
    noise: Vec<f32>,
    value: f64,
    gradient: Vec<f64>,
    temperature_slope: f64,
}

/// mean(α log π(a|s) − Q(s, a)), through the critics to the parameters of the policy.
#[test]
fn gradients_of_soft_policies_match_the_reference() {
    check_cases(&reference().soft_policies, 2, |case| {
        let network = shape(&case.sizes, Activation::Relu, case.normalized);
        let policy = (&case.policy_sizes[..], &case.policy[..]);
        let (outputs, actions, log_probs, mut activations) =
            sample(policy, &case.states, &case.noise);
        let batch = log_probs.len();
        let inputs = join(&case.states, &actions, batch);
        let mut values = Vec::new();
        for (parameters, prior) in case.critics.iter().zip(&case.priors) {
            let critic = ReferenceCritic {
                network: network.clone(),
                parameters,
                prior,
                prior_scale: case.prior_scale,
            };
            values.extend(critic.values(&inputs));
        }
        let mut weights = Vec::new();
        let value = soft_actor_critic::combine(&values, batch, case.combination, &mut weights);
        let mean_log_prob = log_probs.iter().sum::<f32>() / batch as f32;
        let objective = case.alpha * mean_log_prob - value;
        assert_close(
            &format!("{}: objective", case.name),
            &[objective],
            &[case.value],
        );

        let mut slopes = vec![0.0; actions.len()];
        let columns = case.states.len() / batch..network.inputs();
        let terms = case.critics.iter().zip(&case.priors);
        for (weights, (critic, prior)) in weights.chunks_exact(batch).zip(terms) {
            for (factor, parameters) in [(1.0, critic), (case.prior_scale, prior)] {
                let mut activations = Activations::default();
                network.forward(parameters, &inputs, &mut activations);
                let part =
                    network.input_gradient(parameters, &mut activations, weights, columns.clone());
                for (slope, part) in slopes.iter_mut().zip(part) {
                    *slope += factor * part;
                }
            }
        }
        let mut output_gradient = Vec::new();
        squashed_gaussian::policy_gradient(
            &outputs,
            (&case.noise, &actions),
            &slopes,
            (case.alpha, batch),
            &mut output_gradient,
        );
        let policy = shape(&case.policy_sizes, Activation::Relu, false);
        let mut gradient = vec![f32::NAN; policy.parameter_count()];
        policy.backward(
            &case.policy,
            &case.states,
            &mut activations,
            &output_gradient,
            &mut gradient,
        );
        assert_gradient(&case.name, &policy, &gradient, &case.gradient);
        let slope = soft_actor_critic::log_temperature_slope(&log_probs, case.target_entropy);
        assert_close(
            &format!("{}: temperature", case.name),
            &[slope],
            &[case.temperature_slope],
        );
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

/// Errors are relative to the size of a step, about 0.1. Most of the error comes from rounding β₂ =
/// 0.999 to single precision.
#[test]
fn steps_of_adam_match_the_reference() {
    check_cases(&reference().adam, 3, |case| {
        let (count, mut parameters) = (case.start.len(), case.start.clone());
        let mut optimizer = Adam::new(case.settings, count);
        let mut trajectory = Vec::new();
        for gradient in case.gradients.chunks_exact(count) {
            optimizer.descend(&mut parameters, gradient, case.factor);
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
    /// Targets of each update.
    targets: Vec<Vec<f32>>,
    means: Vec<f64>,
    deviations: Vec<f64>,
    /// σ Ŷ + μ, which no update may change.
    denormalized: Vec<f64>,
}

/// Denormalized outputs are differences of numbers as large as the moments, so their errors are
/// relative to the mean.
#[test]
fn updates_of_pop_art_match_the_reference() {
    check_cases(&reference().pop_art, 2, |case| {
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
