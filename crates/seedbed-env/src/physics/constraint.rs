//! Constraints along a joint's coordinate, which Rapier solves again in each substep: ranges,
//! springs, dampers, dry friction, servos. Each is one more Rapier joint that locks nothing, so
//! that any number of them can act on one coordinate.

use rapier2d::prelude::{
    GenericJoint, GenericJointBuilder, ImpulseJointHandle, ImpulseJointSet, JointAxesMask,
    JointMotor, MotorModel, PhysicsWorld, RigidBodyHandle, SpringCoefficients,
};

use super::joint::RapierJoint;
use crate::description::{BodyTask, Joint, Servo, ServoTarget, Softness, Solver};
use crate::inertia::moved_inertia;

/// A constraint along the coordinate of a joint.
pub(super) struct CoordinateConstraint {
    joint: usize,
    effect: Effect,
}

#[derive(Clone, Copy)]
enum Effect {
    /// Minimum and maximum of the coordinate, and the softness of both ends.
    Range([f32; 2], SpringCoefficients<f32>),
    Motor(JointMotor),
}

impl CoordinateConstraint {
    /// The ranges, springs, dampers and frictions of a task's joints.
    pub(super) fn all_passive(task: &BodyTask, joints: &[RapierJoint]) -> Vec<Self> {
        let mut constraints = Vec::new();
        for (index, (described, joint)) in task.joints.iter().zip(joints).enumerate() {
            let effects = [
                range(described, joint, task),
                spring(described),
                friction(described, task),
            ];
            constraints.extend(effects.into_iter().flatten().map(|effect| Self {
                joint: index,
                effect,
            }));
        }
        constraints
    }

    /// A motor whose target is set by [`set_target`](Self::set_target).
    pub(super) fn servo(servo: &Servo, task: &BodyTask) -> Self {
        let force_limit = servo.force_limit.map_or(f32::MAX, |force| force as f32);
        let motor = JointMotor {
            stiffness: servo.kp as f32,
            damping: velocity_gain(servo, task),
            max_force: force_limit,
            ..FORCE_BASED_MOTOR
        };
        Self {
            joint: servo.joint,
            effect: Effect::Motor(motor),
        }
    }

    /// Inserts the constraint for the copy whose bodies are `handles`; `anchor` is a body of the
    /// world.
    pub(super) fn insert(
        &self,
        world: &mut PhysicsWorld,
        anchor: RigidBodyHandle,
        handles: &[RigidBodyHandle],
        joints: &[RapierJoint],
    ) -> ImpulseJointHandle {
        let joint = &joints[self.joint];
        let (parent, child) = joint.ends(anchor, handles);
        world
            .impulse_joints
            .insert(parent, child, self.constraint(joint), false)
    }

    fn constraint(&self, described: &RapierJoint) -> GenericJoint {
        let [frame1, frame2] = described.frames();
        let (axis, sign) = (described.axis(), described.sign());
        let mut joint = GenericJointBuilder::new(JointAxesMask::empty())
            .local_frame1(frame1)
            .local_frame2(frame2)
            .build();
        match self.effect {
            Effect::Range([low, high], softness) => {
                joint.set_limits(
                    axis,
                    if sign > 0.0 {
                        [low, high]
                    } else {
                        [-high, -low]
                    },
                );
                joint.softness = softness;
            }
            Effect::Motor(motor) => {
                joint.motor_axes |= axis.into();
                joint.motors[axis as usize] = JointMotor {
                    target_pos: sign * described.target_angle(motor.target_pos),
                    ..motor
                };
            }
        }
        joint
    }

    /// Sets the target of a servo.
    pub(super) fn set_target(
        handle: ImpulseJointHandle,
        joints: &mut ImpulseJointSet,
        joint: &RapierJoint,
        target: ServoTarget,
        value: f32,
    ) {
        let (axis, sign, value) = (
            joint.axis() as usize,
            joint.sign(),
            match target {
                ServoTarget::Position => joint.target_angle(value),
                ServoTarget::Velocity | ServoTarget::Speed { .. } => value,
            },
        );
        let Some(joint) = joints.get_mut(handle, false) else {
            return;
        };
        set_motor_target(&mut joint.data.motors[axis], target, sign, value);
    }
}

