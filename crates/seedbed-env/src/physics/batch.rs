//! Some copies of a task in one Rapier world.

use rapier2d::prelude::{
    ImpulseJointHandle, PhysicsWorld, RigidBody, RigidBodyBuilder, RigidBodyHandle,
};

use super::body::{SavedBody, place, rigid_body};
use super::constraint::CoordinateConstraint;
use super::{ControlEffect, CopyTemplate, vector};
use crate::description::BodyTask;
use crate::dynamics::CoordinateColumns;
use crate::kinematics::Frame;

/// Some copies of a task in one world.
pub(super) struct Batch {
    world: PhysicsWorld,
    /// `[copies × bodies]`, one row per copy.
    handles: Vec<RigidBodyHandle>,
    /// `[copies × servos]`, one row per copy.
    servos: Vec<ImpulseJointHandle>,
    /// Which copies should move: `[copies]`.
    pub(super) live: Vec<bool>,
    /// The controls that the bodies' forces and the servos' targets are for: `[copies × controls]`,
    /// NaN before the first step.
    applied_controls: Vec<f32>,
    /// Which copies Rapier moves. It is set to `live` before a step, so that a copy that ends and
    /// restarts in between costs nothing.
    enabled: Vec<bool>,
}

impl Batch {
    pub(super) fn new(task: &BodyTask, template: &CopyTemplate, copies: usize) -> Self {
        let mut world = empty_world(task);
        let anchor = world.insert_body(RigidBodyBuilder::fixed());
        let (mut handles, mut servos) = (Vec::new(), Vec::new());
        for _ in 0..copies {
            let bodies = insert_bodies(&mut world, task, template);
            servos.extend(insert_joints(&mut world, anchor, &bodies, template));
            handles.extend(bodies);
        }
        process_changes(&mut world);
        Self {
            world,
            handles,
            servos,
            live: vec![false; copies],
            applied_controls: vec![f32::NAN; copies * template.control_inputs.len()],
            enabled: vec![false; copies],
        }
    }

    /// The bodies of one copy.
    pub(super) fn bodies(
        &self,
        copy: usize,
        template: &CopyTemplate,
    ) -> impl Iterator<Item = &RigidBody> {
        self.handles[copy * template.body_count..][..template.body_count]
            .iter()
            .map(|&handle| &self.world.bodies[handle])
    }

    /// Makes a copy live with its bodies at `frames`.
    pub(super) fn start(&mut self, copy: usize, frames: &[Frame], template: &CopyTemplate) {
        let handles = &self.handles[copy * template.body_count..];
        for ((&handle, frame), &com) in handles.iter().zip(frames).zip(&template.coms) {
            place(&mut self.world.bodies[handle], frame, com);
        }
        self.live[copy] = true;
    }

    pub(super) fn restore(&mut self, copy: usize, bodies: &[SavedBody], live: bool) {
        for (saved, &handle) in bodies.iter().zip(&self.handles[copy * bodies.len()..]) {
            saved.restore_to(&mut self.world.bodies[handle]);
        }
        self.live[copy] = live;
    }

    /// Advances the live copies by one control step; `first_copy` is the index of this batch's
    /// first copy among all copies.
    pub(super) fn step(
        &mut self,
        first_copy: usize,
        controls: &[f32],
        columns: &mut CoordinateColumns,
        template: &CopyTemplate,
    ) {
        self.enable_live_copies(template);
        if self.live.contains(&true) {
            for _ in 0..template.steps {
                self.apply_controls(first_copy, controls, columns.copies(), template);
                self.world.step();
            }
            self.stop_at_walls(template);
            self.read_joints(first_copy, columns, template);
        }
    }

    fn enable_live_copies(&mut self, template: &CopyTemplate) {
        for (copy, enabled) in self.enabled.iter_mut().enumerate() {
            if *enabled != self.live[copy] {
                *enabled = self.live[copy];
                for &handle in &self.handles[copy * template.body_count..][..template.body_count] {
                    self.world.bodies[handle].set_enabled(*enabled);
                }
            }
        }
    }

    /// Sets the forces and servo targets of the live copies whose controls have changed. Rapier keeps
    /// those of the others, and would assemble all joints again if a body or joint were touched.
    fn apply_controls(
        &mut self,
        first_copy: usize,
        controls: &[f32],
        copies: usize,
        template: &CopyTemplate,
    ) {
        let width = template.control_inputs.len();
        for copy in 0..self.live.len() {
            if !self.live[copy] {
                continue;
            }
            let mut is_same = !template.pushes_depend_on_poses;
            let applied = &mut self.applied_controls[copy * width..][..width];
            for (index, applied) in applied.iter_mut().enumerate() {
                let control = controls[index * copies + first_copy + copy];
                is_same &= applied.to_bits() == control.to_bits() && !control.is_nan();
                *applied = control;
            }
            if !is_same {
                self.apply_controls_of(copy, template);
            }
        }
    }

