//! Control steps in which joints turn too fast or too far for a shared world.
//!
//! Rapier stores the rotation of a body as a unit vector. In each substep h it moves the vector
//! along its tangent and normalizes it: a body at ω turns by arctan(ω h) instead of ω h, too little
//! by the share (ω h)² / 3. A unit vector has no full turns either: ends of ranges, springs and
//! servos act on an angle between −π and π, and a coordinate gets the turns that bring it nearest
//! to its value one control step earlier.
//!
//! Up to [`MAX_TURN_PER_SUBSTEP`] the share is at most 1 / 768, and up to [`MAX_TURN_PER_STEP`] and
//! [`MAX_ANGLE`] no turn is lost. A control step that begins or ends beyond is computed again, for
//! that copy alone, as in tasks with contacts: the coordinates of multibodies are plain numbers,
//! which grow by ω h in a substep whatever their size. Between such steps, positions and velocities
//! are the whole state of a copy, so that it can change worlds.

use super::contact::ContactWorlds;
use crate::description::{BodyTask, Drive, Joint, JointKind, ServoTarget};
use crate::dynamics::{CoordinateColumns, Dynamics};

/// The angle by which a body may turn in a substep, rad. Rapier's error is the same in every task,
/// and smaller than that of a first-order method with 16 substeps per radian.
pub(super) const MAX_TURN_PER_SUBSTEP: f32 = 1.0 / 16.0;

/// The angle by which a hinge may turn in a control step, rad. It is less than half a turn, because
/// a hinge may turn faster within the step than at its ends.
const MAX_TURN_PER_STEP: f32 = 2.0;

/// The distance that a hinge's angle may have from where a range, spring or servo is at rest, rad.
/// It is less than half a turn by more than a hinge turns in a substep.
const MAX_ANGLE: f32 = 2.9;

/// Recognizes and repeats control steps in which joints turn too fast or too far.
pub(super) struct FarTurns {
    /// The hinges whose rates, with these signs, add up to the angular velocity of a body.
    chains: Vec<Vec<(usize, f32)>>,
    /// Maximum angular velocity of a body, rad/s.
    max_spin: f32,
    /// Indices of the hinges.
    hinges: Vec<usize>,
    /// Maximum velocity of a hinge, rad/s.
    max_rate: f32,
    rests: Vec<Rest>,
    /// The coordinates of all copies before the step.
    before: CoordinateColumns,
    /// One copy, in which steps are repeated.
    multibody: ContactWorlds,
    /// Position and velocity of each coordinate at the start of a repeated step.
    start: [Vec<f64>; 2],
    /// The controls of a repeated step.
    controls: Vec<f32>,
}

/// Where a range, spring or servo of a hinge is at rest.
struct Rest {
    hinge: usize,
    angle: RestAngle,
}

enum RestAngle {
    /// The middle of a range, or the rest of a spring.
    Fixed(f32),
    /// The target of a servo: this factor times the control with this index.
    Target(f32, usize),
}

impl FarTurns {
    /// For `copies` copies of a task. `None` if nothing turns, or if a joint has several servos, of
    /// which a multibody can have only one.
    pub(super) fn new(task: &BodyTask, copies: usize) -> Option<Self> {
        let joints = task.joints.iter().enumerate();
        let hinges: Vec<_> = joints
            .filter(|(_, joint)| matches!(joint.kind, JointKind::Hinge { .. }))
            .map(|(index, _)| index)
            .collect();
        if hinges.is_empty() || task.has_joint_with_several_servos() {
            return None;
        }
        let control_step = task.spec.control_step as f32;
        let substeps = task.solver.substeps as f32;
        Some(Self {
            chains: chains(task),
            max_spin: MAX_TURN_PER_SUBSTEP * substeps / control_step,
            max_rate: MAX_TURN_PER_STEP / control_step,
            rests: hinges
                .iter()
                .flat_map(|&hinge| rests(hinge, task))
                .collect(),
            hinges,
            before: CoordinateColumns::new(task.joints.len(), copies),
            multibody: ContactWorlds::new(task, 1),
            start: [vec![0.0; task.joints.len()], vec![0.0; task.joints.len()]],
            controls: vec![0.0; task.actuators.len() + task.formula_forces.len()],
        })
    }

