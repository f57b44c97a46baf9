//! What sensors measure.

use crate::expression::Program;

/// A measured number that formulas may read.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// Name, unique among sensors.
    pub name: String,
    /// What the sensor measures.
    pub measurement: Measurement,
}

/// What a sensor measures.
#[derive(Clone, Debug, PartialEq)]
pub enum Measurement {
    /// The coordinate with this index, m or rad. Angles count full turns.
    JointPosition(usize),
    /// The coordinate of the hinge with this index without full turns, in (−π, π], rad.
    WrappedJointPosition(usize),
    /// The velocity of the coordinate with this index, m/s or rad/s.
    JointVelocity(usize),
    /// Position of a point of a body along one of the world's axes, m.
    BodyPosition(BodyPoint),
    /// Velocity of a point of a body along one of the world's axes, m/s.
    BodyVelocity(BodyPoint),
    /// Angle of the body with this index, counting full turns, rad.
    BodyAngle(usize),
    /// Angular velocity of the body with this index, rad/s.
    BodyAngularVelocity(usize),
    /// 1 if the colliders with these indices touch, 0 if not.
    Contact(usize, usize),
    /// Normal force between the colliders with these indices, N.
    ContactForce(usize, usize),
    /// Position of the center of mass of some bodies along one of the world's axes, m.
    SubtreePosition(Subtree),
    /// Velocity of the center of mass of some bodies along one of the world's axes, m/s.
    SubtreeVelocity(Subtree),
    /// Distance to the first surface of another body or of the world, m.
    Ray(Ray),
    /// A formula over the sensors before this one.
    Formula(Program),
}

/// A point of a body, and one of the world's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyPoint {
    /// Index of the body.
    pub body: usize,
    /// The point in the body's frame, m.
    pub at: [f64; 2],
    /// The axis: 0 for x, 1 for y.
    pub axis: usize,
}

/// A body with all bodies that hang on it, and one of the world's axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Subtree {
    /// Indices of the bodies.
    pub bodies: Vec<usize>,
    /// The axis: 0 for x, 1 for y.
    pub axis: usize,
}

/// A ray from a point of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Index of the body.
    pub body: usize,
    /// Where the ray starts, in the body's frame, m.
    pub from: [f64; 2],
    /// Unit vector.
    pub direction: [f64; 2],
    /// Whether the direction is given in the body's frame, not in the world's.
    pub is_local: bool,
    /// Bits of the collision groups whose surfaces the ray meets.
    pub conaffinity: u32,
    /// Length of the ray: what is measured if it meets nothing, m.
    pub length: f64,
}
