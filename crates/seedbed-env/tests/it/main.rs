//! The tests of tasks, in one binary: rigid bodies against closed forms, the contract that every
//! environment keeps, and the errors of wrong files.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod broken_envs;
mod closed_forms;
mod contacts;
mod contract;
mod environments_page;
mod episode_numbers;
mod limits;
mod physics;
mod run_constants;
mod several_joints;
mod smooth;
mod surroundings;
mod tabular;
mod tasks;
mod terrain;
mod turns;

use std::path::{Path, PathBuf};

use seedbed_env::description::BodyTask;
use seedbed_env::{Environment, Physics, TaskDescription, build, load, parse};

/// The repository, whose `envs/` holds the tasks.
fn repository() -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "..", ".."].iter().collect()
}

fn bodies_of(description: &TaskDescription) -> BodyTask {
    description
        .body_task()
        .expect("it is no tabular task")
        .clone()
}

/// A task of rigid bodies from a file of the repository.
fn load_bodies(path: impl AsRef<Path>) -> BodyTask {
    let description = load(&repository().join(path));
    bodies_of(&description.unwrap_or_else(|error| panic!("{error}")))
}

/// A task of rigid bodies from a text.
fn parse_bodies(name: &str, text: String) -> BodyTask {
    let description = parse(name, name, text);
    bodies_of(&description.unwrap_or_else(|error| panic!("{error}")))
}

fn build_bodies(task: &BodyTask, physics: Physics, copies: usize) -> Box<dyn Environment> {
    build(&task.clone().into(), physics, copies).expect("it has this physics")
}
