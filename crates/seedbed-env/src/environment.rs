//! A task of rigid bodies as an [`Environment`]: sensors, observations, rewards and ends of
//! episodes, on top of any [`Dynamics`].
//!
//! Everything that a task computes is in one table of columns, one value per copy, which its
//! formulas read: see [`ColumnLayout`]. Stepping allocates nothing. This module must not depend on
//! what moves the bodies.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::description::{BodyTask, ColumnLayout, TaskDescription};
use super::dynamics::{Dynamics, from_bytes, to_bytes};
use super::expression::{Evaluator, ValueTable};
use super::sensing::SensorReader;
use super::tabular::TabularEnvironment;
use super::{
    Choice, Environment, Force, Physics, Pose, Scene, Status, TaskSpec, analytic, forces, physics,
};
use crate::input::InputError;
use crate::random::Stream;

/// Builds `copies` copies of a task. None has started: reset each before its first step.
///
/// # Errors
/// `physics` is [`Physics::Analytic`], but the task has no analytic model.
pub fn build(
    description: &TaskDescription,
    physics: Physics,
    copies: usize,
) -> Result<Box<dyn Environment>, InputError> {
    match description {
        TaskDescription::Bodies(task) => {
            let dynamics = build_dynamics(task, physics, copies)?;
            Ok(Box::new(BodyEnvironment::new(task, dynamics, copies)))
        }
        TaskDescription::Tabular(task) if physics == Physics::Rapier => {
            Ok(Box::new(TabularEnvironment::new(task, copies)))
        }
        TaskDescription::Tabular(task) => Err(no_analytic_model(&task.origin)),
    }
}

/// Builds only the moving bodies of a task, without observations, rewards and episodes.
///
/// # Errors
/// `physics` is [`Physics::Analytic`], but the task has no analytic model.
pub fn build_dynamics(
    task: &BodyTask,
    physics: Physics,
    copies: usize,
) -> Result<Box<dyn Dynamics>, InputError> {
    match physics {
        Physics::Rapier if task.needs_own_worlds() => {
            Ok(Box::new(physics::ContactWorlds::new(task, copies)))
        }
        Physics::Rapier => Ok(Box::new(physics::RigidBodies::new(task, copies))),
        Physics::Analytic => {
            analytic::build(task, copies).ok_or_else(|| no_analytic_model(&task.origin))
        }
    }
}

fn no_analytic_model(origin: &str) -> InputError {
    InputError {
        origin: origin.to_owned(),
        position: None,
        field: "analytic".to_owned(),
        message: "`physics: Analytic` needs an analytic model, but this task has none".to_owned(),
        help: Some("use `physics: Rapier`".to_owned()),
    }
}

/// M copies of a task of rigid bodies.
struct BodyEnvironment {
    task: BodyTask,
    columns: ColumnLayout,
    dynamics: Box<dyn Dynamics>,
    sensors: SensorReader,
    /// What the formulas read, in the order of [`ColumnLayout`].
    table: ValueTable,
    observation_formulas: Vec<Evaluator>,
    formula_forces: Vec<Evaluator>,
    reward: Evaluator,
    /// The reward, if it is the same in every step: it is then not computed.
    constant_reward: Option<f32>,
    terminated: Evaluator,
    /// Whether the reward or the termination reads values before the step.
    reads_previous: bool,
    episodes: EpisodeStates,
    /// Start coordinates and velocities of the copy that is being reset: `[coordinates]`.
    start: [Vec<f64>; 2],
}

/// The state of each copy's episode, besides the table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct EpisodeStates {
    /// `[copies × observations]`
    observations: Vec<f32>,
    rewards: Vec<f32>,
    statuses: Vec<Status>,
    /// Steps since the reset.
    steps: Vec<u32>,
}

#[derive(Serialize, Deserialize)]
struct SavedEnvironment {
    task: String,
    table: Vec<f32>,
    episodes: EpisodeStates,
    dynamics: Vec<u8>,
}

