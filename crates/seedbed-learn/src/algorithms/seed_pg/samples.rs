//! Samples for gradient steps: the steps of one or several trajectories, or a minibatch of them.

use crate::nn::CodedNetwork;

/// N steps, stored column by column.
#[derive(Default)]
pub(super) struct Samples {
    /// Scaled observations, the inputs of the networks: `[N × observation width]`.
    pub(super) states: Vec<f32>,
    /// Actions of C components each: `[N × C]`.
    pub(super) actions: Vec<f32>,
    /// log μ of each component of the actions, where μ is the policy that acted: `[N × C]`.
    pub(super) behavior_log_probs: Vec<f32>,
    /// Targets of the value function: `[N]`.
    pub(super) targets: Vec<f32>,
    /// Weights of the errors against the targets: `[N]`.
    pub(super) weights: Vec<f32>,
    /// Advantages of the actions: `[N]`.
    pub(super) advantages: Vec<f32>,
    /// Weights of the policy's losses; empty if all are 1: `[N]`.
    pub(super) loss_weights: Vec<f32>,
    /// Importance ratios before the update, around which ratios are clipped; empty if all are 1:
    /// `[N]`.
    pub(super) centers: Vec<f32>,
    /// Weights of −log π of actions that are imitated, in place of the policy's loss; 0 of others; empty if
    /// none are: `[N]`.
    pub(super) imitation: Vec<f32>,
    /// Weights of the policy's entropy; empty if all are that of the configuration: `[N]`.
    pub(super) entropy_weights: Vec<f32>,
}

impl Samples {
    /// Number of steps N.
    pub(super) fn len(&self) -> usize {
        self.targets.len()
    }

    /// Number of components C of an action.
    pub(super) fn component_count(&self) -> usize {
        self.actions.len() / self.len().max(1)
    }

    pub(super) fn clear(&mut self) {
        self.columns_mut().into_iter().for_each(Vec::clear);
    }

    /// Appends all steps of `other`.
    pub(super) fn append(&mut self, other: &Self) {
        for (column, other) in self.columns_mut().into_iter().zip(other.columns()) {
            column.extend_from_slice(other);
        }
    }

    /// Fills the columns that are empty because all rows have the usual number, and sets the weight of the
    /// entropy.
    pub(super) fn fill_empty_columns(&mut self, entropy_weight: f32) {
        let count = self.len();
        self.loss_weights.resize(count, 1.0);
        self.centers.resize(count, 1.0);
        self.imitation.resize(count, 0.0);
        self.entropy_weights.resize(count, entropy_weight);
    }

    /// Appends all steps of `other`, with a code as further inputs.
    pub(super) fn append_coded(&mut self, other: &Self, network: &CodedNetwork, code: usize) {
        network.append_inputs(&other.states, code, &mut self.states);
        let without_states = self.columns_mut().into_iter().zip(other.columns()).skip(1);
        for (column, other) in without_states {
            column.extend_from_slice(other);
        }
    }

    /// Replaces the samples by the steps of `source` with the indices `rows`.
    pub(super) fn gather(&mut self, source: &Self, rows: &[usize]) {
        let count = source.len().max(1);
        for (column, source) in self.columns_mut().into_iter().zip(source.columns()) {
            copy_rows(source, source.len() / count, rows, column);
        }
    }

    fn columns(&self) -> [&[f32]; 10] {
        [
            &self.states,
            &self.actions,
            &self.behavior_log_probs,
            &self.targets,
            &self.weights,
            &self.advantages,
            &self.loss_weights,
            &self.centers,
            &self.imitation,
            &self.entropy_weights,
        ]
    }

    fn columns_mut(&mut self) -> [&mut Vec<f32>; 10] {
        [
            &mut self.states,
            &mut self.actions,
            &mut self.behavior_log_probs,
            &mut self.targets,
            &mut self.weights,
            &mut self.advantages,
            &mut self.loss_weights,
            &mut self.centers,
            &mut self.imitation,
            &mut self.entropy_weights,
        ]
    }
}

/// Replaces `target` by the rows of `source` with the indices `rows`.   `source: [N × width]`
/// → `target: [rows × width]`
fn copy_rows(source: &[f32], width: usize, rows: &[usize], target: &mut Vec<f32>) {
    target.resize(rows.len() * width, 0.0);
    if width == 0 {
        return;
    }
    for (target, row) in target.chunks_exact_mut(width).zip(rows) {
        // A loop, because copying a few numbers with `memcpy` takes longer.
        for (target, number) in target.iter_mut().zip(&source[row * width..][..width]) {
            *target = *number;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples whose numbers are the step plus an offset per column.
    fn samples(steps: &[u8]) -> Samples {
        let column = |offset: f32| {
            steps
                .iter()
                .map(|&step| f32::from(step) + offset)
                .collect::<Vec<f32>>()
        };
        Samples {
            states: steps
                .iter()
                .flat_map(|&step| [f32::from(step), -f32::from(step)])
                .collect(),
            actions: column(10.0),
            behavior_log_probs: column(20.0),
            targets: column(30.0),
            weights: column(40.0),
            advantages: column(50.0),
            loss_weights: column(60.0),
            centers: Vec::new(),
            imitation: column(70.0),
            entropy_weights: Vec::new(),
        }
    }

    #[test]
    fn numbers_of_a_step_stay_together() {
        let mut all_samples = samples(&[0, 1, 2]);
        all_samples.append(&samples(&[3, 4]));
        assert_eq!((all_samples.len(), all_samples.component_count()), (5, 1));
        let mut gathered = samples(&[9]);
        gathered.gather(&all_samples, &[4, 1]);
        assert_eq!(gathered.states, [4.0, -4.0, 1.0, -1.0]);
        assert_eq!(
            (gathered.actions, gathered.advantages),
            (vec![14.0, 11.0], vec![54.0, 51.0])
        );
        assert_eq!(gathered.loss_weights, [64.0, 61.0]);
        assert_eq!(gathered.imitation, [74.0, 71.0]);
        assert!(gathered.centers.is_empty());
    }
}
