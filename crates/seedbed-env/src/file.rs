//! The schema of task files (`envs/*.ron`): field names follow MuJoCo's MJCF where it has an
//! equivalent, units are SI.
//!
//! Lengths are in m, angles in rad, masses in kg, times in s; x points to the right, y upwards,
//! and angles grow counter-clockwise. [`load`] reads a file and checks everything in it, formulas
//! included, so that a [`TaskDescription`] can always be built. Types and ranges are checked while
//! the file is read, references by name afterwards (`resolve`). A file may extend another
//! (`extends`). This module must not depend on building or stepping.

mod actuators;
mod checked;
mod extends;
mod joint_tree;
mod joints;
mod markers;
mod resolve;
mod resolver;
mod sensors;
mod surfaces;
mod surroundings;
mod terrain;

use std::path::Path;

use seedbed_settings::Settings;
use serde::Deserialize;

pub use actuators::{ActuatorKind, ForceFrame};
pub use checked::{Direction, HexColor, Name, Vector, WholeNumbers};
pub use extends::{FieldPlace, find_field};
pub use markers::Marker;
pub use sensors::{Axis, SensorKind};
pub use surfaces::{Collider, Geom, Points};
pub use surroundings::{Fluid, Rope, RopeEnd, Softness};
pub use terrain::{Terrain, TerrainValue};

use super::description::{Integrator, TaskDescription};
use super::gymnasium;
use super::tabular;
use extends::MergedText;
use seedbed_input::limits::{MAX_ENTRIES, short_list};
use seedbed_input::numbers::{
    Count, FiniteNumber, Interval, NonNegative, Positive, StepTime, ranged_count, ranged_number,
};
use seedbed_input::{Disk, FileKind, FileSource, InputError, Located};

/// A task file: `Environment(…)`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename = "Environment", deny_unknown_fields)]
pub struct TaskFile {
    /// The task file that this one extends, by stem or by path. It is always `None` after reading,
    /// because the fields of that file replace `extends` before the text is parsed.
    #[serde(default)]
    pub extends: Option<Located<String>>,
    /// One sentence for people.
    pub description: String,
    /// Acceleration of free fall, m/s².
    pub gravity: Vector,
    /// Time between two actions, s.
    pub control_step: Located<StepTime>,
    /// Steps after which an episode is truncated.
    pub time_limit: Count,
    /// Mean return at which the task counts as solved.
    #[serde(default)]
    pub reward_threshold: Option<FiniteNumber>,
    /// How accurately motion is computed.
    #[serde(default)]
    pub solver: Located<Solver>,
    /// Fixed shapes of the world that are only drawn.
    #[serde(default, deserialize_with = "short_list")]
    pub scenery: Vec<Geom>,
    /// Fixed surfaces of the world that can be touched. They are drawn as well.
    #[serde(default, deserialize_with = "short_list")]
    pub colliders: Vec<Collider>,
    /// How soft all contacts are; by default as soft as the solver needs them.
    #[serde(default)]
    pub contact_softness: Option<Softness>,
    /// Maximum distances between points.
    #[serde(default, deserialize_with = "short_list")]
    pub ropes: Vec<Rope>,
    /// What fills the world; by default nothing.
    #[serde(default)]
    pub fluid: Option<Fluid>,
    /// Name of the body that the view follows; by default the view is fixed.
    #[serde(default)]
    pub tracked: Option<Located<String>>,
    /// Rigid bodies.
    #[serde(deserialize_with = "short_list")]
    pub bodies: Vec<Body>,
    /// Joints, parents before their children. A body may be the child of several joints with the
    /// same parent: up to two slides with perpendicular axes, then at most one hinge. A body that is
    /// no joint's child is free: it has the coordinates `NAME.x`, `NAME.y` and `NAME.angle`, the
    /// position and angle of its frame in the world.
    #[serde(default, deserialize_with = "short_list")]
    pub joints: Vec<Joint>,
    /// Numbers that are drawn once per run and that formulas read by name.
    #[serde(default, deserialize_with = "short_list")]
    pub drawn_per_run: Vec<DrawnNumber>,
    /// Numbers that are drawn at the start of each episode and that formulas read by name.
    #[serde(default, deserialize_with = "short_list")]
    pub drawn_per_episode: Vec<DrawnNumber>,
    /// Numbers that are drawn in each step and that formulas read by name.
    #[serde(default, deserialize_with = "short_list")]
    pub drawn_per_step: Vec<DrawnNumber>,
    /// What is drawn at places that formulas give, such as a target.
    #[serde(default, deserialize_with = "short_list")]
    pub markers: Vec<Marker>,
    /// What the agent drives.
    #[serde(deserialize_with = "short_list")]
    pub actuators: Vec<Actuator>,
    /// What is measured.
    #[serde(deserialize_with = "short_list")]
    pub sensors: Vec<Sensor>,
    /// What the agent observes.
    #[serde(deserialize_with = "short_list")]
    pub observations: Vec<Observation>,
    /// Formula of the reward of a step, over observations, actions and sensors after the step.
    pub reward: Located<String>,
    /// Formula that is true if the task terminates after a step.
    #[serde(default = "never")]
    pub terminated: Located<String>,
    /// Where episodes start. Joints that are not mentioned start at rest at 0, free bodies at rest
    /// where the file puts them.
    #[serde(default, deserialize_with = "short_list")]
    pub reset: Vec<StartCoordinate>,
    /// Formula over sensors and drawn numbers: a start is drawn again while it is true, at most 1000
    /// times.
    #[serde(default = "never")]
    pub redrawn_while: Located<String>,
    /// The task's analytic model.
    #[serde(default)]
    pub analytic: Option<AnalyticModel>,
}

