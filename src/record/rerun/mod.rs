//! Writes `run.rrd`, a recording for the Rerun viewer and for queries. The sole importer of the Rerun SDK; training may not enter.
//!
//! A recording in the making is `run.rrd.part`; it takes its final name when it is complete. Rows are collected and written in
//! pieces, because each piece has a head of its own; [`checkpoint`](Recorder::checkpoint) writes them out.

mod about;
mod blueprint;
mod curves;
mod raw;
mod resume;
mod rows;
mod scene;
mod sink;
mod visitation;

use std::ffi::OsString;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use rerun::StoreId;
use rerun::external::re_log_types::{SetStoreInfo, StoreInfo, StoreSource};
use rerun::log::{Chunk, LogMsg, RowId};

use self::curves::Curves;
use self::raw::{RawColumns, RawTable};
use self::resume::Progress;
use self::rows::Moment;
use self::scene::Film;
use self::sink::{Fault, Sink, Storage};
use self::visitation::Visits;
use super::visitation::{Axes, LineQuota};
use super::{Footage, RecordError, Recorder, RecordingSettings, RoundRecord};
use crate::env::{Scene, Spec};
use crate::experience::Episode;
use crate::random::{Purpose, stream};

const APPLICATION: &str = "seedbed";

/// What a recording says about its run.
#[derive(Clone, Copy, Debug)]
pub struct RecordingAbout<'a> {
    /// The run's name, shown by the viewer.
    pub name: &'a str,
    /// The task.
    pub spec: &'a Spec,
    /// The task's bodies, if it has any.
    pub scene: Option<&'a Scene>,
    /// K, the number of agents.
    pub agents: u32,
    /// The run's seed; which states become lines is derived from it.
    pub run_seed: u64,
    /// The resolved scenario, in RON.
    pub scenario: &'a str,
    /// Further facts by name, such as the algorithm.
    pub properties: &'a [(&'a str, String)],
}

/// Records into an `.rrd` file.
pub struct RerunRecorder {
    paths: Paths,
    sink: Sink,
    axes: Axes,
    quota: LineQuota,
    density_every: u32,
    run_seed: u64,
    time_limit: u32,
    agents: Vec<AgentTrack>,
    curves: Curves,
    film: Option<Film>,
    /// Everything that is still needed after an interruption, save the densities.
    progress: Progress,
}

/// What is being recorded of one agent.
struct AgentTrack {
    raw: RawTable,
    visits: Visits,
}

#[derive(Clone, Debug)]
struct Paths {
    part: PathBuf,
    done: PathBuf,
}

impl RerunRecorder {
    /// Begins a recording that will be at `path` once it is complete.
    ///
    /// # Errors
    /// The file could not be created or written.
    pub fn create(path: &Path, about: &RecordingAbout<'_>, settings: &RecordingSettings) -> Result<Self, RecordError> {
        let paths = Paths::of(path);
        let begun = File::create(&paths.part).map_err(|error| error.to_string());
        let begun = begun.and_then(|file| Self::begin(paths.clone(), Box::new(file), about, settings));
        begun.map_err(|fault| paths.error(fault))
    }

    /// Goes on with the recording at `path` from where [`checkpoint`](Recorder::checkpoint) returned `bytes`.
    ///
    /// # Errors
    /// The bytes are not a checkpoint of this recording, or the file could not be read or written.
    pub fn resume(
        path: &Path,
        about: &RecordingAbout<'_>,
        settings: &RecordingSettings,
        bytes: &[u8],
    ) -> Result<Self, RecordError> {
        let paths = Paths::of(path);
        let resumed = Progress::from_bytes(bytes).and_then(|progress| {
            let store = StoreId::recording(APPLICATION, progress.recording_id.as_str());
            let sink = resume::reopened(&paths.part, &paths.done, progress.messages, store)?;
            Self::with(paths.clone(), sink, about, settings, progress)
        });
        resumed.map_err(|fault| paths.error(fault))
    }

    fn begin(
        paths: Paths,
        storage: Box<dyn Storage>,
        about: &RecordingAbout<'_>,
        settings: &RecordingSettings,
    ) -> Result<Self, Fault> {
        let progress = Progress::start(about, &Axes::of(about.spec));
        let sink = Sink::new(StoreId::recording(APPLICATION, progress.recording_id.as_str()), storage)?;
        let mut recorder = Self::with(paths, sink, about, settings, progress)?;
        recorder.introduce(about)?;
        Ok(recorder)
    }

