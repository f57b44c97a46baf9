//! Impacts of flat faces, which touch at two points at once.
//!
//! Rapier gives the points of a contact their bounces one after the other: the first turns the body,
//! and the second has less left to return. The bounces of both at once add up to one impulse at a
//! point between them, where Rapier then computes the whole impact.

use rapier2d::prelude::{
    ContactModificationContext, NEW_CONTACT_BIT, PhysicsHooks, RigidBody, RigidBodyHandle,
    SolverContact, Vector,
};

/// User data of the colliders of links of multibodies, whose impulses act on other bodies as well. Their
/// impacts are Rapier's.
pub(super) const LINKED: u128 = 1;

/// Replaces the two points of an impact by one.
pub(super) struct FlatImpacts;

impl PhysicsHooks for FlatImpacts {
    fn modify_solver_contacts(&self, context: &mut ContactModificationContext) {
        let colliders = [context.collider1, context.collider2];
        if colliders
            .iter()
            .any(|&handle| context.colliders[handle].user_data == LINKED)
        {
            return;
        }
        let body =
            |handle: Option<RigidBodyHandle>| handle.and_then(|body| context.bodies.get(body));
        let bodies = [body(context.rigid_body1), body(context.rigid_body2)];
        let Some(contact) = context.rigid_mut() else {
            return;
        };
        let &mut [first, second] = &mut contact.solver_contacts[..] else {
            return;
        };
        let normal = *contact.normal;
        let speeds = [first, second].map(|point| approach(point, normal, bodies));
        let is_new = |point: SolverContact| point.contact_id[0] & NEW_CONTACT_BIT != 0;
        if *contact.restitution > 0.0
            && is_new(first)
            && is_new(second)
            && speeds.iter().all(|&speed| speed > 0.0)
        {
            let share = share_of_second(speeds, [first, second], normal, bodies);
            contact.solver_contacts[0] = between(first, second, share);
            contact.solver_contacts.truncate(1);
        }
    }
}

/// The point at this share of the way from the first to the second.
fn between(first: SolverContact, second: SolverContact, share: f32) -> SolverContact {
    SolverContact {
        anchor1: first.anchor1.lerp(second.anchor1, share),
        anchor2: first.anchor2.lerp(second.anchor2, share),
        dist: first.dist + share * (second.dist - first.dist),
        ..first
    }
}

/// The speed at which the second body approaches the first at a point, m/s.
fn approach(point: SolverContact, normal: Vector, bodies: [Option<&RigidBody>; 2]) -> f32 {
    let velocity = |body: Option<&RigidBody>, at: Vector| {
        body.map_or(Vector::ZERO, |body| body.velocity_at_point(at))
    };
    let [one, other] = bodies;
    normal.dot(velocity(one, point.anchor1) - velocity(other, point.anchor2))
}

/// The share of the second point in the impulses j that change the approach speeds v of both points by the
/// same multiple: K j = v, where K has the change of the speed at one point per impulse at another.
fn share_of_second(
    [v1, v2]: [f32; 2],
    points: [SolverContact; 2],
    normal: Vector,
    bodies: [Option<&RigidBody>; 2],
) -> f32 {
    let arms = points.map(|point| {
        let arm = |body: Option<&RigidBody>, at: Vector| {
            body.map_or(0.0, |body| (at - body.center_of_mass()).perp_dot(normal))
        };
        [arm(bodies[0], point.anchor1), arm(bodies[1], point.anchor2)]
    });
    let change = |at: [f32; 2], of: [f32; 2]| -> f32 {
        let of_body = |index: usize| {
            bodies[index].map_or(0.0, |body| {
                let properties = body.mass_properties();
                let turn = at[index] * of[index] * properties.effective_world_inv_inertia;
                normal.dot(properties.effective_inv_mass * normal) + turn
            })
        };
        of_body(0) + of_body(1)
    };
    let [k11, k12, k22] = [(0, 0), (0, 1), (1, 1)].map(|(i, j)| change(arms[i], arms[j]));
    // Times the determinant of K, which is at least 0.
    let (first, second) = (k22 * v1 - k12 * v2, k11 * v2 - k12 * v1);
    let sum = first + second;
    if sum > 0.0 {
        (second / sum).clamp(0.0, 1.0)
    } else {
        0.5
    }
}
