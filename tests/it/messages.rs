//! What a user reads who has written something wrong: every broken scenario and study has its exact
//! message beside it. See CONTRIBUTING.md for how to update them.

use std::path::Path;

use seedbed_golden::check_folder;

use super::util::refuse;

fn message(file: &Path) -> String {
    refuse(&["check", file.to_str().unwrap()])
}

#[test]
fn broken_scenarios_are_explained() {
    check_folder("tests/broken_scenarios", message);
}

#[test]
fn broken_studies_are_explained() {
    check_folder("tests/broken_studies", message);
}
