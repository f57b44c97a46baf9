//! Inputs and targets of models of the dynamics: inputs are standardized (s, a), targets are the
//! changes of state Δs in units of their root mean square, and, if the model predicts outcomes, the
//! reward and whether the episode terminates, see [`OutcomeUnits`].

use rand::RngExt;
use serde::{Deserialize, Serialize};

use crate::experience::Episode;
use crate::nn::{STANDARDIZED_LIMIT, Standardizer, Tensor};
use seedbed_env::{Choice, Status, TaskSpec};
use seedbed_random::Stream;

/// Turns steps of episodes into rows of inputs and targets for a network.
pub(crate) struct TransitionEncoder {
    observation_width: usize,
    action_encodings: Vec<ActionEncoding>,
    moments: Moments,
    /// Units of the outcomes, if they are targets.
    outcome_units: Option<OutcomeUnits>,
    /// Rows before standardization.
    raw: Rows,
    /// Outcomes of these rows: `[N × 2]`; empty if they are not targets.
    raw_outcomes: Vec<f32>,
    /// Changes in units of their root mean square: `[N × observation width]`.
    scaled_changes: Vec<f32>,
}

/// What the targets of a row are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Targets {
    /// The changes of state.
    Changes,
    /// The changes of state, then the [outcomes](OutcomeUnits).
    ChangesAndOutcomes,
}

/// Number of outcomes of a step: its reward, and 1 if the episode terminates with it, else 0.
pub(crate) const OUTCOMES: usize = 2;

/// Largest absolute value of an outcome in its unit.
pub(crate) const OUTCOME_LIMIT: f32 = STANDARDIZED_LIMIT as f32;

/// Running moments of all steps that the model has learned from.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Moments {
    /// Moments of (s, a).
    inputs: Standardizer,
    /// Moments of Δs.
    changes: Standardizer,
}

/// The units of the outcomes of steps: their root mean square, but at least a tenth of the largest
/// absolute value, so that no outcome is clamped, however rare it is.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct OutcomeUnits {
    moments: Standardizer,
    /// Largest absolute values.
    largest: [f32; OUTCOMES],
}

/// Rows for a network: `inputs: [N × in]`, `targets: [N × out]`.
#[derive(Default)]
pub(crate) struct Rows {
    pub(crate) inputs: Vec<f32>,
    pub(crate) targets: Vec<f32>,
}

/// How one component of an action is encoded as inputs of a network.
#[derive(Clone, Debug)]
pub(crate) enum ActionEncoding {
    /// One input per choice: 1 for the chosen value, 0 for all others.
    OneHot { choices: usize },
    /// One input: the action's range is scaled to −1 to 1, and values beyond it are clamped, as in
    /// the environment.
    Scaled { center: f32, half_range: f32 },
}

