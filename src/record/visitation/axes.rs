//! Parallel coordinates: the position of a state on each axis.

use super::{BINS, Unplaced, clamped, fraction};
use crate::run::facts::StateQuantity;
use crate::run::recorder::BonusRange;
use crate::scenario::recording::AxisChoice;
use seedbed_env::{Choice, Quantity, TaskSpec};
use seedbed_learn::experience::{Episode, StepData};

/// Height of the axes in pixels: one per bin.
pub const AXIS_HEIGHT: usize = BINS;

/// Approximate width of all axes together, in pixels.
const TOTAL_WIDTH: usize = 192;

/// Minimum distance between neighboring axes, in pixels.
const MIN_AXIS_GAP: usize = 32;

/// The axes of a recording, from left to right.
#[derive(Clone, Debug, PartialEq)]
pub struct Axes {
    left_to_right: Vec<Axis>,
    gap: usize,
    /// Number of axes from the left that show the observations in their order.
    leading_observations: usize,
    /// The lower end of each axis.
    lower_ends: Vec<f32>,
    /// The distance from the lower to the upper end of each axis.
    spans: Vec<f32>,
}

/// One axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// The quantity on this axis. Its range is the range of the axis.
    pub quantity: Quantity,
    source: StateQuantity,
    /// The values of a discrete action.
    choice: Choice,
}

/// One visited state, with the action, reward, advantage and bonus of the step that starts in it.
#[derive(Clone, Copy, Debug)]
pub struct VisitedState<'a> {
    pub(super) step: usize,
    pub(super) observation: &'a [f32],
    /// The action taken in this state; `None` for the last state of an episode.
    pub(super) action: Option<&'a [f32]>,
    pub(super) reward: f32,
    pub(super) advantage: f32,
    /// The bonus of the step that starts in this state; 0 for the last state of an episode.
    pub bonus: f32,
}

impl<'a> VisitedState<'a> {
    /// All states of an episode in order, with the advantage and the bonus of each step if an
    /// update computed them: `[T + 1]`.
    pub fn of_episode(
        episode: &'a Episode,
        step_data: Option<&'a StepData>,
    ) -> impl Iterator<Item = Self> {
        let advantages = step_data.map_or(&[][..], |data| &data.advantages);
        let bonuses = step_data.map_or(&[][..], |data| &data.intrinsic_rewards);
        let steps = episode.length();
        let (observation_width, action_width) = (
            episode.observations.len() / (steps + 1),
            episode.actions.len() / steps.max(1),
        );
        (0..=steps).map(move |step| Self {
            step,
            observation: &episode.observations
                [step * observation_width..(step + 1) * observation_width],
            action: episode
                .actions
                .get(step * action_width..(step + 1) * action_width)
                .filter(|_| step < steps),
            reward: episode.rewards.get(step).copied().unwrap_or(0.0),
            advantage: advantages.get(step).copied().unwrap_or(0.0),
            bonus: bonuses.get(step).copied().unwrap_or(0.0),
        })
    }

    /// A state read from a recording, without action and reward, with the bonus of the step that
    /// starts in it.
    #[must_use]
    pub fn without_action(step: usize, observation: &'a [f32], bonus: f32) -> Self {
        Self {
            step,
            observation,
            action: None,
            reward: 0.0,
            advantage: 0.0,
            bonus,
        }
    }

    /// Whether an action was taken in this state.
    #[must_use]
    pub fn has_action(&self) -> bool {
        self.action.is_some()
    }
}

impl Axes {
    /// The axes chosen in a scenario. If only one axis is chosen, an axis of the step within the
    /// episode is added before it. The intrinsic reward has an axis only if agents have a bonus.
    #[must_use]
    pub fn of(spec: &TaskSpec, choices: &[AxisChoice], bonus: BonusRange) -> Self {
        let axes = choices
            .iter()
            .flat_map(|choice| Axis::of_choice(*choice, spec, bonus))
            .collect();
        Self::with_at_least_two_axes(axes, spec.time_limit)
    }

