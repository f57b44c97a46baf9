//! Analytic models: classic tasks whose exact equations of motion are known, integrated with an
//! error far below the resolution of an f32 or, if a task demands it, by the explicit Euler method
//! ([`Integrator`]).
//!
//! Rigid bodies are validated against them, and they are fast enough to learn on. All their
//! parameters come from the bodies of the [`BodyTask`]. This module must not depend on rigid-body
//! engines.
//!
//! A control step advances eight copies at a time in loops that compile to SIMD instructions.
//! They consist of operations that IEEE 754 defines to the bit and of sines and cosines made of
//! such operations, so that results have the same bits in every lane, with every instruction set
//! and for every number of copies.

#![expect(
    clippy::inline_always,
    reason = "a loop is compiled for a SIMD instruction set only if it is inlined into the dispatch"
)]

pub mod acrobot;
pub mod cartpole;
mod integration;
pub mod mountain_car;
pub mod pendulum;
mod trigonometry;

use pulp::{Arch, Simd, WithSimd};

use super::Pose;
use super::description::{AnalyticModel, BodyTask, Drive, Integrator, Joint, PassiveForces};
use super::dynamics::{CoordinateColumns, Dynamics, OTHER_BODIES, from_bytes, to_bytes};
use super::kinematics::{Frame, KinematicTree};
use acrobot::Acrobot;
use cartpole::{CartPole, EulerCartPole};
use integration::State;
use mountain_car::MountainCar;
use pendulum::Pendulum;
use trigonometry::{Bounded, Trigonometry, Unbounded};

/// The equations of motion of all N joints of a task.
trait EquationsOfMotion<const N: usize>: Copy + Send {
    /// Index of each joint in the task, in the order of the equations' coordinates.
    fn joints(&self) -> [usize; N];

    /// Number of times that [`advance`](Self::advance) is called per control step.
    fn substeps(&self) -> u32;

    /// The joint coordinates after one substep under constant joint forces, without branches.
    fn advance<T: Trigonometry>(&self, state: &State<N>, forces: [f64; N]) -> State<N>;
}

/// M copies of a task with N joints as equations of motion.
struct AnalyticDynamics<E, const N: usize> {
    equations: E,
    joint_forces: Vec<JointForce>,
    tree: KinematicTree,
    copies: usize,
    /// Whether each copy is live: `[copies]`, filled up to a whole number of groups with copies
    /// that never are.
    live: Vec<[bool; LANES]>,
    /// States of the joints, in the order of the equations, likewise filled up.
    states: Vec<StateLanes<N>>,
    columns: CoordinateColumns,
}

/// Number of copies in a group, which are advanced together.
const LANES: usize = 8;

/// Up to this number of live copies in a group, they are advanced one by one, which takes less time
/// and has the same bits.
const MAX_SINGLE_COPIES: usize = 2;

/// A number of each of some copies.
type Lanes = [f64; LANES];

/// The states of some copies.
#[derive(Clone, Copy)]
struct StateLanes<const N: usize> {
    positions: [Lanes; N],
    velocities: [Lanes; N],
}

/// An actuator or a formula force that acts along a joint.
struct JointForce {
    /// Index of the controls' column.
    control: usize,
    /// Index of the joint, in the order of the equations.
    joint: usize,
    gear: f64,
}

/// Builds `copies` copies of the analytic model of a task; none is live before its `start`. `None` if
/// the task has no analytic model.
#[must_use]
pub(crate) fn build(task: &BodyTask, copies: usize) -> Option<Box<dyn Dynamics>> {
    Some(match task.analytic_model? {
        AnalyticModel::CartPole { integrator, .. } => {
            let equations = CartPole::from_task(task).ok()?;
            match integrator {
                Integrator::RungeKutta => boxed(equations, task, copies),
                Integrator::Euler => boxed(EulerCartPole(equations), task, copies),
            }
        }
        AnalyticModel::Pendulum { .. } => boxed(Pendulum::from_task(task).ok()?, task, copies),
        AnalyticModel::Acrobot { .. } => boxed(Acrobot::from_task(task).ok()?, task, copies),
        AnalyticModel::MountainCar { .. } => {
            boxed(MountainCar::from_task(task).ok()?, task, copies)
        }
    })
}

