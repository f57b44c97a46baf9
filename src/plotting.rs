//! Helpers for figures of runs and figures of studies.

use seedbed_env::Quantity;
use seedbed_figure::Axis;

/// The axis of a figure of states, of which these shares are below and above the display range.
#[must_use]
pub fn axis_with_outside(quantity: &Quantity, outside: [f64; 2]) -> Axis {
    Axis {
        outside,
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
    }
}
