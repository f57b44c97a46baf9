//! Watches each step for motion that the physics cannot have computed well: numbers far beyond their
//! ranges, and bodies that pass surfaces. It never changes the motion.

use super::Status;
use super::description::{BodyTask, Joint, JointKind, Measurement, Surface};
use super::dynamics::{Dynamics, Passage};

/// The first thing in an episode that its physics cannot have computed well.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PhysicsWarning {
    /// Number of the step in its episode: 1 is the first.
    pub step: u32,
    /// What is wrong, and what to do.
    pub message: String,
}

/// Observations beyond this multiple of their range, and coordinates beyond this multiple of theirs,
/// have been computed badly.
const MAX_RANGES: f32 = 1e3;

/// Maximum of positions, m: beyond it, an `f32` has steps of 1 mm, as wide as the tolerance of contacts.
const MAX_POSITION: f32 = 1e4;

/// Maximum of angles, rad: beyond it, an `f32` has steps of 0.008 rad.
const MAX_ANGLE: f32 = 1e5;

/// Maximum of velocities, m/s.
const MAX_VELOCITY: f32 = 1e4;

/// Maximum of angular velocities, turns per substep: the forces of a substep are those of one angle.
const MAX_TURNS_PER_SUBSTEP: f64 = 1.0;

/// Watches all copies of a task.
pub(super) struct Watch {
    /// Maximum absolute values of position and velocity: `[coordinates]`
    limits: Vec<[f32; 2]>,
    /// Maximum absolute values: `[observations]`
    observation_limits: Vec<f32>,
    /// The first fault of each copy's episode, and its step: `[copies]`
    faults: Vec<Option<(u32, Fault)>>,
}

#[derive(Clone, Copy)]
enum Fault {
    /// Coordinate, value and limit.
    Position(usize, f32, f32),
    Velocity(usize, f32, f32),
    /// Observation, value and limit.
    Observation(usize, f32, f32),
    Passage(Passage),
}

impl Watch {
    pub(super) fn new(task: &BodyTask, copies: usize) -> Self {
        let observations = task.spec.observations.iter();
        Self {
            limits: limits(task),
            observation_limits: observations
                .map(|quantity| MAX_RANGES * scale(quantity.range.map(f64::from)))
                .collect(),
            faults: vec![None; copies],
        }
    }

    /// Begins an episode.
    pub(super) fn begin(&mut self, copy: usize) {
        self.faults[copy] = None;
    }

    /// Looks at the step that all running copies have made. `observations`: one column per observation,
    /// `[observations × copies]`; `steps`: the number of steps before it, `[copies]`
    pub(super) fn look(
        &mut self,
        dynamics: &dyn Dynamics,
        observations: &[f32],
        statuses: &[Status],
        steps: &[u32],
    ) {
        let coordinates = dynamics.coordinates();
        let (copies, mut is_beyond) = (self.faults.len(), false);
        for (coordinate, [position, velocity]) in self.limits.iter().enumerate() {
            is_beyond |= any_beyond(coordinates.positions(coordinate), *position);
            is_beyond |= any_beyond(coordinates.velocities(coordinate), *velocity);
        }
        let columns = observations.chunks_exact(copies.max(1));
        for (column, limit) in columns.zip(&self.observation_limits) {
            is_beyond |= any_beyond(column, *limit);
        }
        let has_passages = dynamics.has_passages();
        if !is_beyond && !has_passages {
            return;
        }
        for copy in 0..copies {
            if statuses[copy] == Status::Running && self.faults[copy].is_none() {
                let fault = self.find(dynamics, observations, copy);
                let steps_ago = match fault {
                    Some(Fault::Passage(passage)) => passage.steps,
                    _ => 0,
                };
                let step = (steps[copy] + 1).saturating_sub(steps_ago);
                self.faults[copy] = fault.map(|fault| (step, fault));
            }
        }
    }

    /// What is wrong in a copy.
    fn find(&self, dynamics: &dyn Dynamics, observations: &[f32], copy: usize) -> Option<Fault> {
        let coordinates = dynamics.coordinates();
        for (coordinate, [position_limit, velocity_limit]) in self.limits.iter().enumerate() {
            let (position, velocity) = coordinates.get(coordinate, copy);
            if is_beyond(velocity, *velocity_limit) {
                return Some(Fault::Velocity(coordinate, velocity, *velocity_limit));
            }
            if is_beyond(position, *position_limit) {
                return Some(Fault::Position(coordinate, position, *position_limit));
            }
        }
        let columns = observations
            .chunks_exact(self.faults.len())
            .zip(&self.observation_limits);
        for (index, (column, limit)) in columns.enumerate() {
            if is_beyond(column[copy], *limit) {
                return Some(Fault::Observation(index, column[copy], *limit));
            }
        }
        dynamics.passage(copy).map(Fault::Passage)
    }

    /// The first fault of a copy's episode.
    pub(super) fn warning(&self, copy: usize, task: &BodyTask) -> Option<PhysicsWarning> {
        let (step, fault) = self.faults[copy]?;
        let coordinate_name = |index: usize| task.coordinate_names()[index].clone();
        let out_of_range = |quantity: String, value: f32, limit: f32, unit: &str| {
            format!(
                "{quantity} is {}, more than {}: {EXPLOSION_HELP}",
                with_unit(value, unit),
                with_unit(limit, unit)
            )
        };
        let message = match fault {
            Fault::Position(index, value, limit) => {
                let quantity = format!("the position of `{}`", coordinate_name(index));
                out_of_range(quantity, value, limit, unit_of(index, task))
            }
            Fault::Velocity(index, value, limit) => {
                let quantity = format!("the velocity of `{}`", coordinate_name(index));
                out_of_range(
                    quantity,
                    value,
                    limit,
                    &format!("{}/s", unit_of(index, task)),
                )
            }
            Fault::Observation(index, value, limit) => {
                let observation = &task.spec.observations[index];
                let quantity = format!("observation `{}`", observation.name);
                out_of_range(quantity, value, limit, &observation.unit)
            }
            Fault::Passage(passage) => passage_text(&passage, task),
        };
        Some(PhysicsWarning { step, message })
    }
}

