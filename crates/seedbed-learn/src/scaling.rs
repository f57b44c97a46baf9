//! Scaling of observations for networks: none, by display range, or by running moments.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::nn::{Standardizer, Tensor};
use seedbed_env::TaskSpec;

/// How observations are scaled for networks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum ObservationScaling {
    /// Not at all.
    Raw,
    /// The display range of each observation is scaled to −1 to 1.
    Range,
    /// To mean 0 and standard deviation 1 over all observations that the agent has learned from.
    /// The moments are updated after learning, so that importance ratios compare policies as they
    /// acted.
    Running,
}

/// The scaling of observations, with the state that it needs.
#[derive(Clone, Debug)]
pub(crate) enum Scaling {
    Raw,
    /// Center and half the range of each observation.
    Range(Vec<[f32; 2]>),
    Running(Standardizer),
}

impl Scaling {
    pub(crate) fn new(scaling: ObservationScaling, spec: &TaskSpec) -> Self {
        match scaling {
            ObservationScaling::Raw => Self::Raw,
            ObservationScaling::Range => Self::Range(
                spec.observations
                    .iter()
                    .map(|quantity| center_and_half_range(quantity.range))
                    .collect(),
            ),
            ObservationScaling::Running => {
                Self::Running(Standardizer::new(spec.observation_width()))
            }
        }
    }

    /// Scales observations for a network.   `observations: [N × width]` → `scaled: [N × width]`
    pub(crate) fn apply(&self, observations: &[f32], scaled: &mut Vec<f32>) {
        scaled.clear();
        match self {
            Self::Raw => scaled.extend_from_slice(observations),
            Self::Range(ranges) => {
                let scale = |(value, [center, half_range]): (&f32, &[f32; 2])| {
                    (value - center) / half_range
                };
                scaled.extend(
                    observations
                        .chunks_exact(ranges.len())
                        .flat_map(|row| row.iter().zip(ranges).map(scale)),
                );
            }
            Self::Running(standardizer) => standardizer.apply(observations, scaled),
        }
    }

    /// Updates running moments with observations that were learned from.   `[N × width]`
    pub(crate) fn update(&mut self, observations: &[f32]) {
        if let Self::Running(standardizer) = self {
            standardizer.update(observations);
        }
    }

    /// The numbers of the scaling: center and half range, or mean and standard deviation; none if
    /// observations are not scaled. [`ScalingInfo`](crate::agent::network_info::ScalingInfo) has the names
    /// and the formula.
    pub(crate) fn tensors(&self) -> Vec<Tensor<'static>> {
        let [offset, scale]: [(&str, Vec<f32>); 2] = match self {
            Self::Raw => return Vec::new(),
            Self::Range(ranges) => [
                ("center", ranges.iter().map(|[center, _]| *center).collect()),
                ("half_range", ranges.iter().map(|[_, half]| *half).collect()),
            ],
            Self::Running(moments) => [
                ("mean", moments.mean().collect()),
                ("deviation", moments.deviation().collect()),
            ],
        };
        [offset, scale]
            .map(|(name, values)| Tensor::list(&format!("observations.{name}"), values))
            .into()
    }

    /// The state that learning changes, if any.
    pub(crate) fn learned(&self) -> Option<&Standardizer> {
        match self {
            Self::Running(standardizer) => Some(standardizer),
            Self::Raw | Self::Range(_) => None,
        }
    }

    pub(crate) fn restore(&mut self, learned: Option<Standardizer>) -> Result<(), String> {
        match (self, learned) {
            (Self::Running(standardizer), Some(learned)) => *standardizer = learned,
            (Self::Raw | Self::Range(_), None) => {}
            _ => {
                return Err(
                    "the checkpoint has observations that are scaled in another way".to_owned(),
                );
            }
        }
        Ok(())
    }
}

fn center_and_half_range([low, high]: [f32; 2]) -> [f32; 2] {
    [0.5 * (low + high), 0.5 * (high - low)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::Quantity;

    fn spec() -> TaskSpec {
        let quantity = |name: &str, range| Quantity {
            name: name.to_owned(),
            unit: String::new(),
            range,
        };
        TaskSpec {
            observations: vec![quantity("x", [-8.0, 8.0]), quantity("y", [0.0, 4.0])],
            ..TaskSpec::new("test", Vec::new(), Vec::new())
        }
    }

    fn scaled(scaling: &Scaling, observations: &[f32]) -> Vec<f32> {
        let mut scaled = vec![f32::NAN];
        scaling.apply(observations, &mut scaled);
        scaled
    }

    #[test]
    fn ranges_are_scaled_to_minus_one_to_one() {
        let scaling = Scaling::new(ObservationScaling::Range, &spec());
        assert_eq!(
            scaled(&scaling, &[-8.0, 4.0, 4.0, 2.0, 0.0, 0.0]),
            [-1.0, 1.0, 0.5, 0.0, 0.0, -1.0]
        );
        assert_eq!(
            scaled(
                &Scaling::new(ObservationScaling::Raw, &spec()),
                &[-8.0, 4.0]
            ),
            [-8.0, 4.0]
        );
    }

    /// x = 1, 3: mean 2, deviation 1; y = 10, 30: mean 20, deviation 10.
    #[test]
    fn running_moments_standardize_later_observations() {
        let mut scaling = Scaling::new(ObservationScaling::Running, &spec());
        assert_eq!(scaled(&scaling, &[3.0, 7.0]), [3.0, 7.0]);
        scaling.update(&[1.0, 10.0, 3.0, 30.0]);
        let later = scaled(&scaling, &[4.0, 15.0]);
        assert!(
            (later[0] - 2.0).abs() < 1e-3 && (later[1] + 0.5).abs() < 1e-3,
            "{later:?}"
        );
    }
}
