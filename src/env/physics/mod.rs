//! Rigid bodies: the sole importer of Rapier and Parry.
//!
//! M copies of a task stand in one world at the same place, so that the solver's vector lanes fill up with copies; without
//! colliders nothing of one copy can meet another. (Offsetting the copies would round their coordinates differently.)
//! Numbers cross to Rapier's types in this folder only. Observations, rewards and agents may not enter.

mod joint;
mod shape;

use rapier2d::prelude::{
    MassProperties, PhysicsWorld, Pose as RapierPose, RigidBody, RigidBodyBuilder, RigidBodyHandle, RigidBodySet, Rotation, Vector,
};
use serde::{Deserialize, Serialize};

use self::joint::Hold;
pub use self::shape::inertial;
use super::Pose;
use super::description::{Description, Drive};
use super::dynamics::{Dynamics, JointColumns};
use super::kinematics::{Frame, Tree};

/// M copies of a task as rigid bodies in one Rapier world.
pub struct RigidBodies {
    world: PhysicsWorld,
    /// `[copies × bodies]`, row by copy.
    bodies: Vec<RigidBodyHandle>,
    bodies_each: usize,
    /// One a joint.
    holds: Vec<Hold>,
    motors: Vec<Motor>,
    /// Bodies that motors push: their forces are set anew in each step.
    driven: Vec<usize>,
    tree: Tree,
    frames: Vec<Frame>,
    /// Centres of mass in the bodies' frames.
    coms: Vec<[f64; 2]>,
    /// Which copies move: `[copies]`.
    live: Vec<bool>,
    /// Which copies Rapier moves. Catches up with `live` before a step.
    enabled: Vec<bool>,
    columns: JointColumns,
}

/// An actuator that pushes a joint.
struct Motor {
    joint: usize,
    gear: f32,
}

/// All that Rapier carries from one step to the next for bodies without contacts.
#[derive(Serialize, Deserialize)]
struct SavedState {
    columns: JointColumns,
    live: Vec<bool>,
    bodies: Vec<SavedBody>,
}

#[derive(Serialize, Deserialize)]
struct SavedBody {
    translation: [f32; 2],
    rotation: [f32; 2],
    velocity: [f32; 2],
    angular_velocity: f32,
}

impl RigidBodies {
    /// Builds `copies` copies of a task, none of them live.
    #[must_use]
    pub fn new(description: &Description, copies: usize) -> Self {
        let tree = Tree::new(description);
        let holds: Vec<_> = tree.links().iter().map(Hold::new).collect();
        let mut world = empty_world(description);
        let anchor = world.insert_body(RigidBodyBuilder::fixed());
        let mut bodies = Vec::with_capacity(copies * description.bodies.len());
        for _ in 0..copies {
            bodies.extend(insert_copy(&mut world, anchor, description, &holds));
        }
        apply_changes(&mut world);
        let motors: Vec<_> = description.actuators.iter().map(Motor::new).collect();
        let mut driven: Vec<_> = motors.iter().flat_map(|motor| holds[motor.joint].bodies()).collect();
        driven.sort_unstable();
        driven.dedup();
        Self {
            bodies_each: description.bodies.len(),
            frames: tree.frames(),
            coms: description.bodies.iter().map(|body| body.inertial.com).collect(),
            live: vec![false; copies],
            enabled: vec![false; copies],
            columns: JointColumns::new(description.joints.len(), copies),
            world,
            bodies,
            holds,
            motors,
            driven,
            tree,
        }
    }
}

impl Dynamics for RigidBodies {
    fn start(&mut self, copy: usize, positions: &[f64], velocities: &[f64]) {
        self.tree.place(positions, velocities, &mut self.frames);
        let handles = &self.bodies[copy * self.bodies_each..][..self.bodies_each];
        for ((&handle, frame), &com) in handles.iter().zip(&self.frames).zip(&self.coms) {
            place_body(&mut self.world.bodies[handle], frame, com);
        }
        for (joint, (&position, &velocity)) in positions.iter().zip(velocities).enumerate() {
            self.columns.set(joint, copy, position as f32, velocity as f32);
        }
        self.live[copy] = true;
    }

    fn stop(&mut self, copy: usize) {
        self.live[copy] = false;
    }

    fn step(&mut self, controls: &[f32]) {
        self.enable_live_copies();
        if self.live.contains(&true) {
            self.push(controls);
            self.world.step();
            self.read_joints();
        }
    }

    fn joints(&self) -> &JointColumns {
        &self.columns
    }

    fn poses(&self, copy: usize, poses: &mut [Pose]) {
        for (pose, &handle) in poses.iter_mut().zip(&self.bodies[copy * self.bodies_each..]) {
            let position = self.world.bodies[handle].position();
            let [x, y] = position.translation.to_array();
            *pose = Pose { x, y, angle: position.rotation.angle() };
        }
    }

    fn save(&self) -> Vec<u8> {
        let bodies = self.bodies.iter().map(|&handle| SavedBody::of(&self.world.bodies[handle])).collect();
        let state = SavedState { columns: self.columns.clone(), live: self.live.clone(), bodies };
        postcard::to_stdvec(&state).unwrap_or_default()
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let state: SavedState = postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        let fits = state.columns.same_shape(&self.columns)
            && state.live.len() == self.live.len()
            && state.bodies.len() == self.bodies.len();
        if !fits {
            return Err("the state is of other bodies or another number of copies".to_owned());
        }
        for (saved, &handle) in state.bodies.iter().zip(&self.bodies) {
            saved.put(&mut self.world.bodies[handle]);
        }
        self.columns = state.columns;
        self.live = state.live;
        Ok(())
    }
}

