//! The exact error messages of invalid scenarios, studies and tuning files, which are in `tests/errors/`. CONTRIBUTING.md
//! explains how to update them.

use std::io::Write;
use std::process::Stdio;

use seedbed_golden::check_markdown;

use super::util::{command, stderr};

/// The error that `seedbed check` prints of a text.
fn check_error(text: &str) -> String {
    let mut check = command(&["check", "-"]);
    check
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut check = check.spawn().unwrap();
    let mut input = check.stdin.take().unwrap();
    input.write_all(text.as_bytes()).unwrap();
    drop(input);
    let output = check.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{text}: {}", stderr(&output));
    stderr(&output).replace("/dev/stdin", "input.ron")
}

#[test]
fn errors_in_scenarios_are_those_of_their_cases() {
    check_markdown("tests/errors/scenarios.md", check_error);
}

#[test]
fn errors_in_studies_are_those_of_their_cases() {
    check_markdown("tests/errors/studies.md", check_error);
}

#[test]
fn errors_in_tuning_files_are_those_of_their_cases() {
    check_markdown("tests/errors/tunings.md", check_error);
}
