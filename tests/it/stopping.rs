//! How runs end: after environment steps, by signals, and although output cannot be written.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use super::util::{
    assert_same_results, command, run_command, seedbed, send_signal, small_run, stderr, wait_until,
};
use crate::study::{result_rows, run_study, study_text, write_study};

const RUN: [&str; 6] = [
    "--set",
    "agents.count=2",
    "--set",
    "stop=Episodes(300)",
    "--set",
    "checkpoint_every=1000",
];

/// Starts a run and waits until it plays.
fn start(mut command: Command, folder: &Path) -> Child {
    let mut child = command
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    wait_until("the run has begun", || {
        assert_eq!(child.try_wait().unwrap(), None, "the run ended early");
        folder.join("episodes.csv").is_file() && handles_term(&child)
    });
    child
}

/// Whether a process handles TERM, so that it does not end it at once. Only Linux says so.
fn handles_term(process: &Child) -> bool {
    const SIGTERM: u32 = 15;
    let Ok(status) = fs::read_to_string(format!("/proc/{}/status", process.id())) else {
        return true;
    };
    let mut lines = status.lines();
    let mask = lines.find_map(|line| line.strip_prefix("SigCgt:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (SIGTERM - 1) & 1 == 1)
}

/// The run has no checkpoint before the signal, so that the one from which it is resumed is due to the
/// signal.
fn assert_resumable_after(signal: &str, run: Command, stopped: &Path) {
    let child = start(run, stopped);
    send_signal(signal, &child);
    let output = child.wait_with_output().unwrap();
    let errors = stderr(&output);
    // 128 + number of the signal, as shells say of a process that it ended.
    let expected = if signal == "HUP" { 129 } else { 143 };
    assert_eq!(output.status.code(), Some(expected), "{signal}: {errors}");
    assert!(
        errors.contains("stopping, at the latest after this round"),
        "{errors}"
    );
    assert!(errors.contains("resume with\n"), "{errors}");
    assert!(stopped.join("checkpoint/state.bin").is_file(), "{signal}");
    let mut resumed = run_command(stopped, &[&RUN[..], &["--resume"]].concat());
    let output = resumed.output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let whole = stopped.with_extension("whole");
    assert!(run_command(&whole, &RUN).output().unwrap().status.success());
    assert_same_results(&whole, stopped);
}

#[test]
fn a_run_that_gets_term_can_be_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    assert_resumable_after("TERM", run_command(&path, &RUN), &path);
}

/// Rounds that take minutes or hours: a team whose agents all learn from all, long episodes, planning,
/// models of the task, updates during episodes.
const LONG_ROUNDS: [(&str, &[&str]); 6] = [
    ("cartpole", &["agents.count=500", "algorithm.epochs=1000"]),
    (
        "cartpole",
        &[
            "agents.count=1",
            "algorithm.epochs=10000",
            "algorithm.hidden=[1000, 1000]",
        ],
    ),
    ("cartpole", &["environment=LONG", "agents.count=2"]),
    (
        "mountain_car_seed_psrl",
        &["algorithm.candidates=10000", "algorithm.iterations=1000"],
    ),
    ("corridors_vime", &["algorithm.bonus.minibatches=100000"]),
    (
        "cartpole_q",
        &[
            "algorithm.learning.minibatches=100000",
            "algorithm.learning.minibatch=1",
        ],
    ),
];

/// What a run prints that TERM stops in a round. A run that is resumed has its tables before it begins; if the signal
/// came then, it ends without a word, and is started again.
fn stopped_in_a_round(run: impl Fn() -> Command, folder: &Path) -> String {
    for attempt in 0..10 {
        let child = start(run(), folder);
        std::thread::sleep(Duration::from_millis(200 * attempt));
        send_signal("TERM", &child);
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(143), "{output:?}");
        if !output.stderr.is_empty() {
            return stderr(&output);
        }
    }
    panic!("the run never begins");
}

