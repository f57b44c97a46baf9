//! Joints of tasks with contacts, as links of Rapier's multibodies; and free bodies.

use std::f64::consts::TAU;

use rapier2d::prelude::{
    IntegrationParameters, MultibodyJoint, MultibodyJointHandle, MultibodyJointSet, RigidBody,
    RigidBodyHandle, RigidBodySet, Vector,
};

use super::super::constraint::set_motor_target;
use super::super::joint::HINGE_AXIS;
use super::super::vector;
use super::joint_group::{JointGroup, RapierCoordinate};
use crate::description::{BodyTask, Joint, PassiveForces, ServoTarget, Softness};
use crate::kinematics::{Frame, Motion};

/// A joint of the task: a coordinate of a multibody joint.
pub(super) struct Link {
    handle: MultibodyJointHandle,
    parent: Option<RigidBodyHandle>,
    child: RigidBodyHandle,
    /// Position of the joint relative to the child's center of mass.
    anchor_in_child: Vector,
    /// Unit vector in the parent's frame of a slide, or the sign of a hinge.
    motion: Motion,
    /// The coordinate of Rapier's joint; a weld has none.
    coordinate: Option<RapierCoordinate>,
    ends: Ends,
}

/// The ends of a joint's range, as far as Rapier's velocity of a joint beyond one is not that at which it moves.
#[derive(Clone, Copy)]
enum Ends {
    /// There are none, or the velocity is Rapier's.
    None,
    Hard([f32; 2]),
    Soft([f32; 2], SoftEnd),
}

impl Ends {
    fn new(joint: &Joint, task: &BodyTask) -> Self {
        let range = joint.range.map(|range| range.map(|end| end as f32));
        match (range, joint.range_softness) {
            (Some(range), None) => Self::Hard(range),
            // Copies that turn too fast for a shared world are computed in single steps, which start with Rapier's velocity.
            (Some(range), Some(softness)) if task.needs_own_worlds() => {
                Self::Soft(range, SoftEnd::new(softness, task))
            }
            _ => Self::None,
        }
    }
}

/// How a soft end moves a joint that is beyond it. In each substep, Rapier moves the joint with a correction
/// that it then takes out of the velocity again, so that its velocity is not that at which the joint moves.
#[derive(Clone, Copy)]
struct SoftEnd {
    /// Speed of the correction per depth, 1/s.
    rate: f32,
    /// Share of an inward velocity that the end leaves: c / (1 + c), see
    /// [`range_spring`](super::joint_group).
    share: f32,
}

impl SoftEnd {
    fn new(softness: Softness, task: &BodyTask) -> Self {
        let frequency = TAU * softness.natural_frequency;
        let rate = frequency / (2.0 * softness.damping_ratio);
        let compliance = rate / (task.substep() * frequency * frequency);
        Self {
            rate: rate as f32,
            share: (compliance / (1.0 + compliance)) as f32,
        }
    }

    /// Rapier's velocity of a joint that moves outward at `velocity` at this depth, if nothing else corrects it.
    fn rapier_velocity(self, velocity: f32, depth: f32) -> f32 {
        let outward = velocity + self.rate * depth;
        if outward >= 0.0 {
            outward
        } else {
            velocity.max(outward / self.share)
        }
    }
}

/// Position and velocity of a joint as Rapier has them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LinkState {
    position: f32,
    velocity: f32,
}

/// A free body.
pub(super) struct Root {
    pub(super) body: usize,
    /// Center of mass in the body's frame, m.
    com: Vector,
    /// Whether the body is the parent of a joint, and thus the root of a multibody.
    pub(super) is_linked: bool,
}

/// Position and velocity of a frame's origin, and angle and angular velocity of the frame.
pub(super) struct FrameState {
    pub(super) position: Vector,
    pub(super) velocity: Vector,
    /// Angle without full turns.
    pub(super) angle: f32,
    pub(super) spin: f32,
    /// The angle as the coordinate of a multibody, which counts full turns.
    pub(super) coordinate: Option<f32>,
}

