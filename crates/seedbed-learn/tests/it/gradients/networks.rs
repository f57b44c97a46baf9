//! Networks: all kinds of hidden layers.

use seedbed_learn::nn::{Activation, Activations, Mlp};
use serde::Deserialize;

use super::{assert_close, assert_gradient, assert_largest, check_cases, reference};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct NetworkCase {
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
pub(super) struct HiddenLayerCase {
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
pub(super) fn shape(sizes: &[usize], activation: Activation, normalized: bool) -> Mlp {
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
