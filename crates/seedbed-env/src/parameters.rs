//! Numbers of a task with which its physics is inaccurate, as far as they say so without a trial.

use super::description::{BodyTask, Inertial, Joint, JointKind};
use super::kinematics::Frame;

/// What is inaccurate, where, and what to do.
pub(super) fn warnings(task: &BodyTask) -> Vec<String> {
    let joints = task.joints.iter();
    let mut warnings: Vec<_> = joints
        .clone()
        .filter_map(|joint| mass_ratio(joint, task))
        .collect();
    warnings.extend(joints.clone().filter_map(|joint| swing(joint, task)));
    warnings.extend(joints.filter_map(|joint| spring(joint, task)));
    warnings
}

/// Maximum of angular frequency times substep: implicit integration damps faster oscillations away.
const MAX_PHASE: f64 = 0.5;

/// A hinge about which gravity lets bodies swing faster than substeps can follow.
fn swing(joint: &Joint, task: &BodyTask) -> Option<String> {
    let JointKind::Hinge { .. } = joint.kind else {
        return None;
    };
    let (moving, anchor) = moving_parts(joint, task);
    let arm = distance(moving.com, anchor);
    let gravity = task.gravity[0].hypot(task.gravity[1]);
    let inertia = moving.inertia + moving.mass * arm * arm + joint.passive_forces.armature;
    let frequency = (moving.mass * gravity * arm / inertia).sqrt();
    too_fast(
        &format!("what swings about joint `{}`", joint.name),
        frequency,
        task,
    )
}

/// A spring that is stiffer than substeps can follow, if its damper does not hide it.
fn spring(joint: &Joint, task: &BodyTask) -> Option<String> {
    let passive = joint.passive_forces;
    let (moving, anchor) = moving_parts(joint, task);
    let arm = distance(moving.com, anchor);
    let inertia = passive.armature
        + match joint.kind {
            JointKind::Hinge { .. } => moving.inertia + moving.mass * arm * arm,
            JointKind::Slide { .. } => moving.mass,
            JointKind::Weld => return None,
        };
    let is_overdamped = passive.damping.powi(2) >= 4.0 * passive.stiffness * inertia;
    let frequency = (passive.stiffness / inertia).sqrt();
    let what = format!("the spring of joint `{}`", joint.name);
    too_fast(&what, frequency, task).filter(|_| !is_overdamped)
}

fn too_fast(what: &str, frequency: f64, task: &BodyTask) -> Option<String> {
    let (substep, phase) = (task.substep(), frequency * task.substep());
    (phase > MAX_PHASE).then(|| {
        let period = std::f64::consts::TAU / frequency;
        let times = (phase / MAX_PHASE).ceil();
        format!(
            "{what} has a period of {period:.2e} s, too fast for substeps of {substep:.2e} s, which damp it away: \
             expected {times} times as many `solver.iterations`, or a shorter `control_step`"
        )
    })
}

/// Mass properties in the world of all bodies that a joint moves, at the reference poses, and the
/// position of the joint.
fn moving_parts(joint: &Joint, task: &BodyTask) -> (Inertial, [f64; 2]) {
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

fn distance(one: [f64; 2], other: [f64; 2]) -> f64 {
    (other[0] - one[0]).hypot(other[1] - one[1])
}

fn mass_ratio(_joint: &Joint, _task: &BodyTask) -> Option<String> {
    None
}
