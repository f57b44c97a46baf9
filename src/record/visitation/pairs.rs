//! Scatter plots of pairs of observations: a row of square panels with one point per state.

use super::axes::{Axis, VisitedState};
use crate::scenario::recording::PairChoice;
use seedbed_env::TaskSpec;

/// Number of cells along each side of a panel; a cell is a pixel.
pub const CELLS_PER_SIDE: usize = 40;

/// Distance between two panels, in pixels.
const PANEL_GAP: usize = 20;

/// The panels of a recording, from left to right.
#[derive(Clone, Debug, PartialEq)]
pub struct Pairs {
    /// The horizontal and the vertical axis of each panel.
    panels: Vec<[Axis; 2]>,
}

impl Pairs {
    /// The pairs of observations chosen in a scenario. If the task has only one observation, it is
    /// paired with the step within the episode.
    ///
    /// # Panics
    /// If a chosen name is not an observation of the task. This is prevented by
    /// [`check_pairs`](crate::scenario::recording::RecordingSettings::check_pairs), which reports such names as
    /// errors.
    #[must_use]
    pub fn of(spec: &TaskSpec, choice: &PairChoice) -> Self {
        let observation_count = spec.observations.len();
        let observation = |index: usize| Axis::observation(&spec.observations[index], index);
        let named = |name: &str| {
            let index = spec
                .observations
                .iter()
                .position(|quantity| quantity.name == name);
            observation(index.expect("names of pairs were checked"))
        };
        let panels = match choice {
            PairChoice::These(pairs) => pairs
                .iter()
                .map(|(across, upward)| [named(across), named(upward)])
                .collect(),
            PairChoice::First(_) if observation_count == 1 => {
                vec![[Axis::step(spec.time_limit), observation(0)]]
            }
            // If the number of observations is odd, the last one is paired with the observation
            // before it.
            PairChoice::First(max_pairs) => {
                (0..observation_count.div_ceil(2).min(max_pairs.get() as usize))
                    .map(|pair| (2 * pair).min(observation_count - 2))
                    .map(|first| [observation(first), observation(first + 1)])
                    .collect()
            }
        };
        Self { panels }
    }

    /// The horizontal and the vertical axis of each panel, from left to right.
    #[must_use]
    pub fn panels(&self) -> &[[Axis; 2]] {
        &self.panels
    }

    /// Width of all panels and the gaps between them, in pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        (self.panels.len() * (CELLS_PER_SIDE + PANEL_GAP)).saturating_sub(PANEL_GAP)
    }

    /// Left edge of a panel, in pixels.
    #[must_use]
    pub fn x(&self, panel: usize) -> usize {
        panel * (CELLS_PER_SIDE + PANEL_GAP)
    }

    /// Horizontal and vertical position of a state in each panel, 0 to 1.
    pub fn project(&self, state: &VisitedState<'_>) -> impl Iterator<Item = [f32; 2]> {
        self.panels
            .iter()
            .map(|[across, upward]| [across.fraction(state), upward.fraction(state)])
    }

    /// The points of a state, one per panel, in pixels.
    pub fn points(&self, state: &VisitedState<'_>) -> impl Iterator<Item = [f32; 2]> {
        let place = |(panel, [across, upward]): (usize, [f32; 2])| {
            [
                self.x(panel) as f32 + across * CELLS_PER_SIDE as f32,
                (1.0 - upward) * CELLS_PER_SIDE as f32,
            ]
        };
        self.project(state).enumerate().map(place)
    }
}

#[cfg(test)]
mod tests {
    use super::super::axes::tests::{spec, state_at};
    use super::*;
    use seedbed_input::numbers::ranged_count;

    fn panel_names(observations: usize, choice: &PairChoice) -> Vec<[String; 2]> {
        let pairs = Pairs::of(&spec(&vec![[0.0, 1.0]; observations]), choice);
        pairs
            .panels()
            .iter()
            .map(|panel| panel.clone().map(|axis| axis.quantity.name))
            .collect()
    }

    #[test]
    fn neighboring_observations_are_paired_by_default() {
        let first = PairChoice::First(ranged_count(3));
        assert_eq!(panel_names(1, &first), [["step", "o0"]]);
        assert_eq!(panel_names(3, &first), [["o0", "o1"], ["o1", "o2"]]);
        assert_eq!(panel_names(4, &first), [["o0", "o1"], ["o2", "o3"]]);
        assert_eq!(
            panel_names(9, &first),
            [["o0", "o1"], ["o2", "o3"], ["o4", "o5"]]
        );
        let chosen = PairChoice::These(vec![("o2".to_owned().into(), "o0".to_owned().into())]);
        assert_eq!(panel_names(3, &chosen), [["o2", "o0"]]);
    }

    /// The state is at a quarter of the width and at the top of the first panel, and in the middle
    /// of the left side of the second panel, which is 60 pixels further right.
    #[test]
    fn a_state_has_a_point_in_each_panel() {
        let pairs = Pairs::of(&spec(&[[0.0, 4.0]; 4]), &PairChoice::First(ranged_count(4)));
        assert_eq!(pairs.width(), 100);
        let points: Vec<[f32; 2]> = pairs.points(&state_at(0, &[1.0, 4.0, 0.0, 2.0])).collect();
        assert_eq!(points, [[10.0, 0.0], [60.0, 20.0]]);
    }
}
