//! Errors of writing, resuming or showing a recording.

use rerun::external::re_log_encoding::rrd::{DecodeError, EncodeError};
use rerun::log::ChunkError;
use rerun::sink::SinkFlushError;
use rerun::{RecordingStreamError, SerializationError};

use crate::record::ReadError;

/// Error of writing, resuming or showing a recording. It can be cloned, because a sink returns its
/// first error again on every later call. So errors of libraries are stored as text.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum RecordingError {
    /// The operating system could not read or write a file or a connection.
    #[error("{0}")]
    Io(String),
    /// Rerun could not encode or decode data.
    #[error("{0}")]
    Encoding(String),
    /// Two columns of the raw table have the same name.
    #[error("two columns have the name `{0}`: rename this observation or action of the task")]
    DuplicateColumn(String),
    /// The SDK writes nothing.
    #[error(
        "the environment variable RERUN turns recordings off: unset it, or use `--no-recording`"
    )]
    TurnedOff,
    /// Nothing can be added to a complete recording.
    #[error("the recording is already complete")]
    Complete,
    /// The checkpoint cannot be read.
    #[error("the checkpoint is damaged or was written by another version of seedbed")]
    Checkpoint,
    /// The checkpoint has another number of agents, other axes or other panels.
    #[error("the checkpoint belongs to another scenario")]
    OtherScenario,
    /// The file is shorter than it was at the checkpoint.
    #[error("the file ends before the checkpoint: it has {found} of {expected} messages")]
    EndsEarly {
        /// Messages in the file.
        found: u64,
        /// Messages at the checkpoint.
        expected: u64,
    },
    /// The viewer of `--live` does not receive messages fast enough.
    #[error(
        "the viewer at {address} does not respond and is disconnected; the recording continues without it"
    )]
    ViewerTimeout {
        /// Address of the viewer.
        address: String,
    },
    /// A viewer of a served recording did not receive its end.
    #[error(
        "not every viewer at {address} received the end of the recording; open the file to see all of it"
    )]
    ViewersBehind {
        /// Address of the server.
        address: String,
    },
}

impl From<std::io::Error> for RecordingError {
    fn from(error: std::io::Error) -> Self {
        Self::Io(error.to_string())
    }
}

impl From<EncodeError> for RecordingError {
    fn from(error: EncodeError) -> Self {
        match error {
            EncodeError::Write(error) => error.into(),
            other => Self::Encoding(other.to_string()),
        }
    }
}

impl From<ReadError> for RecordingError {
    fn from(error: ReadError) -> Self {
        Self::Encoding(error.to_string())
    }
}

impl From<DecodeError> for RecordingError {
    fn from(error: DecodeError) -> Self {
        Self::Encoding(error.to_string())
    }
}

impl From<ChunkError> for RecordingError {
    fn from(error: ChunkError) -> Self {
        Self::Encoding(error.to_string())
    }
}

impl From<SerializationError> for RecordingError {
    fn from(error: SerializationError) -> Self {
        Self::Encoding(error.to_string())
    }
}

impl From<RecordingStreamError> for RecordingError {
    fn from(error: RecordingStreamError) -> Self {
        Self::Encoding(error.to_string())
    }
}

impl From<SinkFlushError> for RecordingError {
    fn from(error: SinkFlushError) -> Self {
        Self::Encoding(error.to_string())
    }
}
