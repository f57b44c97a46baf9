//! Sensors: their schema, and what they measure.

use serde::Deserialize;

use super::resolver::{Resolver, formula};
use super::{Collider, Direction, ForceFrame, Sensor, Vector};
use crate::description::{self, BodyPoint, Measurement, Subtree};
use crate::expression::Type;
use seedbed_input::numbers::Positive;
use seedbed_input::{Located, ValidationError};

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
    /// A coordinate of a joint or of a free body, m or rad. Angles count full turns.
    JointPosition(Located<String>),
    /// A hinge's coordinate without full turns, in (−π, π], rad.
    WrappedJointPosition(Located<String>),
    /// The velocity of a coordinate, m/s or rad/s.
    JointVelocity(Located<String>),
    /// Position of a point of a body along an axis of the world, m.
    BodyPosition {
        /// Name of the body.
        body: Located<String>,
        /// Axis of the world along which the position is measured.
        axis: Axis,
        /// The point in the body's frame; by default its origin.
        #[serde(default)]
        at: Vector,
    },
    /// Velocity of a point of a body in the world, m/s.
    BodyVelocity {
        /// Name of the body.
        body: Located<String>,
        /// Axis of the world along which the velocity is measured.
        axis: Axis,
        /// The point in the body's frame; by default its origin.
        #[serde(default)]
        at: Vector,
    },
    /// A body's angle in the world, counting full turns, rad.
    BodyAngle(Located<String>),
    /// A body's angular velocity, rad/s.
    BodyAngularVelocity(Located<String>),
    /// `Contact(a, b)`: 1 if these two colliders touch, 0 if not.
    Contact(Located<String>, Located<String>),
    /// `ContactForce(a, b)`: normal force between these two colliders, N.
    ContactForce(Located<String>, Located<String>),
    /// Position of the center of mass of a body and of all that hang on it by joints, m.
    SubtreePosition {
        /// Name of the body.
        body: Located<String>,
        /// Axis of the world along which the position is measured.
        axis: Axis,
    },
    /// Velocity of the center of mass of a body and of all that hang on it by joints, m/s.
    SubtreeVelocity {
        /// Name of the body.
        body: Located<String>,
        /// Axis of the world along which the velocity is measured.
        axis: Axis,
    },
    /// Distance along a ray to the first collider of another body or of the world, m.
    Ray {
        /// Name of the body from which the ray starts.
        body: Located<String>,
        /// Where the ray starts, in the body's frame; by default its origin.
        #[serde(default)]
        from: Vector,
        /// Direction of the ray.
        direction: Direction,
        /// Frame in which the direction is given; by default the body's.
        #[serde(default = "local")]
        frame: ForceFrame,
        /// Bits of the collision groups whose surfaces the ray meets; by default all.
        #[serde(default = "all_groups")]
        conaffinity: u32,
        /// Length of the ray: what is measured if it meets nothing, m.
        length: Positive,
    },
    /// A formula over the sensors that are listed before this one.
    Formula(Located<String>),
}

