//! The schema of `envs/*.ron`: what a task file may say, in MuJoCo's words and SI units.
//!
//! Lengths are in m, angles in rad, masses in kg, times in s; x points to the right, y upwards, angles grow counter-clockwise.
//! [`load`] reads a file and checks everything that it says, formulas included: a [`Description`] can always be built. Types and
//! ranges are checked while reading, names that refer to something by `resolve`. Building and stepping may not enter.

mod checked;
mod instruments;
mod joint;
mod resolve;
mod surfaces;

use std::path::Path;

use serde::Deserialize;

pub use checked::{Direction, Interval, Name, Vector};
pub use instruments::{ActuatorKind, Axis, ForceFrame, SensorKind};
pub use surfaces::{Collider, Geom, Points};

use super::description::Description;
use super::tabular;
use crate::input::numbers::{Count, Finite, NonNegative, Positive, UpToTen, known, known_count};
use crate::input::{self, Document, InputError, Kind, Located};

/// A task file: `Environment(…)`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename = "Environment", deny_unknown_fields)]
pub struct Environment {
    /// One sentence for people.
    pub description: String,
    /// Acceleration of free fall, m/s².
    pub gravity: Vector,
    /// Seconds between two actions.
    pub control_step: UpToTen,
    /// Steps after which an episode is truncated.
    pub time_limit: Count,
    /// Mean return at which the task counts as solved.
    #[serde(default)]
    pub reward_threshold: Option<Finite>,
    /// How exactly motion is computed.
    #[serde(default)]
    pub solver: Solver,
    /// Shapes that stand still in the world, for drawing.
    #[serde(default)]
    pub scenery: Vec<Geom>,
    /// What stands still in the world and can be touched; drawn as well.
    #[serde(default)]
    pub colliders: Vec<Collider>,
    /// The body that pictures go along with; by default they stand still.
    #[serde(default)]
    pub tracked: Option<Located<String>>,
    /// The rigid bodies.
    pub bodies: Vec<Body>,
    /// What the bodies hang on: at most one joint a body, parents before their children. A body without one is free: it has the
    /// coordinates `NAME.x`, `NAME.y` and `NAME.angle`, where its frame is in the world.
    #[serde(default)]
    pub joints: Vec<Joint>,
    /// What the agent drives.
    pub actuators: Vec<Actuator>,
    /// What is measured.
    pub sensors: Vec<Sensor>,
    /// What the agent sees.
    pub observations: Vec<Observation>,
    /// Formula of the reward of a step, over observations, actions and sensors after it.
    pub reward: Located<String>,
    /// Formula that says whether the task has come to its own end.
    #[serde(default = "never")]
    pub terminated: Located<String>,
    /// Where episodes start; joints that are not mentioned start at rest at 0, free bodies at rest where the file puts them.
    #[serde(default)]
    pub reset: Vec<Start>,
    /// The closed-form twin of the task.
    #[serde(default)]
    pub analytic: Option<Twin>,
}

/// How exactly motion is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Solver {
    /// Substeps in one control step. The error falls as 1 / iterations.
    pub iterations: Count<1000>,
    /// Passes over all joints in one substep; chains of several hinges need more than 1.
    pub passes: Count<1000>,
    /// Times in a control step that contacts are searched for; each is followed by `iterations` substeps.
    pub searches: Count<1000>,
}

/// A rigid body at its reference pose: where it is when all joint coordinates are 0.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Unique among bodies.
    pub name: Located<Name>,
    /// Origin of the body's frame in the world.
    #[serde(default)]
    pub position: Vector,
    /// Angle of the body's frame.
    #[serde(default)]
    pub angle: Option<Finite>,
    /// kg
    pub mass: Positive,
    /// Centre of mass in the body's frame; by default that of the shapes.
    #[serde(default)]
    pub com: Option<Vector>,
    /// About the centre of mass, kg m²; by default that of the shapes, filled evenly.
    #[serde(default)]
    pub inertia: Option<Positive>,
    /// Shapes in the body's frame, for drawing and for what of mass, centre and inertia is left out.
    #[serde(default)]
    pub geoms: Vec<Geom>,
    /// Shapes in the body's frame that touch others; drawn and weighed as well.
    #[serde(default)]
    pub colliders: Vec<Collider>,
    /// Forces of nature on the body.
    #[serde(default)]
    pub forces: Vec<Force>,
    /// Where it is drawn, if elsewhere than it is.
    #[serde(default)]
    pub drawn: Option<Drawn>,
}