    /// Sets the forces and servo targets of one copy.
    fn apply_controls_of(&mut self, copy: usize, template: &CopyTemplate) {
        let handles = &self.handles[copy * template.body_count..][..template.body_count];
        for &body in &template.pushed_bodies {
            let body = &mut self.world.bodies[handles[body]];
            body.reset_forces(false);
            body.reset_torques(false);
        }
        let width = template.control_inputs.len();
        let controls = &self.applied_controls[copy * width..][..width];
        for (input, control) in template.control_inputs.iter().zip(controls) {
            let value = input.gear * control;
            let joint = &template.joints[input.joint];
            match input.effect {
                ControlEffect::Nothing => {}
                ControlEffect::Force => joint.push(value, handles, &mut self.world.bodies),
                ControlEffect::Servo(servo, target) => {
                    let handle = self.servos[copy * template.servos.len() + servo];
                    CoordinateConstraint::set_target(
                        handle,
                        &mut self.world.impulse_joints,
                        joint,
                        target,
                        value,
                    );
                }
            }
        }
    }

    /// Moves bodies that have passed an inelastic wall back to it, and stops them.
    fn stop_at_walls(&mut self, template: &CopyTemplate) {
        for joint in template.joints.iter().filter(|joint| joint.has_walls()) {
            for copy in (0..self.live.len()).filter(|&copy| self.live[copy]) {
                joint.stop_at_walls(
                    &self.handles[copy * template.body_count..][..template.body_count],
                    &mut self.world.bodies,
                );
            }
        }
    }

    /// Writes the joint coordinates of the live copies to their columns.
    pub(super) fn read_joints(
        &self,
        first_copy: usize,
        columns: &mut CoordinateColumns,
        template: &CopyTemplate,
    ) {
        for copy in (0..self.live.len()).filter(|&copy| self.live[copy]) {
            let handles = &self.handles[copy * template.body_count..][..template.body_count];
            for (index, joint) in template.joints.iter().enumerate() {
                let (before, _) = columns.get(index, first_copy + copy);
                let (position, velocity) = joint.read(before, handles, &self.world.bodies);
                columns.set(index, first_copy + copy, position, velocity);
            }
        }
    }
}

/// A world whose joints neither gain nor lose energy beyond the first-order error of the solver.
/// Rapier's default, a stabilization after each substep, would drain energy.
fn empty_world(task: &BodyTask) -> PhysicsWorld {
    let mut world = PhysicsWorld::new();
    world.gravity = vector(task.gravity);
    // Nobody reads the counters, and counting visits every color of contacts.
    world.physics_pipeline.counters.disable();
    let parameters = &mut world.integration_parameters;
    let [steps, substeps] = task.steps_and_substeps(1);
    parameters.dt = task.spec.control_step as f32 / steps as f32;
    parameters.num_solver_iterations = substeps as usize;
    parameters.num_internal_pgs_iterations = task.solver.solver_iterations as usize;
    parameters.num_internal_stabilization_iterations = 0;
    parameters.max_ccd_substeps = 0;
    parameters.normalized_max_linear_velocity = f32::MAX;
    // Soft ends push back as springs do, however far they are pressed in.
    if task
        .joints
        .iter()
        .any(|joint| joint.range_softness.is_some())
    {
        parameters.normalized_max_corrective_velocity = f32::MAX;
    }
    world
}

/// Inserts the bodies of one copy, disabled.
fn insert_bodies(
    world: &mut PhysicsWorld,
    task: &BodyTask,
    template: &CopyTemplate,
) -> Vec<RigidBodyHandle> {
    let rail = |body| {
        let rails = template
            .joints
            .iter()
            .filter_map(|joint| joint.rail_of(body));
        rails.reduce(|[x, y], [other_x, other_y]| [x || other_x, y || other_y])
    };
    let bodies = task.bodies.iter().zip(&template.rotors).enumerate();
    bodies
        .map(|(index, (body, rotor))| world.insert_body(rigid_body(body, rotor, rail(index))))
        .collect()
}

/// Inserts the joints and constraints of one copy, whose bodies are `handles`; returns its servos.
fn insert_joints(
    world: &mut PhysicsWorld,
    anchor: RigidBodyHandle,
    handles: &[RigidBodyHandle],
    template: &CopyTemplate,
) -> Vec<ImpulseJointHandle> {
    for joint in &template.joints {
        joint.insert(world, anchor, handles);
    }
    for constraint in &template.passive_constraints {
        constraint.insert(world, anchor, handles, &template.joints);
    }
    template
        .servos
        .iter()
        .map(|servo| servo.insert(world, anchor, handles, &template.joints))
        .collect()
}

/// Lets Rapier process new bodies without time passing: their masses are set only in a step.
fn process_changes(world: &mut PhysicsWorld) {
    let control_step = std::mem::take(&mut world.integration_parameters.dt);
    world.step();
    world.integration_parameters.dt = control_step;
}
