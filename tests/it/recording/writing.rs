//! Recordings that are broken off, gone on with, or cannot be written.

use std::fs::File;

use seedbed::record::rerun::RerunRecorder;
use seedbed::record::{Recorder, RecordingSettings};

use super::contents::Contents;
use super::synthetic_run::Run;
use super::{compare_raw, record};

#[test]
fn a_killed_and_resumed_run_equals_an_uninterrupted_one() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(4, 30);
    let whole = Contents::of(&record(&run, folder.path(), &RecordingSettings::default()));

    let path = folder.path().join("killed.rrd");
    let settings = RecordingSettings::default();
    let mut recorder = RerunRecorder::create(&path, &run.about(), &settings).unwrap();
    run.rounds[..13]
        .iter()
        .for_each(|round| round.record(&mut recorder));
    let checkpoint = recorder.checkpoint().unwrap();
    run.rounds[13..21]
        .iter()
        .for_each(|round| round.record(&mut recorder));
    drop(recorder);
    assert!(!path.exists());

    let mut recorder = RerunRecorder::resume(&path, &run.about(), &settings, &checkpoint).unwrap();
    run.rounds[13..]
        .iter()
        .for_each(|round| round.record(&mut recorder));
    recorder.finish().unwrap();
    let resumed = Contents::of(&path);
    compare_raw(&run, &resumed);
    assert_eq!(whole.columns(), resumed.columns());
}

#[test]
fn a_torn_file_is_resumed_from_its_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let (run, settings) = (Run::new(2, 8), RecordingSettings::default());
    let path = folder.path().join("run.rrd");
    let mut recorder = RerunRecorder::create(&path, &run.about(), &settings).unwrap();
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
            RerunRecorder::resume(&path, &run.about(), &settings, &checkpoint).unwrap();
        run.rounds[4..]
            .iter()
            .for_each(|round| round.record(&mut recorder));
        recorder.finish().unwrap();
        compare_raw(&run, &Contents::of(&path));
    }

    File::options()
        .write(true)
        .open(&path)
        .unwrap()
        .set_len(length / 2)
        .unwrap();
    let error = RerunRecorder::resume(&path, &run.about(), &settings, &checkpoint)
        .map(drop)
        .unwrap_err()
        .to_string();
    assert!(
        error.starts_with("cannot resume ") && error.contains("ends before the checkpoint"),
        "{error}"
    );
    let error = RerunRecorder::resume(&path, &run.about(), &settings, b"nonsense")
        .map(drop)
        .unwrap_err()
        .to_string();
    assert!(error.contains("the checkpoint is damaged"), "{error}");
    let error = RerunRecorder::resume(&path, &Run::new(3, 1).about(), &settings, &checkpoint)
        .map(drop)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("the checkpoint belongs to another scenario"),
        "{error}"
    );
}

#[test]
fn a_recording_that_is_dropped_early_stays_readable() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(2, 5);
    let path = folder.path().join("run.rrd");
    let mut recorder =
        RerunRecorder::create(&path, &run.about(), &RecordingSettings::default()).unwrap();
    run.rounds
        .iter()
        .for_each(|round| round.record(&mut recorder));
    drop(recorder);
    compare_raw(&run, &Contents::of(&folder.path().join("run.rrd.part")));
}

#[test]
fn a_missing_folder_is_an_error_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("nowhere/run.rrd");
    let error = RerunRecorder::create(
        &path,
        &Run::new(1, 1).about(),
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
fn a_full_disk_is_an_error_at_once() {
    let folder = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink("/dev/full", folder.path().join("run.rrd.part")).unwrap();
    let path = folder.path().join("run.rrd");
    let error = RerunRecorder::create(
        &path,
        &Run::new(1, 1).about(),
        &RecordingSettings::default(),
    )
    .map(drop)
    .unwrap_err();
    assert!(
        error.to_string().contains("No space left on device"),
        "{error}"
    );
}
