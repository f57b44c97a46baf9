//! What a figure of runs shows.

use std::ops::Range;

use super::{FigureError, Over};
use crate::plotting::map_axes;
use crate::record::RecordedStates;
use crate::record::visitation::Axes;
use crate::review::condition::Condition;
use crate::review::selection::{EpisodeSelection, StateSelection};
use crate::scenario::recording::ColorBy;
use seedbed_env::Quantity;

/// What a figure of runs shows.
#[derive(Clone, Debug, Default)]
pub struct FigureSettings {
    /// The parts, from top to bottom in the order of [`Part`]; empty for the default parts.
    pub parts: Vec<Part>,
    /// The agents; empty for the first eight, or for all agents of several runs.
    pub agents: Vec<u32>,
    /// Numbers of the episodes of each agent; `None` for all.
    pub episodes: Option<Range<u32>>,
    /// Conditions that all states meet, such as `theta=-0.1..0.2`; see [`Condition::parse`].
    pub conditions: Vec<String>,
    /// Names of the axes, from left to right; empty for all.
    pub axes: Vec<String>,
    /// What the color of a state shows; `None` draws densities where there are many states.
    pub color_by: Option<ColorBy>,
    /// What returns and curves are drawn over.
    pub over: Over,
    /// Maximum number of states that a panel draws one by one.
    pub max_lines: u32,
    /// Width of the page in CSS pixels; [`DEFAULT_WIDTH`] is two columns of a paper.
    pub width: f64,
    /// Height of the page in CSS pixels, if it is given: maps have as many columns as make them largest.
    pub height: Option<f64>,
}

/// Width of a page in CSS pixels, unless another is chosen.
pub const DEFAULT_WIDTH: f64 = 760.0;

/// A part of a figure of runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Visited states as parallel coordinates, one panel per agent.
    Visitation,
    /// Difference of each agent from the team or, with several runs, of each run from the first.
    Difference,
    /// Visited states of all agents together, as a density.
    Density,
    /// Visited states in the plane of each pair of axes.
    Scatter,
    /// Returns over episodes.
    Returns,
    /// Columns of `rounds.csv`.
    Curves,
    /// All of them, as far as the runs have them.
    All,
}

/// The parts that are drawn by default.
const DEFAULT_PARTS: [Part; 5] = [
    Part::Scatter,
    Part::Visitation,
    Part::Difference,
    Part::Density,
    Part::Returns,
];

/// All parts, in the order in which they are drawn.
const ALL_PARTS: [Part; 6] = [
    Part::Visitation,
    Part::Difference,
    Part::Density,
    Part::Scatter,
    Part::Returns,
    Part::Curves,
];

/// The parts that show states.
const PARTS_WITH_STATES: [Part; 4] = [
    Part::Visitation,
    Part::Difference,
    Part::Density,
    Part::Scatter,
];

/// Maximum number of axes for which all pairs are drawn. With more axes, only pairs of neighboring
/// axes are drawn.
const MAX_PAIRED_AXES: usize = 5;

impl FigureSettings {
    /// Whether a part is drawn.
    pub(super) fn shows(&self, part: Part) -> bool {
        self.parts_in_order().contains(&part)
    }

    /// The parts that are drawn, from the top.
    pub(super) fn parts_in_order(&self) -> Vec<Part> {
        if self.parts.is_empty() {
            return DEFAULT_PARTS.to_vec();
        }
        if self.parts.contains(&Part::All) {
            return ALL_PARTS.to_vec();
        }
        let mut parts: Vec<Part> = Vec::new();
        for part in &self.parts {
            if !parts.contains(part) {
                parts.push(*part);
            }
        }
        parts
    }

    /// Whether any part shows states.
    pub(super) fn shows_states(&self) -> bool {
        PARTS_WITH_STATES.into_iter().any(|part| self.shows(part))
    }

    /// Indices of the selected axes among all axes of the recording.
    pub(super) fn axis_indices(&self, axes: &Axes) -> Result<Vec<usize>, FigureError> {
        let names = axes.all().iter().map(|axis| axis.quantity.name.as_str());
        let names: Vec<&str> = names.collect();
        if self.axes.is_empty() {
            return Ok((0..names.len()).collect());
        }
        let axis_index = |name: &String| {
            let index = names.iter().position(|axis_name| axis_name == name);
            index.ok_or_else(|| FigureError::NoAxis {
                name: name.clone(),
                known: names.join(", "),
            })
        };
        let axis_indices: Vec<usize> =
            self.axes.iter().map(axis_index).collect::<Result<_, _>>()?;
        if axis_indices.len() < 2 {
            return Err(FigureError::TooFewAxes);
        }
        Ok(axis_indices)
    }

    /// Whether scatter plots show one pair of axes, with one panel per agent: a pair is seen at a glance.
    pub(super) fn shows_one_pair(&self) -> bool {
        self.axes.len() == 2 || (self.axes.is_empty() && self.parts.is_empty())
    }

    /// The pairs of axes of scatter plots, as indices among all axes.
    pub(super) fn scatter_pairs(&self, axes: &Axes) -> Result<Vec<[usize; 2]>, FigureError> {
        if self.axes.is_empty() && self.parts.is_empty() {
            let quantities: Vec<&Quantity> = axes.all().iter().map(|axis| &axis.quantity).collect();
            return Ok(map_axes(&quantities).into_iter().collect());
        }
        Ok(axis_pairs(&self.axis_indices(axes)?))
    }

    /// The states of a run that are drawn.
    pub(super) fn state_selection(
        &self,
        recording: &RecordedStates,
        all_axes: &Axes,
    ) -> Result<StateSelection, FigureError> {
        let axes = self.axis_indices(all_axes)?;
        Ok(StateSelection {
            episodes: EpisodeSelection {
                agents: self.agents.clone(),
                episodes: self.episodes.clone().unwrap_or(0..u32::MAX),
            },
            conditions: self.parsed_conditions(recording)?,
            sample_size: self.max_lines as usize,
            pairs: self.scatter_pairs(all_axes)?,
            axes,
            all_axes: all_axes.clone(),
        })
    }

    fn parsed_conditions(&self, recording: &RecordedStates) -> Result<Vec<Condition>, FigureError> {
        let condition = |text: &String| {
            Condition::parse(text, recording).map_err(|reason| FigureError::Condition {
                condition: text.clone(),
                reason,
            })
        };
        self.conditions.iter().map(condition).collect()
    }
}

/// The pairs of axes that are drawn, as indices of axes.
fn axis_pairs(axes: &[usize]) -> Vec<[usize; 2]> {
    if axes.len() > MAX_PAIRED_AXES {
        return axes.windows(2).map(|pair| [pair[0], pair[1]]).collect();
    }
    let mut pairs = Vec::new();
    for (index, &first) in axes.iter().enumerate() {
        pairs.extend(axes[index + 1..].iter().map(|&second| [first, second]));
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_axes_are_paired_with_all_and_many_only_with_neighbors() {
        assert_eq!(axis_pairs(&[0, 2, 3]), [[0, 2], [0, 3], [2, 3]]);
        assert_eq!(axis_pairs(&[0, 1, 2, 3, 4, 5]).len(), 5);
    }
}
