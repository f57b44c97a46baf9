//! What an action pushes, as arrows for pictures. Motion may not enter: nothing here is computed for a step.

use super::description::{Description, Drive, Joint, JointKind, Servo, Target};
use super::{Force, ForceSource, Pose};

/// A force on a body in the body's own frame: where it acts, m, and how much, N.
type Push = (usize, [f64; 2], [f64; 2]);

/// Adds the forces of the latest action: those of actuators, and those fields that depend on it. What acts at one point is one
/// arrow.   `poses: [bodies]`; `control` finds the value of an actuator, then of a field; `joint` a joint's position and rate
pub(super) fn add_actions(
    description: &Description,
    poses: &[Pose],
    control: impl Fn(usize) -> f32,
    joint: impl Fn(usize) -> (f32, f32),
    forces: &mut Vec<Force>,
) {
    let actuators = description
        .actuators
        .iter()
        .map(|actuator| Some((actuator.drive, actuator.gear)));
    let first_action = description.columns().first_action();
    let actions = first_action..first_action + description.actuators.len();
    let fields = description
        .fields
        .iter()
        .map(|field| field.force.reads(&actions).then_some((field.drive, 1.0)));
    let before = forces.len();
    for (index, drive) in actuators.chain(fields).enumerate() {
        let Some((drive, gear)) = drive else { continue };
        if let Some((body, at, force)) = push(
            description,
            poses,
            drive,
            gear * f64::from(control(index)),
            &joint,
        ) {
            let (at, newtons) = (poses[body].point(at), poses[body].vector(force));
            add_at(
                Force {
                    source: ForceSource::Action,
                    at,
                    newtons,
                },
                before,
                forces,
            );
        }
    }
    let acts = |force: &Force| force.newtons != [0.0; 2];
    let pushed: Vec<Force> = forces.drain(before..).filter(acts).collect();
    forces.extend(pushed);
}

fn add_at(force: Force, before: usize, forces: &mut Vec<Force>) {
    match forces[before..]
        .iter_mut()
        .find(|other| other.at == force.at)
    {
        Some(other) => (0..2).for_each(|axis| other.newtons[axis] += force.newtons[axis]),
        None => forces.push(force),
    }
}

fn push(
    description: &Description,
    poses: &[Pose],
    drive: Drive,
    value: f64,
    joint: impl Fn(usize) -> (f32, f32),
) -> Option<Push> {
    match drive {
        Drive::Nothing => None,
        Drive::JointForce(index) => along(description, &description.joints[index], value),
        Drive::Servo(servo) => along(
            description,
            &description.joints[servo.joint],
            of_servo(&servo, value, joint(servo.joint)),
        ),
        Drive::BodyForce {
            body,
            at,
            direction,
            local,
        } => {
            let force = direction.map(|along| along * value);
            let force = if local {
                force
            } else {
                turned(force, -f64::from(poses[body].angle))
            };
            Some((
                body,
                at.unwrap_or(description.bodies[body].inertial.com),
                force,
            ))
        }
    }
}

/// kp (target − q) + kv (rate − q̇), within its limit.
fn of_servo(servo: &Servo, told: f64, (position, rate): (f32, f32)) -> f64 {
    let (position, rate) = (f64::from(position), f64::from(rate));
    let force = match servo.target {
        Target::Position => servo.kp * (told - position) - servo.kv * rate,
        Target::Velocity => servo.kv * (told - rate),
    };
    servo
        .force_limit
        .map_or(force, |limit| force.clamp(-limit, limit))
}

/// A force (N) or torque (N m) along a joint's coordinate. With r from the hinge to the centre of mass, the torque τ is that of the
/// force τ (−r_y, r_x) / |r|² there.
fn along(description: &Description, joint: &Joint, value: f64) -> Option<Push> {
    match joint.kind {
        JointKind::Weld => None,
        JointKind::Slide { axis } => {
            Some((joint.child, joint.anchor, axis.map(|along| along * value)))
        }
        JointKind::Hinge { sense } => {
            let com = description.bodies[joint.child].inertial.com;
            let arm = [com[0] - joint.anchor[0], com[1] - joint.anchor[1]];
            let square = arm[0] * arm[0] + arm[1] * arm[1];
            let per_length = sense * value / square;
            (square > 1e-12).then_some((
                joint.child,
                com,
                [-arm[1] * per_length, arm[0] * per_length],
            ))
        }
    }
}

fn turned([x, y]: [f64; 2], angle: f64) -> [f64; 2] {
    let (sin, cos) = angle.sin_cos();
    [cos * x - sin * y, sin * x + cos * y]
}

impl Pose {
    /// A point of the body's frame in the world.
    fn point(&self, local: [f64; 2]) -> [f32; 2] {
        let [x, y] = self.vector(local);
        [self.x + x, self.y + y]
    }

    /// A vector of the body's frame in the world.
    fn vector(&self, local: [f64; 2]) -> [f32; 2] {
        turned(local, f64::from(self.angle)).map(|along| along as f32)
    }
}
