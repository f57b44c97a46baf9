//! Control steps in which joints turn too fast or too far for a shared world.
//!
//! Rapier stores the rotation of a body as a unit vector. In each substep h it moves the vector
//! along its tangent and normalizes it: a body at ω turns by arctan(ω h) instead of ω h, too little
//! by the share (ω h)² / 3. A unit vector has no full turns either: ends of ranges, springs and
//! servos act on an angle between −π and π, and a coordinate gets the turns that bring it nearest
//! to its value one control step earlier.
//!
//! Up to [`MAX_TURN_PER_SUBSTEP`] the share is at most 1 / 768, and up to [`MAX_TURN_PER_STEP`] and
//! [`MAX_ANGLE`] no turn is lost. From the first control step that begins or ends beyond, the steps
//! of a copy are computed as in tasks with contacts, until it starts again: the coordinates of
//! multibodies are plain numbers, which grow by ω h in a substep whatever their size. Positions and
//! velocities are the whole state of a copy, so that it can change worlds between two steps. It
//! does so once in an episode, because the two methods differ in their errors of first order, which
//! would add up.

use super::body::MAX_TURN_PER_SUBSTEP;
use super::contact::ContactWorlds;
use super::joint::RapierJoint;
use crate::description::{BodyTask, Drive, Joint, JointKind, ServoTarget};
use crate::dynamics::{CoordinateColumns, Dynamics};

/// The angle by which a hinge may turn in a control step, rad. It is less than half a turn, because
/// a hinge may turn faster within the step than at its ends.
const MAX_TURN_PER_STEP: f32 = 2.0;

/// The distance that a hinge's angle may have from where a range, spring or servo is at rest, rad.
/// It is less than half a turn by more than a hinge turns in a substep.
const MAX_ANGLE: f64 = 2.9;

/// A slide may leave a range with hard ends by this distance over the duration of a substep, m/s.
/// Rapier brings it back at 3 m/s at most, and by a fifth of the distance per substep.
const MAX_RETURN_SPEED: f64 = 5.0 * 3.0;

/// Recognizes control steps in which joints turn too fast or too far, and computes them.
pub(super) struct FarTurns {
    /// Whether a copy's steps are computed here until it starts again: `[copies]`.
    is_far: Vec<bool>,
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

/// Where a range, spring or servo of a joint is at rest.
struct Rest {
    joint: usize,
    position: RestPosition,
    /// Maximum distance of the joint from there.
    max_distance: f32,
}

enum RestPosition {
    /// The middle of a range, or the rest of a spring.
    Fixed(f32),
    /// The target of a servo: this factor times the control with this index.
    Target(f32, usize),
}

impl FarTurns {
    /// For `copies` copies of a task with these joints. `None` if nothing turns or is held at the end
    /// of a range by a constraint, or if a joint has several servos, of which a multibody can have only
    /// one.
    pub(super) fn new(task: &BodyTask, joints: &[RapierJoint], copies: usize) -> Option<Self> {
        let indices = 0..task.joints.len();
        let is_hinge = |&index: &usize| joints[index].is_hinge();
        let hinges: Vec<_> = indices.clone().filter(is_hinge).collect();
        let rests: Vec<_> = indices
            .filter(|&index| !joints[index].has_walls())
            .flat_map(|index| rests(index, task))
            .collect();
        let is_needed = !hinges.is_empty() || !rests.is_empty();
        if !is_needed || task.has_joint_with_several_servos() {
            return None;
        }
        let control_step = task.spec.control_step as f32;
        let substeps = task.solver.substeps as f32;
        Some(Self {
            is_far: vec![false; copies],
            chains: chains(task),
            max_spin: MAX_TURN_PER_SUBSTEP * substeps / control_step,
            max_rate: MAX_TURN_PER_STEP / control_step,
            rests,
            hinges,
            before: CoordinateColumns::new(task.joints.len(), copies),
            multibody: ContactWorlds::new(task, 1),
            start: [vec![0.0; task.joints.len()], vec![0.0; task.joints.len()]],
            controls: vec![0.0; task.actuators.len() + task.formula_forces.len()],
        })
    }

    /// Notes that a copy starts, or goes on as it has been saved.
    pub(super) fn set_far(&mut self, copy: usize, is_far: bool) {
        self.is_far[copy] = is_far;
    }

    /// Whether the steps of a copy are computed here.
    pub(super) fn is_far(&self, copy: usize) -> bool {
        self.is_far[copy]
    }

    /// Remembers the coordinates before a step.
    pub(super) fn begin_step(&mut self, columns: &CoordinateColumns) {
        self.before.copy_from(columns);
    }

    /// Computes the latest step of a copy, from the remembered coordinates to `columns`, if a shared
    /// world cannot. Returns whether it has done so.
    pub(super) fn step(
        &mut self,
        copy: usize,
        controls: &[f32],
        columns: &mut CoordinateColumns,
    ) -> bool {
        let control = |index: usize| controls[index * columns.copies() + copy];
        let fits = |columns| self.fits(copy, columns, control);
        if !self.is_far[copy] && fits(&self.before) && fits(columns) {
            return false;
        }
        self.is_far[copy] = true;
        self.repeat_step(copy, controls, columns);
        true
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
            let position = match rest.position {
                RestPosition::Fixed(position) => position,
                RestPosition::Target(gear, index) => gear * control(index),
            };
            columns.positions(rest.joint)[copy] - position
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
                .all(|rest| distance(rest).abs() <= rest.max_distance)
    }

    fn repeat_step(&mut self, copy: usize, controls: &[f32], columns: &mut CoordinateColumns) {
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

/// Where the range, spring and servo of a hinge are at rest, or the range of a slide with hard ends.
fn rests(index: usize, task: &BodyTask) -> Vec<Rest> {
    let joint = &task.joints[index];
    let rest = |position: RestPosition, max_distance: f64| Rest {
        joint: index,
        position,
        max_distance: max_distance as f32,
    };
    let middle = |[low, high]: [f64; 2]| RestPosition::Fixed(f64::midpoint(low, high) as f32);
    match joint.kind {
        JointKind::Hinge { .. } => {
            let Joint {
                range,
                passive_forces: passive,
                ..
            } = joint;
            let spring = RestPosition::Fixed(passive.springref as f32);
            let spring = (passive.stiffness > 0.0).then_some(spring);
            let fixed = range.map(middle).into_iter().chain(spring);
            let rests = fixed.chain(servo_targets(index, task));
            rests.map(|position| rest(position, MAX_ANGLE)).collect()
        }
        JointKind::Slide { .. } if joint.range_softness.is_none() => {
            let substep = task.spec.control_step / f64::from(task.solver.substeps);
            let max_overshoot = MAX_RETURN_SPEED * substep;
            let in_range =
                |range: [f64; 2]| rest(middle(range), (range[1] - range[0]) / 2.0 + max_overshoot);
            joint.range.map(in_range).into_iter().collect()
        }
        JointKind::Slide { .. } | JointKind::Weld => Vec::new(),
    }
}

/// The targets of the servos that drive a joint to a position.
fn servo_targets(joint: usize, task: &BodyTask) -> impl Iterator<Item = RestPosition> {
    let actuators = task.actuators.iter().enumerate();
    actuators.filter_map(move |(index, actuator)| match actuator.drive {
        Drive::Servo(servo) if servo.joint == joint && servo.target == ServoTarget::Position => {
            Some(RestPosition::Target(actuator.gear as f32, index))
        }
        _ => None,
    })
}
