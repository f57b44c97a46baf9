//! Scenario files: environment, team, algorithm, schedule and end of a training run.
//!
//! [`overrides::parse`] reads a file, and `overrides::apply` replaces values; [`Scenario::resolved`] prints a scenario with all
//! defaults. Must not depend on how scenarios are run.

mod catalog;
pub mod overrides;
pub mod recording;
pub mod resolve;
pub mod synonyms;
mod task_reference;
mod threshold;

pub use self::task_reference::TaskReference;
pub use self::threshold::{Rounding, Threshold};
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::input_files::{self, Directory};
use crate::scenario::recording::RecordingSettings;
use seedbed_env::gymnasium::{GymnasiumFile, GymnasiumTask};
use seedbed_env::{Physics, TaskDescription, TaskSpec};
use seedbed_input::edit::to_ron_string;
use seedbed_input::numbers::{Count, FiniteNumber, PositiveFraction, ranged_count, ranged_number};
use seedbed_input::{Document, InputError, Located, ValidationError};
use seedbed_learn::agent::TeamConfig;
use seedbed_learn::algorithms::catalog::Parameter;
use seedbed_learn::algorithms::{Algorithm, ScheduleError, ScheduleKind};

/// A scenario file: `Scenario(…)` in `scenarios/`.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Name of the scenario; by default that of its file. The copy in the folder of a run has it.
    #[serde(default, skip_serializing_if = "is_unnamed")]
    #[schemars(skip)]
    pub name: Located<String>,
    /// The task: name of a file in `envs/`, without `.ron`, or path of a file; or an environment of
    /// Gymnasium, `Gymnasium(id: "CartPole-v1")`.
    pub environment: Located<TaskReference>,
    /// Physics engine: rigid bodies, or the task's analytic model if it has one.
    #[serde(default)]
    pub physics: Physics,
    /// Number of agents, and how they differ.
    #[serde(default)]
    #[schemars(skip)]
    pub agents: TeamConfig,
    /// How the agents learn.
    #[serde(default = "default_algorithm")]
    #[schemars(skip)]
    pub algorithm: Located<Algorithm>,
    /// When the agents learn.
    #[serde(default)]
    pub schedule: Schedule,
    /// When the run ends.
    #[serde(default)]
    pub stop: Stop,
    /// What the recording shows.
    #[serde(default)]
    #[schemars(skip)]
    pub recording: RecordingSettings,
    /// Number of rounds between two checkpoints.
    #[serde(default = "default_checkpoint_every")]
    pub checkpoint_every: Count,
    /// Largest share of the time that checkpoints may take; those that would take more are left out.
    #[serde(default = "default_checkpoint_share")]
    pub checkpoint_share: PositiveFraction,
    /// Run seed, from which all random numbers are derived.
    #[serde(default)]
    pub seed: u64,
}

/// When agents learn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Schedule {
    /// In rounds: all agents learn when every agent has finished its episodes.
    Synchronous {
        /// Number of episodes per agent and round.
        #[serde(default = "one")]
        episodes: Count<10_000>,
    },
    /// Each agent learns when its episode ends, from all episodes that it has received, while the
    /// others continue (thesis Fig. 5.2).
    Asynchronous {
        /// Duration of learning.
        #[serde(default)]
        training: Training,
    },
    /// All agents act step by step, and learn from the newest transitions during their episodes:
    /// for value-based learners. A round is one episode per agent.
    Lockstep {
        /// Number of steps between two updates.
        #[serde(default = "default_learn_every")]
        learn_every: Count,
        /// Whose steps these are.
        #[serde(default)]
        steps_of: StepsOf,
    },
}

impl Schedule {
    /// Number of episodes that each agent plays in a round.
    #[must_use]
    pub fn episodes_per_round(self) -> u32 {
        match self {
            Self::Synchronous { episodes } => episodes.get(),
            Self::Lockstep { .. } | Self::Asynchronous { .. } => 1,
        }
    }
}

