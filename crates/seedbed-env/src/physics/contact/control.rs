//! How actuators and formula forces act on bodies and joints of tasks with contacts.

use rapier2d::prelude::{MultibodyJointSet, RigidBody, RigidBodyHandle, RigidBodySet, Vector};

use super::super::vector;
use super::link::Link;
use crate::description::{BodyTask, Drive, ServoTarget};

/// An actuator or a formula force.
pub(super) struct ControlInput {
    effect: Effect,
    gear: f32,
}

enum Effect {
    Nothing,
    /// Pushes the joint with this index.
    Push(usize),
    /// Sets the target of the servo of the joint with this index.
    Servo(usize, ServoTarget),
    Torque(RigidBodyHandle),
    Force(BodyForce),
}

/// A force on a point of a body.
struct BodyForce {
    body: RigidBodyHandle,
    /// From the body's center of mass to the point, in the body's frame, m.
    arm: Vector,
    direction: Vector,
    /// Whether `direction` is in the body's frame and not in the world's.
    is_local: bool,
}

impl ControlInput {
    /// One per actuator, then one per formula force. `handles`: of the task's bodies
    pub(super) fn from_task(task: &BodyTask, handles: &[RigidBodyHandle]) -> Vec<Self> {
        let actuators = task.actuators.iter();
        let actuators = actuators.map(|actuator| (actuator.drive, actuator.gear as f32));
        let forces = task.formula_forces.iter().map(|force| (force.drive, 1.0));
        let inputs = actuators.chain(forces).map(|(drive, gear)| Self {
            effect: Effect::new(drive, task, handles),
            gear,
        });
        inputs.collect()
    }

    /// Sets the servo target, or adds the force, that belongs to the value of the control.
    pub(super) fn apply(
        &self,
        control: f32,
        links: &[Link],
        bodies: &mut RigidBodySet,
        joints: &mut MultibodyJointSet,
    ) {
        let value = self.gear * control;
        match &self.effect {
            Effect::Nothing => {}
            Effect::Push(joint) => links[*joint].push(value, bodies),
            Effect::Servo(joint, target) => links[*joint].set_target(*target, value, joints),
            Effect::Torque(body) => bodies[*body].add_torque(value, false),
            Effect::Force(force) => force.add(value, &mut bodies[force.body]),
        }
    }
}

impl Effect {
    fn new(drive: Drive, task: &BodyTask, handles: &[RigidBodyHandle]) -> Self {
        match drive {
            Drive::Nothing => Self::Nothing,
            Drive::JointForce(joint) => Self::Push(joint),
            Drive::Servo(servo) => Self::Servo(servo.joint, servo.target),
            Drive::BodyTorque { body } => Self::Torque(handles[body]),
            Drive::BodyForce {
                body,
                at,
                direction,
                is_local,
            } => {
                let com = vector(task.bodies[body].inertial.com);
                Self::Force(BodyForce {
                    body: handles[body],
                    arm: at.map_or(Vector::ZERO, |at| vector(at) - com),
                    direction: vector(direction),
                    is_local,
                })
            }
        }
    }
}

impl BodyForce {
    /// Adds the force of this size, N.
    fn add(&self, size: f32, body: &mut RigidBody) {
        let force = self.direction * size;
        let force = if self.is_local {
            *body.rotation() * force
        } else {
            force
        };
        let point = *body.position() * self.arm;
        body.add_force_at_point(force, point, false);
    }
}
