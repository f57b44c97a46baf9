//! Closed-form twins: tasks whose exact equations of motion are known, integrated far below the accuracy of an f32.
//!
//! They are the yardstick of the rigid bodies, and fast enough to learn on. All their numbers come from the task's
//! [`Description`]: a twin has none of its own. Rigid-body engines may not enter.

pub mod acrobot;
pub mod cartpole;
pub mod mountain_car;
pub mod pendulum;

use super::Pose;
use super::description::{Description, Drive, Joint, Passive, Twin};
use super::dynamics::{Dynamics, JointColumns, from_bytes, to_bytes};
use super::kinematics::{Frame, Tree};
use acrobot::Acrobot;
use cartpole::CartPole;
use mountain_car::MountainCar;
use pendulum::Pendulum;
use serde::{Deserialize, Serialize};

/// Equations of motion of some joints.
pub trait Equations: Send {
    /// Advances `state`, the positions of the joints and then their velocities, by one control step under constant joint forces.
    /// `state`: `[2 × joints]`; `forces`: `[joints]`
    fn advance(&self, state: &mut [f64], forces: &[f64]);
}

/// M copies of a task as closed-form equations.
pub struct ClosedForm<E> {
    equations: E,
    motors: Vec<Motor>,
    tree: Tree,
    state: State,
    columns: JointColumns,
    /// On the joints of the copy that is being moved: `[joints]`.
    forces: Vec<f64>,
}

/// An actuator or a field that pushes a joint.
struct Motor {
    joint: usize,
    gear: f64,
}

#[derive(Clone, Serialize, Deserialize)]
struct State {
    live: Vec<bool>,
    /// Positions, then velocities of all joints, one row a copy: `[copies × 2 joints]`.
    rows: Vec<f64>,
}

/// Builds `copies` copies of the twin of a task, none of them live. None if the task has no twin.
#[must_use]
pub fn build(description: &Description, copies: usize) -> Option<Box<dyn Dynamics>> {
    Some(match description.twin? {
        Twin::CartPole { .. } => boxed(CartPole::of(description).ok()?, description, copies),
        Twin::Pendulum { .. } => boxed(Pendulum::of(description).ok()?, description, copies),
        Twin::Acrobot { .. } => boxed(Acrobot::of(description).ok()?, description, copies),
        Twin::MountainCar { .. } => boxed(MountainCar::of(description).ok()?, description, copies),
    })
}

fn boxed<E: Equations + 'static>(
    equations: E,
    description: &Description,
    copies: usize,
) -> Box<dyn Dynamics> {
    Box::new(ClosedForm::new(equations, description, copies))
}

/// Checks that the task's twin, if it has one, moves as its bodies do.
///
/// # Errors
/// Says in what the bodies differ from the twin.
pub fn check(description: &Description) -> Result<(), String> {
    match description.twin {
        Some(Twin::CartPole { .. }) => CartPole::of(description).map(drop),
        Some(Twin::Pendulum { .. }) => Pendulum::of(description).map(drop),
        Some(Twin::Acrobot { .. }) => Acrobot::of(description).map(drop),
        Some(Twin::MountainCar { .. }) => MountainCar::of(description).map(drop),
        None => Ok(()),
    }
}

/// What all twins have in common: nothing resists their motion, and actuators are forces.
fn require_plain(description: &Description) -> Result<(), String> {
    require(
        !description.needs_worlds(),
        "a twin has no free bodies, colliders, or forces on bodies",
    )?;
    for Joint { name, passive, .. } in &description.joints {
        require(
            *passive == Passive::default(),
            &format!("nothing resists the motion of a twin, but something does on `{name}`"),
        )?;
    }
    let forces = description
        .actuators
        .iter()
        .all(|actuator| matches!(actuator.drive, Drive::JointForce(_)));
    require(forces, "a twin's actuators are joint forces")
}

