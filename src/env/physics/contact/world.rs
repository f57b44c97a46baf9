//! One copy of a task in a world of its own.

use std::f32::consts::TAU;

use rapier2d::prelude::{
    BroadPhaseBvh, CCDSolver, IslandManager, NarrowPhase, PhysicsPipeline, PhysicsWorld, Pose,
    Rotation, Vector,
};
use serde::{Deserialize, Serialize};

use super::super::vector;
use super::build::Pristine;
use super::link::Root;
use crate::env::dynamics::JointColumns;
use crate::env::kinematics::Frame;
use crate::env::{Force, ForceSource};

/// One copy.
#[derive(Serialize, Deserialize)]
pub(super) struct World {
    world: PhysicsWorld,
    /// Whether it moves.
    pub(super) live: bool,
}

impl World {
    pub(super) fn new(pristine: &Pristine) -> Self {
        let mut world = PhysicsWorld::new();
        world.gravity = pristine.gravity;
        world.integration_parameters = pristine.parameters;
        world.bodies = pristine.bodies.clone();
        world.colliders = pristine.colliders.clone();
        world.multibody_joints = pristine.multibody_joints.clone();
        Self { world, live: false }
    }

    /// Starts as a fresh build would: all that Rapier remembers is replaced.
    pub(super) fn start(
        &mut self,
        pristine: &Pristine,
        frames: &[Frame],
        positions: &[f64],
        velocities: &[f64],
    ) {
        self.world.bodies.clone_from(&pristine.bodies);
        self.world.colliders.clone_from(&pristine.colliders);
        self.world
            .multibody_joints
            .clone_from(&pristine.multibody_joints);
        self.world.islands = IslandManager::new();
        self.world.broad_phase = BroadPhaseBvh::new();
        self.world.narrow_phase = NarrowPhase::new();
        self.world.ccd_solver = CCDSolver::new();
        self.world.physics_pipeline = PhysicsPipeline::new();
        self.place_bodies(pristine, frames);
        pristine
            .links
            .iter()
            .zip(positions.iter().zip(velocities))
            .for_each(|(link, (&position, &velocity))| {
                link.place(
                    position as f32,
                    velocity as f32,
                    &mut self.world.multibody_joints,
                );
            });
        self.place_roots(pristine, frames);
        self.take_in_changes();
        self.live = true;
    }

    fn place_bodies(&mut self, pristine: &Pristine, frames: &[Frame]) {
        for ((&handle, frame), &com) in pristine.handles.iter().zip(frames).zip(&pristine.coms) {
            let body = &mut self.world.bodies[handle];
            let rotation = Rotation::from_cos_sin_unchecked(
                frame.rotation[0] as f32,
                frame.rotation[1] as f32,
            );
            let center = frame.point(com);
            body.set_position(Pose::from_parts(vector(center), rotation), false);
            body.set_linvel(vector(frame.velocity_at(center)), false);
            body.set_angvel(frame.angular_velocity as f32, false);
        }
    }

    fn place_roots(&mut self, pristine: &Pristine, frames: &[Frame]) {
        for root in pristine.roots.iter().filter(|root| root.is_linked) {
            let (frame, com) = (&frames[root.body], pristine.coms[root.body]);
            Root::place(
                frame,
                com,
                pristine.handles[root.body],
                &mut self.world.multibody_joints,
            );
        }
        let Self { world, .. } = self;
        for &index in &pristine.multibodies {
            let Some(multibody) = world.multibody_joints.get_multibody_mut(index) else {
                continue;
            };
            multibody.forward_kinematics(&world.bodies, false);
            multibody.update_rigid_bodies(&mut world.bodies, true);
        }
    }

    /// Lets Rapier take in what is new without time passing.
    fn take_in_changes(&mut self) {
        let duration = std::mem::take(&mut self.world.integration_parameters.dt);
        self.world.step();
        self.world.integration_parameters.dt = duration;
    }

    /// One control step. `controls`: `[actuators × copies]`
    pub(super) fn step(
        &mut self,
        pristine: &Pristine,
        copy: usize,
        controls: &[f32],
        copies: usize,
    ) {
        for _ in 0..pristine.searches {
            self.push(pristine, copy, controls, copies);
            self.world.step();
        }
    }

    fn push(&mut self, pristine: &Pristine, copy: usize, controls: &[f32], copies: usize) {
        for &handle in &pristine.handles {
            let body = &mut self.world.bodies[handle];
            body.reset_forces(false);
            body.reset_torques(false);
        }
        for (index, motor) in pristine.motors.iter().enumerate() {
            let control = controls[index * copies + copy];
            motor.push(
                control,
                pristine,
                &mut self.world.bodies,
                &mut self.world.multibody_joints,
            );
        }
    }

    /// Writes the coordinates into their columns. Of all angles that differ by full turns, the one nearest to the one before.
    pub(super) fn read(&self, pristine: &Pristine, copy: usize, columns: &mut JointColumns) {
        for (index, link) in pristine.links.iter().enumerate() {
            let (position, velocity) = link.read(&self.world.multibody_joints);
            columns.set(index, copy, position, velocity);
        }
        for (index, root) in pristine.roots.iter().enumerate() {
            let first = pristine.links.len() + 3 * index;
            let (before, _) = columns.get(first + 2, copy);
            let body = &self.world.bodies[pristine.handles[root.body]];
            let moving = root.moving(
                body,
                pristine.handles[root.body],
                &self.world.multibody_joints,
            );
            let angle = moving.angle + TAU * ((before - moving.angle) / TAU).round();
            columns.set(first, copy, moving.position.x, moving.velocity.x);
            columns.set(first + 1, copy, moving.position.y, moving.velocity.y);
            columns.set(first + 2, copy, angle, moving.spin);
        }
    }

    /// Adds the forces of surfaces that touch: of what the world pushes, or of the second of two bodies. Rapier has the impulses of
    /// its latest step.
    pub(super) fn contacts(&self, forces: &mut Vec<Force>) {
        let dt = self.world.integration_parameters.dt;
        for pair in self.world.narrow_phase.contact_pairs() {
            let pose = self.world.colliders[pair.collider1].position();
            for manifold in pair.solver_manifolds() {
                let normal = manifold.data.normal;
                let sense = if manifold.data.rigid_body2.is_some() {
                    1.0
                } else {
                    -1.0
                };
                for point in manifold
                    .points
                    .iter()
                    .filter(|point| point.data.impulse > 0.0)
                {
                    let tangent = Vector::new(-normal.y, normal.x) * point.data.tangent_impulse.x;
                    let force = (normal * point.data.impulse + tangent) * (sense / dt);
                    let at = *pose * point.local_p1;
                    forces.push(Force {
                        source: ForceSource::Contact,
                        at: at.to_array(),
                        newtons: force.to_array(),
                    });
                }
            }
        }
    }

    /// Whether both hold the same bodies.
    pub(super) fn same_shape(&self, other: &Self) -> bool {
        self.world.bodies.len() == other.world.bodies.len()
            && self.world.colliders.len() == other.world.colliders.len()
    }
}
