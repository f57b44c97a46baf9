//! Plots of one observation against another: a row of square panels, one point a state in each.

use super::axes::{Axis, Seen};
use crate::env::Spec;
use crate::record::PairChoice;

/// Cells along each side of a panel; a cell is a pixel.
pub const CELLS: usize = 40;

/// Between two panels, in pixels.
const GAP: usize = 20;

/// The panels of a recording, from left to right.
#[derive(Clone, Debug, PartialEq)]
pub struct Pairs {
    /// To the right and upwards.
    panels: Vec<[Axis; 2]>,
}

impl Pairs {
    /// The chosen pairs of a task's observations. A single observation is plotted against the step within the episode.
    ///
    /// # Panics
    /// If a chosen name is no observation's; [`check_task`](crate::record::RecordingSettings::check_task) tells before.
    #[must_use]
    pub fn of(spec: &Spec, choice: &PairChoice) -> Self {
        let observed = spec.observations.len();
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
                .map(|(across, upwards)| [named(across), named(upwards)])
                .collect(),
            PairChoice::First(_) if observed == 1 => {
                vec![[Axis::step(spec.time_limit), observation(0)]]
            }
            // The last of an odd number goes with its neighbour.
            PairChoice::First(most) => (0..observed.div_ceil(2).min(most.get() as usize))
                .map(|pair| (2 * pair).min(observed - 2))
                .map(|first| [observation(first), observation(first + 1)])
                .collect(),
        };
        Self { panels }
    }

    /// To the right and upwards, panel by panel.
    #[must_use]
    pub fn panels(&self) -> &[[Axis; 2]] {
        &self.panels
    }

    /// Width of all panels and the gaps between them, in pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        (self.panels.len() * (CELLS + GAP)).saturating_sub(GAP)
    }

    /// Where the left side of panel `panel` is, in pixels.
    #[must_use]
    pub fn x(&self, panel: usize) -> usize {
        panel * (CELLS + GAP)
    }

    /// Where a state is in each panel: to the right and upwards, 0 to 1.
    pub fn project(&self, seen: &Seen<'_>) -> impl Iterator<Item = [f32; 2]> {
        self.panels
            .iter()
            .map(|[across, upwards]| [across.fraction(seen), upwards.fraction(seen)])
    }

    /// The points of a state, one in each panel, in pixels.
    pub fn points(&self, seen: &Seen<'_>) -> impl Iterator<Item = [f32; 2]> {
        let place = |(panel, [across, upwards]): (usize, [f32; 2])| {
            [
                self.x(panel) as f32 + across * CELLS as f32,
                (1.0 - upwards) * CELLS as f32,
            ]
        };
        self.project(seen).enumerate().map(place)
    }
}

#[cfg(test)]
mod tests {
    use super::super::axes::tests::{seen, spec};
    use super::*;
    use crate::input::numbers::known_count;

    fn names(observations: usize, choice: &PairChoice) -> Vec<[String; 2]> {
        let pairs = Pairs::of(&spec(&vec![[0.0, 1.0]; observations]), choice);
        pairs
            .panels()
            .iter()
            .map(|panel| panel.clone().map(|axis| axis.quantity.name))
            .collect()
    }

    #[test]
    fn neighbours_are_paired_unless_told_otherwise() {
        let first = PairChoice::First(known_count(3));
        assert_eq!(names(1, &first), [["step", "o0"]]);
        assert_eq!(names(3, &first), [["o0", "o1"], ["o1", "o2"]]);
        assert_eq!(names(4, &first), [["o0", "o1"], ["o2", "o3"]]);
        assert_eq!(names(9, &first), [["o0", "o1"], ["o2", "o3"], ["o4", "o5"]]);
        let these = PairChoice::These(vec![("o2".to_owned().into(), "o0".to_owned().into())]);
        assert_eq!(names(3, &these), [["o2", "o0"]]);
    }

    /// At a quarter of the first panel's width and at the top; in the second panel, 60 pixels further, in the middle of the left side.
    #[test]
    fn a_state_is_a_point_in_each_panel() {
        let pairs = Pairs::of(&spec(&[[0.0, 4.0]; 4]), &PairChoice::First(known_count(4)));
        assert_eq!(pairs.width(), 100);
        let points: Vec<[f32; 2]> = pairs.points(&seen(0, &[1.0, 4.0, 0.0, 2.0])).collect();
        assert_eq!(points, [[10.0, 0.0], [60.0, 20.0]]);
    }
}
