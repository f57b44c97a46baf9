//! Critics and policies of the soft actor-critic.

use seedbed_learn::nn::{Activation, Activations, Mlp};
use seedbed_learn::rl::soft_actor_critic::{self, Combination};
use seedbed_learn::rl::squashed_gaussian;
use serde::Deserialize;

use super::networks::shape;
use super::{assert_close, assert_gradient, check_cases, reference};

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
pub(super) struct SoftCriticCase {
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
pub(super) struct SoftPolicyCase {
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
