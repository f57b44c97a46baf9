//! Values that are written as one token.

use std::borrow::Cow;

use seedbed_settings::Value;

use super::Reader;
use super::failure::{Failure, Problem, Type};

impl<'t> Reader<'t> {
    pub(super) fn boolean(self) -> Result<bool, Failure> {
        let reader = self.single(Type::Boolean)?;
        match reader.node.value {
            Value::Name("true") => Ok(true),
            Value::Name("false") => Ok(false),
            _ => Err(reader.expected(Type::Boolean)),
        }
    }

    pub(super) fn character(self) -> Result<char, Failure> {
        let reader = self.single(Type::Character)?;
        match reader.node.value {
            Value::Character(character) => Ok(character),
            _ => Err(reader.expected(Type::Character)),
        }
    }

    pub(super) fn text(self) -> Result<&'t Cow<'t, str>, Failure> {
        let reader = self.single(Type::Text)?;
        match &reader.node.value {
            Value::Text(text) => Ok(text),
            _ => Err(reader.expected(Type::Text)),
        }
    }

    pub(super) fn name(self) -> Result<&'t str, Failure> {
        match self.node.value {
            Value::Name(name) => Ok(name),
            _ => Err(self.expected(Type::Name)),
        }
    }

    pub(super) fn number<N: Default + std::str::FromStr>(self) -> Result<N, Failure> {
        let reader = self.single(Type::Number)?;
        let number = match reader.node.value {
            Value::Name(token @ ("inf" | "NaN")) => token.parse().ok(),
            Value::Number(token) => float(token),
            _ => None,
        };
        number.ok_or_else(|| reader.expected(Type::Number))
    }

    /// The whole number; the largest one of its type if it has no other, which is an error.
    pub(super) fn whole_number<N: WholeNumber>(self) -> Result<N, Failure> {
        let reader = self.single(Type::WholeNumber(None))?;
        let number = reader.whole()?;
        let number = number.and_then(|number| N::try_from(number).ok());
        Ok(number.unwrap_or_else(|| reader.refuse_number(N::MIN, N::MAX)))
    }

    fn whole(self) -> Result<Option<i128>, Failure> {
        match self.node.value {
            Value::Number(token) => Ok(whole(token).and_then(Result::ok)),
            _ => Err(self.expected(Type::WholeNumber(None))),
        }
    }

    fn refuse_number<N: Copy + std::fmt::Display>(self, min: N, max: N) -> N {
        let found = self.found().unwrap_or_default();
        let problem = match whole(&found) {
            None => Problem::WrongType(Type::WholeNumber(None), Some(found)),
            Some(_) => Problem::OutOfBounds {
                expected: format!("a whole number from {min} to {max}"),
                found,
            },
        };
        self.context
            .refused_number
            .replace(Some(self.failure(problem)));
        max
    }
}

/// A type of whole numbers.
pub(super) trait WholeNumber: TryFrom<i128> + Copy + std::fmt::Display {
    const MIN: Self;
    const MAX: Self;
}

macro_rules! whole_numbers {
    ($($type:ident)*) => {
        $(impl WholeNumber for $type {
            const MIN: Self = $type::MIN;
            const MAX: Self = $type::MAX;
        })*
    };
}

whole_numbers!(i8 i16 i32 i64 u8 u16 u32 u64);

/// The whole number that is written as `token`; an error if it is too large for all types, `None` if it is no whole
/// number.
pub(super) fn whole(token: &str) -> Option<Result<i128, std::num::ParseIntError>> {
    let unsigned = token.strip_prefix(['+', '-']).unwrap_or(token);
    let bases = [("0x", 16), ("0o", 8), ("0b", 2)];
    let with_base = bases.into_iter().find_map(|(prefix, base)| {
        let digits = unsigned.strip_prefix(prefix)?;
        Some((digits, base))
    });
    let (digits, base) = with_base.unwrap_or((unsigned, 10));
    let is_whole = digits.chars().all(|c| c.is_digit(base) || c == '_');
    if !is_whole || digits.is_empty() || digits.starts_with('_') {
        return None;
    }
    if base == 10 && !token.contains('_') {
        return Some(token.parse());
    }
    let sign = if token.starts_with('-') { "-" } else { "" };
    let plain = format!("{sign}{}", digits.replace('_', ""));
    Some(i128::from_str_radix(&plain, base))
}

fn float<N: std::str::FromStr>(token: &str) -> Option<N> {
    let unsigned = token.trim_start_matches(['+', '-']);
    let is_number = unsigned.starts_with(|c: char| c.is_ascii_digit() || c == '.');
    if !is_number && unsigned != "inf" && unsigned != "NaN" {
        return None;
    }
    if token.contains('_') {
        return token.replace('_', "").parse().ok();
    }
    token.parse().ok()
}