/// Whose steps are counted between two updates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum StepsOf {
    /// Those of one agent: the number of updates does not depend on the number of agents.
    #[default]
    Agent,
    /// Those of the whole team: K agents have K times as many updates as one. Several updates may
    /// follow one step.
    Team,
}

/// Duration of an update in simulated time, so that a schedule is the same on all machines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Training {
    /// Number of steps that other agents make during an update.
    pub env_steps: u32,
}

/// When the run ends.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Stop {
    /// After this number of episodes per agent.
    Episodes(Count),
    /// When the mean over agents and over a full trailing window of episodes reaches a return.
    Solved {
        /// Mean return to reach.
        r#return: FiniteNumber,
        /// Number of episodes per agent in the window.
        #[serde(default = "default_window")]
        window: Located<Count>,
        /// Max number of episodes per agent, after which the run ends in any case.
        at_most: Count,
    },
    /// After the round in which the team has made a number of environment steps in total.
    Steps {
        /// Number of environment steps of the whole team.
        team: Count<4_000_000_000>,
        /// Max number of episodes per agent, after which the run ends in any case.
        at_most: Count,
    },
}

impl Schedule {
    /// Kind of schedule.
    #[must_use]
    pub fn kind(self) -> ScheduleKind {
        match self {
            Self::Synchronous { episodes } => ScheduleKind::Synchronous {
                episodes: episodes.get(),
            },
            Self::Asynchronous { .. } => ScheduleKind::Asynchronous,
            Self::Lockstep { .. } => ScheduleKind::Lockstep,
        }
    }
}

impl Stop {
    /// Max number of episodes per agent.
    #[must_use]
    pub fn max_episodes(&self) -> u32 {
        match self {
            Self::Episodes(count)
            | Self::Solved { at_most: count, .. }
            | Self::Steps { at_most: count, .. } => count.get(),
        }
    }

    /// Number of environment steps of the whole team after which the run ends; `None` if the run
    /// does not depend on it.
    #[must_use]
    pub fn max_env_steps(&self) -> Option<u64> {
        match self {
            Self::Steps { team, .. } => Some(u64::from(team.get())),
            Self::Episodes(_) | Self::Solved { .. } => None,
        }
    }

    /// When a task counts as solved: at the return and window set here; otherwise at the return set
    /// in the task's file, over a window of 25 episodes. `None` if neither is set.
    #[must_use]
    pub fn threshold(&self, task: &TaskSpec) -> Option<Threshold> {
        match self {
            Self::Solved {
                r#return, window, ..
            } => Some(Threshold {
                r#return: r#return.get(),
                window: window.get() as usize,
            }),
            Self::Episodes(_) | Self::Steps { .. } => {
                task.reward_threshold.map(|r#return| Threshold {
                    r#return: f64::from(r#return),
                    window: DEFAULT_WINDOW as usize,
                })
            }
        }
    }
}

/// Default window, in episodes per agent.
const DEFAULT_WINDOW: u32 = 25;

impl Default for Schedule {
    fn default() -> Self {
        Self::Synchronous { episodes: one() }
    }
}

impl Default for Stop {
    fn default() -> Self {
        Self::Episodes(ranged_count(200))
    }
}

fn default_algorithm() -> Located<Algorithm> {
    Algorithm::SeedPg(Box::default()).into()
}

fn default_checkpoint_every() -> Count {
    ranged_count(1)
}

fn default_checkpoint_share() -> PositiveFraction {
    ranged_number(0.01)
}

fn default_window() -> Located<Count> {
    ranged_count(DEFAULT_WINDOW).into()
}

fn default_learn_every() -> Count {
    ranged_count(10)
}

fn one() -> Count<10_000> {
    ranged_count(1)
}