/// How accurately motion is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Solver {
    /// Substeps per contact update. The error falls as 1 / substeps.
    #[serde(rename = "iterations")]
    pub substeps: Count<1000>,
    /// Iterations over all constraints per substep. By default 1, or what servos between bodies need. Chains of
    /// several hinges need more than 1.
    #[serde(rename = "passes")]
    pub solver_iterations: Option<Count<1000>>,
    /// Times per control step that contacts are searched for.
    #[serde(rename = "searches")]
    pub contact_updates: Count<1000>,
}

/// A rigid body at its reference pose: where it is when all joint coordinates are 0.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Name, unique among bodies.
    pub name: Located<Name>,
    /// Origin of the body's frame in the world.
    #[serde(default)]
    pub position: Vector,
    /// Angle of the body's frame in the world.
    #[serde(default)]
    pub angle: Option<FiniteNumber>,
    /// Mass, kg.
    pub mass: Positive,
    /// Center of mass in the body's frame; by default that of the shapes.
    #[serde(default)]
    pub com: Option<Vector>,
    /// Moment of inertia about the center of mass, kg m²; by default that of the shapes at uniform
    /// density.
    #[serde(default)]
    pub inertia: Option<Positive>,
    /// Shapes in the body's frame. They are drawn, and give the center of mass and the inertia if
    /// these are left out.
    #[serde(default, deserialize_with = "short_list")]
    pub geoms: Vec<Geom>,
    /// Shapes in the body's frame that touch others. They are drawn and have mass as well.
    #[serde(default, deserialize_with = "short_list")]
    pub colliders: Vec<Collider>,
    /// Lengths of the box as which the body moves through the fluid: along the body's x and y, and
    /// perpendicular to the plane. By default the fluid does not resist it.
    #[serde(default)]
    pub fluid_box: Option<(Positive, Positive, Positive)>,
    /// Whether contacts are also searched for along the body's path (continuous collision detection),
    /// so that it does not pass thin surfaces however fast it is. For bodies without joints only.
    #[serde(default)]
    pub ccd: Option<Located<bool>>,
    /// Forces on the body, given by formulas.
    #[serde(default, deserialize_with = "short_list")]
    pub forces: Vec<Force>,
    /// Color in which the body is drawn; by default that of the agent, or a dark one for every second body.
    #[serde(default)]
    pub color: Option<HexColor>,
    /// Offset between where the body is and where it is drawn.
    #[serde(default, rename = "drawn")]
    pub display_offset: Option<DisplayOffset>,
}

