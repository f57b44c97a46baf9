//! Rigid bodies: the sole importer of Rapier and Parry.
//!
//! Tasks whose copies need worlds of their own are `contact`'s. M copies of any other stand in one world at the same place, so that one step of the solver serves them all, four in a vector;
//! without colliders nothing of one copy can meet another. (Offsetting the copies would round their coordinates differently.)
//! Numbers cross to Rapier's types in this folder only. Observations, rewards and agents may not enter.

mod batch;
mod body;
mod contact;
mod drive;
mod geometry;
mod joint;
mod shape;

use rapier2d::prelude::{RigidBody, Vector};
use serde::{Deserialize, Serialize};

use self::batch::Batch;
use self::body::{Rotor, SavedBody};
pub use self::contact::ContactWorlds;
use self::drive::Drive;
pub use self::geometry::Geometry;
use self::joint::Hold;
pub use self::shape::inertial;
use super::Pose;
use super::description::{self, Description, Field, Servo, Target};
use super::dynamics::{Dynamics, JointColumns, from_bytes, to_bytes};
use super::kinematics::{Frame, Tree};

/// M copies of a task as rigid bodies in Rapier worlds.
pub struct RigidBodies {
    plan: Plan,
    batches: Vec<Batch>,
    /// Copies in each batch but the last.
    batch_size: usize,
    tree: Tree,
    frames: Vec<Frame>,
    columns: JointColumns,
}

/// What all copies have in common.
struct Plan {
    /// Bodies in one copy.
    bodies: usize,
    /// One a joint.
    holds: Vec<Hold>,
    /// What resists motion.
    passive: Vec<Drive>,
    /// One for each control.
    motors: Vec<Motor>,
    /// Motors that are constraints, in the order of their numbers.
    servos: Vec<Drive>,
    /// One a body: what turns with it.
    rotors: Vec<Rotor>,
    /// Bodies that motors push: their forces are set anew in each step.
    driven: Vec<usize>,
    /// Centres of mass in the bodies' frames.
    coms: Vec<[f64; 2]>,
}

/// What a control does.
struct Motor {
    joint: usize,
    gear: f32,
    kind: MotorKind,
}

enum MotorKind {
    /// Pushes the joint.
    Force,
    /// Tells the servo of this number where to go.
    Servo(usize, Target),
    /// Does nothing by itself.
    Idle,
}

/// All that Rapier carries from one step to the next for bodies without contacts.
#[derive(Serialize, Deserialize)]
struct SavedState {
    columns: JointColumns,
    live: Vec<bool>,
    bodies: Vec<SavedBody>,
}

impl RigidBodies {
    /// Builds `copies` copies of a task, none of them live.
    #[must_use]
    pub fn new(description: &Description, copies: usize) -> Self {
        let tree = Tree::new(description);
        let plan = Plan::new(description, &tree);
        let batch_size = plan.batch_size(copies);
        let starts = (0..copies).step_by(batch_size);
        Self {
            batches: starts
                .map(|first| Batch::new(description, &plan, batch_size.min(copies - first)))
                .collect(),
            batch_size,
            frames: tree.frames(),
            columns: JointColumns::new(description.joints.len(), copies),
            tree,
            plan,
        }
    }

    /// The bodies of one copy.
    fn bodies(&self, copy: usize) -> impl Iterator<Item = &RigidBody> {
        self.batches[copy / self.batch_size].bodies(copy % self.batch_size, &self.plan)
    }
}

impl Dynamics for RigidBodies {
    fn start(&mut self, copy: usize, positions: &[f64], velocities: &[f64]) {
        self.tree.place(positions, velocities, &mut self.frames);
        self.batches[copy / self.batch_size].start(
            copy % self.batch_size,
            &self.frames,
            &self.plan,
        );
        for (joint, (&position, &velocity)) in positions.iter().zip(velocities).enumerate() {
            self.columns
                .set(joint, copy, position as f32, velocity as f32);
        }
    }

    fn stop(&mut self, copy: usize) {
        self.batches[copy / self.batch_size].live[copy % self.batch_size] = false;
    }

    fn step(&mut self, controls: &[f32]) {
        for (index, batch) in self.batches.iter_mut().enumerate() {
            batch.step(
                index * self.batch_size,
                controls,
                &mut self.columns,
                &self.plan,
            );
        }
    }