/// Sets the target of a servo's motor. `sign`: −1 if Rapier's coordinate grows against the task's.
pub(super) fn set_motor_target(motor: &mut JointMotor, target: ServoTarget, sign: f32, value: f32) {
    match target {
        ServoTarget::Position => motor.target_pos = sign * value,
        ServoTarget::Velocity => motor.target_vel = sign * value,
        ServoTarget::Speed { speed, max_force } => {
            motor.target_vel = sign * value.signum() * speed as f32;
            motor.max_force = value.abs() * max_force as f32;
        }
    }
}

/// A softness as Rapier takes it.
pub(super) fn spring_coefficients(softness: Softness) -> SpringCoefficients<f32> {
    SpringCoefficients {
        natural_frequency: softness.natural_frequency as f32,
        damping_ratio: softness.damping_ratio as f32,
    }
}

/// The velocity gain of a servo, N s/m or N m s/rad.
pub(super) fn velocity_gain(servo: &Servo, task: &BodyTask) -> f32 {
    match servo.target {
        ServoTarget::Speed { .. } => stopping_damping(&task.joints[servo.joint], task),
        ServoTarget::Position | ServoTarget::Velocity => servo.kv as f32,
    }
}

/// A damping so strong that a joint reaches its velocity within a substep: it stops what it moves within a
/// microsecond.
fn stopping_damping(joint: &Joint, task: &BodyTask) -> f32 {
    const MIN_DAMPING: f64 = 1e12;
    const STOPPING_RATE: f64 = 1e6;
    (STOPPING_RATE * moved_inertia(joint, task)).max(MIN_DAMPING) as f32
}

/// A motor whose gains are forces; by default Rapier's are accelerations.
const FORCE_BASED_MOTOR: JointMotor = JointMotor {
    target_vel: 0.0,
    target_pos: 0.0,
    stiffness: 0.0,
    damping: 0.0,
    max_force: f32::MAX,
    impulse: 0.0,
    model: MotorModel::ForceBased,
};

/// The range of a joint that is not stopped directly at its walls.
fn range(described: &Joint, joint: &RapierJoint, task: &BodyTask) -> Option<Effect> {
    let range = described.range.filter(|_| !joint.has_walls())?;
    let softness = match described.range_softness {
        Some(given) => spring_coefficients(given),
        None => softness(task.solver, task.spec.control_step),
    };
    Some(Effect::Range(range.map(|end| end as f32), softness))
}

/// The softness of the ends of a range, such that a fifth of the overshoot is corrected in each
/// substep. A joint that hits an end then rebounds with at most a fifth of its speed: Rapier's
/// default corrects all of the overshoot at once, and the correction remains as speed.
///
/// Rapier corrects the share ω h / (ω h + 2 ζ) per substep h, where ζ is the damping ratio. ω = ζ /
/// (2 h) makes it 1/5, and a large ζ makes the end stiff against forces.
fn softness(solver: Solver, control_step: f64) -> SpringCoefficients<f32> {
    const DAMPING_RATIO: f64 = 1e3;
    let substep = control_step / f64::from(solver.substeps);
    let natural_frequency = DAMPING_RATIO / (2.0 * substep) / std::f64::consts::TAU;
    SpringCoefficients {
        natural_frequency: natural_frequency as f32,
        damping_ratio: DAMPING_RATIO as f32,
    }
}

/// Spring and damper of a joint, if it has one of them.
fn spring(joint: &Joint) -> Option<Effect> {
    let passive = &joint.passive_forces;
    let motor = JointMotor {
        stiffness: passive.stiffness as f32,
        damping: passive.damping as f32,
        target_pos: passive.springref as f32,
        ..FORCE_BASED_MOTOR
    };
    (passive.stiffness > 0.0 || passive.damping > 0.0).then_some(Effect::Motor(motor))
}

/// Dry friction: a damper so strong that it stops the joint within a substep, whose force is
/// limited to the friction.
fn friction(joint: &Joint, task: &BodyTask) -> Option<Effect> {
    let max_force = joint.passive_forces.frictionloss as f32;
    (max_force > 0.0).then_some(Effect::Motor(JointMotor {
        damping: stopping_damping(joint, task),
        max_force,
        ..FORCE_BASED_MOTOR
    }))
}
