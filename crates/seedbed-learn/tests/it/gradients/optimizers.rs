//! Steps of Adam, and the normalization of targets (Pop-Art).

use seedbed_learn::nn::{Activations, Adam, AdamSettings, Mlp, PopArt};
use serde::Deserialize;

use super::{assert_close, assert_close_at_scale, check_cases, reference};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AdamCase {
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
pub(super) struct PopArtCase {
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
