//! Motion: what turns the actuators' controls into coordinates, one control step at a time.
//!
//! A [`Dynamics`] holds M copies of one task's bodies: rigid bodies ([`physics`](super::physics)) or closed-form equations
//! ([`analytic`](super::analytic)). Observations, rewards and episodes may not enter.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::{Force, Pose};

/// M copies of a task's bodies. Only live copies move; the bits of one do not depend on the others.
pub trait Dynamics: Send {
    /// Makes `copy` live, with each coordinate at the given value and rate. `positions`, `velocities`: `[coordinates]`
    fn start(&mut self, copy: usize, positions: &[f64], velocities: &[f64]);

    /// Makes `copy` stand still until it is started again.
    fn stop(&mut self, copy: usize);

    /// Advances every live copy by one control step. `controls`: `[(actuators + fields) × M]`, column by actuator, then by field;
    /// constant during the step.
    fn step(&mut self, controls: &[f32]);

    /// The coordinates of all copies as they are now: those of the joints, then x, y and angle of each free body.
    fn joints(&self) -> &JointColumns;

    /// Where the bodies of `copy` are now: `[bodies]`.
    fn poses(&self, copy: usize, poses: &mut [Pose]);

    /// Adds the forces by which surfaces pushed bodies of `copy` at the end of the latest step. Without colliders there are none.
    fn contacts(&self, _copy: usize, _forces: &mut Vec<Force>) {}

    /// The whole state as bytes; [`restore`](Self::restore) continues from them to the same bits.
    fn save(&self) -> Vec<u8>;

    /// Takes up a state that [`save`](Self::save) wrote.
    ///
    /// # Errors
    /// The bytes are not a state of this task with this number of copies.
    fn restore(&mut self, bytes: &[u8]) -> Result<(), String>;
}

/// Coordinates of M copies: `[coordinates × M]`, column by coordinate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointColumns {
    copies: usize,
    positions: Vec<f32>,
    velocities: Vec<f32>,
}

impl JointColumns {
    /// All at rest at 0.
    #[must_use]
    pub fn new(joints: usize, copies: usize) -> Self {
        Self {
            copies,
            positions: vec![0.0; joints * copies],
            velocities: vec![0.0; joints * copies],
        }
    }

    /// M.
    #[must_use]
    pub fn copies(&self) -> usize {
        self.copies
    }

    /// m, or rad with full turns: `[M]`.
    #[must_use]
    pub fn positions(&self, joint: usize) -> &[f32] {
        &self.positions[joint * self.copies..][..self.copies]
    }

    /// m/s or rad/s: `[M]`.
    #[must_use]
    pub fn velocities(&self, joint: usize) -> &[f32] {
        &self.velocities[joint * self.copies..][..self.copies]
    }

    /// Position and velocity of one joint of one copy.
    #[must_use]
    pub fn get(&self, joint: usize, copy: usize) -> (f32, f32) {
        let index = joint * self.copies + copy;
        (self.positions[index], self.velocities[index])
    }

    /// Sets position and velocity of one joint of one copy.
    pub fn set(&mut self, joint: usize, copy: usize, position: f32, velocity: f32) {
        let index = joint * self.copies + copy;
        self.positions[index] = position;
        self.velocities[index] = velocity;
    }

    /// Whether both hold the same number of joints and copies.
    #[must_use]
    pub fn same_shape(&self, other: &Self) -> bool {
        self.copies == other.copies
            && self.positions.len() == other.positions.len()
            && self.velocities.len() == other.velocities.len()
    }
}

/// Bytes that [`from_bytes`] reads back.
pub(super) fn to_bytes<T: Serialize>(state: &T) -> Vec<u8> {
    postcard::to_stdvec(state).expect("plain numbers in memory can always be written")
}

/// What [`to_bytes`] wrote, and nothing but that.
pub(super) fn from_bytes<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, String> {
    match postcard::take_from_bytes(bytes) {
        Ok((state, [])) => Ok(state),
        Ok((_, rest)) => Err(format!("{} bytes too many", rest.len())),
        Err(error) => Err(error.to_string()),
    }
}
