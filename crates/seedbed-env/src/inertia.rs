//! Mass properties of what the joints of a task move.

use super::description::{BodyTask, Inertial, Joint, JointKind};
use super::kinematics::Frame;

/// Mass (kg) that a slide moves, or moment of inertia (kg m²) about a hinge of what it moves, with the
/// armature.
pub(super) fn moved_inertia(joint: &Joint, task: &BodyTask) -> f64 {
    let (moving, anchor) = moving_parts(joint, task);
    let arm = distance(moving.com, anchor);
    let inertia = match joint.kind {
        JointKind::Hinge { .. } => moving.inertia + moving.mass * arm * arm,
        JointKind::Slide { .. } | JointKind::Weld => moving.mass,
    };
    joint.passive_forces.armature + inertia
}

/// Mass properties in the world of all bodies that a joint moves, at the reference poses, and the
/// position of the joint.
pub(super) fn moving_parts(joint: &Joint, task: &BodyTask) -> (Inertial, [f64; 2]) {
    let mut bodies = vec![joint.child];
    // Parents come before their children.
    for other in &task.joints {
        if other.parent.is_some_and(|parent| bodies.contains(&parent))
            && !bodies.contains(&other.child)
        {
            bodies.push(other.child);
        }
    }
    let frame = |body: usize| Frame::at(task.bodies[body].position, task.bodies[body].angle);
    let parts = bodies.iter().map(|&body| {
        let inertial = task.bodies[body].inertial;
        Inertial {
            com: frame(body).point(inertial.com),
            ..inertial
        }
    });
    let whole = parts.reduce(together).unwrap_or_default();
    (whole, frame(joint.child).point(joint.anchor))
}

/// Two bodies as one: the parallel axis theorem.
fn together(one: Inertial, other: Inertial) -> Inertial {
    let mass = one.mass + other.mass;
    let share = other.mass / mass;
    let com = [0, 1].map(|axis| one.com[axis] + share * (other.com[axis] - one.com[axis]));
    let part = |part: Inertial| part.inertia + part.mass * distance(part.com, com).powi(2);
    Inertial {
        mass,
        com,
        inertia: part(one) + part(other),
    }
}

/// Distance of two points, m.
pub(super) fn distance(one: [f64; 2], other: [f64; 2]) -> f64 {
    (other[0] - one[0]).hypot(other[1] - one[1])
}
