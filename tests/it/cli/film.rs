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
    // 404 by 760 pixels at the full size without the key of agents, which has 22 and a gap of 10.
    assert_eq!(film_facts(&first), ((400, 229), 20, 19 * 10 + 200));
    let again = film("again.gif", &["--width", "400"]);
    assert!(std::fs::read(&first).unwrap() == std::fs::read(again).unwrap());
    let agent_1 = film("other.gif", &["--width", "400", "--agent", "1"]);
    assert!(std::fs::read(first).unwrap() != std::fs::read(agent_1).unwrap());
    assert_eq!(
        names_in(folder.path()),
        ["again.gif", "first.gif", "other.gif", "run"]
    );
}

/// The motion of an agent that was not recorded is computed again from its recorded actions: the film has the bytes of one from
/// recorded motion, also where starts follow others from one random stream: in rounds of three episodes, and where agents do not
/// wait for each other.
#[test]
fn motion_that_was_not_recorded_is_computed_again() {
    let folder = tempfile::tempdir().unwrap();
    let film = |name: &str, schedule: &str, scene: &str| {
        let run = folder.path().join(name).join(&schedule[..4]).join("run");
        let schedule = format!("schedule={schedule}");
        let rounds = ["--set", schedule.as_str()];
        assert!(
            small_run(&run, &[&rounds[..], &["--set", scene]].concat())
                .status
                .success()
        );
        let out = run.join("film.png");
        let arguments = [
            "film",
            run.to_str().unwrap(),
            "--agent",
            "1",
            "--seconds",
            "2",
        ];
        let printed = run_successful(&[&arguments[..], &["--out", out.to_str().unwrap()]].concat());
        assert!(printed.ends_with("24 frames\n"), "{printed}");
        std::fs::read(out).unwrap()
    };
    for schedule in ["Synchronous(episodes: 3)", "Asynchronous()"] {
        let recorded = film("one", schedule, "recording.scene=(agents: [1], every: 1)");
        let computed = film("two", schedule, "recording.scene=(agents: [0], every: 1)");
        assert!(recorded == computed, "{schedule}");
    }
}

/// A film of a trained policy shows new episodes without learning: the same ones again, others with another seed.
#[test]
fn a_trained_policy_is_filmed() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    assert!(small_run(&run, &[]).status.success());
    let run = run.to_str().unwrap();
    let film = |extra: &[&str]| {
        let arguments = ["film", run, "--policy", "1", "--seconds", "1"];
        run_successful(&[&arguments[..], extra].concat());
        std::fs::read(format!("{run}/policy.gif")).unwrap()
    };
    let first = film(&[]);
    assert!(first == film(&[]) && first != film(&["--seed", "1"]));
    let message = run_refused(&["film", run, "--actions", "greedy"]);
    assert!(
        message
            .starts_with("error: --actions, --temperature, --environment and --seed need --policy")
    );
    let message = run_refused(&["film", run, "--policy", "7"]);
    assert!(message.contains("has no agent 7: it has agents 0 to 1"));
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
    let message = run_refused(&["film", run_text, "--out", "film.avi"]);
    assert_eq!(
        message,
        "error: --out film.avi: expected a file that ends in .gif, .png or .mp4\n"
    );
    let message = run_refused(&["film", "recordings/sample/run.rrd"]);
    assert!(
        message.contains("has no recording with its scenario beside it, from which a film is made"),
        "{message}"
    );
}