/// Reads and checks the task of a scenario. Also returns the text of a task file that describes the same
/// task alone.
///
/// # Errors
/// There is no such task, or something in it is wrong.
pub fn read_task(
    scenario: &Document<Scenario>,
    scenario_path: &Path,
) -> Result<(TaskDescription, String), InputError> {
    let environment = &scenario.value.environment;
    let TaskReference::Gymnasium(file) = environment.value() else {
        return input_files::read_task(&environment_path(scenario, scenario_path)?);
    };
    let word = seedbed_settings::opening(&scenario.text, "environment");
    if word.is_some_and(|word| word != "Gymnasium") {
        let message = "expected the name of a task in quotes, or `Gymnasium(id: \"…\")`";
        return Err(scenario.locate(environment.error(message)));
    }
    let folder = folder_of_python_file(file, scenario_path);
    let task = GymnasiumTask::new(
        &file.task_name(),
        &scenario.origin,
        &folder,
        (**file).clone(),
    );
    let task = task.map_err(|error| scenario.locate(error))?;
    let text = task.text();
    Ok((task.into(), text))
}

/// Paths of the files that the task of a scenario is read from.
///
/// # Errors
/// See [`read_task`].
pub fn files_of_task(
    scenario: &Document<Scenario>,
    scenario_path: &Path,
) -> Result<Vec<PathBuf>, InputError> {
    if scenario.value.environment.named().is_some() {
        return input_files::files_of_task(&environment_path(scenario, scenario_path)?);
    }
    let (task, _) = read_task(scenario, scenario_path)?;
    let python_file = task.gymnasium().and_then(GymnasiumTask::python_file);
    Ok(python_file.into_iter().collect())
}

/// Where the Python file of an environment is: beside the scenario, or in the working directory, as an
/// override on the command line may mean it.
fn folder_of_python_file(file: &GymnasiumFile, scenario_path: &Path) -> PathBuf {
    let folder = input_files::folder_of(scenario_path);
    let is_there = |folder: &Path| {
        let function = file.function();
        function.is_none_or(|(path, _)| folder.join(path).is_file())
    };
    if input_files::is_builtin(&folder) || (!is_there(&folder) && is_there(Path::new(""))) {
        PathBuf::new()
    } else {
        folder
    }
}

/// Path of the file that a scenario's `environment` names. A name is looked up in the nearest
/// directory `envs` above the scenario or else above the working directory, and then among the
/// built-in tasks; a path is relative to the scenario. Built-in scenarios use built-in tasks, so
/// that they do not depend on the working directory, unless an override names another task.
///
/// # Errors
/// If there is no such file, with the names that exist.
pub fn environment_path(
    scenario: &Document<Scenario>,
    scenario_path: &Path,
) -> Result<PathBuf, InputError> {
    let environment = &scenario.value.environment;
    let name = environment.named().unwrap_or_default();
    let folder = if is_override_of_builtin(name, scenario_path)? {
        PathBuf::new()
    } else {
        input_files::folder_of(scenario_path)
    };
    if seedbed_input::is_ron(Path::new(name)) {
        let path = folder.join(name);
        if path.is_file() {
            return Ok(path);
        }
        return Err(scenario.locate(environment.error(format!("no file {}", path.display()))));
    }
    let start_folders = input_files::start_folders(&folder);
    input_files::find(name, Directory::Environments, &start_folders).map_err(|known| {
        let error = environment.unknown_name("environment", known.iter().map(String::as_str));
        scenario.locate(error.or_help("`seedbed list environments` lists them"))
    })
}

/// Whether a scenario is built in, but the name of its task is not that in its file: a user has
/// given it, who knows the working directory.
fn is_override_of_builtin(name: &str, scenario_path: &Path) -> Result<bool, InputError> {
    if !input_files::is_builtin(scenario_path) {
        return Ok(false);
    }
    let unchanged: Document<Scenario> = input_files::read(scenario_path)?;
    Ok(unchanged.value.environment.named() != Some(name))
}

/// How a scenario names the task `envs/TASK.ron` in its own folder, whose directory `envs` is the
/// nearest. The name of a task that ends in `.ron` would be a path.
pub(crate) fn environment_in_folder(task: &str) -> Located<TaskReference> {
    let is_path_like = Path::new(task).extension().is_some_and(|end| end == "ron");
    let name = if is_path_like {
        format!("envs/{task}.ron")
    } else {
        task.to_owned()
    };
    TaskReference::Named(name).into()
}

