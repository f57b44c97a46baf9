//! What an environment says of itself, and what random actions find out: asked once, and then
//! written into the task's file.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::messages::{DescribedAction, DescribedObservation, DescribedValues, Description, Probe};
use seedbed_input::limits::short_list;
use seedbed_input::numbers::{Count, FiniteNumber, Interval, Positive, ranged_number};

/// What an environment says of itself, and what random actions find out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Found {
    /// The observed numbers.
    pub observations: Vec<FoundObservation>,
    /// The components of an action.
    #[serde(deserialize_with = "short_list")]
    pub actions: Vec<FoundAction>,
    /// Steps after which an episode is truncated.
    #[serde(default)]
    pub time_limit: Option<Count>,
    /// Mean return at which the task counts as solved.
    #[serde(default)]
    pub reward_threshold: Option<FiniteNumber>,
    /// Time between two actions, s.
    pub control_step: Positive,
    /// How an episode in a used environment differs from one in a new environment with the same seed and
    /// actions. Without a difference, runs can be repeated bit for bit.
    #[serde(default)]
    pub difference: Option<String>,
    /// SHA-256 of the Python file that has the environment, unless it is one of Gymnasium's own.
    #[serde(default)]
    pub source_sha256: Option<String>,
    /// Versions of Python and packages.
    #[serde(default)]
    pub versions: BTreeMap<String, String>,
}

/// An observed number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FoundObservation {
    /// Name in the observation space.
    pub name: String,
    /// Its bounds, or what random actions reach.
    pub range: Interval,
}

/// A component of an action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum FoundAction {
    /// One of this number of values.
    Discrete {
        /// Name of the component.
        name: String,
        /// Number of values.
        count: Count<10_000>,
    },
    /// Any number of a range.
    Continuous {
        /// Name of the component.
        name: String,
        /// The range.
        range: Interval,
    },
}

impl Found {
    /// Of what an environment says and does.
    ///
    /// # Errors
    /// Something that no task can have.
    pub(super) fn new(description: Description, probe: &Probe) -> Result<Self, String> {
        let observations = description.observations.into_iter().zip(&probe.ranges);
        Ok(Self {
            observations: observations
                .map(|(observation, &visited)| found_observation(observation, visited))
                .collect::<Result<_, _>>()?,
            actions: description
                .actions
                .into_iter()
                .map(found_action)
                .collect::<Result<_, _>>()?,
            time_limit: match description.time_limit {
                Some(limit) => Some(Count::try_from(u64::from(limit))?),
                None => None,
            },
            reward_threshold: match description.reward_threshold {
                Some(threshold) => Some(FiniteNumber::try_from(threshold)?),
                None => None,
            },
            control_step: Positive::try_from(description.control_step)
                .unwrap_or_else(|_| ranged_number(1.0)),
            difference: probe.difference.clone(),
            source_sha256: description.source.map(|source| source.sha256),
            versions: description.versions,
        })
    }
}

fn found_observation(
    observation: DescribedObservation,
    visited: [Option<f64>; 2],
) -> Result<FoundObservation, String> {
    let (low, high) = match (observation.low, observation.high) {
        (Some(low), Some(high)) if low < high => (shortest(low), shortest(high)),
        _ => {
            let [low, high] = rounded_outwards(visited.map(Option::unwrap_or_default));
            (low, high)
        }
    };
    let range = Interval::try_from((low, high))
        .map_err(|error| format!("observation `{}`: {error}", observation.name))?;
    Ok(FoundObservation {
        name: observation.name,
        range,
    })
}

/// The decimal number with the fewest digits that is the same in single precision, if the bound is a number of single
/// precision: 0.41887903 for 0.41887903213500977.
fn shortest(bound: f64) -> f64 {
    let single = bound as f32;
    let decimal = single.to_string().parse();
    if f64::from(single) == bound {
        decimal.unwrap_or(bound)
    } else {
        bound
    }
}

fn found_action(action: DescribedAction) -> Result<FoundAction, String> {
    let name = action.name;
    let named = |error: String| format!("action `{name}`: {error}");
    match action.values {
        DescribedValues::Discrete { count } => Ok(FoundAction::Discrete {
            count: Count::try_from(u64::from(count)).map_err(named)?,
            name,
        }),
        DescribedValues::Continuous { low, high } => Ok(FoundAction::Continuous {
            range: Interval::try_from((low, high)).map_err(named)?,
            name,
        }),
    }
}

/// A range with ends of two significant digits that contains all visited values. So it is the same on
/// machines on which the last bits of a computation differ.
fn rounded_outwards([low, high]: [f64; 2]) -> [f64; 2] {
    let size = low.abs().max(high.abs());
    if !size.is_finite() || size < 1e-6 {
        return [-1.0, 1.0];
    }
    let unit = 10_f64.powi(size.log10().floor() as i32 - 1);
    // Dividing by a whole number rounds once: 0.12 is 12 / 100.
    let multiple = |count: f64| {
        if unit < 1.0 {
            count / (1.0 / unit).round()
        } else {
            count * unit
        }
    };
    let (low, high) = ((low / unit).floor(), (high / unit).ceil());
    if low < high {
        [multiple(low), multiple(high)]
    } else {
        [multiple(low - 1.0), multiple(high + 1.0)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn visited_ranges_have_two_digits_and_contain_all_values() {
        for (visited, expected) in [
            ([-0.1234, 3.21], [-0.2, 3.3]),
            ([0.011, 0.0123], [0.011, 0.013]),
            ([-1234.0, 5678.0], [-1300.0, 5700.0]),
            ([2.0, 2.0], [1.9, 2.1]),
            ([0.0, 0.0], [-1.0, 1.0]),
            ([0.0, f64::INFINITY], [-1.0, 1.0]),
        ] {
            assert_eq!(rounded_outwards(visited), expected, "{visited:?}");
        }
    }

    /// Bounds of the space are used as they are; those that are infinite come from visited values.
    #[test]
    fn infinite_bounds_become_visited_ranges() {
        let observation = |low, high| DescribedObservation {
            name: "x".to_owned(),
            low,
            high,
        };
        let range = |low, high| {
            let found =
                found_observation(observation(low, high), [Some(-0.5), Some(0.25)]).unwrap();
            found.range.get()
        };
        assert_eq!(range(Some(-4.8), Some(f64::from(4.8_f32))), [-4.8, 4.8]);
        assert_eq!(range(None, Some(4.8)), [-0.5, 0.25]);
    }
}
