//! The kind of a file, which its first word names.

use super::error::{InputError, error_at};
use super::names::suggestion;

/// The kind of a file, which its first word names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// `Environment(…)`
    Environment,
    /// `TabularEnvironment(…)`
    TabularEnvironment,
    /// `Gymnasium(…)`
    Gymnasium,
    /// `Scenario(…)`
    Scenario,
    /// `TabularScenario(…)`
    TabularScenario,
    /// `Study(…)`
    Study,
    /// `Tuning(…)`
    Tuning,
}

impl FileKind {
    /// All kinds.
    pub const ALL: [Self; 7] = [
        Self::Environment,
        Self::TabularEnvironment,
        Self::Gymnasium,
        Self::Scenario,
        Self::TabularScenario,
        Self::Study,
        Self::Tuning,
    ];

    /// The word with which files of this kind begin.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Environment => "Environment",
            Self::TabularEnvironment => "TabularEnvironment",
            Self::Gymnasium => "Gymnasium",
            Self::Scenario => "Scenario",
            Self::TabularScenario => "TabularScenario",
            Self::Study => "Study",
            Self::Tuning => "Tuning",
        }
    }
}

/// The kind of a file, which the first word of its text names.
///
/// # Errors
/// The text begins with something else.
pub fn file_kind(origin: &str, text: &str) -> Result<FileKind, InputError> {
    let word = first_word(text);
    if let Some(kind) = FileKind::ALL.into_iter().find(|kind| kind.name() == word) {
        return Ok(kind);
    }
    let offset = offset_of(word, text);
    let begins_with = text[offset..].split_whitespace().next();
    let found = match begins_with {
        None => "it is empty".to_owned(),
        Some(opening) => {
            let shown: String = opening
                .chars()
                .take(40)
                .flat_map(char::escape_debug)
                .collect();
            format!("it begins with `{shown}`")
        }
    };
    let kinds = FileKind::ALL.map(|kind| format!("`{}(`", kind.name()));
    let message = format!(
        "expected a file that begins with {}, but {found}",
        one_of(&kinds)
    );
    let help = begins_with
        .and_then(foreign_beginning)
        .or_else(|| suggestion(word, FileKind::ALL.map(FileKind::name)));
    let mut error = error_at(origin, text, offset, "", message, help);
    if begins_with.is_none() {
        error.position = None;
    }
    Err(error)
}

/// What to write in place of the beginning of a file in another language.
fn foreign_beginning(opening: &str) -> Option<String> {
    let help = match opening.chars().next()? {
        '#' => "`#` does not begin a comment: write `// …`",
        '{' | '(' | '[' => "a file begins with the word for its kind: `Scenario(environment: …)`",
        '"' | '\'' => "names of fields have no quotes: `Scenario(environment: …)`",
        _ if opening.ends_with(':') && !opening.contains('(') => {
            "fields are in parentheses after the word for the kind of file: \
             `Scenario(environment: …)`"
        }
        _ => return None,
    };
    Some(help.to_owned())
}

/// The names as a list in words, `a, b or c`, without adding quotes.
fn one_of(names: &[String]) -> String {
    match names {
        [first @ .., last] if !first.is_empty() => format!("{} or {last}", first.join(", ")),
        _ => names.concat(),
    }
}

/// The byte offset of `part`, which is a slice of `text`.
fn offset_of(part: &str, text: &str) -> usize {
    part.as_ptr() as usize - text.as_ptr() as usize
}

/// Length of the comment with which `text` begins; `None` if it does not end. Block comments nest.
#[must_use]
pub fn block_comment_length(text: &str) -> Option<usize> {
    let (mut depth, mut at) = (0, 0);
    loop {
        let rest = text.get(at..)?;
        let (open, close) = (rest.find("/*"), rest.find("*/")?);
        match open {
            Some(open) if open < close => (depth, at) = (depth + 1, at + open + 2),
            _ if depth == 1 => return Some(at + close + 2),
            _ => (depth, at) = (depth - 1, at + close + 2),
        }
    }
}

/// The first word behind comments and attributes. It is a slice of `text`, even if it is empty.
fn first_word(text: &str) -> &str {
    let mut rest = text.trim_start();
    loop {
        let skipped = if let Some(comment) = rest.strip_prefix("//") {
            &comment[comment.find('\n').unwrap_or(comment.len())..]
        } else if rest.starts_with("/*") {
            &rest[block_comment_length(rest).unwrap_or(rest.len())..]
        } else if let Some(attribute) = rest.strip_prefix("#!") {
            &attribute[attribute.find(']').map_or(attribute.len(), |end| end + 1)..]
        } else {
            break;
        };
        rest = skipped.trim_start();
    }
    let end = rest
        .find(|c: char| !c.is_alphanumeric() && c != '_')
        .unwrap_or(rest.len());
    &rest[..end]
}
