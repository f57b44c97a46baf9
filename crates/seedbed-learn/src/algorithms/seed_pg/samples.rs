//! Steps that are learned from: one trajectory's, those of many, or a minibatch drawn from them.

/// N steps, column by column.
#[derive(Default)]
pub(super) struct Samples {
    /// What the networks see. `[N × observation width]`
    pub(super) states: Vec<f32>,
    /// `[N × C]`
    pub(super) actions: Vec<f32>,
    /// log μ of each component, under the policy that acted. `[N × C]`
    pub(super) behaviour: Vec<f32>,
    /// What the value function is regressed on. `[N]`
    pub(super) targets: Vec<f32>,
    /// How much each regression counts. `[N]`
    pub(super) weights: Vec<f32>,
    /// `[N]`
    pub(super) advantages: Vec<f32>,
}

impl Samples {
    /// N
    pub(super) fn len(&self) -> usize {
        self.targets.len()
    }

    /// C, the components of an action.
    pub(super) fn components(&self) -> usize {
        self.actions.len() / self.len().max(1)
    }

    pub(super) fn clear(&mut self) {
        self.columns().into_iter().for_each(Vec::clear);
    }

    /// Adds other samples after these.
    pub(super) fn append(&mut self, other: &Self) {
        for row in 0..other.len() {
            self.push_row(other, row);
        }
    }

    /// Becomes the given rows of `from`.
    pub(super) fn gather(&mut self, from: &Self, rows: &[usize]) {
        self.clear();
        for &row in rows {
            self.push_row(from, row);
        }
    }

    fn push_row(&mut self, from: &Self, row: usize) {
        let count = from.len();
        let ours = self.columns();
        let theirs = [
            &from.states,
            &from.actions,
            &from.behaviour,
            &from.targets,
            &from.weights,
            &from.advantages,
        ];
        for (ours, theirs) in ours.into_iter().zip(theirs) {
            let width = theirs.len() / count;
            ours.extend_from_slice(&theirs[row * width..(row + 1) * width]);
        }
    }

    fn columns(&mut self) -> [&mut Vec<f32>; 6] {
        let Self {
            states,
            actions,
            behaviour,
            targets,
            weights,
            advantages,
        } = self;
        [states, actions, behaviour, targets, weights, advantages]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            behaviour: column(20.0),
            targets: column(30.0),
            weights: column(40.0),
            advantages: column(50.0),
        }
    }

    #[test]
    fn rows_stay_together() {
        let mut all = samples(&[0, 1, 2]);
        all.append(&samples(&[3, 4]));
        assert_eq!((all.len(), all.components()), (5, 1));
        let mut drawn = samples(&[9]);
        drawn.gather(&all, &[4, 1]);
        assert_eq!(drawn.states, [4.0, -4.0, 1.0, -1.0]);
        assert_eq!(
            (drawn.actions, drawn.advantages),
            (vec![14.0, 11.0], vec![54.0, 51.0])
        );
    }
}
