//! Rigid bodies: the only module that imports Rapier and Parry.
//!
//! Tasks whose copies need worlds of their own are simulated by `contact`. Copies of all other
//! tasks share a world, so that Rapier can solve four of them at once in SIMD lanes. They are all
//! at the same place, where nothing touches because there are no colliders; moving them apart would
//! change how their coordinates are rounded. This module must not depend on observations, rewards
//! or agents.

mod batch;
mod body;
mod constraint;
mod contact;
mod geometry;
mod joint;
mod shape;
mod turns;

use rapier2d::prelude::{RigidBody, Vector};
use serde::{Deserialize, Serialize};

use self::batch::Batch;
use self::body::{Rotor, SavedBody};
use self::constraint::CoordinateConstraint;
pub use self::contact::ContactWorlds;
pub(crate) use self::contact::depth;
pub use self::geometry::Geometry;
pub(crate) use self::geometry::check_surface;
use self::joint::RapierJoint;
pub use self::shape::inertial;
use self::turns::FarTurns;
use super::Pose;
use super::description::{self, BodyTask, FormulaForce, Servo, ServoTarget};
use super::dynamics::{CoordinateColumns, Dynamics, OTHER_BODIES, from_bytes, to_bytes};
use super::kinematics::{Frame, KinematicTree, Link};

/// M copies of a task as rigid bodies in Rapier worlds.
pub struct RigidBodies {
    template: CopyTemplate,
    batches: Vec<Batch>,
    /// Number of copies in each batch except the last.
    batch_size: usize,
    tree: KinematicTree,
    frames: Vec<Frame>,
    columns: CoordinateColumns,
    /// `None` if nothing turns.
    far_turns: Option<FarTurns>,
}

/// Data that all copies of a task share.
struct CopyTemplate {
    /// Number of bodies per copy.
    body_count: usize,
    /// One per joint.
    joints: Vec<RapierJoint>,
    /// Ranges, springs, dampers and frictions.
    passive_constraints: Vec<CoordinateConstraint>,
    /// One per control.
    control_inputs: Vec<ControlInput>,
    /// Servos, in the order of their indices in [`ControlEffect`].
    servos: Vec<CoordinateConstraint>,
    /// One per body: the armature of its joint.
    rotors: Vec<Rotor>,
    /// Indices of the bodies that controls push. Their forces are reset before new ones are set.
    pushed_bodies: Vec<usize>,
    /// Whether forces on bodies depend on more than the controls.
    pushes_depend_on_poses: bool,
    /// Steps of Rapier per control step.
    steps: u32,
    /// Centers of mass in the bodies' frames.
    coms: Vec<[f64; 2]>,
}

/// What a control acts on.
struct ControlInput {
    joint: usize,
    gear: f32,
    effect: ControlEffect,
}

enum ControlEffect {
    /// Pushes the joint.
    Force,
    /// Sets the target of the servo with this index.
    Servo(usize, ServoTarget),
    /// Does nothing by itself.
    Nothing,
}

/// The state of one copy, which a checkpoint stores.
#[derive(Serialize, Deserialize)]
struct SavedCopy {
    /// Position and velocity of each joint.
    row: Vec<(f32, f32)>,
    live: bool,
    /// None if its steps are not computed in a shared world: where the bodies are follows from `row`.
    bodies: Vec<SavedBody>,
}

impl RigidBodies {
    /// Builds `copies` copies of a task. None of them moves until it is started.
    #[must_use]
    pub fn new(task: &BodyTask, copies: usize) -> Self {
        let template = CopyTemplate::new(task);
        let batch_size = template.batch_size(copies);
        Self::with_batch_size(task, template, copies, batch_size)
    }

    fn with_batch_size(
        task: &BodyTask,
        template: CopyTemplate,
        copies: usize,
        batch_size: usize,
    ) -> Self {
        let tree = KinematicTree::new(task);
        let starts = (0..copies).step_by(batch_size);
        Self {
            batches: starts
                .map(|first| Batch::new(task, &template, batch_size.min(copies - first)))
                .collect(),
            batch_size,
            frames: tree.frame_buffer(),
            columns: CoordinateColumns::new(task.joints.len(), copies),
            far_turns: FarTurns::new(task, &template.joints, copies),
            tree,
            template,
        }
    }

    /// Places the bodies of a copy where its joints are at these positions and velocities.
    fn place(&mut self, copy: usize, positions: &[f64], velocities: &[f64]) {
        self.tree
            .compute_frames(positions, velocities, &mut self.frames);
        self.batches[copy / self.batch_size].start(
            copy % self.batch_size,
            &self.frames,
            &self.template,
        );
    }

