//! Explains errors of the RON parser to people who write files.

use super::error::Position;
use super::kind::FileKind;
use super::names::{quoted_list, suggestion};

/// The message (what is wrong and what was expected), and a hint at what may have been meant.
pub(crate) fn explain(error: &ron::Error, at: &Position) -> (String, Option<String>) {
    let message = match error {
        ron::Error::NoSuchStructField {
            expected, found, ..
        } => return unexpected_name("field", found, expected),
        ron::Error::NoSuchEnumVariant {
            expected, found, ..
        } => return unexpected_name("variant", found, expected),
        ron::Error::MissingStructField { field, .. } => format!("missing field `{field}`"),
        ron::Error::DuplicateStructField { field, .. } => {
            format!("field `{field}` is given twice")
        }
        ron::Error::ExpectedInteger | ron::Error::InvalidIntegerDigit { .. } => {
            "expected a whole number".to_owned()
        }
        ron::Error::ExpectedFloat => "expected a number".to_owned(),
        ron::Error::ExpectedComma | ron::Error::ExpectedStructLikeEnd
            if stopped_at_decimal_point(at) =>
        {
            "expected a whole number, found a fraction".to_owned()
        }
        ron::Error::ExpectedNamedStructLike(name)
            if !FileKind::ALL.iter().any(|kind| kind.name() == *name) =>
        {
            "expected fields in parentheses: `(field: value, …)`".to_owned()
        }
        ron::Error::ExpectedComma => "expected a comma or the end of the list of fields".to_owned(),
        ron::Error::ExpectedString => "expected text in quotes".to_owned(),
        ron::Error::ExpectedIdentifier => "expected the name of a field or of a variant".to_owned(),
        ron::Error::InvalidIdentifier(found) | ron::Error::SuggestRawIdentifier(found) => {
            format!("expected the name of a field or of a variant, found `{found}`")
        }
        ron::Error::TrailingCharacters => "unexpected text after the end of the value".to_owned(),
        ron::Error::IntegerOutOfBounds => "the whole number is too large or negative".to_owned(),
        other => lowercased(&other.to_string()),
    };
    (message, None)
}

pub(crate) fn unexpected_name(
    what: &str,
    found: &str,
    expected: &[&str],
) -> (String, Option<String>) {
    let names = quoted_list(expected.iter().copied());
    // `InputError::unexpected_field` reads the name of a field in this message.
    let message = format!("unexpected {what} `{found}`, expected one of {names}");
    (message, suggestion(found, expected.iter().copied()))
}

/// Whether the parser has stopped at a decimal point, because it expected a whole number.
fn stopped_at_decimal_point(at: &Position) -> bool {
    let mut around = at.text.chars().skip(at.column.saturating_sub(2));
    around.next().is_some_and(|c| c.is_ascii_digit()) && around.next() == Some('.')
}

fn lowercased(sentence: &str) -> String {
    let mut characters = sentence.chars();
    characters.next().map_or_else(String::new, |first| {
        first.to_lowercase().chain(characters).collect()
    })
}