    fn with(
        paths: Paths,
        sink: Sink,
        about: &RecordingAbout<'_>,
        settings: &RecordingSettings,
        mut progress: Progress,
    ) -> Result<Self, Fault> {
        let columns = RawColumns::of(about.spec)?;
        let densities = std::mem::take(&mut progress.densities).into_iter().enumerate();
        let track = |(agent, density)| AgentTrack { raw: RawTable::new(agent, &columns), visits: Visits::new(agent, density) };
        let filmed = settings.scene.as_ref().zip(about.scene);
        Ok(Self {
            paths,
            sink,
            axes: Axes::of(about.spec),
            quota: LineQuota::of(settings.lines),
            density_every: settings.density_every.max(1),
            run_seed: about.run_seed,
            time_limit: about.spec.time_limit,
            agents: densities.map(track).collect(),
            curves: Curves::new(about.agents as usize),
            film: filmed.map(|(settings, scene)| Film::new(settings.agent, scene)),
            progress,
        })
    }

    /// Writes what is true throughout: what this recording is, names, colours, shapes.
    fn introduce(&mut self, about: &RecordingAbout<'_>) -> Result<(), Fault> {
        let info =
            StoreInfo::new(self.sink.store().clone(), StoreSource::Other(format!("seedbed {}", env!("CARGO_PKG_VERSION"))));
        self.sink.send(&LogMsg::SetStoreInfo(SetStoreInfo { row_id: *RowId::new(), info }))?;
        let mut chunks = about::chunks(about)?.to_vec();
        let layout = self.layout(None);
        chunks.extend(visitation::furniture(&self.axes, layout.wide_lettering(), layout.narrow_lettering())?);
        chunks.extend(self.curves.styles()?);
        for (agent, track) in (0..).zip(&self.agents) {
            chunks.push(track.visits.style(agent, self.quota.per_round)?);
        }
        if let Some(film) = &self.film {
            chunks.extend(film.shapes()?);
        }
        chunks.iter().try_for_each(|chunk| self.sink.send_chunk(chunk))
    }

    /// How the recording is shown; the first film tells where its actors are.
    fn lay_out(&mut self, footage: Option<&Footage>) -> Result<(), Fault> {
        let messages = blueprint::messages(APPLICATION, &self.layout(footage))?;
        messages.iter().try_for_each(|message| self.sink.send(message))
    }

