//! Values that remember their place in a file.
//!
//! RON's deserializer does not pass positions on to values. But it reads the values of a text in
//! the same order each time, so that a value is identified by its *ordinal*: the number of
//! [`Located`] values that were read before it. `Located::deserialize` counts them in a
//! thread-local counter, because serde passes it only the deserializer. To locate a validation
//! error, the text is deserialized again; the value with the error's ordinal then fails with the
//! error's message, and the deserializer reports that failure with position and field path like any
//! other. Unless there is an error, the only cost is the ordinal that each value stores.

use std::borrow::Cow;
use std::cell::RefCell;
use std::fmt;
use std::ops::Deref;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::error::{InputError, position};
use super::explanation::explain;
use super::foreign;
use super::former_names::FormerName;
use super::limits::short_list;
use super::names::{quoted_list, suggestion};
use super::parser::read;

/// The text of a file together with the value that was read from it.
#[derive(Debug, Clone)]
pub struct Document<T> {
    /// The file, or another name for the origin of the text.
    pub origin: String,
    /// Text of the file, with the names of today.
    pub text: String,
    /// The value.
    pub value: T,
    /// Fields that have their former names in the file.
    pub former_names: Vec<FormerName>,
}

/// A value that remembers its place in its file.
#[derive(Clone, Copy, Default)]
pub struct Located<T> {
    value: T,
    ordinal: Option<u32>,
}

impl<T: JsonSchema> JsonSchema for Located<T> {
    fn inline_schema() -> bool {
        T::inline_schema()
    }

    fn schema_name() -> Cow<'static, str> {
        T::schema_name()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        T::json_schema(generator)
    }
}

/// An error about a [`Located`] value that is found after reading.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ValidationError {
    ordinal: Option<u32>,
    /// What is wrong, and what was expected.
    pub message: String,
    /// What may have been meant.
    pub help: Option<String>,
    /// Line and column within the value, both from 0.
    within: (usize, usize),
}

impl<T> Document<T> {
    /// Turns an error about a value of this document into one with its position and field.
    #[must_use]
    pub fn locate(&self, error: ValidationError) -> InputError
    where
        T: DeserializeOwned,
    {
        let help = error.help.clone();
        let message = error.message.clone();
        let within = error.within;
        match deserialize::<T>(&self.origin, &self.text, Some(error)) {
            Err(error) => InputError {
                help,
                position: error.position.map(|place| place.moved(within, &self.text)),
                ..error
            },
            // A default value has no place in the text.
            Ok(_) => InputError {
                origin: self.origin.clone(),
                position: None,
                field: String::new(),
                message,
                help,
            },
        }
    }
}

impl<T> Located<T> {
    /// An error about this value.
    #[must_use]
    pub fn error(&self, message: impl Into<String>) -> ValidationError {
        ValidationError {
            ordinal: self.ordinal,
            message: message.into(),
            help: None,
            within: (0, 0),
        }
    }

    /// Whether the value is in a file. A default value has no place.
    #[must_use]
    pub fn has_place(&self) -> bool {
        self.ordinal.is_some()
    }

    /// The value itself.
    #[must_use]
    pub fn value(&self) -> &T {
        &self.value
    }
}

impl<T: AsRef<str>> Located<T> {
    /// The error that this value names no `what`. It lists the `valid` names and
    /// suggests the most similar one.
    #[must_use]
    pub fn unknown_name<'a>(
        &self,
        what: &str,
        valid: impl IntoIterator<Item = &'a str> + Clone,
    ) -> ValidationError {
        let found = self.value.as_ref();
        let names = quoted_list(valid.clone());
        let expected = if names.is_empty() {
            "there are none".to_owned()
        } else {
            format!("expected one of {names}")
        };
        ValidationError {
            ordinal: self.ordinal,
            message: format!("no {what} is named `{found}`, {expected}"),
            help: suggestion(found, valid),
            within: (0, 0),
        }
    }
}

impl ValidationError {
    /// The same error about one character of the value, which is a string: `line` and `column`
    /// within it count from 0.
    #[must_use]
    pub fn at(mut self, line: usize, column: usize) -> Self {
        self.within = (line, column);
        self
    }

    /// The same error with a hint.
    #[must_use]
    pub fn with_help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

impl<T> Deref for Located<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T> From<T> for Located<T> {
    fn from(value: T) -> Self {
        Self {
            value,
            ordinal: None,
        }
    }
}

impl<T: fmt::Debug> fmt::Debug for Located<T> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.value.fmt(formatter)
    }
}

impl<T: PartialEq> PartialEq for Located<T> {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl<T: Serialize> Serialize for Located<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.value.serialize(serializer)
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Located<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = T::deserialize(deserializer)?;
        let ordinal = COUNTER.with_borrow_mut(|counter| {
            // The value is not read by this module, but for example from a checkpoint.
            let Some(counter) = counter else {
                return Ok(None);
            };
            let ordinal = counter.next;
            counter.next += 1;
            match counter
                .error
                .take_if(|error| error.ordinal == Some(ordinal))
            {
                Some(error) => Err(error.message),
                None => Ok(Some(ordinal)),
            }
        });
        Ok(Self {
            value,
            ordinal: ordinal.map_err(D::Error::custom)?,
        })
    }
}

/// Reads a list of at most [`MAX_ENTRIES`](super::limits::MAX_ENTRIES) entries, with its place:
/// `#[serde(deserialize_with = …)]`.
///
/// # Errors
/// The list is longer, or one of its entries is wrong.
pub fn short_located_list<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    deserializer: D,
) -> Result<Located<Vec<T>>, D::Error> {
    let Located { value, ordinal } = Located::<ShortList<T>>::deserialize(deserializer)?;
    Ok(Located {
        value: value.0,
        ordinal,
    })
}

struct ShortList<T>(Vec<T>);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for ShortList<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        short_list(deserializer).map(Self)
    }
}

thread_local! {
    static COUNTER: RefCell<Option<OrdinalCounter>> = const { RefCell::new(None) };
}

/// Counts the located values of the text that is being read, and fails at the one with an error.
struct OrdinalCounter {
    next: u32,
    error: Option<ValidationError>,
}

pub(crate) fn deserialize<T: DeserializeOwned>(
    origin: &str,
    text: &str,
    error: Option<ValidationError>,
) -> Result<T, InputError> {
    // A type's `Deserialize` may read another text, so that the outer counter is put back.
    let outer = COUNTER.replace(Some(OrdinalCounter { next: 0, error }));
    let result = deserialize_tracked(origin, text);
    COUNTER.set(outer);
    result
}

/// What a text is, without an explanation of what is wrong in it.
pub(crate) fn deserialize_silently<T: DeserializeOwned>(text: &str) -> Option<T> {
    read(text).ok()
}

fn deserialize_tracked<T: DeserializeOwned>(origin: &str, text: &str) -> Result<T, InputError> {
    read(text).map_err(|(spanned, field)| located_error::<T>(origin, text, &spanned, field))
}

fn located_error<T: DeserializeOwned>(
    origin: &str,
    text: &str,
    spanned: &ron::error::SpannedError,
    field: String,
) -> InputError {
    let position = position(text, spanned.span.start.line, spanned.span.start.col);
    let (message, help) = explain(&spanned.code, &position);
    let foreign = foreign::correct::<T>(text, &position, &spanned.code);
    InputError {
        origin: origin.to_owned(),
        position: Some(foreign.position.unwrap_or(position)),
        field: foreign.field.unwrap_or(field),
        message: foreign.message.unwrap_or(message),
        help: help.or(foreign.help),
    }
}
