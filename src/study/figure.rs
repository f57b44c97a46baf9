//! What a study draws: the figures that its file asks for, in the words of that file.

use serde::{Deserialize, Serialize};

use super::file::Study;
use super::measure::{Curve, Measure};
use crate::input::numbers::{Count, known_count};
use crate::input::{Complaint, Located};

/// A figure of the report.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Figure {
    /// Means over the runs of each cell, episode by episode, with bands of 95 %.
    Curves {
        /// Stands above it.
        #[serde(default)]
        title: String,
        /// What is followed.
        #[serde(default)]
        of: Located<Curve>,
        /// Which cells; all if none is named.
        #[serde(default)]
        cells: Vec<Located<String>>,
        /// Episodes of the moving average.
        #[serde(default = "default_window")]
        window: Count,
    },
    /// Returns of the single agents of the first run of each cell, side by side.
    Agents {
        /// Stands above it.
        #[serde(default)]
        title: String,
        /// Which cells; all if none is named.
        #[serde(default)]
        cells: Vec<Located<String>>,
        /// Episodes of the moving average.
        #[serde(default = "default_window")]
        window: Count,
    },
    /// Visited states of the first run of each cell as parallel coordinates, cells side by side, a row for each of `episodes`.
    Visitation {
        /// Stands above it.
        #[serde(default)]
        title: String,
        /// Which cells; all if none is named.
        #[serde(default)]
        cells: Vec<Located<String>>,
        /// Up to which episodes of each agent.
        #[serde(default = "whole_training")]
        episodes: Vec<Upto>,
    },
    /// A measure of each cell as a dot with its interval of 95 %.
    Intervals {
        /// Stands above it.
        #[serde(default)]
        title: String,
        /// What; the study's first measure if nothing is said.
        #[serde(default)]
        measure: Option<Located<Measure>>,
        /// Which cells; all if none is named.
        #[serde(default)]
        cells: Vec<Located<String>>,
        /// Words of the cells' names, such as their tasks', over which runs are pooled.
        #[serde(default)]
        over: Located<Vec<String>>,
    },
    /// The share of runs that have not solved their task yet (Kaplan and Meier).
    Unsolved {
        /// Stands above it.
        #[serde(default)]
        title: String,
        /// Which cells; all if none is named.
        #[serde(default)]
        cells: Vec<Located<String>>,
    },
    /// The share of runs above each value of a measure: performance profiles.
    Profiles {
        /// Stands above it.
        #[serde(default)]
        title: String,
        /// What; the study's first measure if nothing is said.
        #[serde(default)]
        measure: Option<Located<Measure>>,
        /// Which cells; all if none is named.
        #[serde(default)]
        cells: Vec<Located<String>>,
        /// Words of the cells' names, such as their tasks', over which runs are pooled.
        #[serde(default)]
        over: Located<Vec<String>>,
    },
}

/// A part of training, from its beginning on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Upto {
    /// So many episodes of each agent.
    First(Count),
    /// All of it.
    All,
}

impl Upto {
    /// How many episodes of each agent.
    #[must_use]
    pub fn episodes(self) -> u32 {
        match self {
            Self::First(count) => count.get(),
            Self::All => u32::MAX,
        }
    }
}

impl Figure {
    /// Stands above it; empty where the file says nothing.
    #[must_use]
    pub fn title(&self) -> &str {
        self.heading().0
    }

    /// The cells that it names.
    #[must_use]
    pub fn cells(&self) -> &[Located<String>] {
        self.heading().1
    }

    /// What all kinds have: a title, and cells.
    fn heading(&self) -> (&str, &[Located<String>]) {
        match self {
            Self::Curves { title, cells, .. }
            | Self::Agents { title, cells, .. }
            | Self::Visitation { title, cells, .. }
            | Self::Intervals { title, cells, .. }
            | Self::Unsolved { title, cells, .. }
            | Self::Profiles { title, cells, .. } => (title, cells),
        }
    }

    /// Words of the cells' names over which its runs are pooled, if it says so.
    #[must_use]
    pub fn over(&self) -> Option<&Located<Vec<String>>> {
        match self {
            Self::Intervals { over, .. } | Self::Profiles { over, .. } if !over.is_empty() => {
                Some(over)
            }
            _ => None,
        }
    }

    /// What of a run it takes, in terms of measures; `main` where it names none.
    #[must_use]
    pub fn shown(&self, main: Measure) -> Option<Measure> {
        match self {
            Self::Curves { of, .. } => Some(Measure::Mean { of: **of }),
            Self::Intervals { measure, .. } | Self::Profiles { measure, .. } => {
                Some(measure.as_ref().map_or(main, |measure| **measure))
            }
            Self::Unsolved { .. } => Some(Measure::EpisodesToSolve),
            Self::Agents { .. } | Self::Visitation { .. } => None,
        }
    }

    /// What it is, as files spell it.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Curves { .. } => "Curves",
            Self::Agents { .. } => "Agents",
            Self::Visitation { .. } => "Visitation",
            Self::Intervals { .. } => "Intervals",
            Self::Unsolved { .. } => "Unsolved",
            Self::Profiles { .. } => "Profiles",
        }
    }

    /// Complains about it at the first place that it names.
    #[must_use]
    pub fn complain(&self, study: &Study, message: String) -> Complaint {
        match (self, self.measure(), self.cells().first()) {
            (Self::Curves { of, .. }, ..) => of.complain(message),
            (_, Some(measure), _) => measure.complain(message),
            (_, None, Some(cell)) => cell.complain(message),
            (_, None, None) => study.measures.complain(message),
        }
    }

    /// What it shows, where it shows a measure.
    fn measure(&self) -> Option<&Located<Measure>> {
        match self {
            Self::Intervals { measure, .. } | Self::Profiles { measure, .. } => measure.as_ref(),
            _ => None,
        }
    }

    /// Whether it shows this cell: it names it, or none at all.
    #[must_use]
    pub fn shows(&self, cell: &str) -> bool {
        self.cells().is_empty() || self.cells().iter().any(|name| name.as_str() == cell)
    }
}

fn default_window() -> Count {
    known_count(25)
}

fn whole_training() -> Vec<Upto> {
    vec![Upto::All]
}
