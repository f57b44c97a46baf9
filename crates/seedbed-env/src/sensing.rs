//! Sensing: from coordinates to what sensors measure.
//!
//! Everything that a sensor measures follows from the positions and velocities of the bodies, and
//! these follow from the coordinates; only the forces of contacts come from the
//! [`Dynamics`]. This module must not depend on what moves the bodies.

use std::f32::consts::{PI, TAU};
use std::ops::Range;

use super::description::{BodyPoint, BodyTask, Measurement, Subtree};
use super::dynamics::{CoordinateColumns, Dynamics};
use super::expression::{Evaluator, ValueTable, copy_values};
use super::kinematics::{Frame, KinematicTree};
use super::physics::Geometry;

/// Reads the sensors of a task.
pub(super) struct SensorReader {
    /// Column of the first sensor.
    first_column: usize,
    measurements: Vec<Measurement>,
    /// Sensors that are formulas over earlier ones, with their columns.
    formulas: Vec<(usize, Evaluator)>,
    /// Whether some sensor depends on the frames of the bodies.
    needs_frames: bool,
    tree: KinematicTree,
    geometry: Geometry,
    /// Masses (kg) and centers of mass in the bodies' frames (m): `[bodies]`
    masses: Vec<(f64, [f64; 2])>,
    /// Positions of the coordinates of the copy that is being read: `[coordinates]`.
    positions: Vec<f64>,
    /// Velocities of the coordinates of the same copy: `[coordinates]`.
    velocities: Vec<f64>,
    /// Frames of the bodies of the same copy: `[bodies]`.
    frames: Vec<Frame>,
}

impl SensorReader {
    pub(super) fn new(task: &BodyTask, copies: usize) -> Self {
        let measurements: Vec<_> = task
            .sensors
            .iter()
            .map(|sensor| sensor.measurement.clone())
            .collect();
        let tree = KinematicTree::new(task);
        let first_column = task.column_layout().first_sensor();
        Self {
            first_column,
            needs_frames: measurements.iter().any(depends_on_frames),
            formulas: measurements
                .iter()
                .enumerate()
                .filter_map(|(index, measurement)| {
                    Some((
                        first_column + index,
                        formula_evaluator(measurement, copies)?,
                    ))
                })
                .collect(),
            measurements,
            frames: tree.frame_buffer(),
            tree,
            geometry: Geometry::new(task, copies),
            masses: task
                .bodies
                .iter()
                .map(|body| (body.inertial.mass, body.inertial.com))
                .collect(),
            positions: vec![0.0; task.coordinate_count()],
            velocities: vec![0.0; task.coordinate_count()],
        }
    }

    /// Sets the line of a collider of `copy` that is a terrain.
    pub(super) fn set_terrain(&mut self, copy: usize, collider: usize, line: &[[f32; 2]]) {
        self.geometry.set_terrain(copy, collider, line);
    }

    /// Writes the measurements of some copies into the columns of the sensors.
    pub(super) fn read(
        &mut self,
        dynamics: &dyn Dynamics,
        copies: Range<usize>,
        table: &mut ValueTable,
    ) {
        let coordinates = dynamics.coordinates();
        for (index, measurement) in self.measurements.iter().enumerate() {
            let column = &mut table.column_mut(self.first_column + index)[copies.clone()];
            match measurement {
                Measurement::JointPosition(coordinate) => {
                    copy_values(&coordinates.positions(*coordinate)[copies.clone()], column);
                }
                Measurement::WrappedJointPosition(coordinate) => {
                    wrap(column, &coordinates.positions(*coordinate)[copies.clone()]);
                }
                Measurement::JointVelocity(coordinate) => {
                    copy_values(&coordinates.velocities(*coordinate)[copies.clone()], column);
                }
                Measurement::ContactForce(one, other) => {
                    for (copy, value) in copies.clone().zip(column) {
                        *value = dynamics.contact_force(copy, *one, *other);
                    }
                }
                _ => {}
            }
        }
        if self.needs_frames {
            copies
                .clone()
                .for_each(|copy| self.read_frame_sensors(coordinates, copy, table));
        }
        for (column, formula) in &mut self.formulas {
            let (before, column) = table.split_at(*column);
            column[copies.clone()].copy_from_slice(formula.evaluate(before, copies.clone()));
        }
    }

