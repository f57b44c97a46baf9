//! A task as an [`Environment`]: sensors become observations, rewards and endings, on top of any [`Dynamics`].
//!
//! Everything that a task computes stands in one table of columns, one value for each copy, which its formulas read and write:
//! sensors, observations, actions, and the sensors and observations before the step. Stepping allocates nothing. What moves the
//! bodies may not enter.

use serde::{Deserialize, Serialize};

use super::description::{Columns, Description};
use super::dynamics::{Dynamics, from_bytes, to_bytes};
use super::expression::{Formula, Table};
use super::sensing::Senses;
use super::tabular::environment::FiniteEnvironment;
use super::{
    Choice, Environment, Force, Physics, Pose, Scene, Spec, Status, analytic, forces, physics,
};
use crate::input::InputError;
use crate::random::Stream;

/// Builds `copies` copies of a task. None has started: reset each before its first step.
///
/// # Errors
/// The task has no closed-form twin, but `physics` asks for it.
pub fn build(
    description: &Description,
    physics: Physics,
    copies: usize,
) -> Result<Box<dyn Environment>, InputError> {
    if let Some(finite) = &description.finite
        && physics == Physics::Rapier
    {
        return Ok(Box::new(FiniteEnvironment::new(
            &description.spec,
            finite,
            copies,
        )));
    }
    Ok(Box::new(Task::new(
        description,
        dynamics(description, physics, copies)?,
        copies,
    )))
}

/// Builds the moving part of a task alone.
///
/// # Errors
/// The task has no closed-form twin, but `physics` asks for it.
pub fn dynamics(
    description: &Description,
    physics: Physics,
    copies: usize,
) -> Result<Box<dyn Dynamics>, InputError> {
    match physics {
        Physics::Rapier if description.needs_worlds() => {
            Ok(Box::new(physics::ContactWorlds::new(description, copies)))
        }
        Physics::Rapier => Ok(Box::new(physics::RigidBodies::new(description, copies))),
        Physics::Analytic => analytic::build(description, copies).ok_or_else(|| InputError {
            origin: description.origin.clone(),
            position: None,
            field: "analytic".to_owned(),
            message: "the task has no closed-form twin, so it cannot run with `physics: Analytic`"
                .to_owned(),
            help: Some("use `physics: Rapier`".to_owned()),
        }),
    }
}

/// M copies of one task.
struct Task {
    description: Description,
    columns: Columns,
    dynamics: Box<dyn Dynamics>,
    senses: Senses,
    /// What the formulas read. Its layout is [`Columns`].
    table: Table,
    observation_formulas: Vec<Formula>,
    fields: Vec<Formula>,
    reward: Formula,
    /// Constant rewards are not computed.
    constant_reward: Option<f32>,
    terminated: Formula,
    reads_previous: bool,
    progress: Progress,
    /// Start coordinates and rates of the copy that is being reset: `[coordinates]`.
    start: [Vec<f64>; 2],
}

/// What each copy has come to, beside the table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Progress {
    /// `[copies × observations]`
    observations: Vec<f32>,
    rewards: Vec<f32>,
    statuses: Vec<Status>,
    /// Steps since the reset.
    steps: Vec<u32>,
}

#[derive(Serialize, Deserialize)]
struct SavedTask {
    task: String,
    table: Vec<f32>,
    progress: Progress,
    dynamics: Vec<u8>,
}

impl Task {
    fn new(description: &Description, dynamics: Box<dyn Dynamics>, copies: usize) -> Self {
        let columns = description.columns();
        let formulas = &description.formulas;
        let previous = columns.first_previous()..columns.count();
        Self {
            columns,
            dynamics,
            table: Table::new(columns.count(), copies),
            observation_formulas: formulas
                .observations
                .iter()
                .map(|program| Formula::new(program, copies))
                .collect(),
            fields: description
                .fields
                .iter()
                .map(|field| Formula::new(&field.force, copies))
                .collect(),
            reward: Formula::new(&formulas.reward, copies),
            constant_reward: formulas.reward.constant(),
            terminated: Formula::new(&formulas.terminated, copies),
            reads_previous: formulas.reward.reads(&previous)
                || formulas.terminated.reads(&previous),
            progress: Progress::new(copies, columns.observations),
            senses: Senses::new(description, copies),
            start: [
                description.reference(),
                vec![0.0; description.coordinates()],
            ],
            description: description.clone(),
        }
    }
}

impl Environment for Task {
    fn spec(&self) -> &Spec {
        &self.description.spec
    }

    fn copies(&self) -> usize {
        self.progress.statuses.len()
    }

    fn reset(&mut self, copy: usize, random: &mut Stream) {
        let [positions, velocities] = &mut self.start;
        for start in &self.description.reset {
            positions[start.coordinate] = start.position.draw(random);
            velocities[start.coordinate] = start.velocity.draw(random);
        }
        self.dynamics.start(copy, positions, velocities);
        self.progress.rewards[copy] = 0.0;
        self.progress.statuses[copy] = Status::Running;
        self.progress.steps[copy] = 0;
        self.observe(copy..copy + 1);
    }

    fn step(&mut self, actions: &[f32]) {
        assert_eq!(
            actions.len(),
            self.copies() * self.columns.actions,
            "one row of actions a copy"
        );
        self.take(actions);
        if self.reads_previous {
            self.table.copy_columns(
                0..self.columns.first_action(),
                self.columns.first_previous(),
            );
        }
        self.apply_fields();
        self.dynamics.step(
            self.table
                .columns(self.columns.first_action()..self.columns.first_previous()),
        );
        self.observe(0..self.copies());
        self.judge();
    }

