//! What Python sees of a task: names, units and ranges.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pyo3::create_exception;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use seedbed_env::{Choice, TaskDescription};
use seedbed_input::InputError;

use super::builtin;

create_exception!(
    seedbed,
    TaskError,
    PyValueError,
    "Something in a task file is wrong.\n\n\
     The text of the exception is the message that `seedbed check` prints: place, reason, line, and \
     what to do. Its parts are the attributes `path` (str), `line` and `column` (int, from 1, or None if \
     the error concerns the whole file), `field` (str, such as \"bodies[0].mass\", or empty), `message` \
     (str) and `help` (str or None)."
);

/// The exception for an error in a task file.
pub(super) fn task_error(py: Python<'_>, error: &InputError) -> PyErr {
    let exception = TaskError::new_err(error.to_string());
    let line = error.position.as_ref().map(|position| position.line);
    let column = error.position.as_ref().map(|position| position.column);
    let value = exception.value(py);
    let attributes = value
        .setattr("path", &error.origin)
        .and_then(|()| value.setattr("line", line))
        .and_then(|()| value.setattr("column", column))
        .and_then(|()| value.setattr("field", &error.field))
        .and_then(|()| value.setattr("message", &error.message))
        .and_then(|()| value.setattr("help", error.help.as_ref()));
    attributes.err().unwrap_or(exception)
}

/// An observed number: name, unit, and the range over which it is displayed.
///
/// Attributes:
///     name (str): Name, unique within its task.
///     unit (str): SI unit, such as "m/s"; empty for a pure number.
///     range (tuple[float, float]): Ends of the display range, in this unit. Values outside occur:
///         use it to scale observations, not as a bound.
#[pyclass(frozen, eq, get_all, module = "seedbed")]
#[derive(Clone, PartialEq)]
pub(crate) struct Quantity {
    name: String,
    unit: String,
    range: (f64, f64),
}

/// One component of an action.
///
/// Attributes:
///     name (str): Name, unique within its task.
///     unit (str): SI unit, such as "N"; empty for a pure number.
///     range (tuple[float, float]): Minimum and maximum, in this unit. A continuous action outside is
///         clamped to it.
///     values (tuple[float, ...] | None): The values that may be chosen, in this unit: the action is
///         the index of one of them. None for a continuous action.
#[pyclass(frozen, eq, module = "seedbed")]
#[derive(Clone, PartialEq)]
pub(crate) struct Action {
    #[pyo3(get)]
    name: String,
    #[pyo3(get)]
    unit: String,
    #[pyo3(get)]
    range: (f64, f64),
    values: Option<Vec<f64>>,
}

/// A task, read from a file and checked.
///
/// Args:
///     file (str | os.PathLike): Path of a task file, such as "envs/mine.ron", or the name of a task:
///         that of a file in the nearest folder `envs`, in or above the working directory, or of a
///         built-in task, such as "cartpole". Built-in files have paths such as
///         "builtin:envs/cartpole.ron".
///     run_seed (int): Run seed with which tasks are drawn that differ from run to run
///         (`drawn_per_run` in a task file), from 0 to 2**64 - 1. It has no effect on other tasks.
///
/// Raises:
///     TaskError: Something in the file is wrong.
///     FileNotFoundError: There is no such file or task.
///
/// Example:
///     >>> import seedbed
///     >>> task = seedbed.Task("cartpole")
///     >>> task.control_step, task.time_limit
///     (0.02, 200)
///     >>> [(quantity.name, quantity.unit) for quantity in task.observations]
///     [('x', 'm'), ('x_dot', 'm/s'), ('theta', 'rad'), ('theta_dot', 'rad/s')]
///     >>> task.actions[0].values
///     (-10.0, 10.0)
#[pyclass(frozen, module = "seedbed")]
pub(crate) struct Task {
    pub(super) description: Arc<TaskDescription>,
    text: String,
    #[pyo3(get)]
    run_seed: u64,
}