impl TransitionEncoder {
    pub(crate) fn new(spec: &TaskSpec, targets: Targets) -> Self {
        let action_encodings = ActionEncoding::of_task(spec);
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
            outcome_units: (targets == Targets::ChangesAndOutcomes).then(OutcomeUnits::new),
            raw: Rows::default(),
            raw_outcomes: Vec::new(),
            scaled_changes: Vec::new(),
        }
    }

    /// Number of inputs and number of targets of a row.
    pub(crate) fn widths(spec: &TaskSpec, targets: Targets) -> [usize; 2] {
        let encodings = ActionEncoding::of_task(spec);
        let action_width: usize = encodings.iter().map(ActionEncoding::width).sum();
        let outcomes = match targets {
            Targets::Changes => 0,
            Targets::ChangesAndOutcomes => OUTCOMES,
        };
        [
            spec.observation_width() + action_width,
            spec.observation_width() + outcomes,
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

    pub(crate) fn outcome_units(&self) -> Option<&OutcomeUnits> {
        self.outcome_units.as_ref()
    }

    /// Copies the moments of another encoder of the same task.
    pub(crate) fn copy_moments(&mut self, other: &Self) {
        self.moments.clone_from(&other.moments);
        self.outcome_units.clone_from(&other.outcome_units);
    }

    /// Continues with stored moments.
    ///
    /// # Errors
    /// What is wrong if they are those of another task.
    pub(crate) fn restore(&mut self, moments: Moments) -> Result<(), String> {
        let expected = &self.moments;
        if !moments.inputs.has_width(expected.inputs.width())
            || !moments.changes.has_width(expected.changes.width())
        {
            return Err(format!(
                "the checkpoint has moments of {} inputs and {} changes; expected {} and {}",
                moments.inputs.width(),
                moments.changes.width(),
                expected.inputs.width(),
                expected.changes.width()
            ));
        }
        self.moments = moments;
        Ok(())
    }

    /// Continues with stored units.
    ///
    /// # Errors
    /// What is wrong if they are not units of outcomes.
    pub(crate) fn restore_outcome_units(&mut self, units: OutcomeUnits) -> Result<(), String> {
        if !units.moments.has_width(OUTCOMES) {
            let width = units.moments.width();
            return Err(format!(
                "the checkpoint has units of {width} outcomes; expected {OUTCOMES}"
            ));
        }
        self.outcome_units = Some(units);
        Ok(())
    }

    /// Writes every `stride`-th step of an episode to `rows`.
    pub(crate) fn load_episode(&mut self, episode: &Episode, stride: usize, rows: &mut Rows) {
        self.clear();
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
        self.clear();
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
        self.clear();
        (0..episode.length()).for_each(|step| self.push(episode, step));
        self.moments.inputs.update(&self.raw.inputs);
        self.moments.changes.update(&self.raw.targets);
        if let Some(units) = &mut self.outcome_units {
            units.update(&self.raw_outcomes);
        }
    }

    fn clear(&mut self) {
        self.raw.clear();
        self.raw_outcomes.clear();
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
        if self.outcome_units.is_some() {
            let is_last = step + 1 == episode.length();
            let terminates = is_last && episode.outcome == Status::Terminated;
            self.raw_outcomes
                .extend([episode.rewards[step], f32::from(terminates)]);
        }
    }

    fn standardize(&mut self, rows: &mut Rows) {
        let Moments { inputs, changes } = &self.moments;
        inputs.apply(&self.raw.inputs, &mut rows.inputs);
        let Some(units) = &self.outcome_units else {
            changes.apply_scale(&self.raw.targets, &mut rows.targets);
            return;
        };
        changes.apply_scale(&self.raw.targets, &mut self.scaled_changes);
        rows.targets.clear();
        let changes = self.scaled_changes.chunks_exact(self.observation_width);
        for (changes, outcomes) in changes.zip(self.raw_outcomes.chunks_exact(OUTCOMES)) {
            rows.targets.extend_from_slice(changes);
            let outcomes = outcomes.iter().zip(units.units());
            rows.targets.extend(
                outcomes
                    .map(|(outcome, unit)| (outcome / unit).clamp(-OUTCOME_LIMIT, OUTCOME_LIMIT)),
            );
        }
    }
}

impl OutcomeUnits {
    fn new() -> Self {
        Self {
            moments: Standardizer::new(OUTCOMES),
            largest: [0.0; OUTCOMES],
        }
    }

    /// Updates the units with the outcomes of steps.   `outcomes: [N × 2]`
    fn update(&mut self, outcomes: &[f32]) {
        self.moments.update(outcomes);
        for outcomes in outcomes.chunks_exact(OUTCOMES) {
            for (largest, outcome) in self.largest.iter_mut().zip(outcomes) {
                *largest = largest.max(outcome.abs());
            }
        }
    }

    /// The unit of each outcome.
    pub(crate) fn units(&self) -> [f32; OUTCOMES] {
        let mut units = self.largest.map(|largest| largest / OUTCOME_LIMIT);
        for (unit, root_mean_square) in units.iter_mut().zip(self.moments.root_mean_square()) {
            *unit = unit.max(root_mean_square);
        }
        units
    }
}

impl Rows {
    fn clear(&mut self) {
        self.inputs.clear();
        self.targets.clear();
    }
}

impl ActionEncoding {
    /// The encoding of each component of a task's actions.
    pub(crate) fn of_task(spec: &TaskSpec) -> Vec<Self> {
        let encoding = |action: &seedbed_env::Action| match &action.choice {
            Choice::Discrete(values) => Self::OneHot {
                choices: values.len(),
            },
            Choice::Continuous => {
                let [low, high] = action.quantity.range;
                Self::Scaled {
                    center: 0.5 * (low + high),
                    half_range: 0.5 * (high - low),
                }
            }
        };
        spec.actions.iter().map(encoding).collect()
    }

    /// Number of inputs.
    pub(crate) fn width(&self) -> usize {
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

    /// The component of an action that these inputs encode.   `inputs: [width]`
    pub(crate) fn decode(&self, inputs: &[f32]) -> f32 {
        match *self {
            Self::OneHot { .. } => {
                let chosen = inputs.iter().position(|&input| input == 1.0);
                chosen.unwrap_or(0) as f32
            }
            Self::Scaled { center, half_range } => center + half_range * inputs[0],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::{Action, Quantity, Status};
    use seedbed_random::{Purpose, stream};

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

    fn encoder(targets: Targets) -> TransitionEncoder {
        TransitionEncoder::new(&spec(), targets)
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
        assert_eq!(TransitionEncoder::widths(&spec(), Targets::Changes), [5, 1]);
        let (mut encoder, mut rows) = (encoder(Targets::Changes), Rows::default());
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
        let (mut encoder, mut rows) = (encoder(Targets::Changes), Rows::default());
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

    /// Rewards 3, 1 and an end after the second step. The root mean square of 3 and 1 is √5; that of
    /// 0 and 1 is √½. After 998 further steps without reward, the root mean square is √(10/1000) =
    /// 0.1 and that of the ends √(1/1000) = 0.032, but the units are a tenth of 3 and of 1.
    #[test]
    fn outcomes_are_targets_in_units_that_do_not_clamp_rare_ones() {
        let targets = Targets::ChangesAndOutcomes;
        assert_eq!(TransitionEncoder::widths(&spec(), targets), [5, 3]);
        let (mut encoder, mut rows) = (encoder(targets), Rows::default());
        let rewarded = Episode {
            rewards: vec![3.0, 1.0],
            ..episode()
        };
        encoder.load_episode(&rewarded, 1, &mut rows);
        assert_eq!(rows.targets, [1.0, 3.0, 0.0, 2.0, 1.0, 1.0]);
        encoder.update_moments(&rewarded);
        let units = |encoder: &TransitionEncoder| encoder.outcome_units().unwrap().units();
        let [reward, end] = units(&encoder);
        assert!((reward - 5.0_f32.sqrt()).abs() < 1e-6 && (end - 0.5_f32.sqrt()).abs() < 1e-6);
        let truncated = Episode {
            outcome: Status::Truncated,
            ..episode()
        };
        (0..499).for_each(|_| encoder.update_moments(&truncated));
        let [reward, end] = units(&encoder);
        assert!((reward - 0.3).abs() < 1e-6 && (end - 0.1).abs() < 1e-6);
        encoder.load_episode(&rewarded, 1, &mut rows);
        assert!((rows.targets[1] - 10.0).abs() < 1e-4 && (rows.targets[5] - 10.0).abs() < 1e-4);
    }

    #[test]
    fn decoded_inputs_are_the_encoded_action() {
        let encodings = ActionEncoding::of_task(&spec());
        for (encoding, action) in encodings.iter().zip([2.0, 1.5]) {
            let mut row = Vec::new();
            encoding.push(action, &mut row);
            assert_eq!(encoding.decode(&row), action);
        }
    }

    /// Each of the 4 steps of two episodes is drawn about 750 times in 3,000; the tolerance is four
    /// standard errors of √(3000 · 3/16) = 24. No drawn step leads from one episode to the other.
    #[test]
    fn steps_are_drawn_uniformly_and_never_across_episodes() {
        let (mut encoder, mut rows) = (encoder(Targets::Changes), Rows::default());
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
