//! Random functions of the state.

use rand::{Rng, RngExt};

use crate::nn::{Activations, Initial, Mlp, Tensor, network_tensors};
use crate::scaling::{ObservationScaling, Scaling};
use seedbed_env::TaskSpec;

/// A fixed random network of the observations, standardized such that its outputs have mean 0 and
/// standard deviation σ over states that are uniformly distributed in the display ranges.
#[derive(Clone, Debug)]
pub(crate) struct StateFunction {
    mlp: Mlp,
    parameters: Vec<f32>,
    scaling: Scaling,
    mean: f32,
    factor: f32,
    states: Vec<f32>,
    activations: Activations,
    values: Vec<f32>,
}

/// Number of random states from which mean and deviation are estimated: the standard error of the
/// deviation is about σ/√2000, or 2 %.
const STANDARDIZATION_STATES: usize = 1000;

impl StateFunction {
    /// A function with `hidden` layers and standard deviation `sigma`.
    pub(crate) fn draw(
        spec: &TaskSpec,
        hidden: &[usize],
        sigma: f32,
        random: &mut impl Rng,
    ) -> Self {
        let width = spec.observation_width();
        let mut sizes = vec![width];
        sizes.extend(hidden);
        sizes.push(1);
        let mlp = Mlp::new(&sizes);
        let parameters = mlp.initial_parameters(Initial::Random, random);
        let count = STANDARDIZATION_STATES * width;
        let states: Vec<f32> = (0..count)
            .map(|_| random.random_range(-1.0..=1.0))
            .collect();
        let mut activations = Activations::default();
        let [mean, deviation] = moments(mlp.forward(&parameters, &states, &mut activations));
        Self {
            mlp,
            parameters,
            scaling: Scaling::new(ObservationScaling::Range, spec),
            mean,
            factor: if deviation > 0.0 {
                sigma / deviation
            } else {
                0.0
            },
            states,
            activations,
            values: Vec::new(),
        }
    }

    /// The network, and the mean and the factor of f = factor · (output − mean).
    pub(super) fn tensors(&self) -> Vec<Tensor<'_>> {
        let numbers = [("mean", self.mean), ("factor", self.factor)];
        let numbers = numbers
            .map(|(name, number)| Tensor::list(&format!("seed_function.{name}"), vec![number]));
        network_tensors(&self.mlp, &self.parameters, "seed_function")
            .chain(numbers)
            .collect()
    }

    /// The function's values.   `observations: [N × width]` → `[N]`
    pub(crate) fn values(&mut self, observations: &[f32]) -> &[f32] {
        self.scaling.apply(observations, &mut self.states);
        let outputs = self
            .mlp
            .forward(&self.parameters, &self.states, &mut self.activations);
        let standardized = outputs
            .iter()
            .map(|output| self.factor * (output - self.mean));
        self.values.clear();
        self.values.extend(standardized);
        &self.values
    }
}

impl PartialEq for StateFunction {
    fn eq(&self, other: &Self) -> bool {
        (&self.parameters, self.mean, self.factor) == (&other.parameters, other.mean, other.factor)
    }
}

/// Mean and standard deviation.
fn moments(values: &[f32]) -> [f32; 2] {
    let count = values.len() as f64;
    let mean = values.iter().copied().map(f64::from).sum::<f64>() / count;
    let squares = values
        .iter()
        .map(|&value| (f64::from(value) - mean).powi(2));
    [mean as f32, (squares.sum::<f64>() / count).sqrt() as f32]
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_random::{Purpose, stream};

    /// Over 4,000 other uniformly random states, the mean is within 0.2 σ of 0 and the deviation
    /// within 10 % of σ: both estimates have standard errors below 4 % of σ.
    #[test]
    fn values_have_the_given_deviation_over_the_display_range() {
        let spec = crate::seed::tests::spec(1);
        let mut random = stream(7, Purpose::RewardSeeds, 0, 0);
        let mut function = StateFunction::draw(&spec, &[8, 8], 3.0, &mut random);
        let states: Vec<f32> = (0..4000).map(|_| random.random_range(-1.0..=1.0)).collect();
        let [mean, deviation] = moments(function.values(&states));
        assert!(
            mean.abs() < 0.6 && (deviation - 3.0).abs() < 0.3,
            "{mean} {deviation}"
        );
    }
}