    fn is_live(&self, copy: usize) -> bool {
        self.batches[copy / self.batch_size].live[copy % self.batch_size]
    }

    /// Computes the steps again in which joints turn too fast or too far for the shared worlds.
    fn repeat_far_turns(&mut self, controls: &[f32]) {
        let Some(mut far_turns) = self.far_turns.take() else {
            return;
        };
        for copy in 0..self.columns.copies() {
            if self.is_live(copy) && far_turns.step(copy, controls, &mut self.columns) {
                self.stop_at_walls(copy);
                self.place_at_columns(copy);
            }
        }
        self.far_turns = Some(far_turns);
    }

    fn set_far(&mut self, copy: usize, is_far: bool) {
        if let Some(far_turns) = &mut self.far_turns {
            far_turns.set_far(copy, is_far);
        }
    }

    fn is_far(&self, copy: usize) -> bool {
        let far_turns = self.far_turns.as_ref();
        far_turns.is_some_and(|far_turns| far_turns.is_far(copy))
    }

    /// Stops the joints of a copy that have inelastic walls, as [`Batch::step`] does.
    fn stop_at_walls(&mut self, copy: usize) {
        for (index, joint) in self.template.joints.iter().enumerate() {
            let Some([low, high]) = joint.walls() else {
                continue;
            };
            let (position, _) = self.columns.get(index, copy);
            if position < low || position > high {
                self.columns
                    .set(index, copy, position.clamp(low, high), 0.0);
            }
        }
    }

    /// Places the bodies of a copy where its coordinates say, if these are finite.
    fn place_at_columns(&mut self, copy: usize) {
        let row = self.columns.row(copy);
        if row.iter().all(|(q, v)| q.is_finite() && v.is_finite()) {
            let (positions, velocities): (Vec<_>, Vec<_>) = row
                .into_iter()
                .map(|(q, v)| (f64::from(q), f64::from(v)))
                .unzip();
            self.place(copy, &positions, &velocities);
        }
    }

    /// The bodies of one copy.
    fn bodies(&self, copy: usize) -> impl Iterator<Item = &RigidBody> {
        self.batches[copy / self.batch_size].bodies(copy % self.batch_size, &self.template)
    }
}

impl Dynamics for RigidBodies {
    fn start(&mut self, copy: usize, positions: &[f64], velocities: &[f64]) {
        self.place(copy, positions, velocities);
        self.set_far(copy, false);
        for (joint, (&position, &velocity)) in positions.iter().zip(velocities).enumerate() {
            self.columns
                .set(joint, copy, position as f32, velocity as f32);
        }
    }

    fn stop(&mut self, copy: usize) {
        self.batches[copy / self.batch_size].live[copy % self.batch_size] = false;
    }

    fn step(&mut self, controls: &[f32]) {
        if let Some(far_turns) = &mut self.far_turns {
            far_turns.begin_step(&self.columns);
        }
        for (index, batch) in self.batches.iter_mut().enumerate() {
            batch.step(
                index * self.batch_size,
                controls,
                &mut self.columns,
                &self.template,
            );
        }
        self.repeat_far_turns(controls);
    }

    fn coordinates(&self) -> &CoordinateColumns {
        &self.columns
    }

    fn poses(&self, copy: usize, poses: &mut [Pose]) {
        for (pose, body) in poses.iter_mut().zip(self.bodies(copy)) {
            let [x, y] = body.translation().to_array();
            *pose = Pose {
                x,
                y,
                angle: body.rotation().angle(),
            };
        }
    }

    fn save(&self, copy: usize) -> Vec<u8> {
        to_bytes(&SavedCopy {
            row: self.columns.row(copy),
            live: self.is_live(copy),
            bodies: if self.is_far(copy) {
                Vec::new()
            } else {
                self.bodies(copy).map(SavedBody::from_body).collect()
            },
        })
    }

    fn restore(&mut self, copy: usize, bytes: &[u8]) -> Result<(), String> {
        let saved: SavedCopy = from_bytes(bytes)?;
        let is_far = saved.bodies.is_empty() && self.far_turns.is_some();
        if saved.bodies.len() != self.template.body_count && !is_far {
            return Err(OTHER_BODIES.to_owned());
        }
        self.columns.set_row(copy, &saved.row)?;
        if is_far {
            self.place_at_columns(copy);
        }
        self.set_far(copy, is_far);
        let batch = &mut self.batches[copy / self.batch_size];
        batch.restore(copy % self.batch_size, &saved.bodies, saved.live);
        Ok(())
    }
}

