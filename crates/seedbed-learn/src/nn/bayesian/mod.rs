//! A Bayesian neural network whose weights are independent Gaussians (thesis §4.2; Blundell et al.
//! 2015, "Bayes by Backprop").
//!
//! The posterior q(w; φ) with φ = {μ, ρ} and σ = log(1 + eᵖ) minimizes the loss per sample,
//! KL(q‖prior)/N − `E_q`[log p(y|x; w)]. The caller provides the noise as standard-normal numbers
//! from its own random streams.

mod gaussian;
mod likelihood;
#[cfg(test)]
mod reference;

pub use gaussian::DiagonalGaussian;
pub use likelihood::{Draws, Likelihood, PassBuffers};

use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::gaussian::{multiply_by_softplus_slope, softplus_in_place, softplus_inverse};
use super::{Adam, AdamSettings, Initial, Mlp};
use seedbed_input::numbers::{Positive, ranged_number};

/// Parameters of a Bayesian network.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BayesianSettings {
    /// Initial standard deviation σ of every weight, from 0.000123 to 1.313.
    pub initial_deviation: Positive,
    /// Standard deviation of the prior of every weight; its mean is 0.
    pub prior_deviation: Positive,
    /// Fixed standard deviation s of targets around the network's outputs.
    pub likelihood_deviation: Positive,
    /// Optimizer of μ and ρ.
    pub optimizer: AdamSettings,
}

impl Default for BayesianSettings {
    fn default() -> Self {
        let (initial_deviation, prior_deviation, likelihood_deviation) =
            (ranged_number(0.2), ranged_number(0.5), ranged_number(1.0));
        Self {
            initial_deviation,
            prior_deviation,
            likelihood_deviation,
            optimizer: AdamSettings::default(),
        }
    }
}

/// A network that learns a distribution over its weights.
#[derive(Clone, Debug)]
pub struct BayesianNetwork {
    likelihood: Likelihood,
    state: BayesianState,
    /// The posterior q of `state` in terms of (μ, σ).
    posterior: DiagonalGaussian,
    scratch: Scratch,
}

/// The part of a network that learning changes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BayesianState {
    /// All μ, then all ρ: `[2P]`.
    parameters: Vec<f32>,
    prior: DiagonalGaussian,
    optimizer: Adam,
}

/// Bounds of ρ, which keep σ from vanishing and from growing beyond the scale of the weights.
const RHO_BOUNDS: [f32; 2] = [-9.0, 1.0];

/// Buffers that are reused.
#[derive(Clone, Debug, Default)]
struct Scratch {
    pass: PassBuffers,
    weights: Vec<f32>,
    antithetic_noise: Vec<f32>,
    weight_gradient: Vec<f32>,
    /// ∂L/∂μ, then ∂L/∂ρ: `[2P]`.
    gradient: Vec<f32>,
}

impl BayesianNetwork {
    /// A network with these layer sizes, starting with the inputs. Initial means are uniform within
    /// ±1/√(inputs of the layer).
    ///
    /// # Panics
    /// If there are fewer than two sizes, or if a size is 0.
    pub fn new(sizes: &[usize], settings: &BayesianSettings, random: &mut impl Rng) -> Self {
        let mut parameters = Mlp::new(sizes).initial_parameters(Initial::Random, random);
        let count = parameters.len();
        let rho = softplus_inverse(settings.initial_deviation.get_f32())
            .clamp(RHO_BOUNDS[0], RHO_BOUNDS[1]);
        parameters.resize(2 * count, rho);
        let prior = DiagonalGaussian::isotropic(count, settings.prior_deviation.get_f32());
        let state = BayesianState {
            parameters,
            prior,
            optimizer: Adam::new(settings.optimizer, 2 * count),
        };
        let likelihood = Likelihood::new(sizes, settings.likelihood_deviation.get_f32());
        let mut network = Self {
            likelihood,
            posterior: state.prior.clone(),
            state,
            scratch: Scratch::default(),
        };
        network.refresh_posterior();
        network
    }

