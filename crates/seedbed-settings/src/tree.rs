//! The tree of a RON text.

use std::ops::Range;

/// A RON text as a tree.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tree {
    /// The value of the whole text.
    pub root: Node,
}

/// A value and its place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Node {
    /// Bytes of the text, without spaces and comments around the value.
    pub place: Range<usize>,
    /// The value.
    pub value: Value,
}

/// A value. Whether it is a struct, a variant or an optional value is not known from a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Value {
    /// A number, `true`, `false` or a character, written in one way: `1.50`, `1.5` and `15e-1` are all `1.5`.
    Scalar(String),
    /// A text, without quotes and escapes.
    Text(String),
    /// `[a, b]`
    List(Vec<Node>),
    /// `{a: b}`: keys and values.
    Map(Vec<(Node, Node)>),
    /// `(field: a)` or `Name(field: a)`.
    Record {
        /// Name before the parenthesis.
        name: Option<String>,
        /// Fields in the order of the text.
        fields: Vec<Field>,
    },
    /// `Name`, `Name(a, b)`, `(a, b)` or `()`.
    Tuple {
        /// Name before the parenthesis.
        name: Option<String>,
        /// Values in the parenthesis.
        items: Vec<Node>,
    },
}

/// A field of a record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: String,
    /// Bytes of the text from its name to its value, with the comma that follows.
    pub place: Range<usize>,
    /// Its value.
    pub value: Node,
}

/// Error: a text is no RON.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected {expected} at byte {at}")]
pub struct Malformed {
    /// Byte at which it is wrong.
    pub at: usize,
    /// What was expected there.
    pub expected: &'static str,
}

impl Node {
    /// Its fields, if it is a record, or the one value of a `Some(…)` or another name that is a record.
    #[must_use]
    pub fn fields(&self) -> &[Field] {
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
    pub fn name(&self) -> Option<&str> {
        match &self.value {
            Value::Record { name, .. } | Value::Tuple { name, .. } => name.as_deref(),
            _ => None,
        }
    }
}
