//! Closed-form twins: tasks whose exact equations of motion are known, integrated far below the accuracy of an f32.
//!
//! They are the yardstick of the rigid bodies, and fast enough to learn on. All their numbers come from the task's
//! [`Description`]: a twin has none of its own. Rigid-body engines may not enter.

pub mod cartpole;

use super::Pose;
use super::description::{Description, Drive, Twin};
use super::dynamics::{Dynamics, JointColumns, from_bytes, to_bytes};
use super::kinematics::{Frame, Tree};
use cartpole::CartPole;
use serde::{Deserialize, Serialize};

/// Equations of motion of two joints.
pub trait Equations: Send {
    /// Positions of the joints, then their velocities, after one control step under constant joint forces.
    fn advance(&self, state: [f64; 4], forces: [f64; 2]) -> [f64; 4];
}

/// M copies of a task as closed-form equations.
pub struct ClosedForm<E> {
    equations: E,
    motors: Vec<Motor>,
    tree: Tree,
    state: State,
    columns: JointColumns,
}

/// An actuator that pushes a joint.
struct Motor {
    joint: usize,
    gear: f64,
}

#[derive(Clone, Serialize, Deserialize)]
struct State {
    live: Vec<bool>,
    /// Positions and velocities of both joints, one row a copy.
    rows: Vec<[f64; 4]>,
}

/// Builds `copies` copies of the twin of a task, none of them live. None if the task has no twin.
#[must_use]
pub fn build(description: &Description, copies: usize) -> Option<Box<dyn Dynamics>> {
    let Twin::CartPole { .. } = description.twin?;
    let cart_pole = CartPole::of(description).ok()?;
    Some(Box::new(ClosedForm::new(cart_pole, description, copies)))
}

/// Checks that the task's twin, if it has one, moves as its bodies do.
///
/// # Errors
/// Says in what the bodies differ from the twin.
pub fn check(description: &Description) -> Result<(), String> {
    match description.twin {
        Some(Twin::CartPole { .. }) => CartPole::of(description).map(drop),
        None => Ok(()),
    }
}

impl<E: Equations> ClosedForm<E> {
    fn new(equations: E, description: &Description, copies: usize) -> Self {
        Self {
            equations,
            motors: description.actuators.iter().filter_map(Motor::new).collect(),
            tree: Tree::new(description),
            state: State { live: vec![false; copies], rows: vec![[0.0; 4]; copies] },
            columns: JointColumns::new(description.joints.len(), copies),
        }
    }

    fn forces(&self, copy: usize, controls: &[f32]) -> [f64; 2] {
        let mut forces = [0.0; 2];
        for (index, motor) in self.motors.iter().enumerate() {
            forces[motor.joint] += motor.gear * f64::from(controls[index * self.state.live.len() + copy]);
        }
        forces
    }

    fn show(&mut self, copy: usize) {
        let [first, second, first_rate, second_rate] = self.state.rows[copy].map(|value| value as f32);
        self.columns.set(0, copy, first, first_rate);
        self.columns.set(1, copy, second, second_rate);
    }
}

impl<E: Equations> Dynamics for ClosedForm<E> {
    fn start(&mut self, copy: usize, positions: &[f64], velocities: &[f64]) {
        self.state.rows[copy] = [positions[0], positions[1], velocities[0], velocities[1]];
        self.state.live[copy] = true;
        self.show(copy);
    }

    fn stop(&mut self, copy: usize) {
        self.state.live[copy] = false;
    }

    fn step(&mut self, controls: &[f32]) {
        for copy in 0..self.state.live.len() {
            if self.state.live[copy] {
                let forces = self.forces(copy, controls);
                self.state.rows[copy] = self.equations.advance(self.state.rows[copy], forces);
                self.show(copy);
            }
        }
    }

    fn joints(&self) -> &JointColumns {
        &self.columns
    }

    fn poses(&self, copy: usize, poses: &mut [Pose]) {
        let [first, second, first_rate, second_rate] = self.state.rows[copy];
        let mut frames = self.tree.frames();
        self.tree.place(&[first, second], &[first_rate, second_rate], &mut frames);
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
    /// None for what a twin cannot drive, which [`check`] refuses.
    fn new(actuator: &super::description::Actuator) -> Option<Self> {
        let Drive::JointForce(joint) = actuator.drive else { return None };
        Some(Self { joint, gear: actuator.gear })
    }
}

impl From<&Frame> for Pose {
    fn from(frame: &Frame) -> Self {
        let [x, y] = frame.position.map(|value| value as f32);
        Self { x, y, angle: frame.angle as f32 }
    }
}
