//! Recordings that are interrupted, resumed, or cannot be written.

use std::path::Path;

use seedbed::record::rerun::RerunRecorder;
use seedbed::run::recorder::Recorder;
use seedbed::scenario::recording::RecordingSettings;

use super::contents::RecordingContents;
use super::synthetic_run::SyntheticRun;
use super::{assert_raw_rows, record, record_rounds, set_file_length};

#[test]
fn a_resumed_recording_equals_an_uninterrupted_one() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(4, 30);
    let complete =
        RecordingContents::read(&record(&run, folder.path(), &RecordingSettings::default()));

    let path = folder.path().join("killed.rrd");
    let settings = RecordingSettings::default();
    let mut recorder = RerunRecorder::create(&path, &run.run_info(), &settings).unwrap();
    record_rounds(&run.rounds[..13], &mut recorder);
    let checkpoint = recorder.checkpoint().unwrap();
    record_rounds(&run.rounds[13..21], &mut recorder);
    drop(recorder);
    assert!(!path.exists());

    let mut recorder =
        RerunRecorder::resume(&path, &run.run_info(), &settings, &checkpoint).unwrap();
    record_rounds(&run.rounds[13..], &mut recorder);
    recorder.finish().unwrap();
    let resumed = RecordingContents::read(&path);
    assert_raw_rows(&run, &resumed);
    assert_eq!(complete.columns(), resumed.columns());
}

/// A checkpoint contains the rows that wait for a full chunk, instead of writing small chunks.
#[test]
fn checkpoints_do_not_change_the_chunks_of_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let (run, settings) = (SyntheticRun::new(2, 40), RecordingSettings::default());
    let rows_per_chunk = |contents: &RecordingContents, entity: &str| -> Vec<usize> {
        let chunks = contents.chunks(entity).iter();
        chunks.map(rerun::log::Chunk::num_rows).collect()
    };
    let without = RecordingContents::read(&record(&run, folder.path(), &settings));
    let path = folder.path().join("often.rrd");
    let mut recorder = RerunRecorder::create(&path, &run.run_info(), &settings).unwrap();
    for rounds in run.rounds.chunks(3) {
        record_rounds(rounds, &mut recorder);
        recorder.checkpoint().unwrap();
    }
    recorder.finish().unwrap();
    let with = RecordingContents::read(&path);
    assert_eq!(without.columns(), with.columns());
    for entity in [
        "/raw/agent_0",
        "/visitation/agent_1/lines",
        "/curves/coverage",
    ] {
        assert_eq!(
            rows_per_chunk(&without, entity),
            rows_per_chunk(&with, entity)
        );
    }
}

/// Records all rounds of a run, with a checkpoint after four rounds. Returns the recorder, the
/// checkpoint, and the length of the file at the checkpoint.
fn record_past_checkpoint(
    run: &SyntheticRun,
    settings: &RecordingSettings,
    path: &Path,
) -> (RerunRecorder, Vec<u8>, u64) {
    let mut recorder = RerunRecorder::create(path, &run.run_info(), settings).unwrap();
    record_rounds(&run.rounds[..4], &mut recorder);
    let checkpoint = recorder.checkpoint().unwrap();
    let part = path.with_extension("rrd.part");
    let length_at_checkpoint = std::fs::metadata(part).unwrap().len();
    record_rounds(&run.rounds[4..], &mut recorder);
    (recorder, checkpoint, length_at_checkpoint)
}

/// A recorder writes a checkpoint, records more rounds, and is dropped. Then its file is cut 100
/// bytes after the checkpoint. It can be resumed twice.
#[test]
fn a_truncated_recording_is_resumed_from_its_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let (run, settings) = (SyntheticRun::new(2, 8), RecordingSettings::default());
    let path = folder.path().join("run.rrd");
    let (recorder, checkpoint, length_at_checkpoint) =
        record_past_checkpoint(&run, &settings, &path);
    drop(recorder);
    let part = folder.path().join("run.rrd.part");
    set_file_length(&part, length_at_checkpoint + 100);

    for _ in 0..2 {
        let mut recorder =
            RerunRecorder::resume(&path, &run.run_info(), &settings, &checkpoint).unwrap();
        record_rounds(&run.rounds[4..], &mut recorder);
        recorder.finish().unwrap();
        assert_raw_rows(&run, &RecordingContents::read(&path));
    }
}

#[test]
fn resume_explains_invalid_checkpoints_and_recordings() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(2, 8);
    let path = folder.path().join("run.rrd");
    let settings = RecordingSettings::default();
    let (mut recorder, checkpoint, length_at_checkpoint) =
        record_past_checkpoint(&run, &settings, &path);
    recorder.finish().unwrap();
    let resume_error = |run: &SyntheticRun, checkpoint: &[u8]| {
        RerunRecorder::resume(&path, &run.run_info(), &settings, checkpoint)
            .map(drop)
            .unwrap_err()
            .to_string()
    };
    let error = resume_error(&run, b"nonsense");
    assert!(error.contains("the checkpoint is damaged"), "{error}");
    let error = resume_error(&SyntheticRun::new(3, 1), &checkpoint);
    assert!(
        error.contains("the checkpoint belongs to another scenario"),
        "{error}"
    );
    set_file_length(&path, length_at_checkpoint / 2);
    let error = resume_error(&run, &checkpoint);
    let expected = format!("shorter than the {length_at_checkpoint} bytes of its checkpoint");
    assert!(
        error.starts_with("cannot resume ") && error.ends_with(&expected),
        "{error}"
    );
}

#[test]
fn a_dropped_recorder_leaves_a_readable_recording() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(2, 5);
    let path = folder.path().join("run.rrd");
    let mut recorder =
        RerunRecorder::create(&path, &run.run_info(), &RecordingSettings::default()).unwrap();
    record_rounds(&run.rounds, &mut recorder);
    drop(recorder);
    assert_raw_rows(
        &run,
        &RecordingContents::read(&folder.path().join("run.rrd.part")),
    );
}

#[test]
fn creating_a_recording_in_a_missing_folder_fails() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("nowhere/run.rrd");
    let error = RerunRecorder::create(
        &path,
        &SyntheticRun::new(1, 1).run_info(),
        &RecordingSettings::default(),
    )
    .map(drop)
    .unwrap_err();
    let error = error.to_string();
    assert!(
        error.starts_with("cannot write ") && error.contains("nowhere/run.rrd.part: No such file"),
        "{error}"
    );
}

#[test]
#[cfg(target_os = "linux")]
fn creating_a_recording_on_a_full_disk_fails() {
    let folder = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink("/dev/full", folder.path().join("run.rrd.part")).unwrap();
    let path = folder.path().join("run.rrd");
    let error = RerunRecorder::create(
        &path,
        &SyntheticRun::new(1, 1).run_info(),
        &RecordingSettings::default(),
    )
    .map(drop)
    .unwrap_err();
    assert!(
        error.to_string().contains("No space left on device"),
        "{error}"
    );
}
