//! Checked and resolved tasks: indices have replaced names, programs have replaced formulas, and
//! defaults have replaced omitted fields.
//!
//! [`mod@file`](super::file) makes a [`TaskDescription`] from a task file, and
//! [`build`](super::build()) makes an environment from it. Fields may be changed in between, for
//! example to compare solver settings. This module must not depend on reading files.

mod actuators;
mod column_layout;
mod distribution;
mod drawn_numbers;
mod run_constants;
mod sensors;
mod surroundings;
mod terrain;

pub use actuators::{Actuator, Drive, Servo, ServoTarget};
pub use column_layout::ColumnLayout;
pub use distribution::Distribution;
pub use drawn_numbers::DrawnNumber;
pub use run_constants::RunConstant;
pub use sensors::{BodyPoint, Measurement, Ray, Sensor, Subtree};
pub use surroundings::{Fluid, Rope, RopeEnd, Softness};
pub use terrain::{Terrain, TerrainValue};

use std::borrow::Cow;

use serde::Deserialize;

pub use super::gymnasium::GymnasiumTask;
pub use super::tabular::TabularTask;

use super::expression::Program;
use super::{Scene, Shape, TaskSpec};

/// One task: rigid bodies, a tabular MDP, or an environment of Gymnasium.
#[derive(Clone, Debug, PartialEq)]
pub enum TaskDescription {
    /// Rigid bodies with joints, actuators, sensors and formulas.
    Bodies(Box<BodyTask>),
    /// A finite Markov decision process, given by its tables.
    Tabular(Box<TabularTask>),
    /// An environment of Gymnasium, which Python runs.
    Gymnasium(Box<GymnasiumTask>),
}

/// A task of rigid bodies.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyTask {
    /// File that the task was read from.
    pub origin: String,
    /// The task as an agent sees it.
    pub spec: TaskSpec,
    /// What is drawn: the world's own shapes first, if there are any, then every body, then every
    /// marker.
    pub scene: Option<Scene>,
    /// Acceleration of free fall to the right and upwards, m/s².
    pub gravity: [f64; 2],
    /// How accurately motion is computed.
    pub solver: Solver,
    /// Rigid bodies.
    pub bodies: Vec<Body>,
    /// Joints, parents before their children. A body may be the child of several: up to two slides,
    /// then at most one hinge, which add up.
    pub joints: Vec<Joint>,
    /// Indices of the bodies that are no joint's child.
    pub free_bodies: Vec<usize>,
    /// Surfaces of bodies and of the world that touch each other.
    pub colliders: Vec<Collider>,
    /// How soft all contacts are; `None` is the default of the solver.
    pub contact_softness: Option<Softness>,
    /// Maximum distances between points.
    pub ropes: Vec<Rope>,
    /// What fills the world, if not a vacuum.
    pub fluid: Option<Fluid>,
    /// One actuator per component of an action, in the same order.
    pub actuators: Vec<Actuator>,
    /// Numbers that are drawn once per run, with their values in one run.
    pub run_constants: Vec<RunConstant>,
    /// Numbers that are drawn at the start of each episode.
    pub episode_numbers: Vec<DrawnNumber>,
    /// Numbers that are drawn in each step.
    pub step_numbers: Vec<DrawnNumber>,
    /// What formulas may read besides drawn numbers, observations and actions.
    pub sensors: Vec<Sensor>,
    /// Forces given by formulas, besides gravity.
    pub formula_forces: Vec<FormulaForce>,
    /// Bodies that are drawn at another place than they are.
    pub display_offsets: Vec<DisplayOffset>,
    /// What is drawn but is no body, such as a target.
    pub markers: Vec<Marker>,
    /// Observations, reward, termination.
    pub formulas: Formulas,
    /// Where episodes start. Coordinates that are not mentioned start at rest at the reference
    /// poses.
    pub reset: Vec<StartCoordinate>,
    /// Formula over sensors and drawn numbers that is true for starts that are drawn again.
    pub redrawn_while: Program,
    /// The task's analytic model, if it has one.
    pub analytic_model: Option<AnalyticModel>,
}