impl Link {
    /// The joint `group.joints[place]`, which is part of the joint of Rapier with this handle.
    pub(super) fn new(
        place: usize,
        group: &JointGroup<'_>,
        handle: MultibodyJointHandle,
        task: &BodyTask,
        handles: &[RigidBodyHandle],
    ) -> Self {
        let joint = &task.joints[group.joints[place]];
        let com = task.bodies[joint.child].inertial.com;
        Self {
            handle,
            parent: joint.parent.map(|parent| handles[parent]),
            child: handles[joint.child],
            anchor_in_child: vector(group.anchor().anchor_in_child) - vector(com),
            motion: group.links[place].motion,
            coordinate: group.coordinates()[place],
            ends: Ends::new(joint, task),
        }
    }

    /// Sets spring, damping, armature and friction of the joint.
    pub(super) fn set_passive_forces(
        &self,
        passive: &PassiveForces,
        joints: &mut MultibodyJointSet,
    ) {
        let Some(RapierCoordinate { axis, sign, dof }) = self.coordinate else {
            return;
        };
        let Some((multibody, id)) = joints.get_mut(self.handle) else {
            return;
        };
        let Some(link) = multibody.link_mut(id) else {
            return;
        };
        link.joint.set_spring(
            axis as usize,
            passive.stiffness as f32,
            sign * passive.springref as f32,
        );
        let dof = link.assembly_id() + dof;
        multibody.damping_mut()[dof] = passive.damping as f32;
        multibody.armature_mut()[dof] = passive.armature as f32;
        multibody.frictions_mut()[dof] = passive.frictionloss as f32;
    }

    /// Sets the target of the joint's servo.
    pub(super) fn set_target(
        &self,
        target: ServoTarget,
        value: f32,
        joints: &mut MultibodyJointSet,
    ) {
        let Some(RapierCoordinate { axis, sign, .. }) = self.coordinate else {
            return;
        };
        let link = joints
            .get_mut(self.handle)
            .and_then(|(multibody, id)| multibody.link_mut(id));
        let Some(motor) = link.map(|link| &mut link.joint.data.motors[axis as usize]) else {
            return;
        };
        set_motor_target(motor, target, sign, value);
    }

    /// Sets position and velocity of a joint whose position is 0.
    pub(super) fn place(&self, position: f32, velocity: f32, joints: &mut MultibodyJointSet) {
        let Some(RapierCoordinate { sign, dof, .. }) = self.coordinate else {
            return;
        };
        let Some((multibody, id)) = joints.get_mut(self.handle) else {
            return;
        };
        let Some(link) = multibody.link_mut(id) else {
            return;
        };
        let mut displacement = [0.0; 3];
        displacement[dof] = sign * position;
        link.joint.apply_displacement(&displacement);
        let dof = link.assembly_id() + dof;
        let velocity = self.rapier_velocity(position, velocity);
        multibody.generalized_velocity_mut()[dof] = sign * velocity;
    }

    /// Rapier's velocity of a joint that moves at this velocity.
    fn rapier_velocity(&self, position: f32, velocity: f32) -> f32 {
        match self.ends {
            Ends::Soft([_, high], end) if position > high => {
                end.rapier_velocity(velocity, position - high)
            }
            Ends::Soft([low, _], end) if position < low => {
                -end.rapier_velocity(-velocity, low - position)
            }
            _ => velocity,
        }
    }

    /// Whether [`read`](Self::read) needs the state before the latest step of Rapier.
    pub(super) fn has_soft_end(&self) -> bool {
        matches!(self.ends, Ends::Soft(..))
    }

    pub(super) fn state(&self, joints: &MultibodyJointSet) -> LinkState {
        let Some(RapierCoordinate { axis, sign, dof }) = self.coordinate else {
            return LinkState::default();
        };
        let link = joints
            .get(self.handle)
            .and_then(|(multibody, id)| Some((multibody, multibody.link(id)?)));
        let Some((multibody, link)) = link else {
            return LinkState::default();
        };
        LinkState {
            position: sign * link.joint().coords()[axis as usize],
            velocity: sign * multibody.generalized_velocity()[link.assembly_id() + dof],
        }
    }

