//! Scenarios: which environment, which team, which algorithm, for how long. The RON that a
//! researcher writes.
//!
//! [`load`] reads a file and applies overrides; [`Scenario::resolved`] writes a scenario with every
//! default spelled out. Building and running may not enter.

mod catalogue;
pub mod overrides;

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::record::RecordingSettings;
use seedbed_env::input::numbers::{Count, FiniteNumber, known_count};
use seedbed_env::input::{self, Document, InputError, Located, ValidationError};
use seedbed_env::{Physics, Spec};
use seedbed_learn::agent::TeamConfig;
use seedbed_learn::algorithms::{Algorithm, ScheduleError, ScheduleKind};

/// A scenario file: `Scenario(…)` in `scenarios/`.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// The task: the stem of a file in `envs/`, or the path of a file.
    pub environment: Located<String>,
    /// Rigid bodies, or the analytic model of a task that has one.
    #[serde(default)]
    pub physics: Physics,
    /// How many agents, and how they differ.
    #[serde(default)]
    #[schemars(skip)]
    pub agents: TeamConfig,
    /// How they learn.
    #[serde(default = "default_algorithm")]
    #[schemars(skip)]
    pub algorithm: Located<Algorithm>,
    /// When agents learn.
    #[serde(default)]
    pub schedule: Schedule,
    /// When the run ends.
    #[serde(default)]
    pub stop: Stop,
    /// What the recording shows.
    #[serde(default)]
    #[schemars(skip)]
    pub recording: RecordingSettings,
    /// Rounds between two checkpoints.
    #[serde(default = "default_checkpoint_every")]
    pub checkpoint_every: Count,
    /// The run's seed, from which every random number derives.
    #[serde(default)]
    pub seed: u64,
}

/// When agents learn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Schedule {
    /// In rounds: when every agent has finished its episodes, all learn at once.
    Synchronous {
        /// Episodes of each agent in a round.
        #[serde(default = "one")]
        episodes: Count<10_000>,
    },
    /// An agent whose episode has ended learns at once from all that has reached it, while the
    /// others go on (thesis Fig. 5.2).
    Asynchronous {
        /// How long learning takes.
        #[serde(default)]
        training: Training,
    },
    /// All agents step at once, and after every so many steps all learn from the newest
    /// transitions, in the middle of their episodes: for value-based learners. A round is an
    /// episode of each.
    Lockstep {
        /// Steps of each agent between two times of learning.
        #[serde(default = "default_learn_every")]
        learn_every: Count,
    },
}

/// How long an update takes in the time of the environments, so that a schedule is the same on any
/// machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Training {
    /// Steps that the others make meanwhile.
    pub env_steps: u32,
}

/// When the run ends.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Stop {
    /// After so many episodes of each agent.
    Episodes(Count),
    /// When the mean over agents and over a full trailing window of episodes reaches a return.
    Solved {
        /// The return to reach.
        r#return: FiniteNumber,
        /// Episodes of each agent in the window.
        #[serde(default = "default_window")]
        window: Located<Count>,
        /// Episodes of each agent after which the run ends even so.
        at_most: Count,
    },
}

impl Schedule {
    /// Which of the kinds it is.
    #[must_use]
    pub fn kind(self) -> ScheduleKind {
        match self {
            Self::Synchronous { .. } => ScheduleKind::Synchronous,
            Self::Asynchronous { .. } => ScheduleKind::Asynchronous,
            Self::Lockstep { .. } => ScheduleKind::Lockstep,
        }
    }
}

impl Stop {
    /// Maximal number of episodes of each agent.
    #[must_use]
    pub fn max_episodes(&self) -> u32 {
        match self {
            Self::Episodes(count) | Self::Solved { at_most: count, .. } => count.get(),
        }
    }

    /// When a task counts as solved: as this says, or else as the task does, over 25 episodes.
    #[must_use]
    pub fn threshold(&self, task: &Spec) -> Option<Threshold> {
        match self {
            Self::Solved {
                r#return, window, ..
            } => Some(Threshold {
                r#return: r#return.get(),
                window: window.get() as usize,
            }),
            Self::Episodes(_) => task.reward_threshold.map(|r#return| Threshold {
                r#return: f64::from(r#return),
                window: DEFAULT_WINDOW as usize,
            }),
        }
    }
}

/// When a task counts as solved: the mean over agents and over a full trailing window of episodes
/// reaches a return.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Threshold {
    /// The return to reach.
    pub r#return: f64,
    /// Number of episodes of each agent in the window.
    pub window: usize,
}

/// Number of episodes of each agent over which a task has to be solved, if nothing else is said.
const DEFAULT_WINDOW: u32 = 25;

impl Default for Schedule {
    fn default() -> Self {
        Self::Synchronous { episodes: one() }
    }
}

impl Default for Stop {
    fn default() -> Self {
        Self::Episodes(known_count(200))
    }
}

fn default_algorithm() -> Located<Algorithm> {
    Algorithm::SeedPg(Box::default()).into()
}

fn default_checkpoint_every() -> Count {
    known_count(25)
}

fn default_window() -> Located<Count> {
    known_count(DEFAULT_WINDOW).into()
}