    /// Remembers the coordinates before a step.
    pub(super) fn begin_step(&mut self, columns: &CoordinateColumns) {
        self.before.copy_from(columns);
    }

    /// Whether the step of a copy from the remembered coordinates to `columns` has to be repeated.
    pub(super) fn are_in_step(
        &self,
        copy: usize,
        columns: &CoordinateColumns,
        controls: &[f32],
    ) -> bool {
        let control = |index: usize| controls[index * columns.copies() + copy];
        [&self.before, columns]
            .into_iter()
            .any(|columns| !self.fits(copy, columns, control))
    }

    /// Whether a shared world computes with these coordinates; it does not if they are not finite.
    fn fits(
        &self,
        copy: usize,
        columns: &CoordinateColumns,
        control: impl Fn(usize) -> f32,
    ) -> bool {
        let rate = |hinge: usize| columns.velocities(hinge)[copy];
        let spin = |chain: &[(usize, f32)]| -> f32 {
            chain.iter().map(|&(hinge, sign)| sign * rate(hinge)).sum()
        };
        let distance = |rest: &Rest| {
            let angle = match rest.angle {
                RestAngle::Fixed(angle) => angle,
                RestAngle::Target(gear, index) => gear * control(index),
            };
            columns.positions(rest.hinge)[copy] - angle
        };
        self.chains
            .iter()
            .all(|chain| spin(chain).abs() <= self.max_spin)
            && self
                .hinges
                .iter()
                .all(|&hinge| rate(hinge).abs() <= self.max_rate)
            && self
                .rests
                .iter()
                .all(|rest| distance(rest).abs() <= MAX_ANGLE)
    }

    /// Computes the step of a copy again, and writes its coordinates to `columns`.
    pub(super) fn repeat_step(
        &mut self,
        copy: usize,
        controls: &[f32],
        columns: &mut CoordinateColumns,
    ) {
        let [positions, velocities] = &mut self.start;
        for (joint, (position, velocity)) in positions.iter_mut().zip(&mut *velocities).enumerate()
        {
            let (q, q_dot) = self.before.get(joint, copy);
            (*position, *velocity) = (q.into(), q_dot.into());
        }
        for (index, control) in self.controls.iter_mut().enumerate() {
            *control = controls[index * columns.copies() + copy];
        }
        self.multibody.start(0, positions, velocities);
        self.multibody.step(&self.controls);
        for joint in 0..positions.len() {
            let (position, velocity) = self.multibody.coordinates().get(joint, 0);
            columns.set(joint, copy, position, velocity);
        }
    }
}

/// The hinges above each body, each chain once.
fn chains(task: &BodyTask) -> Vec<Vec<(usize, f32)>> {
    let mut of_bodies = vec![Vec::new(); task.bodies.len()];
    for (index, joint) in task.joints.iter().enumerate() {
        let mut chain = joint
            .parent
            .map_or_else(Vec::new, |body| of_bodies[body].clone());
        if let JointKind::Hinge { sign } = joint.kind {
            chain.push((index, sign as f32));
        }
        of_bodies[joint.child] = chain;
    }
    of_bodies.retain(|chain| !chain.is_empty());
    of_bodies.dedup();
    of_bodies
}

/// Where the range, spring and servo of a hinge are at rest.
fn rests(hinge: usize, task: &BodyTask) -> Vec<Rest> {
    let Joint {
        range,
        passive_forces,
        ..
    } = &task.joints[hinge];
    let middle = range.map(|[low, high]| f64::midpoint(low, high));
    let spring = (passive_forces.stiffness > 0.0).then_some(passive_forces.springref);
    let fixed = middle.into_iter().chain(spring);
    let fixed = fixed.map(|angle| RestAngle::Fixed(angle as f32));
    let actuators = task.actuators.iter().enumerate();
    let targets = actuators.filter_map(|(index, actuator)| match actuator.drive {
        Drive::Servo(servo) if servo.joint == hinge && servo.target == ServoTarget::Position => {
            Some(RestAngle::Target(actuator.gear as f32, index))
        }
        _ => None,
    });
    fixed
        .chain(targets)
        .map(|angle| Rest { hinge, angle })
        .collect()
}