/// How accurately motion is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Solver {
    /// Substeps per contact update; `iterations` in a task file. The error falls as 1 / substeps.
    pub substeps: u32,
    /// Iterations over all constraints per substep; `passes` in a task file. Chains of several
    /// hinges need more than 1.
    pub solver_iterations: u32,
    /// Times per control step that contacts are searched for; `searches` in a task file. Each is
    /// followed by `substeps` substeps.
    pub contact_updates: u32,
}

/// A rigid body at its reference pose: where it is when all joint coordinates are 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Name, unique among bodies.
    pub name: String,
    /// Origin of the body's frame in the world, m.
    pub position: [f64; 2],
    /// Angle of the body's frame, rad, counter-clockwise.
    pub angle: f64,
    /// Mass, center of mass and inertia.
    pub inertial: Inertial,
    /// Shapes in the body's frame.
    pub shapes: Vec<Shape>,
    /// Lengths of the box as which the body moves through a fluid, m: along the body's x and y, and
    /// perpendicular to the plane. A fluid does not resist a body without it.
    pub fluid_box: Option<[f64; 3]>,
    /// Whether contacts of the body are also searched for along its path, so that it passes nothing
    /// however fast it is. Only free bodies without joints can have this.
    pub ccd: bool,
}

/// How a body resists forces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inertial {
    /// Mass, kg.
    pub mass: f64,
    /// Center of mass in the body's frame, m.
    pub com: [f64; 2],
    /// Moment of inertia about the center of mass, kg m².
    pub inertia: f64,
}

/// A surface that can touch other surfaces.
#[derive(Clone, Debug, PartialEq)]
pub struct Collider {
    /// Name by which sensors refer to it, unique among colliders.
    pub name: Option<String>,
    /// Index of the body that the surface belongs to; `None` is the world.
    pub body: Option<usize>,
    /// The surface in the body's frame.
    pub surface: Surface,
    /// Coefficient μ of dry friction. The larger one of two surfaces is used.
    pub friction: f64,
    /// Coefficient of restitution, from 0 (no bounce) to 1. The larger one of two surfaces is used.
    pub restitution: f64,
    /// Bits of the collision groups that the surface belongs to.
    pub contype: u32,
    /// Bits of the collision groups that the surface touches. Two surfaces can touch if one belongs
    /// to a group that the other touches.
    pub conaffinity: u32,
}

/// The surface of a collider.
#[derive(Clone, Debug, PartialEq)]
pub enum Surface {
    /// An area, or an open line whose right-hand side is outside.
    Shape(Shape),
    /// Everything behind an infinite line.
    HalfSpace {
        /// A point on the line.
        point: [f32; 2],
        /// Unit vector to the outside.
        normal: [f32; 2],
    },
    /// A line that is drawn at the start of each episode.
    Terrain(Box<Terrain>),
}

/// A joint between two bodies, or between the world and a body. Its coordinate is 0 at the
/// reference poses.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name, unique among joints.
    pub name: String,
    /// Index of the parent body; `None` is the world.
    pub parent: Option<usize>,
    /// Index of the child body.
    pub child: usize,
    /// Position of the joint in the child's frame, m.
    pub anchor: [f64; 2],
    /// How the child may move.
    pub kind: JointKind,
    /// Minimum and maximum of the coordinate, m or rad.
    pub range: Option<[f64; 2]>,
    /// How soft the ends of the range are; `None` is the default of the solver.
    pub range_softness: Option<Softness>,
    /// Forces that resist motion along the coordinate.
    pub passive_forces: PassiveForces,
}

