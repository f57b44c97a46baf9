//! The list of all files in `ARCHITECTURE.md`, from the first sentence of each file's documentation.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use super::util::{REPOSITORY, files_below};

/// Where the list begins; it ends with the page.
const HEADING: &str = "## Every file in a sentence\n";

/// Folders with listed files, and the extension of these files.
const FOLDERS: [(&str, &str); 16] = [
    ("src", "rs"),
    ("src/explore/page", "js"),
    ("crates/seedbed-env/src", "rs"),
    ("crates/seedbed-env/src/gymnasium", "py"),
    ("crates/seedbed-figure/src", "rs"),
    ("crates/seedbed-input/src", "rs"),
    ("crates/seedbed-learn/src", "rs"),
    ("crates/seedbed-random/src", "rs"),
    ("crates/seedbed-scene/src", "rs"),
    ("crates/seedbed-settings/src", "rs"),
    ("crates/seedbed-stats/src", "rs"),
    ("python/seedbed", "py"),
    ("python/seedbed_command", "py"),
    ("python/src", "rs"),
    ("tests/it", "rs"),
    ("xtask/src", "rs"),
];

/// What a period does not end a sentence after.
const ABBREVIATIONS: [&str; 4] = ["et al", "Alg", "Eq", "Fig"];

/// The first sentence of a file's documentation; `None` if it has none.
fn first_sentence(text: &str, extension: &str) -> Option<String> {
    if text.starts_with("#![doc = include_str!(\"../README.md\")]") {
        return Some("The crate: see its `README.md`".to_owned());
    }
    let documentation = match extension {
        "rs" => {
            let lines = text.lines().skip_while(|line| !line.starts_with("//!"));
            let lines = lines.map_while(|line| line.strip_prefix("//!"));
            lines.take_while(|line| !line.is_empty()).collect()
        }
        "py" => between(text, "\"\"\"", "\"\"\"")?.replace('\n', " "),
        _ => between(text, "/*", "*/")?.replace('\n', " "),
    };
    let words: Vec<&str> = documentation.split_whitespace().collect();
    let sentence = words.join(" ");
    let is_end = |(place, _): &(usize, &str)| {
        let before = &sentence[..*place];
        !ABBREVIATIONS
            .iter()
            .any(|abbreviation| before.ends_with(abbreviation))
    };
    let end = sentence.match_indices(". ").find(is_end);
    let sentence = sentence[..end.map_or(sentence.len(), |(place, _)| place)].trim_end_matches('.');
    // Links of the documentation lead nowhere here.
    let without_links = sentence.replace("[`", "`").replace("`]", "`");
    (!sentence.is_empty()).then(|| match without_links.find("`(") {
        Some(start) => {
            let (before, link) = without_links.split_at(start + 1);
            let (_, after) = link.split_once(')').unwrap_or_default();
            format!("{before}{after}")
        }
        None => without_links,
    })
}

fn between<'a>(text: &'a str, start: &str, end: &str) -> Option<&'a str> {
    let (_, text) = text.split_once(start)?;
    Some(text.split_once(end)?.0)
}

/// The list, folder by folder.
fn list() -> String {
    let mut folders: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (folder, extension) in FOLDERS {
        for path in files_below(&Path::new(REPOSITORY).join(folder), extension) {
            let relative = path.strip_prefix(REPOSITORY).unwrap();
            let folder = relative.parent().unwrap().to_string_lossy().into_owned();
            let name = relative.file_name().unwrap().to_string_lossy();
            let text = fs::read_to_string(&path).unwrap();
            let Some(sentence) = first_sentence(&text, extension) else {
                panic!(
                    "{}: expected a sentence that says what it is",
                    relative.display()
                );
            };
            let line = format!("- `{name}`: {sentence}");
            folders.entry(folder).or_default().push(line);
        }
    }
    let mut list = HEADING.to_owned();
    for (folder, files) in folders {
        write!(list, "\n### `{folder}/`\n\n{}\n", files.join("\n")).unwrap();
    }
    list
}

/// After a change of a first sentence: `UPDATE_EXPECT=1 cargo test --test it file_map`.
#[test]
fn the_list_of_files_is_current() {
    let path = Path::new(REPOSITORY).join("ARCHITECTURE.md");
    let page = fs::read_to_string(&path).unwrap();
    let (before, _) = page.split_once(HEADING).unwrap();
    expect_test::expect_file![path].assert_eq(&format!("{before}{}", list()));
}

#[test]
fn the_first_sentence_is_found_in_each_language() {
    let rust = "//! Speeds of [`Body`](crate::Body),\n//! in m/s. And more.\n//!\n//! Details.\n";
    let python = "\"\"\"Speeds of bodies,\nin m/s.\n\nDetails.\"\"\"\n";
    let paper = "//! Speeds (Newton et al. 1687, Eq. 2), and why. More.\n";
    let script = "\"use strict\";\n/* Speeds. More. */\n";
    assert_eq!(
        first_sentence(rust, "rs").unwrap(),
        "Speeds of `Body`, in m/s"
    );
    assert_eq!(
        first_sentence(python, "py").unwrap(),
        "Speeds of bodies, in m/s"
    );
    assert_eq!(first_sentence(script, "js").unwrap(), "Speeds");
    assert_eq!(
        first_sentence(paper, "rs").unwrap(),
        "Speeds (Newton et al. 1687, Eq. 2), and why"
    );
    assert_eq!(first_sentence("fn main() {}\n", "rs"), None);
}