    fn joints(&self) -> &JointColumns {
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

    fn save(&self) -> Vec<u8> {
        let state = SavedState {
            columns: self.columns.clone(),
            live: self
                .batches
                .iter()
                .flat_map(|batch| batch.live.iter().copied())
                .collect(),
            bodies: (0..self.columns.copies())
                .flat_map(|copy| self.bodies(copy))
                .map(SavedBody::of)
                .collect(),
        };
        to_bytes(&state)
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let state: SavedState = from_bytes(bytes)?;
        let copies = self.columns.copies();
        let fits = state.columns.same_shape(&self.columns)
            && state.live.len() == copies
            && state.bodies.len() == copies * self.plan.bodies;
        if !fits {
            return Err("the state is of other bodies or another number of copies".to_owned());
        }
        for (copy, bodies) in state.bodies.chunks_exact(self.plan.bodies).enumerate() {
            self.batches[copy / self.batch_size].restore(
                copy % self.batch_size,
                bodies,
                state.live[copy],
            );
        }
        self.columns = state.columns;
        Ok(())
    }
}

impl Plan {
    fn new(description: &Description, tree: &Tree) -> Self {
        let holds: Vec<_> = tree
            .links()
            .iter()
            .enumerate()
            .map(|(joint, link)| Hold::new(link, leaf_range(description, joint)))
            .collect();
        let (motors, servos) = motors(description);
        let mut driven: Vec<_> = motors
            .iter()
            .filter(|motor| motor.pushes())
            .flat_map(|motor| holds[motor.joint].bodies())
            .collect();
        driven.sort_unstable();
        driven.dedup();
        Self {
            bodies: description.bodies.len(),
            passive: Drive::passive(description, &holds),
            holds,
            motors,
            servos: servos.iter().map(Drive::servo).collect(),
            rotors: (0..description.bodies.len())
                .map(|body| Rotor::of(description, body))
                .collect(),
            driven,
            coms: description
                .bodies
                .iter()
                .map(|body| body.inertial.com)
                .collect(),
        }
    }

    /// How many copies share a world: all, if all of Rapier's joints are hinges. Rapier solves joints in vectors from 64 joints
    /// on, and vectors of others round otherwise than single joints do: their copies would not keep their bits.
    fn batch_size(&self, copies: usize) -> usize {
        const VECTORS_FROM: usize = 64;
        let held = self.holds.iter().filter(|hold| hold.is_joint());
        let drives = self.passive.len() + self.servos.len();
        let alike = drives == 0 && held.clone().all(Hold::is_hinge);
        let most = if alike {
            copies
        } else {
            (VECTORS_FROM - 1) / (held.count() + drives)
        };
        most.clamp(1, copies.max(1))
    }
}

/// The range of a joint whose child carries no other joint.
fn leaf_range(description: &Description, joint: usize) -> Option<[f64; 2]> {
    let described = &description.joints[joint];
    let carries = description
        .joints
        .iter()
        .any(|other| other.parent == Some(described.child));
    described.range.filter(|_| !carries)
}

/// What actuators and fields do, and the servos among them.
fn motors(description: &Description) -> (Vec<Motor>, Vec<Servo>) {
    let mut servos = Vec::new();
    let mut motors = Vec::new();
    for actuator in &description.actuators {
        let (joint, kind) = match actuator.drive {
            description::Drive::JointForce(joint) => (joint, MotorKind::Force),
            description::Drive::Servo(servo) => {
                servos.push(servo);
                (
                    servo.joint,
                    MotorKind::Servo(servos.len() - 1, servo.target),
                )
            }
            description::Drive::Nothing | description::Drive::BodyForce { .. } => {
                (0, MotorKind::Idle)
            }
        };
        motors.push(Motor {
            joint,
            gear: actuator.gear as f32,
            kind,
        });
    }
    let on_joint = |field: &Field| match field.drive {
        description::Drive::JointForce(joint) => Some(Motor {
            joint,
            gear: 1.0,
            kind: MotorKind::Force,
        }),
        _ => None,
    };
    motors.extend(description.fields.iter().filter_map(on_joint));
    (motors, servos)
}

impl Motor {
    fn pushes(&self) -> bool {
        matches!(self.kind, MotorKind::Force)
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
    use crate::env::load;
    use crate::random::{Purpose, stream};

    /// Bodies are where the joint coordinates put them, with the velocities that these imply: reading inverts placing.
    #[test]
    fn joint_coordinates_survive_the_way_through_the_bodies() {
        for file in ["envs/cartpole.ron", "tests/envs/crane.ron"] {
            let task = load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(file)).unwrap();
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
                bodies.batches[0].read_joints(0, &mut bodies.columns, &bodies.plan);
                for joint in 0..joints {
                    let (position, velocity) = bodies.joints().get(joint, 0);
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
}
