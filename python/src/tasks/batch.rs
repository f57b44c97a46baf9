//! A batch of copies of a task: the class that the environments in Python are made of.

use std::ffi::CString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};

use numpy::ndarray::Dimension;
use numpy::{
    Element, IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1,
    PyReadwriteArray, PyReadwriteArray1, PyReadwriteArray2, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyIndexError, PyRuntimeError, PyRuntimeWarning, PyValueError};
use pyo3::import_exception;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use seedbed_env::{GivenStart, Physics, TaskDescription};
use seedbed_scene::camera::Bounds;
use seedbed_scene::outline::terrain_lines;

use super::actions::ActionReader;
use super::description::{Task, task_error};
use super::group::{Group, Phase, Rows};
use super::options::{
    Autoreset, MAX_COPIES, MAX_THREADS, autoreset_name, checked_count, default_threads,
    parse_autoreset, parse_physics, physics_name, with_time_limit,
};
use super::picture;
use super::start::{NamedNumbers, given_start, named_start};
use super::threads::Threads;

import_exception!(gymnasium.error, ResetNeeded);

/// Positional and named arguments of the constructor of a batch.
type NewArguments<'py> = ((Py<Task>, usize), Bound<'py, PyDict>);

/// Sides of pictures, in pixels.
const PICTURE_SIDES: std::ops::RangeInclusive<u32> = 32..=4096;

/// A batch of M independent copies of one task.
///
/// The results of a copy depend neither on the number of copies nor on the number of threads. Copies
/// are stepped without Python's global interpreter lock. Arrays in which results are written must be
/// contiguous and must not be used by other threads during a call.
///
/// Args:
///     task (Task): The task.
///     copies (int): Number of copies M.
///     physics (str): "rapier" for rigid bodies, "analytic" for the task's analytic model.
///     threads (int | None): Number of threads; by default the number of cores, but at most one per
///         256 copies, or per 8 copies of a task with contacts.
///     max_episode_steps (int | None): Steps after which an episode is truncated; by default those of
///         the task, and -1 for no limit.
///     autoreset (str): "next_step", "same_step" or "disabled", as in Gymnasium.
///     team (bool): Whether copies belong to the agents of a team: copy k draws its start states from
///         the random stream of agent k, and a copy whose episode has ended waits for the others.
#[pyclass(module = "seedbed._native")]
pub(crate) struct Batch {
    /// The task as it was given; `description` has the time limit of the batch.
    task: Py<Task>,
    description: Arc<TaskDescription>,
    physics: Physics,
    autoreset: Autoreset,
    is_team: bool,
    copies: usize,
    observation_width: usize,
    actions: ActionReader,
    /// Never locked: a mutex makes the batch `Sync`, as Python's classes must be, although environments
    /// are not.
    groups: Mutex<Vec<Group>>,
    threads: Threads,
    /// Where bodies usually are; `None` before the first picture.
    bounds: Option<Bounds>,
    /// Whether a physics warning was given. It is given once.
    has_warned: bool,
}

