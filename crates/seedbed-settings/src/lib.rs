//! Settings in RON as trees of values that know their places in the text.
//!
//! A [`Tree`] is read from any valid RON text, without knowing its types. [`Settings`] are what makes a tree
//! different from its defaults; they identify it, and say in what two trees differ. [`replace`] changes one value of
//! a text and leaves the rest as it is.

#![forbid(unsafe_code)]

mod parser;
mod replace;
mod settings;
mod tree;

pub use parser::MAX_NESTING;
pub use replace::{UnknownField, opening, replace};
pub use settings::{Difference, SCHEMA_VERSION, Settings, sha256};
pub use tree::{Expected, Field, Malformed, Node, Tree, Value};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