impl Resolver<'_> {
    pub(super) fn sensors(&self) -> Result<Vec<description::Sensor>, ValidationError> {
        let sensors = self.file.sensors.iter().enumerate();
        sensors
            .map(|(index, sensor)| self.sensor(index, sensor))
            .collect()
    }

    fn sensor(
        &self,
        index: usize,
        sensor: &Sensor,
    ) -> Result<description::Sensor, ValidationError> {
        Ok(description::Sensor {
            name: sensor.name.value().as_ref().to_owned(),
            measurement: self.measurement(index, &sensor.kind)?,
        })
    }

    fn measurement(&self, index: usize, kind: &SensorKind) -> Result<Measurement, ValidationError> {
        Ok(match kind {
            SensorKind::Formula(text) => {
                let earlier = &self.state_variables()[..self.columns.first_sensor() + index];
                Measurement::Formula(formula(text, Type::Number, earlier)?)
            }
            SensorKind::JointPosition(name) => {
                Measurement::JointPosition(self.find_coordinate(name)?)
            }
            SensorKind::WrappedJointPosition(joint) => {
                Measurement::WrappedJointPosition(self.find_hinge(joint)?)
            }
            SensorKind::JointVelocity(name) => {
                Measurement::JointVelocity(self.find_coordinate(name)?)
            }
            SensorKind::BodyPosition { body, axis, at } => {
                Measurement::BodyPosition(self.body_point(body, *axis, *at)?)
            }
            SensorKind::BodyVelocity { body, axis, at } => {
                Measurement::BodyVelocity(self.body_point(body, *axis, *at)?)
            }
            SensorKind::BodyAngle(body) => Measurement::BodyAngle(self.find_body(body)?),
            SensorKind::BodyAngularVelocity(body) => {
                Measurement::BodyAngularVelocity(self.find_body(body)?)
            }
            SensorKind::Contact(one, other) => {
                let [one, other] = self.two_colliders("Contact", one, other)?;
                Measurement::Contact(one, other)
            }
            SensorKind::ContactForce(one, other) => {
                let [one, other] = self.two_colliders("ContactForce", one, other)?;
                Measurement::ContactForce(one, other)
            }
            SensorKind::SubtreePosition { body, axis } => {
                Measurement::SubtreePosition(self.subtree(body, *axis)?)
            }
            SensorKind::SubtreeVelocity { body, axis } => {
                Measurement::SubtreeVelocity(self.subtree(body, *axis)?)
            }
            SensorKind::Ray {
                body,
                from,
                direction,
                frame,
                conaffinity,
                length,
            } => Measurement::Ray(description::Ray {
                body: self.find_body(body)?,
                from: from.get(),
                direction: direction.get(),
                is_local: *frame == ForceFrame::Local,
                conaffinity: *conaffinity,
                length: length.get(),
            }),
        })
    }

    fn body_point(
        &self,
        body: &Located<String>,
        axis: Axis,
        at: Vector,
    ) -> Result<BodyPoint, ValidationError> {
        Ok(BodyPoint {
            body: self.find_body(body)?,
            at: at.get(),
            axis: axis as usize,
        })
    }

    /// The body and all that hang on it by joints.
    fn subtree(&self, root: &Located<String>, axis: Axis) -> Result<Subtree, ValidationError> {
        let mut bodies = vec![self.find_body(root)?];
        for joint in &self.file.joints {
            let index_of = |name: &Located<String>| {
                let mut bodies = self.file.bodies.iter();
                bodies.position(|body| body.name.as_ref() == name.as_str())
            };
            let (parent, child) = (index_of(&joint.parent), index_of(&joint.child));
            let (Some(parent), Some(child)) = (parent, child) else {
                continue;
            };
            if bodies.contains(&parent) && !bodies.contains(&child) {
                bodies.push(child);
            }
        }
        let axis = axis as usize;
        Ok(Subtree { bodies, axis })
    }

    /// Indices of two different colliders, which the sensor `kind` takes.
    fn two_colliders(
        &self,
        kind: &str,
        one: &Located<String>,
        other: &Located<String>,
    ) -> Result<[usize; 2], ValidationError> {
        let colliders = [self.find_collider(one)?, self.find_collider(other)?];
        if colliders[0] == colliders[1] {
            return Err(other.error(format!(
                "`{kind}` takes two different colliders, but both are `{}`",
                other.as_str()
            )));
        }
        Ok(colliders)
    }

    /// All colliders in the order of their indices: the world's, then those of each body.
    pub(super) fn all_colliders(&self) -> impl Iterator<Item = &Collider> {
        let of_bodies = self.file.bodies.iter().flat_map(|body| &body.colliders);
        self.file.colliders.iter().chain(of_bodies)
    }

    fn find_collider(&self, name: &Located<String>) -> Result<usize, ValidationError> {
        let name_of = |collider: &Collider| {
            let name = collider.name.as_ref();
            name.map(|name| name.value().as_ref().to_owned())
        };
        let index = self
            .all_colliders()
            .position(|collider| name_of(collider).as_ref() == Some(name.value()));
        index.ok_or_else(|| {
            let names: Vec<_> = self.all_colliders().filter_map(name_of).collect();
            name.unknown_name("collider", names.iter().map(String::as_str))
        })
    }
}

fn local() -> ForceFrame {
    ForceFrame::Local
}

fn all_groups() -> u32 {
    u32::MAX
}
