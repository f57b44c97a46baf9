//! The joints of one body as one joint of Rapier, which may have several coordinates.

use std::f64::consts::TAU;

use rapier2d::prelude::{
    GenericJoint, GenericJointBuilder, JointAxesMask, JointAxis, MotorModel, Pose, Rotation,
    SpringCoefficients,
};

use super::super::constraint::velocity_gain;
use super::super::vector;
use crate::description::{BodyTask, Drive, Joint, Servo, Softness};
use crate::kinematics::{Link as TreeLink, Motion, single_angle};

/// All joints of one body.
pub(super) struct JointGroup<'a> {
    task: &'a BodyTask,
    /// Indices of the body's joints.
    pub(super) joints: Vec<usize>,
    /// Each joint as if it were the only one of the body: `[joints]`
    pub(super) links: Vec<TreeLink>,
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
    pub(super) fn new(first: usize, task: &'a BodyTask) -> Self {
        let has_same_child = |&joint: &usize| task.joints[joint].child == task.joints[first].child;
        let joints: Vec<_> = (first..task.joints.len()).filter(has_same_child).collect();
        let links = joints
            .iter()
            .map(|&joint| TreeLink::alone(&task.joints[joint], task));
        Self {
            links: links.collect(),
            task,
            joints,
        }
    }

    /// The joint at whose anchor Rapier's joint is: the hinge, if there is one.
    pub(super) fn anchor(&self) -> &TreeLink {
        let mut links = self.links.iter();
        let hinge = links.find(|link| matches!(link.motion, Motion::Hinge(_)));
        hinge.unwrap_or(&self.links[0])
    }

    /// Unit vector along the first slide, in the parent's frame.
    fn first_slide(&self) -> Option<[f64; 2]> {
        self.links.iter().find_map(|link| match link.motion {
            Motion::Slide(axis) => Some(axis),
            _ => None,
        })
    }

    /// The coordinate of each joint; welds have none. `[joints of the body]`
    pub(super) fn coordinates(&self) -> Vec<Option<RapierCoordinate>> {
        let mut dof = 0;
        let coordinate = |link: &TreeLink| {
            let (axis, sign) = match link.motion {
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
        self.links.iter().map(coordinate).collect()
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
        let anchor = self.anchor();
        let reference = Rotation::new(single_angle(anchor.angle));
        let mut joint = GenericJointBuilder::new(locked)
            .local_frame1(Pose::from_parts(
                vector(anchor.anchor_in_parent) - vector(coms[0]),
                axis_rotation,
            ))
            .local_frame2(Pose::from_parts(
                vector(anchor.anchor_in_child) - vector(coms[1]),
                reference.inverse() * axis_rotation,
            ))
            .contacts_enabled(false)
            .build();
        for (&index, coordinate) in self.joints.iter().zip(coordinates) {
            if let Some(coordinate) = coordinate {
                set_range(&self.task.joints[index], coordinate, self.task, &mut joint);
                set_servo(index, coordinate, self.task, &mut joint);
            }
        }
        joint
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

fn set_servo(
    index: usize,
    coordinate: RapierCoordinate,
    task: &BodyTask,
    joint: &mut GenericJoint,
) {
    let Some(servo) = servo_of(index, task) else {
        return;
    };
    let axis = coordinate.axis;
    joint.set_motor_model(axis, MotorModel::ForceBased);
    let (kp, kv) = (servo.kp as f32, velocity_gain(servo, task));
    joint.set_motor(axis, 0.0, 0.0, kp, kv);
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
/// ω √(1 + c), e = (1 + c) ω / (2 ζ). Below ζ = 1/2, ζ′ is negative.
fn range_spring(softness: Softness, substep: f64) -> SpringCoefficients<f32> {
    let frequency = TAU * softness.natural_frequency;
    let rate = frequency / (2.0 * softness.damping_ratio);
    let compliance = rate / (substep * frequency * frequency);
    let corrected_frequency = frequency * (1.0 + compliance).sqrt();
    let correction = rate * (1.0 + compliance);
    let phase = substep * corrected_frequency;
    let damping = (corrected_frequency / correction - phase) / 2.0;
    // Near 0, single precision loses the digits of a difference: Rapier then computes without damping.
    let is_small = damping < 0.0 && damping > -1e-3 * phase;
    SpringCoefficients {
        natural_frequency: (corrected_frequency / TAU) as f32,
        damping_ratio: if is_small { 0.0 } else { damping as f32 },
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