#[pymethods]
impl Batch {
    #[new]
    #[pyo3(signature = (
        task, copies = 1, *, physics = "rapier", threads = None, max_episode_steps = None,
        autoreset = "disabled", team = false
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        py: Python<'_>,
        task: Py<Task>,
        copies: i64,
        physics: &str,
        threads: Option<i64>,
        max_episode_steps: Option<i64>,
        autoreset: &str,
        team: bool,
    ) -> PyResult<Self> {
        let copies = checked_count("number of copies", copies, MAX_COPIES)?;
        let description = &task.get().description;
        let threads = match threads {
            None => default_threads(description, copies),
            Some(threads) => checked_count("number of threads", threads, MAX_THREADS)?,
        };
        let physics = parse_physics(physics, description)?;
        let description = with_time_limit(description, max_episode_steps)?;
        let spec = description.spec();
        Ok(Self {
            physics,
            autoreset: parse_autoreset(autoreset)?,
            is_team: team,
            copies,
            observation_width: spec.observation_width(),
            actions: ActionReader::new(spec, copies),
            groups: Mutex::new(build_groups(
                py,
                &description,
                physics,
                copies,
                threads.min(copies),
            )?),
            threads: Threads::new(threads.min(copies))?,
            bounds: None,
            has_warned: false,
            description,
            task,
        })
    }

    /// With `__getstate__` and `__setstate__`: `pickle` and `copy` make a batch that continues with the
    /// same bits.
    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<NewArguments<'py>> {
        let limit = self.max_episode_steps().map_or(-1, i64::from);
        let options = PyDict::new(py);
        options.set_item("threads", self.threads())?;
        options.set_item("team", self.is_team)?;
        options.set_item("max_episode_steps", limit)?;
        options.set_item("physics", physics_name(self.physics))?;
        options.set_item("autoreset", autoreset_name(self.autoreset))?;
        Ok(((self.task.clone_ref(py), self.copies), options))
    }

    fn __getstate__<'py>(&mut self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyBytes>>> {
        (0..self.copies).map(|copy| self.save(py, copy)).collect()
    }

    fn __setstate__(&mut self, states: Vec<Vec<u8>>) -> PyResult<()> {
        check_length("states", states.len(), self.copies)?;
        for (copy, state) in states.into_iter().enumerate() {
            self.restore(copy, &state)?;
        }
        Ok(())
    }

    /// Number of copies M.
    #[getter]
    fn copies(&self) -> usize {
        self.copies
    }

    /// Number of threads that step the copies.
    #[getter]
    fn threads(&self) -> usize {
        self.threads.count()
    }

    /// Steps after which an episode is truncated; None without a limit.
    #[getter]
    fn max_episode_steps(&self) -> Option<u32> {
        let limit = self.description.spec().time_limit;
        (limit != u32::MAX).then_some(limit)
    }

    /// Whether there are bodies to draw.
    #[getter]
    fn has_bodies(&mut self) -> bool {
        self.groups()[0].environment.scene().is_some()
    }

    /// Indices of the copies that have no random stream yet: `seed` must be called for them before
    /// `reset`.
    fn unseeded(&mut self) -> Vec<usize> {
        let copies = self.groups().iter().flat_map(|group| {
            let unseeded = (0..group.copies()).filter(|&copy| !group.has_stream(copy));
            unseeded.map(|copy| group.first_copy + copy)
        });
        copies.collect()
    }

    /// Indices of the copies whose episode is running.
    fn running(&mut self) -> Vec<usize> {
        let copies = self.groups().iter().flat_map(|group| {
            let phases = group.phases().iter().enumerate();
            let running = phases.filter(|(_, phase)| **phase == Phase::Running);
            running.map(|(copy, _)| group.first_copy + copy)
        });
        copies.collect()
    }

    /// Checks that there is a start state of these numbers, which `reset` takes: positions (m, rad) and
    /// velocities of coordinates and numbers of the episode by name.
    fn check_start(&mut self, start: [NamedNumbers; 3]) -> PyResult<()> {
        self.given_start(start).map(|_| ())
    }

    /// Lets a copy draw its start states from the random stream with the name (run seed, reset, agent,
    /// round). By default the agent is the index of the copy in a team, otherwise 0.
    #[pyo3(signature = (copy, run_seed, agent = None, round = 0))]
    fn seed(&mut self, copy: usize, run_seed: u64, agent: Option<u32>, round: u32) -> PyResult<()> {
        let agent = agent.unwrap_or(if self.is_team { copy as u32 } else { 0 });
        let (group, copy) = self.locate(copy)?;
        group.seed(copy, run_seed, agent, round);
        Ok(())
    }

    /// Starts a new episode in each copy, or in those that `mask` (bool, `[M]`) selects, and writes the
    /// current observations of all copies (float32, `[M, observations]`).
    ///
    /// With `start`, episodes start in a given state: positions (m, rad) and velocities of coordinates
    /// and numbers of the episode by name. Coordinates that are not named start at rest where the task
    /// places its bodies, other numbers are drawn.
    #[pyo3(signature = (observations, mask = None, start = None))]
    fn reset(
        &mut self,
        py: Python<'_>,
        mut observations: PyReadwriteArray2<'_, f32>,
        mask: Option<PyReadonlyArray1<'_, bool>>,
        start: Option<[NamedNumbers; 3]>,
    ) -> PyResult<()> {
        let start = start.map(|start| self.given_start(start)).transpose()?;
        let mask = mask.map(|mask| mask.as_array().to_vec());
        let observations = slice_of(&mut observations)?;
        check_length(
            "observations",
            observations.len(),
            self.copies * self.observation_width,
        )?;
        check_length(
            "mask",
            mask.as_ref().map_or(self.copies, Vec::len),
            self.copies,
        )?;
        let is_selected = |copy: usize| mask.as_ref().is_none_or(|mask| mask[copy]);
        self.reset_selected(py, is_selected, start.as_ref())?;
        self.write_observations(observations);
        Ok(())
    }

    /// Writes the current observations of all copies (float32, `[M, observations]`).
    fn observe(&mut self, mut observations: PyReadwriteArray2<'_, f32>) -> PyResult<()> {
        let observations = slice_of(&mut observations)?;
        check_length(
            "observations",
            observations.len(),
            self.copies * self.observation_width,
        )?;
        self.write_observations(observations);
        Ok(())
    }

    /// Sets the action of a copy for the next step.
    fn set_action(&mut self, copy: usize, action: &Bound<'_, PyAny>) -> PyResult<()> {
        self.locate(copy)?;
        self.actions.read_single(copy, action)
    }

    /// Advances all copies by one step and writes the results.
    ///
    /// Args:
    ///     actions: One row per copy; None, for a team, for the actions that `set_action` has set.
    ///     observations: float32, `[M, observations]`.
    ///     rewards: float64, `[M]`.
    ///     terminated: bool, `[M]`.
    ///     truncated: bool, `[M]`.
    ///     final_observations: float32, `[M, observations]`: the last observations of episodes that
    ///         end and are followed by a reset in the same step. Needed for "same_step" only.
    #[pyo3(signature = (
        actions, observations, rewards, terminated, truncated, final_observations = None
    ))]
    #[expect(clippy::too_many_arguments, reason = "one argument per array")]
    fn step(
        &mut self,
        py: Python<'_>,
        actions: Option<&Bound<'_, PyAny>>,
        mut observations: PyReadwriteArray2<'_, f32>,
        mut rewards: PyReadwriteArray1<'_, f64>,
        mut terminated: PyReadwriteArray1<'_, bool>,
        mut truncated: PyReadwriteArray1<'_, bool>,
        mut final_observations: Option<PyReadwriteArray2<'_, f32>>,
    ) -> PyResult<()> {
        self.check_running()?;
        match actions {
            Some(actions) => self.actions.read_batch(actions)?,
            None if self.is_team => {}
            None => self.actions.read_batch(py.None().bind(py))?,
        }
        let final_observations = match &mut final_observations {
            Some(array) => slice_of(array)?,
            None => &mut [],
        };
        let rows = Rows {
            observations: slice_of(&mut observations)?,
            rewards: slice_of(&mut rewards)?,
            terminated: slice_of(&mut terminated)?,
            truncated: slice_of(&mut truncated)?,
            final_observations,
        };
        self.check_rows(&rows)?;
        self.step_into(py, rows)
    }

    /// Starts a new episode in the only copy, with `start` in a given state as in `reset`; returns the
    /// observation (float32, `[observations]`).
    #[pyo3(signature = (start = None))]
    fn reset_one<'py>(
        &mut self,
        py: Python<'py>,
        start: Option<[NamedNumbers; 3]>,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        self.check_single()?;
        let start = start.map(|start| self.given_start(start)).transpose()?;
        self.reset_selected(py, |_| true, start.as_ref())?;
        self.observe_one(py)
    }

    /// Positions and velocities of coordinates and numbers of the episode of the only copy, by name.
    fn coordinates(&mut self) -> PyResult<[NamedNumbers; 3]> {
        self.check_single()?;
        let environment = &self.groups()[0].environment;
        Ok(named_start(
            &environment.start_names(),
            &environment.coordinates(0),
        ))
    }

    /// The current observation of the only copy (float32, `[observations]`).
    fn observe_one<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        self.check_single()?;
        let observation = self.groups()[0].environment.observations();
        Ok(PyArray1::from_slice(py, observation))
    }

    /// Advances the only copy by one step; returns the observation (float32, `[observations]`), the
    /// reward, and whether the episode has terminated and is truncated.
    fn step_one<'py>(
        &mut self,
        py: Python<'py>,
        action: &Bound<'py, PyAny>,
    ) -> PyResult<StepOfOne<'py>> {
        self.check_single()?;
        self.check_running()?;
        self.actions.read_single(0, action)?;
        let mut observation = vec![0.0; self.observation_width];
        let (mut reward, mut terminated, mut truncated) = ([0.0], [false], [false]);
        let rows = Rows {
            observations: &mut observation,
            rewards: &mut reward,
            terminated: &mut terminated,
            truncated: &mut truncated,
            final_observations: &mut [],
        };
        self.step_into(py, rows)?;
        Ok((
            observation.into_pyarray(py),
            reward[0],
            terminated[0],
            truncated[0],
        ))
    }

    /// The whole state of a copy: bodies, number of steps, and the random stream of start states.
    fn save<'py>(&mut self, py: Python<'py>, copy: usize) -> PyResult<Bound<'py, PyBytes>> {
        let (group, copy) = self.locate(copy)?;
        Ok(PyBytes::new(py, &group.save(copy)))
    }

    /// Sets a copy to a state that `save` returned, for any copy of the task.
    fn restore(&mut self, copy: usize, state: &[u8]) -> PyResult<()> {
        let (group, copy) = self.locate(copy)?;
        let restored = guarded(|| group.restore(copy, state))?;
        restored.map_err(PyValueError::new_err)
    }

    /// Where the bodies of a copy are (float32, `[bodies, 3]`): x and y in m, angle in rad.
    fn poses<'py>(&mut self, py: Python<'py>, copy: usize) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let (group, copy) = self.locate(copy)?;
        let poses = group.poses(copy);
        let numbers: Vec<f32> = poses
            .iter()
            .flat_map(|pose| [pose.x, pose.y, pose.angle])
            .collect();
        numbers.into_pyarray(py).reshape([poses.len(), 3])
    }

    /// A picture of the bodies of a copy, and of the ground of its episode (uint8, `[height, width, 3]`).
    fn render<'py>(
        &mut self,
        py: Python<'py>,
        copy: usize,
        width: u32,
        height: u32,
    ) -> PyResult<Bound<'py, PyArray3<u8>>> {
        for side in [width, height] {
            if !PICTURE_SIDES.contains(&side) {
                return Err(PyValueError::new_err(format!(
                    "side of a picture is {side} pixels, expected {} to {}",
                    PICTURE_SIDES.start(),
                    PICTURE_SIDES.end()
                )));
            }
        }
        let bounds = self.usual_bounds()?;
        let (group, copy) = self.locate(copy)?;
        let poses = group.poses(copy);
        let terrain = terrain_lines(&*group.environment, copy);
        let scene = group.environment.scene();
        let scene = scene.ok_or_else(|| PyValueError::new_err("the task has no bodies to draw"))?;
        let drawn = py.detach(|| {
            guarded(|| picture::draw(scene, &poses, &terrain, bounds, [width, height]))
        })?;
        let pixels = drawn.map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
        let shape = [pixels.height as usize, pixels.width as usize, 3];
        pixels.rgb.into_pyarray(py).reshape(shape)
    }
}

