//! Actuators: their schema, and what they act on.

use serde::Deserialize;

use super::resolver::Resolver;
use super::{Actuator, Control, Direction, Vector};
use crate::Action;
use crate::description::{self, BodyTask, Drive, Servo, ServoTarget};
use seedbed_input::numbers::{FiniteNumber, NonNegative, Positive};
use seedbed_input::{Located, ValidationError};

/// What an actuator acts on.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum ActuatorKind {
    /// A force (N) or torque (N m) along a coordinate of a joint or of a free body.
    JointForce(Located<String>),
    /// A motor with the force kv (gear × control − q̇).
    VelocityServo {
        /// Name of the joint.
        joint: Located<String>,
        /// Velocity gain, N s/m or N m s/rad.
        kv: Positive,
        /// Maximum force, N or N m; unlimited by default.
        #[serde(default)]
        force_limit: Option<Positive>,
    },
    /// A motor with the force kp (gear × control − q) − kv q̇.
    PositionServo {
        /// Name of the joint.
        joint: Located<String>,
        /// Position gain, N/m or N m/rad.
        kp: Positive,
        /// Velocity gain, N s/m or N m s/rad; 0 by default.
        #[serde(default)]
        kv: Option<NonNegative>,
        /// Maximum force, N or N m; unlimited by default.
        #[serde(default)]
        force_limit: Option<Positive>,
    },
    /// A motor that drives the velocity to `speed` in the direction of the control's sign, with a force
    /// of at most `max_force` × |control|, as the motors of Box2D do.
    SpeedMotor {
        /// Name of the joint.
        joint: Located<String>,
        /// Speed, m/s or rad/s.
        speed: Positive,
        /// Maximum force at a control of ±1, N or N m.
        max_force: Positive,
    },
    /// Nothing by itself: formulas of forces read the control.
    Signal,
    /// A force (N) on a body.
    BodyForce {
        /// Name of the body.
        body: Located<String>,
        /// Point of application in the body's frame; by default the center of mass.
        #[serde(default)]
        at: Option<Vector>,
        /// Direction in which a positive force pushes.
        direction: Direction,
        /// Frame in which the direction is given.
        #[serde(default)]
        frame: ForceFrame,
    },
}

/// The frame in which the direction of a force or of a ray is given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum ForceFrame {
    /// The world's frame.
    #[default]
    World,
    /// The body's frame: the force turns with the body.
    Local,
}

impl Resolver<'_> {
    pub(super) fn actuators(&self) -> Result<Vec<description::Actuator>, ValidationError> {
        let actuators = self.file.actuators.iter();
        actuators.map(|actuator| self.actuator(actuator)).collect()
    }

    fn actuator(&self, actuator: &Actuator) -> Result<description::Actuator, ValidationError> {
        let Action { quantity, choice } = action(actuator);
        Ok(description::Actuator {
            name: quantity.name,
            drive: self.drive(&actuator.kind)?,
            gear: actuator.gear.map_or(1.0, FiniteNumber::get),
            choice,
            range: quantity.range,
        })
    }

    fn drive(&self, kind: &ActuatorKind) -> Result<Drive, ValidationError> {
        Ok(match kind {
            ActuatorKind::JointForce(coordinate) => self.coordinate_force(coordinate)?,
            ActuatorKind::VelocityServo {
                joint,
                kv,
                force_limit,
            } => Drive::Servo(Servo {
                joint: self.find_moving_joint(joint)?,
                target: ServoTarget::Velocity,
                kp: 0.0,
                kv: kv.get(),
                force_limit: force_limit.map(Positive::get),
            }),
            ActuatorKind::PositionServo {
                joint,
                kp,
                kv,
                force_limit,
            } => Drive::Servo(Servo {
                joint: self.find_moving_joint(joint)?,
                target: ServoTarget::Position,
                kp: kp.get(),
                kv: kv.map_or(0.0, NonNegative::get),
                force_limit: force_limit.map(Positive::get),
            }),
            ActuatorKind::SpeedMotor {
                joint,
                speed,
                max_force,
            } => Drive::Servo(Servo {
                joint: self.find_moving_joint(joint)?,
                target: ServoTarget::Speed {
                    speed: speed.get(),
                    max_force: max_force.get(),
                },
                kp: 0.0,
                kv: 0.0,
                force_limit: None,
            }),
            ActuatorKind::BodyForce {
                body,
                at,
                direction,
                frame,
            } => Drive::BodyForce {
                body: self.find_body(body)?,
                at: at.map(Vector::get),
                direction: direction.get(),
                is_local: *frame == ForceFrame::Local,
            },
            ActuatorKind::Signal => Drive::Nothing,
        })
    }

    /// Checks that no joint has two servos if copies have worlds of their own: there, a servo is
    /// the motor of Rapier's multibody joint, and a joint has only one motor. Elsewhere each servo
    /// is a constraint of its own.
    pub(super) fn check_servos(&self, task: &BodyTask) -> Result<(), ValidationError> {
        self.check_gains(task)?;
        if !task.needs_own_worlds() {
            return Ok(());
        }
        let mut joints_with_servo: Vec<&str> = Vec::new();
        for joint in self.file.actuators.iter().filter_map(servo_joint) {
            if joints_with_servo.contains(&joint.as_str()) {
                return Err(joint.error(format!(
                    "joint `{}` already has a servo: in a task with contacts a joint takes only one",
                    joint.as_str()
                )));
            }
            joints_with_servo.push(joint.as_str());
        }
        Ok(())
    }

    /// Checks that no servo is so weak that the solver would take it for a rigid one.
    fn check_gains(&self, task: &BodyTask) -> Result<(), ValidationError> {
        for (actuator, described) in self.file.actuators.iter().zip(&task.actuators) {
            let (Some(joint), Drive::Servo(servo)) = (servo_joint(actuator), described.drive)
            else {
                continue;
            };
            if task.is_too_weak(servo.kp, servo.kv) {
                return Err(joint.error(format!(
                    "the servo of joint `{}` is too weak for single precision: expected kp h² + kv h of at least 1e-20 in \
                     a substep h of {:e} s",
                    joint.as_str(),
                    task.substep()
                )));
            }
        }
        Ok(())
    }
}

/// The joint that a servo drives; `None` of other actuators.
fn servo_joint(actuator: &Actuator) -> Option<&Located<String>> {
    match &actuator.kind {
        ActuatorKind::VelocityServo { joint, .. }
        | ActuatorKind::PositionServo { joint, .. }
        | ActuatorKind::SpeedMotor { joint, .. } => Some(joint),
        _ => None,
    }
}

/// The component of an action that drives an actuator.
pub(super) fn action(actuator: &Actuator) -> Action {
    let (name, unit) = (actuator.name.as_ref(), &actuator.unit);
    match &actuator.control {
        Control::Continuous(interval) => {
            Action::continuous(name, unit, interval.get().map(|end| end as f32))
        }
        Control::Discrete(values) => Action::discrete(name, unit, &values.get()),
    }
}
