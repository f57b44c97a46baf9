//! Numbers with a range in their type, so that an error in a file points at the number itself.

use std::borrow::Cow;
use std::fmt::{Display, LowerExp};

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

/// Defines a number with a range: its documentation, its name, the condition, and the condition in
/// words.
macro_rules! ranged_number {
    ($(#[$meta:meta])* $name:ident, $is_in_range:expr, $expected:literal) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize, Deserialize)]
        #[serde(try_from = "f64", into = "f64")]
        pub struct $name(f64);

        impl $name {
            /// The number itself.
            #[must_use]
            pub const fn get(self) -> f64 {
                self.0
            }

            /// The number in single precision.
            #[must_use]
            pub const fn get_f32(self) -> f32 {
                self.0 as f32
            }
        }

        impl TryFrom<f64> for $name {
            type Error = String;

            fn try_from(value: f64) -> Result<Self, String> {
                let is_in_range: fn(f64) -> bool = $is_in_range;
                if !value.is_finite() && is_in_range(value) {
                    return Err(format!("expected a finite number, found {value:?}"));
                }
                if !is_in_range(value) {
                    return Err(format!(concat!("expected ", $expected, ", found {:?}"), value));
                }
                // Physics and learning run in single precision.
                if !(value as f32).is_finite() || (value != 0.0 && (value as f32).abs() < f32::MIN_POSITIVE) {
                    return Err(format!("{value:e} does not fit into a number of single precision"));
                }
                Ok(Self(value))
            }
        }

        impl JsonSchema for $name {
            fn inline_schema() -> bool {
                true
            }

            fn schema_name() -> Cow<'static, str> {
                stringify!($name).into()
            }

            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!({ "type": "number", "expected": $expected })
            }
        }

        impl From<$name> for f64 {
            fn from(value: $name) -> Self {
                value.0
            }
        }
    };
}

ranged_number!(
    /// A finite number above 0.
    Positive,
    |value| value > 0.0,
    "a number above 0"
);
ranged_number!(
    /// A length with which shapes can be computed in single precision, m.
    Length,
    |value| (1e-6..=1e6).contains(&value),
    "a length from 0.000001 to 1000000 m"
);
ranged_number!(
    /// A time between two actions, s. In a shorter one, motion is lost in single precision: at 1 m, positions are
    /// 6e-8 m apart.
    StepTime,
    |value| (1e-6..=10.0).contains(&value),
    "a time from 0.000001 to 10 s"
);
ranged_number!(
    /// A finite number of at least 0.
    NonNegative,
    |value| value >= 0.0,
    "a number of at least 0"
);
ranged_number!(
    /// A number from 0 to 1, both included.
    Fraction,
    |value| (0.0..=1.0).contains(&value),
    "a number from 0 to 1"
);
ranged_number!(
    /// A number above 0 and at most 1.
    PositiveFraction,
    |value| value > 0.0 && value <= 1.0,
    "a number above 0 and at most 1"
);
ranged_number!(
    /// A number from 0 to less than 1, for example a discount or a decay rate.
    FractionBelowOne,
    |value| (0.0..1.0).contains(&value),
    "a number of at least 0 and below 1"
);
ranged_number!(
    /// A number other than infinity and NaN.
    FiniteNumber,
    |_| true,
    "a finite number"
);

/// A count from `MIN` to `MAX`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "u64", into = "u64")]
pub struct Count<const MAX: u32 = 1_000_000, const MIN: u32 = 1>(u32);

impl<const MAX: u32, const MIN: u32> Count<MAX, MIN> {
    /// The count itself.
    #[must_use]
    pub const fn get(self) -> u32 {
        self.0
    }
}

impl<const MAX: u32, const MIN: u32> TryFrom<u64> for Count<MAX, MIN> {
    type Error = String;

    fn try_from(value: u64) -> Result<Self, String> {
        let count = u32::try_from(value)
            .ok()
            .filter(|count| (MIN..=MAX).contains(count));
        count
            .map(Self)
            .ok_or_else(|| format!("expected a whole number from {MIN} to {MAX}, found {value}"))
    }
}

impl<const MAX: u32, const MIN: u32> JsonSchema for Count<MAX, MIN> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("Count_{MIN}_to_{MAX}").into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let expected = format!("a whole number from {MIN} to {MAX}");
        json_schema!({ "type": "integer", "minimum": MIN, "maximum": MAX, "expected": expected })
    }
}

