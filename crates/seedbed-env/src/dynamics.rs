//! Motion: from the actuators' controls to coordinates, one control step at a time.
//!
//! A [`Dynamics`] holds M copies of one task's bodies: rigid bodies ([`physics`](super::physics))
//! or an analytic model ([`analytic`](super::analytic)). This module must not depend on
//! observations, rewards or episodes.

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{Force, Pose};

/// M copies of a task's bodies. Only live copies move. The bits of a copy do not depend on the
/// other copies.
pub trait Dynamics: Send {
    /// Makes `copy` live, with the given positions and velocities of its coordinates. `positions`,
    /// `velocities`: `[coordinates]`.
    fn start(&mut self, copy: usize, positions: &[f64], velocities: &[f64]);

    /// Sets the line of a collider of `copy` that is a terrain, before the copy is started. Without
    /// colliders there is none.
    fn set_terrain(&mut self, _copy: usize, _collider: usize, _line: &[[f32; 2]]) {}

    /// Freezes `copy` until it is started again.
    fn stop(&mut self, copy: usize);

    /// Advances every live copy by one control step. `controls`: `[(actuators + formula forces) ×
    /// M]`, one column per actuator, then one per formula force; constant during the step.
    fn step(&mut self, controls: &[f32]);

    /// The current coordinates of all copies: one per joint, then x, y and angle of each free body.
    fn coordinates(&self) -> &CoordinateColumns;

    /// Writes where the bodies of `copy` are now: `[bodies]`.
    fn poses(&self, copy: usize, poses: &mut [Pose]);

    /// Appends the contact forces on bodies of `copy` at the end of the latest step. Without
    /// colliders there are none.
    fn contact_forces(&self, _copy: usize, _forces: &mut Vec<Force>) {}

    /// The normal force between two colliders of `copy` at the end of the latest step, N. Without
    /// colliders it is 0.
    fn contact_force(&self, _copy: usize, _one: usize, _other: usize) -> f32 {
        0.0
    }

    /// The first surface that a body of `copy` has been found behind in the latest step, after it passed
    /// without touching it. Without
    /// colliders there is none.
    fn passage(&self, _copy: usize) -> Option<Passage> {
        None
    }

    /// Whether [`passage`](Self::passage) finds anything in any copy.
    fn has_passages(&self) -> bool {
        false
    }

    /// The whole state of one copy as bytes, from which [`restore`](Self::restore) continues with
    /// the same bits.
    fn save(&self, copy: usize) -> Vec<u8>;

    /// Sets a copy to a state that [`save`](Self::save) returned, for any copy of the task.
    ///
    /// # Errors
    /// The bytes are not a state of this task.
    fn restore(&mut self, copy: usize, bytes: &[u8]) -> Result<(), String>;
}

/// A body passed a surface between two searches for contacts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// Index of the collider that passed the other one.
    pub mover: usize,
    /// Index of the other collider.
    pub obstacle: usize,
    /// How far both moved in between, m.
    pub moved: f32,
    /// How many steps before the latest one.
    pub steps: u32,
}

/// Positions and velocities of the coordinates of M copies: `[coordinates × M]`, one column per
/// coordinate.
#[derive(Clone, Debug, PartialEq)]
pub struct CoordinateColumns {
    copies: usize,
    positions: Vec<f32>,
    velocities: Vec<f32>,
}

impl CoordinateColumns {
    /// All coordinates at rest at 0.
    pub(crate) fn new(coordinates: usize, copies: usize) -> Self {
        Self {
            copies,
            positions: vec![0.0; coordinates * copies],
            velocities: vec![0.0; coordinates * copies],
        }
    }

    /// Number of copies M.
    #[must_use]
    pub fn copies(&self) -> usize {
        self.copies
    }

    /// Positions of one coordinate, m, or rad counting full turns: `[M]`.
    #[must_use]
    pub fn positions(&self, coordinate: usize) -> &[f32] {
        &self.positions[coordinate * self.copies..][..self.copies]
    }

    /// Velocities of one coordinate, m/s or rad/s: `[M]`.
    #[must_use]
    pub fn velocities(&self, coordinate: usize) -> &[f32] {
        &self.velocities[coordinate * self.copies..][..self.copies]
    }

    /// Position and velocity of one coordinate of one copy.
    #[must_use]
    pub fn get(&self, coordinate: usize, copy: usize) -> (f32, f32) {
        let index = coordinate * self.copies + copy;
        (self.positions[index], self.velocities[index])
    }

    /// Takes over all coordinates of columns of the same task and number of copies.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.positions.copy_from_slice(&other.positions);
        self.velocities.copy_from_slice(&other.velocities);
    }

    /// Sets position and velocity of one coordinate of one copy.
    pub(crate) fn set(&mut self, coordinate: usize, copy: usize, position: f32, velocity: f32) {
        let index = coordinate * self.copies + copy;
        self.positions[index] = position;
        self.velocities[index] = velocity;
    }

    /// Positions and velocities of one coordinate: `[M]` each.
    pub(crate) fn columns_mut(&mut self, coordinate: usize) -> (&mut [f32], &mut [f32]) {
        let first = coordinate * self.copies;
        (
            &mut self.positions[first..][..self.copies],
            &mut self.velocities[first..][..self.copies],
        )
    }

    /// Makes the coordinates of a copy NaN, because its motion cannot be computed any more.
    pub(crate) fn set_not_finite(&mut self, copy: usize) {
        for coordinate in 0..self.positions.len() / self.copies {
            self.set(coordinate, copy, f32::NAN, f32::NAN);
        }
    }

    /// Position and velocity of each coordinate of one copy: `[coordinates]`.
    pub(crate) fn row(&self, copy: usize) -> Vec<(f32, f32)> {
        (0..self.positions.len() / self.copies)
            .map(|coordinate| self.get(coordinate, copy))
            .collect()
    }

    /// Sets position and velocity of each coordinate of one copy.
    ///
    /// # Errors
    /// The row has another number of coordinates.
    pub(crate) fn set_row(&mut self, copy: usize, row: &[(f32, f32)]) -> Result<(), String> {
        if row.len() != self.positions.len() / self.copies {
            return Err(OTHER_BODIES.to_owned());
        }
        for (coordinate, &(position, velocity)) in row.iter().enumerate() {
            self.set(coordinate, copy, position, velocity);
        }
        Ok(())
    }
}

/// Message for a saved state that does not fit the task.
pub(super) const OTHER_BODIES: &str = "the saved state has other bodies";

/// Writes a state as bytes, which [`from_bytes`] reads.
pub(super) fn to_bytes<T: Serialize>(state: &T) -> Vec<u8> {
    postcard::to_stdvec(state).expect("plain numbers in memory can always be written")
}

/// Reads what [`to_bytes`] wrote; more bytes than that are an error.
pub(super) fn from_bytes<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, String> {
    match postcard::take_from_bytes(bytes) {
        Ok((state, [])) => Ok(state),
        Ok((_, rest)) => Err(format!("there are {} bytes too many", rest.len())),
        Err(error) => Err(error.to_string()),
    }
}
