//! Joints of tasks without contacts: how Rapier represents them, how forces push along them, and
//! how their coordinates are read.

use std::f32::consts::{PI, TAU};

use rapier2d::prelude::{
    GenericJointBuilder, JointAxesMask, JointAxis, PhysicsWorld, Pose, RigidBody, RigidBodyHandle,
    RigidBodySet, Rotation, Vector,
};

use super::vector;
use crate::kinematics::{Link, Motion, single_angle};

/// The axis of a Rapier joint that is the coordinate of a slide.
pub(super) const SLIDE_AXIS: JointAxis = JointAxis::LinX;

/// The axis of a Rapier joint that is the coordinate of a hinge.
pub(super) const HINGE_AXIS: JointAxis = JointAxis::AngX;

/// A joint of a task as Rapier represents it.
pub(super) struct RapierJoint {
    parent: Option<usize>,
    child: usize,
    anchor_in_parent: Vector,
    anchor_in_child: Vector,
    /// The child's rotation in its parent's frame at coordinate 0.
    reference: Rotation,
    representation: Representation,
}

enum Representation {
    /// A slide of the world along x or y: no joint, but a body whose other motions are disabled.
    /// This is exact, and cheaper than a joint.
    Rail {
        axis: Vector,
        origin: f32,
        /// Coordinates of the inelastic walls.
        walls: Option<[f32; 2]>,
    },
    /// A prismatic joint along a unit vector in the parent's frame.
    Slide { axis: Vector },
    /// A revolute joint, counter-clockwise (+1) or clockwise (−1).
    Hinge { sign: f32 },
    /// A weld to the world: no joint, but a body whose motions are disabled.
    Fixed,
    /// A weld to another body.
    Weld,
}

impl RapierJoint {
    /// `walls`: the range of a joint whose child is no joint's parent. On a rail it needs no
    /// constraint: the body is stopped directly.
    pub(super) fn new(link: &Link, walls: Option<[f64; 2]>) -> Self {
        let reference = Rotation::new(single_angle(link.angle));
        let (anchor_in_parent, anchor_in_child) =
            (vector(link.anchor_in_parent), vector(link.anchor_in_child));
        let representation = match link.motion {
            Motion::Hinge(sign) => Representation::Hinge { sign: sign as f32 },
            Motion::Slide(axis) if link.parent.is_none() && axis.contains(&0.0) => {
                let axis = vector(axis);
                let origin = axis.dot(anchor_in_parent - reference * anchor_in_child);
                Representation::Rail {
                    axis,
                    origin,
                    walls: walls.map(|range| range.map(|end| end as f32)),
                }
            }
            Motion::Slide(axis) => Representation::Slide { axis: vector(axis) },
            Motion::Weld if link.parent.is_none() => Representation::Fixed,
            Motion::Weld => Representation::Weld,
        };
        Self {
            parent: link.parent,
            child: link.child,
            anchor_in_parent,
            anchor_in_child,
            reference,
            representation,
        }
    }

    /// The bodies on which a force along the joint acts: its child, and its parent unless that is the
    /// world.
    pub(super) fn bodies(&self) -> impl Iterator<Item = usize> {
        self.parent.into_iter().chain([self.child])
    }

    /// Whether Rapier represents it as a joint.
    pub(super) fn is_constraint(&self) -> bool {
        !matches!(
            self.representation,
            Representation::Rail { .. } | Representation::Fixed
        )
    }

    /// Whether it is a hinge.
    pub(super) fn is_hinge(&self) -> bool {
        matches!(self.representation, Representation::Hinge { .. })
    }

    /// Whether the effect of [`push`](Self::push) depends on where the bodies are.
    pub(super) fn push_depends_on_poses(&self) -> bool {
        matches!(self.representation, Representation::Slide { .. })
    }

    /// Whether the child is stopped directly, without a constraint, at the ends of its range.
    pub(super) fn has_walls(&self) -> bool {
        self.walls().is_some()
    }

    /// The coordinates of the inelastic walls at which the child is stopped directly.
    pub(super) fn walls(&self) -> Option<[f32; 2]> {
        match self.representation {
            Representation::Rail { walls, .. } => walls,
            _ => None,
        }
    }

    /// Parent and child; the parent is `anchor` if it is the world.
    pub(super) fn ends(
        &self,
        anchor: RigidBodyHandle,
        handles: &[RigidBodyHandle],
    ) -> (RigidBodyHandle, RigidBodyHandle) {
        (
            self.parent.map_or(anchor, |body| handles[body]),
            handles[self.child],
        )
    }

    /// The axis of Rapier's joints that is the coordinate.
    pub(super) fn axis(&self) -> JointAxis {
        if self.is_hinge() {
            HINGE_AXIS
        } else {
            SLIDE_AXIS
        }
    }

    /// +1 if the coordinate grows as that of Rapier's joints, else −1.
    pub(super) fn sign(&self) -> f32 {
        if let Representation::Hinge { sign } = self.representation {
            sign
        } else {
            1.0
        }
    }

    /// The target of a motor, without the full turns of a hinge, which Rapier does not remove.
    pub(super) fn target_angle(&self, target: f32) -> f32 {
        if self.is_hinge() && target.abs() > PI {
            target - TAU * (target / TAU).round()
        } else {
            target
        }
    }

    /// The joint's frames in its parent and in its child: the same frame at coordinate 0, with the
    /// x-axis along a slide.
    pub(super) fn frames(&self) -> [Pose; 2] {
        let axis_rotation = match self.representation {
            Representation::Rail { axis, .. } | Representation::Slide { axis } => {
                Rotation::from_cos_sin_unchecked(axis.x, axis.y)
            }
            Representation::Hinge { .. } | Representation::Fixed | Representation::Weld => {
                Rotation::IDENTITY
            }
        };
        let in_child = Pose::from_parts(
            self.anchor_in_child,
            self.reference.inverse() * axis_rotation,
        );
        [
            Pose::from_parts(self.anchor_in_parent, axis_rotation),
            in_child,
        ]
    }