/// Observation, reward, terminated and truncated.
type StepOfOne<'py> = (Bound<'py, PyArray1<f32>>, f64, bool, bool);

impl Batch {
    fn groups(&mut self) -> &mut Vec<Group> {
        exclusive(&mut self.groups)
    }

    /// The group of a copy, and the copy's index in it.
    fn locate(&mut self, copy: usize) -> PyResult<(&mut Group, usize)> {
        let copies = self.copies;
        let group = self
            .groups()
            .iter_mut()
            .rev()
            .find(|group| group.first_copy <= copy);
        match group {
            Some(group) if copy < copies => {
                let index = copy - group.first_copy;
                Ok((group, index))
            }
            _ => {
                let message = format!("copy is {copy}, expected 0 to {}", copies - 1);
                Err(PyIndexError::new_err(message))
            }
        }
    }

    /// The start state with these numbers.
    fn given_start(&mut self, numbers: [NamedNumbers; 3]) -> PyResult<GivenStart> {
        given_start(&self.groups()[0].environment.start_names(), numbers)
    }

    fn check_single(&self) -> PyResult<()> {
        match self.copies {
            1 => Ok(()),
            copies => Err(PyValueError::new_err(format!(
                "the batch has {copies} copies, expected 1"
            ))),
        }
    }

