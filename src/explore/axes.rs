//! The axes of a page, which all its runs share.

use serde::{Serialize, Serializer};

use super::states::{RunStates, StateColumn};
use crate::run::facts::StateQuantity;

/// One axis of the page.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct AxisData {
    name: String,
    unit: String,
    #[serde(rename = "kind", serialize_with = "key")]
    source: StateQuantity,
    low: f64,
    high: f64,
    /// Whether the axis is shown at first.
    shown: bool,
}

/// Writes the kind of a quantity.
fn key<S: Serializer>(source: &StateQuantity, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(source.key())
}

/// Maximum number of observations that are shown at first.
const MAX_SHOWN_OBSERVATIONS: usize = 8;

/// Maximum number of components of actions that are shown at first.
const MAX_SHOWN_ACTIONS: usize = 2;

impl AxisData {
    /// Lower and upper end.
    pub(super) fn range(&self) -> [f64; 2] {
        [self.low, self.high]
    }

    /// Index of the column of a run that the axis shows; `None` for axes of episodes.
    pub(super) fn column_of(&self, states: &RunStates) -> Option<usize> {
        let is_shown = |column: &StateColumn| {
            let StateColumn {
                quantity, source, ..
            } = column;
            (source.key(), &quantity.name, &quantity.unit) == self.key()
        };
        states.columns.iter().position(is_shown)
    }

    /// What tells axes apart. Values in other units are on axes of their own.
    fn key(&self) -> (&'static str, &String, &String) {
        (self.source.key(), &self.name, &self.unit)
    }

    fn of_episodes(quantity: StateQuantity, values: impl Iterator<Item = f64>) -> Self {
        let [low, high] = not_empty(extent(values));
        Self {
            name: quantity.title().to_owned(),
            unit: String::new(),
            source: quantity,
            low,
            high,
            shown: true,
        }
    }
}

/// The axes of all columns of all runs, in the order of [`StateQuantity`], and those of episodes.
pub(super) fn common_axes(runs: &[&RunStates]) -> Vec<AxisData> {
    let mut axes: Vec<AxisData> = Vec::new();
    for column in runs.iter().flat_map(|run| &run.columns) {
        let axis = axis_of(column);
        let known = axes.iter_mut().find(|known| known.key() == axis.key());
        match known {
            Some(known) => {
                [known.low, known.high] = [known.low.min(axis.low), known.high.max(axis.high)];
            }
            None => axes.push(axis),
        }
    }
    axes.sort_by_key(|axis| axis.source.order());
    for axis in &mut axes {
        axis.shown &= axis.low < axis.high;
        [axis.low, axis.high] = not_empty([axis.low, axis.high]);
    }
    show_first(
        &mut axes,
        StateQuantity::Observation(0),
        MAX_SHOWN_OBSERVATIONS,
    );
    show_first(&mut axes, StateQuantity::Action(0), MAX_SHOWN_ACTIONS);
    let episodes = || runs.iter().flat_map(|run| &run.episodes);
    let numbers = episodes().map(|episode| f64::from(episode.episode));
    axes.push(AxisData::of_episodes(StateQuantity::Episode, numbers));
    let returns = episodes().map(|episode| f64::from(episode.r#return as f32));
    axes.push(AxisData::of_episodes(StateQuantity::Return, returns));
    axes
}

/// The axis of one column. The range of a quantity without a range is that of its values.
fn axis_of(column: &StateColumn) -> AxisData {
    let quantity = &column.quantity;
    let [low, high] = match column.source {
        StateQuantity::Observation(_) | StateQuantity::Action(_) => quantity.range.map(f64::from),
        _ => extent(column.values.iter().map(|&value| f64::from(value))),
    };
    AxisData {
        name: quantity.name.clone(),
        unit: quantity.unit.clone(),
        source: column.source,
        low,
        high,
        shown: true,
    }
}

/// Shows only the first axes of the kind of a quantity.
fn show_first(axes: &mut [AxisData], kind: StateQuantity, count: usize) {
    let of_kind = axes
        .iter_mut()
        .filter(|axis| axis.source.order() == kind.order());
    of_kind.skip(count).for_each(|axis| axis.shown = false);
}

/// Smallest and largest finite value.
fn extent(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let finite = values.filter(|value| value.is_finite());
    finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        [low.min(value), high.max(value)]
    })
}

/// A range of at least one level: a single value is its middle.
fn not_empty([low, high]: [f64; 2]) -> [f64; 2] {
    if low < high {
        [low, high]
    } else if low == high {
        [low - 0.5, high + 0.5]
    } else {
        [0.0, 1.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_never_empty() {
        assert_eq!(
            not_empty(extent([2.0, -1.0, f64::NAN].into_iter())),
            [-1.0, 2.0]
        );
        assert_eq!(not_empty(extent([1.0, 1.0].into_iter())), [0.5, 1.5]);
        assert_eq!(not_empty(extent(std::iter::empty())), [0.0, 1.0]);
    }
}