    fn layout(&self, footage: Option<&Footage>) -> blueprint::Layout<'_> {
        blueprint::Layout {
            agents: self.agents.len() as u32,
            axes: &self.axes,
            quota: self.quota,
            time_limit: self.time_limit,
            filmed: self.film.as_ref().map(|film| (film.agent(), footage.and_then(|footage| film.view(footage)))),
        }
    }

    fn take_in(&mut self, round: &RoundRecord<'_>) -> Result<(), Fault> {
        if self.progress.latest.is_none() {
            self.lay_out(round.footage)?;
        }
        let mut rows = round.episode_rows.iter();
        let mut latest_episode = 0;
        for episodes in round.episodes.chunk_by(|one, next| one.agent == next.agent) {
            let mut random = stream(self.run_seed, Purpose::Recording, episodes[0].agent, round.round);
            for (index, episode) in episodes.iter().enumerate() {
                let lines = self.quota.of_episode(index, episodes.len());
                let (first, end) = self.moments(episode);
                let track = &mut self.agents[episode.agent as usize];
                track.raw.add(episode, first);
                track.visits.add(&self.axes, episode, end, lines, &mut random);
                if let Some(row) = rows.next() {
                    self.curves.add_episode(row, end);
                }
                self.film_episode(round, episode, first)?;
                latest_episode = latest_episode.max(end.episode);
            }
        }
        (self.progress.latest, self.progress.pictured) = (Some((round.round.into(), latest_episode)), false);
        let end = self.now();
        self.curves.add_round(round.episode_rows, round.round_rows, end, &mut self.progress.latest_returns);
        self.write(false)?;
        if round.round.is_multiple_of(self.density_every) { self.picture() } else { Ok(()) }
    }

    /// The first and the last row of an episode on the timelines; the agent's next episode begins after them.
    fn moments(&mut self, episode: &Episode) -> (Moment, Moment) {
        let next_step = &mut self.progress.next_steps[episode.agent as usize];
        let first = Moment { env_step: *next_step, episode: episode.episode.into(), round: episode.round.into() };
        let end = Moment { env_step: *next_step + episode.length() as i64, ..first };
        *next_step = end.env_step + 1;
        (first, end)
    }

    fn film_episode(&mut self, round: &RoundRecord<'_>, episode: &Episode, first: Moment) -> Result<(), Fault> {
        let footage = round.footage.filter(|footage| (footage.agent, footage.episode) == (episode.agent, episode.episode));
        if let (Some(film), Some(footage)) = (&self.film, footage) {
            let chunks = film.develop(footage, first)?;
            chunks.iter().try_for_each(|chunk| self.sink.send_chunk(chunk))?;
        }
        Ok(())
    }

    /// The end of the latest round, at the step of the agent that has gone furthest.
    fn now(&self) -> Moment {
        let (round, episode) = self.progress.latest.unwrap_or_default();
        let env_step = self.progress.next_steps.iter().max().map_or(0, |next| (next - 1).max(0));
        Moment { env_step, episode, round }
    }

    /// Writes those collected rows that make a good piece, or all.
    fn write(&mut self, all: bool) -> Result<(), Fault> {
        for track in &mut self.agents {
            let raw = if all || track.raw.is_ready() { track.raw.take() } else { None };
            let lines = if all || track.visits.is_ready() { track.visits.take_lines(&self.axes) } else { None };
            raw.into_iter().chain(lines).try_for_each(|chunk| self.sink.send_chunk(&chunk?))?;
        }
        self.curves.take(all).try_for_each(|chunk| self.sink.send_chunk(&chunk?))
    }

    /// Pictures all states visited so far.
    fn picture(&mut self) -> Result<(), Fault> {
        let now = self.now();
        let mut chunks: Vec<Chunk> = Vec::new();
        for track in &mut self.agents {
            chunks.push(track.visits.picture(&self.axes, now)?);
        }
        chunks.push(visitation::team_picture(self.agents.iter_mut().map(|track| &mut track.visits), &self.axes, now)?);
        self.progress.pictured = true;
        chunks.iter().try_for_each(|chunk| self.sink.send_chunk(chunk))
    }
}

impl RerunRecorder {
    fn save(&mut self) -> Result<Vec<u8>, Fault> {
        self.write(true)?;
        self.sink.sync()?;
        self.progress.messages = self.sink.messages();
        self.progress.densities = self.agents.iter().map(|track| track.visits.density.clone()).collect();
        let bytes = self.progress.to_bytes();
        self.progress.densities.clear();
        bytes
    }

    fn complete(&mut self) -> Result<(), Fault> {
        self.write(true)?;
        if self.progress.latest.is_some() && !self.progress.pictured {
            self.picture()?;
        }
        self.sink.finish()?;
        fs::rename(&self.paths.part, &self.paths.done).map_err(|error| error.to_string())
    }
}

impl Recorder for RerunRecorder {
    fn record_round(&mut self, round: &RoundRecord<'_>) -> Result<(), RecordError> {
        self.take_in(round).map_err(|fault| self.paths.error(fault))
    }

    fn checkpoint(&mut self) -> Result<Vec<u8>, RecordError> {
        self.save().map_err(|fault| self.paths.error(fault))
    }

    fn finish(&mut self) -> Result<(), RecordError> {
        self.complete().map_err(|fault| self.paths.error(fault))
    }
}

/// A recording that is given up keeps all it was told, under the name of a recording in the making.
impl Drop for RerunRecorder {
    fn drop(&mut self) {
        drop(self.write(true));
    }
}

impl Paths {
    fn of(done: &Path) -> Self {
        let mut part = OsString::from(done);
        part.push(".part");
        Self { part: part.into(), done: done.to_owned() }
    }

    fn error(&self, reason: Fault) -> RecordError {
        RecordError { path: self.part.clone(), reason }
    }
}
