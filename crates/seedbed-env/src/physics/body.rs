//! Single bodies: how far they may turn; and those of tasks without contacts: built, placed and saved.

use rapier2d::prelude::{MassProperties, Pose, RigidBody, RigidBodyBuilder, Rotation, Vector};
use serde::{Deserialize, Serialize};

use super::vector;
use crate::description::{Body, BodyTask, JointKind};
use crate::kinematics::Frame;

/// The angle by which a body may turn in a substep, rad. Rapier's error is the same in every task,
/// and smaller than that of a first-order method with 16 substeps per radian.
pub(super) const MAX_TURN_PER_SUBSTEP: f32 = 1.0 / 16.0;

/// What Rapier keeps of a body without contacts from one step to the next.
#[derive(Serialize, Deserialize)]
pub(super) struct SavedBody {
    translation: [f32; 2],
    rotation: [f32; 2],
    velocity: [f32; 2],
    angular_velocity: f32,
}

/// The armature of a body's joint. It moves with the body, so that it can be added to the body's
/// mass or inertia, but gravity does not act on it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rotor {
    mass: f64,
    inertia: f64,
}

impl Rotor {
    pub(super) fn of_body(task: &BodyTask, body: usize) -> Self {
        let joint = task.joints.iter().find(|joint| joint.child == body);
        match joint.map(|joint| (joint.kind, joint.passive_forces.armature)) {
            Some((JointKind::Slide { .. }, mass)) => Self { mass, inertia: 0.0 },
            Some((JointKind::Hinge { .. }, inertia)) => Self { mass: 0.0, inertia },
            _ => Self::default(),
        }
    }
}

/// A disabled body. On a rail it moves in x or y only. Fast rotation is allowed, because Rapier
/// clamps angular velocities by default.
pub(super) fn rigid_body(body: &Body, rotor: &Rotor, rail: Option<[bool; 2]>) -> RigidBody {
    let inertial = &body.inertial;
    let (mass, inertia) = (inertial.mass + rotor.mass, inertial.inertia + rotor.inertia);
    let properties = MassProperties::new(vector(inertial.com), mass as f32, inertia as f32);
    let builder = RigidBodyBuilder::dynamic()
        .pose(Pose::new(vector(body.position), body.angle as f32))
        .additional_mass_properties(properties)
        .gravity_scale((inertial.mass / mass) as f32)
        .can_sleep(false)
        .allow_fast_rotation(true)
        .enabled(false);
    match rail {
        Some([x, y]) => builder.enabled_translations(x, y).lock_rotations().build(),
        None => builder.build(),
    }
}

/// Sets the position and velocity of a body to those of its frame.
pub(super) fn place(body: &mut RigidBody, frame: &Frame, com: [f64; 2]) {
    let rotation =
        Rotation::from_cos_sin_unchecked(frame.rotation[0] as f32, frame.rotation[1] as f32);
    body.set_position(Pose::from_parts(vector(frame.position), rotation), false);
    set_velocities(
        body,
        vector(frame.velocity_at(frame.point(com))),
        frame.angular_velocity as f32,
    );
}

impl SavedBody {
    pub(super) fn from_body(body: &RigidBody) -> Self {
        Self {
            translation: body.translation().to_array(),
            rotation: [body.rotation().re, body.rotation().im],
            velocity: body.linvel().to_array(),
            angular_velocity: body.angvel(),
        }
    }

    /// Sets the position and velocity of a body to the saved ones.
    pub(super) fn restore_to(&self, body: &mut RigidBody) {
        let rotation = Rotation::from_cos_sin_unchecked(self.rotation[0], self.rotation[1]);
        body.set_position(
            Pose::from_parts(Vector::from_array(self.translation), rotation),
            false,
        );
        set_velocities(
            body,
            Vector::from_array(self.velocity),
            self.angular_velocity,
        );
    }
}

/// Sets the velocities to exactly these bits. Rapier ignores a velocity that equals the current
/// one, and 0 equals −0: another velocity is written first.
fn set_velocities(body: &mut RigidBody, linear: Vector, angular: f32) {
    body.set_linvel(Vector::ONE, false);
    body.set_linvel(linear, false);
    body.set_angvel(1.0, false);
    body.set_angvel(angular, false);
}
