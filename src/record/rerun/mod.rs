//! Writes `run.rrd`, a recording for the Rerun viewer and for queries.
//! The sole importer of the Rerun SDK; training may not enter.
//!
//! A recording in the making is `run.rrd.part`; it takes its final name when it is complete. Rows are collected and written in
//! pieces, because each piece has a head of its own; [`checkpoint`](Recorder::checkpoint) writes them out.

mod about;
mod blueprint;
mod curves;
mod forces;
mod framing;
mod furniture;
mod live;
mod opening;
mod pictures;
mod quantities;
mod raw;
pub mod read;
mod resume;
mod rounds;
mod rows;
mod scene;
mod serve;
mod shapes;
mod sink;
mod tiles;
mod visitation;
mod walls;

use std::ffi::OsString;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use rerun::StoreId;

use self::curves::Curves;
pub use self::live::{DEFAULT_VIEWER, Viewer, ViewerError};
use self::pictures::Pictures;
use self::raw::{RawColumns, RawTable};
use self::resume::Progress;
use self::scene::Film;
pub use self::serve::{ServeError, Server};
use self::sink::{Fault, Sink, Storage};
use self::visitation::{Drawing, Sample};
use self::walls::Walls;
use super::visitation::{Axes, Colouring, LineQuota, Pairs, Visited};
use super::{Attempt, Difference, RecordError, Recorder, RecordingSettings, RoundRecord};
use crate::env::{Scene, Spec};

const APPLICATION: &str = "seedbed";

/// What a recording is about, and so what the viewer shows first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Focus {
    /// How a team learned: visited states, returns, updates.
    Learning,
    /// How bodies moved: scenes.
    Motion,
}

/// Who looks at a recording while it is made.
#[derive(Debug)]
pub enum Audience {
    /// A running viewer, which is sent everything.
    Viewer(Viewer),
    /// Viewers that connect as they like.
    Visitors(Server),
}

/// What a recording says about its run.
#[derive(Clone, Copy, Debug)]
pub struct RecordingAbout<'a> {
    /// The run's name, shown by the viewer.
    pub name: &'a str,
    /// What it is about.
    pub focus: Focus,
    /// The task.
    pub spec: &'a Spec,
    /// The task's bodies, if it has any.
    pub scene: Option<&'a Scene>,
    /// K, the number of agents.
    pub agents: u32,
    /// The largest bonus that a step can have; none without curiosity.
    pub largest_bonus: Option<f32>,
    /// Episodes of each agent after which the run ends at the latest.
    pub episodes: u32,
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
    drawing: Drawing,
    walls: Walls,
    quota: LineQuota,
    /// Rounds that are pictured together.
    window: u32,
    density_every: u32,
    raw_every: u32,
    focus: Focus,
    control_step: f64,
    run_seed: u64,
    spec: Spec,
    episodes: u32,
    largest_bonus: Option<f32>,
    compared: bool,
    agents: Vec<AgentTrack>,
    team: Sample,
    visited: Vec<Visited>,
    pictures: Pictures,
    curves: Curves,
    films: Vec<Film>,
    /// Everything that is still needed after an interruption, save what was visited.
    progress: Progress,
}