#[pymethods]
impl Task {
    #[new]
    #[pyo3(signature = (file, *, run_seed = 0))]
    #[expect(
        clippy::needless_pass_by_value,
        reason = "arguments from Python are owned"
    )]
    fn load(py: Python<'_>, file: PathBuf, run_seed: u64) -> PyResult<Self> {
        let path = builtin::find(&file)?;
        let loaded = seedbed_env::load_from(&builtin::FILES, &path);
        let (description, text) = loaded.map_err(|error| task_error(py, &error))?;
        Ok(Self::new(&description, text, run_seed))
    }

    /// The task that a text describes; errors show `path` in place of a file. For unpickling.
    #[staticmethod]
    fn _parse(py: Python<'_>, path: &str, text: String, run_seed: u64) -> PyResult<Self> {
        let name = Path::new(path).file_stem().unwrap_or_default();
        let parsed = seedbed_env::parse(&name.to_string_lossy(), path, text.clone());
        let description = parsed.map_err(|error| task_error(py, &error))?;
        Ok(Self::new(&description, text, run_seed))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Parts)> {
        let task = slf.get();
        let parse = slf.get_type().getattr("_parse")?;
        Ok((
            parse,
            (task.path().to_owned(), task.text.clone(), task.run_seed),
        ))
    }

    /// A task never changes, so that copies can be the task itself.
    fn __copy__<'py>(slf: &Bound<'py, Self>) -> Bound<'py, Self> {
        slf.clone()
    }

    fn __deepcopy__<'py>(slf: &Bound<'py, Self>, _memo: &Bound<'py, PyAny>) -> Bound<'py, Self> {
        slf.clone()
    }

    /// Name of the task: that of its file, without ".ron".
    #[getter]
    fn name(&self) -> &str {
        &self.description.spec().name
    }

    /// What the task is, in one sentence.
    #[getter]
    fn description(&self) -> &str {
        &self.description.spec().description
    }

    /// Path of the task file.
    #[getter]
    fn path(&self) -> &str {
        self.description.origin()
    }

    /// Text of a task file that describes this task and extends no other file.
    #[getter]
    fn text(&self) -> &str {
        &self.text
    }

    /// The observed numbers, in the order of an observation: `[observations]`.
    #[getter]
    fn observations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let quantities = self.description.spec().observations.iter();
        PyTuple::new(py, quantities.map(Quantity::from).collect::<Vec<_>>())
    }

    /// The components of an action, in order: `[components]`.
    #[getter]
    fn actions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let actions = self.description.spec().actions.iter();
        PyTuple::new(py, actions.map(Action::from).collect::<Vec<_>>())
    }

    /// Time between two actions, s.
    #[getter]
    fn control_step(&self) -> f64 {
        self.description.spec().control_step
    }

    /// Number of steps after which an episode is truncated.
    #[getter]
    fn time_limit(&self) -> u32 {
        self.description.spec().time_limit
    }

    /// Mean return at which the task counts as solved; None if there is no agreed one.
    #[getter]
    fn reward_threshold(&self) -> Option<f64> {
        self.description.spec().reward_threshold.map(shortest)
    }

    /// Whether the task has an analytic model, for `physics="analytic"`.
    #[getter]
    fn has_analytic_model(&self) -> bool {
        self.description.has_analytic_model()
    }

    /// Names of the drawn bodies, in the order of `poses()`: `[bodies]`. Empty for tabular tasks.
    #[getter]
    fn bodies<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let scene = self
            .description
            .body_task()
            .and_then(|task| task.scene.as_ref());
        let bodies = scene.map_or(&[][..], |scene| &scene.bodies);
        PyTuple::new(py, bodies.iter().map(|body| &body.name))
    }

    fn __repr__(&self) -> String {
        format!("Task({:?})", self.path())
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.description == other.description
    }

    fn __hash__(&self) -> u64 {
        xxhash_rust::xxh64::xxh64(self.text.as_bytes(), self.run_seed)
    }
}

/// Path, text and run seed of a pickled task.
type Parts = (String, String, u64);

impl Task {
    fn new(description: &TaskDescription, text: String, run_seed: u64) -> Self {
        Self {
            description: Arc::new(description.for_run(run_seed).into_owned()),
            text,
            run_seed,
        }
    }
}

#[pymethods]
impl Quantity {
    fn __repr__(&self) -> String {
        let Self { name, unit, range } = self;
        format!("Quantity(name={name:?}, unit={unit:?}, range={range:?})")
    }

    fn __hash__(&self) -> u64 {
        xxhash_rust::xxh64::xxh64(self.__repr__().as_bytes(), 0)
    }
}

#[pymethods]
impl Action {
    /// The values that may be chosen; None for a continuous action.
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyTuple>>> {
        let values = self.values.as_ref();
        values.map(|values| PyTuple::new(py, values)).transpose()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let Self {
            name, unit, range, ..
        } = self;
        let values = match self.values(py)? {
            Some(values) => values.repr()?.to_string(),
            None => "None".to_owned(),
        };
        Ok(format!(
            "Action(name={name:?}, unit={unit:?}, range={range:?}, values={values})"
        ))
    }

    fn __hash__(&self, py: Python<'_>) -> PyResult<u64> {
        Ok(xxhash_rust::xxh64::xxh64(self.__repr__(py)?.as_bytes(), 0))
    }
}

impl From<&seedbed_env::Quantity> for Quantity {
    fn from(quantity: &seedbed_env::Quantity) -> Self {
        Self {
            name: quantity.name.clone(),
            unit: quantity.unit.clone(),
            range: range(quantity.range),
        }
    }
}

impl From<&seedbed_env::Action> for Action {
    fn from(action: &seedbed_env::Action) -> Self {
        let Quantity { name, unit, range } = Quantity::from(&action.quantity);
        let values = match &action.choice {
            Choice::Discrete(values) => Some(values.iter().copied().map(shortest).collect()),
            Choice::Continuous => None,
        };
        Self {
            name,
            unit,
            range,
            values,
        }
    }
}

fn range([low, high]: [f32; 2]) -> (f64, f64) {
    (shortest(low), shortest(high))
}

/// The number with the digits that the task file has: 0.1 instead of 0.10000000149.
fn shortest(number: f32) -> f64 {
    number.to_string().parse().unwrap_or(f64::from(number))
}
