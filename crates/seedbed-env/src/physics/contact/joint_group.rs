//! The joints of one body as one joint of Rapier, which may have several coordinates.

use std::f64::consts::TAU;

use rapier2d::prelude::{
    GenericJoint, GenericJointBuilder, JointAxesMask, JointAxis, MotorModel, Pose, Rotation,
    SpringCoefficients,
};

use super::super::constraint::velocity_gain;
use super::super::vector;
use crate::description::{BodyTask, Drive, Joint, Servo, Softness};
use crate::kinematics::{KinematicTree, Link as TreeLink, Motion};

/// All joints of one body.
pub(super) struct JointGroup<'a> {
    task: &'a BodyTask,
    /// The first joint of the body, which starts at its parent.
    first: &'a TreeLink,
    /// Indices of the body's joints.
    pub(super) joints: Vec<usize>,
    /// Unit vector in the parent's frame of a slide, or the sign of a hinge: `[joints]`
    pub(super) motions: Vec<Motion>,
    /// Position of Rapier's joint in the child's frame, m: that of the hinge, if there is one.
    pub(super) anchor_in_child: [f64; 2],
}

/// The coordinate of Rapier's joint that is the coordinate of one of the task's joints.
#[derive(Clone, Copy, Debug)]
pub(super) struct RapierCoordinate {
    pub(super) axis: JointAxis,
    /// +1 or −1: the task's coordinate grows in the direction of Rapier's, or against it.
    pub(super) sign: f32,
    /// Index among the coordinates of Rapier's joint.
    pub(super) dof: usize,
}

impl<'a> JointGroup<'a> {
    /// The joints whose child is that of the joint `first`, which is the first of them.
    pub(super) fn new(first: usize, tree: &'a KinematicTree, task: &'a BodyTask) -> Self {
        let has_same_child = |&joint: &usize| task.joints[joint].child == task.joints[first].child;
        let joints: Vec<_> = (first..task.joints.len()).filter(has_same_child).collect();
        let first = &tree.links()[first];
        let motion = |(place, &joint): (usize, &usize)| match tree.links()[joint].motion {
            // A further slide is given in the child's frame, the first one in the parent's.
            Motion::Slide(axis) if place > 0 => Motion::Slide(rotated(axis, first.angle)),
            motion => motion,
        };
        let motions = joints.iter().enumerate().map(motion).collect();
        let hinge = joints
            .iter()
            .map(|&joint| &tree.links()[joint])
            .find(|link| matches!(link.motion, Motion::Hinge(_)));
        Self {
            anchor_in_child: hinge.unwrap_or(first).anchor_in_child,
            task,
            first,
            joints,
            motions,
        }
    }

    /// Unit vector along the first slide, in the parent's frame.
    fn first_slide(&self) -> Option<[f64; 2]> {
        self.motions.iter().find_map(|motion| match motion {
            Motion::Slide(axis) => Some(*axis),
            _ => None,
        })
    }

    /// The coordinate of each joint; welds have none. `[joints of the body]`
    pub(super) fn coordinates(&self) -> Vec<Option<RapierCoordinate>> {
        let mut dof = 0;
        let coordinate = |motion: &Motion| {
            let (axis, sign) = match *motion {
                Motion::Weld => return None,
                Motion::Hinge(sign) => (JointAxis::AngX, sign as f32),
                Motion::Slide(axis) => match self.first_slide() {
                    Some(first) if first != axis => (JointAxis::LinY, turn_sign(first, axis)),
                    _ => (JointAxis::LinX, 1.0),
                },
            };
            dof += 1;
            Some(RapierCoordinate {
                axis,
                sign,
                dof: dof - 1,
            })
        };
        self.motions.iter().map(coordinate).collect()
    }

    /// Rapier's joint; `coms` are the centers of mass of parent and child in their frames.
    pub(super) fn rapier_joint(&self, coms: [[f64; 2]; 2]) -> GenericJoint {
        let coordinates = self.coordinates();
        let free_axes = coordinates.iter().flatten();
        let locked = free_axes.fold(JointAxesMask::LOCKED_FIXED_AXES, |locked, coordinate| {
            locked - JointAxesMask::from(coordinate.axis)
        });
        let axis_rotation = match self.first_slide() {
            Some([x, y]) => Rotation::from_cos_sin_unchecked(x as f32, y as f32),
            None => Rotation::IDENTITY,
        };
        let reference = Rotation::new(self.first.angle as f32);
        let mut joint = GenericJointBuilder::new(locked)
            .local_frame1(Pose::from_parts(
                vector(self.anchor_in_parent()) - vector(coms[0]),
                axis_rotation,
            ))
            .local_frame2(Pose::from_parts(
                vector(self.anchor_in_child) - vector(coms[1]),
                reference.inverse() * axis_rotation,
            ))
            .contacts_enabled(false)
            .build();
        for (&index, coordinate) in self.joints.iter().zip(coordinates) {
            if let Some(coordinate) = coordinate {
                set_range(&self.task.joints[index], coordinate, self.task, &mut joint);
                set_servo(servo_of(index, self.task), coordinate, &mut joint);
            }
        }
        joint
    }

