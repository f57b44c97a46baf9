//! A task as checked and resolved data: names have become indices, formulas programs, defaults numbers.
//!
//! [`file`](super::file) makes it from `envs/*.ron`; [`task`](super::task) and the [`dynamics`](super::dynamics) are built from
//! it. Its fields may be varied before building, as tests of solver settings do. Reading files may not enter.

mod columns;
mod distribution;
mod instruments;

pub use columns::Columns;
pub use distribution::Distribution;
pub use instruments::{Actuator, BodyPoint, Drive, Ray, Reading, Sensor, Servo, Target};

use super::expression::Program;
use super::tabular::environment::Finite;
use super::{Scene, Shape, Spec};

/// One task.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// The file it was read from.
    pub origin: String,
    /// The task as seen from outside.
    pub spec: Spec,
    /// What is drawn: the world's own shapes first, if there are any, then every body.
    pub scene: Option<Scene>,
    /// m/s², to the right and upwards.
    pub gravity: [f64; 2],
    /// How exactly motion is computed.
    pub solver: Solver,
    /// The rigid bodies.
    pub bodies: Vec<Body>,
    /// What bodies hang on: at most one joint a body, parents before their children.
    pub joints: Vec<Joint>,
    /// The bodies that hang on nothing.
    pub free: Vec<usize>,
    /// What bodies and the world touch each other with.
    pub colliders: Vec<Collider>,
    /// One for each component of an action, in the same order.
    pub actuators: Vec<Actuator>,
    /// What formulas may read beside observations and actions.
    pub sensors: Vec<Sensor>,
    /// Forces of nature beside gravity.
    pub fields: Vec<Field>,
    /// Bodies that are drawn elsewhere than they are.
    pub drawings: Vec<Drawing>,
    /// Observations, reward, termination.
    pub formulas: Formulas,
    /// Where episodes start; coordinates that are not mentioned start at rest at the reference poses.
    pub reset: Vec<Start>,
    /// The task's closed-form twin, if it has one.
    pub twin: Option<Twin>,
    /// The tables of a finite task, which has neither bodies nor formulas.
    pub finite: Option<Finite>,
}

/// How exactly motion is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Solver {
    /// Substeps in one control step. The error falls as 1 / iterations.
    pub iterations: u32,
    /// Passes over all joints in one substep; chains of several hinges need more than 1.
    pub passes: u32,
    /// Times in a control step that contacts are searched for; each is followed by `iterations` substeps.
    pub searches: u32,
}

/// A rigid body, described at its reference pose: where it is when all joint coordinates are 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Unique among bodies.
    pub name: String,
    /// Origin of the body's frame in the world, m.
    pub position: [f64; 2],
    /// Angle of the body's frame, rad, counter-clockwise.
    pub angle: f64,
    /// Mass, centre and inertia.
    pub inertial: Inertial,
    /// Shapes in the body's frame.
    pub shapes: Vec<Shape>,
}

/// How a body resists forces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertial {
    /// kg
    pub mass: f64,
    /// Centre of mass in the body's frame, m.
    pub com: [f64; 2],
    /// About the centre of mass, kg m².
    pub inertia: f64,
}

/// A surface that touches others.
#[derive(Clone, Debug, PartialEq)]
pub struct Collider {
    /// By which sensors refer to it; unique among colliders.
    pub name: Option<String>,
    /// The body that it belongs to; none is the world.
    pub body: Option<usize>,
    /// In the body's frame.
    pub surface: Surface,
    /// Coefficient μ of dry friction; of two surfaces the larger counts.
    pub friction: f64,
    /// Coefficient of restitution, from 0 (no bounce) to 1; of two surfaces the larger counts.
    pub restitution: f64,
    /// Bits of the kinds that the surface is of.
    pub contype: u32,
    /// Bits of the kinds that it touches. Two surfaces touch if one is of a kind that the other touches.
    pub conaffinity: u32,
}

/// The form of a collider.
#[derive(Clone, Debug, PartialEq)]
pub enum Surface {
    /// An area, or an open line whose right-hand side is outside.
    Shape(Shape),
    /// All that lies behind an endless line.
    HalfSpace {
        /// A point of the line.
        point: [f32; 2],
        /// Unit vector to the outside.
        normal: [f32; 2],
    },
}

/// What a body hangs on. Its coordinate is 0 at the reference poses.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Unique among joints.
    pub name: String,
    /// The body that carries it; none is the world.
    pub parent: Option<usize>,
    /// The body that moves with it.
    pub child: usize,
    /// Where the joint is, in the child's frame, m.
    pub anchor: [f64; 2],
    /// How the child may move.
    pub kind: JointKind,
    /// Lowest and highest coordinate, m or rad.
    pub range: Option<[f64; 2]>,
    /// What resists motion along the coordinate.
    pub passive: Passive,
}

