//! Helpers that several test modules share: running the program, reading what it printed, runs that
//! are small enough for a test, and waiting for a condition.

use std::ffi::OsStr;
use std::fs;
#[cfg(unix)]
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Output};
use std::time::{Duration, Instant};

/// The repository's folder: the program is run there, and relative paths begin there.
pub(crate) const REPOSITORY: &str = env!("CARGO_MANIFEST_DIR");

/// Files of a run that must not depend on threads, recording, or interruptions.
pub(crate) const RESULT_FILES: [&str; 4] = [
    "episodes.csv",
    "rounds.csv",
    "policies.safetensors",
    "summary.json",
];

/// The command `seedbed ARGUMENTS`, not yet started.
pub(crate) fn command(arguments: &[impl AsRef<OsStr>]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_seedbed"));
    command.args(arguments).current_dir(REPOSITORY);
    command
}

/// Runs `seedbed ARGUMENTS` to its end.
pub(crate) fn seedbed(arguments: &[&str]) -> Output {
    command(arguments).output().expect("the binary runs")
}

/// Runs `seedbed ARGUMENTS`, which must succeed, and returns its standard output.
pub(crate) fn succeed(arguments: &[&str]) -> String {
    let output = seedbed(arguments);
    assert!(
        output.status.success(),
        "{arguments:?}: {}",
        stderr(&output)
    );
    stdout(&output)
}

/// Runs `seedbed ARGUMENTS`, which must refuse its input, and returns its standard error.
pub(crate) fn refuse(arguments: &[&str]) -> String {
    let output = seedbed(arguments);
    assert_eq!(
        output.status.code(),
        Some(2),
        "{arguments:?}: {}",
        stderr(&output)
    );
    stderr(&output)
}

/// What a command printed to standard output.
pub(crate) fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// What a command printed to standard error.
pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The command `seedbed run scenarios/cartpole.ron --out FOLDER MORE`, not yet started.
pub(crate) fn run_command(folder: &Path, more: &[&str]) -> Command {
    let mut command = command(&["run", "scenarios/cartpole.ron", "--out"]);
    command.arg(folder).args(more);
    command
}

/// Runs two agents for six episodes each, to the end.
pub(crate) fn small_run(folder: &Path, more: &[&str]) -> Output {
    let small = ["--set", "agents.count=2", "--set", "stop=Episodes(6)"];
    run_command(folder, &[&small, more].concat())
        .output()
        .expect("the binary runs")
}

/// The names of the result files that are not the same, byte by byte, in both folders of runs.
pub(crate) fn differing_results(one: &Path, other: &Path) -> Vec<&'static str> {
    let read = |folder: &Path, name: &str| {
        let path = folder.join(name);
        fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    };
    let mut names = RESULT_FILES.to_vec();
    names.retain(|name| read(one, name) != read(other, name));
    names
}

/// Asserts that two runs gave the same results, to the bit.
pub(crate) fn assert_same_results(one: &Path, other: &Path) {
    let differing = differing_results(one, other);
    assert!(differing.is_empty(), "{differing:?} differ");
}

/// Runs a command that must abort itself (see the hidden options `--abort-after-…`): a crash at a
/// known moment, of which the process cleans up nothing.
pub(crate) fn crash(mut command: Command) {
    let output = command.output().expect("the binary runs");
    assert!(
        is_aborted(output.status),
        "{}: {}",
        output.status,
        stderr(&output)
    );
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

/// The names of a folder's entries, sorted.
pub(crate) fn names_in(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = entries(folder)
        .iter()
        .map(|path| path.file_name().unwrap().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// All files below a folder, however deep, whose names end with `.EXTENSION`; sorted.
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

/// Waits for a condition, and fails after two minutes: time enough for a busy machine.
pub(crate) fn wait_until(what: &str, mut is_met: impl FnMut() -> bool) {
    let patience = Instant::now() + Duration::from_mins(2);
    while !is_met() {
        assert!(Instant::now() < patience, "not within two minutes: {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}
