//! What is whole in a damaged file of visited states: its episodes all of whose frames have the right
//! checksums.

use std::io;
use std::path::Path;

use super::episodes::EPISODE_START;
use super::frames::{FILE_START, FRAME_START, checksum, file_start, number};
use super::header::Header;
use seedbed_input::limits::{MAX_LARGE_FILE_BYTES, read_bytes};

/// What was taken out of a file of visited states.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SalvagedStates {
    /// The bytes of a file with the whole episodes, which are numbered from 0.
    pub bytes: Vec<u8>,
    /// Numbers of the whole episodes in the damaged file.
    pub episodes: Vec<u32>,
    /// Number of bytes that are in no whole frame.
    pub lost_bytes: usize,
}

/// A frame whose checksums are right.
struct WholeFrame<'a> {
    kind: &'a [u8],
    payload: &'a [u8],
}

/// Takes the whole episodes out of a file; `None` if its header is lost, without which numbers have no
/// meaning.
///
/// # Errors
/// The file cannot be read.
pub fn salvage(path: &Path) -> io::Result<Option<SalvagedStates>> {
    let bytes = read_bytes(path, MAX_LARGE_FILE_BYTES)?;
    let (frames, lost_bytes) = whole_frames(&bytes);
    let mut headers = frames.iter().filter(|frame| frame.kind == b"HEAD");
    let Some(header) = headers.find(|frame| Header::from_json(frame.payload).is_ok()) else {
        return Ok(None);
    };
    let mut salvaged = SalvagedStates {
        bytes: file_start().to_vec(),
        episodes: Vec::new(),
        lost_bytes,
    };
    salvaged.add_frame(*b"HEAD", header.payload);
    let mut unfinished: Vec<&[u8]> = Vec::new();
    for frame in &frames {
        if frame.kind == b"STEP" {
            salvaged.add_frame(*b"STEP", frame.payload);
        }
        if frame.kind != b"EPIS" {
            continue;
        }
        if frame.payload.len() < EPISODE_START || !continues(&mut unfinished, frame.payload) {
            unfinished.clear();
            continue;
        }
        unfinished.push(frame.payload);
        let is_end = number(&frame.payload[12..]) != 0;
        if is_end {
            salvaged.add_episode(&unfinished);
            unfinished.clear();
        }
    }
    Ok(Some(salvaged))
}

/// Whether a frame begins an episode, which replaces one that is not finished, or continues it.
fn continues(unfinished: &mut Vec<&[u8]>, payload: &[u8]) -> bool {
    let [episode, first_step] = [number(payload), number(&payload[4..])];
    if first_step == 0 {
        unfinished.clear();
        return true;
    }
    let steps: u64 = unfinished
        .iter()
        .map(|payload| u64::from(number(&payload[8..])))
        .sum();
    let same_episode = unfinished
        .first()
        .is_some_and(|first| number(first) == episode);
    same_episode && steps == u64::from(first_step)
}

/// The frames with right checksums, wherever they begin, and the number of bytes between them.
fn whole_frames(bytes: &[u8]) -> (Vec<WholeFrame<'_>>, usize) {
    let mut frames = Vec::new();
    let has_start = bytes.starts_with(&file_start());
    let (mut offset, mut lost_bytes) = if has_start { (FILE_START, 0) } else { (0, 0) };
    while offset < bytes.len() {
        if let Some(frame) = frame_at(&bytes[offset..]) {
            offset += FRAME_START + frame.payload.len();
            frames.push(frame);
        } else {
            offset += 1;
            lost_bytes += 1;
        }
    }
    (frames, lost_bytes)
}

/// The frame at the beginning of bytes, if there is a whole one.
fn frame_at(bytes: &[u8]) -> Option<WholeFrame<'_>> {
    let (start, rest) = bytes.split_first_chunk::<FRAME_START>()?;
    let kind = &bytes[..4];
    if ![b"HEAD", b"STEP", b"EPIS", b"DONE"]
        .iter()
        .any(|known| kind == *known)
        || checksum(&start[..12]) != number(&start[12..])
    {
        return None;
    }
    let payload = rest.get(..number(&start[4..8]) as usize)?;
    (checksum(payload) == number(&start[8..12])).then_some(WholeFrame { kind, payload })
}

impl SalvagedStates {
    fn add_episode(&mut self, frames: &[&[u8]]) {
        let new_number = self.episodes.len() as u32;
        self.episodes
            .extend(frames.first().map(|first| number(first)));
        for frame in frames {
            let payload = [&new_number.to_le_bytes(), &frame[4..]].concat();
            self.add_frame(*b"EPIS", &payload);
        }
    }

    fn add_frame(&mut self, kind: [u8; 4], payload: &[u8]) {
        let size = (payload.len() as u32).to_le_bytes();
        let start = [&kind[..], &size, &checksum(payload).to_le_bytes()].concat();
        self.bytes.extend(&start);
        self.bytes.extend(checksum(&start).to_le_bytes());
        self.bytes.extend(payload);
    }

    /// Number of episodes that are lost for certain: those between the first and the last whole one.
    #[must_use]
    pub fn lost_episodes(&self) -> u32 {
        let last = self.episodes.last().map_or(0, |last| last + 1);
        last.saturating_sub(self.episodes.len() as u32)
    }
}
