//! Joints: how a body is held, pushed, and where it is along its joint's coordinate. One variant a way of holding.

use std::f32::consts::TAU;

use rapier2d::prelude::{
    GenericJointBuilder, JointAxesMask, PhysicsWorld, Pose, RigidBody, RigidBodyHandle, RigidBodySet, Rotation, Vector,
};

use super::vector;
use crate::env::kinematics::{Link, Motion};

/// How Rapier holds a joint's child.
pub(super) struct Hold {
    parent: Option<usize>,
    child: usize,
    anchor_in_parent: Vector,
    anchor_in_child: Vector,
    /// The child's rotation in its parent's frame at coordinate 0.
    reference: Rotation,
    kind: Kind,
}

enum Kind {
    /// A slide along one of the world's axes is no joint at all: the body cannot move otherwise. Exact, and cheaper than a joint.
    Rail { axis: Vector, origin: f32 },
    /// A prismatic joint along a unit vector in the parent's frame.
    Slide { axis: Vector },
    /// A revolute joint, counter-clockwise (+1) or clockwise (−1).
    Hinge { sense: f32 },
}

impl Hold {
    pub(super) fn new(link: &Link) -> Self {
        let reference = Rotation::new(link.angle as f32);
        let (anchor_in_parent, anchor_in_child) = (vector(link.anchor_in_parent), vector(link.anchor_in_child));
        let kind = match link.motion {
            Motion::Hinge(sense) => Kind::Hinge { sense: sense as f32 },
            Motion::Slide(axis) if link.parent.is_none() && axis.contains(&0.0) => {
                let axis = vector(axis);
                Kind::Rail { axis, origin: axis.dot(anchor_in_parent - reference * anchor_in_child) }
            }
            Motion::Slide(axis) => Kind::Slide { axis: vector(axis) },
        };
        Self { parent: link.parent, child: link.child, anchor_in_parent, anchor_in_child, reference, kind }
    }

    /// The bodies that a force along the joint pushes.
    pub(super) fn bodies(&self) -> impl Iterator<Item = usize> {
        self.parent.into_iter().chain([self.child])
    }

    /// Whether Rapier holds the child by a joint.
    pub(super) fn is_joint(&self) -> bool {
        !matches!(self.kind, Kind::Rail { .. })
    }

    /// Whether that joint is a slide.
    pub(super) fn is_sliding_joint(&self) -> bool {
        matches!(self.kind, Kind::Slide { .. })
    }

    /// Whether `body` may move in x and in y, if a rail holds it.
    pub(super) fn rail_of(&self, body: usize) -> Option<[bool; 2]> {
        match self.kind {
            Kind::Rail { axis, .. } if self.child == body => Some([axis.x != 0.0, axis.y != 0.0]),
            _ => None,
        }
    }

    /// Inserts the joint for the copy whose bodies are `handles`; `anchor` is a body of the world.
    pub(super) fn insert(&self, world: &mut PhysicsWorld, anchor: RigidBodyHandle, handles: &[RigidBodyHandle]) {
        let (locked, turned) = match self.kind {
            Kind::Rail { .. } => return,
            Kind::Slide { axis } => (JointAxesMask::LOCKED_PRISMATIC_AXES, Rotation::from_cos_sin_unchecked(axis.x, axis.y)),
            Kind::Hinge { .. } => (JointAxesMask::LOCKED_REVOLUTE_AXES, Rotation::IDENTITY),
        };
        let joint = GenericJointBuilder::new(locked)
            .local_frame1(Pose::from_parts(self.anchor_in_parent, turned))
            .local_frame2(Pose::from_parts(self.anchor_in_child, self.reference.inverse() * turned));
        let parent = self.parent.map_or(anchor, |body| handles[body]);
        world.impulse_joints.insert(parent, handles[self.child], joint.build(), false);
    }

    /// Adds a force (N) or torque (N m) along the joint's coordinate, and its reaction on the parent.
    pub(super) fn push(&self, force: f32, handles: &[RigidBodyHandle], bodies: &mut RigidBodySet) {
        let parent = self.parent.map(|body| handles[body]);
        let child = handles[self.child];
        match self.kind {
            Kind::Rail { axis, .. } => bodies[child].add_force(axis * force, false),
            Kind::Slide { axis } => {
                let axis = find(bodies, parent).map_or(axis, |parent| *parent.rotation() * axis);
                let point = *bodies[child].position() * self.anchor_in_child;
                bodies[child].add_force_at_point(axis * force, point, false);
                if let Some(parent) = parent {
                    bodies[parent].add_force_at_point(axis * -force, point, false);
                }
            }
            Kind::Hinge { sense } => {
                bodies[child].add_torque(sense * force, false);
                if let Some(parent) = parent {
                    bodies[parent].add_torque(-sense * force, false);
                }
            }
        }
    }

    /// The joint's position and velocity. Of all angles that differ by full turns, the one nearest to `before`.
    pub(super) fn read(&self, before: f32, handles: &[RigidBodyHandle], bodies: &RigidBodySet) -> (f32, f32) {
        let parent = find(bodies, self.parent.map(|body| handles[body]));
        let child = &bodies[handles[self.child]];
        match self.kind {
            Kind::Rail { axis, origin } => (axis.dot(child.translation()) - origin, axis.dot(child.linvel())),
            Kind::Slide { axis } => self.read_slide(axis, parent, child),
            Kind::Hinge { sense } => {
                let base = parent.map_or(self.reference, |parent| *parent.rotation() * self.reference);
                let turned = base.inverse() * *child.rotation();
                let angle = sense * libm::atan2f(turned.im, turned.re);
                let spin = child.angvel() - parent.map_or(0.0, RigidBody::angvel);
                (angle + TAU * ((before - angle) / TAU).round(), sense * spin)
            }
        }
    }

    /// In the parent's frame the child's anchor moves along the axis only.
    fn read_slide(&self, axis: Vector, parent: Option<&RigidBody>, child: &RigidBody) -> (f32, f32) {
        let anchor = *child.position() * self.anchor_in_child;
        let velocity = child.velocity_at_point(anchor);
        match parent {
            None => (axis.dot(anchor - self.anchor_in_parent), axis.dot(velocity)),
            Some(parent) => {
                let axis = *parent.rotation() * axis;
                let origin = *parent.position() * self.anchor_in_parent;
                (axis.dot(anchor - origin), axis.dot(velocity - parent.velocity_at_point(anchor)))
            }
        }
    }
}

/// The handle's body, or none for the world.
fn find(bodies: &RigidBodySet, handle: Option<RigidBodyHandle>) -> Option<&RigidBody> {
    handle.and_then(|handle| bodies.get(handle))
}