/// A round that would last longer than a second after the signal is abandoned. The checkpoint is that of
/// the round before, and the run can be stopped again while it is resumed.
#[test]
fn runs_with_long_rounds_obey_signals() {
    let folder = tempfile::tempdir().unwrap();
    let task = fs::read_to_string("envs/cartpole.ron").unwrap();
    let endless = task
        .replace("time_limit: 200", "time_limit: 1000000")
        .replace("terminated: ", "terminated: \"false\", // ");
    let long = folder.path().join("long.ron");
    fs::write(&long, endless).unwrap();
    for (index, (scenario, settings)) in LONG_ROUNDS.iter().enumerate() {
        let path = folder.path().join(format!("run_{index}"));
        for resume in [None, Some("--resume")] {
            let run = || {
                let mut run = command(&["run", scenario, "--threads", "1", "--ignore-memory"]);
                run.arg("--out").arg(&path).args(resume);
                for setting in *settings {
                    run.args(["--set", &setting.replace("LONG", long.to_str().unwrap())]);
                }
                run
            };
            let errors = stopped_in_a_round(run, &path);
            let expected = "; resume with\n";
            assert!(errors.contains(expected), "{settings:?}: {errors}");
        }
    }
}

/// A run that is stopped again and again in the middle of rounds has the bits of one that is not.
#[test]
fn abandoned_rounds_do_not_change_bits() {
    let folder = tempfile::tempdir().unwrap();
    for (name, scenario, settings) in [
        (
            "pg",
            "cartpole",
            [
                "agents.count=16",
                "algorithm.epochs=200",
                "stop=Episodes(3)",
            ],
        ),
        (
            "q",
            "cartpole_q",
            [
                "agents.count=2",
                "algorithm.learning.minibatches=300",
                "stop=Episodes(3)",
            ],
        ),
    ] {
        let run = |path: &Path, resume: Option<&str>| {
            let mut run = command(&["run", scenario, "--threads", "1", "--out"]);
            run.arg(path).args(resume);
            for setting in settings {
                run.args(["--set", setting]);
            }
            run
        };
        let (whole, stopped) = (
            folder.path().join(name),
            folder.path().join(format!("{name}_stopped")),
        );
        assert!(run(&whole, None).output().unwrap().status.success());
        let child = start(run(&stopped, None), &stopped);
        send_signal("TERM", &child);
        let output = child.wait_with_output().unwrap();
        assert_eq!(
            output.status.code(),
            Some(143),
            "{name}: {}",
            stderr(&output)
        );
        let child = start(run(&stopped, Some("--resume")), &stopped);
        wait_until("a round is finished", || {
            stopped.join("summary.json").is_file()
                || fs::read_to_string(stopped.join("episodes.csv"))
                    .unwrap()
                    .lines()
                    .count()
                    > 2
        });
        send_signal("TERM", &child);
        if child.wait_with_output().unwrap().status.code() == Some(143) {
            let output = run(&stopped, Some("--resume")).output().unwrap();
            assert!(output.status.success(), "{name}: {}", stderr(&output));
        }
        assert_same_results(&whole, &stopped);
    }
}

/// Commands that do not write a run are ended by the signal itself, or have the same exit status.
#[test]
fn a_tabular_run_and_a_study_with_long_steps_obey_signals() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tabular");
    let mut run = command(&[
        "run",
        "tabular/deep_sea",
        "--set",
        "task.size=50",
        "--set",
        "agents.count=1000",
        "--ignore-memory",
        "--out",
    ]);
    run.arg(&path).stderr(Stdio::piped());
    let child = run.spawn().unwrap();
    wait_until("the run has begun", || handles_term(&child));
    send_signal("TERM", &child);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(143), "{}", stderr(&output));

    let long = r#""agents.count=300", "algorithm.epochs=10000""#;
    let text = study_text(3, "").replace(r#""agents.count=2""#, long);
    assert!(text.contains(long), "{text}");
    let (_folder, study, out) = write_study(&text);
    let mut run = command(&["study", &study, "--jobs", "2", "--ignore-memory", "--out"]);
    run.arg(&out).stderr(Stdio::piped()).stdout(Stdio::null());
    let child = run.spawn().unwrap();
    wait_until("a run has begun", || {
        out.join("runs").is_dir() && fs::read_dir(out.join("runs")).unwrap().next().is_some()
    });
    send_signal("TERM", &child);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(143), "{}", stderr(&output));
    assert!(
        stderr(&output).contains("interrupted; repeat the command"),
        "{}",
        stderr(&output)
    );
}