    /// The axes of all observations and of the bonus, for the quantities stored in a recording.
    #[must_use]
    pub fn of_quantities(observations: &[Quantity], time_limit: u32, bonus: BonusRange) -> Self {
        let observation_axes = observations
            .iter()
            .enumerate()
            .map(|(index, quantity)| Axis::observation(quantity, index));
        Self::with_at_least_two_axes(
            observation_axes
                .chain(bonus.scale_end().map(Axis::bonus))
                .collect(),
            time_limit,
        )
    }

    /// The given axes. If there are fewer than two, axes of the step within the episode are added,
    /// because a line needs two axes.
    fn with_at_least_two_axes(mut axes: Vec<Axis>, time_limit: u32) -> Self {
        while axes.len() < 2 {
            axes.insert(0, Axis::step(time_limit));
        }
        Self::side_by_side(axes)
    }

    fn side_by_side(axes: Vec<Axis>) -> Self {
        let gap = (TOTAL_WIDTH / (axes.len() - 1).max(1)).max(MIN_AXIS_GAP);
        let is_in_order =
            |(index, axis): &(usize, &Axis)| axis.source == StateQuantity::Observation(*index);
        let range = |axis: &Axis| axis.quantity.range;
        Self {
            leading_observations: axes.iter().enumerate().take_while(is_in_order).count(),
            lower_ends: axes.iter().map(|axis| range(axis)[0]).collect(),
            spans: axes
                .iter()
                .map(|axis| range(axis)[1] - range(axis)[0])
                .collect(),
            left_to_right: axes,
            gap,
        }
    }

    /// The axes with the given indices, arranged as a separate image.
    #[must_use]
    pub fn subset(&self, indices: &[usize]) -> Self {
        Self::side_by_side(
            indices
                .iter()
                .map(|&index| self.left_to_right[index].clone())
                .collect(),
        )
    }

    /// All axes, from left to right.
    #[must_use]
    pub fn all(&self) -> &[Axis] {
        &self.left_to_right
    }

    /// Number of pairs of neighboring axes.
    #[must_use]
    pub fn pair_count(&self) -> usize {
        self.left_to_right.len() - 1
    }

    /// Distance from one axis to the next, in pixels.
    pub(super) fn gap(&self) -> usize {
        self.gap
    }

    /// Width of the image, in pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.pair_count() * self.gap + 1
    }

    /// Horizontal position of an axis in pixels: the middle of its column of pixels.
    #[must_use]
    pub fn x(&self, axis: usize) -> f32 {
        (axis * self.gap) as f32 + 0.5
    }

    /// Whether any axis shows an action, its reward or its advantage. If so, the last state of an
    /// episode has no line, because no action is taken in it.
    #[must_use]
    pub fn need_actions(&self) -> bool {
        self.left_to_right.iter().any(|axis| {
            matches!(
                axis.source,
                StateQuantity::Action(_) | StateQuantity::Reward | StateQuantity::Advantage
            )
        })
    }

    /// Writes the positions of a state on the axes into `axis_positions`: `[axes]`, from 0 (lower end)
    /// to 1 (upper end). Values outside the range of an axis are clamped to its ends; NaN stays NaN.
    pub fn project(&self, state: &VisitedState<'_>, axis_positions: &mut Vec<f32>) {
        let (leading, others) = self.left_to_right.split_at(self.leading_observations);
        axis_positions.clear();
        axis_positions.extend_from_slice(&state.observation[..leading.len()]);
        axis_positions.extend(others.iter().map(|axis| axis.value(state)));
        // In a separate loop over slices, because tasks have up to hundreds of axes.
        let ends_and_spans = self.lower_ends.iter().zip(&self.spans);
        for (position, (end, span)) in axis_positions.iter_mut().zip(ends_and_spans) {
            *position = clamped((*position - end) / span);
        }
    }

    /// Counts a state on each axis that cannot show its value at its place. `counts: [axes]`
    pub fn count_unplaced(&self, state: &VisitedState<'_>, counts: &mut [Unplaced]) {
        for (axis, counts) in self.left_to_right.iter().zip(counts) {
            counts.count(axis.value(state), axis.quantity.range);
        }
    }

    /// The polyline of a state with these positions on the axes: `[axes]` points in pixels.
    pub fn line(&self, axis_positions: &[f32]) -> impl Iterator<Item = [f32; 2]> {
        axis_positions
            .iter()
            .enumerate()
            .map(|(axis, fraction)| [self.x(axis), (1.0 - fraction) * AXIS_HEIGHT as f32])
    }
}