impl BodyEnvironment {
    fn new(task: &BodyTask, dynamics: Box<dyn Dynamics>, copies: usize) -> Self {
        let columns = task.column_layout();
        let formulas = &task.formulas;
        let previous_columns = columns.first_previous_value()..columns.count();
        Self {
            columns,
            dynamics,
            table: ValueTable::new(columns.count(), copies),
            observation_formulas: formulas
                .observations
                .iter()
                .map(|program| Evaluator::new(program, copies))
                .collect(),
            formula_forces: task
                .formula_forces
                .iter()
                .map(|force| Evaluator::new(&force.formula, copies))
                .collect(),
            reward: Evaluator::new(&formulas.reward, copies),
            constant_reward: formulas.reward.constant(),
            terminated: Evaluator::new(&formulas.terminated, copies),
            reads_previous: formulas.reward.reads(&previous_columns)
                || formulas.terminated.reads(&previous_columns),
            episodes: EpisodeStates::new(copies, columns.observation_count),
            sensors: SensorReader::new(task, copies),
            start: [
                task.reference_coordinates(),
                vec![0.0; task.coordinate_count()],
            ],
            task: task.clone(),
        }
    }
}

impl Environment for BodyEnvironment {
    fn spec(&self) -> &TaskSpec {
        &self.task.spec
    }

    fn copies(&self) -> usize {
        self.episodes.statuses.len()
    }

    fn reset(&mut self, copy: usize, random: &mut Stream) {
        let [positions, velocities] = &mut self.start;
        for start in &self.task.reset {
            positions[start.coordinate] = start.position.draw(random);
            velocities[start.coordinate] = start.velocity.draw(random);
        }
        self.dynamics.start(copy, positions, velocities);
        self.episodes.rewards[copy] = 0.0;
        self.episodes.statuses[copy] = Status::Running;
        self.episodes.steps[copy] = 0;
        self.observe(copy..copy + 1);
    }

    fn step(&mut self, actions: &[f32]) {
        assert_eq!(
            actions.len(),
            self.copies() * self.columns.action_count,
            "one row of actions per copy"
        );
        self.write_controls(actions);
        if self.reads_previous {
            self.table.copy_columns(
                0..self.columns.first_action(),
                self.columns.first_previous_value(),
            );
        }
        self.compute_formula_forces();
        self.dynamics.step(
            self.table
                .columns(self.columns.first_action()..self.columns.first_previous_value()),
        );
        self.observe(0..self.copies());
        self.compute_rewards_and_statuses();
    }

    fn observations(&self) -> &[f32] {
        &self.episodes.observations
    }

    fn rewards(&self) -> &[f32] {
        &self.episodes.rewards
    }

    fn statuses(&self) -> &[Status] {
        &self.episodes.statuses
    }

    fn save(&self) -> Vec<u8> {
        let state = SavedEnvironment {
            task: self.task.spec.name.clone(),
            table: self.table.values().to_vec(),
            episodes: self.episodes.clone(),
            dynamics: self.dynamics.save(),
        };
        to_bytes(&state)
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let state: SavedEnvironment = from_bytes(bytes)
            .map_err(|error| format!("not a saved state of an environment: {error}"))?;
        let name = &self.task.spec.name;
        if state.task != *name {
            return Err(format!(
                "the saved state is of task `{}`, expected `{name}`",
                state.task
            ));
        }
        if state.table.len() != self.table.values().len()
            || !state.episodes.same_shape(&self.episodes)
        {
            return Err("the saved state has another number of copies".to_owned());
        }
        self.dynamics.restore(&state.dynamics)?;
        self.table.values_mut().copy_from_slice(&state.table);
        self.episodes = state.episodes;
        Ok(())
    }

    fn scene(&self) -> Option<&Scene> {
        self.task.scene.as_ref()
    }

    fn poses(&self, copy: usize, poses: &mut [Pose]) {
        let fixed_bodies = poses.len() - self.task.bodies.len();
        poses[..fixed_bodies].fill(Pose::default());
        self.dynamics.poses(copy, &mut poses[fixed_bodies..]);
        self.add_display_offsets(copy, &mut poses[fixed_bodies..]);
    }

    fn forces(&self, copy: usize, poses: &[Pose], forces: &mut Vec<Force>) {
        if self.episodes.steps[copy] > 0 {
            let bodies = &poses[poses.len() - self.task.bodies.len()..];
            let control = |index| self.table.column(self.columns.first_action() + index)[copy];
            let coordinate = |index| self.dynamics.coordinates().get(index, copy);
            forces::add_action_forces(&self.task, bodies, control, coordinate, forces);
            self.dynamics.contact_forces(copy, forces);
        }
    }
}

