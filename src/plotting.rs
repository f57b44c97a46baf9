//! Helpers that the figures of runs and of studies share.

use seedbed_env::Quantity;
use seedbed_figure::Axis;

/// The axis of a figure that shows `quantity` over its display range.
#[must_use]
pub fn axis(quantity: &Quantity) -> Axis {
    Axis {
        name: quantity.name.clone(),
        unit: quantity.unit.clone(),
        range: quantity.range,
    }
}
