//! The class of Python: arrays in and out, without the lock while agents act and learn.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::thread::available_parallelism;

use numpy::ndarray::{ArrayD, IxDyn};
use numpy::{Element, IntoPyArray, PyArray1, PyArrayMethods};
use pyo3::exceptions::{PyFloatingPointError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use seedbed_env::{Choice, TaskSpec};
use seedbed_learn::team::Workers;
use serde::{Deserialize, Serialize};

use super::arrays::{read_flags, read_numbers};
use super::rounds::{Refusal, StepResult, TeamRounds};
use super::settings::{GivenAction, GivenQuantity, GivenSettings, TeamSettings};
use crate::sealed::{damaged, open, seal};
use crate::tasks::{MAX_THREADS, Threads, checked_count};

/// Beginning of the bytes of a saved team; the last byte is the version of the format.
const MAGIC: [u8; 8] = *b"sb_team\x01";

/// What the bytes are, in messages.
const WHAT: &str = "a saved team";

/// Maximum number of steps of an episode.
const MAX_STEPS: u32 = 100_000_000;

/// A team of agents that learn in a training loop of Python; see `seedbed.Team`.
#[pyclass(module = "seedbed._native")]
pub(crate) struct Team {
    rounds: TeamRounds,
    threads: Threads,
    /// Shape of the observation of one agent.
    observation_shape: Vec<usize>,
    form: ActionForm,
    /// Memory for the arrays of one step.
    rows: Rows,
}

/// The arrays of one step, with a row per agent.
#[derive(Default)]
struct Rows {
    observations: Vec<f32>,
    final_observations: Vec<f32>,
    rewards: Vec<f32>,
    terminated: Vec<bool>,
    truncated: Vec<bool>,
}

/// How the actions of all agents are returned.
enum ActionForm {
    /// An index of each agent: int64, `[K]`.
    Index,
    /// Several indices of each agent: int64, `[K, components]`.
    Indices {
        /// Number of components.
        width: usize,
    },
    /// Numbers in these ranges; of a discrete component its index: float32, `[K, components]`.
    Numbers(Vec<[f32; 2]>),
}

/// The content of a saved team.
#[derive(Serialize, Deserialize)]
struct Saved {
    settings: GivenSettings,
    observation_shape: Vec<usize>,
    rounds: Vec<u8>,
}

#[pymethods]
impl Team {
    #[new]
    #[pyo3(signature = (
        algorithm, agents, task, observations, actions, observation_shape, *, seed, max_episode_steps, episodes,
        learn_every, counts_team_steps, autoreset, threads, notes
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        algorithm: String,
        agents: String,
        task: String,
        observations: Vec<GivenQuantity>,
        actions: Vec<GivenAction>,
        observation_shape: Vec<usize>,
        seed: u64,
        max_episode_steps: u32,
        episodes: Option<u32>,
        learn_every: Option<u32>,
        counts_team_steps: bool,
        autoreset: String,
        threads: Option<i64>,
        notes: String,
    ) -> PyResult<Self> {
        let counts = [
            ("max_episode_steps", Some(max_episode_steps)),
            ("episodes", episodes),
            ("learn_every", learn_every),
        ];
        for (name, count) in counts {
            checked_count(name, count.unwrap_or(1).into(), MAX_STEPS as usize)?;
        }
        let given = GivenSettings {
            algorithm,
            agents,
            task,
            observations,
            actions,
            seed,
            max_episode_steps,
            episodes,
            learn_every,
            counts_team_steps,
            autoreset,
            notes,
        };
        Self::build(given, observation_shape, threads)
    }

    /// The team that `save` returned.
    #[staticmethod]
    fn load(bytes: &[u8], threads: Option<i64>) -> PyResult<Self> {
        let content = open(MAGIC, bytes, WHAT).map_err(PyValueError::new_err)?;
        let saved: Saved =
            postcard::from_bytes(content).map_err(|_| PyValueError::new_err(damaged(WHAT)))?;
        let mut team = Self::build(saved.settings, saved.observation_shape, threads)?;
        let restored = guarded(|| team.rounds.restore(&saved.rounds))?;
        restored.map_err(PyValueError::new_err)?;
        Ok(team)
    }

    /// The whole state of the team between two rounds.
    fn save<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let saved = Saved {
            settings: self.rounds.settings().given.clone(),
            observation_shape: self.observation_shape.clone(),
            rounds: self.rounds.save().map_err(exception)?,
        };
        let content = postcard::to_stdvec(&saved);
        let content = content.expect("plain numbers in memory can always be written");
        Ok(PyBytes::new(py, &seal(MAGIC, &content)))
    }

    /// Number of agents K.
    #[getter]
    fn agents(&self) -> usize {
        self.rounds.settings().agent_count()
    }

    /// Number of finished rounds.
    #[getter]
    fn round(&self) -> u32 {
        self.rounds.round()
    }

    /// The run seed.
    #[getter]
    fn seed(&self) -> u64 {
        self.rounds.settings().given.seed
    }

    /// RON of the algorithm.
    #[getter]
    fn algorithm(&self) -> &str {
        &self.rounds.settings().given.algorithm
    }

    /// Mode in which environments are reset.
    #[getter]
    fn autoreset(&self) -> &str {
        &self.rounds.settings().given.autoreset
    }

    /// What the constructor was given.
    #[getter]
    fn notes(&self) -> &str {
        &self.rounds.settings().given.notes
    }

    /// Number of threads on which agents learn.
    #[getter]
    fn threads(&self) -> usize {
        self.threads.count()
    }

    /// Whether each agent has ended the episodes of the round.
    #[getter]
    fn ready(&self) -> bool {
        self.rounds.is_ready()
    }

    /// Whether each agent is playing an episode (bool, `[K]`).
    #[getter]
    fn playing<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.rounds.playing().into_pyarray(py)
    }

    /// Starts new episodes of all agents, or of those that `mask` (bool, `[K]`) selects.
    #[pyo3(signature = (observations, mask = None))]
    fn start(
        &mut self,
        observations: &Bound<'_, PyAny>,
        mask: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        self.read_observations(observations)?;
        let mut is_selected = vec![true; self.agents()];
        if let Some(mask) = mask {
            read_flags(mask, "mask", self.agents(), &mut is_selected)?;
        }
        let started = self.rounds.start(&self.rows.observations, &is_selected);
        started.map_err(exception)
    }

    /// The actions of all agents in their observations.
    fn act<'py>(
        &mut self,
        py: Python<'py>,
        observations: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.read_observations(observations)?;
        let (rounds, rows) = (&mut self.rounds, &self.rows);
        let acted = py.detach(|| guarded(|| rounds.act(&rows.observations)))?;
        let actions = acted.map_err(exception)?;
        self.form.array(py, actions)
    }

    /// The result of a step of all environments.
    #[pyo3(signature = (observations, rewards, terminated, truncated, final_observations = None))]
    fn record(
        &mut self,
        py: Python<'_>,
        observations: &Bound<'_, PyAny>,
        rewards: &Bound<'_, PyAny>,
        terminated: &Bound<'_, PyAny>,
        truncated: &Bound<'_, PyAny>,
        final_observations: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let count = self.agents();
        self.read_observations(observations)?;
        let shape = self.shape();
        let rows = &mut self.rows;
        read_numbers(rewards, "rewards", &[count], &mut rows.rewards)?;
        read_flags(terminated, "terminated", count, &mut rows.terminated)?;
        read_flags(truncated, "truncated", count, &mut rows.truncated)?;
        if let Some(given) = final_observations {
            let name = "final observations";
            read_numbers(given, name, &shape, &mut rows.final_observations)?;
        }
        let result = StepResult {
            observations: &rows.observations,
            final_observations: final_observations.map(|_| &rows.final_observations[..]),
            rewards: &rows.rewards,
            terminated: &rows.terminated,
            truncated: &rows.truncated,
        };
        let (rounds, workers) = (&mut self.rounds, Workers::new(self.threads.pool()?));
        let recorded = py.detach(|| guarded(|| rounds.record(&result, workers)))?;
        recorded.map_err(exception)
    }

    /// All agents learn; returns numbers of the update by name (float64, `[K]`).
    fn learn<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (rounds, workers) = (&mut self.rounds, Workers::new(self.threads.pool()?));
        let learned = py.detach(|| guarded(|| rounds.learn(workers)))?;
        let metrics = PyDict::new(py);
        for (name, numbers) in learned.map_err(exception)? {
            metrics.set_item(name, numbers.into_pyarray(py))?;
        }
        Ok(metrics)
    }

    /// Metadata of the parameters: texts by key.
    fn metadata(&self) -> BTreeMap<&'static str, String> {
        let TeamSettings {
            given,
            algorithm,
            agents,
            spec,
            ..
        } = self.rounds.settings();
        algorithm.tensor_metadata(spec, agents.count.get(), given.seed)
    }

    /// The parameters of all networks by name (float32).
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let parameters = PyDict::new(py);
        for tensor in self.rounds.tensors() {
            let array = ArrayD::from_shape_vec(IxDyn(&tensor.shape), tensor.values.into_owned());
            let array = array.map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
            parameters.set_item(tensor.name, array.into_pyarray(py))?;
        }
        Ok(parameters)
    }
}

