//! Analytic models: classic tasks whose exact equations of motion are known, integrated with an
//! error far below the resolution of an f32.
//!
//! Rigid bodies are validated against them, and they are fast enough to learn on. All their
//! parameters come from the bodies of the [`BodyTask`]. This module must not depend on rigid-body
//! engines.

pub mod acrobot;
pub mod cartpole;
pub mod mountain_car;
pub mod pendulum;

use super::Pose;
use super::description::{AnalyticModel, BodyTask, Drive, Joint, PassiveForces};
use super::dynamics::{CoordinateColumns, Dynamics, from_bytes, to_bytes};
use super::kinematics::{Frame, KinematicTree};
use acrobot::Acrobot;
use cartpole::CartPole;
use mountain_car::MountainCar;
use pendulum::Pendulum;
use serde::{Deserialize, Serialize};

/// The equations of motion of all joints of a task.
pub(crate) trait EquationsOfMotion: Send {
    /// Advances `state`, the positions of the joints and then their velocities, by one control step
    /// under constant joint forces. `state`: `[2 × joints]`; `forces`: `[joints]`
    fn advance(&self, state: &mut [f64], forces: &[f64]);
}

/// M copies of a task as equations of motion.
struct AnalyticDynamics<E> {
    equations: E,
    joint_forces: Vec<JointForce>,
    tree: KinematicTree,
    state: State,
    columns: CoordinateColumns,
    /// Forces on the joints of the copy that is being advanced: `[joints]`.
    forces: Vec<f64>,
}

/// An actuator or a formula force that acts along a joint.
struct JointForce {
    joint: usize,
    gear: f64,
}

/// The state of all copies, which a checkpoint stores.
#[derive(Clone, Serialize, Deserialize)]
struct State {
    /// Whether each copy is live: `[copies]`.
    live: Vec<bool>,
    /// Positions, then velocities of all joints, one row per copy: `[copies × 2 joints]`.
    rows: Vec<f64>,
}

/// Builds `copies` copies of the analytic model of a task; none is live before its `start`. `None` if
/// the task has no analytic model.
#[must_use]
pub(crate) fn build(task: &BodyTask, copies: usize) -> Option<Box<dyn Dynamics>> {
    Some(match task.analytic_model? {
        AnalyticModel::CartPole { .. } => boxed(CartPole::from_task(task).ok()?, task, copies),
        AnalyticModel::Pendulum { .. } => boxed(Pendulum::from_task(task).ok()?, task, copies),
        AnalyticModel::Acrobot { .. } => boxed(Acrobot::from_task(task).ok()?, task, copies),
        AnalyticModel::MountainCar { .. } => {
            boxed(MountainCar::from_task(task).ok()?, task, copies)
        }
    })
}

fn boxed<E: EquationsOfMotion + 'static>(
    equations: E,
    task: &BodyTask,
    copies: usize,
) -> Box<dyn Dynamics> {
    Box::new(AnalyticDynamics::new(equations, task, copies))
}

/// Checks that the task's analytic model, if it has one, describes the motion of its bodies.
///
/// # Errors
/// Says what the model requires of the bodies.
pub(crate) fn check(task: &BodyTask) -> Result<(), String> {
    match task.analytic_model {
        Some(AnalyticModel::CartPole { .. }) => CartPole::from_task(task).map(drop),
        Some(AnalyticModel::Pendulum { .. }) => Pendulum::from_task(task).map(drop),
        Some(AnalyticModel::Acrobot { .. }) => Acrobot::from_task(task).map(drop),
        Some(AnalyticModel::MountainCar { .. }) => MountainCar::from_task(task).map(drop),
        None => Ok(()),
    }
}

/// Checks what all analytic models require: no free bodies, no colliders, no passive forces, and no
/// actuators except joint forces.
fn require_common_properties(task: &BodyTask) -> Result<(), String> {
    require(
        !task.needs_own_worlds(),
        "an analytic model cannot have free bodies, colliders, or forces on bodies",
    )?;
    for Joint {
        name,
        passive_forces,
        ..
    } in &task.joints
    {
        require(
            *passive_forces == PassiveForces::default(),
            &format!(
                "an analytic model cannot have resistance: remove damping, friction, armature and stiffness from joint `{name}`"
            ),
        )?;
    }
    let has_only_joint_forces = task
        .actuators
        .iter()
        .all(|actuator| matches!(actuator.drive, Drive::JointForce(_)));
    require(
        has_only_joint_forces,
        "an analytic model can only have actuators of type `JointForce`",
    )
}

/// Like [`require_common_properties`], and also checks that there are no ranges and that no forces
/// act but gravity and actuators.
fn require_only_gravity(task: &BodyTask) -> Result<(), String> {
    require_common_properties(task)?;
    require(
        task.formula_forces.is_empty(),
        "this analytic model cannot have a joint `force`",
    )?;
    require(
        task.joints.iter().all(|joint| joint.range.is_none()),
        "this analytic model cannot have a joint `range`",
    )
}

