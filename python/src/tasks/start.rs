//! Start states that are given by name instead of being drawn.

use std::collections::BTreeMap;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use seedbed_env::{GivenStart, StartNames};

/// Numbers by name.
pub(super) type NamedNumbers = BTreeMap<String, f64>;

/// The start state with these positions and velocities of coordinates and these numbers of the episode.
///
/// # Errors
/// The task has no number of such a name, or a number is not finite in single precision.
pub(super) fn given_start(
    names: &StartNames,
    [positions, velocities, numbers]: [NamedNumbers; 3],
) -> PyResult<GivenStart> {
    Ok(GivenStart {
        positions: indexed("positions", "coordinate", positions, &names.coordinates)?,
        velocities: indexed("velocities", "coordinate", velocities, &names.coordinates)?,
        episode_numbers: indexed(
            "numbers",
            "number in `drawn_per_episode`",
            numbers,
            &names.episode_numbers,
        )?,
    })
}

/// Positions and velocities of coordinates and numbers of the episode, by name.
pub(super) fn named_start(names: &StartNames, start: &GivenStart) -> [NamedNumbers; 3] {
    let named = |numbers: &[(usize, f64)], names: &[String]| {
        let pair = |&(index, number): &(usize, f64)| (names[index].clone(), number);
        numbers.iter().map(pair).collect()
    };
    [
        named(&start.positions, &names.coordinates),
        named(&start.velocities, &names.coordinates),
        named(&start.episode_numbers, &names.episode_numbers),
    ]
}

/// Pairs of the index of each name and its number.
fn indexed(
    option: &str,
    kind: &str,
    numbers: NamedNumbers,
    known: &[String],
) -> PyResult<Vec<(usize, f64)>> {
    let index = |(name, number): (String, f64)| {
        let Some(index) = known.iter().position(|other| *other == name) else {
            return Err(unknown(option, kind, &name, known));
        };
        // Tasks compute in single precision, in which large numbers are infinite.
        if !(number as f32).is_finite() {
            return Err(PyValueError::new_err(format!(
                "options[{option:?}][{name:?}] is {number}, expected a finite number in single precision"
            )));
        }
        Ok((index, number))
    };
    numbers.into_iter().map(index).collect()
}

fn unknown(option: &str, kind: &str, name: &str, known: &[String]) -> PyErr {
    let expected = if known.is_empty() {
        "the task has none".to_owned()
    } else {
        format!("expected one of {}", known.join(", "))
    };
    PyValueError::new_err(format!(
        "options[{option:?}]: no {kind} is named {name:?}: {expected}"
    ))
}