fn boxed<E: EquationsOfMotion<N> + 'static, const N: usize>(
    equations: E,
    task: &BodyTask,
    copies: usize,
) -> Box<dyn Dynamics> {
    Box::new(AnalyticDynamics::new(equations, task, copies))
}

/// Checks that the task's analytic model, if it has one, describes the motion of its bodies.
///
/// # Errors
/// Says what the model requires of the bodies.
pub(crate) fn check(task: &BodyTask) -> Result<(), String> {
    match task.analytic_model {
        Some(AnalyticModel::CartPole { .. }) => CartPole::from_task(task).map(drop),
        Some(AnalyticModel::Pendulum { .. }) => Pendulum::from_task(task).map(drop),
        Some(AnalyticModel::Acrobot { .. }) => Acrobot::from_task(task).map(drop),
        Some(AnalyticModel::MountainCar { .. }) => MountainCar::from_task(task).map(drop),
        None => Ok(()),
    }
}

/// Checks what all analytic models require: no free bodies, no colliders, no passive forces, and no
/// actuators except joint forces.
fn require_common_properties(task: &BodyTask) -> Result<(), String> {
    require(
        !task.needs_own_worlds(),
        "an analytic model cannot have free bodies, colliders, or forces on bodies",
    )?;
    for Joint {
        name,
        passive_forces,
        ..
    } in &task.joints
    {
        require(
            *passive_forces == PassiveForces::default(),
            &format!(
                "an analytic model cannot have resistance: remove damping, friction, armature and stiffness from joint `{name}`"
            ),
        )?;
    }
    let has_only_joint_forces = task
        .actuators
        .iter()
        .all(|actuator| matches!(actuator.drive, Drive::JointForce(_)));
    require(
        has_only_joint_forces,
        "an analytic model can only have actuators of type `JointForce`",
    )
}

/// Like [`require_common_properties`], and also checks that there are no ranges and that no forces
/// act but gravity and actuators.
fn require_only_gravity(task: &BodyTask) -> Result<(), String> {
    require_common_properties(task)?;
    require(
        task.formula_forces.is_empty(),
        "this analytic model cannot have a joint `force`",
    )?;
    require(
        task.joints.iter().all(|joint| joint.range.is_none()),
        "this analytic model cannot have a joint `range`",
    )
}

/// An error with this message unless the condition holds.
fn require(condition: bool, message: &str) -> Result<(), String> {
    if condition {
        Ok(())
    } else {
        Err(message.to_owned())
    }
}

impl<E: EquationsOfMotion<N>, const N: usize> AnalyticDynamics<E, N> {
    fn new(equations: E, task: &BodyTask, copies: usize) -> Self {
        let joints = equations.joints();
        let drives = task.actuators.iter().map(|it| (it.drive, it.gear));
        let formula_drives = task.formula_forces.iter().map(|it| (it.drive, 1.0));
        Self {
            equations,
            joint_forces: drives
                .chain(formula_drives)
                .enumerate()
                .filter_map(|(control, (drive, gear))| {
                    JointForce::new(control, drive, gear, joints)
                })
                .collect(),
            tree: KinematicTree::new(task),
            copies,
            live: vec![[false; LANES]; copies.div_ceil(LANES)],
            states: vec![StateLanes::ZERO; copies.div_ceil(LANES)],
            columns: CoordinateColumns::new(N, copies),
        }
    }

    /// Positions, then velocities of one copy, in the order of the task's joints: `[2 N]`.
    fn row(&self, copy: usize) -> Vec<f64> {
        let mut row = vec![0.0; 2 * N];
        let state = self.states[copy / LANES].get(copy % LANES);
        for (i, joint) in self.equations.joints().into_iter().enumerate() {
            row[joint] = state.positions[i];
            row[N + joint] = state.velocities[i];
        }
        row
    }