impl Axis {
    fn of_choice(choice: AxisChoice, spec: &TaskSpec, bonus: BonusRange) -> Vec<Self> {
        match choice {
            AxisChoice::Observations => Self::observations(spec),
            AxisChoice::Action => (0..spec.actions.len())
                .map(|index| Self::action(spec, index))
                .collect(),
            AxisChoice::Reward { from, to } => vec![Self::of_all_tasks(
                StateQuantity::Reward,
                [from.get_f32(), to.get_f32()],
            )],
            AxisChoice::Advantage { from, to } => {
                vec![Self::of_all_tasks(
                    StateQuantity::Advantage,
                    [from.get_f32(), to.get_f32()],
                )]
            }
            AxisChoice::IntrinsicReward => bonus.scale_end().into_iter().map(Self::bonus).collect(),
            AxisChoice::Step => vec![Self::step(spec.time_limit)],
        }
    }

    fn observations(spec: &TaskSpec) -> Vec<Self> {
        spec.observations
            .iter()
            .enumerate()
            .map(|(index, quantity)| Self::observation(quantity, index))
            .collect()
    }

    /// The axis of observation `index`.
    pub(super) fn observation(quantity: &Quantity, index: usize) -> Self {
        Self {
            quantity: quantity.clone(),
            source: StateQuantity::Observation(index),
            choice: Choice::Continuous,
        }
    }

    fn action(spec: &TaskSpec, index: usize) -> Self {
        let action = &spec.actions[index];
        Self {
            quantity: action.quantity.clone(),
            source: StateQuantity::Action(index),
            choice: action.choice.clone(),
        }
    }

    /// The axis of steps within an episode.
    pub(super) fn step(time_limit: u32) -> Self {
        Self::of_all_tasks(StateQuantity::Step, [0.0, time_limit.max(1) as f32])
    }

    /// The axis of the intrinsic reward, from 0 to `scale_end`.
    fn bonus(scale_end: f32) -> Self {
        Self::of_all_tasks(StateQuantity::IntrinsicReward, [0.0, scale_end])
    }

    fn of_all_tasks(source: StateQuantity, range: [f32; 2]) -> Self {
        Self {
            quantity: source.with_range(range),
            source,
            choice: Choice::Continuous,
        }
    }

    /// Position of a state on the axis, 0 to 1.
    pub(super) fn fraction(&self, state: &VisitedState<'_>) -> f32 {
        fraction(self.value(state), self.quantity.range)
    }

    fn value(&self, state: &VisitedState<'_>) -> f32 {
        match self.source {
            StateQuantity::Observation(index) => state.observation[index],
            StateQuantity::Action(index) => state
                .action
                .map_or(0.0, |action| action_value(&self.choice, action[index])),
            StateQuantity::Reward => state.reward,
            StateQuantity::IntrinsicReward => state.bonus,
            StateQuantity::Advantage => state.advantage,
            StateQuantity::Step => state.step as f32,
            // They have no axis here.
            StateQuantity::Info(_) | StateQuantity::Episode | StateQuantity::Return => f32::NAN,
        }
    }
}