    /// Checks that all copies can be stepped.
    fn check_running(&mut self) -> PyResult<()> {
        let (copies, autoreset, is_team) = (self.copies, self.autoreset, self.is_team);
        let may_have_ended = is_team || autoreset != Autoreset::Disabled;
        let can_step = |phase: &Phase| match phase {
            Phase::Running => true,
            Phase::Ended => may_have_ended,
            Phase::Idle => false,
        };
        for group in self.groups() {
            if let Some(copy) = group.phases().iter().position(|phase| !can_step(phase)) {
                let phase = group.phases()[copy];
                return Err(reset_needed(phase, group.first_copy + copy, copies));
            }
        }
        Ok(())
    }

    fn check_rows(&self, rows: &Rows<'_>) -> PyResult<()> {
        let numbers = self.copies * self.observation_width;
        check_length("observations", rows.observations.len(), numbers)?;
        check_length("rewards", rows.rewards.len(), self.copies)?;
        check_length("terminated", rows.terminated.len(), self.copies)?;
        check_length("truncated", rows.truncated.len(), self.copies)?;
        let needed = if self.autoreset == Autoreset::SameStep {
            numbers
        } else {
            0
        };
        check_length("final_observations", rows.final_observations.len(), needed)
    }

    fn reset_selected(
        &mut self,
        py: Python<'_>,
        is_selected: impl Fn(usize) -> bool + Send + Sync,
        start: Option<&GivenStart>,
    ) -> PyResult<()> {
        let reset = |group: &mut Group| {
            for copy in 0..group.copies() {
                if is_selected(group.first_copy + copy) {
                    group.reset(copy, start);
                }
            }
        };
        let (threads, groups) = (&mut self.threads, exclusive(&mut self.groups));
        py.detach(|| guarded(|| threads.for_each(groups, reset))?)
    }

