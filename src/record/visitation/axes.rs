//! Parallel coordinates: where a state crosses each axis.

use super::{BINS, fraction};
use crate::env::{Choice, Quantity, Spec};
use crate::experience::Episode;
use crate::record::AxisChoice;

/// Height of the axes, in pixels: one for each bin.
pub const HEIGHT: usize = BINS;

/// All axes together are about this wide, in pixels.
const WIDTH: usize = 192;

/// Axes are never closer than this, in pixels.
const MIN_GAP: usize = 32;

/// The axes of a recording, from left to right.
#[derive(Clone, Debug, PartialEq)]
pub struct Axes {
    axes: Vec<Axis>,
    gap: usize,
}

/// One axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// What is read off it, with the values at its lower and upper end.
    pub quantity: Quantity,
    source: Source,
}

/// Where an axis finds its value in a step.
#[derive(Clone, Debug, PartialEq)]
enum Source {
    Step,
    Observation(usize),
    Action(usize, Choice),
    Reward,
    Advantage,
    IntrinsicReward,
}

/// One step of an episode as it is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    pub(super) step: usize,
    pub(super) observation: &'a [f32],
    /// None at an episode's end, where nothing was done.
    pub(super) action: Option<&'a [f32]>,
    pub(super) reward: f32,
    pub(super) advantage: f32,
    /// What the step that was taken from there earned; nothing follows the last state, so that it has none.
    pub bonus: f32,
}

impl<'a> Seen<'a> {
    /// All states of an episode, in order: `[T + 1]`.
    pub fn all(episode: &'a Episode) -> impl Iterator<Item = Self> {
        let steps = episode.length();
        let (observed, acted) = (
            episode.observations.len() / (steps + 1),
            episode.actions.len() / steps.max(1),
        );
        (0..=steps).map(move |step| Self {
            step,
            observation: &episode.observations[step * observed..(step + 1) * observed],
            action: episode
                .actions
                .get(step * acted..(step + 1) * acted)
                .filter(|_| step < steps),
            reward: episode.rewards.get(step).copied().unwrap_or(0.0),
            advantage: episode.advantages.get(step).copied().unwrap_or(0.0),
            bonus: episode.intrinsic_rewards.get(step).copied().unwrap_or(0.0),
        })
    }

    /// A state that was read back, with the bonus of what was done there.
    #[must_use]
    pub fn state(step: usize, observation: &'a [f32], bonus: f32) -> Self {
        Self {
            step,
            observation,
            action: None,
            reward: 0.0,
            advantage: 0.0,
            bonus,
        }
    }

    /// Whether something was done there.
    #[must_use]
    pub fn acts(&self) -> bool {
        self.action.is_some()
    }
}

impl Axes {
    /// The chosen axes of a task. A single one gets the step within the episode as its neighbour; the bonus, up to `largest_bonus`, has
    /// an axis only where agents are curious.
    #[must_use]
    pub fn of(spec: &Spec, choices: &[AxisChoice], largest_bonus: Option<f32>) -> Self {
        let axes = choices
            .iter()
            .flat_map(|choice| Axis::chosen(*choice, spec, largest_bonus))
            .collect();
        Self::with_steps(axes, spec.time_limit)
    }

    /// The axes of all observations and of the bonus, from what a recording tells of its task.
    #[must_use]
    pub fn of_quantities(
        observations: &[Quantity],
        time_limit: u32,
        largest_bonus: Option<f32>,
    ) -> Self {
        let observed = observations
            .iter()
            .enumerate()
            .map(|(index, quantity)| Axis::observation(quantity, index));
        Self::with_steps(
            observed.chain(largest_bonus.map(Axis::bonus)).collect(),
            time_limit,
        )
    }

    /// Lines lead from an axis to the next: the step stands in where there are fewer than two.
    fn with_steps(mut axes: Vec<Axis>, time_limit: u32) -> Self {
        while axes.len() < 2 {
            axes.insert(0, Axis::step(time_limit));
        }
        Self::side_by_side(axes)
    }

    fn side_by_side(axes: Vec<Axis>) -> Self {
        let gap = (WIDTH / (axes.len() - 1).max(1)).max(MIN_GAP);
        Self { axes, gap }
    }

    /// Some of these axes, by their places, as axes of a picture of their own.
    #[must_use]
    pub fn chosen(&self, places: &[usize]) -> Self {
        Self::side_by_side(
            places
                .iter()
                .map(|&place| self.axes[place].clone())
                .collect(),
        )
    }

    /// From left to right.
    #[must_use]
    pub fn all(&self) -> &[Axis] {
        &self.axes
    }

