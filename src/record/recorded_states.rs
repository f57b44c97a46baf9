//! The visited states of a run, wherever they are recorded.

use std::collections::BTreeMap;
use std::path::Path;

use seedbed_env::{Quantity, Scene};

use super::recording::Recording;
use super::state_files::StateFiles;
use super::visitation::Axes;
use super::{ReadError, RecordedEpisode, RecordedScene};
use crate::run::facts::StateQuantity;
use crate::run::folder::is_state_file;
use crate::run::recorder::BonusRange;

/// The visited states of a run, which are read episode by episode.
#[derive(Clone, Debug, PartialEq)]
pub enum RecordedStates {
    /// A recording, `run.rrd`.
    Recording(Recording),
    /// Files of visited states, one per agent, that another program wrote.
    StateFiles(StateFiles),
}

impl RecordedStates {
    /// Opens a recording or the file of one agent.
    ///
    /// # Errors
    /// The file cannot be read, is damaged, or is of another kind.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        if is_state_file(path) {
            return StateFiles::open_file(path).map(Self::StateFiles);
        }
        Recording::open(path).map(Self::Recording)
    }

    /// The files of visited states, if the states are recorded in such files.
    #[must_use]
    pub fn state_files(&self) -> Option<&StateFiles> {
        match self {
            Self::Recording(_) => None,
            Self::StateFiles(files) => Some(files),
        }
    }

    /// Properties of the run by name, such as `environment` and `agents`.
    #[must_use]
    pub fn properties(&self) -> &BTreeMap<String, String> {
        match self {
            Self::Recording(recording) => recording.properties(),
            Self::StateFiles(files) => files.properties(),
        }
    }

    /// The observations of an agent, in order.
    #[must_use]
    pub fn observations(&self) -> &[Quantity] {
        match self {
            Self::Recording(recording) => recording.observations(),
            Self::StateFiles(files) => files.observations(),
        }
    }

    /// The components of an action, in order.
    #[must_use]
    pub fn actions(&self) -> &[Quantity] {
        match self {
            Self::Recording(recording) => recording.actions(),
            Self::StateFiles(files) => files.actions(),
        }
    }

    /// What is recorded beside the observations, in order. It has no ranges.
    #[must_use]
    pub fn info(&self) -> &[Quantity] {
        match self {
            Self::Recording(recording) => recording.info(),
            Self::StateFiles(_) => &[],
        }
    }

    /// The quantities of the task by name: observations, actions, entries of `info`.
    pub fn quantities_of_task(&self) -> impl Iterator<Item = (StateQuantity, &Quantity)> {
        StateQuantity::of_task(self.observations(), self.actions(), self.info())
    }

    /// Number of steps after which episodes are truncated or, if it is not known, length of the
    /// longest episode.
    #[must_use]
    pub fn time_limit(&self) -> u32 {
        match self {
            Self::Recording(recording) => recording.time_limit(),
            Self::StateFiles(files) => files.time_limit(),
        }
    }

    /// Whether agents have a bonus, and its range.
    #[must_use]
    pub fn bonus(&self) -> BonusRange {
        match self {
            Self::Recording(recording) => recording.bonus(),
            Self::StateFiles(_) => BonusRange::None,
        }
    }

    /// The axes of parallel coordinates: all observations and the bonus.
    #[must_use]
    pub fn axes(&self) -> Axes {
        match self {
            Self::Recording(recording) => recording.axes(),
            Self::StateFiles(files) => files.axes(),
        }
    }

    /// What is incomplete, for people.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        match self {
            Self::Recording(_) => &[],
            Self::StateFiles(files) => files.warnings(),
        }
    }

    /// All complete episodes. The episodes of each agent are in ascending order.
    ///
    /// # Errors
    /// If the file cannot be opened. An item is an error if the file is damaged.
    pub fn episodes(
        &self,
    ) -> Result<Box<dyn Iterator<Item = Result<RecordedEpisode, ReadError>>>, ReadError> {
        match self {
            Self::Recording(recording) => Ok(Box::new(recording.episodes()?)),
            Self::StateFiles(files) => Ok(Box::new(files.episodes())),
        }
    }

    /// The bodies of an agent in the recorded episodes; none in files of visited states.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn scenes(&self, agent: u32, scene: &Scene) -> Result<Vec<RecordedScene>, ReadError> {
        match self {
            Self::Recording(recording) => recording.scenes(agent, scene),
            Self::StateFiles(_) => Ok(Vec::new()),
        }
    }
}

impl From<Recording> for RecordedStates {
    fn from(recording: Recording) -> Self {
        Self::Recording(recording)
    }
}
