//! Ranges, vectors and names that are checked while the file is read, so that an error points at them.

use serde::Deserialize;

use super::{Control, Distribution, Values};
use crate::env::expression::RESERVED;
use crate::input::numbers::{Finite, Positive};

/// A low and a higher end.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "(f64, f64)")]
pub struct Interval {
    low: f64,
    high: f64,
}

/// A point or vector of the plane, m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(try_from = "(f64, f64)")]
pub struct Vector([f64; 2]);

/// A vector that is not zero; only its direction counts.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "(f64, f64)")]
pub struct Direction([f64; 2]);

/// A word that formulas can use: letters, digits and `_`.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Name(String);

impl Interval {
    /// Low and high end.
    #[must_use]
    pub fn get(self) -> [f64; 2] {
        [self.low, self.high]
    }
}

impl Vector {
    /// Right and up.
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

impl TryFrom<(f64, f64)> for Interval {
    type Error = String;

    fn try_from((low, high): (f64, f64)) -> Result<Self, String> {
        if low < high && low.is_finite() && high.is_finite() {
            return Ok(Self { low, high });
        }
        Err(format!(
            "expected a low and a higher number, found ({low}, {high})"
        ))
    }
}

/// A control whose range is not checked yet.
#[derive(Deserialize)]
#[serde(rename = "Control")]
pub(super) enum AnyControl {
    Discrete(Values),
    Continuous(f64, f64),
}

/// A distribution whose range is not checked yet.
#[derive(Deserialize)]
#[serde(rename = "Distribution")]
pub(super) enum AnyDistribution {
    Constant(Finite),
    Uniform(f64, f64),
    Normal(Finite, Positive),
}

impl TryFrom<AnyControl> for Control {
    type Error = String;

    fn try_from(any: AnyControl) -> Result<Self, String> {
        match any {
            AnyControl::Discrete(values) => Ok(Self::Discrete(values)),
            AnyControl::Continuous(low, high) => Ok(Self::Continuous((low, high).try_into()?)),
        }
    }
}

impl TryFrom<AnyDistribution> for Distribution {
    type Error = String;

    fn try_from(any: AnyDistribution) -> Result<Self, String> {
        match any {
            AnyDistribution::Constant(value) => Ok(Self::Constant(value)),
            AnyDistribution::Uniform(low, high) => Ok(Self::Uniform((low, high).try_into()?)),
            AnyDistribution::Normal(mean, deviation) => Ok(Self::Normal(mean, deviation)),
        }
    }
}

impl TryFrom<(f64, f64)> for Vector {
    type Error = String;

    fn try_from((x, y): (f64, f64)) -> Result<Self, String> {
        if x.is_finite() && y.is_finite() {
            Ok(Self([x, y]))
        } else {
            Err(format!("expected finite numbers, found ({x}, {y})"))
        }
    }
}

impl TryFrom<(f64, f64)> for Direction {
    type Error = String;

    /// Axes of the world stay exact: their length is not divided by.
    fn try_from((x, y): (f64, f64)) -> Result<Self, String> {
        let length = libm::hypot(x, y);
        match (x, y) {
            _ if !length.is_finite() || length == 0.0 => {
                Err(format!("expected a direction, found ({x}, {y})"))
            }
            (_, 0.0) => Ok(Self([x.signum(), 0.0])),
            (0.0, _) => Ok(Self([0.0, y.signum()])),
            _ => Ok(Self([x / length, y / length])),
        }
    }
}

impl TryFrom<String> for Name {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        if RESERVED.contains(&text.as_str()) {
            return Err(format!(
                "`{text}` means something in every formula and cannot be a name"
            ));
        }
        match syn::parse_str::<syn::Ident>(&text) {
            Ok(_) => Ok(Self(text)),
            Err(_) => Err(format!(
                "expected a word of letters, digits and `_` that is no keyword, found `{text}`"
            )),
        }
    }
}

impl AsRef<str> for Name {
    fn as_ref(&self) -> &str {
        &self.0
    }
}
