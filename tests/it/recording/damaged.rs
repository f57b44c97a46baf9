//! Reading damaged recordings: errors with a place, and never a panic.

use std::fs;
use std::path::Path;

use seedbed::record::recording::Recording;
use seedbed::record::{ReadError, RecordedEpisode};
use seedbed::scenario::recording::RecordingSettings;

use super::record;
use super::synthetic_run::SyntheticRun;

/// Size in bytes of the header of the file.
const FILE_HEADER: usize = 12;

/// Size in bytes of a message's header: its kind and its length, eight bytes each.
const MESSAGE_HEADER: usize = 16;

fn recording_bytes(folder: &Path) -> Vec<u8> {
    let run = SyntheticRun::new(2, 3);
    fs::read(record(&run, folder, &RecordingSettings::default())).unwrap()
}

/// All episodes that are read from a file with these bytes.
fn read(path: &Path, bytes: &[u8]) -> Result<Vec<RecordedEpisode>, ReadError> {
    fs::write(path, bytes).unwrap();
    Recording::open(path)?.episodes()?.collect()
}

/// Where the messages begin, by the lengths in their headers. The last one has the table of contents.
fn message_starts(bytes: &[u8]) -> Vec<usize> {
    let number = |at: usize| {
        let bytes = bytes.get(at..at + 8)?;
        Some(u64::from_le_bytes(bytes.try_into().unwrap()) as usize)
    };
    let mut starts = Vec::new();
    let mut start = FILE_HEADER;
    while let (Some(0..=4), Some(length)) = (number(start), number(start + 8)) {
        starts.push(start);
        start += MESSAGE_HEADER + length;
    }
    starts
}

#[test]
fn an_impossible_length_is_an_error_at_its_message() {
    let folder = tempfile::tempdir().unwrap();
    let intact = recording_bytes(folder.path());
    let path = folder.path().join("run.rrd");
    for start in message_starts(&intact).into_iter().skip(1).step_by(3) {
        let mut bytes = intact.clone();
        bytes[start + 14] = 8;
        let error = read(&path, &bytes).unwrap_err().to_string();
        let place = format!("is damaged at offset {start}: the file ends within a message");
        assert!(error.ends_with(&place), "{start}: {error}");
        bytes[start + 14] = 0;
        bytes[start] = 99;
        let error = read(&path, &bytes).unwrap_err().to_string();
        let place = format!("is damaged at offset {start}: no message begins here");
        assert!(error.ends_with(&place), "{start}: {error}");
    }
}

/// The recording of a run that was killed may end anywhere; a complete recording may not.
#[test]
fn only_an_unfinished_recording_may_end_within_a_message() {
    let folder = tempfile::tempdir().unwrap();
    let intact = recording_bytes(folder.path());
    let [done, part] = ["run.rrd", "run.rrd.part"].map(|name| folder.path().join(name));
    let episodes = read(&done, &intact).unwrap();
    assert!(!episodes.is_empty());
    let end = *message_starts(&intact).last().unwrap();
    let cut = &intact[..=end + MESSAGE_HEADER];
    assert_eq!(read(&part, cut).unwrap(), episodes);
    assert!(
        matches!(read(&done, cut), Err(ReadError::Damaged { offset, .. }) if offset == end as u64)
    );
}

/// Flips bits all over the file. Whatever is read, nothing panics, and no episode gets longer or
/// shorter without an error. (Numbers of states have no checksum in this format.)
#[test]
fn flipped_bits_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let intact = recording_bytes(folder.path());
    let path = folder.path().join("run.rrd");
    let mut errors = 0;
    for byte in (0..intact.len()).step_by(intact.len() / 300) {
        let mut bytes = intact.clone();
        bytes[byte] ^= 1 << (byte % 8);
        if let Err(error) = read(&path, &bytes) {
            errors += 1;
            assert!(error.to_string().contains("run.rrd"), "{byte}: {error}");
        }
    }
    assert!(errors > 20, "{errors}");
}
