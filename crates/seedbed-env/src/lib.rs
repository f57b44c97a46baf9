//! Reinforcement-learning tasks as data: rigid bodies, analytic models and tabular MDPs, described
//! in text files and run as batches of independent copies.
//!
//! A task is a RON file that says which bodies there are, what holds and drives them, what an agent
//! observes, and how it is rewarded. [`load`] reads and checks it, [`build`] makes an
//! [`Environment`] of any number of copies:
//!
//! ```
//! use seedbed_random::{Purpose, stream};
//! use seedbed_env::{Environment, Physics, Status, build, load};
//!
//! # std::env::set_current_dir("../..")?;
//! let task = load("envs/cartpole.ron".as_ref())?;
//! let mut environment = build(&task, Physics::Rapier, 16)?;
//! for copy in 0..16 {
//!     environment.reset(copy, &mut stream(0, Purpose::Reset, copy as u32, 0));
//! }
//! while environment.statuses().contains(&Status::Running) {
//!     environment.step(&[1.0; 16]); // one row per copy: the index of a discrete action
//! }
//! assert!(environment.rewards().iter().all(|reward| *reward == 1.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The same file, the same random streams and the same actions give the same bits on every machine,
//! and the bits of one copy do not depend on the other copies.
//!
//! # Where to look
//!
//! - [`Environment`] is the interface to agents. Other crates may implement this trait; its
//!   documentation has an example. [`TaskSpec`] is what agents know of a task beforehand.
//! - [`mod@file`] is the schema of task files. `envs/README.md` in the repository teaches it.
//! - [`description`] is what a checked file becomes, and may be changed before building.
//! - [`gymnasium`] runs environments of Gymnasium in worker processes.
//! - [`tabular`] has finite MDPs with priors, and [`analytic`] the exact equations of classic
//!   tasks.
//!
//! Agents, learning and recording are other crates, on which this one must not depend.

pub mod analytic;
pub mod cancellation;
mod caught_panic;
pub mod description;
pub mod dynamics;
mod environment;
pub mod expression;
pub mod file;
mod forces;
pub mod gymnasium;
mod inertia;
pub mod kinematics;
mod parameters;
pub mod physics;
mod sensing;
pub mod tabular;
mod terrain;
mod trial;
mod watch;

pub use caught_panic::caught_panic;
pub use description::TaskDescription;
pub use environment::{build, build_dynamics, build_with_workers};
pub use file::{load, load_from, parse, settings as task_settings};
pub use trial::physics_warnings;
pub use watch::PhysicsWarning;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use seedbed_random::Stream;

