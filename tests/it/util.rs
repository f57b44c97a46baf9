//! Helpers of several test modules: running commands, reading their output, short runs, comparing
//! results, and waiting for a condition.

use std::ffi::OsStr;
use std::fs;
#[cfg(unix)]
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
#[cfg(unix)]
use std::process::Child;
use std::process::{Command, ExitStatus, Output};
use std::time::{Duration, Instant};

/// Folder of the repository. Commands are run in this folder, so relative paths begin there.
pub(crate) const REPOSITORY: &str = env!("CARGO_MANIFEST_DIR");

/// Files of a run that must not depend on threads, recording, or interruptions.
pub(crate) const RESULT_FILES: [&str; 4] = [
    "episodes.csv",
    "rounds.csv",
    "policies.safetensors",
    "summary.json",
];

/// The command `seedbed ARGUMENTS`, before it is started.
pub(crate) fn command(arguments: &[impl AsRef<OsStr>]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_seedbed"));
    command.args(arguments).current_dir(REPOSITORY);
    // Without a log of the runs that tests make with files of the repository.
    command.env("SEEDBED_RUN_LOG", "");
    command
}

/// Runs `seedbed ARGUMENTS` to its end.
pub(crate) fn seedbed(arguments: &[&str]) -> Output {
    command(arguments).output().expect("the binary runs")
}

/// Runs `seedbed ARGUMENTS`, which must succeed, and returns its standard output.
pub(crate) fn run_successful(arguments: &[&str]) -> String {
    let output = seedbed(arguments);
    assert!(
        output.status.success(),
        "{arguments:?}: {}",
        stderr(&output)
    );
    stdout(&output)
}

/// Runs `seedbed ARGUMENTS`, which must fail with exit status 2 (invalid input), and returns its
/// standard error.
pub(crate) fn run_refused(arguments: &[&str]) -> String {
    let output = seedbed(arguments);
    assert_eq!(
        output.status.code(),
        Some(2),
        "{arguments:?}: {}",
        stderr(&output)
    );
    stderr(&output)
}

/// Standard output of a command.
pub(crate) fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Standard error of a command.
pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The arguments of `seedbed study` for a study and the directory of its results. `arguments` may begin with an
/// action, such as `verify`.
pub(crate) fn study_arguments<'a>(
    study: &'a str,
    out: &'a str,
    arguments: &[&'a str],
) -> Vec<&'a str> {
    let action = arguments.first().filter(|word| !word.starts_with('-'));
    let options = &arguments[usize::from(action.is_some())..];
    let mut all = vec!["study"];
    all.extend(action);
    all.extend([study, "--out", out]);
    all.extend(options);
    all
}

/// The command `seedbed run scenarios/cartpole.ron --out FOLDER EXTRA_ARGUMENTS`, before it is
/// started.
pub(crate) fn run_command(folder: &Path, extra_arguments: &[&str]) -> Command {
    let mut command = command(&["run", "scenarios/cartpole.ron", "--out"]);
    command.arg(folder).args(extra_arguments);
    command
}

/// Runs `scenarios/cartpole.ron` with two agents and six episodes per agent.
pub(crate) fn small_run(folder: &Path, extra_arguments: &[&str]) -> Output {
    let small = ["--set", "agents.count=2", "--set", "stop=Episodes(6)"];
    run_command(folder, &[&small, extra_arguments].concat())
        .output()
        .expect("the binary runs")
}