/// [`require_plain`], and neither ranges nor fields.
fn require_free(description: &Description) -> Result<(), String> {
    require_plain(description)?;
    require(
        description.fields.is_empty(),
        "no `force` of nature acts on this twin but gravity",
    )?;
    require(
        description.joints.iter().all(|joint| joint.range.is_none()),
        "the joints of this twin have no `range`",
    )
}

fn require(condition: bool, otherwise: &str) -> Result<(), String> {
    if condition {
        Ok(())
    } else {
        Err(otherwise.to_owned())
    }
}

/// The state after `duration`, s, by one step of Kutta's fourth-order rule; `slope` is its rate of change.
fn runge_kutta<const N: usize>(
    state: [f64; N],
    duration: f64,
    slope: impl Fn([f64; N]) -> [f64; N],
) -> [f64; N] {
    let ahead = |by: f64, slope: [f64; N]| std::array::from_fn(|i| state[i] + by * slope[i]);
    let k1 = slope(state);
    let k2 = slope(ahead(0.5 * duration, k1));
    let k3 = slope(ahead(0.5 * duration, k2));
    let k4 = slope(ahead(duration, k3));
    std::array::from_fn(|i| state[i] + duration / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
}

/// Steps of at most `longest` in a control step.
fn substeps(control_step: f64, longest: f64) -> u32 {
    (control_step / longest).ceil().max(1.0) as u32
}

impl<E: Equations> ClosedForm<E> {
    fn new(equations: E, description: &Description, copies: usize) -> Self {
        let joints = description.joints.len();
        let fields = description
            .fields
            .iter()
            .filter_map(|field| Motor::new(field.drive, 1.0));
        Self {
            equations,
            motors: description
                .actuators
                .iter()
                .filter_map(|actuator| Motor::new(actuator.drive, actuator.gear))
                .chain(fields)
                .collect(),
            tree: Tree::new(description),
            state: State {
                live: vec![false; copies],
                rows: vec![0.0; copies * 2 * joints],
            },
            columns: JointColumns::new(joints, copies),
            forces: vec![0.0; joints],
        }
    }

    /// Numbers in a row: two for each joint.
    fn width(&self) -> usize {
        2 * self.forces.len()
    }

    fn advance(&mut self, copy: usize, controls: &[f32]) {
        self.forces.fill(0.0);
        for (index, motor) in self.motors.iter().enumerate() {
            self.forces[motor.joint] +=
                motor.gear * f64::from(controls[index * self.state.live.len() + copy]);
        }
        let width = self.width();
        self.equations
            .advance(&mut self.state.rows[copy * width..][..width], &self.forces);
        self.show(copy);
    }

    fn show(&mut self, copy: usize) {
        let width = self.width();
        let (positions, velocities) = self.state.rows[copy * width..][..width].split_at(width / 2);
        for (joint, (&position, &velocity)) in positions.iter().zip(velocities).enumerate() {
            self.columns
                .set(joint, copy, position as f32, velocity as f32);
        }
    }
}

impl<E: Equations> Dynamics for ClosedForm<E> {
    fn start(&mut self, copy: usize, positions: &[f64], velocities: &[f64]) {
        let width = self.width();
        let row = &mut self.state.rows[copy * width..][..width];
        row[..width / 2].copy_from_slice(positions);
        row[width / 2..].copy_from_slice(velocities);
        self.state.live[copy] = true;
        self.show(copy);
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

    fn joints(&self) -> &JointColumns {
        &self.columns
    }

    fn poses(&self, copy: usize, poses: &mut [Pose]) {
        let width = self.width();
        let (positions, velocities) = self.state.rows[copy * width..][..width].split_at(width / 2);
        let mut frames = self.tree.frames();
        self.tree.place(positions, velocities, &mut frames);
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
            return Err("the state is of another number of copies".to_owned());
        }
        self.state = state;
        (0..self.state.live.len()).for_each(|copy| self.show(copy));
        Ok(())
    }
}

impl Motor {
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
