//! Writes `run.rrd`, a recording for the Rerun viewer and for queries. Only this module imports the
//! Rerun SDK. It must not depend on training.
//!
//! While a run is in progress, or if it crashed, the file is `run.rrd.part`; it gets its final name
//! when it is complete. Rows are collected and written in chunks, because each chunk has a header
//! of its own. When they are written depends only on the number of recorded states, so that the
//! division into chunks depends neither on clocks nor on checkpoints. A
//! [`checkpoint`](Recorder::checkpoint) contains the rows that are not in the file yet.

mod annotations;
mod blueprint;
mod curves;
mod decode;
mod description;
mod error;
mod forces;
mod header;
mod images;
mod layouts;
mod live;
mod quantities;
mod raw;
mod read;
mod read_scenes;
mod resume;
mod ropes;
mod rounds;
mod rows;
mod run_constants;
mod samples;
mod scene;
mod serve;
mod shapes;
mod sink;
mod terrain;
mod tiles;
mod viewer_connection;
mod writers;

use std::ffi::OsString;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use self::error::RecordingError;
use self::layouts::Layouts;
pub use self::live::{DEFAULT_VIEWER, Viewer};
pub use self::read::Recording;
use self::resume::State;
use self::run_constants::RunConstants;
use self::samples::VisitationStyle;
pub use self::serve::Server;
use self::sink::{MessageBytes, Sink, Storage};
use self::writers::{Due, Writers};
use super::ReadError;
use crate::run::recorder::{Attempt, RecordError, Recorder, RecorderFactory, RoundRecord, RunInfo};
use crate::scenario::recording::RecordingSettings;
use crate::storage::written::WrittenFile;
use seedbed_learn::team::Workers;

/// Number of messages of a recording before the first damage or its end, and number of bytes up to there.
///
/// # Errors
/// The file is no recording or cannot be read.
pub fn whole_length(path: &Path) -> Result<(usize, u64), ReadError> {
    Ok(decode::Messages::open_unfinished(path)?.whole_length())
}

/// Whether this build can write and read recordings. Builds with the feature `rerun` can.
pub const AVAILABLE: bool = true;

const APPLICATION: &str = "seedbed";

/// Where a recording is shown while it is made.
#[derive(Debug)]
pub enum LiveTarget {
    /// A running viewer, to which all messages are sent.
    Push(Viewer),
    /// A server, to which any number of viewers connect.
    Serve(Server),
}

/// A recording that a run will write.
#[derive(Debug)]
pub struct RecordingFile {
    /// Path of the file when it is complete.
    pub path: PathBuf,
    /// The viewers that show the recording while it is written.
    pub live: Option<LiveTarget>,
}

impl RecorderFactory for RecordingFile {
    fn create(
        self: Box<Self>,
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
    ) -> Result<Box<dyn Recorder>, RecordError> {
        let recorder = RerunRecorder::create(&self.path, info, settings)?;
        Ok(Box::new(recorder.shown_in(self.live)))
    }

    fn resume(
        self: Box<Self>,
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
        checkpoint: &[u8],
    ) -> Result<Box<dyn Recorder>, RecordError> {
        let recorder = RerunRecorder::resume(&self.path, info, settings, checkpoint)?;
        Ok(Box::new(recorder.shown_in(self.live)))
    }
}

/// Writes an `.rrd` file.
pub struct RerunRecorder {
    paths: Paths,
    sink: Sink,
    constants: RunConstants,
    style: VisitationStyle,
    layouts: Layouts,
    writers: Writers,
    state: State,
}

/// An error if Rerun would panic, because it cannot represent this time.
fn check_clock(now: SystemTime) -> Result<(), RecordingError> {
    if now < SystemTime::UNIX_EPOCH {
        return Err(RecordingError::ClockBefore1970);
    }
    Ok(())
}

#[derive(Clone, Debug)]
struct Paths {
    /// Path of the file while it is written, which ends in `.part`.
    part: PathBuf,
    /// Path of the complete file.
    done: PathBuf,
}

impl RerunRecorder {
    /// Starts a recording whose file has the path `path` when it is complete.
    ///
    /// # Errors
    /// The file could not be created or written.
    pub fn create(
        path: &Path,
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
    ) -> Result<Self, RecordError> {
        let paths = Paths::of(path);
        let started = check_clock(SystemTime::now())
            .and_then(|()| Ok(File::create(&paths.part)?))
            .and_then(|file| Self::start(paths.clone(), Box::new(file), info, settings));
        started.map_err(|error| paths.error(Attempt::Write, &error))
    }

    /// Resumes the recording at `path` from a checkpoint: `bytes` is what
    /// [`checkpoint`](Recorder::checkpoint) returned.
    ///
    /// # Errors
    /// The bytes are not a checkpoint of this recording, or the file could not be read or written.
    pub fn resume(
        path: &Path,
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
        bytes: &[u8],
    ) -> Result<Self, RecordError> {
        let paths = Paths::of(path);
        let resumed = State::from_bytes(bytes).and_then(|mut state| {
            check_clock(SystemTime::now())?;
            state.check(info, settings)?;
            let sink = resume::reopen(&paths.part, &paths.done, &mut state)?;
            Self::from_parts(paths.clone(), sink, info, settings, state)
        });
        resumed.map_err(|error| paths.error(Attempt::Resume, &error))
    }

