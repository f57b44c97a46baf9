//! The settings of an environment of Gymnasium, in a task file or in a scenario.

use std::collections::BTreeMap;
use std::path::Path;

use ron::Value;
use schemars::JsonSchema;
use seedbed_settings::Settings;
use serde::{Deserialize, Serialize};

use super::found::Found;
use seedbed_input::Located;
use seedbed_input::numbers::{
    Count, FiniteNumber, Interval, Positive, ranged_count, ranged_number,
};

/// An environment of Gymnasium: `Gymnasium(id: "CartPole-v1")`.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(rename = "Gymnasium", deny_unknown_fields)]
pub struct GymnasiumFile {
    /// What `gymnasium.make` makes, such as `CartPole-v1` or `module:Name-v0`; or `file.py:function` or
    /// `module:Class`, a function that returns an environment or a class of environments.
    pub id: Located<String>,
    /// One sentence for people.
    #[serde(default)]
    pub description: String,
    /// Arguments of the environment.
    #[serde(default)]
    #[schemars(skip)]
    pub kwargs: Located<BTreeMap<String, Value>>,
    /// Names of all observed numbers in order; by default those of the observation space.
    #[serde(default)]
    pub names: Located<Vec<String>>,
    /// Units of observed numbers, for people.
    #[serde(default)]
    pub units: Located<BTreeMap<String, String>>,
    /// Ranges over which observed numbers are displayed, scaled and counted. Those that are not given are
    /// the bounds of the observation space; if these are infinite, what random actions reach.
    #[serde(default)]
    #[schemars(skip)]
    pub ranges: Located<BTreeMap<String, Interval>>,
    /// Steps after which an episode is truncated; by default that of the environment.
    #[serde(default)]
    pub time_limit: Option<Count>,
    /// Mean return at which the task counts as solved; by default that of the environment.
    #[serde(default)]
    pub reward_threshold: Option<FiniteNumber>,
    /// Entries of `info` that are recorded beside the observations; agents do not see them.
    #[serde(default)]
    pub log_info: Located<Vec<String>>,
    /// How discrete observations are given to agents.
    #[serde(default)]
    pub discrete: DiscreteObservations,
    /// Number of steps with random actions that are made once to find ranges.
    #[serde(default = "default_probe_steps")]
    pub probe_steps: Count,
    /// Number of worker processes; by default one per thread. Results do not depend on it.
    #[serde(default)]
    pub workers: Option<Count<256>>,
    /// Time after which a reset or a step counts as hanging, s.
    #[serde(default = "default_step_timeout")]
    pub step_timeout: Positive,
    /// What the environment says of itself. It is written into the folder of a run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(skip)]
    pub found: Option<Found>,
}

/// How discrete observations are given to agents.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum DiscreteObservations {
    /// As one number per value, which is 1 for the observed value and 0 otherwise.
    #[default]
    OneHot,
    /// As one number.
    Number,
}

impl GymnasiumFile {
    /// Name of the task: that of the environment without module and folders.
    #[must_use]
    pub fn task_name(&self) -> String {
        let after_module = self.id.rsplit(':').next().unwrap_or_default();
        after_module.replace(['/', '\\'], "-")
    }

    /// Path of the Python file and name of the function, if the environment is made by one.
    #[must_use]
    pub fn function(&self) -> Option<(&Path, &str)> {
        let (file, function) = self.id.rsplit_once(':')?;
        let path = Path::new(file);
        let is_python = path.extension().is_some_and(|extension| extension == "py");
        is_python.then_some((path, function))
    }
}

/// Whether the text of a task file has all that the environment says of itself, so that reading it runs no
/// Python.
#[must_use]
pub fn is_complete(text: &str) -> bool {
    let file = seedbed_input::parse::<GymnasiumFile>("", text.to_owned());
    file.is_ok_and(|file| file.value.found.is_some())
}

/// What identifies the task: not how and where it is run.
pub(crate) fn settings(text: &str) -> Settings {
    ["workers", "step_timeout", "found.versions"]
        .into_iter()
        .fold(
            seedbed_input::settings_of::<GymnasiumFile>(text),
            Settings::without,
        )
}

fn default_probe_steps() -> Count {
    ranged_count(10_000)
}

fn default_step_timeout() -> Positive {
    ranged_number(60.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(id: &str) -> GymnasiumFile {
        let text = format!("Gymnasium(id: {id:?}, kwargs: {{\"size\": 9}})");
        seedbed_input::parse("test", text).unwrap().value
    }

    #[test]
    fn names_of_tasks_are_those_of_environments() {
        for (id, name) in [
            ("CartPole-v1", "CartPole-v1"),
            ("ALE/Pong-v5", "ALE-Pong-v5"),
            ("my_envs:Maze-v0", "Maze-v0"),
            ("envs/maze.py:make_maze", "make_maze"),
        ] {
            assert_eq!(file(id).task_name(), name);
        }
    }

    #[test]
    fn only_ids_with_a_python_file_have_a_function() {
        assert_eq!(file("my_envs:Maze-v0").function(), None);
        let function = file("a/b.py:make");
        assert_eq!(function.function(), Some((Path::new("a/b.py"), "make")));
    }
}
