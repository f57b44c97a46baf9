//! Smooth tasks, which have no contacts, against closed forms: how large the errors of rigid bodies
//! are, that the errors fall with the number of substeps, what is conserved, and what springs,
//! dampers, friction, servos and ranges do.

mod car;
mod joints;
mod swings;

use seedbed_env::Physics;
use seedbed_env::build_dynamics;
use seedbed_env::description::BodyTask;
use seedbed_env::dynamics::Dynamics;
use seedbed_random::{Purpose, Stream, stream};

fn task(name: &str) -> BodyTask {
    crate::load_bodies(format!("envs/{name}.ron"))
}

fn with_substeps(name: &str, substeps: u32) -> BodyTask {
    let mut task = task(name);
    task.solver.substeps = substeps;
    task
}

fn rigid_bodies(task: &BodyTask) -> Box<dyn Dynamics> {
    build_dynamics(task, Physics::Rapier, 1).expect("every task has rigid bodies")
}

fn random() -> Stream {
    stream(13, Purpose::Action, 0, 0)
}

/// Positions, then velocities of all joints.
fn state(bodies: &dyn Dynamics, joints: usize) -> Vec<f64> {
    let joint = |joint| bodies.coordinates().get(joint, 0);
    let positions = (0..joints).map(|index| f64::from(joint(index).0));
    positions
        .chain((0..joints).map(|index| f64::from(joint(index).1)))
        .collect()
}

fn start(bodies: &mut dyn Dynamics, state: &[f64]) {
    let (positions, velocities) = state.split_at(state.len() / 2);
    bodies.start(0, positions, velocities);
}
