//! What actuators act on and what sensors measure: their schema, and what they mean.

use serde::Deserialize;

use super::joint::{find_hinge, find_moving};
use super::{Actuator, Collider, Direction, Environment, Sensor, Vector, resolve};
use crate::env::description::{self, BodyPoint, Drive, Reading, Servo, Target};
use crate::env::expression::Type;
use crate::input::numbers::{Finite, NonNegative, Positive};
use crate::input::{Complaint, Located};

/// What an actuator acts on.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum ActuatorKind {
    /// A force (N) or torque (N m) along a joint's coordinate.
    JointForce(Located<String>),
    /// A motor with the force kv (control − q̇).
    VelocityServo {
        /// Which joint.
        joint: Located<String>,
        /// N s/m or N m s/rad.
        kv: Positive,
        /// Largest force, N or N m.
        #[serde(default)]
        force_limit: Option<Positive>,
    },
    /// A motor with the force kp (control − q) − kv q̇.
    PositionServo {
        /// Which joint.
        joint: Located<String>,
        /// N/m or N m/rad.
        kp: Positive,
        /// N s/m or N m s/rad; 0 by default.
        #[serde(default)]
        kv: Option<NonNegative>,
        /// Largest force, N or N m.
        #[serde(default)]
        force_limit: Option<Positive>,
    },
    /// Nothing by itself: formulas of forces read it.
    Signal,
    /// A force (N) on a body.
    BodyForce {
        /// Which body.
        body: Located<String>,
        /// Where, in the body's frame; by default at the centre of mass.
        #[serde(default)]
        at: Option<Vector>,
        /// Where a positive force pushes.
        direction: Direction,
        /// Whose direction it is.
        #[serde(default)]
        frame: ForceFrame,
    },
}

/// Whose direction a force has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum ForceFrame {
    /// The world's.
    #[default]
    World,
    /// The body's: the force turns with it.
    Local,
}

/// An axis of the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum Axis {
    /// To the right.
    X,
    /// Upwards.
    Y,
}

/// What a sensor measures.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum SensorKind {
    /// A coordinate of a joint or of a free body, m or rad; angles count full turns.
    JointPosition(Located<String>),
    /// A hinge's coordinate, rad, without its full turns: in (−π, π].
    WrappedJointPosition(Located<String>),
    /// The rate of a coordinate, m/s or rad/s.
    JointVelocity(Located<String>),
    /// Where a point of a body is in the world, m.
    BodyPosition {
        /// Which body.
        body: Located<String>,
        /// Along which of the world's axes.
        axis: Axis,
        /// In the body's frame.
        #[serde(default)]
        at: Vector,
    },
    /// How fast a point of a body moves in the world, m/s.
    BodyVelocity {
        /// Which body.
        body: Located<String>,
        /// Along which of the world's axes.
        axis: Axis,
        /// In the body's frame.
        #[serde(default)]
        at: Vector,
    },
    /// A body's angle in the world, rad, counting full turns.
    BodyAngle(Located<String>),
    /// Its rate, rad/s.
    BodyAngularVelocity(Located<String>),
    /// `Contact(a, b)`: 1 if these two colliders touch, 0 if not.
    Contact(Located<String>, Located<String>),
    /// Distance along a ray to the first collider of another body or of the world.
    Ray {
        /// Which body sends it.
        body: Located<String>,
        /// Where it starts, in the body's frame.
        #[serde(default)]
        from: Vector,
        /// Where it goes, in the body's frame.
        direction: Direction,
        /// What is measured if nothing is nearer.
        length: Positive,
    },
    /// A formula over the sensors that are listed before.
    Formula(Located<String>),
}

/// An actuator with the indices of what it acts on.
pub(super) fn actuator(
    actuator: &Actuator,
    file: &Environment,
) -> Result<description::Actuator, Complaint> {
    let (choice, range) = resolve::choice(&actuator.control);
    Ok(description::Actuator {
        name: actuator.name.value().as_ref().to_owned(),
        drive: drive(&actuator.kind, file)?,
        gear: actuator.gear.map_or(1.0, Finite::get),
        choice,
        range,
    })
}

/// Where contacts are, a joint has one motor.
pub(super) fn check_servos(file: &Environment) -> Result<(), Complaint> {
    let mut driven: Vec<&str> = Vec::new();
    for actuator in file
        .actuators
        .iter()
        .filter(|_| resolve::needs_worlds(file))
    {
        if let ActuatorKind::VelocityServo { joint, .. }
        | ActuatorKind::PositionServo { joint, .. } = &actuator.kind
        {
            if driven.contains(&joint.as_str()) {
                return Err(joint.complain(format!(
                    "joint `{}` has a servo already: with contacts, it takes one",
                    joint.as_str()
                )));
            }
            driven.push(joint.as_str());
        }
    }
    Ok(())
}

