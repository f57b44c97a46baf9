//! Explains what is wrong with a value to people who write files.

use seedbed_settings::Expected;

use super::deserializer::{Failure, Problem, Type, word};
use super::error::{InputError, error_at};
use super::foreign;
use super::kind::FileKind;
use super::names::{quoted_list, shown, suggestion};

/// Beginning of the message about a name in quotes where a name without them is expected.
pub const NAME_IN_QUOTES: &str = "expected a name without quotes";

/// The error about a text that cannot be read.
pub(crate) fn explained(origin: &str, text: &str, failure: &Failure) -> InputError {
    // At the end of a text, what is missing belongs behind the last value.
    let place = failure.place().unwrap_or_default();
    let place = place.min(text.trim_end().len());
    let (message, help) = message(text, place, failure.problem());
    let foreign = foreign::correct(text, place, failure.problem());
    let (place, message) = foreign.place_and_message.unwrap_or((place, message));
    let help = help.or(foreign.help);
    error_at(origin, text, place, &failure.field(), message, help)
}

/// What is wrong and what was expected, and a hint at what may have been meant.
fn message(text: &str, place: usize, problem: &Problem) -> (String, Option<String>) {
    let message = match problem {
        Problem::Syntax(expected) => syntax(text, place, *expected),
        Problem::WrongType(expected, found) => return wrong_type(expected, found.as_deref()),
        Problem::OutOfBounds { expected, found } => {
            format!("expected {expected}, found {}", shown(found))
        }
        Problem::InQuotes { found, written } => {
            let message = format!("{}, found `{}`", NAME_IN_QUOTES, shown(found));
            return (message, Some(format!("write `{written}`")));
        }
        Problem::WithParentheses(name) => {
            let message = "expected a name without parentheses".to_owned();
            return (
                message,
                Some(format!("write `{}` without parentheses", shown(name))),
            );
        }
        Problem::TooMany => "expected a closing bracket".to_owned(),
        Problem::OtherName { expected, found } => {
            let message = format!("expected struct `{expected}` but found `{found}`");
            return (message, command_for(found).map(str::to_owned));
        }
        Problem::UnknownField { expected, found } => {
            return unexpected_name("field", found, expected);
        }
        Problem::UnknownVariant { expected, found } => {
            return unexpected_name("variant", found, expected);
        }
        Problem::MissingField(field) => format!("missing field `{field}`"),
        Problem::DuplicateField(field) => format!("field `{field}` is given twice"),
        Problem::WrongLength { expected, found } => format!("expected {expected}, found {found}"),
        Problem::WrongValue { expected, found } => format!("expected {expected}, found {found}"),
        Problem::Message(message) => message.clone(),
    };
    (message, None)
}

/// The command for a file of another kind.
fn command_for(kind: &str) -> Option<&'static str> {
    match kind {
        "Scenario" => Some("this is a scenario: `seedbed run FILE`"),
        "Study" => Some("this is a study: `seedbed study FILE`"),
        "Environment" => Some("this is a task: `seedbed preview FILE`"),
        "Tuning" => Some("this is a tuning: `seedbed tune FILE`"),
        _ => None,
    }
}

fn syntax(text: &str, place: usize, expected: Expected) -> String {
    match expected {
        Expected::EndOfComment => "unclosed block comment".to_owned(),
        Expected::EndOfText => "unexpected text after the end of the value".to_owned(),
        Expected::EndOfQuotes => "this text has no closing quote `\"`".to_owned(),
        Expected::Name => expected_name(&word(&text[place..])),
        _ => format!("expected {expected}"),
    }
}

fn wrong_type(expected: &Type, found: Option<&str>) -> (String, Option<String>) {
    let message = match (expected, found) {
        (Type::WholeNumber(range), Some(found)) => {
            let number: Option<f64> = found.replace('_', "").parse().ok();
            let whole = number.filter(|number| number.fract() == 0.0 && number.abs() < 1e15);
            let range = range.as_deref().unwrap_or("a whole number");
            let message = format!("expected {range}, found `{}`", shown(found));
            return (message, whole.map(|whole| format!("write `{whole:.0}`")));
        }
        (Type::WholeNumber(_), None) => "expected a whole number",
        (Type::Boolean, _) => "expected `true` or `false`",
        (Type::Number, _) => "expected a number",
        (Type::Character, _) => "expected one character in single quotes",
        (Type::Text, _) => "expected text in quotes",
        (Type::List, _) => "expected opening `[`",
        (Type::Map, _) => "expected opening `{`",
        (Type::Struct(""), _) => "expected opening `(`",
        (Type::Struct(name), _) if FileKind::ALL.iter().any(|kind| kind.name() == *name) => {
            return (format!("expected opening `(` for struct `{name}`"), None);
        }
        (Type::Struct(_), _) => "expected fields in parentheses: `(field: value, …)`",
        (Type::Unnamed, _) => "expected values without names of fields",
        (Type::Unit, _) => "expected `()`",
        (Type::Name, found) => return (expected_name(found.unwrap_or_default()), None),
    };
    (message.to_owned(), None)
}

fn expected_name(found: &str) -> String {
    let found = if found.is_empty() {
        String::new()
    } else {
        format!(", found `{}`", shown(found))
    };
    format!("expected the name of a field or of a variant{found}")
}

fn unexpected_name(what: &str, found: &str, expected: &[&str]) -> (String, Option<String>) {
    let names = quoted_list(expected.iter().copied());
    // `InputError::unexpected_field` reads the name of a field in this message.
    let message = format!("unexpected {what} `{found}`, expected one of {names}");
    (message, suggestion(found, expected.iter().copied()))
}
