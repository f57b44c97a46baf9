//! `seedbed film`.

use std::path::Path;

use crate::util::{names_in, run_refused, run_successful, small_run};

/// Size, number of frames, and total duration in hundredths of a second.
fn film_facts(path: &Path) -> ((u16, u16), usize, u32) {
    let bytes = std::fs::read(path).unwrap();
    let mut decoder = gif::DecodeOptions::new()
        .read_info(bytes.as_slice())
        .unwrap();
    let size = (decoder.width(), decoder.height());
    let (mut frames, mut duration) = (0, 0);
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        frames += 1;
        duration += u32::from(frame.delay);
    }
    (size, frames, duration)
}

/// Two seconds with ten frames each are 20 frames of 0.1 s; the last one stays for 2 s.
#[test]
fn a_run_is_filmed() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    assert!(small_run(&run, &[]).status.success());
    let film = |name: &str, extra: &[&str]| {
        let path = folder.path().join(name);
        let arguments = [
            "film",
            run.to_str().unwrap(),
            "--seconds",
            "2",
            "--fps",
            "10",
        ];
        let out = ["--out", path.to_str().unwrap()];
        run_successful(&[&arguments[..], &out, extra].concat());
        path
    };
    let first = film("first.gif", &["--width", "400"]);
    assert_eq!(film_facts(&first), ((400, 404), 20, 19 * 10 + 200));
    let again = film("again.gif", &["--width", "400"]);
    assert!(std::fs::read(&first).unwrap() == std::fs::read(again).unwrap());
    // Agent 1 is not recorded, so that only states and returns are shown.
    let without_bodies = film("other.gif", &["--width", "400", "--agent", "1"]);
    assert!(std::fs::read(first).unwrap() != std::fs::read(without_bodies).unwrap());
    assert_eq!(
        names_in(folder.path()),
        ["again.gif", "first.gif", "other.gif", "run"]
    );
}

#[test]
fn runs_that_cannot_be_filmed_are_explained() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    assert!(small_run(&run, &[]).status.success());
    let run_text = run.to_str().unwrap();
    let message = run_refused(&["film", run_text, "--agent", "2"]);
    assert_eq!(
        message,
        format!("error: {run_text} has no agent 2: it has agents 0 to 1\n")
    );
    let message = run_refused(&["film", run_text, "--out", "film.mp4"]);
    assert_eq!(
        message,
        "error: --out film.mp4: expected a file that ends in .gif\n"
    );
    let message = run_refused(&["film", "recordings/sample/run.rrd"]);
    assert!(
        message.contains("has no recording and scenario, from which a film is made"),
        "{message}"
    );
}