impl RigidBodies {
    fn enable_live_copies(&mut self) {
        for copy in 0..self.live.len() {
            if self.enabled[copy] != self.live[copy] {
                self.enabled[copy] = self.live[copy];
                for &handle in &self.bodies[copy * self.bodies_each..][..self.bodies_each] {
                    self.world.bodies[handle].set_enabled(self.live[copy]);
                }
            }
        }
    }

    fn push(&mut self, controls: &[f32]) {
        let copies = self.live.len();
        for copy in (0..copies).filter(|&copy| self.live[copy]) {
            let handles = &self.bodies[copy * self.bodies_each..][..self.bodies_each];
            for &body in &self.driven {
                let body = &mut self.world.bodies[handles[body]];
                body.reset_forces(false);
                body.reset_torques(false);
            }
            for (index, motor) in self.motors.iter().enumerate() {
                let force = motor.gear * controls[index * copies + copy];
                self.holds[motor.joint].push(force, handles, &mut self.world.bodies);
            }
        }
    }

    fn read_joints(&mut self) {
        for copy in (0..self.live.len()).filter(|&copy| self.live[copy]) {
            let handles = &self.bodies[copy * self.bodies_each..][..self.bodies_each];
            for (joint, hold) in self.holds.iter().enumerate() {
                let (before, _) = self.columns.get(joint, copy);
                let (position, velocity) = hold.read(before, handles, &self.world.bodies);
                self.columns.set(joint, copy, position, velocity);
            }
        }
    }
}

impl Motor {
    fn new(actuator: &super::description::Actuator) -> Self {
        let Drive::JointForce(joint) = actuator.drive;
        Self { joint, gear: actuator.gear as f32 }
    }
}

impl SavedBody {
    fn of(body: &RigidBody) -> Self {
        let position = body.position();
        Self {
            translation: position.translation.to_array(),
            rotation: [position.rotation.re, position.rotation.im],
            velocity: body.linvel().to_array(),
            angular_velocity: body.angvel(),
        }
    }

    fn put(&self, body: &mut RigidBody) {
        let rotation = Rotation::from_cos_sin_unchecked(self.rotation[0], self.rotation[1]);
        body.set_position(RapierPose::from_parts(Vector::from_array(self.translation), rotation), false);
        set_velocities(body, Vector::from_array(self.velocity), self.angular_velocity);
    }
}

/// A world whose impulse joints neither gain nor lose energy beyond the solver's first order: the pass that follows each substep
/// by default drains energy, the limit on rotation per step clamps fast poles.
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

/// Inserts the bodies and joints of one copy, disabled, and returns the bodies' handles.
fn insert_copy(
    world: &mut PhysicsWorld,
    anchor: RigidBodyHandle,
    description: &Description,
    holds: &[Hold],
) -> Vec<RigidBodyHandle> {
    let rail = |body| holds.iter().find_map(|hold| hold.rail_of(body));
    let bodies = description.bodies.iter().enumerate();
    let handles: Vec<_> = bodies.map(|(index, body)| world.insert_body(rigid_body(body, rail(index)))).collect();
    for hold in holds {
        hold.insert(world, anchor, &handles);
    }
    handles
}

fn rigid_body(body: &super::description::Body, rail: Option<[bool; 2]>) -> RigidBody {
    let inertial = &body.inertial;
    let properties = MassProperties::new(vector(inertial.com), inertial.mass as f32, inertial.inertia as f32);
    let builder = RigidBodyBuilder::dynamic()
        .pose(RapierPose::new(vector(body.position), body.angle as f32))
        .additional_mass_properties(properties)
        .can_sleep(false)
        .allow_fast_rotation(true)
        .enabled(false);
    match rail {
        Some([x, y]) => builder.enabled_translations(x, y).lock_rotations().build(),
        None => builder.build(),
    }
}

/// Lets Rapier take in new bodies (their masses count from then on) without time passing.
fn apply_changes(world: &mut PhysicsWorld) {
    let control_step = std::mem::take(&mut world.integration_parameters.dt);
    world.step();
    world.integration_parameters.dt = control_step;
}

fn place_body(body: &mut RigidBody, frame: &Frame, com: [f64; 2]) {
    let rotation = Rotation::from_cos_sin_unchecked(frame.rotation[0] as f32, frame.rotation[1] as f32);
    body.set_position(RapierPose::from_parts(vector(frame.position), rotation), false);
    set_velocities(body, vector(frame.velocity_at(frame.point(com))), frame.angular_velocity as f32);
}

/// Rapier does not write a velocity that equals the old one, and 0 equals −0: write another one before.
fn set_velocities(body: &mut RigidBody, linear: Vector, angular: f32) {
    body.set_linvel(Vector::ONE, false);
    body.set_linvel(linear, false);
    body.set_angvel(1.0, false);
    body.set_angvel(angular, false);
}

fn vector(a: [f64; 2]) -> Vector {
    Vector::new(a[0] as f32, a[1] as f32)
}

/// The handle's body, or none for the world.
fn find(bodies: &RigidBodySet, handle: Option<RigidBodyHandle>) -> Option<&RigidBody> {
    handle.and_then(|handle| bodies.get(handle))
}