const EXPLOSION_HELP: &str = "the physics cannot compute it; check masses, inertias, stiffness, gears and \
     `control_step`, or raise `solver.iterations`";

fn passage_text(passage: &Passage, task: &BodyTask) -> String {
    let surfaces = [passage.mover, passage.obstacle];
    let [mover, obstacle] = surfaces.map(|index| collider_text(index, task));
    let update = task.spec.control_step / f64::from(task.solver.contact_updates);
    let help = passage_help(passage, task);
    format!(
        "{mover} passed {obstacle}: they moved {:.2} m in the {update} s between two searches for contacts; raise \
         `solver.searches`{help}",
        passage.moved
    )
}

/// What helps against a passage beside more searches: what to make thicker, and `ccd` if that helps.
fn passage_help(passage: &Passage, task: &BodyTask) -> &'static str {
    let [mover, obstacle] = [passage.mover, passage.obstacle].map(|index| &task.colliders[index]);
    let has_ccd = |body: Option<usize>| body.is_some_and(|body| task.bodies[body].ccd);
    let is_free = |body: usize| {
        let mut joints = task.joints.iter();
        task.free_bodies.contains(&body) && joints.all(|joint| joint.parent != Some(body))
    };
    if matches!(obstacle.surface, Surface::HalfSpace { .. }) {
        return " or make the body thicker; `ccd` does not see half-spaces";
    }
    match (has_ccd(mover.body), has_ccd(obstacle.body)) {
        (true, true) => {
            ", make them thicker, or remove `ccd` of one of the two: bodies that both have it do not see each other"
        }
        (false, _) if mover.body.is_some_and(is_free) => {
            ", make them thicker, or `ccd: true` for the body"
        }
        _ => ", make them thicker",
    }
}

/// A collider in a message: by its name, or by its body.
fn collider_text(index: usize, task: &BodyTask) -> String {
    let collider = &task.colliders[index];
    let body = collider.body.map(|body| &task.bodies[body].name);
    match (&collider.name, body) {
        (Some(name), Some(body)) if name != body => format!("collider `{name}` of body `{body}`"),
        (Some(name), None) => format!("collider `{name}`"),
        (_, Some(body)) => format!("body `{body}`"),
        (None, None) => format!("collider {index} of the task"),
    }
}

fn with_unit(value: f32, unit: &str) -> String {
    let digits = if (1e-2..1e4).contains(&value.abs()) {
        format!("{value:.4}")
            .trim_end_matches('0')
            .trim_end_matches('.')
            .to_owned()
    } else {
        format!("{value:.1e}")
    };
    format!("{digits} {unit}").trim_end().to_owned()
}

/// Whether a coordinate is an angle or a length: `rad` or `m`.
fn unit_of(coordinate: usize, task: &BodyTask) -> &'static str {
    if is_angle(coordinate, task) {
        "rad"
    } else {
        "m"
    }
}

fn is_angle(coordinate: usize, task: &BodyTask) -> bool {
    match task.joints.get(coordinate) {
        Some(joint) => matches!(joint.kind, JointKind::Hinge { .. }),
        None => (coordinate - task.joints.len()) % 3 == 2,
    }
}

/// Maximum absolute values of position and velocity: `[coordinates]`.
fn limits(task: &BodyTask) -> Vec<[f32; 2]> {
    let max_spin = std::f64::consts::TAU * MAX_TURNS_PER_SUBSTEP / task.substep();
    let limits = (0..task.coordinate_count()).map(|coordinate| {
        let [mut position, mut velocity] = if is_angle(coordinate, task) {
            [MAX_ANGLE, max_spin as f32]
        } else {
            [MAX_POSITION, MAX_VELOCITY]
        };
        if let Some(Joint {
            range: Some(range), ..
        }) = task.joints.get(coordinate)
        {
            position = position.min(MAX_RANGES * scale(*range));
        }
        // An observation that shows a coordinate may expect more of it.
        for (measurement, range) in shown_coordinates(task) {
            match measurement {
                Measurement::JointPosition(shown) if *shown == coordinate => {
                    position = position.max(scale(range));
                }
                Measurement::JointVelocity(shown) if *shown == coordinate => {
                    velocity = velocity.max(scale(range));
                }
                _ => {}
            }
        }
        [position, velocity]
    });
    limits.collect()
}

/// The sensors that an observation shows under their own names, and its range.
fn shown_coordinates(task: &BodyTask) -> impl Iterator<Item = (&Measurement, [f64; 2])> {
    task.spec.observations.iter().filter_map(|observation| {
        let mut sensors = task.sensors.iter();
        let sensor = sensors.find(|sensor| sensor.name == observation.name)?;
        Some((&sensor.measurement, observation.range.map(f64::from)))
    })
}

/// The largest absolute value of a range, which need not include 0.
fn scale([low, high]: [f64; 2]) -> f32 {
    (high - low).max(low.abs()).max(high.abs()) as f32
}

/// Whether a number of any copy is beyond a limit. Without branches, this is fast.
fn any_beyond(values: &[f32], limit: f32) -> bool {
    values
        .iter()
        .fold(false, |any, value| any | is_beyond(*value, limit))
}

/// NaN is beyond any limit.
fn is_beyond(value: f32, limit: f32) -> bool {
    let is_within = value.abs() <= limit;
    !is_within
}