/// What resists motion along a joint's coordinate q: the force −damping q̇ − stiffness (q − springref) and dry friction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Passive {
    /// N s/m or N m s/rad.
    pub damping: f64,
    /// Dry friction, N or N m: holds up to this force, then slides against it.
    pub frictionloss: f64,
    /// Inertia of a rotor that turns with the coordinate, kg or kg m². It has no weight.
    pub armature: f64,
    /// N/m or N m/rad.
    pub stiffness: f64,
    /// Where the spring is at rest, m or rad.
    pub springref: f64,
}

/// A force that depends on the state and on the action. It is computed before each control step and constant during it.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// What it acts on: a joint or a body.
    pub drive: Drive,
    /// N or N m, over sensors and actions.
    pub force: Program,
}

/// Draws a body elsewhere than it is: a car that the equations move along x only, on its hill.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// Which body.
    pub body: usize,
    /// Added to the drawn height, m, over sensors.
    pub y: Program,
    /// Added to the drawn angle, rad, over sensors.
    pub angle: Program,
}

/// How a joint lets its child move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum JointKind {
    /// Along an axis; the coordinate is in m.
    Slide {
        /// Unit vector in the child's frame.
        axis: [f64; 2],
    },
    /// About the anchor; the coordinate is in rad.
    Hinge {
        /// +1 if the coordinate grows counter-clockwise, −1 if clockwise.
        sense: f64,
    },
    /// Not at all; the coordinate is always 0.
    Weld,
}

/// The task's formulas over a table whose columns are: sensors, observations, actions, fields, sensors before the step,
/// observations before the step. See [`Columns`].
#[derive(Clone, Debug, PartialEq)]
pub struct Formulas {
    /// One program an observation, over sensors only.
    pub observations: Vec<Program>,
    /// The reward of a step.
    pub reward: Program,
    /// Whether the task ends after a step.
    pub terminated: Program,
}

/// Where a joint starts an episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Which joint.
    pub coordinate: usize,
    /// m or rad.
    pub position: Distribution,
    /// m/s or rad/s.
    pub velocity: Distribution,
}

/// A closed-form twin: exact equations of motion instead of rigid bodies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Twin {
    /// A cart on a level rail with a pole that swings without friction.
    CartPole {
        /// Joint between the world and the cart.
        slider: usize,
        /// Joint between the cart and the pole.
        hinge: usize,
    },
    /// A body that swings about a fixed point without friction.
    Pendulum {
        /// Joint between the world and the body.
        hinge: usize,
    },
    /// Two bodies in a chain that swings about a fixed point without friction.
    Acrobot {
        /// Joint between the world and the upper link.
        shoulder: usize,
        /// Joint between the links.
        elbow: usize,
    },
    /// A car on a level rail in a field of force, between inelastic walls.
    MountainCar {
        /// Joint between the world and the car.
        slider: usize,
    },
}

impl Description {
    /// A finite task.
    #[must_use]
    pub fn of_finite(origin: &str, spec: Spec, finite: Finite) -> Self {
        Self {
            origin: origin.to_owned(),
            spec,
            scene: None,
            gravity: [0.0; 2],
            solver: Solver {
                iterations: 1,
                passes: 1,
                searches: 1,
            },
            bodies: Vec::new(),
            joints: Vec::new(),
            free: Vec::new(),
            colliders: Vec::new(),
            actuators: Vec::new(),
            sensors: Vec::new(),
            fields: Vec::new(),
            drawings: Vec::new(),
            formulas: Formulas {
                observations: Vec::new(),
                reward: Program::zero(),
                terminated: Program::zero(),
            },
            reset: Vec::new(),
            twin: None,
            finite: Some(finite),
        }
    }

    /// Where each kind of number stands in the table that formulas read.
    #[must_use]
    pub fn columns(&self) -> Columns {
        Columns {
            sensors: self.sensors.len(),
            observations: self.spec.observations.len(),
            actions: self.actuators.len(),
            fields: self.fields.len(),
        }
    }

    /// Number of coordinates: one a joint, then x, y and angle of each free body.
    #[must_use]
    pub fn coordinates(&self) -> usize {
        self.joints.len() + 3 * self.free.len()
    }

    /// The coordinates at the reference poses: 0 for joints.
    #[must_use]
    pub fn reference(&self) -> Vec<f64> {
        let pose = |&body: &usize| {
            let Body {
                position: [x, y],
                angle,
                ..
            } = self.bodies[body];
            [x, y, angle]
        };
        vec![0.0; self.joints.len()]
            .into_iter()
            .chain(self.free.iter().flat_map(pose))
            .collect()
    }

    /// Whether each copy needs a world of its own: if bodies may touch something, hang on nothing, or are pushed directly.
    #[must_use]
    pub fn needs_worlds(&self) -> bool {
        let drives = self
            .actuators
            .iter()
            .map(|actuator| actuator.drive)
            .chain(self.fields.iter().map(|field| field.drive));
        let pushes = |drive| matches!(drive, Drive::BodyForce { .. });
        drives.into_iter().any(pushes) || !self.colliders.is_empty() || !self.free.is_empty()
    }
}
