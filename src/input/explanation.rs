//! What the RON parser complains about, in the words of whoever writes a file.

use super::{Position, listed, nearest};

/// Structs whose names people write: those that files open with.
const KINDS: [&str; 5] = [
    "Scenario",
    "Environment",
    "TabularScenario",
    "TabularEnvironment",
    "Study",
];

/// What is wrong and what was expected, and what may have been meant.
pub(super) fn explain(error: &ron::Error, at: &Position) -> (String, Option<String>) {
    let message = match error {
        ron::Error::NoSuchStructField {
            expected, found, ..
        } => {
            let help = suggestion(found, expected.iter().copied());
            return (
                format!(
                    "unexpected field `{found}`, expected one of {}",
                    listed(expected.iter().copied())
                ),
                help,
            );
        }
        ron::Error::NoSuchEnumVariant {
            expected, found, ..
        } => {
            let help = suggestion(found, expected.iter().copied());
            return (
                format!(
                    "unexpected variant `{found}`, expected one of {}",
                    listed(expected.iter().copied())
                ),
                help,
            );
        }
        ron::Error::MissingStructField { field, .. } => format!("missing field `{field}`"),
        ron::Error::DuplicateStructField { field, .. } => {
            format!("field `{field}` stands here twice")
        }
        ron::Error::ExpectedInteger | ron::Error::InvalidIntegerDigit { .. } => {
            "expected a whole number".to_owned()
        }
        ron::Error::ExpectedFloat => "expected a number".to_owned(),
        ron::Error::ExpectedComma | ron::Error::ExpectedStructLikeEnd if splits_number(at) => {
            "expected a whole number, found a fraction".to_owned()
        }
        ron::Error::ExpectedNamedStructLike(name) if !KINDS.contains(name) => {
            "expected fields in parentheses: `(field: value, …)`".to_owned()
        }
        ron::Error::ExpectedComma => "expected a comma or the end of the list of fields".to_owned(),
        ron::Error::ExpectedString => "expected a text in quotes".to_owned(),
        ron::Error::ExpectedIdentifier => "expected the name of a field or of a variant".to_owned(),
        ron::Error::InvalidIdentifier(found) | ron::Error::SuggestRawIdentifier(found) => {
            format!("expected the name of a field or of a variant, found `{found}`")
        }
        ron::Error::TrailingCharacters => "unexpected text after the end".to_owned(),
        ron::Error::IntegerOutOfBounds => "this whole number is too large or below zero".to_owned(),
        other => lowercased(&other.to_string()),
    };
    (message, None)
}

/// Whether the parser of whole numbers has stopped at a decimal point.
fn splits_number(at: &Position) -> bool {
    let mut around = at.text.chars().skip(at.column.saturating_sub(2));
    around.next().is_some_and(|c| c.is_ascii_digit()) && around.next() == Some('.')
}

fn lowercased(sentence: &str) -> String {
    let mut characters = sentence.chars();
    characters.next().map_or_else(String::new, |first| {
        first.to_lowercase().chain(characters).collect()
    })
}

pub(super) fn suggestion<'a>(
    found: &str,
    valid: impl IntoIterator<Item = &'a str>,
) -> Option<String> {
    nearest(found, valid).map(|name| format!("did you mean `{name}`?"))
}