impl CopyTemplate {
    fn new(task: &BodyTask) -> Self {
        // If a body has several joints, they are slides of the world here, none of which moves another.
        let joints: Vec<_> = task
            .joints
            .iter()
            .enumerate()
            .map(|(index, joint)| {
                RapierJoint::new(&Link::alone(joint, task), leaf_range(task, index))
            })
            .collect();
        let (control_inputs, servos) = control_inputs(task);
        let mut pushed_bodies: Vec<_> = control_inputs
            .iter()
            .filter(|input| input.is_force())
            .flat_map(|input| joints[input.joint].bodies())
            .collect();
        pushed_bodies.sort_unstable();
        pushed_bodies.dedup();
        Self {
            body_count: task.bodies.len(),
            passive_constraints: CoordinateConstraint::all_passive(task, &joints),
            pushes_depend_on_poses: control_inputs
                .iter()
                .any(|input| input.is_force() && joints[input.joint].push_depends_on_poses()),
            steps: task.steps_and_substeps(1)[0],
            joints,
            control_inputs,
            servos: servos
                .iter()
                .map(|servo| CoordinateConstraint::servo(servo, task))
                .collect(),
            rotors: (0..task.bodies.len())
                .map(|body| Rotor::of_body(task, body))
                .collect(),
            pushed_bodies,
            coms: task.bodies.iter().map(|body| body.inertial.com).collect(),
        }
    }

    /// Number of copies that share a world. If all of Rapier's joints are plain hinges, all copies
    /// share one, because hinges round in the same way alone and in SIMD lanes. Other joints do
    /// not: with them, the bits of a copy would depend on the number of copies. Their worlds
    /// therefore have too few joints for SIMD.
    fn batch_size(&self, copies: usize) -> usize {
        let joints = self.joints.iter().filter(|joint| joint.is_constraint());
        let constraints = self.passive_constraints.len() + self.servos.len();
        let only_hinges = constraints == 0 && joints.clone().all(RapierJoint::is_hinge);
        let max_copies = if only_hinges {
            copies
        } else {
            (MIN_JOINTS_FOR_SIMD - 1) / (joints.count() + constraints)
        };
        max_copies.clamp(1, copies.max(1))
    }
}

/// Number of joints in a world from which on Rapier may solve some of them in SIMD lanes.
///
/// Rapier groups joints by color, such that joints of one color share no moving body, and solves a
/// color in SIMD lanes if it has at least `min_color_joints = JOINT_BATCH * LAYOUT_REF_WORKERS / 2`
/// = 16 × 8 / 2 joints. These constants are private: see `StagedIslandSolver::init_joints` in
/// `src/dynamics/solver/staged_island_solver/joints.rs` of rapier2d 0.36. That a copy's bits do not
/// depend on the other copies rests on this number, so that a test below fails if Rapier changes
/// it.
const MIN_JOINTS_FOR_SIMD: usize = 64;

/// The range, with hard ends, of a joint whose child is no joint's parent.
fn leaf_range(task: &BodyTask, joint: usize) -> Option<[f64; 2]> {
    let described = &task.joints[joint];
    let is_parent = task
        .joints
        .iter()
        .any(|other| other.parent == Some(described.child));
    described
        .range
        .filter(|_| !is_parent && described.range_softness.is_none())
}

/// What actuators and formula forces act on, and the servos among them.
fn control_inputs(task: &BodyTask) -> (Vec<ControlInput>, Vec<Servo>) {
    let mut servos = Vec::new();
    let mut inputs = Vec::new();
    for actuator in &task.actuators {
        let (joint, effect) = match actuator.drive {
            description::Drive::JointForce(joint) => (joint, ControlEffect::Force),
            description::Drive::Servo(servo) => {
                servos.push(servo);
                (
                    servo.joint,
                    ControlEffect::Servo(servos.len() - 1, servo.target),
                )
            }
            description::Drive::Nothing
            | description::Drive::BodyForce { .. }
            | description::Drive::BodyTorque { .. } => (0, ControlEffect::Nothing),
        };
        inputs.push(ControlInput {
            joint,
            gear: actuator.gear as f32,
            effect,
        });
    }
    let on_joint = |force: &FormulaForce| match force.drive {
        description::Drive::JointForce(joint) => Some(ControlInput {
            joint,
            gear: 1.0,
            effect: ControlEffect::Force,
        }),
        _ => None,
    };
    inputs.extend(task.formula_forces.iter().filter_map(on_joint));
    (inputs, servos)
}