    fn step_into(&mut self, py: Python<'_>, rows: Rows<'_>) -> PyResult<()> {
        let autoreset = self.autoreset;
        let width = self.description.spec().action_width();
        let actions = self.actions.matrix();
        let groups = exclusive(&mut self.groups);
        let rows = split_rows(rows, groups, self.observation_width);
        let mut parts: Vec<(&mut Group, Rows<'_>)> = groups.iter_mut().zip(rows).collect();
        let step = |(group, rows): &mut (&mut Group, Rows<'_>)| {
            let actions = &actions[group.first_copy * width..][..group.copies() * width];
            group.step(actions, autoreset, rows);
        };
        let threads = &mut self.threads;
        py.detach(|| guarded(|| threads.for_each(&mut parts, step))?)?;
        self.warn_of_physics(py)
    }

    /// Gives the first physics warning as a warning of Python, once.
    fn warn_of_physics(&mut self, py: Python<'_>) -> PyResult<()> {
        if self.has_warned {
            return Ok(());
        }
        let groups = exclusive(&mut self.groups).iter();
        let mut found = groups.filter_map(|group| {
            let (copy, episode, warning) = group.physics_warning.as_ref()?;
            Some((group.first_copy + copy, episode, warning))
        });
        let Some((copy, episode, warning)) = found.next() else {
            return Ok(());
        };
        let text = format!(
            "{}: in copy {copy}, episode {episode}, step {}, {}",
            self.description.spec().name,
            warning.step,
            warning.message
        );
        let text = CString::new(text).unwrap_or_default();
        self.has_warned = true;
        PyErr::warn(py, &py.get_type::<PyRuntimeWarning>(), &text, 1)
    }

    fn write_observations(&mut self, mut observations: &mut [f32]) {
        let width = self.observation_width;
        for group in self.groups() {
            let rows = observations.split_off_mut(..group.copies() * width);
            group.write_observations(rows.unwrap_or_default());
        }
    }

    fn usual_bounds(&mut self) -> PyResult<Bounds> {
        if let Some(bounds) = self.bounds {
            return Ok(bounds);
        }
        let copies = picture::sampled_copies();
        let sampled = seedbed_env::build(&self.description, self.physics, copies);
        let mut sampled = sampled.map_err(|error| PyValueError::new_err(error.to_string()))?;
        let bounds = guarded(|| picture::usual_bounds(&mut *sampled))?;
        let bounds = bounds.filter(|bounds| bounds.iter().all(|number| number.is_finite()));
        Ok(*self.bounds.insert(bounds.unwrap_or([-1.0, 1.0, -1.0, 1.0])))
    }
}

/// The exception for a copy that cannot be stepped.
fn reset_needed(phase: Phase, copy: usize, copies: usize) -> PyErr {
    let subject = match copies {
        1 => "the environment".to_owned(),
        _ => format!("copy {copy}"),
    };
    ResetNeeded::new_err(match phase {
        Phase::Idle => format!("{subject} has not started: call `reset` before the first `step`"),
        _ => format!("the episode of {subject} has ended: call `reset` before the next `step`"),
    })
}

/// The groups of a batch that is not shared.
fn exclusive(groups: &mut Mutex<Vec<Group>>) -> &mut Vec<Group> {
    groups.get_mut().unwrap_or_else(PoisonError::into_inner)
}

/// Divides the rows of all copies among groups.
fn split_rows<'a>(rows: Rows<'a>, groups: &[Group], width: usize) -> Vec<Rows<'a>> {
    let Rows {
        mut observations,
        mut rewards,
        mut terminated,
        mut truncated,
        mut final_observations,
    } = rows;
    let mut parts = Vec::with_capacity(groups.len());
    for group in groups {
        let (copies, numbers) = (group.copies(), group.copies() * width);
        parts.push(Rows {
            observations: observations.split_off_mut(..numbers).unwrap_or_default(),
            rewards: rewards.split_off_mut(..copies).unwrap_or_default(),
            terminated: terminated.split_off_mut(..copies).unwrap_or_default(),
            truncated: truncated.split_off_mut(..copies).unwrap_or_default(),
            final_observations: final_observations
                .split_off_mut(..numbers)
                .unwrap_or_default(),
        });
    }
    parts
}