    /// Whether `body` may move in x and whether in y, if it is on a rail.
    pub(super) fn rail_of(&self, body: usize) -> Option<[bool; 2]> {
        match self.representation {
            Representation::Rail { axis, .. } if self.child == body => {
                Some([axis.x != 0.0, axis.y != 0.0])
            }
            Representation::Fixed if self.child == body => Some([false; 2]),
            _ => None,
        }
    }

    /// Inserts the joint for the copy whose bodies are `handles`; `anchor` is a body of the world.
    pub(super) fn insert(
        &self,
        world: &mut PhysicsWorld,
        anchor: RigidBodyHandle,
        handles: &[RigidBodyHandle],
    ) {
        let locked = match self.representation {
            Representation::Rail { .. } | Representation::Fixed => return,
            Representation::Slide { .. } => JointAxesMask::LOCKED_PRISMATIC_AXES,
            Representation::Hinge { .. } => JointAxesMask::LOCKED_REVOLUTE_AXES,
            Representation::Weld => JointAxesMask::LOCKED_FIXED_AXES,
        };
        let ([frame1, frame2], (parent, child)) = (self.frames(), self.ends(anchor, handles));
        let joint = GenericJointBuilder::new(locked)
            .local_frame1(frame1)
            .local_frame2(frame2);
        world
            .impulse_joints
            .insert(parent, child, joint.build(), false);
    }

    /// Sets a child that has left its range back to the end of it, at rest along the axis: an inelastic
    /// wall.
    pub(super) fn stop_at_walls(&self, handles: &[RigidBodyHandle], bodies: &mut RigidBodySet) {
        let Representation::Rail {
            axis,
            origin,
            walls: Some([low, high]),
        } = self.representation
        else {
            return;
        };
        let child = &mut bodies[handles[self.child]];
        let position = axis.dot(child.translation()) - origin;
        if position < low || position > high {
            let end = position.clamp(low, high);
            child.set_translation(
                child.translation() + axis * (origin + end - axis.dot(child.translation())),
                false,
            );
            let velocity = child.linvel();
            child.set_linvel(velocity - axis * axis.dot(velocity), false);
        }
    }

    /// Adds a force (N) or torque (N m) along the joint's coordinate, and its reaction on the
    /// parent.
    pub(super) fn push(&self, force: f32, handles: &[RigidBodyHandle], bodies: &mut RigidBodySet) {
        let parent = self.parent.map(|body| handles[body]);
        let child = handles[self.child];
        match self.representation {
            Representation::Rail { axis, .. } => bodies[child].add_force(axis * force, false),
            Representation::Slide { axis } => {
                let axis =
                    find_body(bodies, parent).map_or(axis, |parent| *parent.rotation() * axis);
                let point = *bodies[child].position() * self.anchor_in_child;
                bodies[child].add_force_at_point(axis * force, point, false);
                if let Some(parent) = parent {
                    bodies[parent].add_force_at_point(axis * -force, point, false);
                }
            }
            Representation::Hinge { sign } => {
                bodies[child].add_torque(sign * force, false);
                if let Some(parent) = parent {
                    bodies[parent].add_torque(-sign * force, false);
                }
            }
            Representation::Fixed | Representation::Weld => {}
        }
    }

    /// The joint's position and velocity. An angle counts the full turns that bring it nearest to
    /// `before`, the position one step earlier.
    pub(super) fn read(
        &self,
        before: f32,
        handles: &[RigidBodyHandle],
        bodies: &RigidBodySet,
    ) -> (f32, f32) {
        let parent = find_body(bodies, self.parent.map(|body| handles[body]));
        let child = &bodies[handles[self.child]];
        match self.representation {
            Representation::Fixed | Representation::Weld => (0.0, 0.0),
            Representation::Rail { axis, origin, .. } => (
                axis.dot(child.translation()) - origin,
                axis.dot(child.linvel()),
            ),
            Representation::Slide { axis } => self.read_slide(axis, parent, child),
            Representation::Hinge { sign } => {
                let base =
                    parent.map_or(self.reference, |parent| *parent.rotation() * self.reference);
                let turned = base.inverse() * *child.rotation();
                let angle = sign * libm::atan2f(turned.im, turned.re);
                let spin = child.angvel() - parent.map_or(0.0, RigidBody::angvel);
                (angle + TAU * ((before - angle) / TAU).round(), sign * spin)
            }
        }
    }

    /// Position and velocity of a slide: in the parent's frame, the child's anchor moves only along
    /// the axis.
    fn read_slide(
        &self,
        axis: Vector,
        parent: Option<&RigidBody>,
        child: &RigidBody,
    ) -> (f32, f32) {
        let anchor = *child.position() * self.anchor_in_child;
        let velocity = child.velocity_at_point(anchor);
        match parent {
            None => (axis.dot(anchor - self.anchor_in_parent), axis.dot(velocity)),
            Some(parent) => {
                let axis = *parent.rotation() * axis;
                let origin = *parent.position() * self.anchor_in_parent;
                (
                    axis.dot(anchor - origin),
                    axis.dot(velocity - parent.velocity_at_point(anchor)),
                )
            }
        }
    }
}

/// The body with this handle; `None` is the world.
fn find_body(bodies: &RigidBodySet, handle: Option<RigidBodyHandle>) -> Option<&RigidBody> {
    handle.and_then(|handle| bodies.get(handle))
}
