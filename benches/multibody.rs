//! Rapier alone, without this project's code: a body with two legs of three links, as a half cheetah, on the ground and in the
//! air. What takes the time of a step in tasks with contacts, for whoever makes Rapier's multibodies faster; see
//! `docs/speed.md`.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use rapier2d::prelude::{
    ColliderBuilder, Group, InteractionGroups, InteractionTestMode, PhysicsWorld,
    RevoluteJointBuilder, RigidBodyBuilder, RigidBodyHandle, Vector,
};

criterion_group!(benches, multibody);
criterion_main!(benches);

/// How links are joined.
#[derive(Clone, Copy, PartialEq)]
enum Joints {
    /// Reduced coordinates.
    Multibody,
    /// Constraints between free bodies.
    Impulse,
}

const LENGTH: f32 = 0.3;
const RADIUS: f32 = 0.05;

/// Seven links and six hinges, whose lowest links touch the ground if it has one.
fn walker(joints: Joints, on_ground: bool) -> PhysicsWorld {
    let mut world = PhysicsWorld::new();
    world.integration_parameters.dt = 0.01;
    if on_ground {
        let ground = RigidBodyBuilder::fixed().translation(Vector::new(0.0, -1.0));
        world.insert(ground, ColliderBuilder::cuboid(100.0, 1.0));
    } else {
        world.gravity = Vector::ZERO;
    }
    let torso = link(&mut world, Vector::new(0.0, 3.0 * LENGTH + RADIUS));
    for side in [-0.5, 0.5] {
        let mut parent = torso;
        let mut anchor = Vector::new(side, 0.0);
        for number in 1..=3 {
            let height = (3.0 - number as f32 + 0.5) * LENGTH + RADIUS;
            let child = link(&mut world, Vector::new(side, height));
            let joint = RevoluteJointBuilder::new()
                .local_anchor1(anchor)
                .local_anchor2(Vector::new(0.0, 0.5 * LENGTH))
                .contacts_enabled(false);
            join(&mut world, joints, [parent, child], joint);
            (parent, anchor) = (child, Vector::new(0.0, -0.5 * LENGTH));
        }
    }
    world
}

/// A link that collides with the ground only.
fn link(world: &mut PhysicsWorld, place: Vector) -> RigidBodyHandle {
    let groups = InteractionGroups::new(
        Group::GROUP_1,
        Group::ALL ^ Group::GROUP_1,
        InteractionTestMode::And,
    );
    let shape = ColliderBuilder::capsule_y(0.5 * LENGTH - RADIUS, RADIUS).collision_groups(groups);
    let body = RigidBodyBuilder::dynamic()
        .translation(place)
        .can_sleep(false);
    world.insert(body, shape).0
}

fn join(
    world: &mut PhysicsWorld,
    joints: Joints,
    [parent, child]: [RigidBodyHandle; 2],
    joint: RevoluteJointBuilder,
) {
    match joints {
        Joints::Multibody => drop(world.insert_multibody_joint(parent, child, joint)),
        Joints::Impulse => drop(world.insert_impulse_joint(parent, child, joint)),
    }
}

fn multibody(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("seven links");
    for (place, on_ground) in [("on the ground", true), ("in the air", false)] {
        for (name, joints, iterations, stabilization) in [
            ("multibody, 4 substeps", Joints::Multibody, 4, 1),
            (
                "multibody, 4 substeps, without stabilization",
                Joints::Multibody,
                4,
                0,
            ),
            ("multibody, 1 substep", Joints::Multibody, 1, 1),
            ("impulse joints, 4 substeps", Joints::Impulse, 4, 1),
        ] {
            let mut world = walker(joints, on_ground);
            let parameters = &mut world.integration_parameters;
            parameters.num_solver_iterations = iterations;
            parameters.num_internal_stabilization_iterations = stabilization;
            group.bench_function(BenchmarkId::new(name, place), |bencher| {
                bencher.iter(|| world.step());
            });
        }
    }
    group.finish();
}
