//! Golden files for tests: for each input file, the expected output is a file in the same folder.
//!
//! With the environment variable `UPDATE_EXPECT=1`, tests write the current outputs to these files.
//! `cargo xtask bless` does this for all golden files. Review the changes before you commit them.

use std::path::{Path, PathBuf};

use expect_test::expect_file;

/// Compares `output(NAME.ron)` with `NAME.txt` for each `NAME.ron` in a folder. If `folder` is
/// relative, the paths passed to `output` are relative as well, because outputs may contain the
/// path of their input.
///
/// # Panics
/// If an output differs from its file, if the folder has no inputs, or if it has a file that is
/// neither an input nor the expected output of an input.
pub fn check_folder(folder: impl AsRef<Path>, output: impl Fn(&Path) -> String) {
    let files = files_in(folder.as_ref());
    let is_input = |path: &Path| path.extension().is_some_and(|found| found == "ron");
    let (inputs, others): (Vec<_>, Vec<_>) = files.into_iter().partition(|path| is_input(path));
    assert!(
        !inputs.is_empty(),
        "no inputs in {}",
        folder.as_ref().display()
    );
    for path in others {
        let has_output_name = path.extension().is_some_and(|found| found == "txt");
        assert!(
            has_output_name && inputs.contains(&path.with_extension("ron")),
            "{} is not the expected output of any input: delete it",
            path.display()
        );
    }
    for input in inputs {
        let expected = std::path::absolute(input.with_extension("txt"))
            .unwrap_or_else(|error| panic!("{}: {error}", input.display()));
        expect_file![expected].assert_eq(&output(&input));
    }
}

fn files_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder)
        .unwrap_or_else(|error| panic!("cannot list {}: {error}", folder.display()));
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.expect("a folder's entries can be read").path())
        .collect();
    files.sort();
    files
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn folder_with(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            fs::write(folder.path().join(name), text).unwrap();
        }
        folder
    }

    fn uppercase(input: &Path) -> String {
        fs::read_to_string(input).unwrap().to_uppercase()
    }

    #[test]
    fn matching_output_passes() {
        let folder = folder_with(&[("a.ron", "loud"), ("a.txt", "LOUD")]);
        check_folder(folder.path(), uppercase);
    }

    #[test]
    #[should_panic(expected = "is not the expected output of any input")]
    fn expected_output_without_an_input_fails() {
        let folder = folder_with(&[("a.ron", "loud"), ("a.txt", "LOUD"), ("b.txt", "LOUD")]);
        check_folder(folder.path(), uppercase);
    }

    #[test]
    #[should_panic(expected = "no inputs in")]
    fn a_folder_without_inputs_fails() {
        check_folder(folder_with(&[]).path(), uppercase);
    }
}