/// A task of a ball in the air above ground that is 1 m long. `height`: the formula of the height of point
/// `index`, which may read `bump`, a number from 0 to 0.1 that is drawn for each point.
pub(crate) fn ball_above_ground(height: &str) -> String {
    format!(
        r#"Environment(
            description: "A ball above ground.", gravity: (0.0, 0.0), control_step: 0.02, time_limit: 20,
            solver: (iterations: 4, searches: 2),
            colliders: [(name: "ground", geom: Terrain(
                from: -0.5, spacing: 0.1, points: 11, drawn: [(name: "bump", value: Uniform(0.0, 0.1))], height: "{height}",
            ))],
            bodies: [(name: "ball", position: (0.0, 1.0), mass: 1.0, colliders: [(name: "skin", geom: Ball(radius: 0.2))])],
            actuators: [(name: "push", type: JointForce("ball.x"), control: Continuous(-1.0, 1.0), unit: "N")],
            sensors: [(name: "x", type: JointPosition("ball.x"))],
            observations: [(name: "x", unit: "m", range: (-1.0, 1.0))],
            reward: "0",
        )"#
    )
}

/// Names of those result files whose bytes differ between two run folders.
pub(crate) fn differing_results(first: &Path, second: &Path) -> Vec<&'static str> {
    let read = |folder: &Path, name: &str| {
        let path = folder.join(name);
        fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    };
    let mut names = RESULT_FILES.to_vec();
    names.retain(|name| read(first, name) != read(second, name));
    names
}

/// Asserts that the result files of two run folders have the same bytes.
pub(crate) fn assert_same_results(first: &Path, second: &Path) {
    let differing = differing_results(first, second);
    assert!(differing.is_empty(), "{differing:?} differ");
}

/// Writes the description of a study's results without its checksum, as earlier versions did and as
/// somebody does who edits it on purpose.
pub(crate) fn write_manifest_without_checksum(path: &Path, text: &str) {
    let (fields, _) = text
        .rsplit_once(",\n  \"sha256\": \"")
        .expect("a manifest has a checksum");
    fs::write(path, format!("{fields}\n}}\n")).unwrap();
}

/// Runs a command with a hidden option `--abort-after-…` and asserts that the process aborts. This
/// simulates a crash at a known time: an aborted process does not clean up.
pub(crate) fn crash(mut command: Command) {
    let output = command.output().expect("the binary runs");
    assert!(
        is_aborted(output.status),
        "{}: {}",
        output.status,
        stderr(&output)
    );
}

/// Sends the signal of Ctrl-C (SIGINT) to a process.
#[cfg(unix)]
pub(crate) fn interrupt(process: &Child) {
    send_signal("INT", process);
}

/// Sends a signal, such as `TERM`, to a process.
#[cfg(unix)]
pub(crate) fn send_signal(signal: &str, process: &Child) {
    let status = Command::new("kill")
        .args([&format!("-{signal}"), &process.id().to_string()])
        .status();
    assert!(status.unwrap().success());
}

#[cfg(unix)]
fn is_aborted(status: ExitStatus) -> bool {
    const SIGABRT: i32 = 6;
    status.signal() == Some(SIGABRT)
}

#[cfg(not(unix))]
fn is_aborted(status: ExitStatus) -> bool {
    !matches!(status.code(), Some(0..=2))
}

/// Sorted names of the files and folders in a folder.
pub(crate) fn names_in(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = entries(folder)
        .iter()
        .map(|path| path.file_name().unwrap().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Sorted paths of all files with an extension in a folder and its subfolders.
pub(crate) fn files_below(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for path in entries(folder) {
        if path.is_dir() {
            files.extend(files_below(&path, extension));
        } else if path.extension().is_some_and(|found| found == extension) {
            files.push(path);
        }
    }
    files.sort();
    files
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder)
        .unwrap_or_else(|error| panic!("cannot list {}: {error}", folder.display()));
    entries.map(|entry| entry.unwrap().path()).collect()
}

/// Waits until a condition is true. Fails after two minutes, which is enough on a busy machine.
pub(crate) fn wait_until(condition_text: &str, mut condition: impl FnMut() -> bool) {
    let deadline = Instant::now() + Duration::from_mins(2);
    while !condition() {
        assert!(
            Instant::now() < deadline,
            "still false after two minutes: {condition_text}"
        );
        std::thread::sleep(Duration::from_millis(2));
    }
}
