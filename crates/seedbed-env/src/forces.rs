//! The forces of an action, to be drawn as arrows. They are not used to compute motion.

use super::description::{BodyTask, Drive, Joint, JointKind, Servo, ServoTarget};
use super::{Force, ForceSource, Pose};

/// Index of a body, point of application (m) and force (N) in the body's own frame.
type AppliedForce = (usize, [f64; 2], [f64; 2]);

/// Appends the forces of the latest action: those of actuators, and those formula forces that
/// depend on the action. Forces at the same point are added up.
///
/// `poses`: `[bodies]`; `control`: the value of an actuator, then of a formula force, by index;
/// `joint`: position and velocity of a joint, by index.
pub(super) fn add_actions(
    task: &BodyTask,
    poses: &[Pose],
    control: impl Fn(usize) -> f32,
    joint: impl Fn(usize) -> (f32, f32),
    forces: &mut Vec<Force>,
) {
    let actuators = task
        .actuators
        .iter()
        .map(|actuator| Some((actuator.drive, actuator.gear)));
    let first_action = task.column_layout().first_action();
    let actions = first_action..first_action + task.actuators.len();
    let formula_forces = task
        .formula_forces
        .iter()
        .map(|force| force.force.reads(&actions).then_some((force.drive, 1.0)));
    let before = forces.len();
    for (index, drive) in actuators.chain(formula_forces).enumerate() {
        let Some((drive, gear)) = drive else { continue };
        if let Some((body, at, force)) =
            push(task, poses, drive, gear * f64::from(control(index)), &joint)
        {
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
    task: &BodyTask,
    poses: &[Pose],
    drive: Drive,
    value: f64,
    joint: impl Fn(usize) -> (f32, f32),
) -> Option<AppliedForce> {
    match drive {
        Drive::Nothing => None,
        Drive::JointForce(index) => along_joint(task, &task.joints[index], value),
        Drive::Servo(servo) => along_joint(
            task,
            &task.joints[servo.joint],
            servo_force(&servo, value, joint(servo.joint)),
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
                rotated(force, -f64::from(poses[body].angle))
            };
            Some((body, at.unwrap_or(task.bodies[body].inertial.com), force))
        }
    }
}

/// kp (target − q) + kv (rate − q̇), within its limit.
fn servo_force(servo: &Servo, target: f64, (position, rate): (f32, f32)) -> f64 {
    let (position, rate) = (f64::from(position), f64::from(rate));
    let force = match servo.target {
        ServoTarget::Position => servo.kp * (target - position) - servo.kv * rate,
        ServoTarget::Velocity => servo.kv * (target - rate),
    };
    servo
        .force_limit
        .map_or(force, |limit| force.clamp(-limit, limit))
}

/// A force (N) or torque (N m) along a joint's coordinate. With r from the hinge to the center of
/// mass, the torque τ is that of the force τ (−r_y, r_x) / |r|² there.
fn along_joint(task: &BodyTask, joint: &Joint, value: f64) -> Option<AppliedForce> {
    match joint.kind {
        JointKind::Weld => None,
        JointKind::Slide { axis } => {
            Some((joint.child, joint.anchor, axis.map(|along| along * value)))
        }
        JointKind::Hinge { sign } => {
            let com = task.bodies[joint.child].inertial.com;
            let arm = [com[0] - joint.anchor[0], com[1] - joint.anchor[1]];
            let square = arm[0] * arm[0] + arm[1] * arm[1];
            let per_length = sign * value / square;
            (square > 1e-12).then_some((
                joint.child,
                com,
                [-arm[1] * per_length, arm[0] * per_length],
            ))
        }
    }
}

fn rotated([x, y]: [f64; 2], angle: f64) -> [f64; 2] {
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
        rotated(local, f64::from(self.angle)).map(|along| along as f32)
    }
}