/// An error with this message unless the condition holds.
fn require(condition: bool, message: &str) -> Result<(), String> {
    if condition {
        Ok(())
    } else {
        Err(message.to_owned())
    }
}

/// The state after `duration`, s, by one step of the fourth-order Runge–Kutta method; `derivative`
/// is the time derivative of a state.
fn runge_kutta<const N: usize>(
    state: [f64; N],
    duration: f64,
    derivative: impl Fn([f64; N]) -> [f64; N],
) -> [f64; N] {
    let extrapolate =
        |time: f64, rate: [f64; N]| std::array::from_fn(|i| state[i] + time * rate[i]);
    let k1 = derivative(state);
    let k2 = derivative(extrapolate(0.5 * duration, k1));
    let k3 = derivative(extrapolate(0.5 * duration, k2));
    let k4 = derivative(extrapolate(duration, k3));
    std::array::from_fn(|i| state[i] + duration / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
}

/// Number of steps of at most `max_step` in a control step.
fn substeps(control_step: f64, max_step: f64) -> u32 {
    (control_step / max_step).ceil().max(1.0) as u32
}

impl<E: EquationsOfMotion> AnalyticDynamics<E> {
    fn new(equations: E, task: &BodyTask, copies: usize) -> Self {
        let joints = task.joints.len();
        let formula_forces = task
            .formula_forces
            .iter()
            .filter_map(|force| JointForce::new(force.drive, 1.0));
        Self {
            equations,
            joint_forces: task
                .actuators
                .iter()
                .filter_map(|actuator| JointForce::new(actuator.drive, actuator.gear))
                .chain(formula_forces)
                .collect(),
            tree: KinematicTree::new(task),
            state: State {
                live: vec![false; copies],
                rows: vec![0.0; copies * 2 * joints],
            },
            columns: CoordinateColumns::new(joints, copies),
            forces: vec![0.0; joints],
        }
    }

    /// Length of a row: two numbers per joint.
    fn width(&self) -> usize {
        2 * self.forces.len()
    }

    /// Advances one copy by one control step.
    fn advance(&mut self, copy: usize, controls: &[f32]) {
        self.forces.fill(0.0);
        for (index, joint_force) in self.joint_forces.iter().enumerate() {
            self.forces[joint_force.joint] +=
                joint_force.gear * f64::from(controls[index * self.state.live.len() + copy]);
        }
        let width = self.width();
        self.equations
            .advance(&mut self.state.rows[copy * width..][..width], &self.forces);
        self.update_columns(copy);
    }

    /// Writes the state of one copy to the coordinate columns.
    fn update_columns(&mut self, copy: usize) {
        let width = self.width();
        let (positions, velocities) = self.state.rows[copy * width..][..width].split_at(width / 2);
        for (joint, (&position, &velocity)) in positions.iter().zip(velocities).enumerate() {
            self.columns
                .set(joint, copy, position as f32, velocity as f32);
        }
    }
}

impl<E: EquationsOfMotion> Dynamics for AnalyticDynamics<E> {
    fn start(&mut self, copy: usize, positions: &[f64], velocities: &[f64]) {
        let width = self.width();
        let row = &mut self.state.rows[copy * width..][..width];
        row[..width / 2].copy_from_slice(positions);
        row[width / 2..].copy_from_slice(velocities);
        self.state.live[copy] = true;
        self.update_columns(copy);
    }

    fn stop(&mut self, copy: usize) {
        self.state.live[copy] = false;
    }

    fn step(&mut self, controls: &[f32]) {
        for copy in 0..self.state.live.len() {
            if self.state.live[copy] {
                self.advance(copy, controls);
            }
        }
    }

    fn coordinates(&self) -> &CoordinateColumns {
        &self.columns
    }

    fn poses(&self, copy: usize, poses: &mut [Pose]) {
        let width = self.width();
        let (positions, velocities) = self.state.rows[copy * width..][..width].split_at(width / 2);
        let mut frames = self.tree.frame_buffer();
        self.tree.compute_frames(positions, velocities, &mut frames);
        for (pose, frame) in poses.iter_mut().zip(&frames) {
            *pose = Pose::from(frame);
        }
    }

    fn save(&self) -> Vec<u8> {
        to_bytes(&self.state)
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let state: State = from_bytes(bytes)?;
        if state.live.len() != self.state.live.len() || state.rows.len() != self.state.rows.len() {
            return Err("the saved state has another number of copies".to_owned());
        }
        self.state = state;
        (0..self.state.live.len()).for_each(|copy| self.update_columns(copy));
        Ok(())
    }
}

impl JointForce {
    fn new(drive: Drive, gear: f64) -> Option<Self> {
        match drive {
            Drive::JointForce(joint) => Some(Self { joint, gear }),
            Drive::Nothing | Drive::Servo(_) | Drive::BodyForce { .. } => None,
        }
    }
}

impl From<&Frame> for Pose {
    fn from(frame: &Frame) -> Self {
        let [x, y] = frame.position.map(|value| value as f32);
        Self {
            x,
            y,
            angle: frame.angle as f32,
        }
    }
}