impl Team {
    fn build(
        given: GivenSettings,
        observation_shape: Vec<usize>,
        threads: Option<i64>,
    ) -> PyResult<Self> {
        let settings = TeamSettings::new(given)?;
        let count = settings.agent_count();
        let threads = match threads {
            None => available_parallelism().map_or(1, usize::from),
            Some(threads) => checked_count("threads", threads, MAX_THREADS)?,
        };
        Ok(Self {
            form: ActionForm::of(&settings.spec),
            rounds: guarded(|| TeamRounds::new(settings))?,
            threads: Threads::new(threads.min(count))?,
            observation_shape,
            rows: Rows::default(),
        })
    }

    /// Shape of the observations of all agents.
    fn shape(&self) -> Vec<usize> {
        [&[self.agents()], &self.observation_shape[..]].concat()
    }

    fn read_observations(&mut self, given: &Bound<'_, PyAny>) -> PyResult<()> {
        let shape = self.shape();
        read_numbers(given, "observations", &shape, &mut self.rows.observations)
    }
}

impl ActionForm {
    fn of(spec: &TaskSpec) -> Self {
        let is_discrete = |choice: &Choice| matches!(choice, Choice::Discrete(_));
        match &spec.actions[..] {
            [action] if is_discrete(&action.choice) => Self::Index,
            actions if actions.iter().all(|action| is_discrete(&action.choice)) => Self::Indices {
                width: actions.len(),
            },
            actions => {
                let range = |action: &seedbed_env::Action| match &action.choice {
                    Choice::Discrete(values) => [0.0, (values.len() - 1) as f32],
                    Choice::Continuous => action.quantity.range,
                };
                Self::Numbers(actions.iter().map(range).collect())
            }
        }
    }

