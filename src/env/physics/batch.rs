//! Some copies of a task in one Rapier world.

use rapier2d::prelude::{
    ImpulseJointHandle, PhysicsWorld, RigidBody, RigidBodyBuilder, RigidBodyHandle,
};

use super::body::{SavedBody, place, rigid_body};
use super::drive::Drive;
use super::{MotorKind, Plan, vector};
use crate::env::description::Description;
use crate::env::dynamics::JointColumns;
use crate::env::kinematics::Frame;

/// Some copies in one world.
pub(super) struct Batch {
    world: PhysicsWorld,
    /// `[copies × bodies]`, row by copy.
    handles: Vec<RigidBodyHandle>,
    /// `[copies × servos]`, row by copy.
    servos: Vec<ImpulseJointHandle>,
    /// Which copies shall move: `[copies]`.
    pub(super) live: Vec<bool>,
    /// Which copies Rapier moves. Catches up with `live` before a step, so that a copy that ends and starts again costs nothing.
    enabled: Vec<bool>,
}

impl Batch {
    pub(super) fn new(description: &Description, plan: &Plan, copies: usize) -> Self {
        let mut world = empty_world(description);
        let anchor = world.insert_body(RigidBodyBuilder::fixed());
        let (mut handles, mut servos) = (Vec::new(), Vec::new());
        for _ in 0..copies {
            let bodies = insert_bodies(&mut world, description, plan);
            servos.extend(insert_joints(&mut world, anchor, &bodies, plan));
            handles.extend(bodies);
        }
        apply_changes(&mut world);
        Self {
            world,
            handles,
            servos,
            live: vec![false; copies],
            enabled: vec![false; copies],
        }
    }

    pub(super) fn bodies(&self, copy: usize, plan: &Plan) -> impl Iterator<Item = &RigidBody> {
        self.handles[copy * plan.bodies..][..plan.bodies]
            .iter()
            .map(|&handle| &self.world.bodies[handle])
    }

    /// Makes a copy live with its bodies at `frames`.
    pub(super) fn start(&mut self, copy: usize, frames: &[Frame], plan: &Plan) {
        let handles = &self.handles[copy * plan.bodies..];
        for ((&handle, frame), &com) in handles.iter().zip(frames).zip(&plan.coms) {
            place(&mut self.world.bodies[handle], frame, com);
        }
        self.live[copy] = true;
    }

    pub(super) fn restore(&mut self, copy: usize, bodies: &[SavedBody], live: bool) {
        for (saved, &handle) in bodies.iter().zip(&self.handles[copy * bodies.len()..]) {
            saved.put(&mut self.world.bodies[handle]);
        }
        self.live[copy] = live;
    }

    /// One control step of the live copies; `first` is the number of this batch's first copy in all columns.
    pub(super) fn step(
        &mut self,
        first: usize,
        controls: &[f32],
        columns: &mut JointColumns,
        plan: &Plan,
    ) {
        self.enable_live_copies(plan);
        if self.live.contains(&true) {
            self.push(first, controls, columns.copies(), plan);
            self.world.step();
            self.stop(plan);
            self.read_joints(first, columns, plan);
        }
    }

    fn enable_live_copies(&mut self, plan: &Plan) {
        for (copy, enabled) in self.enabled.iter_mut().enumerate() {
            if *enabled != self.live[copy] {
                *enabled = self.live[copy];
                for &handle in &self.handles[copy * plan.bodies..][..plan.bodies] {
                    self.world.bodies[handle].set_enabled(*enabled);
                }
            }
        }
    }

    fn push(&mut self, first: usize, controls: &[f32], copies: usize, plan: &Plan) {
        for copy in (0..self.live.len()).filter(|&copy| self.live[copy]) {
            let handles = &self.handles[copy * plan.bodies..][..plan.bodies];
            for &body in &plan.driven {
                let body = &mut self.world.bodies[handles[body]];
                body.reset_forces(false);
                body.reset_torques(false);
            }
            for (index, motor) in plan.motors.iter().enumerate() {
                let value = motor.gear * controls[index * copies + first + copy];
                let hold = &plan.holds[motor.joint];
                match motor.kind {
                    MotorKind::Idle => {}
                    MotorKind::Force => hold.push(value, handles, &mut self.world.bodies),
                    MotorKind::Servo(servo, target) => {
                        let handle = self.servos[copy * plan.servos.len() + servo];
                        Drive::aim(handle, &mut self.world.impulse_joints, hold, target, value);
                    }
                }
            }
        }
    }

    /// Stops what has run against a wall.
    fn stop(&mut self, plan: &Plan) {
        for hold in plan.holds.iter().filter(|hold| hold.stops()) {
            for copy in (0..self.live.len()).filter(|&copy| self.live[copy]) {
                hold.stop(
                    &self.handles[copy * plan.bodies..][..plan.bodies],
                    &mut self.world.bodies,
                );
            }
        }
    }

    pub(super) fn read_joints(&self, first: usize, columns: &mut JointColumns, plan: &Plan) {
        for copy in (0..self.live.len()).filter(|&copy| self.live[copy]) {
            let handles = &self.handles[copy * plan.bodies..][..plan.bodies];
            for (joint, hold) in plan.holds.iter().enumerate() {
                let (before, _) = columns.get(joint, first + copy);
                let (position, velocity) = hold.read(before, handles, &self.world.bodies);
                columns.set(joint, first + copy, position, velocity);
            }
        }
    }
}

/// A world whose impulse joints neither gain nor lose energy beyond the solver's first order: the pass that follows each substep
/// by default drains energy.
fn empty_world(description: &Description) -> PhysicsWorld {
    let mut world = PhysicsWorld::new();
    world.gravity = vector(description.gravity);
    let parameters = &mut world.integration_parameters;
    parameters.dt = description.spec.control_step as f32;
    parameters.num_solver_iterations = description.solver.iterations as usize;
    parameters.num_internal_pgs_iterations = description.solver.passes as usize;
    parameters.num_internal_stabilization_iterations = 0;
    parameters.max_ccd_substeps = 0;
    parameters.normalized_max_linear_velocity = f32::MAX;
    world
}

/// Inserts the bodies of one copy, disabled.
fn insert_bodies(
    world: &mut PhysicsWorld,
    description: &Description,
    plan: &Plan,
) -> Vec<RigidBodyHandle> {
    let rail = |body| plan.holds.iter().find_map(|hold| hold.rail_of(body));
    let bodies = description.bodies.iter().zip(&plan.rotors).enumerate();
    bodies
        .map(|(index, (body, rotor))| world.insert_body(rigid_body(body, rotor, rail(index))))
        .collect()
}

/// Inserts the joints of one copy, whose bodies are `handles`; returns its servos.
fn insert_joints(
    world: &mut PhysicsWorld,
    anchor: RigidBodyHandle,
    handles: &[RigidBodyHandle],
    plan: &Plan,
) -> Vec<ImpulseJointHandle> {
    for hold in &plan.holds {
        hold.insert(world, anchor, handles);
    }
    for drive in &plan.passive {
        drive.insert(world, anchor, handles, &plan.holds);
    }
    plan.servos
        .iter()
        .map(|servo| servo.insert(world, anchor, handles, &plan.holds))
        .collect()
}

/// Lets Rapier take in new bodies (their masses count from then on) without time passing.
fn apply_changes(world: &mut PhysicsWorld) {
    let control_step = std::mem::take(&mut world.integration_parameters.dt);
    world.step();
    world.integration_parameters.dt = control_step;
}
