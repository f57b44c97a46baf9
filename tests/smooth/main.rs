//! Smooth tasks, which have no contacts, against closed forms: how far rigid bodies are off, that the error falls as it should, what
//! they conserve, and what springs, dampers, friction, servos and ranges do.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod car;
mod joints;
mod swings;

use std::path::Path;

use seedbed::env::description::Description;
use seedbed::env::dynamics::Dynamics;
use seedbed::env::task::dynamics;
use seedbed::env::{Physics, load};
use seedbed::random::{Purpose, Stream, stream};

fn task(name: &str) -> Description {
    load(
        &Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("envs")
            .join(name)
            .with_extension("ron"),
    )
    .unwrap_or_else(|error| panic!("{error}"))
}

fn with_iterations(name: &str, iterations: u32) -> Description {
    let mut task = task(name);
    task.solver.iterations = iterations;
    task
}

fn rigid(task: &Description) -> Box<dyn Dynamics> {
    dynamics(task, Physics::Rapier, 1).expect("every task has rigid bodies")
}

fn random() -> Stream {
    stream(13, Purpose::Action, 0, 0)
}

/// Positions, then velocities of all joints.
fn state(bodies: &dyn Dynamics, joints: usize) -> Vec<f64> {
    let joint = |joint| bodies.joints().get(joint, 0);
    let positions = (0..joints).map(|index| f64::from(joint(index).0));
    positions
        .chain((0..joints).map(|index| f64::from(joint(index).1)))
        .collect()
}

fn start(bodies: &mut dyn Dynamics, state: &[f64]) {
    let (positions, velocities) = state.split_at(state.len() / 2);
    bodies.start(0, positions, velocities);
}
