//! Recordings that are interrupted, resumed, or cannot be written.

use std::fs::File;

use seedbed::record::rerun::RerunRecorder;
use seedbed::record::{Recorder, RecordingSettings};

use super::contents::RecordingContents;
use super::synthetic_run::SyntheticRun;
use super::{assert_raw_rows, record};

#[test]
fn a_resumed_recording_equals_an_uninterrupted_one() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(4, 30);
    let complete =
        RecordingContents::read(&record(&run, folder.path(), &RecordingSettings::default()));

    let path = folder.path().join("killed.rrd");
    let settings = RecordingSettings::default();
    let mut recorder = RerunRecorder::create(&path, &run.run_info(), &settings).unwrap();
    run.rounds[..13]
        .iter()
        .for_each(|round| round.record(&mut recorder));
    let checkpoint = recorder.checkpoint().unwrap();
    run.rounds[13..21]
        .iter()
        .for_each(|round| round.record(&mut recorder));
    drop(recorder);
    assert!(!path.exists());

    let mut recorder =
        RerunRecorder::resume(&path, &run.run_info(), &settings, &checkpoint).unwrap();
    run.rounds[13..]
        .iter()
        .for_each(|round| round.record(&mut recorder));
    recorder.finish().unwrap();
    let resumed = RecordingContents::read(&path);
    assert_raw_rows(&run, &resumed);
    assert_eq!(complete.columns(), resumed.columns());
}

#[test]
fn a_truncated_recording_is_resumed_from_its_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let (run, settings) = (SyntheticRun::new(2, 8), RecordingSettings::default());
    let path = folder.path().join("run.rrd");
    let mut recorder = RerunRecorder::create(&path, &run.run_info(), &settings).unwrap();
    run.rounds[..4]
        .iter()
        .for_each(|round| round.record(&mut recorder));
    let checkpoint = recorder.checkpoint().unwrap();
    let part = folder.path().join("run.rrd.part");
    let length = std::fs::metadata(&part).unwrap().len();
    run.rounds[4..]
        .iter()
        .for_each(|round| round.record(&mut recorder));
    drop(recorder);
    File::options()
        .write(true)
        .open(&part)
        .unwrap()
        .set_len(length + 100)
        .unwrap();

    for _ in 0..2 {
        let mut recorder =
            RerunRecorder::resume(&path, &run.run_info(), &settings, &checkpoint).unwrap();
        run.rounds[4..]
            .iter()
            .for_each(|round| round.record(&mut recorder));
        recorder.finish().unwrap();
        assert_raw_rows(&run, &RecordingContents::read(&path));
    }

    File::options()
        .write(true)
        .open(&path)
        .unwrap()
        .set_len(length / 2)
        .unwrap();
    let error = RerunRecorder::resume(&path, &run.run_info(), &settings, &checkpoint)
        .map(drop)
        .unwrap_err()
        .to_string();
    assert!(
        error.starts_with("cannot resume ") && error.contains("ends before the checkpoint"),
        "{error}"
    );
    let error = RerunRecorder::resume(&path, &run.run_info(), &settings, b"nonsense")
        .map(drop)
        .unwrap_err()
        .to_string();
    assert!(error.contains("the checkpoint is damaged"), "{error}");
    let error = RerunRecorder::resume(
        &path,
        &SyntheticRun::new(3, 1).run_info(),
        &settings,
        &checkpoint,
    )
    .map(drop)
    .unwrap_err()
    .to_string();
    assert!(
        error.contains("the checkpoint belongs to another scenario"),
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
    run.rounds
        .iter()
        .for_each(|round| round.record(&mut recorder));
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
