//! The template of a world: bodies, colliders and joints of a task as Rapier's sets. Every episode
//! starts from a copy of them.

use rapier2d::prelude::{
    ActiveHooks, CoefficientCombineRule, Collider, ColliderBuilder, ColliderHandle, ColliderSet,
    Group, ImpulseJointSet, IntegrationParameters, InteractionGroups, InteractionTestMode,
    MassProperties, MultibodyIndex, MultibodyJointSet, Pose, RigidBody, RigidBodyBuilder,
    RigidBodyHandle, RigidBodySet, Vector,
};

use super::super::constraint::spring_coefficients;
use super::super::geometry::{PlacedShape, TOLERANCE};
use super::super::vector;
use super::bounce::LINKED;
use super::control::ControlInput;
use super::fluid::FluidBody;
use super::joint_group::JointGroup;
use super::link::{Link, Root};
use super::passage::PassageWatch;
use super::rope::Rope;
use crate::description::{self, Body, BodyTask, Joint};

/// A world before an episode.
pub(super) struct WorldTemplate {
    pub(super) gravity: Vector,
    pub(super) parameters: IntegrationParameters,
    /// Steps of Rapier per control step.
    pub(super) steps: u32,
    pub(super) bodies: RigidBodySet,
    pub(super) colliders: ColliderSet,
    pub(super) multibody_joints: MultibodyJointSet,
    pub(super) impulse_joints: ImpulseJointSet,
    pub(super) ropes: Vec<Rope>,
    pub(super) multibodies: Vec<MultibodyIndex>,
    /// `[bodies]`
    pub(super) handles: Vec<RigidBodyHandle>,
    /// `[colliders]`
    pub(super) collider_handles: Vec<ColliderHandle>,
    /// Centers of mass in the bodies' frames: `[bodies]`
    pub(super) coms: Vec<[f64; 2]>,
    /// One per joint.
    pub(super) links: Vec<Link>,
    /// One per free body.
    pub(super) roots: Vec<Root>,
    /// One per control.
    pub(super) control_inputs: Vec<ControlInput>,
    pub(super) fluid_bodies: Vec<FluidBody>,
    pub(super) passage_watch: PassageWatch,
}

impl WorldTemplate {
    pub(super) fn new(task: &BodyTask) -> Self {
        let mut bodies = RigidBodySet::new();
        let handles: Vec<_> = task
            .bodies
            .iter()
            .map(|body| bodies.insert(rigid_body(body)))
            .collect();
        let coms: Vec<_> = task.bodies.iter().map(|body| body.inertial.com).collect();
        let (colliders, collider_handles) = colliders(task, &handles, &mut bodies);
        let mut joints = MultibodyJointSet::new();
        let links = insert_links(task, &handles, &mut bodies, &mut joints);
        let mut impulse_joints = ImpulseJointSet::new();
        let ropes = Rope::insert_all(task, &handles, &mut bodies, &mut impulse_joints);
        let multibodies = multibody_indices(&handles, &joints);
        remove_default_damping(&multibodies, &bodies, &mut joints);
        links
            .iter()
            .zip(&task.joints)
            .for_each(|(link, described)| {
                link.set_passive_forces(&described.passive_forces, &mut joints);
            });
        Self {
            gravity: vector(task.gravity),
            parameters: parameters(task),
            steps: task.steps_and_substeps(task.solver.contact_updates)[0],
            roots: task
                .free_bodies
                .iter()
                .map(|&body| root(body, task))
                .collect(),
            control_inputs: ControlInput::from_task(task, &handles),
            fluid_bodies: FluidBody::all(task),
            passage_watch: passage_watch(task, &handles, &collider_handles),
            multibodies,
            multibody_joints: joints,
            impulse_joints,
            ropes,
            bodies,
            colliders,
            handles,
            collider_handles,
            coms,
            links,
        }
    }
}

/// Surfaces that approach each other more slowly than this, m/s, are found before they touch: the
/// distance at which contacts are predicted grows with the time between two contact updates.
const MAX_PREDICTED_SPEED: f32 = 4.0;

/// The distance at which contacts are predicted, m, in tasks with restitution. A predicted contact
/// bounces before the surfaces touch, and also if they would miss each other.
const PREDICTION_OF_BOUNCES: f32 = 0.002;

/// Distance at which contacts are predicted, m. `dt`: time between two contact updates, s
fn prediction_distance(task: &BodyTask, dt: f32) -> f32 {
    let surfaces = &task.colliders;
    if surfaces.iter().any(|surface| surface.restitution > 0.0) {
        PREDICTION_OF_BOUNCES
    } else {
        MAX_PREDICTED_SPEED * dt
    }
}

/// Rapier's settings. Contacts are not recycled from one step to the next, because recycled ones
/// gain energy on sloping ground. Continuous collision detection is off, because it moves
/// multibodies without updating their coordinates; bodies must be slow enough, or walls thick
/// enough, to do without it.
fn parameters(task: &BodyTask) -> IntegrationParameters {
    let [steps, substeps] = task.steps_and_substeps(task.solver.contact_updates);
    let dt = task.spec.control_step as f32 / steps as f32;
    let softness = task.contact_softness.map(spring_coefficients);
    let defaults = IntegrationParameters::default();
    IntegrationParameters {
        contact_softness: softness.unwrap_or(defaults.contact_softness),
        static_contact_softness: softness.unwrap_or(defaults.static_contact_softness),
        dt,
        num_solver_iterations: substeps as usize,
        num_internal_pgs_iterations: task.solver.solver_iterations as usize,
        num_internal_stabilization_iterations: 1,
        normalized_allowed_linear_error: TOLERANCE,
        normalized_prediction_distance: prediction_distance(task, dt),
        normalized_max_linear_velocity: f32::MAX,
        max_ccd_substeps: usize::from(task.bodies.iter().any(|body| body.ccd)),
        contact_recycling: false,
        ..defaults
    }
}