/// A batch of M independent copies of one task.
///
/// A copy is live from its [`reset`](Self::reset) until its status is no longer
/// [`Status::Running`]; only live copies are stepped. The bits of one copy must depend neither on M
/// nor on what the other copies do.
///
/// # Example
/// A task in Rust: walk on a line until its end.
///
/// ```
/// use seedbed_random::Stream;
/// use seedbed_env::{Action, Environment, Quantity, TaskSpec, Status};
///
/// struct Walk {
///     spec: TaskSpec,
///     positions: Vec<f32>,
///     rewards: Vec<f32>,
///     statuses: Vec<Status>,
/// }
///
/// impl Walk {
///     fn new(copies: usize) -> Self {
///         Self {
///             spec: TaskSpec::new(
///                 "walk",
///                 vec![Quantity::new("position", "m", [0.0, 3.0])],
///                 vec![Action::discrete("step", "m", &[-1.0, 1.0])],
///             ),
///             positions: vec![0.0; copies],
///             rewards: vec![0.0; copies],
///             statuses: vec![Status::Idle; copies],
///         }
///     }
/// }
///
/// impl Environment for Walk {
///     fn spec(&self) -> &TaskSpec {
///         &self.spec
///     }
///     fn copies(&self) -> usize {
///         self.positions.len()
///     }
///     fn reset(&mut self, copy: usize, _random: &mut Stream) {
///         self.positions[copy] = 1.0;
///         self.rewards[copy] = 0.0;
///         self.statuses[copy] = Status::Running;
///     }
///     fn step(&mut self, actions: &[f32]) {
///         for (copy, &action) in actions.iter().enumerate() {
///             if self.statuses[copy] == Status::Running {
///                 self.positions[copy] += if action == 1.0 { 1.0 } else { -1.0 };
///                 let at_end = self.positions[copy] == 3.0;
///                 self.rewards[copy] = if at_end { 1.0 } else { 0.0 };
///                 if at_end || self.positions[copy] == 0.0 {
///                     self.statuses[copy] = Status::Terminated;
///                 }
///             }
///         }
///     }
///     fn observations(&self) -> &[f32] {
///         &self.positions
///     }
///     fn rewards(&self) -> &[f32] {
///         &self.rewards
///     }
///     fn statuses(&self) -> &[Status] {
///         &self.statuses
///     }
///     fn save(&self, copy: usize) -> Vec<u8> {
///         vec![self.positions[copy] as u8, u8::from(self.statuses[copy] == Status::Running)]
///     }
///     fn restore(&mut self, copy: usize, bytes: &[u8]) -> Result<(), String> {
///         let &[position, running] = bytes else {
///             return Err(format!("expected 2 bytes, found {}", bytes.len()));
///         };
///         self.positions[copy] = f32::from(position);
///         self.statuses[copy] = if running == 1 { Status::Running } else { Status::Idle };
///         Ok(())
///     }
/// }
///
/// let mut walk = Walk::new(2);
/// let mut random = seedbed_random::stream(0, seedbed_random::Purpose::Reset, 0, 0);
/// (0..2).for_each(|copy| walk.reset(copy, &mut random));
/// walk.step(&[1.0, 0.0]);
/// assert_eq!(walk.observations(), [2.0, 0.0]);
/// assert_eq!(walk.statuses(), [Status::Running, Status::Terminated]);
/// ```
pub trait Environment: Send {
    /// Names, units and ranges of observations and actions.
    fn spec(&self) -> &TaskSpec;

    /// Number of copies M.
    fn copies(&self) -> usize;

    /// Starts a new episode in `copy`, with a start state drawn from `random`.
    fn reset(&mut self, copy: usize, random: &mut Stream);

    /// Begins a [`reset`](Self::reset), and may leave the rest to [`finish_resets`](Self::finish_resets), so that copies
    /// in other processes are reset at the same time. Until then the copy has no observation. The default
    /// is `reset`.
    fn begin_reset(&mut self, copy: usize, random: &mut Stream) {
        self.reset(copy, random);
    }

    /// Finishes all resets that were begun. The default does nothing.
    fn finish_resets(&mut self) {}

    /// Names of the numbers that [`reset_at`](Self::reset_at) can be given. The default has none.
    fn start_names(&self) -> StartNames {
        StartNames::default()
    }

    /// Starts a new episode in `copy` in a given state. Coordinates that are not given start at rest
    /// where the task places its bodies; numbers of the episode that are not given are drawn from
    /// `random`. The default, for tasks without such numbers, is [`reset`](Self::reset).
    fn reset_at(&mut self, copy: usize, random: &mut Stream, _start: &GivenStart) {
        self.reset(copy, random);
    }

    /// The numbers that [`reset_at`](Self::reset_at) takes to start an episode in the current state of
    /// `copy`. What contacts remember from one step to the next is not among them: [`save`](Self::save)
    /// is exact. The default has none.
    fn coordinates(&self, _copy: usize) -> GivenStart {
        GivenStart::default()
    }

    /// Sets the constants of the task that are drawn once per run to those of the run with this run
    /// seed, in some copies. They have the values of
    /// [`for_run`](crate::TaskDescription::for_run); other copies keep theirs. The default, for tasks
    /// whose copies all belong to one run, does nothing.
    fn set_run(&mut self, _copies: std::ops::Range<usize>, _run_seed: u64) {}

    /// Advances every live copy by one control step.
    ///
    /// `actions`: `[M × action width]`, one row per copy. A discrete action is the index of its
    /// value. Rows of copies that are not live are ignored.
    fn step(&mut self, actions: &[f32]);

    /// The current observation of each copy: `[M × observations]`, one row per copy.
    fn observations(&self) -> &[f32];

    /// What is recorded beside the present observation of each copy: `[M × info]`, one row per copy. The
    /// default has nothing.
    fn info(&self) -> &[f32] {
        &[]
    }

    /// The reward of the latest step of each copy: `[M]`.
    fn rewards(&self) -> &[f32];