    fn observations(&self) -> &[f32] {
        &self.progress.observations
    }

    fn rewards(&self) -> &[f32] {
        &self.progress.rewards
    }

    fn statuses(&self) -> &[Status] {
        &self.progress.statuses
    }

    fn save(&self) -> Vec<u8> {
        let state = SavedTask {
            task: self.description.spec.name.clone(),
            table: self.table.values().to_vec(),
            progress: self.progress.clone(),
            dynamics: self.dynamics.save(),
        };
        to_bytes(&state)
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let state: SavedTask =
            from_bytes(bytes).map_err(|error| format!("no saved environment: {error}"))?;
        let name = &self.description.spec.name;
        if state.task != *name {
            return Err(format!(
                "the state is of task `{}`, not of `{name}`",
                state.task
            ));
        }
        if state.table.len() != self.table.values().len()
            || !state.progress.same_shape(&self.progress)
        {
            return Err("the state is of another number of copies".to_owned());
        }
        self.dynamics.restore(&state.dynamics)?;
        self.table.values_mut().copy_from_slice(&state.table);
        self.progress = state.progress;
        Ok(())
    }

    fn scene(&self) -> Option<&Scene> {
        self.description.scene.as_ref()
    }

    fn poses(&self, copy: usize, poses: &mut [Pose]) {
        let still = poses.len() - self.description.bodies.len();
        poses[..still].fill(Pose::default());
        self.dynamics.poses(copy, &mut poses[still..]);
        self.draw_elsewhere(copy, &mut poses[still..]);
    }

    fn forces(&self, copy: usize, poses: &[Pose], forces: &mut Vec<Force>) {
        if self.progress.steps[copy] > 0 {
            let bodies = &poses[poses.len() - self.description.bodies.len()..];
            let control = |index| self.table.column(self.columns.first_action() + index)[copy];
            let joint = |joint| self.dynamics.joints().get(joint, copy);
            forces::add_actions(&self.description, bodies, control, joint, forces);
            self.dynamics.contacts(copy, forces);
        }
    }
}

impl Task {
    /// Translates actions into controls, in the table's action columns.
    fn take(&mut self, actions: &[f32]) {
        let width = self.columns.actions;
        for (index, actuator) in self.description.actuators.iter().enumerate() {
            let controls = self.table.column_mut(self.columns.first_action() + index);
            for ((control, row), status) in controls
                .iter_mut()
                .zip(actions.chunks_exact(width))
                .zip(&self.progress.statuses)
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
    fn apply_fields(&mut self) {
        let copies = 0..self.copies();
        for (index, field) in self.fields.iter_mut().enumerate() {
            let (before, column) = self.table.split_at(self.columns.first_field() + index);
            column.copy_from_slice(field.evaluate(before, copies.clone()));
        }
    }

    /// Only pictures ask for this, so that it may allocate.
    fn draw_elsewhere(&self, copy: usize, poses: &mut [Pose]) {
        let value = |program| {
            Formula::new(program, self.copies()).evaluate(self.table.view(), copy..copy + 1)[0]
        };
        for drawing in &self.description.drawings {
            poses[drawing.body].y += value(&drawing.y);
            poses[drawing.body].angle += value(&drawing.angle);
        }
    }

    /// Reads the sensors of some copies and computes what is observed.
    fn observe(&mut self, copies: std::ops::Range<usize>) {
        self.senses
            .read(self.dynamics.joints(), copies.clone(), &mut self.table);
        let width = self.columns.observations;
        for (index, formula) in self.observation_formulas.iter_mut().enumerate() {
            let (before, column) = self
                .table
                .split_at(self.columns.first_observation() + index);
            let values = formula.evaluate(before, copies.clone());
            column[copies.clone()].copy_from_slice(values);
            for (row, &value) in self
                .progress
                .observations
                .chunks_exact_mut(width)
                .skip(copies.start)
                .zip(values)
            {
                row[index] = value;
            }
        }
    }

    /// Rewards the copies that have moved, and ends episodes.
    fn judge(&mut self) {
        let copies = 0..self.copies();
        let terminated = self.terminated.evaluate(self.table.view(), copies.clone());
        let rewards = self
            .constant_reward
            .is_none()
            .then(|| self.reward.evaluate(self.table.view(), copies.clone()));
        let progress = &mut self.progress;
        for copy in copies {
            if progress.statuses[copy] == Status::Running {
                progress.rewards[copy] = self
                    .constant_reward
                    .unwrap_or_else(|| rewards.map_or(0.0, |rewards| rewards[copy]));
                progress.steps[copy] += 1;
                let limit = progress.steps[copy] >= self.description.spec.time_limit;
                progress.statuses[copy] = ending(terminated[copy] != 0.0, limit);
                if progress.statuses[copy] != Status::Running {
                    self.dynamics.stop(copy);
                }
            }
        }
    }
}

/// The task's own end counts before the time limit.
fn ending(terminated: bool, limit: bool) -> Status {
    match (terminated, limit) {
        (true, _) => Status::Terminated,
        (false, true) => Status::Truncated,
        (false, false) => Status::Running,
    }
}

impl Progress {
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