    /// Pairs of neighbouring axes.
    #[must_use]
    pub fn pairs(&self) -> usize {
        self.axes.len() - 1
    }

    /// From one axis to the next, in pixels.
    pub(super) fn gap(&self) -> usize {
        self.gap
    }

    /// Width of the picture, in pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.pairs() * self.gap + 1
    }

    /// Where axis `axis` stands: the middle of its column of pixels.
    #[must_use]
    pub fn x(&self, axis: usize) -> f32 {
        (axis * self.gap) as f32 + 0.5
    }

    /// Whether an axis tells what was done, so that an episode's last state has no line.
    #[must_use]
    pub fn show_actions(&self) -> bool {
        self.axes.iter().any(|axis| {
            matches!(
                axis.source,
                Source::Action(..) | Source::Reward | Source::Advantage
            )
        })
    }

    /// Puts where a state crosses the axes, 0 at their lower and 1 at their upper ends, into `fractions`: `[axes]`.
    /// What lies beyond an end counts as at the end.
    pub fn project(&self, seen: &Seen<'_>, fractions: &mut Vec<f32>) {
        fractions.clear();
        fractions.extend(self.axes.iter().map(|axis| axis.fraction(seen)));
    }

    /// The polyline of a projected state: `[axes]` points.
    pub fn line(&self, fractions: &[f32]) -> impl Iterator<Item = [f32; 2]> {
        fractions
            .iter()
            .enumerate()
            .map(|(axis, fraction)| [self.x(axis), (1.0 - fraction) * HEIGHT as f32])
    }
}

impl Axis {
    fn chosen(choice: AxisChoice, spec: &Spec, largest_bonus: Option<f32>) -> Vec<Self> {
        match choice {
            AxisChoice::Observations => Self::observations(spec),
            AxisChoice::Action => (0..spec.actions.len())
                .map(|index| Self::action(spec, index))
                .collect(),
            AxisChoice::Reward { from, to } => vec![Self::named(
                "reward",
                [from.get_f32(), to.get_f32()],
                Source::Reward,
            )],
            AxisChoice::Advantage { from, to } => {
                vec![Self::named(
                    "advantage",
                    [from.get_f32(), to.get_f32()],
                    Source::Advantage,
                )]
            }
            AxisChoice::IntrinsicReward => largest_bonus.into_iter().map(Self::bonus).collect(),
            AxisChoice::Step => vec![Self::step(spec.time_limit)],
        }
    }

    fn observations(spec: &Spec) -> Vec<Self> {
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
            source: Source::Observation(index),
        }
    }

    fn action(spec: &Spec, index: usize) -> Self {
        let action = &spec.actions[index];
        Self {
            quantity: action.quantity.clone(),
            source: Source::Action(index, action.choice.clone()),
        }
    }

    /// The axis of steps within an episode.
    pub(super) fn step(time_limit: u32) -> Self {
        Self::named("step", [0.0, time_limit.max(1) as f32], Source::Step)
    }

    /// A range without extent, where bonuses weigh nothing, gets one.
    fn bonus(largest: f32) -> Self {
        Self::named(
            "intrinsic reward",
            [0.0, if largest > 0.0 { largest } else { 1.0 }],
            Source::IntrinsicReward,
        )
    }

    fn named(name: &str, range: [f32; 2], source: Source) -> Self {
        Self {
            quantity: Quantity {
                name: name.to_owned(),
                unit: String::new(),
                range,
            },
            source,
        }
    }

    /// Where a state lies on the axis, 0 to 1.
    pub(super) fn fraction(&self, seen: &Seen<'_>) -> f32 {
        let value = match &self.source {
            Source::Step => seen.step as f32,
            Source::Observation(index) => seen.observation[*index],
            Source::Action(index, choice) => seen
                .action
                .map_or(0.0, |action| meant(choice, action[*index])),
            Source::Reward => seen.reward,
            Source::Advantage => seen.advantage,
            Source::IntrinsicReward => seen.bonus,
        };
        fraction(value, self.quantity.range)
    }
}