    /// One step of Adam on KL(q‖prior)/N plus the mean of −log p(y|x; w) over the minibatch and
    /// over draws w = μ ± σ ε (thesis Eq. 27; Eq. 33 with the mean over draws and the divergence in
    /// closed form).   `inputs: [B × in]`, `targets: [B × out]`, `noise: [n × P]`, `data_count`: N
    ///
    /// Each ε is used twice, as ε and −ε (an antithetic pair), which cancels the odd part of the
    /// noise in the gradient.
    ///
    /// # Panics
    /// If a slice is empty or has another shape.
    pub fn descend(&mut self, inputs: &[f32], targets: &[f32], noise: &[f32], data_count: usize) {
        self.compute_gradient(inputs, targets, noise, data_count);
        self.state
            .optimizer
            .descend(&mut self.state.parameters, &self.scratch.gradient, 1.0);
        let count = self.likelihood.weight_count();
        for rho in &mut self.state.parameters[count..] {
            *rho = rho.clamp(RHO_BOUNDS[0], RHO_BOUNDS[1]);
        }
        self.refresh_posterior();
    }

    /// Replaces the prior by the present posterior, so that what was learned is kept when the data
    /// are no longer available.
    pub fn make_posterior_the_prior(&mut self) {
        self.state.prior.clone_from(&self.posterior);
    }

    /// Copies the posterior of a network of the same shape. Training must not continue from the copy,
    /// because it lacks the optimizer's moments and the prior.
    pub(crate) fn copy_posterior(&mut self, other: &Self) {
        self.state.parameters.clone_from(&other.state.parameters);
        self.posterior.clone_from(&other.posterior);
    }

    /// The posterior q(w; φ) in terms of (μ, σ).
    #[must_use]
    pub fn posterior(&self) -> &DiagonalGaussian {
        &self.posterior
    }

    /// The prior of the weights.
    #[must_use]
    pub fn prior(&self) -> &DiagonalGaussian {
        &self.state.prior
    }

    /// The likelihood p(y|x; w).
    #[must_use]
    pub fn likelihood(&self) -> &Likelihood {
        &self.likelihood
    }

    /// The part that learning changes, to be stored.
    #[must_use]
    pub fn state(&self) -> &BayesianState {
        &self.state
    }

    /// Continues from a stored state.
    ///
    /// # Panics
    /// If the state has another number of weights: see [`BayesianState::weight_count`].
    pub fn restore(&mut self, state: BayesianState) {
        assert_eq!(state.weight_count(), self.likelihood.weight_count());
        self.state = state;
        self.refresh_posterior();
    }

    /// Computes the gradient of the loss; returns the mean of −log p(y|x; w) over draws and samples,
    /// nats.
    fn compute_gradient(
        &mut self,
        inputs: &[f32],
        targets: &[f32],
        noise: &[f32],
        data_count: usize,
    ) -> f64 {
        let count = self.likelihood.weight_count();
        let rows = inputs.len() / self.likelihood.inputs();
        assert!(
            rows > 0 && data_count > 0 && !noise.is_empty() && noise.len().is_multiple_of(count)
        );
        let draws = 2 * (noise.len() / count);
        self.scratch.gradient.clear();
        self.scratch.gradient.resize(2 * count, 0.0);
        let scale = -1.0 / (draws * rows) as f32;
        let log_likelihood: f64 = noise
            .chunks_exact(count)
            .map(|noise| self.add_antithetic_pair(inputs, targets, noise, scale))
            .sum();
        let (mean_gradient, rho_gradient) = self.scratch.gradient.split_at_mut(count);
        self.posterior.add_divergence_gradient(
            &self.state.prior,
            1.0 / data_count as f32,
            mean_gradient,
            rho_gradient,
        );
        // So far, `rho_gradient` is the gradient with respect to σ.
        multiply_by_softplus_slope(&self.state.parameters[count..], rho_gradient);
        -log_likelihood / (draws * rows) as f64
    }

