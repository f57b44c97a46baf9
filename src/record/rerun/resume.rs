//! Goes on with a recording that was interrupted.
//!
//! A checkpoint names how many messages the file held. Those are copied to a fresh file, which then takes the old one's place:
//! what was written after the checkpoint is played again and must not be there twice.

use std::collections::VecDeque;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;

use rerun::StoreId;
use rerun::external::re_log_encoding::rrd::DecoderApp;
use rerun::external::re_log_types::RecordingId;
use serde::{Deserialize, Serialize};

use super::RecordingAbout;
use super::sink::{Fault, Sink};
use super::visitation::Drawing;
use crate::record::RecordingSettings;
use crate::record::visitation::Visited;

/// The format of [`Progress`].
const FORMAT: u32 = 2;

/// What a recording needs to go on, beside its file.
#[derive(Serialize, Deserialize)]
pub(super) struct Progress {
    /// So that bytes of another version are refused rather than misread.
    format: u32,
    /// Messages in the file.
    pub(super) messages: u64,
    /// Tells this recording from all others.
    pub(super) recording_id: String,
    /// Each agent's next step on its own timeline.
    pub(super) next_steps: Vec<i64>,
    /// What each agent visited.
    pub(super) visited: Vec<Visited>,
    /// The ends of the scale of lines and points, once they are known.
    pub(super) colour_range: Option<[f32; 2]>,
    /// The team's mean returns of the latest rounds.
    pub(super) latest_returns: VecDeque<f64>,
    /// Whether the latest round's visited states were pictured.
    pub(super) pictured: bool,
    /// The latest round and its latest episode.
    pub(super) latest: Option<(i64, i64)>,
}

impl Progress {
    /// Nothing recorded yet. The recording's id is the run's name and something unique, so that recordings can be shown together.
    pub(super) fn start(about: &RecordingAbout<'_>, settings: &RecordingSettings) -> Self {
        let (agents, drawing) = (
            about.agents as usize,
            Drawing::of(about, settings, [0.0, 1.0]),
        );
        Self {
            format: FORMAT,
            messages: 0,
            recording_id: format!("{}-{}", about.name, unique()),
            next_steps: vec![0; agents],
            visited: vec![Visited::new(&drawing.axes, about.largest_bonus.is_some()); agents],
            colour_range: None,
            latest_returns: VecDeque::new(),
            pictured: false,
            latest: None,
        }
    }

    /// Fails where the run is not the one that was interrupted.
    pub(super) fn check(
        &self,
        about: &RecordingAbout<'_>,
        settings: &RecordingSettings,
    ) -> Result<(), Fault> {
        let (drawing, curious) = (
            Drawing::of(about, settings, [0.0, 1.0]),
            about.largest_bonus.is_some(),
        );
        let is_same_team = self.visited.len() == about.agents as usize
            && self.next_steps.len() == about.agents as usize;
        if is_same_team
            && self
                .visited
                .iter()
                .all(|visited| visited.fits(&drawing.axes, &drawing.pairs, curious))
        {
            Ok(())
        } else {
            Err("the checkpoint belongs to another scenario".to_owned())
        }
    }

    /// As [`from_bytes`](Self::from_bytes) reads it.
    pub(super) fn to_bytes(&self) -> Result<Vec<u8>, Fault> {
        postcard::to_stdvec(self).map_err(|error| error.to_string())
    }

    /// From what [`to_bytes`](Self::to_bytes) wrote.
    pub(super) fn from_bytes(bytes: &[u8]) -> Result<Self, Fault> {
        let format = postcard::take_from_bytes::<u32>(bytes).map_or(FORMAT, |(format, _)| format);
        if format != FORMAT {
            return Err("the checkpoint is damaged, or of another version of seedbed".to_owned());
        }
        postcard::from_bytes(bytes).map_err(|error| format!("the checkpoint is damaged: {error}"))
    }
}

/// Eight letters that no other recording has.
fn unique() -> String {
    RecordingId::random()
        .as_str()
        .chars()
        .rev()
        .take(8)
        .collect()
}

/// Opens `part` with only its first `messages` messages. Where there is no such file, `done` is taken instead.
pub(super) fn reopened(
    part: &Path,
    done: &Path,
    messages: u64,
    store: StoreId,
) -> Result<Sink, Fault> {
    let source = if part.exists() { part } else { done };
    let fresh = part.with_extension("resuming");
    let mut sink = Sink::new(
        store,
        Box::new(File::create(&fresh).map_err(|error| error.to_string())?),
    )?;
    copy(source, messages, &mut sink)?;
    sink.sync()?;
    fs::rename(&fresh, part).map_err(|error| error.to_string())?;
    Ok(sink)
}

fn copy(source: &Path, messages: u64, sink: &mut Sink) -> Result<(), Fault> {
    let file = File::open(source).map_err(|error| error.to_string())?;
    for message in DecoderApp::decode_lazy(BufReader::new(file)).take(messages as usize) {
        sink.send(&message.map_err(|error| error.to_string())?)?;
    }
    if sink.messages() < messages {
        return Err(format!(
            "it ends before the checkpoint, after {} of {messages} messages",
            sink.messages()
        ));
    }
    Ok(())
}