impl BodyEnvironment {
    /// Translates actions into controls, in the table's action columns.
    fn write_controls(&mut self, actions: &[f32]) {
        let width = self.columns.action_count;
        for (index, actuator) in self.task.actuators.iter().enumerate() {
            let controls = self.table.column_mut(self.columns.first_action() + index);
            let rows = actions.chunks_exact(width);
            for ((control, row), status) in
                controls.iter_mut().zip(rows).zip(&self.episodes.statuses)
            {
                if *status == Status::Running {
                    *control = match &actuator.choice {
                        Choice::Discrete(values) => values[row[index] as usize],
                        Choice::Continuous => {
                            row[index].clamp(actuator.range[0], actuator.range[1])
                        }
                    };
                }
            }
        }
    }

    /// Computes the forces that depend on the state before the step.
    fn compute_formula_forces(&mut self) {
        let copies = 0..self.copies();
        for (index, force) in self.formula_forces.iter_mut().enumerate() {
            let column = self.columns.first_formula_force() + index;
            let (before, column) = self.table.split_at(column);
            column.copy_from_slice(force.evaluate(before, copies.clone()));
        }
    }

    /// Adds the display offsets of one copy to the poses of its bodies. This is called only to
    /// draw, so that it may allocate.
    fn add_display_offsets(&self, copy: usize, poses: &mut [Pose]) {
        let value = |program| {
            Evaluator::new(program, self.copies()).evaluate(self.table.view(), copy..copy + 1)[0]
        };
        for offset in &self.task.display_offsets {
            poses[offset.body].y += value(&offset.y);
            poses[offset.body].angle += value(&offset.angle);
        }
    }

    /// Reads the sensors of some copies and computes their observations.
    fn observe(&mut self, copies: Range<usize>) {
        let coordinates = self.dynamics.coordinates();
        self.sensors
            .read(coordinates, copies.clone(), &mut self.table);
        let width = self.columns.observation_count;
        for (index, formula) in self.observation_formulas.iter_mut().enumerate() {
            let column = self.columns.first_observation() + index;
            let (before, column) = self.table.split_at(column);
            let values = formula.evaluate(before, copies.clone());
            column[copies.clone()].copy_from_slice(values);
            let rows = self.episodes.observations.chunks_exact_mut(width);
            for (row, &value) in rows.skip(copies.start).zip(values) {
                row[index] = value;
            }
        }
    }

    /// Computes the rewards of the copies that have moved, and ends episodes.
    fn compute_rewards_and_statuses(&mut self) {
        let copies = 0..self.copies();
        let terminated = self.terminated.evaluate(self.table.view(), copies.clone());
        let rewards = self
            .constant_reward
            .is_none()
            .then(|| self.reward.evaluate(self.table.view(), copies.clone()));
        let episodes = &mut self.episodes;
        for copy in copies {
            if episodes.statuses[copy] != Status::Running {
                continue;
            }
            episodes.rewards[copy] = self
                .constant_reward
                .unwrap_or_else(|| rewards.map_or(0.0, |rewards| rewards[copy]));
            episodes.steps[copy] += 1;
            let at_limit = episodes.steps[copy] >= self.task.spec.time_limit;
            episodes.statuses[copy] = status_after_step(terminated[copy] != 0.0, at_limit);
            if episodes.statuses[copy] != Status::Running {
                self.dynamics.stop(copy);
            }
        }
    }
}

/// Termination takes precedence over the time limit.
fn status_after_step(terminated: bool, at_limit: bool) -> Status {
    match (terminated, at_limit) {
        (true, _) => Status::Terminated,
        (false, true) => Status::Truncated,
        (false, false) => Status::Running,
    }
}

impl EpisodeStates {
    fn new(copies: usize, observations: usize) -> Self {
        Self {
            observations: vec![0.0; copies * observations],
            rewards: vec![0.0; copies],
            statuses: vec![Status::Idle; copies],
            steps: vec![0; copies],
        }
    }

    fn same_shape(&self, other: &Self) -> bool {
        self.observations.len() == other.observations.len()
            && self.rewards.len() == other.rewards.len()
            && self.statuses.len() == other.statuses.len()
            && self.steps.len() == other.steps.len()
    }
}