/// `env` handles HUP as usual even if these tests were started by `nohup`.
#[cfg(target_os = "linux")]
#[test]
fn a_run_that_gets_hup_can_be_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let run = started_by("env", &["--default-signal=HUP"], &run_command(&path, &RUN));
    assert_resumable_after("HUP", run, &path);
}

/// The command that starts `run` by another program.
fn started_by(program: &str, arguments: &[&str], run: &Command) -> Command {
    let mut command = Command::new(program);
    command
        .args(arguments)
        .arg(run.get_program())
        .args(run.get_args())
        .current_dir(run.get_current_dir().unwrap());
    command
}

/// `nohup` starts programs with HUP ignored.
#[test]
fn a_run_that_ignores_hup_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let script = ["-c", "trap '' HUP; exec \"$@\"", "sh"];
    let child = start(started_by("sh", &script, &run_command(&path, &RUN)), &path);
    send_signal("HUP", &child);
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(path.join("summary.json").is_file());
}

/// The reader takes one line of progress and closes the pipe, as `head -1` does.
#[test]
fn a_closed_pipe_does_not_end_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let mut child = run_command(&path, &RUN)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    let mut reader = BufReader::new(child.stderr.take().unwrap());
    reader.read_line(&mut line).unwrap();
    assert!(line.contains("episodes"), "{line}");
    drop(reader);
    assert!(child.wait().unwrap().success());
    assert!(path.join("summary.json").is_file());
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_for_progress_does_not_end_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let full = File::options().write(true).open("/dev/full").unwrap();
    let status = run_command(&path, &RUN)
        .stdout(Stdio::null())
        .stderr(full)
        .status()
        .unwrap();
    assert!(status.success(), "{status}");
}

#[test]
fn control_characters_in_names_are_escaped() {
    let output = seedbed(&["check", "no\u{1b}[31m\u{7}.ron"]);
    let errors = stderr(&output);
    assert_eq!(output.status.code(), Some(2));
    assert!(errors.contains("no\\u001b[31m\\u0007.ron"), "{errors}");
    assert!(
        !errors.contains('\u{1b}') && !errors.contains('\u{7}'),
        "{errors}"
    );
}

#[test]
fn recordings_that_rerun_turns_off_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let out = path.to_str().unwrap();
    let run = ["run", "cartpole", "--set", "stop=Episodes(2)", "--out", out];
    let output = command(&run).env("RERUN", "off").output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let expected =
        "the environment variable RERUN turns recordings off: unset it, or use `--no-recording`\n";
    assert!(stderr(&output).ends_with(expected), "{}", stderr(&output));
    let without = [&run[..], &["--no-recording", "--overwrite"]].concat();
    let output = command(&without).env("RERUN", "off").output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
}

