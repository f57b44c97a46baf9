//! Axes on which the states of several recordings are drawn together.

use super::RecordedStates;
use super::visitation::Axes;
use crate::run::recorder::BonusRange;
use crate::text::pluralize;
use seedbed_env::Quantity;

/// Maximum number of names in a message.
const MAX_NAMES: usize = 8;

/// The axes of all observations and of the bonus, with ranges that contain those of all recordings. The
/// bonus has an axis if all have it. Each recording has a name for messages.
///
/// # Errors
/// Two recordings have other observations: what differs.
pub fn common_axes(recordings: &[(String, &RecordedStates)]) -> Result<Axes, String> {
    let Some(((first_name, first), others)) = recordings.split_first() else {
        return Ok(Axes::of_quantities(&[], 1, BonusRange::None));
    };
    let mut observations = first.observations().to_vec();
    let (mut time_limit, mut bonus) = (first.time_limit(), first.bonus());
    for (name, recording) in others {
        if let Some(difference) = difference(first.observations(), recording.observations()) {
            return Err(format!(
                "{name} cannot be compared with {first_name}: {difference}; draw each of them alone"
            ));
        }
        widen(&mut observations, recording.observations());
        time_limit = time_limit.max(recording.time_limit());
        bonus = bonus.union(recording.bonus());
    }
    Ok(Axes::of_quantities(&observations, time_limit, bonus))
}

/// Widens ranges to contain those of other quantities, which are the same in name and unit.
pub(crate) fn widen(quantities: &mut [Quantity], others: &[Quantity]) {
    for (quantity, other) in quantities.iter_mut().zip(others) {
        let [low, high] = quantity.range;
        quantity.range = [low.min(other.range[0]), high.max(other.range[1])];
    }
}

/// The first observation of the same name that has another range here and there: visits are counted on other axes.
pub(crate) fn other_range<'a>(
    first: &'a [Quantity],
    others: &'a [Quantity],
) -> Option<(&'a Quantity, &'a Quantity)> {
    let mut pairs = first.iter().zip(others);
    pairs.find(|(one, other)| one.name == other.name && one.range != other.range)
}

/// Why states of these observations cannot be compared with states of `first`; `None` if they can:
/// names, units and order are the same.
pub(crate) fn difference(first: &[Quantity], others: &[Quantity]) -> Option<String> {
    if is_same(first, others, |quantity| &quantity.name) {
        let mut pairs = first.iter().zip(others);
        let (one, other) = pairs.find(|(one, other)| one.unit != other.unit)?;
        let [unit, expected] = [other, one].map(|quantity| match quantity.unit.as_str() {
            "" => "no unit".to_owned(),
            unit => format!("the unit {unit}"),
        });
        return Some(format!(
            "its `{}` has {unit} instead of {expected}",
            one.name
        ));
    }
    let [found, expected] = [others, first].map(names);
    let mut sorted = [first.to_vec(), others.to_vec()];
    for quantities in &mut sorted {
        quantities.sort_by(|one, other| one.name.cmp(&other.name));
    }
    Some(
        if is_same(&sorted[0], &sorted[1], |quantity| &quantity.name) {
            format!("its observations are in another order: {found} instead of {expected}")
        } else if first.len() == others.len() {
            format!("its observations are {found} instead of {expected}")
        } else {
            format!(
                "it has {} ({found}) instead of {} ({expected})",
                pluralize(others.len(), "observation"),
                first.len()
            )
        },
    )
}

fn is_same(one: &[Quantity], other: &[Quantity], text: fn(&Quantity) -> &String) -> bool {
    one.iter().map(text).eq(other.iter().map(text))
}

fn names(quantities: &[Quantity]) -> String {
    let names = quantities.iter().take(MAX_NAMES);
    let mut names: Vec<&str> = names.map(|quantity| quantity.name.as_str()).collect();
    if quantities.len() > MAX_NAMES {
        names.push("…");
    }
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quantities(names_and_units: &[(&str, &str)]) -> Vec<Quantity> {
        let quantity = |(name, unit): &(&str, &str)| Quantity {
            name: (*name).to_owned(),
            unit: (*unit).to_owned(),
            range: [0.0, 1.0],
        };
        names_and_units.iter().map(quantity).collect()
    }

    #[test]
    fn what_differs_is_said() {
        let first = quantities(&[("x", "m"), ("v", "m/s")]);
        let difference_to = |others: &[(&str, &str)]| difference(&first, &quantities(others));
        assert_eq!(difference_to(&[("x", "m"), ("v", "m/s")]), None);
        for (others, expected) in [
            (
                &[("x", "m"), ("v", "cm/s")][..],
                "its `v` has the unit cm/s instead of the unit m/s",
            ),
            (
                &[("x", ""), ("v", "m/s")],
                "its `x` has no unit instead of the unit m",
            ),
            (
                &[("v", "m/s"), ("x", "m")],
                "its observations are in another order: v, x instead of x, v",
            ),
            (
                &[("x", "m"), ("w", "m/s")],
                "its observations are x, w instead of x, v",
            ),
            (
                &[("x", "m")],
                "it has 1 observation (x) instead of 2 (x, v)",
            ),
        ] {
            assert_eq!(difference_to(others).as_deref(), Some(expected));
        }
    }

    #[test]
    fn ranges_contain_those_of_all() {
        let mut one = quantities(&[("x", "m")]);
        let mut other = one.clone();
        other[0].range = [-3.0, 0.5];
        widen(&mut one, &other);
        assert_eq!(one[0].range, [-3.0, 1.0]);
    }
}
