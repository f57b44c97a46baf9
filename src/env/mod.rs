//! Environments: batches of independent copies of one task, described by a file and not by code.
//!
//! [`Environment`] is all that the rest of the workbench sees. [`mod@file`] is the schema of `envs/*.ron` and makes a
//! [`description`], [`task`] turns that into an environment on top of a [`dynamics`] (rigid bodies in [`physics`], or the
//! closed-form twins of [`analytic`]). Tasks of finitely many states are tables ([`tabular`]). [`load`] and [`build`] are the two steps. Agents, learning and recording may not enter.

pub mod analytic;
pub mod description;
pub mod dynamics;
pub mod expression;
pub mod file;
mod forces;
pub mod kinematics;
pub mod physics;
mod sensing;
pub mod tabular;
pub mod task;

pub use file::load;
pub use task::build;

use serde::{Deserialize, Serialize};

use crate::random::Stream;

/// A batch of M independent copies of one task.
///
/// A copy is live from its [`reset`](Self::reset) until its status is no longer [`Status::Running`]; only live copies are
/// stepped. The bits of one copy depend neither on M nor on what the other copies do.
pub trait Environment: Send {
    /// Names, units and ranges of what is observed and done.
    fn spec(&self) -> &Spec;

    /// M, the number of copies.
    fn copies(&self) -> usize;

    /// Starts a new episode in `copy`; its start state is drawn from `random`.
    fn reset(&mut self, copy: usize, random: &mut Stream);

    /// Advances every live copy by one control step. `actions`: `[M × action width]`, row by copy; a discrete action is the
    /// index of its value. Rows of copies that are not live are ignored.
    fn step(&mut self, actions: &[f32]);

    /// What each copy observes now: `[M × observations]`, row by copy.
    fn observations(&self) -> &[f32];

    /// The reward of each copy's latest step: `[M]`.
    fn rewards(&self) -> &[f32];

    /// Whether each copy's episode goes on: `[M]`.
    fn statuses(&self) -> &[Status];

    /// The whole state as bytes; [`restore`](Self::restore) continues from them to the same bits.
    fn save(&self) -> Vec<u8>;

    /// Takes up a state that [`save`](Self::save) wrote.
    ///
    /// # Errors
    /// Says what is wrong where the bytes are not a state of this environment with this number of copies.
    fn restore(&mut self, bytes: &[u8]) -> Result<(), String>;

    /// The bodies to draw, if the task has a shape.
    fn scene(&self) -> Option<&Scene>;

    /// Where the bodies of `copy` are now, in the order of the scene: `[bodies]`.
    fn poses(&self, copy: usize, poses: &mut [Pose]);

    /// Adds the forces of the latest step of `copy`, as they act on bodies that are at `poses`; none directly after a reset.
    /// Only pictures ask for this, so that it may allocate.   `poses: [bodies]`, in the order of the scene
    fn forces(&self, copy: usize, poses: &[Pose], forces: &mut Vec<Force>);
}

/// What moves the bodies of a task.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Physics {
    /// Rigid bodies.
    #[default]
    Rapier,
    /// The task's closed-form twin, if it has one.
    Analytic,
}

/// Whether an episode goes on, and if not, how it ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Not started, or ended and not yet reset. Not stepped.
    #[default]
    Idle,
    /// The episode goes on.
    Running,
    /// The task's own end: no reward can follow.
    Terminated,
    /// The time limit cut the episode off.
    Truncated,
}

/// A task as seen from outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Spec {
    /// The task's name: its file's stem.
    pub name: String,
    /// One sentence for people.
    pub description: String,
    /// What an agent sees, in order.
    pub observations: Vec<Quantity>,
    /// What an agent does, in order.
    pub actions: Vec<Action>,
    /// Seconds between two actions.
    pub control_step: f64,
    /// Steps after which an episode is truncated.
    pub time_limit: u32,
    /// Mean return at which the task counts as solved, if anybody has agreed on one.
    pub reward_threshold: Option<f32>,
}

/// A named number with its unit and the range over which it is displayed and its coverage is counted.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantity {
    /// Name, unique within its task.
    pub name: String,
    /// SI unit, such as `m/s`; empty for a pure number.
    pub unit: String,
    /// Low and high end of the display range. Values outside may occur.
    pub range: [f32; 2],
}

/// One component of an action.
#[derive(Clone, Debug, PartialEq)]
pub struct Action {
    /// Name, unit and range.
    pub quantity: Quantity,
    /// What may be chosen.
    pub choice: Choice,
}

/// What may be chosen for one component of an action.
#[derive(Clone, Debug, PartialEq)]
pub enum Choice {
    /// One of these values; the action is the value's index.
    Discrete(Vec<f32>),
    /// Any number within the quantity's range; clamped to it.
    Continuous,
}

/// Position (m) and angle (rad, counter-clockwise) of a body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Position to the right, m.
    pub x: f32,
    /// Position upwards, m.
    pub y: f32,
    /// Angle, rad, counter-clockwise.
    pub angle: f32,
}

/// A force as pictures show it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Force {
    /// Where it comes from.
    pub source: ForceSource,
    /// Where it acts, m, to the right and upwards.
    pub at: [f32; 2],
    /// N, to the right and upwards.
    pub newtons: [f32; 2],
}

/// Where a force comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ForceSource {
    /// The agent's action. A torque is shown as the force at the body's centre of mass that turns it as much.
    Action,
    /// Another surface.
    Contact,
}

/// The drawable bodies of a task.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// One entry a body, in the order of the poses.
    pub bodies: Vec<SceneBody>,
    /// The body that pictures go along with, by its index here.
    pub tracked: Option<usize>,
}

/// One drawable body.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneBody {
    /// The body's name in its file.
    pub name: String,
    /// Whether it stands still throughout.
    pub fixed: bool,
    /// Shapes in the body's own frame.
    pub shapes: Vec<Shape>,
    /// The hinge about which it turns, in its own frame, m.
    pub hinge: Option<[f32; 2]>,
}

/// A shape in its body's frame; lengths in m, angles in rad.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A disc.
    Ball {
        /// Centre.
        center: [f32; 2],
        /// Radius.
        radius: f32,
    },
    /// A rectangle.
    Box {
        /// Centre.
        center: [f32; 2],
        /// Half width and half height.
        half_size: [f32; 2],
        /// Rotation about the centre.
        angle: f32,
    },
    /// A segment with a thickness.
    Capsule {
        /// One end of the segment.
        from: [f32; 2],
        /// The other end.
        to: [f32; 2],
        /// Half the thickness.
        radius: f32,
    },
    /// A closed convex polygon.
    Polygon(Vec<[f32; 2]>),
    /// An open line, such as a terrain or a rail.
    Polyline(Vec<[f32; 2]>),
}

impl Spec {
    /// Numbers in one observation.
    #[must_use]
    pub fn observation_width(&self) -> usize {
        self.observations.len()
    }

    /// Numbers in one action.
    #[must_use]
    pub fn action_width(&self) -> usize {
        self.actions.len()
    }

    /// A task in which there is nothing to see and nothing to do, for tests to fill.
    #[cfg(test)]
    pub(crate) fn bare() -> Self {
        Self {
            name: "test".to_owned(),
            description: String::new(),
            observations: Vec::new(),
            actions: Vec::new(),
            control_step: 0.1,
            time_limit: 10,
            reward_threshold: None,
        }
    }
}