    /// Whether the episode of each copy is running, and if not, how it ended: `[M]`.
    fn statuses(&self) -> &[Status];

    /// The first thing in the present or latest episode of `copy` that the physics cannot have computed
    /// well, such as a velocity far beyond its range. It may allocate. The default has none.
    fn physics_warning(&self, _copy: usize) -> Option<PhysicsWarning> {
        None
    }

    /// The whole state of one copy as bytes, from which [`restore`](Self::restore) continues with
    /// the same bits.
    fn save(&self, copy: usize) -> Vec<u8>;

    /// Sets a copy to a state that [`save`](Self::save) returned, for any copy of the task.
    ///
    /// # Errors
    /// The bytes are not a state of this task.
    fn restore(&mut self, copy: usize, bytes: &[u8]) -> Result<(), String>;

    /// The bodies to draw; `None` (the default) if there is nothing to draw.
    fn scene(&self) -> Option<&Scene> {
        None
    }

    /// Writes where the bodies of `copy` are now, in the order of the scene: `[bodies]`.
    fn poses(&self, _copy: usize, _poses: &mut [Pose]) {}

    /// The ground of `copy`, which differs from episode to episode, as lines of points in m. This is
    /// called only to draw, so that it may allocate. The default has none.
    fn terrain(&self, _copy: usize) -> Vec<Vec<[f32; 2]>> {
        Vec::new()
    }

    /// Appends the forces of the latest step of `copy`, as they act on bodies that are at `poses`:
    /// `[bodies]`, in the order of the scene. There are none directly after a reset. This is called
    /// only to draw, so that it may allocate.
    fn forces(&self, _copy: usize, _poses: &[Pose], _forces: &mut Vec<Force>) {}
}

/// Names of the numbers in which episodes of a task can be started.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StartNames {
    /// The coordinates: joints, then `NAME.x`, `NAME.y` and `NAME.angle` of each free body.
    pub coordinates: Vec<String>,
    /// The numbers that are drawn at the start of each episode.
    pub episode_numbers: Vec<String>,
}

/// A start state that is given instead of drawn: pairs of an index in [`StartNames`] and a number.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GivenStart {
    /// Positions of coordinates, m or rad.
    pub positions: Vec<(usize, f64)>,
    /// Velocities of coordinates, m/s or rad/s.
    pub velocities: Vec<(usize, f64)>,
    /// Numbers that are drawn at the start of each episode otherwise.
    pub episode_numbers: Vec<(usize, f64)>,
}

/// What moves the bodies of a task.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub enum Physics {
    /// Rigid-body physics of Rapier. Tabular tasks have no bodies and run with this setting too.
    #[default]
    Rapier,
    /// The task's analytic model, if it has one.
    Analytic,
}

/// Whether an episode is running, and if not, how it ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// No episode is running, for example because none has started. The copy is not stepped.
    #[default]
    Idle,
    /// The episode is running.
    Running,
    /// The episode reached a terminal state: no reward can follow.
    Terminated,
    /// The episode reached the time limit.
    Truncated,
}

impl Status {
    /// Name as in `episodes.csv`, such as `terminated`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Running => "running",
            Self::Terminated => "terminated",
            Self::Truncated => "truncated",
        }
    }
}

/// A task as an agent sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct TaskSpec {
    /// Name of the task: the stem of its file.
    pub name: String,
    /// One sentence for people.
    pub description: String,
    /// The observed quantities, in order.
    pub observations: Vec<Quantity>,
    /// Components of an action, in order.
    pub actions: Vec<Action>,
    /// Time between two actions, s.
    pub control_step: f64,
    /// Steps after which an episode is truncated.
    pub time_limit: u32,
    /// Mean return at which the task counts as solved, if there is an agreed one.
    pub reward_threshold: Option<f32>,
    /// What is recorded in each state beside the observation, in order. Agents do not see it.
    pub info: Vec<Quantity>,
}

/// A named number with its unit, and the range over which it is displayed and its coverage is
/// counted.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantity {
    /// Name, unique within its task.
    pub name: String,
    /// SI unit, for example `m/s`; empty for a pure number.
    pub unit: String,
    /// Minimum and maximum of the display range. Values outside may occur.
    pub range: [f32; 2],
}