    /// Reads the sensors of one copy that depend on the frames of the bodies.
    fn read_frame_sensors(
        &mut self,
        coordinates: &CoordinateColumns,
        copy: usize,
        table: &mut ValueTable,
    ) {
        for (coordinate, (position, velocity)) in self
            .positions
            .iter_mut()
            .zip(&mut self.velocities)
            .enumerate()
        {
            let (q, q_dot) = coordinates.get(coordinate, copy);
            (*position, *velocity) = (f64::from(q), f64::from(q_dot));
        }
        self.tree
            .compute_frames(&self.positions, &self.velocities, &mut self.frames);
        for (index, measurement) in self.measurements.iter().enumerate() {
            if let Some(value) = self.measure(copy, measurement) {
                table.column_mut(self.first_column + index)[copy] = value;
            }
        }
    }

    /// The measured value; `None` if it does not depend on the frames of the bodies.
    fn measure(&self, copy: usize, measurement: &Measurement) -> Option<f32> {
        Some(match measurement {
            Measurement::JointPosition(_)
            | Measurement::WrappedJointPosition(_)
            | Measurement::JointVelocity(_)
            | Measurement::ContactForce(..)
            | Measurement::Formula(_) => {
                return None;
            }
            Measurement::BodyPosition(point) => self.position_of(point)[point.axis] as f32,
            Measurement::BodyVelocity(point) => {
                self.frames[point.body].velocity_at(self.position_of(point))[point.axis] as f32
            }
            Measurement::BodyAngle(body) => self.frames[*body].angle as f32,
            Measurement::BodyAngularVelocity(body) => self.frames[*body].angular_velocity as f32,
            Measurement::Contact(one, other) => {
                let touch = self.geometry.touch(copy, [*one, *other], &self.frames);
                f32::from(u8::from(touch))
            }
            Measurement::SubtreePosition(subtree) => self.mean_over(subtree, Frame::point),
            Measurement::SubtreeVelocity(subtree) => {
                self.mean_over(subtree, |frame, com| frame.velocity_at(frame.point(com)))
            }
            Measurement::Ray(ray) => self.geometry.ray_distance(copy, ray, &self.frames),
        })
    }

    /// The mean of `quantity(frame, center of mass)` over the bodies of a subtree, weighted by mass.
    fn mean_over(&self, subtree: &Subtree, quantity: fn(&Frame, [f64; 2]) -> [f64; 2]) -> f32 {
        let (mut sum, mut total_mass) = (0.0, 0.0);
        for &body in &subtree.bodies {
            let (mass, com) = self.masses[body];
            sum += mass * quantity(&self.frames[body], com)[subtree.axis];
            total_mass += mass;
        }
        (sum / total_mass) as f32
    }

    fn position_of(&self, point: &BodyPoint) -> [f64; 2] {
        self.frames[point.body].point(point.at)
    }
}

/// Removes full turns from angles, into (−π, π].
fn wrap(wrapped: &mut [f32], angles: &[f32]) {
    for (wrapped, &angle) in wrapped.iter_mut().zip(angles) {
        *wrapped = angle - TAU * ((angle - PI) / TAU).ceil();
        if *wrapped <= -PI || *wrapped > PI {
            *wrapped = wrap_far(angle);
        }
    }
}

/// Removes the full turns of an angle whose multiples of 2π an `f32` rounds by too much.
fn wrap_far(angle: f32) -> f32 {
    let turned = f64::from(angle).rem_euclid(std::f64::consts::TAU) as f32;
    if turned > PI { turned - TAU } else { turned }
}

fn depends_on_frames(measurement: &Measurement) -> bool {
    use Measurement::{ContactForce, Formula, JointPosition, JointVelocity, WrappedJointPosition};
    !matches!(
        measurement,
        JointPosition(_)
            | WrappedJointPosition(_)
            | JointVelocity(_)
            | ContactForce(..)
            | Formula(_)
    )
}

fn formula_evaluator(measurement: &Measurement, copies: usize) -> Option<Evaluator> {
    if let Measurement::Formula(program) = measurement {
        Some(Evaluator::new(program, copies))
    } else {
        None
    }
}