impl<const MAX: u32, const MIN: u32> From<Count<MAX, MIN>> for u64 {
    fn from(value: Count<MAX, MIN>) -> Self {
        u64::from(value.0)
    }
}

/// An interval of two finite numbers, `(low, high)` with low < high.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "(f64, f64)", into = "(f64, f64)")]
pub struct Interval {
    low: f64,
    high: f64,
}

impl Interval {
    /// Low and high end.
    #[must_use]
    pub fn get(self) -> [f64; 2] {
        [self.low, self.high]
    }
}

impl From<Interval> for (f64, f64) {
    fn from(interval: Interval) -> Self {
        (interval.low, interval.high)
    }
}

impl TryFrom<(f64, f64)> for Interval {
    type Error = String;

    fn try_from((low, high): (f64, f64)) -> Result<Self, String> {
        // Physics and learning run in single precision.
        let fits = |number: f64| number.abs() <= f64::from(f32::MAX);
        if low >= high || !low.is_finite() || !high.is_finite() {
            return Err(format!(
                "expected a range (low, high) with low < high, found ({}, {})",
                readable(low),
                readable(high)
            ));
        }
        if !fits(low) || !fits(high) || !fits(high - low) || low as f32 >= high as f32 {
            return Err(format!(
                "the range ({low:e}, {high:e}) does not fit into numbers of single precision"
            ));
        }
        Ok(Self { low, high })
    }
}

/// A number for messages: with an exponent if it would have many digits without.
#[must_use]
pub fn readable<N: Copy + Display + LowerExp + Into<f64>>(number: N) -> String {
    let size = number.into().abs();
    let is_short = size == 0.0 || (1e-6..1e15).contains(&size) || !size.is_finite();
    if is_short {
        number.to_string()
    } else {
        format!("{number:e}")
    }
}

/// The smallest whole number that is at least `number`, which was computed from decimal numbers. An
/// excess that is due to rounding does not count: 0.28 of 25 is 7, though the product of the nearest
/// binary numbers is 7.000000000000001.
#[must_use]
pub fn ceil_decimal(number: f64) -> f64 {
    // Two numbers and their product or quotient are each within a relative error of EPSILON / 2.
    (number * (1.0 - 8.0 * f64::EPSILON)).ceil()
}

/// The smallest whole number that is at least a share of a count; see [`ceil_decimal`].
#[must_use]
pub fn share_of_count(share: f64, count: usize) -> usize {
    ceil_decimal(share * count as f64) as usize
}

/// A number that is in its range, such as a default.
///
/// # Panics
/// If it is not in its range.
#[must_use]
pub fn ranged_number<N: TryFrom<f64, Error = String>>(value: f64) -> N {
    N::try_from(value).unwrap_or_else(|message| panic!("{message}"))
}

/// A count that is in its range, such as a default.
///
/// # Panics
/// If it is not in its range.
#[must_use]
pub fn ranged_count<const MAX: u32, const MIN: u32>(value: u32) -> Count<MAX, MIN> {
    Count::try_from(u64::from(value)).unwrap_or_else(|message| panic!("{message}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_many_digits_have_an_exponent() {
        for (number, shown) in [
            (0.0, "0"),
            (2.5, "2.5"),
            (-1e300, "-1e300"),
            (1e-30, "1e-30"),
            (123_456.0, "123456"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(readable(number), shown);
        }
        assert_eq!(readable(1e38_f32), "1e38");
    }

    /// All shares with two decimals of counts up to 1000 are ⌈n c / 100⌉, in whole numbers.
    #[test]
    fn shares_of_counts_are_those_of_decimal_numbers() {
        for count in 0..=1000_usize {
            for percent in 1..=100_usize {
                let share = format!("0.{percent:02}").replace("0.100", "1.0");
                let share: f64 = share.parse().unwrap();
                let expected = (percent * count).div_ceil(100);
                for share in [share, percent as f64 / 100.0] {
                    assert_eq!(share_of_count(share, count), expected, "{share} of {count}");
                }
            }
        }
        assert_eq!(share_of_count(1e-9, 10), 1);
        assert_eq!(share_of_count(0.2801, 25), 8);
    }

    /// 0.14 / 0.02 is 7.000000000000001 in binary numbers.
    #[test]
    fn quotients_of_decimal_numbers_are_rounded_up() {
        for (number, expected) in [(0.14 / 0.02, 7.0), (0.05 / 0.02, 3.0), (0.0, 0.0)] {
            assert_eq!(ceil_decimal(number), expected);
        }
    }
}