/// A body whose origin is its center of mass.
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
        .ccd_enabled(body.ccd)
        .build()
}

fn colliders(
    task: &BodyTask,
    handles: &[RigidBodyHandle],
    bodies: &mut RigidBodySet,
) -> (ColliderSet, Vec<ColliderHandle>) {
    let mut colliders = ColliderSet::new();
    let mut inserted = Vec::new();
    for surface in &task.colliders {
        let is_linked = surface.body.is_some_and(|body| is_linked(body, task));
        let collider = collider(surface, center_of_mass(surface, task), is_linked);
        inserted.push(match surface.body {
            None => colliders.insert(collider),
            Some(body) => colliders.insert_with_parent(collider, handles[body], bodies),
        });
    }
    (colliders, inserted)
}

fn passage_watch(
    task: &BodyTask,
    handles: &[RigidBodyHandle],
    colliders: &[ColliderHandle],
) -> PassageWatch {
    let poses = task.colliders.iter().map(|surface| {
        Pose::from_translation(-center_of_mass(surface, task)) * PlacedShape::new(surface).pose
    });
    PassageWatch::new(task, handles, colliders, poses)
}

/// Center of mass of a collider's body in the body's frame; that of the world is its origin.
fn center_of_mass(surface: &description::Collider, task: &BodyTask) -> Vector {
    surface
        .body
        .map_or(Vector::ZERO, |body| vector(task.bodies[body].inertial.com))
}

fn collider(surface: &description::Collider, com: Vector, is_linked: bool) -> Collider {
    let PlacedShape { shape, pose, .. } = PlacedShape::new(surface);
    let groups = |bits| Group::from_bits_retain(bits);
    ColliderBuilder::new(shape)
        .position(Pose::from_translation(-com) * pose)
        .density(0.0)
        .friction(surface.friction as f32)
        .friction_combine_rule(CoefficientCombineRule::Max)
        .restitution(surface.restitution as f32)
        .restitution_combine_rule(CoefficientCombineRule::Max)
        .active_hooks(if surface.restitution > 0.0 {
            ActiveHooks::MODIFY_SOLVER_CONTACTS
        } else {
            ActiveHooks::empty()
        })
        .user_data(if is_linked { LINKED } else { 0 })
        .collision_groups(InteractionGroups::new(
            groups(surface.contype),
            groups(surface.conaffinity),
            InteractionTestMode::Or,
        ))
        .build()
}

/// Inserts all joints. Each body that hangs on the world gets a fixed body of its own, so that trees
/// of bodies are independent.
fn insert_links(
    task: &BodyTask,
    handles: &[RigidBodyHandle],
    bodies: &mut RigidBodySet,
    joints: &mut MultibodyJointSet,
) -> Vec<Link> {
    let mut links: Vec<(usize, Link)> = Vec::new();
    let is_first = |&joint: &usize| task.first_joint_of_child(joint) == joint;
    for first in (0..task.joints.len()).filter(is_first) {
        let group = JointGroup::new(first, task);
        let Joint { parent, child, .. } = task.joints[first];
        let parent_handle = match parent {
            Some(parent) => handles[parent],
            None => bodies.insert(RigidBodyBuilder::fixed()),
        };
        let com = |body: usize| task.bodies[body].inertial.com;
        let joint = group.rapier_joint([parent.map_or([0.0; 2], com), com(child)]);
        let handle = joints.insert(parent_handle, handles[child], joint, false);
        let handle = handle.expect("joints form trees");
        for (place, &index) in group.joints.iter().enumerate() {
            links.push((index, Link::new(place, &group, handle, task, handles)));
        }
    }
    links.sort_by_key(|(index, _)| *index);
    links.into_iter().map(|(_, link)| link).collect()
}

fn root(body: usize, task: &BodyTask) -> Root {
    let com = task.bodies[body].inertial.com;
    Root::new(body, com, is_linked(body, task))
}

/// Whether a body is a link of a multibody.
fn is_linked(body: usize, task: &BodyTask) -> bool {
    let mut joints = task.joints.iter();
    joints.any(|joint| joint.parent == Some(body) || joint.child == body)
}

/// The multibodies of the bodies, each once.
fn multibody_indices(
    handles: &[RigidBodyHandle],
    joints: &MultibodyJointSet,
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
    indices
}

/// Removes the damping that Rapier gives to every hinge by default.
fn remove_default_damping(
    multibodies: &[MultibodyIndex],
    bodies: &RigidBodySet,
    joints: &mut MultibodyJointSet,
) {
    for &index in multibodies {
        if let Some(multibody) = joints.get_multibody_mut(index) {
            multibody.forward_kinematics(bodies, true);
            multibody.damping_mut().fill(0.0);
        }
    }
}