/// Passive forces along a joint's coordinate q: −damping q̇ − stiffness (q − springref), dry
/// friction, and the inertia of a rotor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PassiveForces {
    /// Damping, N s/m or N m s/rad.
    pub damping: f64,
    /// Dry friction, N or N m: the joint sticks up to this force and slides against it beyond.
    pub frictionloss: f64,
    /// Inertia of a rotor that moves with the coordinate, kg or kg m². The rotor has no weight.
    pub armature: f64,
    /// Stiffness of the spring, N/m or N m/rad.
    pub stiffness: f64,
    /// Coordinate at which the spring is at rest, m or rad.
    pub springref: f64,
}

/// A force given by a formula of the state and the action. It is computed before each control step
/// and constant during it.
#[derive(Clone, Debug, PartialEq)]
pub struct FormulaForce {
    /// Joint or body that the force acts on.
    pub drive: Drive,
    /// Formula of the force over sensors and actions, N or N m.
    pub formula: Program,
}

/// An offset between where a body is and where it is drawn. For example, a car that the equations
/// move along x only is drawn on its hill.
#[derive(Clone, Debug, PartialEq)]
pub struct DisplayOffset {
    /// Index of the body.
    pub body: usize,
    /// Formula over sensors, added to the drawn height, m.
    pub y: Program,
    /// Formula over sensors, added to the drawn angle, rad.
    pub angle: Program,
}

/// Shapes that are drawn at a place that formulas give. Nothing touches them.
#[derive(Clone, Debug, PartialEq)]
pub struct Marker {
    /// Name, unique among bodies and markers.
    pub name: String,
    /// Shapes in the marker's frame.
    pub shapes: Vec<Shape>,
    /// Formulas over sensors and drawn numbers of the position (m) and the angle (rad) of the
    /// marker's frame: x, y, angle.
    pub pose: [Program; 3],
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
        sign: f64,
    },
    /// Not at all; the coordinate is always 0.
    Weld,
}

/// The task's formulas, over a table of columns. [`ColumnLayout`] gives the order of the columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Formulas {
    /// One program per observation, over sensors only.
    pub observations: Vec<Program>,
    /// Reward of a step.
    pub reward: Program,
    /// Whether the task terminates after a step.
    pub terminated: Program,
}

/// How a coordinate is drawn at the start of an episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartCoordinate {
    /// Index of the coordinate: the joints' coordinates first, then x, y and angle of each free
    /// body.
    pub coordinate: usize,
    /// Position, m or rad.
    pub position: Distribution,
    /// Velocity, m/s or rad/s.
    pub velocity: Distribution,
}

/// A task's analytic model: closed-form equations of motion instead of rigid bodies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnalyticModel {
    /// A cart on a level rail with a pole that swings without friction.
    CartPole {
        /// Index of the joint between the world and the cart.
        slider: usize,
        /// Index of the joint between the cart and the pole.
        hinge: usize,
        /// How the equations of motion are integrated.
        integrator: Integrator,
    },
    /// A body that swings about a fixed point without friction.
    Pendulum {
        /// Index of the joint between the world and the body.
        hinge: usize,
    },
    /// Two bodies in a chain that swings about a fixed point without friction.
    Acrobot {
        /// Index of the joint between the world and the upper link.
        shoulder: usize,
        /// Index of the joint between the links.
        elbow: usize,
    },
    /// A car on a level rail under a force that depends on its position, between inelastic walls.
    MountainCar {
        /// Index of the joint between the world and the car.
        slider: usize,
    },
}

/// How equations of motion are integrated over a control step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum Integrator {
    /// Sixth-order Runge–Kutta, with an error below the resolution of an f32.
    #[default]
    RungeKutta,
    /// One step of the explicit Euler method, which uses the velocities and accelerations before
    /// the step. Its error is part of the task: it adds energy.
    ///
    /// Source: `CartPoleEnv.step` with `kinematics_integrator == "euler"`,
    /// `gymnasium/envs/classic_control/cartpole.py`.
    Euler,
}