/// A force on a body. It is computed before each control step and constant during it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Force {
    /// Component to the right, N: a formula over sensors and actions.
    #[serde(default = "zero")]
    pub x: Located<String>,
    /// Component upwards, N: a formula over sensors and actions.
    #[serde(default = "zero")]
    pub y: Located<String>,
    /// Point of application in the body's frame; by default the center of mass.
    #[serde(default)]
    pub at: Option<Vector>,
    /// Frame in which x and y are given.
    #[serde(default)]
    pub frame: ForceFrame,
}

/// An offset between where a body is and where it is drawn. It does not change the motion.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename = "Drawn", deny_unknown_fields)]
pub struct DisplayOffset {
    /// Formula over sensors, added to the drawn height, m.
    #[serde(default = "zero")]
    pub y: Located<String>,
    /// Formula over sensors, added to the drawn angle, rad.
    #[serde(default = "zero")]
    pub angle: Located<String>,
}

/// A joint. Its coordinate is 0 at the reference poses.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// Name, unique among joints.
    pub name: Located<Name>,
    /// Name of the parent: `world`, a free body, or the child of an earlier joint.
    pub parent: Located<String>,
    /// Name of the child, the body that moves.
    pub child: Located<String>,
    /// Position of the joint in the child's frame; by default its origin.
    #[serde(default)]
    pub anchor: Vector,
    /// How the child may move.
    #[serde(rename = "type")]
    pub kind: Located<JointKind>,
    /// Minimum and maximum of the coordinate, m or rad; unlimited by default.
    #[serde(default)]
    pub range: Option<Located<Interval>>,
    /// How soft the ends of the range are; by default hard.
    #[serde(default)]
    pub range_softness: Option<Located<Softness>>,
    /// Damping, N s/m or N m s/rad.
    #[serde(default)]
    pub damping: Option<Located<NonNegative>>,
    /// Dry friction, N or N m.
    #[serde(default)]
    pub frictionloss: Option<Located<NonNegative>>,
    /// Inertia of a rotor that moves with the coordinate, kg or kg m². The rotor has no weight.
    #[serde(default)]
    pub armature: Option<Located<NonNegative>>,
    /// Stiffness of a spring, N/m or N m/rad.
    #[serde(default)]
    pub stiffness: Option<Located<NonNegative>>,
    /// Coordinate at which the spring is at rest; 0 by default.
    #[serde(default)]
    pub springref: Option<Located<FiniteNumber>>,
    /// Force along the coordinate, N or N m: a formula over sensors and actions. It is computed
    /// before each control step and constant during it.
    #[serde(default)]
    pub force: Option<Located<String>>,
}

/// How a joint lets its child move.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum JointKind {
    /// Along a direction of the child's frame; coordinate in m.
    Slide {
        /// Direction in which the coordinate grows.
        axis: Direction,
    },
    /// About the anchor; coordinate in rad.
    Hinge {
        /// Direction of rotation in which the coordinate grows.
        #[serde(default)]
        positive: RotationDirection,
    },
    /// Not at all.
    Weld,
}

/// A direction of rotation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum RotationDirection {
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
    /// Name by which formulas read the control, unique among actions, observations and sensors.
    pub name: Located<Name>,
    /// What the actuator acts on.
    #[serde(rename = "type")]
    pub kind: ActuatorKind,
    /// What the agent may choose.
    pub control: Control,
    /// Force or torque per unit of control; 1 by default.
    #[serde(default)]
    pub gear: Option<FiniteNumber>,
    /// Unit of the control, for people.
    #[serde(default)]
    pub unit: String,
}

