//! Resumes a recording that was interrupted.
//!
//! A checkpoint stores the number of messages in the file, and the rows that are not in the file
//! yet. To resume, this number of messages is copied to a new file, which replaces the old file, and
//! these rows are added. Rounds after the checkpoint are not copied, because they are run and
//! recorded again.

use std::collections::VecDeque;
use std::fs::{self, File};
use std::path::Path;

use rerun::StoreId;
use rerun::external::re_log_types::RecordingId;
use serde::{Deserialize, Serialize};

use super::APPLICATION;
use super::decode::Messages;
use super::error::RecordingError;
use super::sink::Sink;
use crate::run::ranks::Ranks;
use crate::run::recorder::RunInfo;
use crate::storage::written::Written;

/// Version of the order and types of the fields of [`State`].
const FORMAT: u32 = 5;

/// What a recorder needs to resume, in addition to its file.
#[derive(Serialize, Deserialize)]
pub(super) struct State {
    /// Equals [`FORMAT`]; a checkpoint with another number is refused.
    format: u32,
    /// Number of messages in the file at the checkpoint.
    pub(super) messages: u64,
    /// What the file began with at the checkpoint.
    pub(super) written: Written,
    /// The rows that are not in the file yet: [`MessageBytes`](super::sink::MessageBytes).
    pub(super) unwritten: Vec<u8>,
    /// Unique id of the recording.
    pub(super) recording_id: String,
    /// The next step of each agent on the timeline of its steps.
    pub(super) next_steps: Vec<i64>,
    /// The visited states of each agent, [`AgentVisits`](crate::record::visitation::AgentVisits); only in a checkpoint. `[K]`
    pub(super) visits: Vec<Vec<u8>>,
    /// The ends of the color scale of states; `None` before the first round.
    pub(super) color_range: Option<[f32; 2]>,
    /// The team's mean returns of the latest rounds.
    pub(super) latest_returns: VecDeque<f64>,
    /// Number of the team's states since rows of all entities were written.
    pub(super) states_since_write: u64,
    /// Number of the team's states since the latest images.
    pub(super) states_since_images: u64,
    /// Whether there are images of the latest round.
    pub(super) has_latest_images: bool,
    /// The latest round and its latest episode.
    pub(super) latest: Option<(i64, i64)>,
}

impl State {
    /// The state of a recording without rounds. Its id is the run's name and a random suffix, so
    /// that several recordings can be shown together.
    pub(super) fn start(info: &RunInfo<'_>) -> Self {
        let agents = info.agents as usize;
        Self {
            format: FORMAT,
            messages: 0,
            written: Written::default(),
            unwritten: Vec::new(),
            recording_id: info
                .ranks
                .broadcast(format!("{}-{}", info.name, random_suffix())),
            next_steps: vec![0; agents],
            visits: Vec::new(),
            color_range: None,
            latest_returns: VecDeque::new(),
            states_since_write: 0,
            states_since_images: 0,
            has_latest_images: false,
            latest: None,
        }
    }

    /// Id of the recording in Rerun.
    pub(super) fn store_id(&self) -> StoreId {
        StoreId::recording(APPLICATION, self.recording_id.as_str())
    }

    /// Returns an error if this checkpoint has another number of agents than the run.
    pub(super) fn check_team(&self, info: &RunInfo<'_>) -> Result<(), RecordingError> {
        let agents = info.agents as usize;
        if self.visits.len() == agents && self.next_steps.len() == agents {
            Ok(())
        } else {
            Err(RecordingError::OtherScenario)
        }
    }

    /// Encodes the state for [`from_bytes`](Self::from_bytes).
    pub(super) fn to_bytes(&self) -> Result<Vec<u8>, RecordingError> {
        postcard::to_stdvec(self).map_err(|error| RecordingError::Encoding(error.to_string()))
    }

    /// Decodes the bytes of [`to_bytes`](Self::to_bytes).
    pub(super) fn from_bytes(bytes: &[u8]) -> Result<Self, RecordingError> {
        // The format is the first field, so that it can be read before all other fields.
        match postcard::take_from_bytes::<u32>(bytes) {
            Ok((FORMAT, _)) => postcard::from_bytes(bytes).map_err(|_| RecordingError::Checkpoint),
            _ => Err(RecordingError::Checkpoint),
        }
    }
}

/// Eight random characters.
fn random_suffix() -> String {
    RecordingId::random()
        .as_str()
        .chars()
        .rev()
        .take(8)
        .collect()
}

/// Opens `part` with the messages that it had at the checkpoint, and writes the rows of the
/// checkpoint to it. If `part` does not exist, the messages are copied from `done`.
pub(super) fn reopen(
    part: &Path,
    done: &Path,
    ranks: Ranks,
    state: &mut State,
) -> Result<Sink, RecordingError> {
    let source = if part.exists() { part } else { done };
    state.written.check(source)?;
    let new_part = part.with_extension("resuming");
    let copied = copy(source, &new_part, ranks, state);
    if copied.is_err() {
        // Only the first failure is reported.
        drop(fs::remove_file(&new_part));
    }
    let sink = copied?;
    fs::rename(&new_part, part)?;
    Ok(sink)
}

fn copy(
    source: &Path,
    new_part: &Path,
    ranks: Ranks,
    state: &mut State,
) -> Result<Sink, RecordingError> {
    let (store, agents) = (state.store_id(), state.next_steps.len() as u32);
    let mut sink = Sink::new(store, agents, Box::new(File::create(new_part)?))?;
    if !ranks.is_single() {
        sink = sink.without_index();
    }
    copy_messages(source, state.messages, &mut sink)?;
    // The checkpoint must also describe the new file, in case the run is stopped before the next one.
    if sink.written() != state.written {
        return Err(RecordingError::OtherBytes);
    }
    sink.send_encoded(&std::mem::take(&mut state.unwritten))?;
    state.states_since_write = 0;
    sink.sync()?;
    Ok(sink)
}

fn copy_messages(source: &Path, messages: u64, sink: &mut Sink) -> Result<(), RecordingError> {
    for message in Messages::open_unfinished(source)?.take(messages as usize) {
        sink.send(&message?)?;
    }
    if sink.message_count() < messages {
        return Err(RecordingError::EndsEarly {
            found: sink.message_count(),
            expected: messages,
        });
    }
    Ok(())
}
