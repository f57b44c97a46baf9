//! What acts along a joint's coordinate as a constraint of its own, solved anew in each substep: ranges, springs, dampers, dry
//! friction, servos. Each is one more Rapier joint that locks nothing, so that any number of them can act on one coordinate.

use rapier2d::prelude::{
    GenericJoint, GenericJointBuilder, ImpulseJointHandle, ImpulseJointSet, JointAxesMask,
    JointAxis, JointMotor, MotorModel, PhysicsWorld, RigidBodyHandle, SpringCoefficients,
};

use super::joint::Hold;
use crate::env::description::{Description, Joint, Servo, Solver, Target};

/// A constraint along the coordinate of a joint.
pub(super) struct Drive {
    joint: usize,
    effect: Effect,
}

#[derive(Clone, Copy)]
enum Effect {
    /// Lowest and highest coordinate, and the softness of either end.
    Range([f32; 2], SpringCoefficients<f32>),
    Motor(JointMotor),
}

impl Drive {
    /// What the description says that resists the motion of its joints.
    pub(super) fn passive(description: &Description, holds: &[Hold]) -> Vec<Self> {
        let joints = description.joints.iter().zip(holds).enumerate();
        let drives = joints.flat_map(|(joint, (described, hold))| {
            let effects = [
                range(described, hold, description),
                spring(described),
                friction(described),
            ];
            effects
                .into_iter()
                .flatten()
                .map(move |effect| Self { joint, effect })
        });
        drives.collect()
    }

    /// A motor that [`aim`](Self::aim) can drive.
    pub(super) fn servo(servo: &Servo) -> Self {
        let force_limit = servo.force_limit.map_or(f32::MAX, |force| force as f32);
        let motor = JointMotor {
            stiffness: servo.kp as f32,
            damping: servo.kv as f32,
            max_force: force_limit,
            ..FORCE
        };
        Self {
            joint: servo.joint,
            effect: Effect::Motor(motor),
        }
    }

    /// Inserts the constraint for the copy whose bodies are `handles`; `anchor` is a body of the world.
    pub(super) fn insert(
        &self,
        world: &mut PhysicsWorld,
        anchor: RigidBodyHandle,
        handles: &[RigidBodyHandle],
        holds: &[Hold],
    ) -> ImpulseJointHandle {
        let hold = &holds[self.joint];
        let (parent, child) = hold.ends(anchor, handles);
        world
            .impulse_joints
            .insert(parent, child, self.constraint(hold), false)
    }

    fn constraint(&self, hold: &Hold) -> GenericJoint {
        let ([frame1, frame2], axis, sense) = (hold.frames(), hold.axis(), hold.sense());
        let mut joint = GenericJointBuilder::new(JointAxesMask::empty())
            .local_frame1(frame1)
            .local_frame2(frame2)
            .build();
        match self.effect {
            Effect::Range([low, high], softness) => {
                joint.set_limits(
                    axis,
                    if sense > 0.0 {
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
                    target_pos: sense * motor.target_pos,
                    ..motor
                };
            }
        }
        joint
    }

    /// Tells a servo where to go.
    pub(super) fn aim(
        handle: ImpulseJointHandle,
        joints: &mut ImpulseJointSet,
        hold: &Hold,
        target: Target,
        value: f32,
    ) {
        let (axis, value) = (hold.axis() as usize, hold.sense() * value);
        let Some(joint) = joints.get_mut(handle, false) else {
            return;
        };
        match target {
            Target::Position => joint.data.motors[axis].target_pos = value,
            Target::Velocity => joint.data.motors[axis].target_vel = value,
        }
    }
}

/// A motor whose gains are forces; by default Rapier's are accelerations.
const FORCE: JointMotor = JointMotor {
    target_vel: 0.0,
    target_pos: 0.0,
    stiffness: 0.0,
    damping: 0.0,
    max_force: f32::MAX,
    impulse: 0.0,
    model: MotorModel::ForceBased,
};

fn range(joint: &Joint, hold: &Hold, description: &Description) -> Option<Effect> {
    let range = joint.range.filter(|_| !hold.stops())?;
    Some(Effect::Range(
        range.map(|end| end as f32),
        softness(description.solver, description.spec.control_step),
    ))
}

/// An end of a range takes back a fifth of what it is exceeded by in each substep: a blow against it gives back at most a fifth of
/// the speed. (Rapier's own softness takes back all of it, and what it takes back remains as speed.)
///
/// Rapier's share is ω h / (ω h + 2 ζ) with the substep h: ω = ζ / (2 h) makes it 1/5; a large ζ makes the end hard against forces.
fn softness(solver: Solver, control_step: f64) -> SpringCoefficients<f32> {
    const DAMPING_RATIO: f64 = 1e3;
    let substep = control_step / f64::from(solver.iterations);
    let natural_frequency = DAMPING_RATIO / (2.0 * substep) / std::f64::consts::TAU;
    SpringCoefficients {
        natural_frequency: natural_frequency as f32,
        damping_ratio: DAMPING_RATIO as f32,
    }
}

fn spring(joint: &Joint) -> Option<Effect> {
    let passive = &joint.passive;
    let motor = JointMotor {
        stiffness: passive.stiffness as f32,
        damping: passive.damping as f32,
        target_pos: passive.springref as f32,
        ..FORCE
    };
    (passive.stiffness > 0.0 || passive.damping > 0.0).then_some(Effect::Motor(motor))
}

/// Dry friction brakes a joint to rest within a substep, if its force is large enough.
fn friction(joint: &Joint) -> Option<Effect> {
    const BRAKE: f32 = 1e12;
    let most = joint.passive.frictionloss as f32;
    (most > 0.0).then_some(Effect::Motor(JointMotor {
        damping: BRAKE,
        max_force: most,
        ..FORCE
    }))
}

/// Which of a Rapier joint's axes is the coordinate.
pub(super) const ALONG: JointAxis = JointAxis::LinX;
/// See [`ALONG`].
pub(super) const ABOUT: JointAxis = JointAxis::AngX;