/// What the agent may choose.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "checked::unchecked::Control")]
pub enum Control {
    /// One of these values.
    Discrete(DiscreteValues),
    /// `Continuous(low, high)`: any number from low to high.
    Continuous(Interval),
}

/// At least two values of a discrete control.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "Vec<FiniteNumber>")]
pub struct DiscreteValues(Vec<FiniteNumber>);

/// A number that is drawn once per run, the same for all agents and episodes of the run, or at the
/// start of each episode, or in each step.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename = "Number", deny_unknown_fields)]
pub struct DrawnNumber {
    /// Name by which formulas read it, unique among drawn numbers, sensors, observations and
    /// actions; only an observation that shows it may have the same name.
    pub name: Located<Name>,
    /// Its distribution over runs, episodes or steps.
    pub value: Distribution,
}

/// A measured number.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Name, unique among sensors.
    pub name: Located<Name>,
    /// What is measured.
    #[serde(rename = "type")]
    pub kind: SensorKind,
}

/// A number that the agent observes.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Observation {
    /// Name, unique among observations.
    pub name: Located<Name>,
    /// Formula over sensors; by default the sensor of the same name.
    #[serde(default)]
    pub value: Option<Located<String>>,
    /// Unit, for people.
    #[serde(default)]
    pub unit: String,
    /// Range over which it is displayed and its coverage is counted.
    pub range: Interval,
}

/// How a coordinate is drawn at the start of an episode.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename = "Start", deny_unknown_fields)]
pub struct StartCoordinate {
    /// Name of the joint, or of a coordinate of a free body, such as `NAME.x`.
    pub joint: Located<String>,
    /// Position, m or rad; by default that of the reference poses.
    #[serde(default)]
    pub position: Option<Distribution>,
    /// Velocity, m/s or rad/s; 0 by default.
    #[serde(default)]
    pub velocity: Distribution,
}

/// The distribution of a random number.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "checked::unchecked::Distribution")]
pub enum Distribution {
    /// Always this number.
    Constant(FiniteNumber),
    /// `Uniform(low, high)`: uniform from low to high.
    Uniform(Interval),
    /// `Normal(mean, deviation)`: Gaussian.
    Normal(FiniteNumber, Positive),
    /// `WholeNumber(from: 0, to: 7)`: each whole number of the range with equal probability.
    WholeNumber(WholeNumbers),
}

/// The analytic model of a task.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum AnalyticModel {
    /// A cart on a level rail, and a pole that swings on it without friction.
    CartPole {
        /// Name of the joint between the world and the cart.
        slider: Located<String>,
        /// Name of the joint between the cart and the pole.
        hinge: Located<String>,
        /// How the equations of motion are integrated.
        #[serde(default)]
        integrator: Integrator,
    },
    /// A body that swings about a fixed point without friction.
    Pendulum {
        /// Name of the joint between the world and the body.
        hinge: Located<String>,
    },
    /// Two links in a chain that swings about a fixed point without friction.
    Acrobot {
        /// Name of the joint between the world and the upper link.
        shoulder: Located<String>,
        /// Name of the joint between the links.
        elbow: Located<String>,
    },
    /// A car on a level rail under a force that depends on its position, between inelastic walls.
    MountainCar {
        /// Name of the joint between the world and the car.
        slider: Located<String>,
    },
}

/// Reads and checks the task file at `path`.
///
/// # Errors
/// The file, or one that it extends, cannot be read, or something in it is wrong.
pub fn load(path: &Path) -> Result<TaskDescription, InputError> {
    load_from(&Disk, path).map(|(description, _)| description)
}