/// The value of an action. A discrete action is stored as the index of its value.
fn action_value(choice: &Choice, action: f32) -> f32 {
    match choice {
        Choice::Discrete(values) => values[action as usize],
        Choice::Continuous => action,
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use seedbed_env::{Action, Status};
    use seedbed_input::numbers::{FiniteNumber, ranged_number};

    const OBSERVATIONS_AND_BONUS: [AxisChoice; 2] =
        [AxisChoice::Observations, AxisChoice::IntrinsicReward];

    /// A task with observations `o0`, `o1`, … and a discrete action with two values.
    pub(crate) fn spec(ranges: &[[f32; 2]]) -> TaskSpec {
        let quantity = |(i, &range): (usize, &[f32; 2])| Quantity {
            name: format!("o{i}"),
            unit: "m".to_owned(),
            range,
        };
        let push = Quantity {
            name: "push".to_owned(),
            unit: "N".to_owned(),
            range: [-10.0, 10.0],
        };
        TaskSpec {
            name: "task".to_owned(),
            description: String::new(),
            observations: ranges.iter().enumerate().map(quantity).collect(),
            actions: vec![Action {
                quantity: push,
                choice: Choice::Discrete(vec![-10.0, 10.0]),
            }],
            control_step: 0.02,
            time_limit: 200,
            reward_threshold: None,
            info: Vec::new(),
        }
    }

    /// A state without an action.
    pub(crate) fn state_at(step: usize, observation: &[f32]) -> VisitedState<'_> {
        VisitedState {
            step,
            observation,
            action: None,
            reward: 0.0,
            advantage: 0.0,
            bonus: 0.0,
        }
    }

    fn projected(axes: &Axes, state: &VisitedState<'_>) -> Vec<f32> {
        let mut axis_positions = Vec::new();
        axes.project(state, &mut axis_positions);
        axis_positions
    }

    #[test]
    fn a_line_crosses_each_axis_at_the_position_of_its_value() {
        let axes = Axes::of(
            &spec(&[[-2.0, 2.0], [0.0, 10.0], [-1.0, 1.0]]),
            &OBSERVATIONS_AND_BONUS,
            BonusRange::None,
        );
        assert_eq!((axes.pair_count(), axes.width()), (2, 193));
        let axis_positions = projected(&axes, &state_at(0, &[1.0, 2.5, -1.0]));
        assert_eq!(axis_positions, [0.75, 0.25, 0.0]);
        assert_eq!(
            axes.line(&axis_positions).collect::<Vec<_>>(),
            [[0.5, 16.0], [96.5, 48.0], [192.5, 64.0]]
        );
    }

    #[test]
    fn values_outside_an_axis_are_clamped_to_its_ends() {
        let axes = Axes::of(
            &spec(&[[-1.0, 1.0]; 3]),
            &OBSERVATIONS_AND_BONUS,
            BonusRange::None,
        );
        assert_eq!(
            projected(&axes, &state_at(0, &[-7.0, f32::INFINITY, -0.5])),
            [0.0, 1.0, 0.25]
        );
        let with_nan = projected(&axes, &state_at(0, &[0.0, f32::NAN, f32::NEG_INFINITY]));
        assert!(with_nan[1].is_nan() && [with_nan[0], with_nan[2]] == [0.5, 0.0]);
    }

    #[test]
    fn values_outside_an_axis_are_counted() {
        let axes = Axes::of(
            &spec(&[[-1.0, 1.0]; 3]),
            &OBSERVATIONS_AND_BONUS,
            BonusRange::None,
        );
        let mut counts = [Unplaced::default(); 3];
        for observation in [[-7.0, f32::INFINITY, f32::NAN], [-1.0, 1.0, -1.5]] {
            axes.count_unplaced(&state_at(0, &observation), &mut counts);
        }
        let counts = counts.map(|counts| [counts.below, counts.above, counts.nan]);
        assert_eq!(counts, [[1, 0, 0], [0, 1, 0], [1, 0, 1]]);
    }

    #[test]
    fn a_single_observation_gets_an_axis_of_the_step() {
        let axes = Axes::of(
            &spec(&[[0.0, 4.0]]),
            &OBSERVATIONS_AND_BONUS,
            BonusRange::None,
        );
        assert_eq!(axes.all()[0].quantity.name, "step");
        assert_eq!(projected(&axes, &state_at(50, &[3.0])), [0.25, 0.75]);
    }

    #[test]
    fn many_axes_keep_a_minimum_distance() {
        assert_eq!(
            Axes::of(
                &spec(&[[0.0, 1.0]; 12]),
                &OBSERVATIONS_AND_BONUS,
                BonusRange::None
            )
            .width(),
            11 * MIN_AXIS_GAP + 1
        );
    }

    /// The position of a bonus of 0.3 on an axis up to 1.2 is 0.25.
    #[test]
    fn agents_with_a_bonus_have_an_axis_of_the_bonus() {
        let axes = Axes::of(
            &spec(&[[0.0, 1.0]; 2]),
            &OBSERVATIONS_AND_BONUS,
            BonusRange::UpTo(1.2),
        );
        assert_eq!(axes.all()[2].quantity.name, "intrinsic reward");
        let axis_positions = projected(
            &axes,
            &VisitedState {
                bonus: 0.3,
                ..state_at(0, &[0.5, 1.0])
            },
        );
        assert!(
            (axis_positions[2] - 0.25).abs() < 1e-6,
            "{axis_positions:?}"
        );
    }

    /// The first step has action 1 (10 N) and reward 1, on an axis from −2 to 2. The second step
    /// has action 0 and reward −5, which is outside the axis.
    #[test]
    fn chosen_axes_show_actions_rewards_and_steps() {
        let reward = AxisChoice::Reward {
            from: ranged_number(-2.0),
            to: ranged_number::<FiniteNumber>(2.0).into(),
        };
        let axes = Axes::of(
            &spec(&[[0.0, 1.0]]),
            &[AxisChoice::Action, reward, AxisChoice::Step],
            BonusRange::None,
        );
        assert_eq!(
            axes.all()
                .iter()
                .map(|axis| axis.quantity.name.as_str())
                .collect::<Vec<_>>(),
            ["push", "reward", "step"]
        );
        let mut episode = Episode::start(0, 0, 0, &spec(&[[0.0, 1.0]]));
        episode.observations = vec![0.1, 0.2, 0.3];
        episode.actions = vec![1.0, 0.0];
        episode.rewards = vec![1.0, -5.0];
        episode.outcome = Status::Truncated;
        let states: Vec<Vec<f32>> = VisitedState::of_episode(&episode, None)
            .filter(VisitedState::has_action)
            .map(|state| projected(&axes, &state))
            .collect();
        assert!(axes.need_actions());
        assert_eq!(states, [[1.0, 0.75, 0.0], [0.0, 0.0, 0.005]]);
    }

    /// On an axis from −4 to 4, the advantage 2 has position 0.75, and −5 is outside the axis. The
    /// last state has no action and so no advantage.
    #[test]
    fn advantages_have_positions_on_an_axis_of_advantages() {
        let advantage = AxisChoice::Advantage {
            from: ranged_number(-4.0),
            to: ranged_number::<FiniteNumber>(4.0).into(),
        };
        let axes = Axes::of(
            &spec(&[[0.0, 1.0]]),
            &[AxisChoice::Observations, advantage],
            BonusRange::None,
        );
        assert_eq!(
            (axes.all()[1].quantity.name.as_str(), axes.need_actions()),
            ("advantage", true)
        );
        let mut episode = Episode::start(0, 0, 0, &spec(&[[0.0, 1.0]]));
        (episode.observations, episode.actions) = (vec![0.5; 3], vec![1.0, 0.0]);
        episode.rewards = vec![1.0; 2];
        let step_data = StepData {
            advantages: vec![2.0, -5.0],
            ..StepData::empty_for(&episode)
        };
        let states: Vec<Vec<f32>> = VisitedState::of_episode(&episode, Some(&step_data))
            .filter(VisitedState::has_action)
            .map(|state| projected(&axes, &state))
            .collect();
        assert_eq!(states, [[0.5, 0.75], [0.5, 0.0]]);
    }
}