fn drive(kind: &ActuatorKind, file: &Environment) -> Result<Drive, Complaint> {
    let limit = |force: &Option<Positive>| force.map(Positive::get);
    let moving = |joint| find_moving(joint, &file.joints);
    Ok(match kind {
        ActuatorKind::JointForce(joint) => Drive::JointForce(moving(joint)?),
        ActuatorKind::VelocityServo {
            joint,
            kv,
            force_limit,
        } => Drive::Servo(Servo {
            joint: moving(joint)?,
            target: Target::Velocity,
            kp: 0.0,
            kv: kv.get(),
            force_limit: limit(force_limit),
        }),
        ActuatorKind::PositionServo {
            joint,
            kp,
            kv,
            force_limit,
        } => Drive::Servo(Servo {
            joint: moving(joint)?,
            target: Target::Position,
            kp: kp.get(),
            kv: kv.map_or(0.0, NonNegative::get),
            force_limit: limit(force_limit),
        }),
        ActuatorKind::BodyForce {
            body,
            at,
            direction,
            frame,
        } => Drive::BodyForce {
            body: resolve::find_body(body, file)?,
            at: at.map(Vector::get),
            direction: direction.get(),
            local: *frame == ForceFrame::Local,
        },
        ActuatorKind::Signal => Drive::Nothing,
    })
}

/// A sensor with the indices of what it measures.
pub(super) fn sensor(
    index: usize,
    sensor: &Sensor,
    file: &Environment,
) -> Result<description::Sensor, Complaint> {
    Ok(description::Sensor {
        name: sensor.name.value().as_ref().to_owned(),
        reading: reading(index, &sensor.kind, file)?,
    })
}

fn reading(index: usize, kind: &SensorKind, file: &Environment) -> Result<Reading, Complaint> {
    Ok(match kind {
        SensorKind::Formula(text) => {
            let before: Vec<_> = resolve::present_sensors(file, resolve::columns(file))
                .into_iter()
                .take(index)
                .collect();
            Reading::Formula(resolve::formula(text, Type::Number, &before)?)
        }
        SensorKind::JointPosition(name) => {
            Reading::JointPosition(resolve::find_coordinate(name, file)?)
        }
        SensorKind::WrappedJointPosition(joint) => {
            Reading::WrappedJointPosition(find_hinge(joint, &file.joints)?)
        }
        SensorKind::JointVelocity(name) => {
            Reading::JointVelocity(resolve::find_coordinate(name, file)?)
        }
        SensorKind::BodyPosition { body, axis, at } => {
            Reading::BodyPosition(point(body, *axis, *at, file)?)
        }
        SensorKind::BodyVelocity { body, axis, at } => {
            Reading::BodyVelocity(point(body, *axis, *at, file)?)
        }
        SensorKind::BodyAngle(body) => Reading::BodyAngle(resolve::find_body(body, file)?),
        SensorKind::BodyAngularVelocity(body) => {
            Reading::BodyAngularVelocity(resolve::find_body(body, file)?)
        }
        SensorKind::Contact(one, other) => contact(one, other, file)?,
        SensorKind::Ray {
            body,
            from,
            direction,
            length,
        } => Reading::Ray(description::Ray {
            body: resolve::find_body(body, file)?,
            from: from.get(),
            direction: direction.get(),
            length: length.get(),
        }),
    })
}

fn point(
    body: &Located<String>,
    axis: Axis,
    at: Vector,
    file: &Environment,
) -> Result<BodyPoint, Complaint> {
    Ok(BodyPoint {
        body: resolve::find_body(body, file)?,
        at: at.get(),
        axis: axis as usize,
    })
}

fn contact(
    one: &Located<String>,
    other: &Located<String>,
    file: &Environment,
) -> Result<Reading, Complaint> {
    let (first, second) = (find_collider(one, file)?, find_collider(other, file)?);
    if first == second {
        return Err(other.complain(format!(
            "a contact is between two colliders, but both are `{}`",
            &**other
        )));
    }
    Ok(Reading::Contact(first, second))
}

/// The collider's index: the world's come first, then those of each body.
fn find_collider(name: &Located<String>, file: &Environment) -> Result<usize, Complaint> {
    let all = || {
        file.colliders
            .iter()
            .chain(file.bodies.iter().flat_map(|body| &body.colliders))
    };
    let named = |collider: &Collider| {
        collider
            .name
            .as_ref()
            .is_some_and(|known| known.as_ref() == name.as_str())
    };
    let names: Vec<_> = all()
        .filter_map(|collider| collider.name.as_ref())
        .map(|known| known.value().as_ref())
        .collect();
    all()
        .position(named)
        .ok_or_else(|| name.complain_unknown("collider", names))
}