/// A force on a body. Computed before each control step, constant during it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Force {
    /// Formula over sensors and actions of its part to the right, N.
    #[serde(default = "zero")]
    pub x: Located<String>,
    /// Formula over sensors and actions of its part upwards, N.
    #[serde(default = "zero")]
    pub y: Located<String>,
    /// Where it acts, in the body's frame; by default at the centre of mass.
    #[serde(default)]
    pub at: Option<Vector>,
    /// Whose right and up are meant.
    #[serde(default)]
    pub frame: ForceFrame,
}

/// Draws a body elsewhere than it is. Motion does not change.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drawn {
    /// Formula over sensors: added to the drawn height, m.
    #[serde(default = "zero")]
    pub y: Located<String>,
    /// Formula over sensors: added to the drawn angle, rad.
    #[serde(default = "zero")]
    pub angle: Located<String>,
}

/// What a body hangs on. The coordinate is 0 at the reference poses.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// Unique among joints.
    pub name: Located<Name>,
    /// `world`, or a body that hangs on an earlier joint.
    pub parent: Located<String>,
    /// The body that moves.
    pub child: Located<String>,
    /// Where the joint is, in the child's frame.
    #[serde(default)]
    pub anchor: Vector,
    /// How the child may move.
    #[serde(rename = "type")]
    pub kind: Located<JointKind>,
    /// Lowest and highest coordinate, m or rad.
    #[serde(default)]
    pub range: Option<Located<Interval>>,
    /// Resistance per rate, N s/m or N m s/rad.
    #[serde(default)]
    pub damping: Option<Located<NonNegative>>,
    /// Dry friction, N or N m.
    #[serde(default)]
    pub frictionloss: Option<Located<NonNegative>>,
    /// Inertia of a rotor that turns with the coordinate, kg or kg m².
    #[serde(default)]
    pub armature: Option<Located<NonNegative>>,
    /// Of a spring, N/m or N m/rad.
    #[serde(default)]
    pub stiffness: Option<Located<NonNegative>>,
    /// Where the spring is at rest; 0 by default.
    #[serde(default)]
    pub springref: Option<Located<Finite>>,
    /// Formula over sensors and actions of a force along the coordinate, N or N m. Computed before each control step, constant during it.
    #[serde(default)]
    pub force: Option<Located<String>>,
}

/// How a joint lets its child move.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum JointKind {
    /// Along a direction of the child's frame; coordinate in m.
    Slide {
        /// Where the coordinate grows.
        axis: Direction,
    },
    /// About the anchor; coordinate in rad.
    Hinge {
        /// Where the coordinate grows.
        #[serde(default)]
        positive: Sense,
    },
    /// Not at all.
    Weld,
}

/// A sense of rotation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum Sense {
    /// From x to y.
    #[default]
    CounterClockwise,
    /// From y to x.
    Clockwise,
}

/// What one component of an action drives.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Actuator {
    /// Unique among actions, observations and sensors. Formulas read the control by it.
    pub name: Located<Name>,
    /// What it acts on.
    #[serde(rename = "type")]
    pub kind: ActuatorKind,
    /// What the agent may choose.
    pub control: Control,
    /// Force or torque for each unit of control; 1 by default.
    #[serde(default)]
    pub gear: Option<Finite>,
    /// Unit of the control, for people.
    #[serde(default)]
    pub unit: String,
}

/// What the agent may choose.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "checked::AnyControl")]
pub enum Control {
    /// One of these values.
    Discrete(Values),
    /// `Continuous(low, high)`: any number from low to high.
    Continuous(Interval),
}

