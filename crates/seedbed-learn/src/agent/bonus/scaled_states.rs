//! States as the models of bonuses see them that compare states: observations whose display ranges are scaled to −1 to 1.

use crate::nn::{STANDARDIZED_LIMIT, Tensor};
use crate::scaling::{ObservationScaling, Scaling};
use seedbed_env::TaskSpec;

/// How inputs are scaled, for readers of the tensors.
pub(super) fn formula() -> String {
    format!(
        "x = clip((input - observations.center) / observations.half_range, \
         -{STANDARDIZED_LIMIT}, {STANDARDIZED_LIMIT}), where the input is the observation after the step."
    )
}

/// Names of the observations.
pub(super) fn names(spec: &TaskSpec) -> Vec<String> {
    let observations = spec.observations.iter();
    observations
        .map(|observation| observation.name.clone())
        .collect()
}

/// Scales states, and keeps the latest ones.
pub(super) struct ScaledStates {
    width: usize,
    scaling: Scaling,
    scaled: Vec<f32>,
}

impl ScaledStates {
    pub(super) fn new(spec: &TaskSpec) -> Self {
        Self {
            width: spec.observation_width(),
            scaling: Scaling::new(ObservationScaling::Range, spec),
            scaled: Vec::new(),
        }
    }

    /// Number of observations of a state.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Scales states, and clips them, so that distances are finite.   `observations: [N × width]`
    pub(super) fn scale(&mut self, observations: &[f32]) {
        self.scaling.apply(observations, &mut self.scaled);
        let limit = STANDARDIZED_LIMIT as f32;
        for number in &mut self.scaled {
            *number = number.clamp(-limit, limit);
        }
    }

    /// Scales the states that the steps of an episode lead to.   `observations: [(T + 1) × width]`
    pub(super) fn scale_next(&mut self, observations: &[f32]) {
        self.scale(observations.get(self.width..).unwrap_or_default());
    }

    /// The states that were scaled last: `[N × width]`
    pub(super) fn all(&self) -> &[f32] {
        &self.scaled
    }

    /// The same, one by one.
    pub(super) fn iter(&self) -> std::slice::ChunksExact<'_, f32> {
        self.scaled.chunks_exact(self.width)
    }

    /// Centers and half ranges.
    pub(super) fn tensors(&self) -> Vec<Tensor<'static>> {
        self.scaling.tensors()
    }
}
