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

use rerun::StoreId;

use self::error::RecordingError;
use self::layouts::Layouts;
pub use self::live::{DEFAULT_VIEWER, Viewer};
pub use self::read::Recording;
use self::resume::State;
use self::rows::Moment;
use self::run_constants::RunConstants;
use self::samples::VisitationStyle;
pub use self::serve::Server;
use self::sink::{EncodedChunks, MessageBytes, Sink, Storage};
use self::writers::{Due, LocalAgent, TeamWriters, local_agents};
use super::ReadError;
use crate::record::visitation::AgentVisits;
use crate::run::ranks::Ranks;
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

    fn follow(
        self: Box<Self>,
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
        checkpoint: Option<&[u8]>,
    ) -> Result<Option<Box<dyn Recorder>>, RecordError> {
        let recorder = RerunRecorder::follow(&self.path, info, settings, checkpoint)?;
        Ok(Some(Box::new(recorder)))
    }
}

/// Writes an `.rrd` file. If the run is divided over ranks, each collects and encodes the rows of its agents, and rank 0 writes
/// them; all ranks must make the same calls.
pub struct RerunRecorder {
    paths: Paths,
    ranks: Ranks,
    store_id: StoreId,
    constants: RunConstants,
    style: VisitationStyle,
    /// The agents of this rank.
    agents: Vec<LocalAgent>,
    /// Whether a round was added.
    has_begun: bool,
    /// `None` on ranks other than 0.
    team: Option<Team>,
}

/// The file, and what all agents have in common.
struct Team {
    sink: Sink,
    layouts: Layouts,
    writers: TeamWriters,
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
            let mut recorder = Self::restored(paths.clone(), info, settings, &mut state)?;
            let sink = resume::reopen(&paths.part, &paths.done, info.ranks, &mut state)?;
            recorder.team = Some(Team::new(sink, info, settings, &recorder.style, state));
            Ok(recorder)
        });
        resumed.map_err(|error| paths.error(Attempt::Resume, &error))
    }

    /// The part of the recorder that belongs to a rank other than 0, from the beginning or from the checkpoint of rank 0.
    fn follow(
        path: &Path,
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
        bytes: Option<&[u8]>,
    ) -> Result<Self, RecordError> {
        let paths = Paths::of(path);
        let started = match bytes {
            None => Self::new(paths.clone(), info, settings, &State::start(info)).and_then(
                |mut recorder| {
                    recorder.write_header(info, settings)?;
                    Ok(recorder)
                },
            ),
            Some(bytes) => State::from_bytes(bytes)
                .and_then(|mut state| Self::restored(paths.clone(), info, settings, &mut state)),
        };
        started.map_err(|error| paths.error(Attempt::Resume, &error))
    }

    fn shown_in(mut self, live: Option<LiveTarget>) -> Self {
        if let (Some(target), Some(team)) = (live, &mut self.team) {
            team.stream_to(target, &self.paths.part);
        }
        self
    }

    fn start(
        paths: Paths,
        storage: Box<dyn Storage>,
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
    ) -> Result<Self, RecordingError> {
        let state = State::start(info);
        let mut sink = Sink::new(state.store_id(), info.agents, storage)?;
        if !info.ranks.is_single() {
            sink = sink.without_index();
        }
        let mut recorder = Self::new(paths, info, settings, &state)?;
        recorder.team = Some(Team::new(sink, info, settings, &recorder.style, state));
        recorder.write_header(info, settings)?;
        Ok(recorder)
    }

    /// A recorder without a file.
    fn new(
        paths: Paths,
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
        state: &State,
    ) -> Result<Self, RecordingError> {
        let style = VisitationStyle::of(info, settings, state.color_range);
        Ok(Self {
            paths,
            ranks: info.ranks,
            store_id: state.store_id(),
            constants: RunConstants::of(info, settings),
            agents: local_agents(info, settings, &style)?,
            style,
            has_begun: state.latest.is_some(),
            team: None,
        })
    }

    /// A recorder without a file, with the local agents of a checkpoint.
    fn restored(
        paths: Paths,
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
        state: &mut State,
    ) -> Result<Self, RecordingError> {
        state.check_team(info)?;
        let mut recorder = Self::new(paths, info, settings, state)?;
        let (style, has_bonus) = (&recorder.style, info.bonus.exists());
        for agent in &mut recorder.agents {
            let number = agent.number as usize;
            agent.next_step = state.next_steps[number];
            let visits: AgentVisits = postcard::from_bytes(&state.visits[number])
                .map_err(|_| RecordingError::Checkpoint)?;
            if !visits.was_made_for(&style.axes, &style.pairs, has_bonus) {
                return Err(RecordingError::OtherScenario);
            }
            agent.visits = visits;
        }
        state.visits.clear();
        Ok(recorder)
    }

    /// The state of the recorder, on rank 0; nothing on others.
    fn save(&mut self) -> Result<Vec<u8>, RecordingError> {
        let visits = |agent: &LocalAgent| postcard::to_stdvec(&agent.visits);
        let visits = self.agents.iter().map(visits).collect::<Result<_, _>>();
        let visits = visits.map_err(|error| RecordingError::Encoding(error.to_string()))?;
        let visits = self.ranks.gather_lists(visits);
        let rows = self.unwritten_rows()?;
        let rows = self.ranks.gather_bytes(rows);
        let Some(team) = &mut self.team else {
            return Ok(Vec::new());
        };
        team.sink.sync()?;
        let state = &mut team.state;
        state.messages = team.sink.message_count();
        state.written = team.sink.written();
        state.visits = visits;
        state.unwritten = EncodedChunks::read(&EncodedChunks::join(&rows)).as_file()?;
        let bytes = state.to_bytes();
        (state.visits, state.unwritten) = (Vec::new(), Vec::new());
        bytes
    }

    /// The rows of this rank that are not in the file yet, encoded.
    fn unwritten_rows(&self) -> Result<Vec<u8>, RecordingError> {
        let mut encoded = MessageBytes::new(&self.store_id)?;
        for agent in &self.agents {
            let chunks = agent.writers.clone().take(&self.style, Due::All)?;
            chunks.iter().try_for_each(|chunk| encoded.add(chunk))?;
        }
        if let Some(team) = &self.team {
            let mut rows = team.writers.clone();
            rows.write(&self.style, Due::All, &mut |chunk| encoded.add(&chunk))?;
        }
        encoded.into_chunks()
    }

    fn write_rest(&mut self) -> Result<(), RecordingError> {
        if let Some(team) = &mut self.team {
            team.state.states_since_write = 0;
        }
        self.write_chunks(Due::All, Workers::CURRENT_THREAD)
    }

    fn complete(&mut self) -> Result<(), RecordingError> {
        let team = self.team.as_ref();
        let needs_images = team.and_then(Team::needs_images);
        if let Some(end) = self.ranks.broadcast(needs_images) {
            self.add_images(end, Workers::CURRENT_THREAD);
        }
        self.write_chunks(Due::All, Workers::CURRENT_THREAD)?;
        let Some(team) = &mut self.team else {
            return Ok(());
        };
        team.sink.finish()?;
        Ok(fs::rename(&self.paths.part, &self.paths.done)?)
    }
}

