//! Numbers that carry their own range, so that an error in a file points at the number itself.

use serde::{Deserialize, Serialize};

/// Defines a number with a range: its name, what it is, the condition, and how the condition reads.
macro_rules! ranged_number {
    ($(#[$meta:meta])* $name:ident, $holds:expr, $expected:literal) => {
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
                let holds: fn(f64) -> bool = $holds;
                if value.is_finite() && holds(value) {
                    Ok(Self(value))
                } else {
                    Err(format!(concat!("expected ", $expected, ", found {}"), value))
                }
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
    /// Any number but infinity and NaN.
    Finite,
    |_| true,
    "a finite number"
);

/// A count of at least 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "u32", into = "u32")]
pub struct Count(u32);

impl Count {
    /// The count itself.
    #[must_use]
    pub const fn get(self) -> u32 {
        self.0
    }
}

impl TryFrom<u32> for Count {
    type Error = String;

    fn try_from(value: u32) -> Result<Self, String> {
        if value > 0 { Ok(Self(value)) } else { Err("expected a whole number of at least 1, found 0".to_owned()) }
    }
}

impl From<Count> for u32 {
    fn from(value: Count) -> Self {
        value.0
    }
}

/// A number that is known to lie in its range: for defaults.
///
/// # Panics
/// If it does not.
#[must_use]
pub fn known<N: TryFrom<f64, Error = String>>(value: f64) -> N {
    N::try_from(value).unwrap_or_else(|message| panic!("{message}"))
}

/// A count that is known to be at least 1: for defaults.
///
/// # Panics
/// If it is 0.
#[must_use]
pub fn known_count(value: u32) -> Count {
    Count::try_from(value).unwrap_or_else(|message| panic!("{message}"))
}
