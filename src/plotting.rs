//! Helpers for figures of runs and figures of studies.

use seedbed_env::Quantity;
use seedbed_figure::Axis;

/// The axis of a figure of states, of which these shares are below the display range, above it, and NaN.
#[must_use]
pub fn axis_with_shares(quantity: &Quantity, [below, above, nan]: [f64; 3]) -> Axis {
    Axis {
        outside: [below, above],
        nan,
        ..axis(quantity)
    }
}

/// The axis of a figure for a quantity, over the display range of the quantity.
#[must_use]
pub fn axis(quantity: &Quantity) -> Axis {
    Axis {
        name: quantity.name.clone(),
        unit: quantity.unit.clone(),
        range: quantity.range,
        outside: [0.0; 2],
        nan: 0.0,
    }
}
