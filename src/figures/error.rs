//! Why a figure cannot be drawn.

use std::path::PathBuf;

use crate::record::ReadError;
use crate::review::LoadRunError;

/// Why a figure of runs cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// A run has no recording, although states are drawn.
    #[error("{0} has no recording, which is needed to draw states")]
    NotRecorded(PathBuf),
    /// The states of two runs have no common axes.
    #[error("{0}")]
    OtherAxes(String),
    /// A run has no such agent.
    #[error("no agent {agent} in {run}; expected 0 to {last}")]
    NoAgent {
        /// The run.
        run: PathBuf,
        /// The agent.
        agent: u32,
        /// Number of the last agent.
        last: u32,
    },
    /// There is no axis of this name.
    #[error("no axis `{name}`; expected {known}")]
    NoAxis {
        /// The name.
        name: String,
        /// Names of all axes.
        known: String,
    },
    /// Lines need two axes.
    #[error("expected at least two axes")]
    TooFewAxes,
    /// A condition on states cannot be read.
    #[error("{condition}: {reason}")]
    Condition {
        /// The condition.
        condition: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A run has no episodes among the chosen ones.
    #[error("{0} has no such episodes of these agents")]
    NoEpisodes(PathBuf),
    /// A run has no states that meet all conditions.
    #[error("{0} has no states that meet the conditions")]
    NoStates(PathBuf),
    /// A run has no table of rounds, whose curves are drawn.
    #[error("{0} has no rounds.csv")]
    NoRounds(PathBuf),
    /// The only agent of a run cannot differ from its team.
    #[error("{0} has one agent, which has no team to be compared with")]
    NoTeam(PathBuf),
    /// A run has no intrinsic rewards by which states are colored.
    #[error("{0} has no intrinsic rewards (its scenario has no `bonus`)")]
    NoBonus(PathBuf),
    /// A run cannot be read.
    #[error(transparent)]
    Run(#[from] LoadRunError),
}

impl From<ReadError> for FigureError {
    fn from(error: ReadError) -> Self {
        Self::Run(error.into())
    }
}