    /// Position and velocity of the joint's coordinate. `before`: the state before the latest step of Rapier.
    ///
    /// A joint does not move out of a range with hard ends: Rapier stops it one substep after it has passed an end,
    /// and at once lets go of one that is back there, so that a joint that is pressed on an end passes it in
    /// every other substep.
    pub(super) fn read(
        &self,
        before: LinkState,
        parameters: &IntegrationParameters,
        joints: &MultibodyJointSet,
    ) -> (f32, f32) {
        let now = self.state(joints);
        let velocity = match self.ends {
            Ends::Hard([low, _]) if now.position < low => now.velocity.max(0.0),
            Ends::Hard([_, high]) if now.position > high => now.velocity.min(0.0),
            Ends::Soft([low, high], _) if now.position < low || now.position > high => {
                velocity_of_motion(before, now, parameters)
            }
            _ => now.velocity,
        };
        (now.position, velocity)
    }

    /// Adds a force (N) or torque (N m) along the coordinate, and its reaction on the parent.
    pub(super) fn push(&self, force: f32, bodies: &mut RigidBodySet) {
        match self.motion {
            Motion::Weld => {}
            Motion::Hinge(sign) => {
                let torque = sign as f32 * force;
                bodies[self.child].add_torque(torque, false);
                if let Some(parent) = self.parent {
                    bodies[parent].add_torque(-torque, false);
                }
            }
            Motion::Slide(axis) => {
                let axis = self.parent.map_or(vector(axis), |parent| {
                    *bodies[parent].rotation() * vector(axis)
                });
                let point = *bodies[self.child].position() * self.anchor_in_child;
                bodies[self.child].add_force_at_point(axis * force, point, false);
                if let Some(parent) = self.parent {
                    bodies[parent].add_force_at_point(axis * -force, point, false);
                }
            }
        }
    }
}

/// The velocity at which a joint moves in the last substep of a step of Rapier. What corrections have added to the
/// mean over all substeps, between whose velocities Rapier's changes evenly, they add to the last as well.
fn velocity_of_motion(
    before: LinkState,
    now: LinkState,
    parameters: &IntegrationParameters,
) -> f32 {
    let substeps = parameters.num_solver_iterations as f32;
    let mean = (now.position - before.position) / parameters.dt;
    mean + (now.velocity - before.velocity) * ((substeps - 1.0) / (2.0 * substeps))
}

impl Root {
    pub(super) fn new(body: usize, com: [f64; 2], is_linked: bool) -> Self {
        Self {
            body,
            com: vector(com),
            is_linked,
        }
    }

    /// Sets the position and velocity of the root of a multibody to those of its frame.
    pub(super) fn place(
        frame: &Frame,
        com: [f64; 2],
        handle: RigidBodyHandle,
        joints: &mut MultibodyJointSet,
    ) {
        let Some(multibody) = multibody_of(handle, joints) else {
            return;
        };
        let ([x, y], [right, up]) = (frame.point(com), frame.velocity_at(frame.point(com)));
        let root = multibody.root_mut();
        root.joint = MultibodyJoint::new(root.joint.data, false);
        root.joint
            .apply_displacement(&[x as f32, y as f32, frame.angle as f32]);
        let mut velocity = multibody.generalized_velocity_mut();
        for (dof, value) in [right, up, frame.angular_velocity].into_iter().enumerate() {
            velocity[dof] = value as f32;
        }
    }

    /// The motion of the root's frame. In a multibody, Rapier updates the velocity of a body late:
    /// that of the multibody is read instead.
    pub(super) fn frame_state(
        &self,
        body: &RigidBody,
        handle: RigidBodyHandle,
        joints: &MultibodyJointSet,
    ) -> FrameState {
        let multibody = joints
            .rigid_body_link(handle)
            .and_then(|link| joints.get_multibody(link.multibody));
        let (velocity, spin, coordinate) = match multibody {
            Some(multibody) => {
                let rates = multibody.generalized_velocity();
                let coordinate = multibody.root().joint().coords()[HINGE_AXIS as usize];
                (Vector::new(rates[0], rates[1]), rates[2], Some(coordinate))
            }
            None => (body.linvel(), body.angvel(), None),
        };
        let arm = *body.rotation() * self.com;
        FrameState {
            position: body.translation() - arm,
            velocity: velocity - Vector::new(-arm.y, arm.x) * spin,
            angle: libm::atan2f(body.rotation().im, body.rotation().re),
            spin,
            coordinate,
        }
    }
}

fn multibody_of(
    handle: RigidBodyHandle,
    joints: &mut MultibodyJointSet,
) -> Option<&mut rapier2d::prelude::Multibody> {
    let index = joints.rigid_body_link(handle)?.multibody;
    joints.get_multibody_mut(index)
}
