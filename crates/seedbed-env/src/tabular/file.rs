//! The schema of a tabular task in `envs/*.ron`, for agents that act in it as in any other task.

use serde::Deserialize;

use super::environment::{StateEncoding, TabularTask};
use super::{Mdp, Model, TaskFamily};
use crate::{Action, TaskSpec};
use seedbed_input::numbers::FiniteNumber;
use seedbed_input::{InputError, Located, ValidationError};

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
    pub mdp_seed: Option<Located<u64>>,
    /// Whether each run draws an MDP of its own with its run seed, the same for all agents and
    /// episodes of the run; if not, all runs have the MDP that is drawn with `drawn_with`. The known
    /// part of the task, such as a graph, is the same for all runs.
    #[serde(default)]
    pub drawn_per_run: bool,
    /// Mean return at which the task counts as solved.
    #[serde(default)]
    pub reward_threshold: Option<FiniteNumber>,
}

/// Checks the text of a task file; errors show `origin` in place of a file name.
///
/// # Errors
/// Something in the text is wrong.
pub(crate) fn parse(name: &str, origin: &str, text: &str) -> Result<TabularTask, InputError> {
    let document = seedbed_input::parse::<TabularTaskFile>(origin, text.to_owned())?;
    let file = &document.value;
    if let Some(base) = &file.extends {
        return Err(document.locate(base.error("`extends` is given twice")));
    }
    let mdp_seed = file.mdp_seed().map_err(|error| document.locate(error))?;
    let model = file.task.model(mdp_seed);
    let true_mdp = file.task.draw_mdp(&model, mdp_seed);
    let task = TabularTask::new(origin, model, true_mdp, file.observation);
    Ok(TabularTask {
        drawn_per_run: file.drawn_per_run.then(|| file.task.clone()),
        spec: TaskSpec {
            name: name.to_owned(),
            description: file.description.clone(),
            reward_threshold: file.reward_threshold.map(FiniteNumber::get_f32),
            ..task.spec
        },
        ..task
    })
}

impl TabularTaskFile {
    /// Random number seed of the MDP, and of what is known of it; 0 by default.
    ///
    /// # Errors
    /// `drawn_with` is given, but each run draws an MDP of its own.
    fn mdp_seed(&self) -> Result<u64, ValidationError> {
        match &self.mdp_seed {
            Some(seed) if self.drawn_per_run => Err(seed
                .error("`drawn_with` has no effect: with `drawn_per_run: true`, each run draws its task with its run seed")
                .with_help("remove `drawn_with` or `drawn_per_run`")),
            seed => Ok(seed.as_ref().map_or(0, |seed| **seed)),
        }
    }
}

impl TabularTask {
    /// The task of the run with this run seed. A team with a tabular model of the same family has
    /// the same MDP in the run with this run seed, if the known part of the family is the same for
    /// all run seeds.
    #[must_use]
    pub fn for_run(&self, run_seed: u64) -> Self {
        let mut task = self.clone();
        if let Some(family) = &self.drawn_per_run {
            task.true_mdp = family.draw_mdp(&self.model, run_seed);
        }
        task
    }

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
            drawn_per_run: None,
            observation,
        }
    }
}
