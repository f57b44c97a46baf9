//! Losses of value functions and action values.

use seedbed_learn::nn::{Activations, Mlp};
use seedbed_learn::rl::index_conditioned::{self, Indices};
use seedbed_learn::rl::q_learning;
use serde::Deserialize;

use super::{assert_close, assert_gradient, assert_parameter_gradient, check_cases, reference};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ValueCase {
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

        let point = (&case.parameters[..], &case.states[..]);
        assert_parameter_gradient(
            &case.name,
            &network,
            point,
            &mut activations,
            &slopes,
            &case.gradient,
        );
    });
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ActionValueCase {
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
pub(super) struct IndexedValueCase {
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
