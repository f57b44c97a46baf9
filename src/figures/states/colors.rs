//! Colors of states, and their keys.

use crate::figures::settings::FigureSettings;
use crate::plotting;
use crate::review::selection::{SelectedState, SelectedStates};
use crate::scenario::recording::ColorBy;
use seedbed_env::Status;
use seedbed_figure::color::{OTHERS_COLOR, agent_color, categorical_color, sequential_color};
use seedbed_figure::{Color, Key};

/// Colors of states, with their color key.
pub(super) struct StateColors {
    color_by: ColorBy,
    /// Values at the ends of a continuous color scale.
    range: [f64; 2],
    pub(super) key: Option<Key>,
}

impl StateColors {
    pub(super) fn new(settings: &FigureSettings, groups: &[&[&SelectedStates]]) -> Self {
        let color_by = settings.color_by.unwrap_or(ColorBy::Agent);
        let range = color_range(color_by, groups);
        let key = color_key(color_by, range, groups);
        Self {
            color_by,
            range,
            key,
        }
    }

    pub(super) fn color(&self, agent: u32, state: &SelectedState) -> Color {
        let [low, high] = self.range;
        match color_value(self.color_by, state) {
            Some(value) if value.is_nan() => OTHERS_COLOR,
            Some(value) => sequential_color((value - low) / (high - low)),
            None if self.color_by == ColorBy::Agent => agent_color(agent),
            None => outcome_color(state.outcome),
        }
    }
}

/// The value that determines the color on a continuous scale; `None` for categorical colors.
fn color_value(color_by: ColorBy, state: &SelectedState) -> Option<f64> {
    match color_by {
        ColorBy::Agent | ColorBy::Outcome => None,
        ColorBy::Episode => Some(f64::from(state.episode)),
        ColorBy::Return => Some(state.r#return),
        ColorBy::IntrinsicReward => Some(f64::from(state.intrinsic_reward)),
    }
}

/// Smallest and largest value on the continuous color scale. If all values are equal, the range
/// also includes 0 and is never empty; without values it is 0 to 1.
fn color_range(color_by: ColorBy, groups: &[&[&SelectedStates]]) -> [f64; 2] {
    let [low, high] = groups
        .iter()
        .copied()
        .flatten()
        .flat_map(|states| &states.sample)
        .filter_map(|state| color_value(color_by, state))
        .filter(|value| value.is_finite())
        .fold([f64::INFINITY, f64::NEG_INFINITY], |ends, value| {
            [ends[0].min(value), ends[1].max(value)]
        });
    if high > low {
        [low, high]
    } else if low > high {
        [0.0, 1.0]
    } else {
        [low.min(0.0), low.max(0.0) + 1.0]
    }
}

fn color_key(color_by: ColorBy, range: [f64; 2], groups: &[&[&SelectedStates]]) -> Option<Key> {
    let mut states = groups
        .iter()
        .copied()
        .flatten()
        .flat_map(|states| &states.sample);
    let has_nan = states.any(|state| color_value(color_by, state).is_some_and(f64::is_nan));
    let continuous_key = |label: &str| {
        Some(Key::Continuous {
            label: format!("{label}{}", if has_nan { ", gray: NaN" } else { "" }),
            range,
        })
    };
    match color_by {
        ColorBy::Agent => agent_key(groups),
        ColorBy::Episode => continuous_key("episode"),
        ColorBy::Return => continuous_key("return of the episode"),
        ColorBy::IntrinsicReward => continuous_key("intrinsic reward"),
        ColorBy::Outcome => {
            let outcomes = [
                ("terminated", Status::Terminated),
                ("truncated", Status::Truncated),
            ];
            Some(Key::Categories(
                outcomes
                    .map(|(name, outcome)| (name.to_owned(), outcome_color(outcome)))
                    .to_vec(),
            ))
        }
    }
}

/// Key of the colors of agents; `None` unless a panel shows several agents.
fn agent_key(groups: &[&[&SelectedStates]]) -> Option<Key> {
    let has_several_agents = groups.iter().any(|group| group.len() > 1);
    let mut agents: Vec<u32> = groups
        .iter()
        .copied()
        .flatten()
        .map(|states| states.agent)
        .collect();
    agents.sort_unstable();
    agents.dedup();
    has_several_agents.then(|| Key::Categories(plotting::names_of_agents(agents)))
}

/// The color of an outcome on a white page.
fn outcome_color(outcome: Status) -> Color {
    categorical_color(if outcome == Status::Terminated { 0 } else { 3 })
}
