//! The frames of a file of visited states: parts with a checksum each.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::Crc;

use super::header::Header;
use crate::record::ReadError;
use seedbed_input::limits::open_regular;

const MAGIC: [u8; 8] = *b"SBSTATES";
const FORMAT_VERSION: u32 = 1;

/// Number of bytes before the first frame: magic, version and checksum.
pub(super) const FILE_START: usize = 16;

/// Number of bytes before the payload of a frame: kind, size and two checksums.
pub(super) const FRAME_START: usize = 16;

/// The frames of a file, read one by one.
pub(super) struct Frames {
    path: PathBuf,
    file: BufReader<File>,
    /// Position in the file.
    offset: u64,
    /// Size of the file when it was opened. It may grow while it is read.
    size: u64,
    /// Number of bytes of an incomplete frame at the end.
    torn_bytes: u64,
}

/// A frame whose checksums are right.
pub(super) struct Frame {
    /// Position in the file.
    pub offset: u64,
    pub kind: FrameKind,
    pub payload: Vec<u8>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FrameKind {
    /// What the states are; the first frame.
    Header,
    /// Number of steps of the environment before the next episode.
    Begin,
    /// Steps of an episode.
    Episode,
    /// The recorder was closed.
    Closed,
}

impl Frames {
    /// Opens a file and reads its header.
    pub(super) fn open(path: &Path) -> Result<(Self, Header), ReadError> {
        let opened = open_regular(path).and_then(|file| Ok((file.metadata()?.len(), file)));
        let (size, file) = opened.map_err(|error| unreadable(path, error.to_string()))?;
        let mut frames = Self {
            path: path.to_owned(),
            file: BufReader::with_capacity(1 << 16, file),
            offset: 0,
            size,
            torn_bytes: 0,
        };
        frames.read_file_start()?;
        let offset = frames.offset;
        let header = match frames.next_frame()? {
            Some(frame) if frame.kind == FrameKind::Header => Header::from_json(&frame.payload),
            _ => Err("it has no header".to_owned()),
        };
        let header = header.map_err(|reason| frames.damaged(offset, reason))?;
        Ok((frames, header))
    }

    fn read_file_start(&mut self) -> Result<(), ReadError> {
        let is_long_enough = self.size >= FILE_START as u64;
        let start: [u8; FILE_START] = if is_long_enough {
            self.read()?
        } else {
            [0; FILE_START]
        };
        if start[..8] != MAGIC {
            let reason = "it is not a file of visited states".to_owned();
            return Err(unreadable(&self.path, reason));
        }
        if checksum(&start[..12]) != number(&start[12..]) {
            return Err(self.damaged(0, "wrong checksum".to_owned()));
        }
        let version = number(&start[8..12]);
        if version != FORMAT_VERSION {
            let reason = format!(
                "it has version {version} of the format; this version of seedbed reads version {FORMAT_VERSION}"
            );
            return Err(unreadable(&self.path, reason));
        }
        Ok(())
    }

    /// The next frame; `None` at the end of the file, or of its complete frames.
    pub(super) fn next_frame(&mut self) -> Result<Option<Frame>, ReadError> {
        let offset = self.offset;
        let remaining = self.size - offset;
        if remaining < FRAME_START as u64 {
            self.torn_bytes = remaining;
            return Ok(None);
        }
        let start: [u8; FRAME_START] = self.read()?;
        if start == [0; FRAME_START] && self.rest_is_zero()? {
            self.torn_bytes = remaining;
            return Ok(None);
        }
        if checksum(&start[..12]) != number(&start[12..]) {
            return Err(self.damaged(offset, "wrong checksum".to_owned()));
        }
        let payload_size = u64::from(number(&start[4..8]));
        if payload_size > self.size - self.offset {
            self.torn_bytes = remaining;
            return Ok(None);
        }
        let mut payload = vec![0; payload_size as usize];
        self.read_into(&mut payload)?;
        if checksum(&payload) != number(&start[8..12]) {
            return Err(self.damaged(offset, "wrong checksum".to_owned()));
        }
        let kind = match &start[..4] {
            b"HEAD" => FrameKind::Header,
            b"STEP" => FrameKind::Begin,
            b"EPIS" => FrameKind::Episode,
            b"DONE" => FrameKind::Closed,
            _ => return Err(self.damaged(offset, "unknown kind of frame".to_owned())),
        };
        Ok(Some(Frame {
            offset,
            kind,
            payload,
        }))
    }

    /// Whether the file ends with zeros from here, as after a failure of the machine.
    fn rest_is_zero(&mut self) -> Result<bool, ReadError> {
        let mut block = [0; 1 << 12];
        loop {
            let read = self.file.read(&mut block);
            let count = read.map_err(|error| unreadable(&self.path, error.to_string()))?;
            self.offset += count as u64;
            if count == 0 || block[..count].iter().any(|byte| *byte != 0) {
                return Ok(count == 0);
            }
        }
    }

    /// Number of bytes of an incomplete frame at the end, once all others are read.
    pub(super) fn torn_bytes(&self) -> u64 {
        self.torn_bytes
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The error that the frame at `offset` has impossible contents.
    pub(super) fn damaged(&self, offset: u64, reason: String) -> ReadError {
        ReadError::Damaged {
            path: self.path.clone(),
            offset,
            reason,
        }
    }

    fn read<const N: usize>(&mut self) -> Result<[u8; N], ReadError> {
        let mut bytes = [0; N];
        self.read_into(&mut bytes)?;
        Ok(bytes)
    }

    fn read_into(&mut self, bytes: &mut [u8]) -> Result<(), ReadError> {
        let read = self.file.read_exact(bytes);
        read.map_err(|error| unreadable(&self.path, error.to_string()))?;
        self.offset += bytes.len() as u64;
        Ok(())
    }
}

fn unreadable(path: &Path, reason: String) -> ReadError {
    ReadError::Unreadable {
        path: path.to_owned(),
        reason,
    }
}

/// The bytes with which every file begins.
pub(super) fn file_start() -> [u8; FILE_START] {
    let mut start = [0; FILE_START];
    start[..8].copy_from_slice(&MAGIC);
    start[8..12].copy_from_slice(&FORMAT_VERSION.to_le_bytes());
    let sum = checksum(&start[..12]);
    start[12..].copy_from_slice(&sum.to_le_bytes());
    start
}

/// CRC-32 as in zlib.
pub(super) fn checksum(bytes: &[u8]) -> u32 {
    let mut crc = Crc::new();
    crc.update(bytes);
    crc.sum()
}

/// The number in eight bytes.
pub(super) fn long_number(bytes: &[u8]) -> Option<u64> {
    Some(u64::from_le_bytes(bytes.try_into().ok()?))
}

/// The number in the first four bytes.
pub(super) fn number(bytes: &[u8]) -> u32 {
    bytes
        .first_chunk()
        .map_or(0, |bytes| u32::from_le_bytes(*bytes))
}