impl ControlInput {
    fn is_force(&self) -> bool {
        matches!(self.effect, ControlEffect::Force)
    }
}

fn vector(a: [f64; 2]) -> Vector {
    Vector::new(a[0] as f32, a[1] as f32)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use rand::RngExt;

    use super::*;
    use crate::description::TaskDescription;
    use crate::{load, parse};
    use seedbed_random::{Purpose, stream};

    fn task(file: &str) -> BodyTask {
        let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        body_task(&load(&repository.join(file)).unwrap())
    }

    fn body_task(description: &TaskDescription) -> BodyTask {
        description.body_task().unwrap().clone()
    }

    /// Placing bodies at given joint coordinates and reading the coordinates back gives the same
    /// positions and velocities.
    #[test]
    fn coordinates_of_placed_bodies_are_read_back() {
        for file in [
            "envs/cartpole.ron",
            "crates/seedbed-env/tests/envs/crane.ron",
        ] {
            let task = task(file);
            let (mut bodies, joints) = (RigidBodies::new(&task, 1), task.joints.len());
            let mut random = stream(0, Purpose::Preview, 0, 0);
            for _ in 0..100 {
                let mut draw = || {
                    (0..joints)
                        .map(|_| random.random_range(-2.5_f64..2.5))
                        .collect::<Vec<_>>()
                };
                let (positions, velocities) = (draw(), draw());
                bodies.start(0, &positions, &velocities);
                bodies.batches[0].read_joints(0, &mut bodies.columns, &bodies.template);
                for joint in 0..joints {
                    let (position, velocity) = bodies.coordinates().get(joint, 0);
                    assert!(
                        (f64::from(position) - positions[joint]).abs() < 2e-6,
                        "{joint}: {position}, {positions:?}"
                    );
                    assert!(
                        (f64::from(velocity) - velocities[joint]).abs() < 1e-5,
                        "{joint}: {velocity}, {velocities:?}"
                    );
                }
            }
        }
    }

    /// The bits of position and velocity after 50 steps: `[copies]`, in worlds of `batch_size`
    /// copies.
    fn coordinate_bits(task: &BodyTask, copies: usize, batch_size: usize) -> Vec<[u32; 2]> {
        let template = CopyTemplate::new(task);
        let mut bodies = RigidBodies::with_batch_size(task, template, copies, batch_size);
        for copy in 0..copies {
            let position = 0.1 + 0.01 * copy as f64;
            bodies.start(copy, &[position], &[0.3]);
        }
        for _ in 0..50 {
            bodies.step(&vec![0.0; copies]);
        }
        (0..copies)
            .map(|copy| {
                let (position, velocity) = bodies.coordinates().get(0, copy);
                [position.to_bits(), velocity.to_bits()]
            })
            .collect()
    }

    /// A task of one Rapier joint that is not a hinge: a slide along a slope.
    fn slope() -> BodyTask {
        let text = r#"Environment(
            description: "A sledge on a slope.", gravity: (0.0, -9.81), control_step: 0.02, time_limit: 100,
            bodies: [(name: "sledge", mass: 1.0, geoms: [Ball(radius: 0.1)])],
            joints: [(name: "slope", parent: "world", child: "sledge", type: Slide(axis: (1.0, 0.7)))],
            actuators: [(name: "push", type: JointForce("slope"), control: Continuous(-1.0, 1.0))],
            sensors: [(name: "x", type: JointPosition("slope"))],
            observations: [(name: "x", range: (-1.0, 1.0))],
            reward: "0",
        )"#;
        body_task(&parse("slope", "slope", text.to_owned()).unwrap())
    }

    /// If this fails, Rapier has changed `min_color_joints`: set [`MIN_JOINTS_FOR_SIMD`] to it.
    #[test]
    fn few_joints_are_not_solved_in_simd_lanes() {
        let task = slope();
        let alone = coordinate_bits(&task, MIN_JOINTS_FOR_SIMD, 1);
        assert_eq!(
            coordinate_bits(&task, MIN_JOINTS_FOR_SIMD - 1, MIN_JOINTS_FOR_SIMD - 1),
            alone[..MIN_JOINTS_FOR_SIMD - 1],
            "fewer joints must be solved one by one"
        );
    }
}
