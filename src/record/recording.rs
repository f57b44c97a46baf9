//! Replaces the module `rerun` in builds without the feature `rerun`: every call returns an error
//! with the reason. Types that only a successful call could return have no values.

use std::collections::BTreeMap;
use std::iter;
use std::path::{Path, PathBuf};

use seedbed_env::{Quantity, Scene};

use super::visitation::Axes;
use super::{LiveError, ReadError, RecordedEpisode, RecordedScene, UNAVAILABLE};
use crate::run::recorder::{Attempt, BonusRange, RecordError, Recorder, RecorderFactory, RunInfo};
use crate::scenario::recording::RecordingSettings;

/// Whether this build can write and read recordings. Builds with the feature `rerun` can.
pub const AVAILABLE: bool = false;

/// Fails.
///
/// # Errors
/// Always.
pub fn whole_length(path: &Path) -> Result<(usize, u64), ReadError> {
    Err(ReadError::Unreadable {
        path: path.to_owned(),
        reason: UNAVAILABLE.to_owned(),
    })
}

/// The address at which a viewer listens by default.
pub const DEFAULT_VIEWER: &str = "rerun+http://127.0.0.1:9876/proxy";

/// Stands in for the recording's file: this build cannot write recordings.
#[derive(Debug)]
pub struct RecordingFile {
    /// Path that the recording would have.
    pub path: PathBuf,
    /// Always `None`, because this build cannot show recordings.
    pub live: Option<LiveTarget>,
}

impl RecordingFile {
    fn error(self, attempt: Attempt) -> RecordError {
        let reason = UNAVAILABLE.to_owned();
        let path = self.path;
        RecordError {
            path,
            attempt,
            reason,
        }
    }
}

impl RecorderFactory for RecordingFile {
    fn create(
        self: Box<Self>,
        _: &RunInfo<'_>,
        _: &RecordingSettings,
    ) -> Result<Box<dyn Recorder>, RecordError> {
        Err(self.error(Attempt::Write))
    }

    fn resume(
        self: Box<Self>,
        _: &RunInfo<'_>,
        _: &RecordingSettings,
        _: &[u8],
    ) -> Result<Box<dyn Recorder>, RecordError> {
        Err(self.error(Attempt::Resume))
    }
}

/// Where a recording would be shown while it is written.
#[derive(Debug)]
pub enum LiveTarget {
    /// A running viewer.
    Push(Viewer),
    /// A server, to which viewers connect.
    Serve(Server),
}

/// A running viewer, which this build cannot connect to.
#[derive(Debug)]
pub enum Viewer {}

impl Viewer {
    /// Fails.
    ///
    /// # Errors
    /// Always [`LiveError::Unavailable`].
    pub fn connect(_: &str) -> Result<Self, LiveError> {
        Err(LiveError::Unavailable)
    }
}

/// A server of recordings, which this build cannot start.
#[derive(Debug)]
pub enum Server {}

impl Server {
    /// Fails.
    ///
    /// # Errors
    /// Always [`LiveError::Unavailable`].
    pub fn bind(_: u16) -> Result<Self, LiveError> {
        Err(LiveError::Unavailable)
    }

    /// The address that viewers connect to.
    #[must_use]
    pub fn address(&self) -> String {
        match *self {}
    }
}

/// An opened recording, which this build cannot read.
#[derive(Clone, Debug, PartialEq)]
pub enum Recording {}

impl Recording {
    /// Fails.
    ///
    /// # Errors
    /// Always [`ReadError::Unreadable`].
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Err(ReadError::Unreadable {
            path: path.to_owned(),
            reason: UNAVAILABLE.to_owned(),
        })
    }

    /// Facts about the run by name.
    #[must_use]
    pub fn properties(&self) -> &BTreeMap<String, String> {
        match *self {}
    }

    /// The bodies of an agent in the recorded episodes.
    ///
    /// # Errors
    /// Never, because there is no recording.
    pub fn scenes(&self, _: u32, _: &Scene) -> Result<Vec<RecordedScene>, ReadError> {
        match *self {}
    }

    /// The observations of an agent, in order.
    #[must_use]
    pub fn observations(&self) -> &[Quantity] {
        match *self {}
    }

    /// The actions of an agent, in order.
    #[must_use]
    pub fn actions(&self) -> &[Quantity] {
        match *self {}
    }

    /// What is recorded beside the observations, in order.
    #[must_use]
    pub fn info(&self) -> &[Quantity] {
        match *self {}
    }

    /// Number of steps after which episodes are truncated.
    #[must_use]
    pub fn time_limit(&self) -> u32 {
        match *self {}
    }

    /// Range of the intrinsic rewards, if the agents have any.
    #[must_use]
    pub fn bonus(&self) -> BonusRange {
        match *self {}
    }

    /// The axes of parallel coordinates.
    #[must_use]
    pub fn axes(&self) -> Axes {
        match *self {}
    }

    /// All episodes.
    ///
    /// # Errors
    /// Never: a recording cannot be opened.
    pub fn episodes(&self) -> Result<iter::Empty<Result<RecordedEpisode, ReadError>>, ReadError> {
        match *self {}
    }
}