impl TaskDescription {
    /// The task as an agent sees it.
    #[must_use]
    pub fn spec(&self) -> &TaskSpec {
        match self {
            Self::Bodies(task) => &task.spec,
            Self::Tabular(task) => &task.spec,
            Self::Gymnasium(task) => &task.spec,
        }
    }

    /// The task as an agent sees it, to be changed before building.
    pub fn spec_mut(&mut self) -> &mut TaskSpec {
        match self {
            Self::Bodies(task) => &mut task.spec,
            Self::Tabular(task) => &mut task.spec,
            Self::Gymnasium(task) => &mut task.spec,
        }
    }

    /// File that the task was read from.
    #[must_use]
    pub fn origin(&self) -> &str {
        match self {
            Self::Bodies(task) => &task.origin,
            Self::Tabular(task) => &task.origin,
            Self::Gymnasium(task) => &task.origin,
        }
    }

    /// The task of rigid bodies; `None` for other tasks.
    #[must_use]
    pub fn body_task(&self) -> Option<&BodyTask> {
        match self {
            Self::Bodies(task) => Some(task),
            Self::Tabular(_) | Self::Gymnasium(_) => None,
        }
    }

    /// The environment of Gymnasium; `None` for other tasks.
    #[must_use]
    pub fn gymnasium(&self) -> Option<&GymnasiumTask> {
        match self {
            Self::Gymnasium(task) => Some(task),
            Self::Bodies(_) | Self::Tabular(_) => None,
        }
    }

    /// Number of worker processes for `copies` copies of an environment of Gymnasium on `threads`
    /// threads: what the task asks for, or one per thread. 0 for other tasks.
    #[must_use]
    pub fn worker_count(&self, copies: usize, threads: usize) -> usize {
        let task = self.gymnasium();
        task.map_or(0, |task| task.worker_count(copies, threads))
    }

    /// The task of the run with this run seed: itself, or a tabular task with an MDP, or rigid
    /// bodies with constants, that are drawn with the run seed.
    #[must_use]
    pub fn for_run(&self, run_seed: u64) -> Cow<'_, Self> {
        match self {
            Self::Tabular(task) if task.drawn_per_run.is_some() => {
                Cow::Owned(task.for_run(run_seed).into())
            }
            Self::Bodies(task) if !task.run_constants.is_empty() => {
                Cow::Owned(task.for_run(run_seed).into())
            }
            _ => Cow::Borrowed(self),
        }
    }

    /// Whether the task has an analytic model, which [`Physics::Analytic`](super::Physics) runs.
    #[must_use]
    pub fn has_analytic_model(&self) -> bool {
        self.body_task()
            .is_some_and(|task| task.analytic_model.is_some())
    }
}

impl From<BodyTask> for TaskDescription {
    fn from(task: BodyTask) -> Self {
        Self::Bodies(Box::new(task))
    }
}

impl From<GymnasiumTask> for TaskDescription {
    fn from(task: GymnasiumTask) -> Self {
        Self::Gymnasium(Box::new(task))
    }
}

impl From<TabularTask> for TaskDescription {
    fn from(task: TabularTask) -> Self {
        Self::Tabular(Box::new(task))
    }
}

impl BodyTask {
    /// The task of the run with this run seed.
    #[must_use]
    pub fn for_run(&self, run_seed: u64) -> Self {
        let mut task = self.clone();
        for (index, constant) in task.run_constants.iter_mut().enumerate() {
            constant.value = constant.draw(index, run_seed);
        }
        task
    }

    /// The order of the columns that formulas read.
    #[must_use]
    pub fn column_layout(&self) -> ColumnLayout {
        ColumnLayout {
            run_constant_count: self.run_constants.len(),
            episode_number_count: self.episode_numbers.len(),
            step_number_count: self.step_numbers.len(),
            sensor_count: self.sensors.len(),
            observation_count: self.spec.observations.len(),
            action_count: self.actuators.len(),
            formula_force_count: self.formula_forces.len(),
            terrain_point_count: self.terrains().map(|terrain| terrain.points).sum(),
        }
    }

