//! The forces of an action, to be drawn as arrows. They are not used to compute motion.

use super::description::{BodyTask, Drive, Joint, JointKind, Servo, ServoTarget};
use super::{Force, ForceSource, Pose};

/// Index of a body, point of application (m) and force (N) in the body's own frame.
type AppliedForce = (usize, [f64; 2], [f64; 2]);

/// Appends the forces of the latest action: those of actuators, and those formula forces that
/// depend on the action. Forces at the same point are added up.
///
/// `poses`: `[bodies]`; `control(i)`: value of the i-th control, actuators first, then formula
/// forces; `joint(i)`: position and velocity of the i-th joint.
pub(super) fn add_action_forces(
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
    let action_columns = first_action..first_action + task.actuators.len();
    let formula_forces = task.formula_forces.iter().map(|force| {
        let reads_action = force.formula.reads(&action_columns);
        reads_action.then_some((force.drive, 1.0))
    });
    let first_new = forces.len();
    for (index, drive) in actuators.chain(formula_forces).enumerate() {
        let Some((drive, gear)) = drive else { continue };
        if let Some((body, at, force)) =
            applied_force(task, poses, drive, gear * f64::from(control(index)), &joint)
        {
            let (at, newtons) = (poses[body].point(at), poses[body].vector(force));
            add_to_same_point(
                Force {
                    source: ForceSource::Action,
                    at,
                    newtons,
                },
                first_new,
                forces,
            );
        }
    }
    let is_nonzero = |force: &Force| force.newtons != [0.0; 2];
    let nonzero: Vec<Force> = forces.drain(first_new..).filter(is_nonzero).collect();
    forces.extend(nonzero);
}

/// Adds a force to the one at the same point from index `first_new` on, or appends it.
fn add_to_same_point(force: Force, first_new: usize, forces: &mut Vec<Force>) {
    match forces[first_new..]
        .iter_mut()
        .find(|other| other.at == force.at)
    {
        Some(other) => (0..2).for_each(|axis| other.newtons[axis] += force.newtons[axis]),
        None => forces.push(force),
    }
}

/// The force that a control with the given value applies to a body.
fn applied_force(
    task: &BodyTask,
    poses: &[Pose],
    drive: Drive,
    value: f64,
    joint: impl Fn(usize) -> (f32, f32),
) -> Option<AppliedForce> {
    match drive {
        // A torque on a free body has no place to be drawn at.
        Drive::Nothing | Drive::BodyTorque { .. } => None,
        Drive::JointForce(index) => joint_force(task, &task.joints[index], value),
        Drive::Servo(servo) => joint_force(
            task,
            &task.joints[servo.joint],
            servo_force(&servo, value, joint(servo.joint)),
        ),
        Drive::BodyForce {
            body,
            at,
            direction,
            is_local,
        } => {
            let force = direction.map(|along| along * value);
            let force = if is_local {
                force
            } else {
                rotated(force, -f64::from(poses[body].angle))
            };
            Some((body, at.unwrap_or(task.bodies[body].inertial.com), force))
        }
    }
}

/// The force kp (target − q) + kv (target velocity − q̇) of a servo, within its limit.
fn servo_force(servo: &Servo, target: f64, (position, rate): (f32, f32)) -> f64 {
    let (position, rate) = (f64::from(position), f64::from(rate));
    let force = match servo.target {
        ServoTarget::Position => servo.kp * (target - position) - servo.kv * rate,
        ServoTarget::Velocity => servo.kv * (target - rate),
        // What the motor needs is not known: its direction and maximum are shown.
        ServoTarget::Speed { speed, max_force } => {
            max_force * target.abs() * (speed * target.signum() - rate).signum()
        }
    };
    servo
        .force_limit
        .map_or(force, |limit| force.clamp(-limit, limit))
}

/// The force (N) or torque (N m) `value` along a joint's coordinate, as a force on the child. With
/// r from the hinge to the center of mass, a torque τ becomes the force τ (−r_y, r_x) / |r|² at the
/// center of mass, which has the same torque.
fn joint_force(task: &BodyTask, joint: &Joint, value: f64) -> Option<AppliedForce> {
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