    fn shown_in(mut self, live: Option<LiveTarget>) -> Self {
        if let Some(target) = live {
            self.stream_to(target);
        }
        self
    }

    /// Shows the recording in viewers, from its beginning and while it is written. Failures become
    /// warnings: the file does not depend on viewers.
    fn stream_to(&mut self, target: LiveTarget) {
        let streaming = match target {
            LiveTarget::Push(mut viewer) => viewer
                .catch_up(&self.paths.part)
                .map(|()| self.sink.push_to(viewer)),
            LiveTarget::Serve(server) => self.sink.serve_from(server, &self.paths.part),
        };
        if let Err(error) = streaming {
            self.sink.warn(error);
        }
    }

    fn start(
        paths: Paths,
        storage: Box<dyn Storage>,
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
    ) -> Result<Self, RecordingError> {
        let state = State::start(info, settings);
        let sink = Sink::new(state.store_id(), info.agents, storage)?;
        let mut recorder = Self::from_parts(paths, sink, info, settings, state)?;
        recorder.write_header(info, settings)?;
        Ok(recorder)
    }

    fn from_parts(
        paths: Paths,
        sink: Sink,
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
        state: State,
    ) -> Result<Self, RecordingError> {
        let style = VisitationStyle::of(info, settings, state.color_range);
        Ok(Self {
            paths,
            sink,
            constants: RunConstants::of(info, settings),
            layouts: Layouts::new(
                info.agents,
                &style.axes,
                &style.pairs,
                style.coloring.color_by,
            ),
            style,
            writers: Writers::new(info, settings)?,
            state,
        })
    }

    fn save(&mut self) -> Result<Vec<u8>, RecordingError> {
        self.sink.sync()?;
        self.state.messages = self.sink.message_count();
        self.state.written = self.sink.written();
        let mut unwritten = MessageBytes::new(self.sink.store_id())?;
        let mut rows = self.writers.clone();
        rows.write(&self.style, Due::All, &mut |chunk| unwritten.add(&chunk))?;
        self.state.unwritten = unwritten.into_bytes()?;
        let bytes = self.state.to_bytes();
        self.state.unwritten = Vec::new();
        bytes
    }

    fn complete(&mut self) -> Result<(), RecordingError> {
        if self.state.latest.is_some() && !self.state.has_latest_images {
            self.add_images(Workers::CURRENT_THREAD);
        }
        self.write_chunks(Due::All)?;
        self.sink.finish()?;
        Ok(fs::rename(&self.paths.part, &self.paths.done)?)
    }
}

impl Recorder for RerunRecorder {
    fn record_round(&mut self, round: &RoundRecord<'_>) -> Result<(), RecordError> {
        self.add_round(round)
            .map_err(|error| self.paths.error(Attempt::Write, &error))
    }

    fn flush(&mut self) -> Result<(), RecordError> {
        self.state.states_since_write = 0;
        self.write_chunks(Due::All)
            .map_err(|error| self.paths.error(Attempt::Write, &error))
    }

    fn checkpoint(&mut self) -> Result<Vec<u8>, RecordError> {
        self.save()
            .map_err(|error| self.paths.error(Attempt::Write, &error))
    }

    fn written_files(&self) -> Vec<WrittenFile> {
        vec![WrittenFile {
            path: self.paths.part.clone(),
            written: self.state.written,
        }]
    }

    fn finish(&mut self) -> Result<(), RecordError> {
        self.complete()
            .map_err(|error| self.paths.error(Attempt::Write, &error))
    }

    fn take_warning(&mut self) -> Option<String> {
        self.sink.take_warning().map(|warning| warning.to_string())
    }
}

/// If the recorder is dropped before the recording is complete, everything recorded so far is
/// written to `run.rrd.part`. Nothing is added to what the newest checkpoint describes, not even an
/// index, because only that can be verified.
impl Drop for RerunRecorder {
    fn drop(&mut self) {
        drop(self.write_chunks(Due::All));
        if self.sink.written() == self.state.written {
            self.sink.leave_without_index();
        }
    }
}

impl Paths {
    fn of(done: &Path) -> Self {
        let mut part = OsString::from(done);
        part.push(".part");
        Self {
            part: part.into(),
            done: done.to_owned(),
        }
    }

    fn error(&self, attempt: Attempt, error: &RecordingError) -> RecordError {
        RecordError {
            path: self.part.clone(),
            attempt,
            reason: error.to_string(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_clock_before_1970_is_an_error() {
        let epoch = SystemTime::UNIX_EPOCH;
        assert_eq!(check_clock(epoch), Ok(()));
        let before = epoch.checked_sub(Duration::from_secs(1)).unwrap();
        assert_eq!(check_clock(before), Err(RecordingError::ClockBefore1970));
    }
}