/// What is being recorded of one agent.
struct AgentTrack {
    raw: RawTable,
    sample: Sample,
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
    pub fn create(
        path: &Path,
        about: &RecordingAbout<'_>,
        settings: &RecordingSettings,
    ) -> Result<Self, RecordError> {
        let paths = Paths::of(path);
        let begun = File::create(&paths.part).map_err(|error| error.to_string());
        let begun =
            begun.and_then(|file| Self::begin(paths.clone(), Box::new(file), about, settings));
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
            progress.check(about, settings)?;
            let store = StoreId::recording(APPLICATION, progress.recording_id.as_str());
            let sink = resume::reopened(&paths.part, &paths.done, progress.messages, store)?;
            Self::with(paths.clone(), sink, about, settings, progress)
        });
        resumed.map_err(|reason| RecordError {
            path: paths.part,
            attempt: Attempt::GoOn,
            reason,
        })
    }

    /// Shows the recording, as far as it has come and from now on. The file stays as it is.
    pub fn show_to(&mut self, audience: Audience) {
        let shown = match audience {
            Audience::Viewer(mut viewer) => viewer
                .catch_up(&self.paths.part)
                .map(|()| self.sink.show_in(viewer)),
            Audience::Visitors(server) => self.sink.serve(server, &self.paths.part),
        };
        if let Err(fault) = shown {
            self.sink.warn(fault);
        }
    }

    fn begin(
        paths: Paths,
        storage: Box<dyn Storage>,
        about: &RecordingAbout<'_>,
        settings: &RecordingSettings,
    ) -> Result<Self, Fault> {
        let progress = Progress::start(about, settings);
        let sink = Sink::new(
            StoreId::recording(APPLICATION, progress.recording_id.as_str()),
            storage,
        )?;
        let mut recorder = Self::with(paths, sink, about, settings, progress)?;
        recorder.introduce(about, settings)?;
        Ok(recorder)
    }

    fn with(
        paths: Paths,
        sink: Sink,
        about: &RecordingAbout<'_>,
        settings: &RecordingSettings,
        mut progress: Progress,
    ) -> Result<Self, Fault> {
        let columns = RawColumns::of(
            about.spec,
            about.largest_bonus.is_some(),
            settings.has_advantages(),
        )?;
        let visited = std::mem::take(&mut progress.visited);
        let track = |agent| AgentTrack {
            raw: RawTable::new(agent, &columns),
            sample: Sample::new(&format!("agent_{agent}")),
        };
        let drawing = Drawing::of(about, settings, progress.colour_range.unwrap_or([0.0, 1.0]));
        let films = settings
            .scene
            .iter()
            .zip(about.scene)
            .flat_map(|(settings, scene)| {
                settings
                    .agents
                    .iter()
                    .map(move |agent| Film::new(**agent, scene))
            });
        Ok(Self {
            paths,
            sink,
            walls: Walls::new(about.agents, &drawing.axes, &drawing.pairs),
            drawing,
            quota: LineQuota::of(settings.lines.get(), settings.window.get()),
            window: settings.window.get(),
            density_every: settings.density_every.get(),
            raw_every: settings.raw_every.get(),
            focus: about.focus,
            control_step: about.spec.control_step,
            run_seed: about.run_seed,
            spec: about.spec.clone(),
            episodes: about.episodes,
            largest_bonus: about.largest_bonus,
            compared: about.agents > 1 && settings.difference != Difference::Off,
            agents: (0..visited.len()).map(track).collect(),
            team: Sample::new("team"),
            pictures: Pictures::new(
                visited.len(),
                about.largest_bonus.is_some(),
                &settings.difference,
            ),
            visited,
            curves: Curves::new(about.agents as usize),
            films: films.collect(),
            progress,
        })
    }
}

impl Drawing {
    fn of(about: &RecordingAbout<'_>, settings: &RecordingSettings, range: [f32; 2]) -> Self {
        Self {
            axes: Axes::of(about.spec, &settings.axes, about.largest_bonus),
            pairs: Pairs::of(about.spec, &settings.pairs),
            colouring: Colouring {
                by: *settings.colour,
                range,
            },
        }
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

    fn warning(&mut self) -> Option<String> {
        self.sink.warning()
    }
}

impl RerunRecorder {
    fn save(&mut self) -> Result<Vec<u8>, Fault> {
        self.write(true)?;
        self.sink.sync()?;
        self.progress.messages = self.sink.messages();
        self.progress.visited.clone_from(&self.visited);
        let bytes = self.progress.to_bytes();
        self.progress.visited.clear();
        bytes
    }

    fn complete(&mut self) -> Result<(), Fault> {
        if self.progress.latest.is_some() && !self.progress.pictured {
            self.picture();
        }
        self.write(true)?;
        self.sink.finish()?;
        fs::rename(&self.paths.part, &self.paths.done).map_err(|error| error.to_string())
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
        Self {
            part: part.into(),
            done: done.to_owned(),
        }
    }

    fn error(&self, reason: Fault) -> RecordError {
        RecordError {
            path: self.part.clone(),
            attempt: Attempt::Write,
            reason,
        }
    }
}