fn default_learn_every() -> Count {
    known_count(10)
}

fn one() -> Count<10_000> {
    known_count(1)
}

/// Reads the scenario at `path` and applies `overrides`, each as `path.to.field=value`.
///
/// # Errors
/// The file or an override is wrong.
pub fn load(path: &Path, overrides: &[String]) -> Result<Document<Scenario>, InputError> {
    overrides::apply_all(input::read(path)?, overrides)
}

/// The file that a scenario's `environment` names: a path, taken from the scenario's folder, or the
/// stem of a file in the nearest folder `envs` on the way up from the scenario or from the working
/// directory.
///
/// # Errors
/// There is no such file; says where it was looked for and what there is.
pub fn environment_path(
    scenario: &Document<Scenario>,
    scenario_path: &Path,
) -> Result<PathBuf, InputError> {
    let name = &scenario.value.environment;
    let folder = scenario_path.parent().unwrap_or(Path::new("."));
    let starts = [
        folder.canonicalize().unwrap_or_default(),
        std::env::current_dir().unwrap_or_default(),
    ];
    if name.ends_with(".ron") {
        let path = folder.join(name.as_str());
        if path.is_file() {
            return Ok(path);
        }
        return Err(scenario.locate(name.error(format!("no file {}", path.display()))));
    }
    task_file(name, &starts).map_err(|known| {
        scenario.locate(name.unknown_name("environment", known.iter().map(String::as_str)))
    })
}

/// The file of the task `name` in the nearest folder `envs` on the way up from the first of
/// `starts` that has it.
///
/// # Errors
/// The names of all tasks that were found instead.
pub fn task_file(name: &str, starts: &[PathBuf]) -> Result<PathBuf, Vec<String>> {
    let file = format!("{name}.ron");
    let found = starts
        .iter()
        .find_map(|start| input::find_upwards(start, "envs", &file));
    found
        .map(|path| shortened(&path))
        .ok_or_else(|| known_environments(starts))
}

impl Scenario {
    /// A scenario of nothing but defaults, in a task without a name.
    fn shortest() -> Self {
        Self {
            environment: String::new().into(),
            physics: Physics::default(),
            agents: TeamConfig::default(),
            algorithm: default_algorithm(),
            schedule: Schedule::default(),
            stop: Stop::default(),
            recording: RecordingSettings::default(),
            checkpoint_every: default_checkpoint_every(),
            seed: 0,
        }
    }

    /// What no single field can tell.
    ///
    /// # Errors
    /// The field to blame, and why.
    pub fn check(&self) -> Result<(), ValidationError> {
        self.algorithm.config().check()?;
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
        let curious = self.algorithm.largest_intrinsic_reward().is_some();
        self.recording.check(
            self.agents.count.get(),
            curious,
            self.algorithm.config().estimates_advantages(),
        )
    }

    /// Checks whether the algorithm can learn when the schedule says.
    fn check_schedule(&self) -> Result<(), ValidationError> {
        let checked = self.algorithm.config().check_schedule(self.schedule.kind());
        checked.map_err(|error| match error {
            ScheduleError::Algorithm(message) => self.algorithm.error(message),
            ScheduleError::Parameter(error) => error,
        })
    }

    /// The scenario as a file with every default spelled out.
    #[must_use]
    pub fn resolved(&self) -> String {
        overrides::spelled_out("Scenario", self)
    }

    /// Maximal number of episodes of each agent.
    #[must_use]
    pub fn max_episodes(&self) -> u32 {
        self.stop.max_episodes()
    }
}

impl overrides::Resolve for Scenario {
    fn resolved(&self) -> String {
        self.resolved()
    }
}

/// The stems of all files in the `envs` folders that would be searched.
fn known_environments(starts: &[PathBuf]) -> Vec<String> {
    let folders = starts
        .iter()
        .flat_map(|start| input::folders_upwards(start, "envs"));
    let entries = folders
        .filter_map(|folder| std::fs::read_dir(folder).ok())
        .flatten()
        .flatten()
        .map(|entry| entry.path());
    let files = entries.filter(|path| path.extension().is_some_and(|extension| extension == "ron"));
    let mut stems: Vec<String> = files
        .filter_map(|path| path.file_stem()?.to_str().map(str::to_owned))
        .collect();
    stems.sort();
    stems.dedup();
    stems
}

/// The path from the working directory, where it lies below.
#[must_use]
pub fn shortened(path: &Path) -> PathBuf {
    let below = std::env::current_dir()
        .ok()
        .and_then(|here| path.strip_prefix(here).ok().map(Path::to_owned));
    below.unwrap_or_else(|| path.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shortest_scenario_resolves_to_one_that_reads_back_the_same() {
        let short: Document<Scenario> =
            input::parse("test", r#"Scenario(environment: "cartpole")"#.to_owned()).unwrap();
        let text = short.value.resolved();
        assert!(
            text.starts_with("Scenario(\n    environment: \"cartpole\",\n"),
            "{text}"
        );
        assert!(text.contains("algorithm: SeedPg(\n"), "{text}");
        let again: Document<Scenario> = input::parse("test", text).unwrap();
        assert_eq!(short.value, again.value);
    }
}
