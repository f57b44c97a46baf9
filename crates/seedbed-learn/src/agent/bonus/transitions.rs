//! Inputs and targets of bonus models: inputs are standardized (s, a), targets are the changes of
//! state Δs in units of their root mean square.

use rand::RngExt;
use serde::{Deserialize, Serialize};

use crate::agent::Tensor;
use crate::experience::Episode;
use crate::nn::Standardizer;
use seedbed_env::random::Stream;
use seedbed_env::{Choice, TaskSpec};

/// Turns steps of episodes into rows of inputs and targets for a network.
pub(crate) struct TransitionEncoder {
    observation_width: usize,
    action_encodings: Vec<ActionEncoding>,
    moments: Moments,
    /// Rows before standardization.
    raw: Rows,
}

/// Running moments of all steps that the model has learned from.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Moments {
    /// Moments of (s, a).
    inputs: Standardizer,
    /// Moments of Δs.
    changes: Standardizer,
}

/// Rows for a network: `inputs: [N × in]`, `targets: [N × out]`.
#[derive(Default)]
pub(crate) struct Rows {
    pub(crate) inputs: Vec<f32>,
    pub(crate) targets: Vec<f32>,
}

/// How one component of an action is encoded as inputs of a network.
enum ActionEncoding {
    /// One input per choice: 1 for the chosen value, 0 for all others.
    OneHot { choices: usize },
    /// One input: the action's range is scaled to −1 to 1, and values beyond it are clamped, as in
    /// the environment.
    Scaled { center: f32, half_range: f32 },
}

impl TransitionEncoder {
    pub(crate) fn new(spec: &TaskSpec) -> Self {
        let encoding = |action: &seedbed_env::Action| match &action.choice {
            Choice::Discrete(values) => ActionEncoding::OneHot {
                choices: values.len(),
            },
            Choice::Continuous => {
                let [low, high] = action.quantity.range;
                ActionEncoding::Scaled {
                    center: 0.5 * (low + high),
                    half_range: 0.5 * (high - low),
                }
            }
        };
        let action_encodings: Vec<ActionEncoding> = spec.actions.iter().map(encoding).collect();
        let observation_width = spec.observation_width();
        let action_width: usize = action_encodings.iter().map(ActionEncoding::width).sum();
        let width = observation_width + action_width;
        let moments = Moments {
            inputs: Standardizer::new(width),
            changes: Standardizer::new(observation_width),
        };
        Self {
            observation_width,
            action_encodings,
            moments,
            raw: Rows::default(),
        }
    }

    /// Number of inputs and number of targets of a row.
    pub(crate) fn widths(spec: &TaskSpec) -> [usize; 2] {
        let actions = spec.actions.iter().map(|action| match &action.choice {
            Choice::Discrete(values) => values.len(),
            Choice::Continuous => 1,
        });
        [
            spec.observation_width() + actions.sum::<usize>(),
            spec.observation_width(),
        ]
    }

    /// Names of the inputs of a row, in order. Choices are named `name = value`.
    pub(crate) fn input_names(spec: &TaskSpec) -> Vec<String> {
        let mut names: Vec<String> = spec.observations.iter().map(|o| o.name.clone()).collect();
        for seedbed_env::Action { quantity, choice } in &spec.actions {
            match choice {
                Choice::Discrete(values) => {
                    let choices = values.iter().map(|x| format!("{} = {x}", quantity.name));
                    names.extend(choices);
                }
                Choice::Continuous => names.push(quantity.name.clone()),
            }
        }
        names
    }

    /// Moments of the inputs (mean and standard deviation) and root mean square of the changes.
    pub(crate) fn tensors(&self) -> [Tensor<'static>; 3] {
        let Moments { inputs, changes } = &self.moments;
        let list = |name, values: Vec<f32>| Tensor::list(name, values);
        [
            list("inputs.mean", inputs.mean().collect()),
            list("inputs.deviation", inputs.deviation().collect()),
            list(
                "changes.root_mean_square",
                changes.root_mean_square().collect(),
            ),
        ]
    }

    pub(crate) fn moments(&self) -> &Moments {
        &self.moments
    }

    pub(crate) fn restore(&mut self, moments: Moments) {
        self.moments = moments;
    }

    /// Writes every `stride`-th step of an episode to `rows`.
    pub(crate) fn load_episode(&mut self, episode: &Episode, stride: usize, rows: &mut Rows) {
        self.raw.clear();
        (0..episode.length())
            .step_by(stride)
            .for_each(|step| self.push(episode, step));
        self.standardize(rows);
    }

    /// Writes `count` steps to `rows`, drawn uniformly with replacement from the steps of all
    /// episodes.
    pub(crate) fn sample(
        &mut self,
        episodes: &[&Episode],
        count: usize,
        random: &mut Stream,
        rows: &mut Rows,
    ) {
        self.raw.clear();
        let step_count: usize = episodes.iter().map(|episode| episode.length()).sum();
        let mut positions: Vec<usize> = (0..count)
            .map(|_| random.random_range(0..step_count))
            .collect();
        positions.sort_unstable();
        let mut episodes = episodes.iter();
        let (mut episode, mut start) = (episodes.next(), 0);
        // Positions are sorted, so one pass over the episodes finds all of them.
        for position in positions {
            while let Some(current) = episode.filter(|other| position >= start + other.length()) {
                start += current.length();
                episode = episodes.next();
            }
            if let Some(current) = episode {
                self.push(current, position - start);
            }
        }
        self.standardize(rows);
    }