    /// Adds the gradients of the draws with ε and −ε; returns Σ log p(y|x; w) over both draws and
    /// all samples.
    fn add_antithetic_pair(
        &mut self,
        inputs: &[f32],
        targets: &[f32],
        noise: &[f32],
        scale: f32,
    ) -> f64 {
        let mut antithetic = std::mem::take(&mut self.scratch.antithetic_noise);
        antithetic.clear();
        antithetic.extend(noise.iter().map(|noise| -noise));
        let sum = self.add_draw(inputs, targets, noise, scale)
            + self.add_draw(inputs, targets, &antithetic, scale);
        self.scratch.antithetic_noise = antithetic;
        sum
    }

    /// Adds `scale` · ∂ log p/∂w and `scale` · ε ∂ log p/∂w of one draw to the gradients with
    /// respect to μ and σ; returns Σ log p(y|x; w).
    fn add_draw(&mut self, inputs: &[f32], targets: &[f32], noise: &[f32], scale: f32) -> f64 {
        let Scratch {
            pass,
            weights,
            weight_gradient,
            gradient,
            ..
        } = &mut self.scratch;
        self.posterior.draw(noise, weights);
        weight_gradient.resize(noise.len(), 0.0);
        let log_likelihood = self
            .likelihood
            .forward_and_backward(weights, inputs, targets, scale, pass);
        self.likelihood.gradient(inputs, pass, weight_gradient);
        let (mean_gradient, deviation_gradient) = gradient.split_at_mut(noise.len());
        likelihood::add_gradient_of_draw(weight_gradient, noise, mean_gradient, deviation_gradient);
        log_likelihood
    }

    /// Sets the posterior from the parameters of the state.
    fn refresh_posterior(&mut self) {
        let (mean, rho) = self
            .state
            .parameters
            .split_at(self.likelihood.weight_count());
        self.posterior.mean.copy_from_slice(mean);
        self.posterior.deviation.copy_from_slice(rho);
        softplus_in_place(&mut self.posterior.deviation);
    }
}

