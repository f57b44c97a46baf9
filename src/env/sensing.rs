//! Sensing: from coordinates to what sensors measure.
//!
//! All that a sensor can measure follows from where the bodies are and how fast they move, and that from the coordinates. What
//! moves the bodies may not enter.

use std::f32::consts::{PI, TAU};
use std::ops::Range;

use super::description::{BodyPoint, Description, Reading};
use super::dynamics::JointColumns;
use super::expression::{Formula, Table};
use super::kinematics::{Frame, Tree};
use super::physics::Geometry;

/// Reads the sensors of a task.
pub(super) struct Senses {
    readings: Vec<Reading>,
    /// Sensors that are formulas over earlier ones, with their columns.
    formulas: Vec<(usize, Formula)>,
    /// Whether some sensor needs to know where the bodies are.
    reads_bodies: bool,
    tree: Tree,
    geometry: Geometry,
    /// Of the copy that is being read: `[coordinates]`, `[coordinates]`, `[bodies]`.
    positions: Vec<f64>,
    velocities: Vec<f64>,
    frames: Vec<Frame>,
}

impl Senses {
    pub(super) fn new(description: &Description, copies: usize) -> Self {
        let readings: Vec<_> = description
            .sensors
            .iter()
            .map(|sensor| sensor.reading.clone())
            .collect();
        let tree = Tree::new(description);
        Self {
            reads_bodies: readings.iter().any(is_of_bodies),
            formulas: readings
                .iter()
                .enumerate()
                .filter_map(|(column, reading)| Some((column, formula(reading, copies)?)))
                .collect(),
            readings,
            frames: tree.frames(),
            tree,
            geometry: Geometry::new(description),
            positions: vec![0.0; description.coordinates()],
            velocities: vec![0.0; description.coordinates()],
        }
    }

    /// Writes what the sensors of some copies measure into the table's first columns.
    pub(super) fn read(&mut self, columns: &JointColumns, copies: Range<usize>, table: &mut Table) {
        for (column, reading) in self.readings.iter().enumerate() {
            let column = &mut table.column_mut(column)[copies.clone()];
            match reading {
                Reading::JointPosition(coordinate) => {
                    column.copy_from_slice(&columns.positions(*coordinate)[copies.clone()])
                }
                Reading::WrappedJointPosition(coordinate) => {
                    wrap(column, &columns.positions(*coordinate)[copies.clone()])
                }
                Reading::JointVelocity(coordinate) => {
                    column.copy_from_slice(&columns.velocities(*coordinate)[copies.clone()])
                }
                _ => {}
            }
        }
        if self.reads_bodies {
            copies
                .clone()
                .for_each(|copy| self.read_bodies(columns, copy, table));
        }
        for (column, formula) in &mut self.formulas {
            let (before, column) = table.split_at(*column);
            column[copies.clone()].copy_from_slice(formula.evaluate(before, copies.clone()));
        }
    }

    fn read_bodies(&mut self, columns: &JointColumns, copy: usize, table: &mut Table) {
        for (coordinate, (position, velocity)) in self
            .positions
            .iter_mut()
            .zip(&mut self.velocities)
            .enumerate()
        {
            let (place, rate) = columns.get(coordinate, copy);
            (*position, *velocity) = (f64::from(place), f64::from(rate));
        }
        self.tree
            .place(&self.positions, &self.velocities, &mut self.frames);
        for (column, reading) in self.readings.iter().enumerate() {
            if let Some(value) = self.measured(reading) {
                table.column_mut(column)[copy] = value;
            }
        }
    }

    /// None for what does not depend on where the bodies are.
    fn measured(&self, reading: &Reading) -> Option<f32> {
        Some(match reading {
            Reading::JointPosition(_)
            | Reading::WrappedJointPosition(_)
            | Reading::JointVelocity(_)
            | Reading::Formula(_) => {
                return None;
            }
            Reading::BodyPosition(point) => self.place_of(point)[point.axis] as f32,
            Reading::BodyVelocity(point) => {
                self.frames[point.body].velocity_at(self.place_of(point))[point.axis] as f32
            }
            Reading::BodyAngle(body) => self.frames[*body].angle as f32,
            Reading::BodyAngularVelocity(body) => self.frames[*body].angular_velocity as f32,
            Reading::Contact(one, other) => {
                f32::from(u8::from(self.geometry.touch(*one, *other, &self.frames)))
            }
            Reading::Ray(ray) => self.geometry.distance(ray, &self.frames),
        })
    }

    fn place_of(&self, point: &BodyPoint) -> [f64; 2] {
        self.frames[point.body].point(point.at)
    }
}

/// Takes full turns off angles: into (−π, π].
fn wrap(wrapped: &mut [f32], angles: &[f32]) {
    for (wrapped, &angle) in wrapped.iter_mut().zip(angles) {
        *wrapped = angle - TAU * ((angle - PI) / TAU).ceil();
    }
}

fn is_of_bodies(reading: &Reading) -> bool {
    use Reading::{Formula, JointPosition, JointVelocity, WrappedJointPosition};
    !matches!(
        reading,
        JointPosition(_) | WrappedJointPosition(_) | JointVelocity(_) | Formula(_)
    )
}

fn formula(reading: &Reading, copies: usize) -> Option<Formula> {
    if let Reading::Formula(program) = reading {
        Some(Formula::new(program, copies))
    } else {
        None
    }
}
