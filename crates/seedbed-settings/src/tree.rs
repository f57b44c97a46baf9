//! The tree of a RON text.

use std::borrow::Cow;
use std::fmt;
use std::ops::Range;

/// A RON text as a tree. Names and values are parts of the text.
#[derive(Clone, Debug, PartialEq)]
pub struct Tree<'a> {
    /// The text.
    pub text: &'a str,
    /// The value of the whole text, as far as it was read.
    pub root: Node<'a>,
    /// What is wrong with the text. There, the tree ends.
    pub error: Option<Malformed>,
}

/// A value and its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Node<'a> {
    /// Bytes of the text, without spaces and comments around the value.
    pub place: Range<usize>,
    /// The value.
    pub value: Value<'a>,
}

/// A value. Whether it is a struct, a variant or an optional value is not known from a text.
#[derive(Clone, Debug, PartialEq)]
pub enum Value<'a> {
    /// What begins like a number, as it is written: `1.50`, `-inf`, `0x1f` or `2x`.
    Number(&'a str),
    /// `'a'`
    Character(char),
    /// A text, without quotes and escapes.
    Text(Cow<'a, str>),
    /// A name alone: `Name`, `true`, `inf`.
    Name(&'a str),
    /// `[a, b]`
    List(Vec<Node<'a>>),
    /// `{a: b}`: keys and values.
    Map(Vec<(Node<'a>, Node<'a>)>),
    /// `(field: a)` or `Name(field: a)`.
    Record {
        /// Name before the parenthesis.
        name: Option<&'a str>,
        /// Fields in the order of the text.
        fields: Vec<Field<'a>>,
    },
    /// `Name(a, b)`, `(a, b)` or `()`.
    Tuple {
        /// Name before the parenthesis.
        name: Option<&'a str>,
        /// Values in the parenthesis.
        items: Vec<Node<'a>>,
    },
    /// What is wrong with the text, in place of the value that cannot be read.
    Malformed(Malformed),
}

/// A field of a record.
#[derive(Clone, Debug, PartialEq)]
pub struct Field<'a> {
    /// Its name.
    pub name: &'a str,
    /// Bytes of its name.
    pub place: Range<usize>,
    /// Its value.
    pub value: Node<'a>,
}

/// Error: a text is no RON.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected {expected} at byte {at}")]
pub struct Malformed {
    /// Byte at which it is wrong.
    pub at: usize,
    /// What was expected there.
    pub expected: Expected,
}

/// What is expected in a RON text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Expected {
    /// `#![enable(…)]`
    Attribute,
    /// What follows a quotation mark `'`.
    Character,
    /// The colon after a name or a key.
    Colon,
    /// The comma after a value, or the bracket after all values.
    Comma,
    /// The end of a comment.
    EndOfComment,
    /// The quotation mark after a text.
    EndOfQuotes,
    /// The end of the whole text.
    EndOfText,
    /// What follows a backslash.
    Escape,
    /// Fewer brackets within each other.
    FewerBrackets,
    /// The name of a field or a variant.
    Name,
    /// A value.
    Value,
}

impl fmt::Display for Expected {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Attribute => "`#![enable(…)]`",
            Self::Character => "one character in single quotes",
            Self::Colon => "a colon",
            Self::Comma => "a comma or the end of the list of fields",
            Self::EndOfComment => "the end of a comment",
            Self::EndOfQuotes => "the end of a text in quotes",
            Self::EndOfText => "the end of the whole text",
            Self::Escape => {
                "one of `\\n`, `\\r`, `\\t`, `\\0`, `\\\\`, `\\\"`, `\\'`, `\\x41` and `\\u{e9}`"
            }
            Self::FewerBrackets => "fewer brackets within each other",
            Self::Name => "the name of a field or of a variant",
            Self::Value => "a value",
        })
    }
}

impl<'a> Node<'a> {
    /// Its fields, if it is a record, or the one value of a `Some(…)` or another name that is a record.
    #[must_use]
    pub fn fields(&self) -> &[Field<'a>] {
        match &self.value {
            Value::Record { fields, .. } => fields,
            Value::Tuple {
                name: Some(_),
                items,
            } if items.len() == 1 => items[0].fields(),
            _ => &[],
        }
    }

    /// The name before its parenthesis, or the name alone.
    #[must_use]
    pub fn name(&self) -> Option<&'a str> {
        match &self.value {
            Value::Record { name, .. } | Value::Tuple { name, .. } => *name,
            Value::Name(name) => Some(name),
            _ => None,
        }
    }

    /// What is wrong with the text, if it cannot be read from here on.
    #[must_use]
    pub fn malformed(&self) -> Option<Malformed> {
        match self.value {
            Value::Malformed(malformed) => Some(malformed),
            _ => None,
        }
    }
}
