//! What is wrong with a value: the problem, its place and its field.

use std::fmt::{self, Display};

use seedbed_settings::{Expected, Malformed};
use serde::de::{self, Unexpected};

/// What is wrong, where, and in which field.
#[derive(Debug)]
pub(crate) struct Failure(Box<Parts>);

#[derive(Debug)]
struct Parts {
    problem: Problem,
    /// Byte of the text; `None` until the value in which it is knows its place.
    place: Option<usize>,
    /// The path of the field, the innermost name first.
    path: Vec<String>,
}

/// What is wrong.
#[derive(Debug)]
pub(crate) enum Problem {
    /// The text is no RON.
    Syntax(Expected),
    /// Something else than a value of this type, with the number that was found.
    WrongType(Type, Option<String>),
    /// A whole number that the bits of its type cannot hold.
    OutOfBounds {
        expected: String,
        found: String,
    },
    /// A text in quotes in place of the variant that is written like this.
    InQuotes {
        found: String,
        written: String,
    },
    /// A variant without fields that has parentheses.
    WithParentheses(String),
    /// A value after the last one.
    TooMany,
    /// Another name before the parenthesis of a struct.
    OtherName {
        expected: &'static str,
        found: String,
    },
    UnknownField {
        expected: &'static [&'static str],
        found: String,
    },
    UnknownVariant {
        expected: &'static [&'static str],
        found: String,
    },
    MissingField(&'static str),
    DuplicateField(&'static str),
    /// A number of values that its type does not have.
    WrongLength {
        expected: String,
        found: usize,
    },
    /// A value that its type does not have.
    WrongValue {
        expected: String,
        found: String,
    },
    /// What a type says itself.
    Message(String),
}

/// What a value is expected to be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Type {
    Boolean,
    /// A whole number; what its type says of its range.
    WholeNumber(Option<String>),
    Number,
    Character,
    Text,
    List,
    Map,
    /// Fields or values in parentheses, after this name or none.
    Struct(&'static str),
    /// Values without names of fields.
    Unnamed,
    Unit,
    /// The name of a field or a variant.
    Name,
}

impl Failure {
    fn new(problem: Problem, place: Option<usize>) -> Self {
        Self(Box::new(Parts {
            problem,
            place,
            path: Vec::new(),
        }))
    }

    pub(super) fn at(place: usize, problem: Problem) -> Self {
        Self::new(problem, Some(place))
    }

    pub(super) fn malformed(malformed: Malformed) -> Self {
        Self::at(malformed.at, Problem::Syntax(malformed.expected))
    }

    pub(crate) fn problem(&self) -> &Problem {
        &self.0.problem
    }

    pub(crate) fn place(&self) -> Option<usize> {
        self.0.place
    }

    pub(super) fn set_place(&mut self, place: usize) {
        self.0.place = Some(place);
    }

    /// For example `bodies[0].mass`.
    pub(crate) fn field(&self) -> String {
        let names: String = self.0.path.iter().rev().map(String::as_str).collect();
        names.trim_start_matches('.').to_owned()
    }

    /// The same in an entry of a list.
    pub(super) fn in_item(mut self, index: usize) -> Self {
        self.0.path.push(format!("[{index}]"));
        self
    }

    /// The same in a field or a variant.
    pub(super) fn in_field(mut self, name: &str) -> Self {
        self.0.path.push(format!(".{name}"));
        self
    }

    /// This error about a whole number, with the range that its type expects, as it says in a message such as `expected a
    /// whole number from 1 to 10, found 11`.
    pub(super) fn with_range_of(mut self, other: &Self) -> Self {
        let message = match &other.0.problem {
            Problem::Message(message) => message.strip_prefix("expected "),
            _ => None,
        };
        let Some((range, _)) = message.and_then(|message| message.split_once(", found ")) else {
            return self;
        };
        match &mut self.0.problem {
            Problem::WrongType(Type::WholeNumber(own_range), _) => {
                *own_range = Some(range.to_owned());
            }
            Problem::OutOfBounds { expected, .. } => range.clone_into(expected),
            _ => {}
        }
        self
    }
}

impl Display for Failure {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:?}", self.0.problem)
    }
}

impl std::error::Error for Failure {}

impl de::Error for Failure {
    fn custom<M: Display>(message: M) -> Self {
        Self::new(Problem::Message(message.to_string()), None)
    }

    fn invalid_type(found: Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        Self::invalid_value(found, expected)
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        let problem = Problem::WrongValue {
            expected: expected.to_string(),
            found: in_words(found),
        };
        Self::new(problem, None)
    }

    fn invalid_length(found: usize, expected: &dyn de::Expected) -> Self {
        let expected = expected.to_string();
        Self::new(Problem::WrongLength { expected, found }, None)
    }

    fn unknown_variant(found: &str, expected: &'static [&'static str]) -> Self {
        let found = found.to_owned();
        Self::new(Problem::UnknownVariant { expected, found }, None)
    }

    fn unknown_field(found: &str, expected: &'static [&'static str]) -> Self {
        let found = found.to_owned();
        Self::new(Problem::UnknownField { expected, found }, None)
    }

    fn missing_field(field: &'static str) -> Self {
        Self::new(Problem::MissingField(field), None)
    }

    fn duplicate_field(field: &'static str) -> Self {
        Self::new(Problem::DuplicateField(field), None)
    }
}

/// For example ``the boolean `true` ``.
fn in_words(found: Unexpected<'_>) -> String {
    match found {
        Unexpected::Bool(found) => format!("the boolean `{found}`"),
        Unexpected::Unsigned(found) => format!("the number `{found}`"),
        Unexpected::Signed(found) => format!("the number `{found}`"),
        Unexpected::Float(found) => format!("the number `{found}`"),
        Unexpected::Char(found) => format!("the character `{found}`"),
        Unexpected::Str(found) => format!("the text {found:?}"),
        Unexpected::Seq => "a list".to_owned(),
        Unexpected::Unit => "nothing".to_owned(),
        Unexpected::Option => "an optional value".to_owned(),
        other => other.to_string(),
    }
}
