//! Networks that several agents share, with a one-hot code of the agent as further inputs.
//!
//! The code adds one row of the first layer's weights to its outputs, so that for each agent the network is
//! one without a code, with first-layer biases of this agent's own. Embeddings that are learned for each
//! agent, as in SAPG (Singla, Agarwal & Pathak 2024), add such a row, too.

use super::Mlp;

/// A network with a one-hot code as further inputs.
#[derive(Clone, Debug)]
pub(crate) struct CodedNetwork {
    /// The network that it is for one code.
    plain: Mlp,
    codes: usize,
}

impl CodedNetwork {
    /// `plain` with a code of this number of agents as further inputs.
    pub(crate) fn new(plain: Mlp, codes: usize) -> Self {
        Self { plain, codes }
    }

    /// The network that it is for one code.
    pub(crate) fn plain(&self) -> &Mlp {
        &self.plain
    }

    /// Its shape.
    pub(crate) fn mlp(&self) -> Mlp {
        self.plain.with_further_inputs(self.codes)
    }

    /// The parameters of the first of these plain networks, with the first-layer biases of each for its code.
    /// `plain: [codes][P]`
    pub(crate) fn join(&self, plain: &[&[f32]]) -> Vec<f32> {
        let [weights, biases] = self.first_layer();
        let (first, rest) = plain[0].split_at(weights);
        let own_biases = plain.iter().flat_map(|own| &own[weights..][..biases]);
        let code_weights = own_biases
            .zip(rest[..biases].iter().cycle())
            .map(|(own, shared)| own - shared);
        let first = first.iter().copied();
        first
            .chain(code_weights)
            .chain(rest.iter().copied())
            .collect()
    }

    /// Sets `plain` to the network that `joined` is for one code.   `joined: [P + codes × units]` →
    /// `plain: [P]`
    pub(crate) fn select(&self, joined: &[f32], code: usize, plain: &mut [f32]) {
        let [weights, biases] = self.first_layer();
        let (first, rest) = joined.split_at(weights);
        let (code_weights, rest) = rest.split_at(self.codes * biases);
        plain[..weights].copy_from_slice(first);
        plain[weights..].copy_from_slice(rest);
        let own = &code_weights[code * biases..][..biases];
        for (bias, own) in plain[weights..].iter_mut().zip(own) {
            *bias += own;
        }
    }

    /// Appends rows of inputs, each with the same code.   `inputs: [N × plain inputs]` → `coded: [N ×
    /// inputs]`
    pub(crate) fn append_inputs(&self, inputs: &[f32], code: usize, coded: &mut Vec<f32>) {
        for row in inputs.chunks_exact(self.plain.inputs()) {
            coded.extend_from_slice(row);
            coded.extend((0..self.codes).map(|other| f32::from(u8::from(other == code))));
        }
    }

    /// Numbers of weights and of biases of the plain network's first layer.
    fn first_layer(&self) -> [usize; 2] {
        let units = self.plain.units_of_first_layer();
        [self.plain.inputs() * units, units]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::{Activations, Initial};
    use rand::SeedableRng;

    /// For each code the joined network has the outputs of its plain network: first that of the first one with
    /// biases of its own, then, when code weights have changed, the sum of both.
    #[test]
    fn a_coded_network_is_one_plain_network_for_each_code() {
        let plain_shape = Mlp::new(&[2, 3, 1]);
        let coded = CodedNetwork::new(plain_shape.clone(), 2);
        let mut random = seedbed_random::Stream::seed_from_u64(3);
        let networks: [Vec<f32>; 2] =
            [(); 2].map(|()| plain_shape.initial_parameters(Initial::Random, &mut random));
        let mut joined = coded.join(&[&networks[0], &networks[1]]);
        assert_eq!(joined.len(), coded.mlp().parameter_count());
        // The weights of the second code's first unit: after 2 · 3 weights and the 3 of the first code.
        joined[9] += 0.25;
        let output = |shape: &Mlp, parameters: &[f32], inputs: &[f32]| {
            shape.forward(parameters, inputs, &mut Activations::default())[0]
        };
        for code in 0..2 {
            let mut plain = networks[0].clone();
            coded.select(&joined, code, &mut plain);
            let change = if code == 1 { 0.25 } else { 0.0 };
            let own_biases = &networks[code][6..9];
            for (unit, (bias, own)) in plain[6..9].iter().zip(own_biases).enumerate() {
                let expected = own + if unit == 0 { change } else { 0.0 };
                assert!((bias - expected).abs() < 1e-6);
            }
            assert_eq!(plain[..6], networks[0][..6]);
            assert_eq!(plain[9..], networks[0][9..]);
            let mut inputs = Vec::new();
            coded.append_inputs(&[0.3, -0.8], code, &mut inputs);
            let difference =
                output(&plain_shape, &plain, &[0.3, -0.8]) - output(&coded.mlp(), &joined, &inputs);
            assert!(difference.abs() < 1e-6);
        }
    }
}