/// At least two numbers.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "Vec<Finite>")]
pub struct Values(Vec<Finite>);

/// A measured number.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Unique among sensors.
    pub name: Located<Name>,
    /// What is measured.
    #[serde(rename = "type")]
    pub kind: SensorKind,
}

/// A number that the agent sees.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Observation {
    /// Unique among observations.
    pub name: Located<Name>,
    /// Formula over sensors; by default the sensor of the same name.
    #[serde(default)]
    pub value: Option<Located<String>>,
    /// For people.
    #[serde(default)]
    pub unit: String,
    /// Over which it is displayed and its coverage is counted.
    pub range: Interval,
}

/// Where a coordinate starts an episode.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Start {
    /// Which joint, or which coordinate of a free body, such as `NAME.x`.
    pub joint: Located<String>,
    /// m or rad; by default where the file draws it.
    #[serde(default)]
    pub position: Option<Distribution>,
    /// m/s or rad/s.
    #[serde(default)]
    pub velocity: Distribution,
}

/// How a number is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "checked::AnyDistribution")]
pub enum Distribution {
    /// Always the same.
    Constant(Finite),
    /// `Uniform(low, high)`: any number from low to high, evenly.
    Uniform(Interval),
    /// `Normal(mean, deviation)`: Gaussian.
    Normal(Finite, Positive),
}

/// The closed-form twin of a task.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Twin {
    /// A cart on a level rail, and a pole that swings on it without friction.
    CartPole {
        /// Joint between the world and the cart.
        slider: Located<String>,
        /// Joint between the cart and the pole.
        hinge: Located<String>,
    },
    /// A body that swings about a fixed point without friction.
    Pendulum {
        /// Joint between the world and the body.
        hinge: Located<String>,
    },
    /// Two links in a chain that swings about a fixed point without friction.
    Acrobot {
        /// Joint between the world and the upper link.
        shoulder: Located<String>,
        /// Joint between the links.
        elbow: Located<String>,
    },
    /// A car on a level rail in a field of force, between inelastic walls.
    MountainCar {
        /// Joint between the world and the car.
        slider: Located<String>,
    },
}

/// Reads and checks the task file at `path`.
///
/// # Errors
/// The file cannot be read, or something in it is wrong.
pub fn load(path: &Path) -> Result<Description, InputError> {
    let name = path
        .file_stem()
        .map(|stem| stem.to_string_lossy().into_owned())
        .unwrap_or_default();
    parse(&name, &path.display().to_string(), input::read_text(path)?)
}

/// Checks the text of a task file; `origin` stands in the place of the file's name in errors.
///
/// # Errors
/// Something in it is wrong.
pub fn parse(name: &str, origin: &str, text: String) -> Result<Description, InputError> {
    match input::kind(origin, &text) {
        Ok(Kind::TabularEnvironment) => tabular::file::parse(name, origin, text),
        _ => describe(name, &input::parse(origin, text)?),
    }
}

fn describe(name: &str, document: &Document<Environment>) -> Result<Description, InputError> {
    resolve::description(name, &document.origin, &document.value)
        .map_err(|complaint| document.locate(complaint))
}

impl Default for Solver {
    fn default() -> Self {
        Self {
            iterations: known_count(4),
            passes: known_count(1),
            searches: known_count(1),
        }
    }
}

impl Default for Distribution {
    fn default() -> Self {
        Self::Constant(known(0.0))
    }
}

impl Values {
    /// The numbers, in f32.
    #[must_use]
    pub fn get(&self) -> Vec<f32> {
        self.0.iter().map(|value| value.get() as f32).collect()
    }
}

impl TryFrom<Vec<Finite>> for Values {
    type Error = String;

    fn try_from(values: Vec<Finite>) -> Result<Self, String> {
        if values.len() >= 2 {
            Ok(Self(values))
        } else {
            Err(format!(
                "expected at least 2 values, found {}",
                values.len()
            ))
        }
    }
}

fn zero() -> Located<String> {
    Located::from("0".to_owned())
}

fn never() -> Located<String> {
    Located::from("false".to_owned())
}