impl BayesianState {
    /// Number of weights P of the network; 0 if the lengths of the state's vectors do not fit
    /// together.
    #[must_use]
    pub fn weight_count(&self) -> usize {
        let count = self.prior.mean.len();
        if self.parameters.len() == 2 * count && self.prior.deviation.len() == count {
            count
        } else {
            0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::reference::normals;
    use super::*;
    use proptest::prelude::*;
    use seedbed_random::{Purpose, stream};

    fn network(seed: u64, sizes: &[usize], settings: &BayesianSettings) -> BayesianNetwork {
        BayesianNetwork::new(
            sizes,
            settings,
            &mut stream(seed, Purpose::InitialParameters, 0, 0),
        )
    }

    #[test]
    fn initial_posterior_and_prior_match_the_settings() {
        let network = network(1, &[3, 8, 2], &BayesianSettings::default());
        assert_eq!(network.likelihood().weight_count(), 4 * 8 + 9 * 2);
        assert!(
            network
                .posterior()
                .deviation
                .iter()
                .all(|sigma| (sigma - 0.2).abs() < 1e-6)
        );
        assert_eq!(*network.prior(), DiagonalGaussian::isotropic(50, 0.5));
        assert!(
            network
                .posterior()
                .mean
                .iter()
                .all(|mean| mean.abs() <= 1.0 / 3.0_f32.sqrt())
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// The loss and its gradient agree with a simple implementation in double precision and its
        /// central differences.
        #[test]
        fn gradient_agrees_with_central_differences(seed in 0..1_000_000_u64, pairs in 1..3_usize, batch in 1..3_usize) {
            let (sizes, deviation) = ([2, 4, 3, 2], 0.6);
            let settings = BayesianSettings { likelihood_deviation: ranged_number(deviation), ..BayesianSettings::default() };
            let mut network = network(seed, &sizes, &settings);
            let count = network.likelihood().weight_count();
            network.state.parameters[count..].iter_mut().zip(normals(seed, count)).for_each(|(rho, z)| *rho += 0.5 * z);
            network.refresh_posterior();
            let (inputs, targets) = (normals(seed + 1, 2 * batch), normals(seed + 2, 2 * batch));
            let noise = normals(seed + 3, pairs * count);
            let found_nll = network.compute_gradient(&inputs, &targets, &noise, 5);

            let loss_terms = |phi: &[f64]| -> [f64; 2] {
                let (mean, rho) = phi.split_at(count);
                let sigma: Vec<f64> = rho.iter().map(|rho| rho.exp().ln_1p()).collect();
                let mut nll = 0.0;
                for (noise, sign) in noise.chunks(count).flat_map(|noise| [(noise, 1.0), (noise, -1.0)]) {
                    let moments = mean.iter().zip(&sigma).zip(noise);
                    let weights: Vec<f64> = moments.map(|((mean, sigma), &noise)| mean + sign * sigma * f64::from(noise)).collect();
                    for (input, target) in inputs.chunks(2).zip(targets.chunks(2)) {
                        nll -= reference::log_likelihood(&sizes, f64::from(deviation as f32), &weights, input, target);
                    }
                }
                let divergences = mean.iter().zip(&sigma).map(|(mean, sigma)| 0.5 * ((sigma / 0.5).powi(2) + (mean / 0.5).powi(2) - 1.0) - (sigma / 0.5).ln());
                [divergences.sum(), nll / (2 * pairs * batch) as f64]
            };
            let phi: Vec<f64> = network.state.parameters.iter().map(|&x| f64::from(x)).collect();
            let [divergence, nll] = loss_terms(&phi);
            let found_divergence = network.posterior().divergence(network.prior());
            prop_assert!((found_divergence - divergence).abs() < 1e-4 * (1.0 + divergence));
            prop_assert!((found_nll - nll).abs() < 1e-4 * (1.0 + nll));
            let expected = reference::gradient(&phi, |phi| loss_terms(phi)[0] / 5.0 + loss_terms(phi)[1]);
            let scale = expected.iter().map(|g| g.abs()).fold(1.0, f64::max);
            for (found, expected) in network.scratch.gradient.iter().zip(expected) {
                prop_assert!((f64::from(*found) - expected).abs() < 1e-4 * scale, "{found} {expected}");
            }
        }
    }

    /// y = w₁x₁ + w₂x₂ + b, s = ½, prior 𝒩(0, ½²), over the full factorial x ∈ {±1} × {±2}, twice:
    /// XᵀX = diag(8, 32, 8) is diagonal, so the conjugate posterior is mean-field: Λ = 1/0.25 +
    /// XᵀX/0.25 = 36, 132, 36, μ = Λ⁻¹ Xᵀy/0.25, σ² = 1/Λ. With y = x₁ − 0.4 x₂ + 0.6: μ = 32/36,
    /// −0.4·128/132, 0.6·32/36.
    #[test]
    fn posterior_of_a_linear_model_is_the_conjugate_posterior() {
        let settings = BayesianSettings {
            likelihood_deviation: ranged_number(0.5),
            ..BayesianSettings::default()
        };
        let mut network = network(2, &[2, 1], &settings);
        let inputs = [1.0, 2.0, 1.0, -2.0, -1.0, 2.0, -1.0, -2.0].repeat(2);
        let targets: Vec<f32> = inputs.chunks(2).map(|x| x[0] - 0.4 * x[1] + 0.6).collect();
        let noise = normals(5, 20_000 * 12);
        let (mut mean, mut deviation) = ([0.0; 3], [0.0; 3]);
        for (step, noise) in noise.chunks(12).enumerate() {
            network.descend(&inputs, &targets, noise, 8);
            // Average over the second half, because Adam keeps fluctuating around the optimum.
            if step >= 10_000 {
                for i in 0..3 {
                    mean[i] += network.posterior().mean[i] / 10_000.0;
                    deviation[i] += network.posterior().deviation[i] / 10_000.0;
                }
            }
        }
        let precision = [36.0_f32, 132.0, 36.0];
        let expected = [32.0 / 36.0, -0.4 * 128.0 / 132.0, 0.6 * 32.0 / 36.0];
        for i in 0..3 {
            assert!(
                (mean[i] - expected[i]).abs() < 2e-3,
                "{i}: mean {} {}",
                mean[i],
                expected[i]
            );
            assert!(
                (deviation[i] * precision[i].sqrt() - 1.0).abs() < 0.02,
                "{i}: {} {}",
                deviation[i],
                precision[i].sqrt().recip()
            );
        }
    }

    #[test]
    fn rho_stays_within_its_bounds() {
        let fast = AdamSettings {
            step_size: ranged_number(5.0),
            ..AdamSettings::default()
        };
        let mut network = network(
            3,
            &[1, 4, 1],
            &BayesianSettings {
                optimizer: fast,
                ..BayesianSettings::default()
            },
        );
        for step in 0..20 {
            network.descend(&[0.5], &[0.0], &normals(step, 13), 1000);
            assert!(
                network.state.parameters[13..]
                    .iter()
                    .all(|rho| (-9.0..=1.0).contains(rho))
            );
        }
        assert!(
            network.state.parameters[13..]
                .iter()
                .any(|rho| [-9.0, 1.0].contains(rho)),
            "no bound was reached"
        );
    }

    /// With the posterior as the new prior, training without informative data does not change it;
    /// with the old prior, it returns towards 𝒩(0, ½²).
    #[test]
    fn a_posterior_as_prior_keeps_what_was_learned() {
        let mut with_new_prior = network(4, &[1, 1], &BayesianSettings::default());
        let (inputs, targets) = ([1.0, -1.0], [1.5, -1.5]);
        for step in 0..3000 {
            with_new_prior.descend(&inputs, &targets, &normals(step, 4), 50);
        }
        let learned = with_new_prior.posterior().mean[0];
        assert!(learned > 1.0, "{learned}");
        let mut with_old_prior = with_new_prior.clone();
        with_new_prior.make_posterior_the_prior();
        assert_eq!(
            with_new_prior
                .posterior()
                .divergence(with_new_prior.prior()),
            0.0
        );
        for step in 0..1000 {
            // A sample at x = 0 has no information about the slope, so only the prior changes it.
            with_new_prior.descend(&[0.0], &[0.0], &normals(step, 4), 1);
            with_old_prior.descend(&[0.0], &[0.0], &normals(step, 4), 1);
        }
        assert!(
            (with_new_prior.posterior().mean[0] - learned).abs() < 0.02,
            "{} {learned}",
            with_new_prior.posterior().mean[0]
        );
        assert!(
            with_old_prior.posterior().mean[0] < learned - 0.4,
            "{} {learned}",
            with_old_prior.posterior().mean[0]
        );
    }

    #[test]
    fn a_restored_state_continues_with_the_same_bits() {
        let [mut network, mut resumed] =
            [5, 6].map(|seed| network(seed, &[2, 6, 1], &BayesianSettings::default()));
        let (inputs, targets) = (normals(1, 8), normals(2, 4));
        network.descend(&inputs, &targets, &normals(3, 25), 4);
        network.make_posterior_the_prior();
        let stored = postcard::to_stdvec(network.state()).unwrap();
        resumed.restore(postcard::from_bytes(&stored).unwrap());
        for network in [&mut network, &mut resumed] {
            network.descend(&inputs, &targets, &normals(4, 50), 4);
        }
        assert_eq!(network.state(), resumed.state());
        assert_eq!(network.posterior(), resumed.posterior());
    }
}