/// A discrete action is the index of its value.
fn meant(choice: &Choice, action: f32) -> f32 {
    match choice {
        Choice::Discrete(values) => values[action as usize],
        Choice::Continuous => action,
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::env::{Action, Status};
    use crate::input::numbers::{Finite, known};

    const ALL: [AxisChoice; 2] = [AxisChoice::Observations, AxisChoice::IntrinsicReward];

    /// A task that observes `o0`, `o1`, …, with two pushes to choose from.
    pub(crate) fn spec(ranges: &[[f32; 2]]) -> Spec {
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
        Spec {
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
        }
    }

    /// A state from which nothing is done.
    pub(crate) fn seen(step: usize, observation: &[f32]) -> Seen<'_> {
        Seen {
            step,
            observation,
            action: None,
            reward: 0.0,
            advantage: 0.0,
            bonus: 0.0,
        }
    }

    fn projected(axes: &Axes, seen: &Seen<'_>) -> Vec<f32> {
        let mut fractions = Vec::new();
        axes.project(seen, &mut fractions);
        fractions
    }

    #[test]
    fn a_state_is_a_line_across_the_axes() {
        let axes = Axes::of(&spec(&[[-2.0, 2.0], [0.0, 10.0], [-1.0, 1.0]]), &ALL, None);
        assert_eq!((axes.pairs(), axes.width()), (2, 193));
        let fractions = projected(&axes, &seen(0, &[1.0, 2.5, -1.0]));
        assert_eq!(fractions, [0.75, 0.25, 0.0]);
        assert_eq!(
            axes.line(&fractions).collect::<Vec<_>>(),
            [[0.5, 16.0], [96.5, 48.0], [192.5, 64.0]]
        );
    }

    #[test]
    fn values_beyond_the_axes_stop_at_their_ends() {
        let axes = Axes::of(&spec(&[[-1.0, 1.0]; 3]), &ALL, None);
        assert_eq!(
            projected(&axes, &seen(0, &[-7.0, f32::INFINITY, f32::NAN])),
            [0.0, 1.0, 0.0]
        );
    }

    #[test]
    fn a_single_observation_is_drawn_against_the_step() {
        let axes = Axes::of(&spec(&[[0.0, 4.0]]), &ALL, None);
        assert_eq!(axes.all()[0].quantity.name, "step");
        assert_eq!(projected(&axes, &seen(50, &[3.0])), [0.25, 0.75]);
    }

    #[test]
    fn many_axes_keep_their_distance() {
        assert_eq!(
            Axes::of(&spec(&[[0.0, 1.0]; 12]), &ALL, None).width(),
            11 * MIN_GAP + 1
        );
    }

    /// A bonus of 0.3 of at most 1.2 crosses the last axis at a quarter of its height.
    #[test]
    fn curious_agents_have_an_axis_for_their_bonus() {
        let axes = Axes::of(&spec(&[[0.0, 1.0]; 2]), &ALL, Some(1.2));
        assert_eq!(axes.all()[2].quantity.name, "intrinsic reward");
        let fractions = projected(
            &axes,
            &Seen {
                bonus: 0.3,
                ..seen(0, &[0.5, 1.0])
            },
        );
        assert!((fractions[2] - 0.25).abs() < 1e-6, "{fractions:?}");
    }

    /// Two steps: push with index 1, which means 10 N, for a reward of 1 of −2 to 2; then with index 0 for −5, which is beyond the axis.
    #[test]
    fn actions_rewards_and_steps_have_axes_where_wanted() {
        let reward = AxisChoice::Reward {
            from: known(-2.0),
            to: known::<Finite>(2.0).into(),
        };
        let axes = Axes::of(
            &spec(&[[0.0, 1.0]]),
            &[AxisChoice::Action, reward, AxisChoice::Step],
            None,
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
        let states: Vec<Vec<f32>> = Seen::all(&episode)
            .filter(Seen::acts)
            .map(|seen| projected(&axes, &seen))
            .collect();
        assert!(axes.show_actions());
        assert_eq!(states, [[1.0, 0.75, 0.0], [0.0, 0.0, 0.005]]);
    }

    /// From −4 to 4: 2 is at three quarters, −5 is beyond the axis; the last state, from which nothing is done, has no advantage.
    #[test]
    fn advantages_have_an_axis_where_wanted() {
        let advantage = AxisChoice::Advantage {
            from: known(-4.0),
            to: known::<Finite>(4.0).into(),
        };
        let axes = Axes::of(
            &spec(&[[0.0, 1.0]]),
            &[AxisChoice::Observations, advantage],
            None,
        );
        assert_eq!(
            (axes.all()[1].quantity.name.as_str(), axes.show_actions()),
            ("advantage", true)
        );
        let mut episode = Episode::start(0, 0, 0, &spec(&[[0.0, 1.0]]));
        (episode.observations, episode.actions) = (vec![0.5; 3], vec![1.0, 0.0]);
        (episode.rewards, episode.advantages) = (vec![1.0; 2], vec![2.0, -5.0]);
        let states: Vec<Vec<f32>> = Seen::all(&episode)
            .filter(Seen::acts)
            .map(|seen| projected(&axes, &seen))
            .collect();
        assert_eq!(states, [[0.5, 0.75], [0.5, 0.0]]);
    }
}
