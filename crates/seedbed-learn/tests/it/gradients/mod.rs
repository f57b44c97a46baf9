//! Compares every hand-written gradient with automatic differentiation, whose results
//! `gradients/reference.py` stores in `gradients/reference.json`; its first lines explain how to
//! run it.

mod distributions;
mod networks;
mod optimizers;
mod policies;
mod soft_actor_critic;
mod values;

use seedbed_learn::nn::{Activations, Mlp};
use serde::Deserialize;

use distributions::{CategoricalCase, GaussianCase, SquashedGaussianCase};
use networks::{HiddenLayerCase, NetworkCase};
use optimizers::{AdamCase, PopArtCase};
use policies::PolicyLossCase;
use soft_actor_critic::{SoftCriticCase, SoftPolicyCase};
use values::{ActionValueCase, IndexedValueCase, ValueCase};

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
    serde_json::from_str(include_str!("../../gradients/reference.json")).unwrap()
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

/// Compares the gradient of a loss with respect to the parameters of a network.
///
/// `activations` are those of the inputs, `slopes` is the gradient with respect to the outputs.
fn assert_parameter_gradient(
    name: &str,
    network: &Mlp,
    (parameters, inputs): (&[f32], &[f32]),
    activations: &mut Activations,
    slopes: &[f32],
    reference: &[f64],
) {
    let mut gradient = vec![f32::NAN; network.parameter_count()];
    network.backward(parameters, inputs, activations, slopes, &mut gradient);
    assert_gradient(name, network, &gradient, reference);
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

/// Compares numbers relative to the largest of them.
fn assert_largest(name: &str, ours: &[f32], reference: &[f64]) {
    let largest = reference.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    assert_close_at_scale(name, ours, reference, largest);
}