    /// The terrains among the colliders.
    pub fn terrains(&self) -> impl Iterator<Item = &Terrain> {
        let colliders = self.colliders.iter();
        colliders.filter_map(|collider| match &collider.surface {
            Surface::Terrain(terrain) => Some(&**terrain),
            _ => None,
        })
    }

    /// Number of coordinates: one per joint, then x, y and angle of each free body.
    #[must_use]
    pub fn coordinate_count(&self) -> usize {
        self.joints.len() + 3 * self.free_bodies.len()
    }

    /// Names of the coordinates: the joints, then `NAME.x`, `NAME.y` and `NAME.angle` of each free
    /// body.
    #[must_use]
    pub fn coordinate_names(&self) -> Vec<String> {
        let mut names: Vec<_> = self.joints.iter().map(|joint| joint.name.clone()).collect();
        for &body in &self.free_bodies {
            let body = &self.bodies[body].name;
            names.extend(["x", "y", "angle"].map(|axis| format!("{body}.{axis}")));
        }
        names
    }

    /// Time of a substep of the solver, s.
    #[must_use]
    pub fn substep(&self) -> f64 {
        let Solver {
            substeps,
            contact_updates,
            ..
        } = self.solver;
        self.spec.control_step / f64::from(substeps) / f64::from(contact_updates)
    }

    /// The coordinates at the reference poses: 0 for joints.
    #[must_use]
    pub fn reference_coordinates(&self) -> Vec<f64> {
        let mut coordinates = vec![0.0; self.joints.len()];
        for &body in &self.free_bodies {
            let Body {
                position: [x, y],
                angle,
                ..
            } = self.bodies[body];
            coordinates.extend([x, y, angle]);
        }
        coordinates
    }

    /// Whether each copy of the task needs a physics world of its own, because bodies can touch,
    /// are free, are pushed directly, have several joints, or move through a fluid, or because of
    /// joints that need the coordinates of multibodies. Copies of other tasks share a world.
    #[must_use]
    pub fn needs_own_worlds(&self) -> bool {
        let drives = self
            .actuators
            .iter()
            .map(|actuator| actuator.drive)
            .chain(self.formula_forces.iter().map(|force| force.drive));
        let acts_on_body =
            |drive| matches!(drive, Drive::BodyForce { .. } | Drive::BodyTorque { .. });
        drives.into_iter().any(acts_on_body)
            || !self.colliders.is_empty()
            || !self.free_bodies.is_empty()
            || !self.ropes.is_empty()
            || self.fluid.is_some()
            || (0..self.joints.len()).any(|joint| self.needs_multibody(joint))
    }

    /// Whether a joint needs the coordinates of a multibody: it shares its child with another joint,
    /// has an armature that cannot be added to the child's own mass or inertia, because other joints
    /// move the child along the coordinate as well, is a hinge whose range has soft ends, which
    /// yield too far without multibodies, or has a spring or damper that would lock it without them.
    fn needs_multibody(&self, index: usize) -> bool {
        let joint = &self.joints[index];
        let is_hinge = |joint: &Joint| matches!(joint.kind, JointKind::Hinge { .. });
        let mut joints_above =
            std::iter::successors(self.joint_above(joint), |joint| self.joint_above(joint));
        let has_rotor = joint.passive_forces.armature > 0.0;
        let moves_with_others = match joint.kind {
            JointKind::Hinge { .. } => joints_above.any(is_hinge),
            JointKind::Slide { .. } => joints_above.any(|joint| joint.kind != JointKind::Weld),
            JointKind::Weld => false,
        };
        let has_other_joint = self.joints_of(joint.child).count() > 1;
        (has_other_joint && !self.is_on_rails(joint.child))
            || (has_rotor && moves_with_others)
            || (is_hinge(joint) && joint.range_softness.is_some())
            || self.is_too_weak(joint.passive_forces.stiffness, joint.passive_forces.damping)
    }

