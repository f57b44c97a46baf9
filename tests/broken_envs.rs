//! What a user reads who has written something wrong: every file in `tests/broken_envs/` has its exact message beside it.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};

use seedbed::env::load;

fn broken_files() -> Vec<PathBuf> {
    let entries = std::fs::read_dir("tests/broken_envs").expect("the folder is there");
    let mut files: Vec<_> = entries
        .map(|entry| entry.expect("its entries can be read").path())
        .collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "ron"));
    files.sort();
    files
}

/// Set `UPDATE_EXPECTED` to write the messages as they are now, and read the difference.
#[test]
fn every_mistake_is_told_with_its_place() {
    let files = broken_files();
    assert!(files.len() >= 40);
    for file in files {
        let Err(error) = load(&file) else {
            panic!("{} is not broken", file.display())
        };
        let expected = file.with_extension("txt");
        if std::env::var_os("UPDATE_EXPECTED").is_some() {
            std::fs::write(&expected, format!("{error}\n")).unwrap();
        }
        assert_eq!(
            format!("{error}\n"),
            std::fs::read_to_string(&expected).unwrap_or_default(),
            "{}",
            file.display()
        );
    }
}

#[test]
fn a_missing_file_is_told() {
    let error = load(Path::new("envs/no.ron")).unwrap_err();
    assert_eq!(error.to_string(), "envs/no.ron: no such file");
}
