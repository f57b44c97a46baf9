//! Figures in study files.

use serde::Deserialize;

use crate::experiment::measure::{Curve, Measure};
use seedbed_input::numbers::{Count, ranged_count};
use seedbed_input::{Located, ValidationError};

/// A figure of the report.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Figure {
    /// One curve per cell, the mean over its runs, with 95 % bands.
    Curves {
        /// Title [default: generated].
        #[serde(default)]
        title: String,
        /// What the curves are over.
        #[serde(default)]
        x: CurveAxis,
        /// Curve.
        #[serde(default)]
        of: Located<Curve>,
        /// Names of cells [default: all].
        #[serde(default)]
        cells: Vec<Located<String>>,
        /// Number of episodes of the moving average. Curves of everything up to an episode, such as
        /// `TeamCoverage`, are not averaged.
        #[serde(default = "default_window")]
        window: Count,
    },
    /// Returns of each agent in the first run of each cell, side by side.
    Agents {
        /// Title [default: generated].
        #[serde(default)]
        title: String,
        /// Names of cells [default: all].
        #[serde(default)]
        cells: Vec<Located<String>>,
        /// Number of episodes of the moving average.
        #[serde(default = "default_window")]
        window: Count,
    },
    /// Visited states of all runs of each cell as parallel coordinates, and their difference from those
    /// of the first cell: one column per cell, two rows for each of `episodes`.
    Visitation {
        /// Title [default: generated].
        #[serde(default)]
        title: String,
        /// Names of cells [default: all].
        #[serde(default)]
        cells: Vec<Located<String>>,
        /// Episodes of each agent whose states are shown.
        #[serde(default = "whole_training")]
        episodes: Vec<EpisodeWindow>,
    },
    /// Visited states of all runs of each cell in the plane of two observations, with the walls of the task if these are its
    /// coordinates: one panel per cell.
    Scatter {
        /// Title [default: generated].
        #[serde(default)]
        title: String,
        /// Names of cells [default: all].
        #[serde(default)]
        cells: Vec<Located<String>>,
        /// Names of the observations on the horizontal and the vertical axis [default: `x` and `y`, or the first two that are no
        /// velocities].
        #[serde(default)]
        axes: Option<(Located<String>, Located<String>)>,
        /// Episodes of each agent whose states are shown.
        #[serde(default = "all_episodes")]
        episodes: EpisodeWindow,
    },
    /// A measure of each cell as a dot with its 95 % interval.
    Intervals {
        /// Title [default: generated].
        #[serde(default)]
        title: String,
        /// Measure [default: the first of the study].
        #[serde(default)]
        measure: Option<Located<Measure>>,
        /// Names of cells [default: all].
        #[serde(default)]
        cells: Vec<Located<String>>,
        /// Parts of the cells' names, such as tasks, over which runs are pooled.
        #[serde(default)]
        over: Located<Vec<String>>,
        /// Name of the cell at whose value a dashed line is drawn, such as the floor of noise that does not learn.
        #[serde(default)]
        line: Option<Located<String>>,
    },
    /// Share of runs that have not solved their task yet (Kaplan–Meier curve).
    Unsolved {
        /// Title [default: generated].
        #[serde(default)]
        title: String,
        /// Names of cells [default: all].
        #[serde(default)]
        cells: Vec<Located<String>>,
    },
    /// Performance profile: share of runs above each value of a measure.
    Profiles {
        /// Title [default: generated].
        #[serde(default)]
        title: String,
        /// Measure [default: the first of the study].
        #[serde(default)]
        measure: Option<Located<Measure>>,
        /// Names of cells [default: all].
        #[serde(default)]
        cells: Vec<Located<String>>,
        /// Parts of the cells' names, such as tasks, over which runs are pooled.
        #[serde(default)]
        over: Located<Vec<String>>,
    },
    /// The mean of a measure over the number of agents, one panel per task, one curve per method.
    Scaling {
        /// Title [default: generated].
        #[serde(default)]
        title: String,
        /// Measure [default: the first of the study].
        #[serde(default)]
        measure: Option<Located<Measure>>,
        /// Names of cells [default: all].
        #[serde(default)]
        cells: Vec<Located<String>>,
    },
    /// Differences between cells whose names differ in one part, as a table of colored numbers over two
    /// other parts.
    Differences {
        /// Title [default: generated].
        #[serde(default)]
        title: String,
        /// Measure [default: the first of the study].
        #[serde(default)]
        measure: Option<Located<Measure>>,
        /// Names of cells [default: all].
        #[serde(default)]
        cells: Vec<Located<String>>,
        /// The compared parts of names: the measure of cells with the first, minus that of cells with the
        /// second.
        compare: (Located<String>, Located<String>),
        /// Name of the axis of the grid whose values are columns.
        columns: Located<String>,
        /// Name of the axis of the grid whose values are rows.
        rows: Located<String>,
    },
}

/// The horizontal axis of curves. At equal numbers of episodes, runs may have made different numbers of steps.
/// Seconds are no axis: results do not depend on the speed of a machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum CurveAxis {
    /// Episodes that each agent has finished.
    #[default]
    Episodes,
    /// Environment steps of the team.
    EnvSteps,
    /// Gradient steps of all networks of the team.
    GradientSteps,
}

impl CurveAxis {
    /// The axis in words.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::Episodes => "episodes of each agent",
            Self::EnvSteps => "environment steps of the team",
            Self::GradientSteps => "gradient steps of the team",
        }
    }
}