impl Team {
    fn new(
        sink: Sink,
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
        style: &VisitationStyle,
        state: State,
    ) -> Self {
        Self {
            sink,
            layouts: Layouts::new(
                info.agents,
                &style.axes,
                &style.pairs,
                style.coloring.color_by,
            ),
            writers: TeamWriters::new(info, settings),
            state,
        }
    }

    /// Shows the recording in viewers, from its beginning and while it is written. Failures become
    /// warnings: the file does not depend on viewers.
    fn stream_to(&mut self, target: LiveTarget, file: &Path) {
        let streaming = match target {
            LiveTarget::Push(mut viewer) => {
                viewer.catch_up(file).map(|()| self.sink.push_to(viewer))
            }
            LiveTarget::Serve(server) => self.sink.serve_from(server, file),
        };
        if let Err(error) = streaming {
            self.sink.warn(error);
        }
    }

    /// The end of the latest round if there are no images of it yet.
    fn needs_images(&self) -> Option<Moment> {
        let has_rounds = self.state.latest.is_some();
        (has_rounds && !self.state.has_latest_images).then(|| self.end_of_latest_round())
    }
}

impl Recorder for RerunRecorder {
    fn record_round(&mut self, round: &RoundRecord<'_>) -> Result<(), RecordError> {
        self.add_round(round)
            .map_err(|error| self.paths.error(Attempt::Write, &error))
    }

    fn flush(&mut self) -> Result<(), RecordError> {
        self.write_rest()
            .map_err(|error| self.paths.error(Attempt::Write, &error))
    }

    fn checkpoint(&mut self) -> Result<Vec<u8>, RecordError> {
        self.save()
            .map_err(|error| self.paths.error(Attempt::Write, &error))
    }

    fn written_files(&self) -> Vec<WrittenFile> {
        let of_team = |team: &Team| WrittenFile {
            path: self.paths.part.clone(),
            written: team.state.written,
        };
        self.team.iter().map(of_team).collect()
    }

    fn finish(&mut self) -> Result<(), RecordError> {
        self.complete()
            .map_err(|error| self.paths.error(Attempt::Write, &error))
    }

    fn take_warning(&mut self) -> Option<String> {
        let warning = self.team.as_mut()?.sink.take_warning();
        warning.map(|warning| warning.to_string())
    }
}

/// If the recorder is dropped before the recording is complete, everything recorded so far is
/// written to `run.rrd.part`. Nothing is added to what the newest checkpoint describes, not even an
/// index, because only that can be verified. Of a run on several ranks, of which none waits for the others, this is what is in the
/// file already.
impl Drop for RerunRecorder {
    fn drop(&mut self) {
        if !self.ranks.is_single() {
            return;
        }
        drop(self.write_chunks(Due::All, Workers::CURRENT_THREAD));
        if let Some(Team { sink, state, .. }) = &mut self.team
            && sink.written() == state.written
        {
            sink.leave_without_index();
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
