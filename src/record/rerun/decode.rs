//! Decodes the messages of a recording, which may be damaged.
//!
//! The decoders of Rerun and Arrow allocate as many bytes as the file says, and panic at some invalid
//! contents. Here all sizes are compared with the bytes that are there before a decoder sees them,
//! and a panic becomes an error.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom, Take};
use std::path::{Path, PathBuf};

use re_protos::common::v1alpha1::Compression;
use re_protos::external::prost::bytes::Bytes;
use re_protos::log_msg::v1alpha1::{ArrowMsg, log_msg::Msg};
use rerun::external::arrow;
use rerun::external::re_chunk_store::external::re_chunk;
use rerun::external::re_log_encoding::external::lz4_flex;
use rerun::external::re_log_encoding::{
    ApplicationIdInjector, CodecError, CrateVersion, Decodable, DecodeError, Decoder,
    DecoderEntrypoint, DecoderIterator, MessageHeader, MessageKind, StreamFooter, StreamHeader,
    ToApplication,
};
use rerun::external::re_log_types;
use rerun::log::{Chunk, LogMsg};

use crate::record::ReadError;
use seedbed_env::caught_panic;
use seedbed_input::limits::open_regular;

/// A block that LZ4 compresses to n bytes has at most 255 n bytes.
const MAX_LZ4_RATIO: u64 = 255;

/// The messages of a recording, decoded on demand. Nothing follows an error.
pub(super) struct Messages {
    path: PathBuf,
    decoder: DecoderIterator<CheckedMessage, BufReader<Take<File>>>,
    /// The error at the end of the complete messages.
    error_at_end: Option<ReadError>,
    failed: bool,
    /// Where the last complete message ends.
    end: u64,
}

impl Messages {
    /// Opens a recording. The file of an unfinished run (`.part`) may end within a message, which is
    /// ignored.
    pub(super) fn open(path: &Path) -> Result<Self, ReadError> {
        let is_unfinished = path
            .extension()
            .is_some_and(|extension| extension == "part");
        Self::open_as(path, is_unfinished)
    }

    /// Opens a recording that may end within a message, which is ignored.
    pub(super) fn open_unfinished(path: &Path) -> Result<Self, ReadError> {
        Self::open_as(path, true)
    }

    fn open_as(path: &Path, is_unfinished: bool) -> Result<Self, ReadError> {
        let unreadable = |error: io::Error| ReadError::Unreadable {
            path: path.to_owned(),
            reason: error.to_string(),
        };
        let mut file = open_regular(path).map_err(unreadable)?;
        let frames = Frames::of(&mut file).map_err(unreadable)?;
        let reason = match frames.problem {
            Some(Problem::Incomplete) if !is_unfinished => Some("the file ends within a message"),
            Some(Problem::Unknown) => Some("no message begins here"),
            _ => None,
        };
        let whole = BufReader::new(file.take(frames.end));
        Ok(Self {
            path: path.to_owned(),
            decoder: Decoder::decode_lazy(whole),
            error_at_end: reason.map(|reason| ReadError::Damaged {
                path: path.to_owned(),
                offset: frames.end,
                reason: reason.to_owned(),
            }),
            failed: false,
            end: frames.end,
        })
    }

    /// Number of messages before the first damage or the end, and number of bytes up to there.
    pub(super) fn whole_length(mut self) -> (usize, u64) {
        let (mut messages, mut length) = (0, 0);
        while let Some(Ok(message)) = self.next() {
            let is_whole = match &message {
                LogMsg::ArrowMsg(_, rows) => self.chunk(rows).is_ok(),
                _ => true,
            };
            if !is_whole {
                break;
            }
            messages += 1;
            length = self.decoder.num_bytes_processed();
        }
        if !self.failed {
            length = self.end;
        }
        (messages, length)
    }

    /// Decodes the rows of a message.
    pub(super) fn chunk(&mut self, message: &re_log_types::ArrowMsg) -> Result<Chunk, ReadError> {
        let chunk = caught_panic(|| Chunk::from_arrow_msg(message).map_err(|e| e.to_string()));
        chunk.flatten().map_err(|reason| self.damaged(reason))
    }

    /// The error of the decoder. Before the first message, the file may be no recording at all.
    fn decode_error(&mut self, error: &DecodeError) -> ReadError {
        let reason = decode_error_text(error);
        if self.decoder.num_bytes_processed() > StreamHeader::ENCODED_SIZE_BYTES as u64 {
            return self.damaged(reason);
        }
        self.failed = true;
        ReadError::Unreadable {
            path: self.path.clone(),
            reason,
        }
    }

    /// The error that something is wrong in the latest message.
    pub(super) fn damaged(&mut self, reason: impl Into<String>) -> ReadError {
        self.failed = true;
        ReadError::Damaged {
            path: self.path.clone(),
            offset: self.decoder.num_bytes_processed(),
            reason: reason.into(),
        }
    }
}

impl Iterator for Messages {
    type Item = Result<LogMsg, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.failed {
            return None;
        }
        let decoder = std::panic::AssertUnwindSafe(&mut self.decoder);
        let message = caught_panic(move || { decoder }.0.next());
        match message {
            Ok(Some(Ok(CheckedMessage(message)))) => Some(Ok(message)),
            Ok(Some(Err(error))) => Some(Err(self.decode_error(&error))),
            Err(reason) => Some(Err(self.damaged(reason))),
            Ok(None) => self.error_at_end.take().map(Err),
        }
    }
}

