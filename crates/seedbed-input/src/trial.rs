//! What a type expects at a token that it refused: the text is read again with other tokens there.
//!
//! The parser knows neither the range of a whole number that it cannot hold, nor the field of one that it
//! stopped in. Trials with other tokens find both, for each type, and cost nothing without an error.

use std::ops::Range;

use serde::de::DeserializeOwned;

use super::parser::read;

/// A whole number that no type holds.
const TOO_LARGE: &str = "99999999999999999999999999999999999999999999999999";

/// The largest numbers of types of whole numbers, the largest first.
const LARGEST: [i128; 8] = [
    u64::MAX as i128,
    i64::MAX as i128,
    u32::MAX as i128,
    i32::MAX as i128,
    u16::MAX as i128,
    i16::MAX as i128,
    u8::MAX as i128,
    i8::MAX as i128,
];

/// A field that expects a whole number.
pub(crate) struct WholeNumberField {
    /// Path of the field.
    pub(crate) field: String,
    /// What its type expects if it has a range of its own, for example `a whole number from 1 to 10`.
    pub(crate) own_range: Option<String>,
    /// What the bits of its type hold, for example `a whole number from 0 to 255`.
    pub(crate) bits: String,
}

impl WholeNumberField {
    /// The field of the whole number at `token`, the bytes of a number in the text of a `T`.
    pub(crate) fn of<T: DeserializeOwned>(text: &str, token: &Range<usize>) -> Option<Self> {
        let result_with = |token_text: &str| read::<T>(&replaced(text, token, token_text));
        let is_too_large = |number: &str| match result_with(number) {
            Err((error, field)) if is_out_of_bounds(&error) => Some(field),
            _ => None,
        };
        let field = is_too_large(TOO_LARGE)?;
        let is_held = |max: &i128| is_too_large(&max.to_string()).is_none();
        let max = LARGEST.into_iter().find(is_held)?;
        let own_range = match result_with(&max.to_string()) {
            Err((error, place)) if place == field => range_in(&error.code.to_string()),
            _ => None,
        };
        let min = if is_too_large("-1").is_some() {
            0
        } else {
            -max - 1
        };
        let bits = format!("a whole number from {min} to {max}");
        Some(Self {
            field,
            own_range,
            bits,
        })
    }
}

/// What is meant by a name in quotes, at `token`, where the name of a variant is expected.
pub(crate) enum Unquoted {
    /// The variant, as it is written.
    Variant(String),
    /// No variant has this name; these are all.
    Unknown(&'static [&'static str]),
}

impl Unquoted {
    pub(crate) fn of<T: DeserializeOwned>(text: &str, token: &Range<usize>, name: &str) -> Self {
        use ron::Error::{
            ExpectedNamedStructLike, ExpectedStructLike, MissingStructField, NoSuchEnumVariant,
        };
        let error_with = |written: &str| {
            let again = read::<T>(&replaced(text, token, written));
            again.err().map(|(error, _)| error.code)
        };
        let with_fields = format!("{name}()");
        match error_with(name) {
            Some(NoSuchEnumVariant {
                expected, found, ..
            }) if found == name => Self::Unknown(expected),
            Some(ExpectedStructLike | ExpectedNamedStructLike(_)) => {
                match error_with(&with_fields) {
                    Some(MissingStructField { .. }) => Self::Variant(format!("{name}(…)")),
                    _ => Self::Variant(with_fields),
                }
            }
            _ => Self::Variant(name.to_owned()),
        }
    }
}

/// The text with another token.
fn replaced(text: &str, token: &Range<usize>, other: &str) -> String {
    [&text[..token.start], other, &text[token.end..]].concat()
}

fn is_out_of_bounds(error: &ron::error::SpannedError) -> bool {
    error.code == ron::Error::IntegerOutOfBounds
}

/// The range in a message such as `expected a whole number from 1 to 10, found 11`.
fn range_in(message: &str) -> Option<String> {
    let rest = message.strip_prefix("expected ")?;
    rest.split_once(", found ")
        .map(|(range, _)| range.to_owned())
}
