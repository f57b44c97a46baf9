//! The error messages of wrong task files: each file in `tests/broken_envs/` has its exact message
//! beside it. See CONTRIBUTING.md for how to update them.

use std::path::Path;

use seedbed_env::load;
use seedbed_golden::check_folder;

#[test]
fn every_error_is_reported_with_its_place() {
    check_folder("tests/broken_envs", |file| match load(file) {
        Ok(_) => panic!("{} is not broken", file.display()),
        Err(error) => format!("{error}\n"),
    });
}

#[test]
fn a_missing_file_is_reported() {
    let error = load(Path::new("envs/no.ron")).unwrap_err();
    assert_eq!(error.to_string(), "envs/no.ron: no such file");
}