fn build_groups(
    py: Python<'_>,
    description: &TaskDescription,
    physics: Physics,
    copies: usize,
    groups: usize,
) -> PyResult<Vec<Group>> {
    let mut built = Vec::with_capacity(groups);
    for group in 0..groups {
        let (first, end) = (group * copies / groups, (group + 1) * copies / groups);
        let environment = guarded(|| seedbed_env::build(description, physics, end - first))?;
        let environment = environment.map_err(|error| task_error(py, &error))?;
        built.push(Group::new(environment, physics, first));
    }
    Ok(built)
}

fn check_length(name: &str, found: usize, expected: usize) -> PyResult<()> {
    if found == expected {
        return Ok(());
    }
    let message = format!("`{name}` has {found} elements, expected {expected}");
    Err(PyValueError::new_err(message))
}

/// The elements of an array in which results are written.
fn slice_of<'a, T: Element, D: Dimension>(
    array: &'a mut PyReadwriteArray<'_, T, D>,
) -> PyResult<&'a mut [T]> {
    if !array.is_c_contiguous() {
        return Err(PyValueError::new_err(
            "expected a contiguous array in C order",
        ));
    }
    let elements = array.as_slice_mut();
    elements.map_err(|error| PyValueError::new_err(error.to_string()))
}

/// The result of some work. If it panics, which a simulation of extreme numbers could, this is an
/// exception like any other.
fn guarded<T>(work: impl FnOnce() -> T) -> PyResult<T> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
        PyRuntimeError::new_err(format!(
            "the simulation failed: {}; make a new environment, and check the numbers of the task",
            text.unwrap_or("no reason is known")
        ))
    })
}
