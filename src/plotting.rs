//! Helpers for figures of runs and figures of studies.

use seedbed_env::Quantity;
use seedbed_figure::Axis;
use seedbed_stats::aggregate::mean;

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

/// Mean of each value and of the values before it, of at most `window` values: `[n]` → `[n]`
///
/// The window grows at the beginning, so that the first values are not lost.
#[must_use]
pub fn trailing_means(values: &[f64], window: usize) -> Vec<f64> {
    let window = window.max(1);
    let trailing_mean = |last: usize| mean(&values[(last + 1).saturating_sub(window)..=last]);
    (0..values.len()).map(trailing_mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_of_trailing_means_grow_at_the_beginning() {
        let values = [4.0, 2.0, 6.0, 1.0];
        assert_eq!(trailing_means(&values, 3), [4.0, 3.0, 4.0, 3.0]);
        assert_eq!(trailing_means(&values, 1), values);
        assert_eq!(trailing_means(&values, 9), [4.0, 3.0, 4.0, 3.25]);
        assert!(trailing_means(&[], 3).is_empty());
    }
}
