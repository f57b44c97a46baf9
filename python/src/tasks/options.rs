//! The keywords of a batch: what Python gives and what is meant.

use std::sync::Arc;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use seedbed_env::description::BodyTask;
use seedbed_env::{Physics, TaskDescription};

/// When a copy whose episode has ended is reset: the modes of Gymnasium's vector environments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Autoreset {
    /// In the next step, which ignores the action of the copy.
    NextStep,
    /// At the end of the same step.
    SameStep,
    /// Never. A copy whose episode has ended does not move.
    Disabled,
}

/// Maximum numbers of copies and of threads of a batch.
pub(super) const MAX_COPIES: usize = 1 << 20;
pub(crate) const MAX_THREADS: usize = 256;

/// Minimum number of copies per thread, unless a number of threads is given, for tasks with contacts and
/// for all others. They take about 0.1 ms, and to wake a thread about 0.02 ms.
const MIN_COPIES_PER_THREAD: [usize; 2] = [8, 256];

/// Names of the modes in which episodes are reset.
const AUTORESETS: [(&str, Autoreset); 3] = [
    ("next_step", Autoreset::NextStep),
    ("same_step", Autoreset::SameStep),
    ("disabled", Autoreset::Disabled),
];

/// The number of cores, but not more than there is work for.
pub(super) fn default_threads(description: &TaskDescription, copies: usize) -> usize {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let body_task = description.body_task();
    let has_contacts = body_task.is_some_and(BodyTask::needs_own_worlds);
    let copies_per_thread = MIN_COPIES_PER_THREAD[usize::from(!has_contacts)];
    cores.min(copies / copies_per_thread).clamp(1, MAX_THREADS)
}

pub(super) fn parse_physics(name: &str, description: &TaskDescription) -> PyResult<Physics> {
    match name {
        "rapier" => Ok(Physics::Rapier),
        "analytic" if description.has_analytic_model() => Ok(Physics::Analytic),
        "analytic" => Err(PyValueError::new_err(format!(
            "physics is \"analytic\", but the task `{}` has no analytic model: use physics=\"rapier\"",
            description.spec().name
        ))),
        _ => Err(PyValueError::new_err(format!(
            "physics is {name:?}, expected \"rapier\" or \"analytic\""
        ))),
    }
}

pub(super) fn physics_name(physics: Physics) -> &'static str {
    match physics {
        Physics::Rapier => "rapier",
        Physics::Analytic => "analytic",
    }
}

pub(crate) fn parse_autoreset(name: &str) -> PyResult<Autoreset> {
    let mode = AUTORESETS.iter().find(|(known, _)| *known == name);
    mode.map(|&(_, mode)| mode).ok_or_else(|| {
        PyValueError::new_err(format!(
            "autoreset is {name:?}, expected \"next_step\", \"same_step\" or \"disabled\""
        ))
    })
}

pub(super) fn autoreset_name(autoreset: Autoreset) -> &'static str {
    let mode = AUTORESETS.iter().find(|(_, mode)| *mode == autoreset);
    mode.map_or("", |(name, _)| name)
}

/// The task with another time limit, if there is one.
pub(super) fn with_time_limit(
    description: &Arc<TaskDescription>,
    max_episode_steps: Option<i64>,
) -> PyResult<Arc<TaskDescription>> {
    let limit = match max_episode_steps {
        None => return Ok(Arc::clone(description)),
        Some(-1) => u32::MAX,
        Some(steps @ 1..) => u32::try_from(steps).unwrap_or(u32::MAX),
        Some(steps) => {
            return Err(PyValueError::new_err(format!(
                "max_episode_steps is {steps}, expected at least 1, or -1 for no limit"
            )));
        }
    };
    let mut description = TaskDescription::clone(description);
    description.spec_mut().time_limit = limit;
    Ok(Arc::new(description))
}

/// A number of copies or threads that Python gives: from 1 to `max`.
pub(crate) fn checked_count(name: &str, given: i64, max: usize) -> PyResult<usize> {
    let count = usize::try_from(given).ok();
    let count = count.filter(|count| (1..=max).contains(count));
    let error = || PyValueError::new_err(format!("{name} is {given}, expected 1 to {max}"));
    count.ok_or_else(error)
}