/// The decoder's message, without its prefix.
fn decode_error_text(error: &DecodeError) -> String {
    match error {
        DecodeError::Codec(error) => error.to_string(),
        DecodeError::Read(error) => error.to_string(),
    }
}

/// The extent of the complete messages of a file.
struct Frames {
    /// Where the last complete message ends.
    end: u64,
    /// What is wrong there; `None` at the end of the file.
    problem: Option<Problem>,
}

/// Why no complete message begins at some place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Problem {
    /// The file ends before the message does.
    Incomplete,
    /// No message of a recording begins like this.
    Unknown,
}

impl Frames {
    /// Goes from header to header. A header is followed by as many bytes as it says, or the file ends
    /// there for the decoder.
    fn of(file: &mut File) -> io::Result<Self> {
        let length = file.metadata()?.len();
        let mut headers = BufReader::with_capacity(256, file);
        let mut end = 0;
        let mut problem = None;
        while end < length && problem.is_none() {
            headers.seek(SeekFrom::Start(end))?;
            match next_frame_size(&mut headers)? {
                Some(size) if size <= length - end => end += size,
                Some(_) => problem = Some(Problem::Incomplete),
                None if length - end < MessageHeader::ENCODED_SIZE_BYTES as u64 => {
                    problem = Some(Problem::Incomplete);
                }
                None => problem = Some(Problem::Unknown),
            }
        }
        headers.rewind()?;
        if end == 0 {
            // The decoder says best what kind of file this is.
            (end, problem) = (length, None);
        }
        Ok(Self { end, problem })
    }
}

/// Size in bytes of the stream header, message with its header, or stream footer that is next in the
/// file; `None` if it is none of these.
fn next_frame_size(file: &mut impl Read) -> io::Result<Option<u64>> {
    let mut bytes = Vec::new();
    let most = StreamFooter::ENCODED_SIZE_BYTES.max(MessageHeader::ENCODED_SIZE_BYTES);
    file.take(most as u64).read_to_end(&mut bytes)?;
    let header = bytes.first_chunk::<{ MessageHeader::ENCODED_SIZE_BYTES }>();
    let size = if let Some(Ok(header)) = header.map(|bytes| MessageHeader::from_rrd_bytes(bytes)) {
        header
            .len
            .saturating_add(MessageHeader::ENCODED_SIZE_BYTES as u64)
    } else if is_frame::<StreamHeader>(&bytes, StreamHeader::ENCODED_SIZE_BYTES) {
        StreamHeader::ENCODED_SIZE_BYTES as u64
    } else if is_frame::<StreamFooter>(&bytes, StreamFooter::ENCODED_SIZE_BYTES) {
        StreamFooter::ENCODED_SIZE_BYTES as u64
    } else {
        return Ok(None);
    };
    Ok(Some(size))
}

fn is_frame<T: Decodable>(bytes: &[u8], size: usize) -> bool {
    let frame = bytes.get(..size);
    frame.is_some_and(|bytes| T::from_rrd_bytes(bytes).is_ok())
}

/// A message whose sizes were checked before it was decoded.
struct CheckedMessage(LogMsg);

impl DecoderEntrypoint for CheckedMessage {
    fn decode(
        bytes: Bytes,
        span: re_chunk::Span<u64>,
        kind: MessageKind,
        application_ids: &mut impl ApplicationIdInjector,
        version: Option<CrateVersion>,
    ) -> Result<Option<Self>, CodecError> {
        let message = Msg::decode(bytes, span, kind, application_ids, version)?;
        let Some(mut message) = message else {
            return Ok(None);
        };
        if let Msg::ArrowMsg(rows) = &mut message {
            decompress(rows)?;
            check_sizes(&rows.payload)?;
        }
        let message = message.to_application((application_ids, version))?;
        Ok(Some(Self(message)))
    }
}

/// Replaces the compressed rows of a message.
fn decompress(rows: &mut ArrowMsg) -> Result<(), CodecError> {
    if rows.compression() != Compression::Lz4 {
        return Ok(());
    }
    let most = MAX_LZ4_RATIO * rows.payload.len() as u64;
    if rows.uncompressed_size > most {
        return Err(invalid("the decompressed size is impossible"));
    }
    let size = rows.uncompressed_size as usize;
    let bytes = lz4_flex::block::decompress(&rows.payload, size)?;
    rows.uncompressed_size = bytes.len() as u64;
    rows.payload = Bytes::from(bytes);
    rows.set_compression(Compression::None);
    Ok(())
}

/// Checks that metadata and body of each message of a stream in Arrow's format are inside of `bytes`.
fn check_sizes(mut bytes: &[u8]) -> Result<(), CodecError> {
    const CONTINUATION: [u8; 4] = [0xff; 4];
    let cut = || invalid("a table is longer than its message");
    while let Some(rest) = bytes.strip_prefix(&CONTINUATION) {
        let (size, rest) = rest.split_first_chunk().ok_or_else(cut)?;
        let size = u32::from_le_bytes(*size) as usize;
        if size == 0 {
            return Ok(());
        }
        let (metadata, rest) = rest.split_at_checked(size).ok_or_else(cut)?;
        let metadata = arrow::ipc::root_as_message(metadata);
        let metadata = metadata.map_err(|error| invalid(&error.to_string()))?;
        let body = usize::try_from(metadata.bodyLength()).unwrap_or(usize::MAX);
        bytes = rest.get(body..).ok_or_else(cut)?;
    }
    if bytes.is_empty() {
        Ok(())
    } else {
        Err(invalid("a table does not begin where it should"))
    }
}

fn invalid(reason: &str) -> CodecError {
    CodecError::FrameDecoding(reason.to_owned())
}
