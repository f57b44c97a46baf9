//! What a team is made of: the algorithm, its agents, what they observe and do, and when they learn.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use seedbed_env::{Action, Choice, Quantity, TaskSpec};
use seedbed_input::Document;
use seedbed_learn::agent::TeamConfig;
use seedbed_learn::algorithms::{Algorithm, ScheduleError, ScheduleKind};
use seedbed_learn::team::{LearningTeam, LearningTiming, TeamContext};
use serde::{Deserialize, Serialize};

use crate::tasks::{Autoreset, parse_autoreset};

/// An observed number: name, unit, and the ends of its range.
pub(super) type GivenQuantity = (String, String, f32, f32);

/// A component of an action: its range, and the values of a discrete one.
pub(super) type GivenAction = (GivenQuantity, Option<Vec<f32>>);

/// What Python gives, and what a saved team has.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct GivenSettings {
    /// RON of the algorithm and of its agents.
    pub(super) algorithm: String,
    pub(super) agents: String,
    /// Name of the task, for people.
    pub(super) task: String,
    pub(super) observations: Vec<GivenQuantity>,
    pub(super) actions: Vec<GivenAction>,
    pub(super) seed: u64,
    /// Maximal number of steps of an episode.
    pub(super) max_episode_steps: u32,
    /// Number of episodes that each agent plays per round before it waits; `None` if agents play on.
    pub(super) episodes: Option<u32>,
    /// Number of steps between two updates during episodes; `None` if agents learn after episodes.
    pub(super) learn_every: Option<u32>,
    /// Whether these are steps of the whole team.
    pub(super) counts_team_steps: bool,
    pub(super) autoreset: String,
    /// What the module in Python wants to know when the team is loaded.
    pub(super) notes: String,
}

/// Checked settings.
pub(super) struct TeamSettings {
    pub(super) given: GivenSettings,
    pub(super) algorithm: Algorithm,
    pub(super) agents: TeamConfig,
    pub(super) spec: TaskSpec,
    pub(super) autoreset: Autoreset,
}

impl TeamSettings {
    /// # Errors
    /// What is wrong, and what was expected.
    pub(super) fn new(given: GivenSettings) -> PyResult<Self> {
        let algorithm = parsed_algorithm(&given.algorithm)?;
        let agents = parsed::<TeamConfig>("agents", &given.agents)?;
        let autoreset = parse_autoreset(&given.autoreset)?;
        let settings = Self {
            spec: spec_of(&given),
            algorithm: algorithm.value.clone(),
            agents: agents.value.clone(),
            autoreset,
            given,
        };
        settings.check(&algorithm, &agents)?;
        Ok(settings)
    }

    /// Checks that the settings fit together.
    fn check(
        &self,
        algorithm: &Document<Algorithm>,
        agents: &Document<TeamConfig>,
    ) -> PyResult<()> {
        let config = self.algorithm.config();
        let checked = config.check();
        checked.map_err(|error| value_error(&algorithm.locate(error)))?;
        let checked = config.check_team(&self.agents);
        checked.map_err(|error| value_error(&agents.locate(error)))?;
        let kind = self.schedule();
        let checked = self.check_schedule(kind);
        checked.map_err(|error| schedule_error(error, kind, algorithm))?;
        config
            .check_task(&self.spec)
            .map_err(|error| value_error(&error))
    }

    /// Number of agents K.
    pub(super) fn agent_count(&self) -> usize {
        self.agents.count.get() as usize
    }

    /// Number of episodes that each agent ends before the team can learn.
    pub(super) fn episodes_per_round(&self) -> usize {
        self.given.episodes.unwrap_or(1) as usize
    }

    /// Checks that the algorithm can learn in this kind of schedule.
    pub(super) fn check_schedule(&self, kind: ScheduleKind) -> Result<(), ScheduleError> {
        self.algorithm.config().check_schedule(kind)
    }

    fn schedule(&self) -> ScheduleKind {
        match self.given.learn_every {
            Some(_) => ScheduleKind::Lockstep,
            None => ScheduleKind::Synchronous {
                episodes: self.given.episodes.unwrap_or(1),
            },
        }
    }

    /// A team that has not learned yet.
    pub(super) fn build(&self) -> LearningTeam {
        let timing = match self.given.learn_every {
            None => LearningTiming::AfterEpisodes,
            Some(count) if self.given.counts_team_steps => LearningTiming::EveryTransitions(count),
            Some(count) => LearningTiming::EverySteps(count),
        };
        let team = self.algorithm.config().build(&TeamContext {
            run_seed: self.given.seed,
            config: &self.agents,
            local_agents: None,
            spec: &self.spec,
            timing,
            record_advantages: false,
        });
        LearningTeam::new(team, self.algorithm.transitions_kept())
    }
}

/// Reads RON. `argument`: its name in Python
fn parsed<T: serde::de::DeserializeOwned>(argument: &str, text: &str) -> PyResult<Document<T>> {
    seedbed_input::parse(argument, text.to_owned()).map_err(|error| value_error(&error))
}

/// Reads an algorithm: its name, or RON.
fn parsed_algorithm(text: &str) -> PyResult<Document<Algorithm>> {
    let is_name = text.chars().all(|sign| sign.is_ascii_alphanumeric());
    match parsed("algorithm", text) {
        // With parameters, which all have their defaults.
        Err(_) if is_name => parsed("algorithm", &format!("{text}()")),
        parsed => parsed,
    }
}

fn value_error(error: &impl ToString) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// The exception for an algorithm that cannot learn when it was asked to, in words of Python.
fn schedule_error(
    error: ScheduleError,
    kind: ScheduleKind,
    algorithm: &Document<Algorithm>,
) -> PyErr {
    let name = algorithm.value.name();
    match (error, kind) {
        (ScheduleError::Parameter(error), _) => value_error(&algorithm.locate(error)),
        (ScheduleError::Algorithm(_), ScheduleKind::Lockstep) => value_error(&format!(
            "learn_every is given, but `{name}` learns after episodes, not during them; expected \
             learn_every=None, or an algorithm with a replay buffer such as `QLearning` or `SeedSac`"
        )),
        (ScheduleError::Algorithm(message), _) => value_error(&format!("`{name}` {message}")),
    }
}

/// What agents observe and do, as a task has it.
fn spec_of(given: &GivenSettings) -> TaskSpec {
    let quantity = |(name, unit, low, high): &GivenQuantity| Quantity {
        name: name.clone(),
        unit: unit.clone(),
        range: [*low, *high],
    };
    let action = |(range, values): &GivenAction| Action {
        quantity: quantity(range),
        choice: match values {
            Some(values) => Choice::Discrete(values.clone()),
            None => Choice::Continuous,
        },
    };
    TaskSpec {
        name: given.task.clone(),
        description: String::new(),
        observations: given.observations.iter().map(quantity).collect(),
        actions: given.actions.iter().map(action).collect(),
        control_step: 1.0,
        time_limit: given.max_episode_steps,
        reward_threshold: None,
        info: Vec::new(),
    }
}