/// Episodes from the start of training.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum EpisodeWindow {
    /// The given number of first episodes of each agent.
    First(Count),
    /// All episodes.
    All,
}

impl EpisodeWindow {
    /// Maximum number of episodes of each agent.
    #[must_use]
    pub fn episodes(self) -> u32 {
        match self {
            Self::First(count) => count.get(),
            Self::All => u32::MAX,
        }
    }
}

impl Figure {
    /// Title in the study file; empty if there is none.
    #[must_use]
    pub fn title(&self) -> &str {
        self.title_and_cells().0
    }

    /// Names of the cells that the figure shows; empty for all cells.
    #[must_use]
    pub fn cells(&self) -> &[Located<String>] {
        self.title_and_cells().1
    }

    /// Title and cells, which all kinds of figures have.
    fn title_and_cells(&self) -> (&str, &[Located<String>]) {
        match self {
            Self::Curves { title, cells, .. }
            | Self::Agents { title, cells, .. }
            | Self::Visitation { title, cells, .. }
            | Self::Scatter { title, cells, .. }
            | Self::Intervals { title, cells, .. }
            | Self::Unsolved { title, cells, .. }
            | Self::Profiles { title, cells, .. }
            | Self::Scaling { title, cells, .. }
            | Self::Differences { title, cells, .. } => (title, cells),
        }
    }

    /// What runs must have been counted in for this figure; `None` if it counts nothing.
    #[must_use]
    pub fn counted(&self) -> Option<CurveAxis> {
        match self {
            Self::Curves { x, .. } => Some(*x),
            Self::Agents { .. } => Some(CurveAxis::Episodes),
            _ => None,
        }
    }

    /// Parts of the cells' names over which runs are pooled; `None` if runs are not pooled.
    #[must_use]
    pub fn over(&self) -> Option<&Located<Vec<String>>> {
        match self {
            Self::Intervals { over, .. } | Self::Profiles { over, .. } if !over.is_empty() => {
                Some(over)
            }
            _ => None,
        }
    }

    /// Name of the cell at whose value a line is drawn.
    #[must_use]
    pub fn line(&self) -> Option<&Located<String>> {
        match self {
            Self::Intervals { line, .. } => line.as_ref(),
            _ => None,
        }
    }

    /// The parts of names that a figure of differences compares; `None` for all others.
    #[must_use]
    pub fn compared_parts(&self) -> Option<(&Located<String>, &Located<String>)> {
        match self {
            Self::Differences { compare, .. } => Some((&compare.0, &compare.1)),
            _ => None,
        }
    }

    /// Measure that runs must have for this figure; `None` if runs need no measure. Figures of a
    /// measure default to `main_measure`.
    #[must_use]
    pub fn required_measure(&self, main_measure: Measure) -> Option<Measure> {
        match self {
            Self::Curves { of, .. } => Some(Measure::Mean { of: **of }),
            Self::Intervals { measure, .. }
            | Self::Profiles { measure, .. }
            | Self::Scaling { measure, .. }
            | Self::Differences { measure, .. } => {
                Some(measure.as_ref().map_or(main_measure, |measure| **measure))
            }
            Self::Unsolved { .. } => Some(Measure::EpisodesToSolve),
            Self::Agents { .. } | Self::Visitation { .. } | Self::Scatter { .. } => None,
        }
    }

    /// Parts of the training whose visited states the figure shows.
    #[must_use]
    pub fn windows(&self) -> &[EpisodeWindow] {
        match self {
            Self::Visitation { episodes, .. } => episodes,
            Self::Scatter { episodes, .. } => std::slice::from_ref(episodes),
            _ => &[],
        }
    }

    /// Name of this kind of figure in study files.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Curves { .. } => "Curves",
            Self::Agents { .. } => "Agents",
            Self::Visitation { .. } => "Visitation",
            Self::Scatter { .. } => "Scatter",
            Self::Intervals { .. } => "Intervals",
            Self::Unsolved { .. } => "Unsolved",
            Self::Profiles { .. } => "Profiles",
            Self::Scaling { .. } => "Scaling",
            Self::Differences { .. } => "Differences",
        }
    }

    /// An error that is located at this figure or, if it has no value of its own, at the measures of its study.
    #[must_use]
    pub fn error<T>(&self, measures: &Located<T>, message: String) -> ValidationError {
        match (self, self.measure(), self.cells().first()) {
            (Self::Curves { of, .. }, ..) => of.error(message),
            (_, Some(measure), _) => measure.error(message),
            (_, None, Some(cell)) => cell.error(message),
            (_, None, None) => measures.error(message),
        }
    }

    /// Measure given in the study file.
    fn measure(&self) -> Option<&Located<Measure>> {
        match self {
            Self::Intervals { measure, .. }
            | Self::Profiles { measure, .. }
            | Self::Scaling { measure, .. }
            | Self::Differences { measure, .. } => measure.as_ref(),
            _ => None,
        }
    }

    /// Whether the figure shows a cell: its list of cells contains the cell or is empty.
    #[must_use]
    pub fn shows(&self, cell: &str) -> bool {
        self.cells().is_empty() || self.cells().iter().any(|name| name.as_str() == cell)
    }
}

fn default_window() -> Count {
    ranged_count(25)
}

fn whole_training() -> Vec<EpisodeWindow> {
    vec![EpisodeWindow::All]
}

fn all_episodes() -> EpisodeWindow {
    EpisodeWindow::All
}