    /// Whether Rapier takes a motor with these gains for a rigid one: it inverts the impulse per velocity of a
    /// substep h, k h² + d h, and takes the inverses of numbers up to 1e-20 for 0.
    #[must_use]
    pub(crate) fn is_too_weak(&self, stiffness: f64, damping: f64) -> bool {
        const MIN_GAIN: f64 = 1.001e-20;
        let substep = self.substep();
        let gain = (stiffness * substep + damping) * substep;
        (stiffness > 0.0 || damping > 0.0) && gain < MIN_GAIN
    }

    /// Whether something acts along a direction that turns with the bodies, and nothing has to be searched for:
    /// each substep is then a step of Rapier, which keeps forces and the directions of ropes.
    #[must_use]
    pub(crate) fn follows_turns(&self) -> bool {
        let turns = |joint: &Joint| matches!(joint.kind, JointKind::Hinge { .. });
        let is_turned = |index: usize| {
            let joint = &self.joints[index];
            let mut above =
                std::iter::successors(self.joint_above(joint), |joint| self.joint_above(joint));
            matches!(joint.kind, JointKind::Slide { .. }) && above.any(turns)
        };
        let actuators = self.actuators.iter().map(|actuator| actuator.drive);
        let mut drives = actuators.chain(self.formula_forces.iter().map(|force| force.drive));
        self.colliders.is_empty()
            && (!self.ropes.is_empty()
                || drives
                    .any(|drive| matches!(drive, Drive::JointForce(joint) if is_turned(joint))))
    }

    /// Steps of Rapier per control step, and substeps of each, for so many searches for contacts.
    #[must_use]
    pub(crate) fn steps_and_substeps(&self, searches: u32) -> [u32; 2] {
        if self.follows_turns() {
            [searches * self.solver.substeps, 1]
        } else {
            [searches, self.solver.substeps]
        }
    }

    /// Names of the servos, and indices of their joints.
    pub(crate) fn servos(&self) -> impl Iterator<Item = (&str, usize)> {
        self.actuators
            .iter()
            .filter_map(|actuator| match actuator.drive {
                Drive::Servo(servo) => Some((actuator.name.as_str(), servo.joint)),
                _ => None,
            })
    }

    /// Whether several servos drive the same joint.
    #[must_use]
    pub(crate) fn has_joint_with_several_servos(&self) -> bool {
        let mut driven: Vec<_> = self.servos().map(|(_, joint)| joint).collect();
        driven.sort_unstable();
        driven.windows(2).any(|pair| pair[0] == pair[1])
    }

    fn joints_of(&self, child: usize) -> impl Iterator<Item = &Joint> {
        self.joints.iter().filter(move |joint| joint.child == child)
    }

    /// Whether a body only slides along x and y of the world: its motion is that of a body that does
    /// not turn.
    fn is_on_rails(&self, body: usize) -> bool {
        let is_rail = |joint: &Joint| match joint.kind {
            JointKind::Slide { axis } => {
                let has_rotor = joint.passive_forces.armature > 0.0;
                joint.parent.is_none() && axis.contains(&0.0) && !has_rotor
            }
            _ => false,
        };
        self.bodies[body].angle == 0.0 && self.joints_of(body).all(is_rail)
    }

    /// The joint that holds the parent of a joint, if it has one.
    fn joint_above(&self, joint: &Joint) -> Option<&Joint> {
        let parent = joint.parent?;
        self.joints.iter().find(|other| other.child == parent)
    }

    /// Index of the first joint whose child is that of the joint with this index.
    #[must_use]
    pub fn first_joint_of_child(&self, joint: usize) -> usize {
        let child = self.joints[joint].child;
        let first = self.joints.iter().position(|other| other.child == child);
        first.unwrap_or(joint)
    }
}
