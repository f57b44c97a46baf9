//! The schema of a finite task in `envs/*.ron`, for agents that act in it as in any other task.

use serde::Deserialize;

use super::Task;
use super::environment::{Finite, Observation};
use crate::env::description::Description;
use crate::env::{Action, Choice, Quantity, Spec};
use crate::input::numbers::Finite as FiniteNumber;
use crate::input::{self, InputError};

/// A finite task: `TabularEnvironment(…)`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename = "TabularEnvironment", deny_unknown_fields)]
pub struct TabularEnvironment {
    /// One sentence for people.
    pub description: String,
    /// The tables.
    pub task: Task,
    /// What the agent sees.
    #[serde(default)]
    pub observation: Observation,
    /// Names the one task that is drawn from its prior; the same for every run.
    #[serde(default)]
    pub drawn_with: u64,
    /// Mean return at which the task counts as solved.
    #[serde(default)]
    pub reward_threshold: Option<FiniteNumber>,
}

/// Checks the text of a task file; `origin` stands in the place of the file's name in errors.
///
/// # Errors
/// Something in it is wrong.
pub fn parse(name: &str, origin: &str, text: String) -> Result<Description, InputError> {
    let file = input::parse::<TabularEnvironment>(origin, text)?.value;
    let model = file.task.model(file.drawn_with);
    let truth = file.task.draw(&model, file.drawn_with);
    let finite = Finite {
        model,
        truth,
        observation: file.observation,
    };
    Ok(Description::of_finite(
        origin,
        spec(name, &file, &finite),
        finite,
    ))
}

fn spec(name: &str, file: &TabularEnvironment, finite: &Finite) -> Spec {
    let actions = (0..finite.model.most_actions())
        .map(|action| action as f32)
        .collect::<Vec<_>>();
    let range = [0.0, (actions.len() - 1) as f32];
    Spec {
        name: name.to_owned(),
        description: file.description.clone(),
        observations: finite.quantities(),
        actions: vec![Action {
            quantity: quantity("action", range),
            choice: Choice::Discrete(actions),
        }],
        control_step: 1.0,
        time_limit: finite.model.horizon,
        reward_threshold: file.reward_threshold.map(FiniteNumber::get_f32),
    }
}

/// A pure number.
pub(super) fn quantity(name: &str, range: [f32; 2]) -> Quantity {
    Quantity {
        name: name.to_owned(),
        unit: String::new(),
        range,
    }
}
