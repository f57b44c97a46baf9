//! What the components of an action drive.

use crate::Choice;

/// What one component of an action drives.
#[derive(Clone, Debug, PartialEq)]
pub struct Actuator {
    /// Name, unique among actions, observations and sensors.
    pub name: String,
    /// What the actuator acts on.
    pub drive: Drive,
    /// Force or torque per unit of control.
    pub gear: f64,
    /// Values that the control may take.
    pub choice: Choice,
    /// Minimum and maximum of the control.
    pub range: [f32; 2],
}

/// What an actuator or a formula force acts on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drive {
    /// A force (N) or torque (N m) along the coordinate of the joint with this index.
    JointForce(usize),
    /// Nothing by itself: formulas of forces read the control.
    Nothing,
    /// A force (N) on a body.
    BodyForce {
        /// Index of the body.
        body: usize,
        /// Point of application in the body's frame, m; `None` is the center of mass.
        at: Option<[f64; 2]>,
        /// Unit vector along which a positive force pushes.
        direction: [f64; 2],
        /// Whether the direction turns with the body.
        is_local: bool,
    },
    /// A torque (N m, counter-clockwise) on the body with this index.
    BodyTorque {
        /// Index of the body.
        body: usize,
    },
    /// A motor that drives a joint's coordinate or velocity to gear × control.
    Servo(Servo),
}

/// A motor with the force kp (target − q) + kv (target velocity − q̇), computed again in each
/// substep. One that drives to a speed reaches it within a substep if its force allows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Servo {
    /// Index of the joint.
    pub joint: usize,
    /// The quantity whose target is gear × control.
    pub target: ServoTarget,
    /// Position gain, N/m or N m/rad; 0 for a velocity servo.
    pub kp: f64,
    /// Velocity gain, N s/m or N m s/rad.
    pub kv: f64,
    /// Maximum force, N or N m.
    pub force_limit: Option<f64>,
}

/// The quantity whose target a servo's control sets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ServoTarget {
    /// The coordinate, m or rad. The target velocity is 0.
    Position,
    /// The velocity, m/s or rad/s.
    Velocity,
    /// The sign of the control gives the direction of motion, its size the share of the maximum
    /// force.
    Speed {
        /// Speed that the motor drives to, m/s or rad/s.
        speed: f64,
        /// Maximum force at a control of 1, N or N m.
        max_force: f64,
    },
}