fn is_unnamed(name: &Located<String>) -> bool {
    name.is_empty()
}

impl Scenario {
    /// A scenario with all defaults and an unnamed task.
    fn with_defaults() -> Self {
        Self {
            name: Located::default(),
            environment: TaskReference::default().into(),
            physics: Physics::default(),
            agents: TeamConfig::default(),
            algorithm: default_algorithm(),
            schedule: Schedule::default(),
            stop: Stop::default(),
            recording: RecordingSettings::default(),
            checkpoint_every: default_checkpoint_every(),
            checkpoint_share: default_checkpoint_share(),
            seed: 0,
        }
    }

    /// Checks whether the values of different fields contradict each other.
    ///
    /// # Errors
    /// The first contradiction, with the field that is to be changed.
    pub fn check(&self) -> Result<(), ValidationError> {
        if !is_unnamed(&self.name)
            && Path::new(self.name.as_str())
                .file_name()
                .is_none_or(|name| name != self.name.as_str())
        {
            let message = "expected a name that a folder can have, without `/`";
            return Err(self.name.error(message));
        }
        self.algorithm.config().check()?;
        self.algorithm.config().check_team(&self.agents)?;
        self.check_schedule()?;
        if let Stop::Solved {
            window, at_most, ..
        } = &self.stop
            && window.get() > at_most.get()
        {
            return Err(window.error(format!(
                "expected a window of at most the {} episodes of `at_most`",
                at_most.get()
            )));
        }
        let has_intrinsic_reward = self.algorithm.largest_intrinsic_reward().is_some();
        self.recording.check(
            self.agents.count.get(),
            has_intrinsic_reward,
            self.algorithm.config().estimates_advantages(),
        )
    }

    /// Checks whether the algorithm supports the schedule.
    fn check_schedule(&self) -> Result<(), ValidationError> {
        let checked = self.algorithm.config().check_schedule(self.schedule.kind());
        checked.map_err(|error| match error {
            ScheduleError::Algorithm(message) => self.algorithm.error(message),
            ScheduleError::Parameter(error) => error,
        })
    }

    /// The scenario for a folder that has a copy of its task: `envs/TASK.ron`. Its name there is
    /// `name`.
    #[must_use]
    pub fn beside_its_task(&self, name: &str, task: &str) -> Self {
        Self {
            name: name.to_owned().into(),
            environment: environment_in_folder(task),
            ..self.clone()
        }
    }

    /// Text of the scenario's file with all defaults.
    #[must_use]
    pub fn resolved(&self) -> String {
        to_ron_string("Scenario", self)
    }

    /// Max number of episodes per agent.
    #[must_use]
    pub fn max_episodes(&self) -> u32 {
        self.stop.max_episodes()
    }
}

impl resolve::Resolve for Scenario {
    fn resolved(&self) -> String {
        self.resolved()
    }

    fn parameters() -> Vec<Parameter> {
        Self::catalog()
    }

    fn check(&self) -> Result<(), ValidationError> {
        self.check()
    }

    fn examples(text: &str) -> Vec<String> {
        let algorithm = synonyms::algorithm_in(text);
        let with =
            |end| format!("Scenario(environment: \"cartpole\", algorithm: {algorithm}{end})");
        vec![
            with("()"),
            with(""),
            "Scenario(environment: \"cartpole\")".to_owned(),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shortest_scenario_resolves_to_one_that_reads_back_the_same() {
        let short: Document<Scenario> =
            seedbed_input::parse("test", r#"Scenario(environment: "cartpole")"#.to_owned())
                .unwrap();
        let text = short.value.resolved();
        assert!(
            text.starts_with("Scenario(\n    environment: \"cartpole\",\n"),
            "{text}"
        );
        assert!(text.contains("algorithm: SeedPg(\n"), "{text}");
        let again: Document<Scenario> = seedbed_input::parse("test", text).unwrap();
        assert_eq!(short.value, again.value);
    }
}
