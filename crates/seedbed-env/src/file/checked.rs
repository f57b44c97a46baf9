//! Ranges, vectors and names that are checked while the file is read, so that an error points at
//! them.

use serde::Deserialize;

use super::{Control, DiscreteValues, Distribution};
use crate::expression::RESERVED_NAMES;
use seedbed_input::limits::MAX_NAME_BYTES;
use seedbed_input::numbers::{FiniteNumber, Positive, readable};

/// The whole numbers from one to another, with from < to. Both have a value in single precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WholeNumbers {
    from: i32,
    to: i32,
}

/// A point or vector of the plane, m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(try_from = "(f64, f64)")]
pub struct Vector([f64; 2]);

/// The direction of a nonzero vector.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "(f64, f64)")]
pub struct Direction([f64; 2]);

/// Red, green and blue, as `#rrggbb` with hexadecimal digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct HexColor([u8; 3]);

/// A name that formulas can use: letters, digits and `_`.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Name(String);

impl HexColor {
    /// Red, green and blue.
    #[must_use]
    pub fn get(self) -> [u8; 3] {
        self.0
    }
}

impl TryFrom<String> for HexColor {
    type Error = String;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        let digits = text.strip_prefix('#').filter(|digits| {
            digits.len() == 6 && digits.bytes().all(|digit| digit.is_ascii_hexdigit())
        });
        let number = digits.and_then(|digits| u32::from_str_radix(digits, 16).ok());
        let [_, channels @ ..] = number
            .ok_or_else(|| format!("expected a color such as \"#1f77b4\", found {text:?}"))?
            .to_be_bytes();
        Ok(Self(channels))
    }
}

impl WholeNumbers {
    /// First and last number.
    #[must_use]
    pub fn get(self) -> [i32; 2] {
        [self.from, self.to]
    }

    fn new(from: i64, to: i64) -> Result<Self, String> {
        /// All whole numbers up to this one have a value in single precision.
        const MAX: i64 = 1 << f32::MANTISSA_DIGITS;
        let number = |number: i64| match i32::try_from(number) {
            Ok(number) if i64::from(number).abs() <= MAX => Ok(number),
            _ => Err(format!(
                "expected whole numbers from -{MAX} to {MAX}, found {number}"
            )),
        };
        if from >= to {
            return Err(format!(
                "expected whole numbers with from < to, found from: {from}, to: {to}"
            ));
        }
        Ok(Self {
            from: number(from)?,
            to: number(to)?,
        })
    }
}

impl Vector {
    /// Components to the right and upwards.
    #[must_use]
    pub fn get(self) -> [f64; 2] {
        self.0
    }
}

impl Direction {
    /// The unit vector.
    #[must_use]
    pub fn get(self) -> [f64; 2] {
        self.0
    }
}

/// What is not checked yet, under the names of users, which errors have.
pub(super) mod unchecked {
    use super::{Deserialize, DiscreteValues, FiniteNumber, Positive};

    /// A control whose range is not checked yet.
    #[derive(Deserialize)]
    pub(in crate::file) enum Control {
        Discrete(DiscreteValues),
        Continuous(f64, f64),
    }

    /// A distribution whose range is not checked yet.
    #[derive(Deserialize)]
    pub(in crate::file) enum Distribution {
        Constant(FiniteNumber),
        Uniform(f64, f64),
        Normal(FiniteNumber, Positive),
        WholeNumber { from: i64, to: i64 },
    }
}

impl TryFrom<unchecked::Control> for Control {
    type Error = String;

    fn try_from(unchecked: unchecked::Control) -> Result<Self, String> {
        match unchecked {
            unchecked::Control::Discrete(values) => Ok(Self::Discrete(values)),
            unchecked::Control::Continuous(low, high) => {
                Ok(Self::Continuous((low, high).try_into()?))
            }
        }
    }
}

impl TryFrom<unchecked::Distribution> for Distribution {
    type Error = String;

    fn try_from(unchecked: unchecked::Distribution) -> Result<Self, String> {
        match unchecked {
            unchecked::Distribution::Constant(value) => Ok(Self::Constant(value)),
            unchecked::Distribution::Uniform(low, high) => {
                Ok(Self::Uniform((low, high).try_into()?))
            }
            unchecked::Distribution::Normal(mean, deviation) => Ok(Self::Normal(mean, deviation)),
            unchecked::Distribution::WholeNumber { from, to } => {
                Ok(Self::WholeNumber(WholeNumbers::new(from, to)?))
            }
        }
    }
}

impl TryFrom<(f64, f64)> for Vector {
    type Error = String;

    fn try_from((x, y): (f64, f64)) -> Result<Self, String> {
        if !x.is_finite() || !y.is_finite() {
            return Err(format!(
                "expected finite numbers, found ({}, {})",
                readable(x),
                readable(y)
            ));
        }
        // Physics runs in single precision.
        if [x, y]
            .iter()
            .any(|number| number.abs() > f64::from(f32::MAX))
        {
            return Err(format!(
                "the vector ({x:e}, {y:e}) does not fit into numbers of single precision"
            ));
        }
        Ok(Self([x, y]))
    }
}

impl TryFrom<(f64, f64)> for Direction {
    type Error = String;

    /// A vector along x or y becomes exactly ±1, because dividing it by its length could round.
    fn try_from((x, y): (f64, f64)) -> Result<Self, String> {
        let length = libm::hypot(x, y);
        match (x, y) {
            _ if !length.is_finite() || length == 0.0 => Err(format!(
                "expected a direction, a vector other than zero, found ({}, {})",
                readable(x),
                readable(y)
            )),
            (_, 0.0) => Ok(Self([x.signum(), 0.0])),
            (0.0, _) => Ok(Self([0.0, y.signum()])),
            _ => Ok(Self([x / length, y / length])),
        }
    }
}

impl TryFrom<String> for Name {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        if RESERVED_NAMES.contains(&text.as_str()) {
            return Err(format!(
                "`{text}` is reserved in formulas: choose another name"
            ));
        }
        if text.len() > MAX_NAME_BYTES {
            return Err(format!(
                "a name can have at most {MAX_NAME_BYTES} characters, this one has {}",
                text.len()
            ));
        }
        match syn::parse_str::<syn::Ident>(&text) {
            Ok(_) => Ok(Self(text)),
            Err(_) => Err(format!(
                "expected a name of letters, digits and `_` that is no reserved word, found `{text}`"
            )),
        }
    }
}

impl AsRef<str> for Name {
    fn as_ref(&self) -> &str {
        &self.0
    }
}