    /// Sets positions and velocities of one copy, in the order of the task's joints: `[N]` each.
    fn set_row(&mut self, copy: usize, positions: &[f64], velocities: &[f64]) {
        let joints = self.equations.joints();
        let state = State {
            positions: joints.map(|joint| positions[joint]),
            velocities: joints.map(|joint| velocities[joint]),
        };
        self.states[copy / LANES].set(copy % LANES, &state);
        for joint in joints {
            let (position, velocity) = (positions[joint], velocities[joint]);
            self.columns
                .set(joint, copy, position as f32, velocity as f32);
        }
    }

    fn live_mut(&mut self, copy: usize) -> &mut bool {
        &mut self.live[copy / LANES][copy % LANES]
    }

    /// Advances the live copies of one group by one control step.
    #[inline(always)]
    fn advance_group(&mut self, group: usize, controls: &[f32]) {
        let live = self.live[group];
        let forces = self.force_lanes(group, controls);
        let before = self.states[group];
        let mut after = before;
        if live.iter().filter(|live| **live).count() > MAX_SINGLE_COPIES {
            advance_lanes(self.equations, &mut after, &forces);
        } else {
            for lane in (0..LANES).filter(|&lane| live[lane]) {
                let (start, forces) = (before.get(lane), of_lane(&forces, lane));
                after.set(
                    lane,
                    &advance::<Bounded, E, N>(self.equations, &start, forces),
                );
            }
        }
        for lane in (0..LANES).filter(|&lane| live[lane]) {
            if after.get(lane).velocities[0].is_nan() {
                let (start, forces) = (before.get(lane), of_lane(&forces, lane));
                after.set(lane, &advance_unbounded(self.equations, &start, forces));
            }
        }
        self.states[group].set_live(&after, live);
        self.update_columns(group);
    }

    /// Forces on the joints of the copies of one group.
    #[inline(always)]
    fn force_lanes(&self, group: usize, controls: &[f32]) -> [Lanes; N] {
        let mut forces = [[0.0; LANES]; N];
        for it in &self.joint_forces {
            let column = &controls[it.control * self.copies..][..self.copies];
            let lanes = &column[group * LANES..];
            for (force, control) in forces[it.joint].iter_mut().zip(lanes) {
                *force += it.gear * f64::from(*control);
            }
        }
        forces
    }

    /// Writes the states of one group to the coordinate columns.
    #[inline(always)]
    fn update_columns(&mut self, group: usize) {
        let lanes = &self.states[group];
        for (i, joint) in self.equations.joints().into_iter().enumerate() {
            let (positions, velocities) = self.columns.columns_mut(joint);
            for (lanes, column) in [
                (&lanes.positions[i], positions),
                (&lanes.velocities[i], velocities),
            ] {
                for (value, rounded) in lanes.iter().zip(&mut column[group * LANES..]) {
                    *rounded = *value as f32;
                }
            }
        }
    }
}

/// Advances all copies of a group by one control step. The equations are passed by value, so that
/// the compiler sees that the states do not change them; otherwise the loop over lanes would not
/// become SIMD instructions.
#[inline(always)]
fn advance_lanes<E: EquationsOfMotion<N>, const N: usize>(
    equations: E,
    states: &mut StateLanes<N>,
    forces: &[Lanes; N],
) {
    for _ in 0..equations.substeps() {
        for lane in 0..LANES {
            let end = equations.advance::<Bounded>(&states.get(lane), of_lane(forces, lane));
            states.set(lane, &end);
        }
    }
}

/// The state of one copy after one control step.
#[inline(always)]
fn advance<T: Trigonometry, E: EquationsOfMotion<N>, const N: usize>(
    equations: E,
    start: &State<N>,
    forces: [f64; N],
) -> State<N> {
    let mut state = *start;
    for _ in 0..equations.substeps() {
        state = equations.advance::<T>(&state, forces);
    }
    state
}

/// Like [`advance`], for a copy that turned further than [`Bounded`] allows.
#[cold]
#[inline(never)]
fn advance_unbounded<E: EquationsOfMotion<N>, const N: usize>(
    equations: E,
    start: &State<N>,
    forces: [f64; N],
) -> State<N> {
    advance::<Unbounded, E, N>(equations, start, forces)
}

