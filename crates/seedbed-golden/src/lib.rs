//! Golden files for tests: for each input file, the expected output is a file in the same folder. Many small inputs
//! are in one Markdown file, each with its expected output.
//!
//! With the environment variable `UPDATE_EXPECT=1`, tests write the current outputs to these files.
//! `cargo xtask bless` does this for all golden files. Review the changes before you commit them.

use std::ops::Range;
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

/// An input and its expected output in a Markdown file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Case {
    /// Heading of its section.
    pub name: String,
    /// Contents of the block of code in the language `ron`.
    pub input: String,
    /// Bytes of the file with the contents of the block `text`.
    expected: Range<usize>,
}

/// The cases of a Markdown file: its sections of level 2, each with a block `ron` and a block `text` after it.
///
/// # Panics
/// If a section has no such blocks, or two sections have the same heading.
#[must_use]
pub fn cases(markdown: &str) -> Vec<Case> {
    const HEADING: &str = "\n## ";
    let mut cases: Vec<Case> = Vec::new();
    let starts = markdown.match_indices(HEADING).map(|(start, _)| start);
    for start in starts {
        let text = &markdown[start + HEADING.len()..];
        let text = &text[..text.find(HEADING).unwrap_or(text.len())];
        let name = text.lines().next().unwrap_or_default();
        assert!(
            cases.iter().all(|case| case.name != name),
            "two cases are named `{name}`"
        );
        let input = block(text, "ron", 0);
        let input = input.unwrap_or_else(|| panic!("`{name}` has no block ```ron"));
        let expected = block(text, "text", input.end);
        let expected = expected.unwrap_or_else(|| panic!("`{name}` has no block ```text"));
        let before = start + HEADING.len();
        cases.push(Case {
            name: name.to_owned(),
            input: text[input].to_owned(),
            expected: before + expected.start..before + expected.end,
        });
    }
    cases
}

/// Where the contents of the first block of code in a language after byte `from` are.
fn block(text: &str, language: &str, from: usize) -> Option<Range<usize>> {
    let fence = format!("\n```{language}\n");
    let start = from + text[from..].find(&fence)? + fence.len();
    // The line feed before the closing fence may be that of the opening one.
    let length = text[start - 1..].find("\n```")?;
    Some(start..start + length)
}

/// Compares `output(input)` of each case in a Markdown file with its expected output.
///
/// # Panics
/// If an output differs, if there are no cases, or if one of them lacks a part.
pub fn check_markdown(path: impl AsRef<Path>, output: impl Fn(&str) -> String) {
    let path = path.as_ref();
    let unreadable = |error| -> ! { panic!("{}: {error}", path.display()) };
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| unreadable(error));
    let absolute = std::path::absolute(path).unwrap_or_else(|error| unreadable(error));
    let cases = cases(&text);
    assert!(!cases.is_empty(), "no cases in {}", path.display());
    let (mut actual, mut copied) = (String::new(), 0);
    for case in &cases {
        actual += &text[copied..case.expected.start];
        actual += &output(&case.input);
        copied = case.expected.end;
    }
    actual += &text[copied..];
    expect_file![absolute].assert_eq(&actual);
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

    const MARKDOWN: &str = "# Cases\n\n## One\n\nWords.\n\n```ron\nloud\n```\n\n```text\nLOUD\n```\n\n\
                            ## Nothing\n\n```ron\n```\n\n```text\n```\n";

    fn check_text(markdown: &str) {
        let folder = folder_with(&[("cases.md", markdown)]);
        check_markdown(folder.path().join("cases.md"), str::to_uppercase);
    }

    #[test]
    fn cases_are_read_from_markdown() {
        let found = cases(MARKDOWN);
        let found: Vec<(&str, &str)> = found
            .iter()
            .map(|case| (case.name.as_str(), case.input.as_str()))
            .collect();
        assert_eq!(found, [("One", "loud\n"), ("Nothing", "")]);
        check_text(MARKDOWN);
    }

    #[test]
    fn another_output_than_that_of_the_case_fails() {
        for other in ["LOUDER\n", "LOU\n", "LOUD\n\n", ""] {
            let markdown = MARKDOWN.replace("LOUD\n", other);
            let result = std::panic::catch_unwind(|| check_text(&markdown));
            assert!(result.is_err(), "{other:?}");
        }
    }

    #[test]
    #[should_panic(expected = "`Nothing` has no block ```text")]
    fn a_case_without_expected_output_fails() {
        check_text(&MARKDOWN.replace("\n```text\n```\n", ""));
    }

    #[test]
    #[should_panic(expected = "two cases are named `One`")]
    fn two_cases_with_one_name_fail() {
        check_text(&MARKDOWN.replace("Nothing", "One"));
    }

    #[test]
    #[should_panic(expected = "no inputs in")]
    fn a_folder_without_inputs_fails() {
        check_folder(folder_with(&[]).path(), uppercase);
    }
}
