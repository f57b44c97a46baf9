//! Ropes: maximum distances between points of bodies.
//!
//! Rapier's own rope joint does not work between links of multibodies: its solver ignores coupled axes
//! there. Here a rope is a joint with a limit along one axis, which is turned to the direction of the
//! rope whenever contacts are searched for.

use rapier2d::prelude::{
    GenericJoint, GenericJointBuilder, ImpulseJointHandle, ImpulseJointSet, JointAxesMask,
    JointAxis, Pose, RigidBodyBuilder, RigidBodyHandle, RigidBodySet, Rotation, Vector,
};

use super::super::vector;
use crate::description::{self, BodyTask};

/// A rope, whose joint has this handle.
pub(super) struct Rope {
    handle: ImpulseJointHandle,
    ends: [RopeEnd; 2],
}

/// A body, and a point relative to its center of mass.
#[derive(Clone, Copy)]
struct RopeEnd {
    body: RigidBodyHandle,
    at: Vector,
}

impl Rope {
    /// Inserts the ropes of a task.
    pub(super) fn insert_all(
        task: &BodyTask,
        handles: &[RigidBodyHandle],
        bodies: &mut RigidBodySet,
        joints: &mut ImpulseJointSet,
    ) -> Vec<Self> {
        let mut insert = |rope: &description::Rope| {
            let ends = rope
                .ends
                .map(|end| RopeEnd::new(end, task, handles, bodies));
            let joint = limited_joint(rope.length as f32, ends);
            let handle = joints.insert(ends[0].body, ends[1].body, joint, false);
            Self { handle, ends }
        };
        task.ropes.iter().map(&mut insert).collect()
    }

    /// Turns the axis of the rope's limit to where its other end is.
    pub(super) fn turn(&self, bodies: &RigidBodySet, joints: &mut ImpulseJointSet) {
        let [start, end] = self.ends.map(|end| *bodies[end.body].position() * end.at);
        let along = end - start;
        let length = along.length();
        let Some(joint) = joints.get_mut(self.handle, false) else {
            return;
        };
        // Without a length there is no direction, and nothing to limit.
        if length > f32::EPSILON {
            let in_world = Rotation::from_cos_sin_unchecked(along.x / length, along.y / length);
            let rotation = bodies[self.ends[0].body].rotation().inverse() * in_world;
            joint.data.local_frame1 = Pose::from_parts(self.ends[0].at, rotation);
        }
    }
}

impl RopeEnd {
    fn new(
        end: description::RopeEnd,
        task: &BodyTask,
        handles: &[RigidBodyHandle],
        bodies: &mut RigidBodySet,
    ) -> Self {
        match end.body {
            Some(body) => Self {
                body: handles[body],
                at: vector(end.at) - vector(task.bodies[body].inertial.com),
            },
            None => Self {
                body: bodies.insert(RigidBodyBuilder::fixed()),
                at: vector(end.at),
            },
        }
    }
}

fn limited_joint(length: f32, ends: [RopeEnd; 2]) -> GenericJoint {
    let mut joint = GenericJointBuilder::new(JointAxesMask::empty())
        .local_anchor1(ends[0].at)
        .local_anchor2(ends[1].at)
        .build();
    joint.set_limits(JointAxis::LinX, [-length, length]);
    joint
}