/// Like [`load`], but reads files from `source` and also returns the text of a task file that
/// describes the same task and extends no other file: the text of the file itself, or its text
/// merged with those of the files that it extends. Each file is read once, so that the text belongs
/// to the description even if a file changes in the meantime.
///
/// # Errors
/// Those of [`load`].
pub fn load_from(
    source: &dyn FileSource,
    path: &Path,
) -> Result<(TaskDescription, String), InputError> {
    let name = path
        .file_stem()
        .map(|stem| stem.to_string_lossy().into_owned())
        .unwrap_or_default();
    let text = MergedText::read(source, path)?;
    if let Ok(FileKind::Gymnasium) = seedbed_input::file_kind(text.origin(), text.text()) {
        let folder = source.folder_of(path);
        let parsed = gymnasium::parse(&name, text.origin(), &folder, text.text());
        let (task, text) = parsed.map_err(|error| text.locate(error))?;
        return Ok((task.into(), text));
    }
    let description = parse_merged(&name, &text)?;
    Ok((description, text.into_text()))
}

/// Checks the text of a task file. `name` is the name of the task; errors show `origin` in place of
/// a file name. The text cannot extend a file, because it has no folder.
///
/// # Errors
/// Something in the text is wrong.
pub fn parse(name: &str, origin: &str, text: String) -> Result<TaskDescription, InputError> {
    parse_merged(name, &MergedText::without_base(origin, text)?)
}

/// What identifies a task: the values of the text of a task file without those that have their defaults, and without
/// the sentence for people.
///
/// # Panics
/// If the text is not that of a task file.
#[must_use]
pub fn settings(text: &str) -> Settings {
    let settings = match seedbed_input::file_kind("", text) {
        Ok(FileKind::TabularEnvironment) => {
            seedbed_input::settings_of::<tabular::file::TabularTaskFile>(text)
        }
        Ok(FileKind::Gymnasium) => gymnasium::settings(text),
        _ => seedbed_input::settings_of::<TaskFile>(text),
    };
    settings.without("description")
}

fn parse_merged(name: &str, text: &MergedText) -> Result<TaskDescription, InputError> {
    let parsed = match seedbed_input::file_kind(text.origin(), text.text()) {
        Ok(FileKind::TabularEnvironment) => {
            let task = tabular::file::parse(name, text.origin(), text.text());
            task.map(TaskDescription::from)
        }
        Ok(FileKind::Gymnasium) => {
            let task = gymnasium::parse(name, text.origin(), Path::new(""), text.text());
            task.map(|(task, _)| task.into())
        }
        _ => parse_bodies(name, text.origin(), text.text()),
    };
    parsed.map_err(|error| text.locate(error))
}

fn parse_bodies(name: &str, origin: &str, text: &str) -> Result<TaskDescription, InputError> {
    let document = seedbed_input::parse::<TaskFile>(origin, text.to_owned())?;
    if let Some(base) = &document.value.extends {
        return Err(document.locate(base.error("`extends` is given twice")));
    }
    let task = resolver::Resolver::new(&document.value).task(name, origin);
    task.map(TaskDescription::from)
        .map_err(|error| document.locate(error))
}

impl Default for Solver {
    fn default() -> Self {
        Self {
            substeps: ranged_count(4),
            solver_iterations: None,
            contact_updates: ranged_count(1),
        }
    }
}

impl Default for Distribution {
    fn default() -> Self {
        Self::Constant(ranged_number(0.0))
    }
}

impl DiscreteValues {
    /// The numbers, in f32.
    #[must_use]
    pub fn get(&self) -> Vec<f32> {
        self.0.iter().map(|value| value.get() as f32).collect()
    }
}

impl TryFrom<Vec<FiniteNumber>> for DiscreteValues {
    type Error = String;

    fn try_from(values: Vec<FiniteNumber>) -> Result<Self, String> {
        if values.len() > MAX_ENTRIES {
            return Err(format!(
                "expected at most {MAX_ENTRIES} values, found {}",
                values.len()
            ));
        }
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
