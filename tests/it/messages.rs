//! Golden files of error messages: `NAME.txt` is the exact error of the invalid scenario, study or
//! tuning file `NAME.ron`. CONTRIBUTING.md explains how to update these files.

use std::path::Path;

use seedbed_golden::check_folder;

use super::util::run_refused;

/// The error that `seedbed check FILE` prints.
fn check_error(file: &Path) -> String {
    run_refused(&["check", file.to_str().unwrap()])
}

#[test]
fn errors_in_scenarios_match_the_golden_files() {
    check_folder("tests/broken_scenarios", check_error);
}

#[test]
fn errors_in_studies_match_the_golden_files() {
    check_folder("tests/broken_studies", check_error);
}

#[test]
fn errors_in_tuning_files_match_the_golden_files() {
    check_folder("tests/broken_tunings", check_error);
}
