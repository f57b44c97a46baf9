//! What acts on bodies and what is measured of them.

use crate::env::Choice;
use crate::env::expression::Program;

/// What one component of an action drives.
#[derive(Clone, Debug, PartialEq)]
pub struct Actuator {
    /// Unique among actions, observations and sensors.
    pub name: String,
    /// What it acts on.
    pub drive: Drive,
    /// Force or torque for each unit of control.
    pub gear: f64,
    /// Values that the control may take.
    pub choice: Choice,
    /// Lowest and highest control.
    pub range: [f32; 2],
}

/// What an actuator acts on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drive {
    /// A force (N) or torque (N m) along the coordinate of the joint with this index.
    JointForce(usize),
    /// Nothing by itself.
    Nothing,
    /// A force (N) on a body.
    BodyForce {
        /// Which body.
        body: usize,
        /// Where, in the body's frame, m; none is the centre of mass.
        at: Option<[f64; 2]>,
        /// Unit vector along which a positive force pushes.
        direction: [f64; 2],
        /// Whether the direction turns with the body.
        local: bool,
    },
    /// A motor that drives a joint's coordinate or rate to gear × control.
    Servo(Servo),
}

/// A motor with the force kp (target − q) + kv (rate − q̇), computed anew in each substep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Servo {
    /// Which joint.
    pub joint: usize,
    /// What gear × control says.
    pub target: Target,
    /// N/m or N m/rad; 0 for a velocity servo.
    pub kp: f64,
    /// N s/m or N m s/rad.
    pub kv: f64,
    /// Largest force, N or N m.
    pub force_limit: Option<f64>,
}

/// What a servo is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// The coordinate, m or rad; the rate is 0.
    Position,
    /// The rate, m/s or rad/s.
    Velocity,
}

/// A number that formulas may read.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// Unique among sensors.
    pub name: String,
    /// What it measures.
    pub reading: Reading,
}

/// What a sensor measures.
#[derive(Clone, Debug, PartialEq)]
pub enum Reading {
    /// The coordinate with this index, m or rad; angles count full turns.
    JointPosition(usize),
    /// The coordinate of the hinge with this index, rad, without its full turns: in (−π, π].
    WrappedJointPosition(usize),
    /// A joint's rate, m/s or rad/s.
    JointVelocity(usize),
    /// Where a point of a body is along one of the world's axes, m.
    BodyPosition(BodyPoint),
    /// How fast it moves along that axis, m/s.
    BodyVelocity(BodyPoint),
    /// The angle of the body with this index, rad, counting full turns.
    BodyAngle(usize),
    /// Its rate, rad/s.
    BodyAngularVelocity(usize),
    /// 1 if the colliders with these indices touch, 0 if not.
    Contact(usize, usize),
    /// Distance to the first surface of another body or of the world, m.
    Ray(Ray),
    /// A formula over the sensors before this one.
    Formula(Program),
}

/// A point of a body, seen along one of the world's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyPoint {
    /// Which body.
    pub body: usize,
    /// In the body's frame, m.
    pub at: [f64; 2],
    /// 0 for x, 1 for y.
    pub axis: usize,
}

/// A ray that turns with its body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Which body.
    pub body: usize,
    /// Where it starts, in the body's frame, m.
    pub from: [f64; 2],
    /// Unit vector in the body's frame.
    pub direction: [f64; 2],
    /// What is measured if nothing is nearer, m.
    pub length: f64,
}
