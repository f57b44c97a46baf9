//! `/scenario/quantities`: what was seen and done, with units and ranges, for those who read a recording back.
//!
//! One list a column: `name`, `unit`, `low`, `high`, and `role`: `observation`, `action`, `step` (from 0 to the time limit) or
//! `intrinsic_reward` (of curious agents, from 0 to the largest).

use std::sync::Arc;

use rerun::external::arrow::array::{Array, Float32Array, ListArray, StringArray};
use rerun::log::Chunk;
use rerun::{AnyValues, ComponentIdentifier};

use super::rows::timeless;
use super::sink::Fault;
use crate::env::{Quantity, Spec};

pub(super) const ENTITY: &str = "/scenario/quantities";

/// What a recording tells of its task.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Quantities {
    pub(super) observations: Vec<Quantity>,
    pub(super) actions: Vec<Quantity>,
    pub(super) time_limit: u32,
    pub(super) largest_bonus: Option<f32>,
}

/// As [`read`] takes it.
pub(super) fn chunk(spec: &Spec, largest_bonus: Option<f32>) -> Result<Chunk, Fault> {
    let step = Quantity {
        name: "step".to_owned(),
        unit: String::new(),
        range: [0.0, spec.time_limit as f32],
    };
    let bonus = |largest| Quantity {
        name: "intrinsic_reward".to_owned(),
        unit: String::new(),
        range: [0.0, largest],
    };
    let observed = spec
        .observations
        .iter()
        .cloned()
        .map(|quantity| (quantity, "observation"));
    let done = spec
        .actions
        .iter()
        .map(|action| (action.quantity.clone(), "action"));
    let further = std::iter::once((step, "step"))
        .chain(largest_bonus.map(|largest| (bonus(largest), "intrinsic_reward")));
    let rows: Vec<(Quantity, &str)> = observed.chain(done).chain(further).collect();
    let words = |word: fn(&(Quantity, &'static str)) -> String| {
        Arc::new(StringArray::from_iter_values(rows.iter().map(word)))
    };
    let numbers = |end: usize| {
        Arc::new(Float32Array::from_iter_values(
            rows.iter().map(|(quantity, _)| quantity.range[end]),
        ))
    };
    let columns = AnyValues::default()
        .with_component_from_data("name", words(|(quantity, _)| quantity.name.clone()))
        .with_component_from_data("unit", words(|(quantity, _)| quantity.unit.clone()))
        .with_component_from_data("low", numbers(0))
        .with_component_from_data("high", numbers(1))
        .with_component_from_data("role", words(|(_, role)| (*role).to_owned()));
    timeless(ENTITY, &columns)
}

/// From what [`chunk`] made; nothing where it is something else.
pub(super) fn read(chunk: &Chunk) -> Option<Quantities> {
    let (names, units, roles) = (
        words(chunk, "name")?,
        words(chunk, "unit")?,
        words(chunk, "role")?,
    );
    let (lows, highs) = (numbers(chunk, "low"), numbers(chunk, "high"));
    let ranges: Vec<[f32; 2]> = lows
        .into_iter()
        .zip(highs)
        .map(|(low, high)| [low, high])
        .collect();
    if [units.len(), roles.len(), ranges.len()] != [names.len(); 3] {
        return None;
    }
    let mut quantities = Quantities::default();
    for (((name, unit), range), role) in names.into_iter().zip(units).zip(ranges).zip(roles) {
        match role.as_str() {
            "observation" => quantities.observations.push(Quantity { name, unit, range }),
            "action" => quantities.actions.push(Quantity { name, unit, range }),
            "step" => quantities.time_limit = range[1] as u32,
            "intrinsic_reward" => quantities.largest_bonus = Some(range[1]),
            _ => {}
        }
    }
    (!quantities.observations.is_empty()).then_some(quantities)
}

/// The words of a column, those of all rows after each other.
pub(super) fn words(chunk: &Chunk, component: &str) -> Option<Vec<String>> {
    let list: &ListArray = chunk
        .components()
        .get_array(ComponentIdentifier::try_new(component).ok()?)?;
    let words = list.values().as_any().downcast_ref::<StringArray>()?;
    Some(words.iter().flatten().map(ToOwned::to_owned).collect())
}

fn numbers(chunk: &Chunk, component: &str) -> Vec<f32> {
    let component = ComponentIdentifier::try_new(component).ok();
    component.map_or(Vec::new(), |component| {
        chunk
            .iter_slices::<f32>(component)
            .flatten()
            .copied()
            .collect()
    })
}