/// The numbers of one copy. The lanes are passed by reference, because a copy of them within a loop
/// over lanes would keep that loop from becoming SIMD instructions.
#[inline(always)]
fn of_lane<const N: usize>(lanes: &[Lanes; N], lane: usize) -> [f64; N] {
    std::array::from_fn(|i| lanes[i][lane])
}

impl<const N: usize> StateLanes<N> {
    const ZERO: Self = Self {
        positions: [[0.0; LANES]; N],
        velocities: [[0.0; LANES]; N],
    };

    /// The state of one copy.
    #[inline(always)]
    fn get(&self, lane: usize) -> State<N> {
        State {
            positions: of_lane(&self.positions, lane),
            velocities: of_lane(&self.velocities, lane),
        }
    }

    /// Sets the state of one copy.
    #[inline(always)]
    fn set(&mut self, lane: usize, state: &State<N>) {
        for i in 0..N {
            self.positions[i][lane] = state.positions[i];
            self.velocities[i][lane] = state.velocities[i];
        }
    }

    /// Sets the states of the live copies.
    #[inline(always)]
    fn set_live(&mut self, new: &Self, live: [bool; LANES]) {
        for i in 0..N {
            for (lane, is_live) in live.into_iter().enumerate() {
                // Choosing a number and storing it always has no branch.
                let choose = |new, old| if is_live { new } else { old };
                self.positions[i][lane] = choose(new.positions[i][lane], self.positions[i][lane]);
                self.velocities[i][lane] =
                    choose(new.velocities[i][lane], self.velocities[i][lane]);
            }
        }
    }
}

/// One control step of all live copies.
struct ControlStep<'a, E, const N: usize> {
    dynamics: &'a mut AnalyticDynamics<E, N>,
    controls: &'a [f32],
}

impl<E: EquationsOfMotion<N>, const N: usize> WithSimd for ControlStep<'_, E, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for group in 0..self.dynamics.live.len() {
            if self.dynamics.live[group].contains(&true) {
                self.dynamics.advance_group(group, self.controls);
            }
        }
    }
}

impl<E: EquationsOfMotion<N>, const N: usize> Dynamics for AnalyticDynamics<E, N> {
    fn start(&mut self, copy: usize, positions: &[f64], velocities: &[f64]) {
        self.set_row(copy, positions, velocities);
        *self.live_mut(copy) = true;
    }

    fn stop(&mut self, copy: usize) {
        *self.live_mut(copy) = false;
    }

    fn step(&mut self, controls: &[f32]) {
        Arch::new().dispatch(ControlStep {
            dynamics: self,
            controls,
        });
    }

    fn coordinates(&self) -> &CoordinateColumns {
        &self.columns
    }

    fn poses(&self, copy: usize, poses: &mut [Pose]) {
        let row = self.row(copy);
        let (positions, velocities) = row.split_at(N);
        let mut frames = self.tree.frame_buffer();
        self.tree.compute_frames(positions, velocities, &mut frames);
        for (pose, frame) in poses.iter_mut().zip(&frames) {
            *pose = Pose::from(frame);
        }
    }

    fn save(&self, copy: usize) -> Vec<u8> {
        to_bytes(&(self.live[copy / LANES][copy % LANES], self.row(copy)))
    }

    fn restore(&mut self, copy: usize, bytes: &[u8]) -> Result<(), String> {
        let (live, row): (bool, Vec<f64>) = from_bytes(bytes)?;
        if row.len() != 2 * N {
            return Err(OTHER_BODIES.to_owned());
        }
        let (positions, velocities) = row.split_at(N);
        self.set_row(copy, positions, velocities);
        *self.live_mut(copy) = live;
        Ok(())
    }
}

impl JointForce {
    /// `joints`: the task's index of each joint of the equations.
    fn new<const N: usize>(
        control: usize,
        drive: Drive,
        gear: f64,
        joints: [usize; N],
    ) -> Option<Self> {
        let Drive::JointForce(driven) = drive else {
            return None;
        };
        let joint = joints.iter().position(|joint| *joint == driven)?;
        Some(Self {
            control,
            joint,
            gear,
        })
    }
}

