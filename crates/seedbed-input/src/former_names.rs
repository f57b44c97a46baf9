//! Former names of fields, which are read for one more version.

use std::ops::Range;

/// Names of fields that were renamed, each with the former one. Digests of settings have the former names, so that
/// they are those of published results.
pub const FORMER_NAMES: [(&str, &str); 7] = [
    ("color", "colour"),
    ("optimizer", "optimiser"),
    ("policy_optimizer", "policy_optimiser"),
    ("randomized", "randomised"),
    ("regularization", "regularisation"),
    ("standardize", "standardise"),
    ("value_optimizer", "value_optimiser"),
];

/// A field of a text that has its former name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FormerName {
    /// The name in the text.
    pub former: &'static str,
    /// The name of today.
    pub new: &'static str,
    /// Line, counted from 1.
    pub line: usize,
    /// Where the former name begins, in bytes.
    start: usize,
}

/// The fields of a RON text that have former names, in their order.
#[must_use]
pub fn former_names_in(text: &str) -> Vec<FormerName> {
    let mut found = Vec::new();
    for range in names_of_fields(text) {
        if let Some((new, former)) = renamed(&text[range.clone()]) {
            found.push(FormerName {
                former,
                new,
                line: text[..range.start].matches('\n').count() + 1,
                start: range.start,
            });
        }
    }
    found
}

/// A RON text with the names of today. All places in it are the same: a name that is shorter than the former one is
/// followed by spaces.
#[must_use]
pub(crate) fn with_new_names(mut text: String, former_names: &[FormerName]) -> String {
    for name in former_names {
        let padded = format!("{:width$}", name.new, width = name.former.len());
        text.replace_range(name.start..name.start + name.former.len(), &padded);
    }
    text
}

/// A path such as `algorithm.policy_optimiser.step_size` with the names of today.
#[must_use]
pub fn path_with_new_names(path: &str) -> String {
    let names = path.split('.');
    let new: Vec<&str> = names
        .map(|name| renamed(name).map_or(name, |(new, _)| new))
        .collect();
    new.join(".")
}

fn renamed(name: &str) -> Option<(&'static str, &'static str)> {
    let mut names = FORMER_NAMES.into_iter();
    names.find(|(_, former)| *former == name)
}

/// Where the names of fields are: identifiers before a colon, outside of texts in quotes and of comments.
fn names_of_fields(text: &str) -> Vec<Range<usize>> {
    let bytes = text.as_bytes();
    let is_of_name = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_';
    let mut names = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let rest = &text[at..];
        if let Some(length) = length_of_text_or_comment(rest) {
            at += length;
        } else if is_of_name(bytes[at]) {
            let length = bytes[at..]
                .iter()
                .take_while(|byte| is_of_name(**byte))
                .count();
            if text[at + length..].trim_start().starts_with(':') {
                names.push(at..at + length);
            }
            at += length;
        } else {
            at += rest.chars().next().map_or(1, char::len_utf8);
        }
    }
    names
}

/// Number of bytes of the text in quotes or of the comment with which `rest` begins; `None` if it begins with something else.
fn length_of_text_or_comment(rest: &str) -> Option<usize> {
    if rest.starts_with("//") {
        return Some(rest.find('\n').unwrap_or(rest.len()));
    }
    if rest.starts_with("/*") {
        return Some(crate::block_comment_length(rest).unwrap_or(rest.len()));
    }
    if let Some(raw) = rest.strip_prefix('r') {
        let marks = raw.bytes().take_while(|byte| *byte == b'#').count();
        if raw[marks..].starts_with('"') {
            let end = format!("\"{}", "#".repeat(marks));
            let start = 1 + marks + 1;
            let length = rest[start..].find(&end).map(|at| start + at + end.len());
            return Some(length.unwrap_or(rest.len()));
        }
    }
    rest.starts_with('"').then(|| length_of_quoted(rest))
}

/// Number of bytes of a text in quotes, with its quotation marks.
fn length_of_quoted(rest: &str) -> usize {
    let mut is_escaped = false;
    for (at, c) in rest.char_indices().skip(1) {
        match c {
            '"' if !is_escaped => return at + 1,
            '\\' => is_escaped = !is_escaped,
            _ => is_escaped = false,
        }
    }
    rest.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn former_names_of_fields_are_replaced_in_place() {
        let text = "(colour: 1, // colour: no\n a: \"optimiser: \\\" no\", b: r#\"standardise: \"no\"#, /* optimiser: no */ \
                    value_optimiser : (x: randomised), Colour: 2)";
        let expected = "(color : 1, // colour: no\n a: \"optimiser: \\\" no\", b: r#\"standardise: \"no\"#, /* optimiser: no */ \
                        value_optimizer : (x: randomised), Colour: 2)";
        let names = former_names_in(text);
        let found: Vec<(&str, usize)> = names.iter().map(|name| (name.new, name.line)).collect();
        assert_eq!(found, [("color", 1), ("value_optimizer", 2)]);
        assert_eq!(with_new_names(text.to_owned(), &names), expected);
    }

    #[test]
    fn broken_texts_are_read_to_their_end() {
        for text in ["\"", "r#\"", "/*", "//", "é:", "(a: \"\\"] {
            assert_eq!(former_names_in(text), []);
        }
    }

    #[test]
    fn paths_are_renamed() {
        let path = path_with_new_names("algorithm.policy_optimiser.step_size");
        assert_eq!(path, "algorithm.policy_optimizer.step_size");
    }

    /// Otherwise the places in a text would change.
    #[test]
    fn no_name_is_longer_than_the_former_one() {
        for (new, former) in FORMER_NAMES {
            assert!(new.len() <= former.len(), "{new}");
        }
    }
}
