//! A task's bodies, colliders and joints as Rapier's sets, from which every episode starts.

use rapier2d::prelude::{
    CoefficientCombineRule, Collider, ColliderBuilder, ColliderSet, Group, IntegrationParameters,
    InteractionGroups, InteractionTestMode, MassProperties, MultibodyIndex, MultibodyJointSet,
    Pose, RigidBody, RigidBodyBuilder, RigidBodyHandle, RigidBodySet, Vector,
};

use super::super::geometry::{Placed, TOLERANCE};
use super::super::vector;
use super::link::{Link, Motor, Root, joint};
use crate::env::description::{self, Body, Description, Drive};
use crate::env::kinematics::{Link as TreeLink, Tree};

/// What all copies have in common.
pub(super) struct Pristine {
    pub(super) gravity: Vector,
    pub(super) parameters: IntegrationParameters,
    /// Steps of Rapier in a control step.
    pub(super) searches: u32,
    pub(super) bodies: RigidBodySet,
    pub(super) colliders: ColliderSet,
    pub(super) multibody_joints: MultibodyJointSet,
    pub(super) multibodies: Vec<MultibodyIndex>,
    /// `[bodies]`
    pub(super) handles: Vec<RigidBodyHandle>,
    /// Centres of mass in the bodies' frames: `[bodies]`
    pub(super) coms: Vec<[f64; 2]>,
    /// One a joint.
    pub(super) links: Vec<Link>,
    /// One a free body.
    pub(super) roots: Vec<Root>,
    pub(super) motors: Vec<Motor>,
}

impl Pristine {
    pub(super) fn new(description: &Description, tree: &Tree) -> Self {
        let mut bodies = RigidBodySet::new();
        let handles: Vec<_> = description
            .bodies
            .iter()
            .map(|body| bodies.insert(rigid_body(body)))
            .collect();
        let coms: Vec<_> = description
            .bodies
            .iter()
            .map(|body| body.inertial.com)
            .collect();
        let colliders = colliders(description, &handles, &mut bodies);
        let mut joints = MultibodyJointSet::new();
        let insert = |(index, link)| {
            insert_link(index, link, description, &handles, &mut bodies, &mut joints)
        };
        let links: Vec<_> = tree.links().iter().enumerate().map(insert).collect();
        let multibodies = undamped(&bodies, &handles, &mut joints);
        links
            .iter()
            .zip(&description.joints)
            .for_each(|(link, described)| link.resist(&described.passive, &mut joints));
        Self {
            gravity: vector(description.gravity),
            parameters: parameters(description),
            searches: description.solver.searches,
            roots: description
                .free
                .iter()
                .map(|&body| root(body, description))
                .collect(),
            motors: Motor::all(description),
            multibodies,
            multibody_joints: joints,
            bodies,
            colliders,
            handles,
            coms,
            links,
        }
    }
}

/// What closes in more slowly than this, m/s, is found before it touches, however long it is until contacts are searched for again.
const CLOSING_SPEED: f32 = 4.0;

/// Contacts are solved anew in each search: recycled ones gain energy on sloping ground. Bodies are slow enough, or walls thick
/// enough, to do without continuous detection, which moves multibodies without their coordinates.
fn parameters(description: &Description) -> IntegrationParameters {
    let dt = description.spec.control_step as f32 / description.solver.searches as f32;
    IntegrationParameters {
        dt,
        num_solver_iterations: description.solver.iterations as usize,
        num_internal_pgs_iterations: description.solver.passes as usize,
        num_internal_stabilization_iterations: 1,
        normalized_allowed_linear_error: TOLERANCE,
        normalized_prediction_distance: CLOSING_SPEED * dt,
        normalized_max_linear_velocity: f32::MAX,
        max_ccd_substeps: 0,
        contact_recycling: false,
        ..IntegrationParameters::default()
    }
}

/// A body whose origin is its centre of mass.
fn rigid_body(body: &Body) -> RigidBody {
    let inertial = &body.inertial;
    RigidBodyBuilder::dynamic()
        .additional_mass_properties(MassProperties::new(
            Vector::ZERO,
            inertial.mass as f32,
            inertial.inertia as f32,
        ))
        .can_sleep(false)
        .allow_fast_rotation(true)
        .build()
}

fn colliders(
    description: &Description,
    handles: &[RigidBodyHandle],
    bodies: &mut RigidBodySet,
) -> ColliderSet {
    let mut colliders = ColliderSet::new();
    for surface in &description.colliders {
        let com = surface.body.map_or(Vector::ZERO, |body| {
            vector(description.bodies[body].inertial.com)
        });
        let collider = collider(surface, com);
        match surface.body {
            None => colliders.insert(collider),
            Some(body) => colliders.insert_with_parent(collider, handles[body], bodies),
        };
    }
    colliders
}

fn collider(surface: &description::Collider, com: Vector) -> Collider {
    let Placed { form, pose, .. } = Placed::new(surface);
    let kinds = |bits| Group::from_bits_retain(bits);
    ColliderBuilder::new(form)
        .position(Pose::from_translation(-com) * pose)
        .density(0.0)
        .friction(surface.friction as f32)
        .friction_combine_rule(CoefficientCombineRule::Max)
        .restitution(surface.restitution as f32)
        .restitution_combine_rule(CoefficientCombineRule::Max)
        .collision_groups(InteractionGroups::new(
            kinds(surface.contype),
            kinds(surface.conaffinity),
            InteractionTestMode::Or,
        ))
        .build()
}

/// What hangs on the world hangs on a fixed body of its own, so that trees do not depend on each other.
fn insert_link(
    index: usize,
    link: &TreeLink,
    description: &Description,
    handles: &[RigidBodyHandle],
    bodies: &mut RigidBodySet,
    joints: &mut MultibodyJointSet,
) -> Link {
    let parent = link.parent.map_or_else(
        || bodies.insert(RigidBodyBuilder::fixed()),
        |parent| handles[parent],
    );
    let com = |body: usize| description.bodies[body].inertial.com;
    let coms = [link.parent.map_or([0.0; 2], com), com(link.child)];
    let servo = description
        .actuators
        .iter()
        .find_map(|actuator| match &actuator.drive {
            Drive::Servo(servo) if servo.joint == index => Some(servo),
            _ => None,
        });
    let joint = joint(link, &description.joints[index], servo, coms);
    let handle = joints.insert(parent, handles[link.child], joint, false);
    Link::new(link, handle.expect("joints form trees"), handles, coms[1])
}

fn root(body: usize, description: &Description) -> Root {
    let is_linked = description
        .joints
        .iter()
        .any(|joint| joint.parent == Some(body));
    Root::new(body, description.bodies[body].inertial.com, is_linked)
}

/// Takes away the damping that Rapier gives to every hinge, and lists the trees.
fn undamped(
    bodies: &RigidBodySet,
    handles: &[RigidBodyHandle],
    joints: &mut MultibodyJointSet,
) -> Vec<MultibodyIndex> {
    let mut indices: Vec<_> = Vec::new();
    for link in handles
        .iter()
        .filter_map(|&handle| joints.rigid_body_link(handle))
    {
        if !indices.contains(&link.multibody) {
            indices.push(link.multibody);
        }
    }
    for &index in &indices {
        if let Some(multibody) = joints.get_multibody_mut(index) {
            multibody.forward_kinematics(bodies, true);
            multibody.damping_mut().fill(0.0);
        }
    }
    indices
}
