//! The schema of a tabular task in `envs/*.ron`, for agents that act in it as in any other task.

use serde::Deserialize;

use super::environment::{StateEncoding, TabularTask};
use super::{Mdp, Model, TaskFamily};
use crate::description::TaskDescription;
use crate::input::numbers::FiniteNumber;
use crate::input::{self, InputError, Located};
use crate::{Action, TaskSpec};

/// A file of a tabular task: `TabularEnvironment(…)`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename = "TabularEnvironment", deny_unknown_fields)]
pub(crate) struct TabularTaskFile {
    /// The task file that this one extends; see [`TaskFile::extends`](crate::file::TaskFile).
    #[serde(default)]
    pub extends: Option<Located<String>>,
    /// One sentence for people.
    pub description: String,
    /// Family of MDPs.
    pub task: TaskFamily,
    /// How a state is observed.
    #[serde(default)]
    pub observation: StateEncoding,
    /// Random number seed with which the MDP is drawn from its family, the same for every run.
    #[serde(default, rename = "drawn_with")]
    pub mdp_seed: u64,
    /// Mean return at which the task counts as solved.
    #[serde(default)]
    pub reward_threshold: Option<FiniteNumber>,
}

/// Checks the text of a task file; errors show `origin` in place of a file name.
///
/// # Errors
/// Something in the text is wrong.
pub(crate) fn parse(name: &str, origin: &str, text: &str) -> Result<TaskDescription, InputError> {
    let document = input::parse::<TabularTaskFile>(origin, text.to_owned())?;
    let file = &document.value;
    if let Some(base) = &file.extends {
        return Err(document.locate(base.error("`extends` is given twice")));
    }
    let model = file.task.model(file.mdp_seed);
    let true_mdp = file.task.draw_mdp(&model, file.mdp_seed);
    let task = TabularTask::new(origin, model, true_mdp, file.observation);
    Ok(TaskDescription::from(TabularTask {
        spec: TaskSpec {
            name: name.to_owned(),
            description: file.description.clone(),
            reward_threshold: file.reward_threshold.map(FiniteNumber::get_f32),
            ..task.spec
        },
        ..task
    }))
}

impl TabularTask {
    /// A task without a name. An action is an index among the actions of the current state.
    #[must_use]
    pub fn new(origin: &str, model: Model, true_mdp: Mdp, observation: StateEncoding) -> Self {
        let actions: Vec<_> = (0..model.max_actions()).map(|index| index as f32).collect();
        let action = Action::discrete("action", "", &actions);
        let spec = TaskSpec {
            control_step: 1.0,
            time_limit: model.horizon,
            ..TaskSpec::new("", observation.quantities(&model), vec![action])
        };
        Self {
            origin: origin.to_owned(),
            spec,
            model,
            true_mdp,
            observation,
        }
    }
}