    /// The actions of all agents as an array.   `actions: [K × components]`
    fn array<'py>(&self, py: Python<'py>, actions: &[f32]) -> PyResult<Bound<'py, PyAny>> {
        let indices = || {
            actions
                .iter()
                .map(|&action| action as i64)
                .collect::<Vec<i64>>()
        };
        Ok(match self {
            Self::Index => indices().into_pyarray(py).into_any(),
            Self::Indices { width } => matrix(py, indices(), *width)?,
            Self::Numbers(ranges) => {
                let clamped = actions.iter().zip(ranges.iter().cycle());
                let clamped = clamped.map(|(action, [low, high])| action.clamp(*low, *high));
                matrix(py, clamped.collect::<Vec<f32>>(), ranges.len())?
            }
        })
    }
}

/// Numbers as an array of rows.
fn matrix<T: Element>(py: Python<'_>, numbers: Vec<T>, width: usize) -> PyResult<Bound<'_, PyAny>> {
    let rows = numbers.len() / width;
    let array = numbers.into_pyarray(py).reshape([rows, width])?;
    Ok(array.into_any())
}

fn exception(refusal: Refusal) -> PyErr {
    match refusal {
        Refusal::Value(message) => PyValueError::new_err(message),
        Refusal::Order(message) => PyRuntimeError::new_err(message),
        Refusal::Diverged(message) => PyFloatingPointError::new_err(message),
    }
}

/// The result of some work. If it panics, this is an exception like any other.
fn guarded<T>(work: impl FnOnce() -> T) -> PyResult<T> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
        PyRuntimeError::new_err(format!(
            "the team failed: {}; load one that was saved before",
            text.unwrap_or("no reason is known")
        ))
    })
}
