//! `/scenario/quantities`: the observations and actions with their units and ranges, for programs
//! that read a recording.
//!
//! One list per column: `name`, `unit`, `low`, `high`, and `role`: `observation`, `action`, `info`
//! (recorded beside the observations, without a range), `step` (from 0 to the time limit) or `intrinsic_reward` (from 0 to the maximum; only for agents with a
//! bonus).

use std::sync::Arc;

use rerun::external::arrow::array::{Array, Float32Array, ListArray, StringArray};
use rerun::log::Chunk;
use rerun::{AnyValues, ComponentIdentifier};

use super::error::RecordingError;
use super::rows::static_chunk;
use crate::run::facts::StateQuantity;
use crate::run::recorder::BonusRange;
use seedbed_env::{Quantity, TaskSpec};

pub(super) const ENTITY: &str = "/scenario/quantities";

/// Observations, actions, time limit and bonus range, as stored in a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Quantities {
    pub(super) observations: Vec<Quantity>,
    pub(super) actions: Vec<Quantity>,
    /// What is recorded beside the observations.
    pub(super) info: Vec<Quantity>,
    pub(super) time_limit: u32,
    pub(super) bonus: BonusRange,
}

/// Encodes the quantities as a chunk for [`read`].
pub(super) fn chunk(spec: &TaskSpec, bonus: BonusRange) -> Result<Chunk, RecordingError> {
    let rows = quantities_with_roles(spec, bonus);
    let texts = |text: fn(&(Quantity, &'static str)) -> String| {
        Arc::new(StringArray::from_iter_values(rows.iter().map(text)))
    };
    let numbers = |end: usize| {
        Arc::new(Float32Array::from_iter_values(
            rows.iter().map(|(quantity, _)| quantity.range[end]),
        ))
    };
    let columns = AnyValues::default()
        .with_component_from_data("name", texts(|(quantity, _)| quantity.name.clone()))
        .with_component_from_data("unit", texts(|(quantity, _)| quantity.unit.clone()))
        .with_component_from_data("low", numbers(0))
        .with_component_from_data("high", numbers(1))
        .with_component_from_data("role", texts(|(_, role)| (*role).to_owned()));
    static_chunk(ENTITY, &columns)
}

/// All quantities in the order of their rows, each with its role.
fn quantities_with_roles(spec: &TaskSpec, bonus: BonusRange) -> Vec<(Quantity, &'static str)> {
    let actions: Vec<Quantity> = spec
        .actions
        .iter()
        .map(|action| action.quantity.clone())
        .collect();
    let of_task = StateQuantity::of_task(&spec.observations, &actions, &spec.info);
    let mut rows: Vec<_> = of_task
        .map(|(quantity, named)| (named.clone(), quantity.key()))
        .collect();
    let mut add = |quantity: StateQuantity, max: f32| {
        let named = Quantity {
            name: quantity.key().to_owned(),
            unit: String::new(),
            range: [0.0, max],
        };
        rows.push((named, quantity.key()));
    };
    add(StateQuantity::Step, spec.time_limit as f32);
    if let Some(max) = bonus.max() {
        add(StateQuantity::IntrinsicReward, max);
    }
    rows
}

/// Decodes a chunk of [`chunk`]; `None` if the chunk has other contents.
pub(super) fn read(chunk: &Chunk) -> Option<Quantities> {
    let (names, units, roles) = (
        strings(chunk, "name")?,
        strings(chunk, "unit")?,
        strings(chunk, "role")?,
    );
    let (lows, highs) = (floats(chunk, "low"), floats(chunk, "high"));
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
            "info" => quantities.info.push(Quantity { name, unit, range }),
            "step" => quantities.time_limit = range[1] as u32,
            "intrinsic_reward" => quantities.bonus = BonusRange::UpTo(range[1]),
            _ => {}
        }
    }
    (!quantities.observations.is_empty()).then_some(quantities)
}

/// The strings of all rows of a column.
pub(super) fn strings(chunk: &Chunk, component: &str) -> Option<Vec<String>> {
    let list: &ListArray = chunk
        .components()
        .get_array(ComponentIdentifier::try_new(component).ok()?)?;
    let texts = list.values().as_any().downcast_ref::<StringArray>()?;
    Some(texts.iter().flatten().map(ToOwned::to_owned).collect())
}

fn floats(chunk: &Chunk, component: &str) -> Vec<f32> {
    let component = ComponentIdentifier::try_new(component).ok();
    component.map_or(Vec::new(), |component| {
        chunk
            .iter_slices::<f32>(component)
            .flatten()
            .copied()
            .collect()
    })
}