    /// Updates the running moments with the steps of an episode.
    pub(crate) fn update_moments(&mut self, episode: &Episode) {
        self.raw.clear();
        (0..episode.length()).for_each(|step| self.push(episode, step));
        self.moments.inputs.update(&self.raw.inputs);
        self.moments.changes.update(&self.raw.targets);
    }

    fn push(&mut self, episode: &Episode, step: usize) {
        let width = self.observation_width;
        let [state, next] =
            [step, step + 1].map(|row| &episode.observations[row * width..(row + 1) * width]);
        self.raw.inputs.extend_from_slice(state);
        let actions = &episode.actions
            [step * self.action_encodings.len()..(step + 1) * self.action_encodings.len()];
        for (encoding, &action) in self.action_encodings.iter().zip(actions) {
            encoding.push(action, &mut self.raw.inputs);
        }
        self.raw
            .targets
            .extend(next.iter().zip(state).map(|(next, state)| next - state));
    }

    fn standardize(&self, rows: &mut Rows) {
        self.moments
            .inputs
            .apply(&self.raw.inputs, &mut rows.inputs);
        self.moments
            .changes
            .apply_scale(&self.raw.targets, &mut rows.targets);
    }
}

impl Rows {
    fn clear(&mut self) {
        self.inputs.clear();
        self.targets.clear();
    }
}

impl ActionEncoding {
    fn width(&self) -> usize {
        match self {
            Self::OneHot { choices } => *choices,
            Self::Scaled { .. } => 1,
        }
    }

    fn push(&self, action: f32, row: &mut Vec<f32>) {
        match *self {
            Self::OneHot { choices } => {
                row.extend((0..choices).map(|choice| f32::from(choice == action as usize)));
            }
            Self::Scaled { center, half_range } => {
                row.push(((action - center) / half_range).clamp(-1.0, 1.0));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::random::{Purpose, stream};
    use seedbed_env::{Action, Quantity, Status};

    fn spec() -> TaskSpec {
        let quantity = |name: &str, range| Quantity {
            name: name.to_owned(),
            unit: String::new(),
            range,
        };
        TaskSpec {
            observations: vec![quantity("x", [-1.0, 1.0])],
            actions: vec![
                Action {
                    quantity: quantity("kick", [0.0, 2.0]),
                    choice: Choice::Discrete(vec![0.0, 1.0, 2.0]),
                },
                Action {
                    quantity: quantity("push", [0.0, 4.0]),
                    choice: Choice::Continuous,
                },
            ],
            ..TaskSpec::new("test", Vec::new(), Vec::new())
        }
    }

    /// x = 1, 2, 4 with actions (2, 3) and (0, 9).
    fn episode() -> Episode {
        Episode {
            observations: vec![1.0, 2.0, 4.0],
            actions: vec![2.0, 3.0, 0.0, 9.0],
            rewards: vec![0.0; 2],
            outcome: Status::Terminated,
            ..Episode::start(0, 0, 0, &spec())
        }
    }

    /// Before the first moments, a row is x, three inputs for the kick, and the push scaled from
    /// 0…4 to −1…1 and clamped; Δx = 1, 2.
    #[test]
    fn steps_become_rows() {
        assert_eq!(
            TransitionEncoder::input_names(&spec()),
            ["x", "kick = 0", "kick = 1", "kick = 2", "push"]
        );
        assert_eq!(TransitionEncoder::widths(&spec()), [5, 1]);
        let (mut encoder, mut rows) = (TransitionEncoder::new(&spec()), Rows::default());
        encoder.load_episode(&episode(), 1, &mut rows);
        assert_eq!(
            rows.inputs,
            [1.0, 0.0, 0.0, 1.0, 0.5, 2.0, 1.0, 0.0, 0.0, 1.0]
        );
        assert_eq!(rows.targets, [1.0, 2.0]);
        encoder.load_episode(&episode(), 2, &mut rows);
        assert_eq!(rows.targets, [1.0]);
    }

    /// Δx = 1, 2 has a root mean square of √2.5.
    #[test]
    fn targets_are_in_units_of_their_root_mean_square() {
        let (mut encoder, mut rows) = (TransitionEncoder::new(&spec()), Rows::default());
        encoder.update_moments(&episode());
        encoder.load_episode(&episode(), 1, &mut rows);
        assert!(
            (rows.targets[1] - 2.0 / 2.5_f32.sqrt()).abs() < 1e-5,
            "{:?}",
            rows.targets
        );
        assert!(
            (rows.inputs[0] + 1.0).abs() < 1e-4,
            "x = 1 is a deviation below its mean of 1.5: {:?}",
            rows.inputs
        );
    }

    /// Each of the 4 steps of two episodes is drawn about 750 times in 3,000; the tolerance is four
    /// standard errors of √(3000 · 3/16) = 24. No drawn step leads from one episode to the other.
    #[test]
    fn steps_are_drawn_uniformly_and_never_across_episodes() {
        let (mut encoder, mut rows) = (TransitionEncoder::new(&spec()), Rows::default());
        let other = Episode {
            observations: vec![5.0, 8.0, 12.0],
            ..episode()
        };
        let mut random = stream(1, Purpose::Shuffle, 0, 0);
        encoder.sample(&[&episode(), &other], 3000, &mut random, &mut rows);
        for change in [1.0, 2.0, 3.0, 4.0] {
            let count = rows
                .targets
                .iter()
                .filter(|target| **target == change)
                .count();
            assert!(count.abs_diff(750) < 100, "{change}: {count}");
        }
        assert_eq!(rows.targets.len(), 3000);
    }
}