    /// Position of Rapier's joint in the parent's frame at coordinate 0, m.
    fn anchor_in_parent(&self) -> [f64; 2] {
        let (first, anchor) = (self.first, self.anchor_in_child);
        if anchor == first.anchor_in_child {
            return first.anchor_in_parent;
        }
        let [x, y] = [0, 1].map(|axis| anchor[axis] - first.anchor_in_child[axis]);
        let [x, y] = rotated([x, y], first.angle);
        [first.anchor_in_parent[0] + x, first.anchor_in_parent[1] + y]
    }
}

fn set_range(
    described: &Joint,
    coordinate: RapierCoordinate,
    task: &BodyTask,
    joint: &mut GenericJoint,
) {
    let Some(range) = described.range else { return };
    let ends = range.map(|end| coordinate.sign * end as f32);
    joint.set_limits(
        coordinate.axis,
        [ends[0].min(ends[1]), ends[0].max(ends[1])],
    );
    if let Some(softness) = described.range_softness {
        joint.softness = range_spring(softness, substep(task));
    }
}

fn set_servo(servo: Option<&Servo>, coordinate: RapierCoordinate, joint: &mut GenericJoint) {
    let Some(servo) = servo else { return };
    let axis = coordinate.axis;
    joint.set_motor_model(axis, MotorModel::ForceBased);
    joint.set_motor(axis, 0.0, 0.0, servo.kp as f32, velocity_gain(servo));
    let max_force = servo.force_limit.map_or(f32::MAX, |force| force as f32);
    joint.set_motor_max_force(axis, max_force);
}

fn servo_of(joint: usize, task: &BodyTask) -> Option<&Servo> {
    let mut actuators = task.actuators.iter();
    actuators.find_map(|actuator| match &actuator.drive {
        Drive::Servo(servo) if servo.joint == joint => Some(servo),
        _ => None,
    })
}

/// Duration of a substep, s.
fn substep(task: &BodyTask) -> f64 {
    let substeps = task.solver.contact_updates * task.solver.substeps;
    task.spec.control_step / f64::from(substeps)
}

/// The coefficients with which a range of Rapier's multibodies yields like a spring of natural
/// frequency ω and damping ratio ζ: under a lasting load by its acceleration over ω², and an overshoot
/// shrinks at the rate ω / (2 ζ).
///
/// In a substep h, Rapier computes a correction from the spring ω′, ζ′: with its coefficients e =
/// ω′ / (h ω′ + 2 ζ′) and c = 1 / (h ω′ (h ω′ + 2 ζ′)), a limit overshoots by (1 + c) / ω′² per
/// acceleration, because the correction is removed from the velocities after each substep, and an
/// overshoot shrinks at the rate e / (1 + c). Both are as desired for c = 1 / (2 ζ h ω), ω′ =
/// ω √(1 + c), e = (1 + c) ω / (2 ζ).
fn range_spring(softness: Softness, substep: f64) -> SpringCoefficients<f32> {
    let frequency = TAU * softness.natural_frequency;
    let rate = frequency / (2.0 * softness.damping_ratio);
    let compliance = rate / (substep * frequency * frequency);
    let corrected_frequency = frequency * (1.0 + compliance).sqrt();
    let correction = rate * (1.0 + compliance);
    let damping = (corrected_frequency / correction - substep * corrected_frequency) / 2.0;
    SpringCoefficients {
        natural_frequency: (corrected_frequency / TAU) as f32,
        damping_ratio: damping.max(0.0) as f32,
    }
}

/// The softness of contacts as Rapier takes it.
pub(super) fn contact_spring(softness: Softness) -> SpringCoefficients<f32> {
    SpringCoefficients {
        natural_frequency: softness.natural_frequency as f32,
        damping_ratio: softness.damping_ratio as f32,
    }
}

/// +1 if `b` is `a` turned by a quarter counter-clockwise, −1 if clockwise.
fn turn_sign(a: [f64; 2], b: [f64; 2]) -> f32 {
    if a[0] * b[1] - a[1] * b[0] > 0.0 {
        1.0
    } else {
        -1.0
    }
}

fn rotated([x, y]: [f64; 2], angle: f64) -> [f64; 2] {
    let (sine, cosine) = libm::sincos(angle);
    [cosine * x - sine * y, sine * x + cosine * y]
}
