//! Values that remember their place in a file.
//!
//! The values of a text are read in the same order each time, so that a value is identified by its *ordinal*: the number
//! of [`Located`] values that were read before it. `Located::deserialize` gets it from the deserializer of this crate. To
//! locate a validation error, the text is read again; the value with the error's ordinal then fails with the error's
//! message, and the deserializer reports that failure with place and field like any other. Unless there is an error, the
//! only cost is the ordinal that each value stores.

use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;
use std::ops::Deref;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use seedbed_settings::Tree;
use serde::de::{DeserializeOwned, Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::deserializer::{LOCATED, LocatedError, read};
use super::error::{InputError, Position};
use super::explanation::explained;
use super::former_names::FormerName;
use super::limits::short_list;
use super::names::{quoted_list, suggestion};

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

/// Maximum number of valid names that an error lists.
const MAX_LISTED_NAMES: usize = 40;

/// Number of names that are shown of more.
const SHOWN_NAMES: usize = 5;

impl<T> Document<T> {
    /// Turns an error about a value of this document into one with its position and field.
    #[must_use]
    pub fn locate(&self, error: ValidationError) -> InputError
    where
        T: DeserializeOwned,
    {
        let tree = Tree::parse_partly(&self.text);
        let message = &error.message;
        let located = error
            .ordinal
            .map(|ordinal| LocatedError { ordinal, message });
        match read::<T>(&tree, located) {
            Err(failure) => {
                let found = explained(&self.origin, &self.text, &failure);
                let moved = |place: Position| place.moved(error.within, &self.text);
                InputError {
                    help: error.help,
                    position: found.position.map(moved),
                    ..found
                }
            }
            // A default value has no place in the text.
            Ok(_) => InputError {
                origin: self.origin.clone(),
                position: None,
                field: String::new(),
                message: error.message,
                help: error.help,
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
        let count = valid.clone().into_iter().count();
        let expected = match count {
            0 => "there are none".to_owned(),
            1..=MAX_LISTED_NAMES => format!("expected one of {}", quoted_list(valid.clone())),
            _ => {
                let some = quoted_list(valid.clone().into_iter().take(SHOWN_NAMES));
                format!("expected one of {count} names, such as {some}")
            }
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

    /// The same error with a hint, if it has none.
    #[must_use]
    pub fn or_help(mut self, help: impl Into<String>) -> Self {
        self.help.get_or_insert_with(|| help.into());
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
        deserializer.deserialize_newtype_struct(LOCATED, LocatedVisitor(PhantomData))
    }
}

struct LocatedVisitor<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for LocatedVisitor<T> {
    type Value = Located<T>;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a value")
    }

    /// A value that this crate does not read, but for example from a checkpoint.
    fn visit_newtype_struct<D: Deserializer<'de>>(self, value: D) -> Result<Located<T>, D::Error> {
        T::deserialize(value).map(Located::from)
    }

    /// The value and its ordinal.
    fn visit_seq<A: SeqAccess<'de>>(self, mut parts: A) -> Result<Located<T>, A::Error> {
        let value = parts.next_element()?;
        let value = value.ok_or_else(|| A::Error::invalid_length(0, &self))?;
        let ordinal = parts.next_element()?;
        Ok(Located { value, ordinal })
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