/// One component of an action.
#[derive(Clone, Debug, PartialEq)]
pub struct Action {
    /// Name, unit and range.
    pub quantity: Quantity,
    /// Values that may be chosen.
    pub choice: Choice,
}

/// The values that may be chosen for one component of an action.
#[derive(Clone, Debug, PartialEq)]
pub enum Choice {
    /// One of these values. The action is the index of the value.
    Discrete(Vec<f32>),
    /// Any number within the quantity's range. The action is clamped to it.
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

/// A force, to be drawn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Force {
    /// What causes the force.
    pub source: ForceSource,
    /// Point of application in the world, m.
    pub at: [f32; 2],
    /// Components to the right and upwards, N.
    pub newtons: [f32; 2],
}

/// What causes a force.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ForceSource {
    /// The agent's action. A torque is drawn as the force at the body's center of mass that has the
    /// same effect.
    Action,
    /// Contact with another surface.
    Contact,
}

/// The drawable bodies of a task.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// One entry per body, in the order of the poses.
    pub bodies: Vec<SceneBody>,
    /// Index (in `bodies`) of the body that the view follows.
    pub tracked: Option<usize>,
    /// Ropes between bodies.
    pub ropes: Vec<SceneRope>,
}

/// A rope, which is drawn as a line between its two ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SceneRope(pub [SceneRopeEnd; 2]);

/// A point that a rope is tied to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SceneRopeEnd {
    /// Index of the body in [`Scene::bodies`]; `None` is the world.
    pub body: Option<usize>,
    /// The point in the body's frame, m.
    pub at: [f32; 2],
}

/// One drawable body.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneBody {
    /// Name of the body in its file.
    pub name: String,
    /// Whether the body never moves.
    pub is_fixed: bool,
    /// Red, green and blue, if the task gives them.
    pub color: Option<[u8; 3]>,
    /// Shapes in the body's own frame.
    pub shapes: Vec<Shape>,
    /// Position of the hinge about which the body turns, in the body's frame, m.
    pub hinge: Option<[f32; 2]>,
}

/// A shape in its body's frame; lengths in m, angles in rad.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A disc.
    Ball {
        /// Center.
        center: [f32; 2],
        /// Radius.
        radius: f32,
    },
    /// A rectangle.
    Box {
        /// Center.
        center: [f32; 2],
        /// Half width and half height.
        half_size: [f32; 2],
        /// Rotation about the center.
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
    /// An open line, for example a terrain or a rail.
    Polyline(Vec<[f32; 2]>),
}

impl TaskSpec {
    /// A task with control steps of 0.1 s, a time limit of 1,000 steps and no reward threshold. All
    /// fields are public: change what differs.
    #[must_use]
    pub fn new(name: &str, observations: Vec<Quantity>, actions: Vec<Action>) -> Self {
        Self {
            name: name.to_owned(),
            description: String::new(),
            observations,
            actions,
            control_step: 0.1,
            time_limit: 1000,
            reward_threshold: None,
            info: Vec::new(),
        }
    }

    /// Number of components of an observation.
    #[must_use]
    pub fn observation_width(&self) -> usize {
        self.observations.len()
    }

    /// Number of components of an action.
    #[must_use]
    pub fn action_width(&self) -> usize {
        self.actions.len()
    }
}

impl Quantity {
    /// A quantity with its unit and display range.
    #[must_use]
    pub fn new(name: &str, unit: &str, range: [f32; 2]) -> Self {
        Self {
            name: name.to_owned(),
            unit: unit.to_owned(),
            range,
        }
    }
}

impl Action {
    /// A component of an action that is one of `values`, which must not be empty.
    #[must_use]
    pub fn discrete(name: &str, unit: &str, values: &[f32]) -> Self {
        let min = values.iter().copied().fold(f32::MAX, f32::min);
        let max = values.iter().copied().fold(f32::MIN, f32::max);
        Self {
            quantity: Quantity::new(name, unit, [min, max]),
            choice: Choice::Discrete(values.to_vec()),
        }
    }

    /// A component of an action that is any number within `range`.
    #[must_use]
    pub fn continuous(name: &str, unit: &str, range: [f32; 2]) -> Self {
        Self {
            quantity: Quantity::new(name, unit, range),
            choice: Choice::Continuous,
        }
    }
}
