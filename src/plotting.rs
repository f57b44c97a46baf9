//! Helpers for figures of runs and figures of studies.

use indicatif::HumanCount;
use seedbed_env::Quantity;
use seedbed_figure::color::{AGENT_COLORS, OTHERS_COLOR, agent_color};
use seedbed_figure::{Axis, Color};
use seedbed_stats::aggregate::mean;

/// Names and colors of agents in the key of a figure.
#[must_use]
pub fn names_of_agents(agents: impl IntoIterator<Item = u32>) -> Vec<(String, Color)> {
    let mut names = Vec::new();
    for agent in agents {
        if agent < AGENT_COLORS {
            names.push((format!("agent {agent}"), agent_color(agent)));
        } else {
            names.push(("other agents".to_owned(), OTHERS_COLOR));
            break;
        }
    }
    names
}

/// How many of all states are drawn, such as `1,000 of 1,234 states`, or `1,234 states` if all are.
#[must_use]
pub fn number_of_states(drawn: u64, all: u64) -> String {
    let states = format!("{} states", HumanCount(all));
    if drawn < all {
        format!("{} of {states}", HumanCount(drawn))
    } else {
        states
    }
}

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

/// The two quantities in which a map is drawn: the coordinates x and y if there are such, otherwise the first two that are no
/// velocities. `None` if there are fewer than two.
#[must_use]
pub fn map_axes(quantities: &[&Quantity]) -> Option<[usize; 2]> {
    if let Some(coordinates) = coordinates(quantities) {
        return Some(coordinates);
    }
    let is_velocity = |index: &usize| quantities[*index].unit.ends_with("/s");
    let (velocities, mut others): (Vec<usize>, Vec<usize>) =
        (0..quantities.len()).partition(is_velocity);
    others.extend(velocities);
    let [first, second, ..] = others[..] else {
        return None;
    };
    Some([first.min(second), first.max(second)])
}

/// The coordinates x and y in the world, if both are among the quantities.
#[must_use]
pub fn coordinates(quantities: &[&Quantity]) -> Option<[usize; 2]> {
    let place = |name: &str| {
        quantities
            .iter()
            .position(|quantity| is_coordinate(&quantity.name, &quantity.unit, name))
    };
    Some([place("x")?, place("y")?])
}

/// Whether the first axis is the coordinate x and the second one y, so that walls can be drawn behind states.
#[must_use]
pub fn are_coordinates([x, y]: [&Axis; 2]) -> bool {
    is_coordinate(&x.name, &x.unit, "x") && is_coordinate(&y.name, &y.unit, "y")
}

/// Whether a quantity is the coordinate of this name in the world.
fn is_coordinate(name: &str, unit: &str, coordinate: &str) -> bool {
    name == coordinate && unit == "m"
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
    fn maps_have_places_rather_than_velocities() {
        let quantity = |(name, unit): (&str, &str)| Quantity {
            name: name.to_owned(),
            unit: unit.to_owned(),
            range: [0.0, 1.0],
        };
        let axes = |names: &[(&str, &str)]| {
            let quantities: Vec<Quantity> = names.iter().copied().map(quantity).collect();
            map_axes(&quantities.iter().collect::<Vec<_>>())
        };
        let cart = [
            ("x", "m"),
            ("v", "m/s"),
            ("angle", "rad"),
            ("turning", "rad/s"),
        ];
        assert_eq!(axes(&cart), Some([0, 2]));
        assert_eq!(
            axes(&[("v", "m/s"), ("y", "m"), ("a", ""), ("x", "m")]),
            Some([3, 1])
        );
        assert_eq!(
            axes(&[("angle", "rad"), ("turning", "rad/s")]),
            Some([0, 1])
        );
        assert_eq!(axes(&[("x", "m")]), None);
    }

    #[test]
    fn windows_of_trailing_means_grow_at_the_beginning() {
        let values = [4.0, 2.0, 6.0, 1.0];
        assert_eq!(trailing_means(&values, 3), [4.0, 3.0, 4.0, 3.0]);
        assert_eq!(trailing_means(&values, 1), values);
        assert_eq!(trailing_means(&values, 9), [4.0, 3.0, 4.0, 3.25]);
        assert!(trailing_means(&[], 3).is_empty());
    }
}