/// Changed bytes of a checkpoint are never played or trained from. The error names the checkpoint
/// before it, from which the run can be resumed.
#[test]
fn damaged_checkpoints_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let child = start(
        run_command(
            &path,
            &[
                &RUN[..4],
                &["--set", "checkpoint_every=2", "--set", "checkpoint_share=1"],
            ]
            .concat(),
        ),
        &path,
    );
    let previous = path.join("checkpoint/previous.bin");
    wait_until("there are two checkpoints", || previous.is_file());
    send_signal("TERM", &child);
    child.wait_with_output().unwrap();
    let state = path.join("checkpoint/state.bin");
    let intact = fs::read(&state).unwrap();
    let resume = || {
        let arguments = [
            &RUN[..4],
            &[
                "--set",
                "checkpoint_every=2",
                "--set",
                "checkpoint_share=1",
                "--resume",
            ],
        ]
        .concat();
        run_command(&path, &arguments).output().unwrap()
    };
    for position in (0..intact.len()).step_by(intact.len() / 12) {
        let mut damaged = intact.clone();
        damaged[position] ^= 16;
        fs::write(&state, damaged).unwrap();
        let evaluation = seedbed(&["evaluate", path.to_str().unwrap()]);
        for output in [resume(), evaluation] {
            let errors = stderr(&output);
            assert_eq!(output.status.code(), Some(2), "{position}: {errors}");
            assert!(output.stdout.is_empty(), "{position}: no results");
            assert!(errors.contains("state.bin: "), "{position}: {errors}");
            assert!(
                errors.contains("the checkpoint before it is intact"),
                "{errors}"
            );
        }
    }
    fs::rename(&previous, &state).unwrap();
    let output = resume();
    assert!(output.status.success(), "{}", stderr(&output));
    let whole = folder.path().join("whole");
    let whole_run = run_command(&whole, &RUN[..4]).output().unwrap();
    assert!(whole_run.status.success());
    assert_same_results(&whole, &path);
}

/// A table that was changed after the checkpoint is noticed, although its length is the same.
#[test]
fn changed_tables_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    assert!(small_run(&path, &[]).status.success());
    let table = path.join("episodes.csv");
    let text = fs::read_to_string(&table).unwrap();
    let last_digit = text
        .rfind(|character: char| character.is_ascii_digit())
        .unwrap();
    let mut changed = text.into_bytes();
    changed[last_digit] = if changed[last_digit] == b'7' {
        b'8'
    } else {
        b'7'
    };
    fs::write(&table, &changed).unwrap();
    fs::remove_file(path.join("summary.json")).unwrap();
    let output = small_run(&path, &["--set", "stop=Episodes(8)", "--resume"]);
    let errors = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    let expected = "episodes.csv: was changed or damaged after its checkpoint: its first ";
    assert!(errors.contains(expected), "{errors}");
    assert_eq!(fs::read(&table).unwrap(), changed, "the table is kept");
}

/// The environment steps of the team after each episode, as `episodes.csv` says.
fn steps_after_episodes(folder: &Path) -> Vec<u64> {
    let mut reader = csv::Reader::from_path(folder.join("episodes.csv")).unwrap();
    let rows = reader.deserialize::<BTreeMap<String, String>>();
    rows.map(|row| row.unwrap()["env_steps"].parse().unwrap())
        .collect()
}

#[test]
fn a_run_ends_after_the_round_in_which_the_team_has_made_its_steps() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let stop = "stop=Steps(team: 500, at_most: 300)";
    let agents = "agents.count=2";
    let output = run_command(&path, &["--set", agents, "--set", stop])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(
        stderr(&output).contains("500/500 env steps"),
        "{}",
        stderr(&output)
    );
    let steps = steps_after_episodes(&path);
    assert!(steps.len() > 4, "{steps:?}");
    assert!(steps[steps.len() - 1] >= 500, "{steps:?}");
    // Two episodes are a round.
    assert!(steps[steps.len() - 3] < 500, "{steps:?}");
}

#[test]
fn a_run_that_ends_after_steps_has_a_maximum_of_episodes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let stop = "stop=Steps(team: 1000000, at_most: 3)";
    let output = run_command(&path, &["--set", "agents.count=2", "--set", stop])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(steps_after_episodes(&path).len(), 6);
}

#[test]
fn runs_of_a_study_end_after_the_steps_of_the_scenario() {
    let text = study_text(3, "").replace("Episodes(8)", "Steps(team: 300, at_most: 100)");
    assert!(text.contains("Steps(team: 300"), "{text}");
    let (_folder, study, out) = write_study(&text);
    let output = run_study(&study, &out, &[]);
    assert!(output.status.success(), "{}", stderr(&output));
    let rows = result_rows(&out);
    assert_eq!(rows.len(), 9);
    for row in rows {
        let env_steps: u32 = row["env_steps"].parse().unwrap();
        // The last round, of two early episodes, has much less than 200 steps.
        assert!((300..500).contains(&env_steps), "{row:?}");
    }
}