impl From<&Frame> for Pose {
    fn from(frame: &Frame) -> Self {
        let [x, y] = frame.position.map(|value| value as f32);
        Self {
            x,
            y,
            angle: frame.angle as f32,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use proptest::prelude::*;

    use super::*;
    use crate::load;

    fn task(name: &str) -> BodyTask {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../envs/{name}.ron"));
        load(&path).unwrap().body_task().unwrap().clone()
    }

    /// The bits of the coordinates of all copies after `steps` control steps from `starts`, each the
    /// positions and then the velocities of one copy: all copies in one batch of dynamics, or each
    /// in dynamics of its own.
    fn bits(task: &BodyTask, starts: &[Vec<f64>], together: bool, steps: usize) -> Vec<Vec<u32>> {
        let joints = task.joints.len();
        let run = |starts: &[Vec<f64>]| {
            let mut dynamics = build(task, starts.len()).unwrap();
            for (copy, start) in starts.iter().enumerate() {
                dynamics.start(copy, &start[..joints], &start[joints..]);
            }
            let controls = vec![0.75; task.actuators.len() * starts.len()];
            let formula_forces = vec![0.001; task.formula_forces.len() * starts.len()];
            let controls = [controls, formula_forces].concat();
            (0..steps).for_each(|_| dynamics.step(&controls));
            let row = |copy| dynamics.coordinates().row(copy);
            (0..starts.len())
                .map(|copy| {
                    let numbers = row(copy).into_iter().flat_map(|(q, v)| [q, v]);
                    numbers.map(f32::to_bits).collect()
                })
                .collect::<Vec<Vec<u32>>>()
        };
        if together {
            run(starts)
        } else {
            starts.chunks(1).flat_map(run).collect()
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// SIMD lanes, copies that are advanced one by one, and copies that turned beyond the bound
        /// of [`Bounded`] have the bits of a copy alone.
        #[test]
        fn copies_have_the_same_bits_together_and_alone(
            starts in prop::collection::vec(
                (
                    prop::collection::vec(-4.0_f64..4.0, 4),
                    prop::sample::select(vec![0.0, 0.0, 0.0, 1e5, 1e6, -1e6, 1e9]),
                ),
                1..35,
            ),
        ) {
            for name in ["cartpole", "cartpole_gym", "cartpole_swingup", "acrobot", "pendulum", "mountain_car_continuous"] {
                let task = task(name);
                let joints = task.joints.len();
                let starts: Vec<_> = starts
                    .iter()
                    .map(|(start, turns)| {
                        let mut start = start[..2 * joints].to_vec();
                        start[joints - 1] += turns;
                        start
                    })
                    .collect();
                prop_assert_eq!(bits(&task, &starts, true, 3), bits(&task, &starts, false, 3), "{}", name);
            }
        }
    }

    /// A control step in SIMD lanes has the bits of the equations' own Runge–Kutta steps, which are
    /// compiled without SIMD instructions.
    #[test]
    fn lanes_have_the_bits_of_scalar_equations() {
        let task = task("pendulum");
        let equations = Pendulum::from_task(&task).unwrap();
        let mut dynamics = build(&task, LANES).unwrap();
        let starts: Vec<[f64; 2]> = (0..LANES)
            .map(|copy| [0.7 * copy as f64 - 2.0, 1.0 - copy as f64])
            .collect();
        for (copy, [position, velocity]) in starts.iter().enumerate() {
            dynamics.start(copy, &[*position], &[*velocity]);
        }
        dynamics.step(&[0.5; LANES]);
        let (substeps, gear) = (equations.substeps(), task.actuators[0].gear);
        let duration = task.spec.control_step / f64::from(substeps);
        for (copy, start) in starts.into_iter().enumerate() {
            let [position, velocity] = (0..substeps).fold(start, |state, _| {
                equations.runge_kutta(state, gear * 0.5, duration)
            });
            assert_eq!(
                dynamics.coordinates().get(0, copy),
                (position as f32, velocity as f32)
            );
        }
    }
}
