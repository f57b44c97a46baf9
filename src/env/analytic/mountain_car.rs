//! A car on a level rail in a field of force, between inelastic walls, by Gym's own difference equations.
//!
//! A field is constant during a control step of h seconds, and one substep of semi-implicit Euler in that time is what the task is
//! defined by, not an approximation of it:
//!
//! ```text
//! v ← v + h F / m,   x ← x + h v;   beyond a wall: x at the wall, v = 0
//! ```
//!
//! The map is symplectic: for F = −V′(x) the energy ½ m v² + V(x) swings about its value and does not drift.

use super::{Equations, require, require_plain};
use crate::env::description::{Description, Twin};
use crate::env::kinematics::{Motion, Tree};

/// The parameters of a car.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MountainCar {
    /// m, kg.
    pub mass: f64,
    /// Where the walls are, m.
    pub walls: [f64; 2],
    /// h, s.
    pub control_step: f64,
}

impl MountainCar {
    /// Takes the parameters from the body of a description with a mountain-car twin.
    ///
    /// # Errors
    /// The body is no such car; says why.
    pub fn of(description: &Description) -> Result<Self, String> {
        let Some(Twin::MountainCar { slider }) = description.twin else {
            return Err("the task has no mountain-car twin".to_owned());
        };
        require_plain(description)?;
        let joint = &description.joints[slider];
        require(
            description.joints.len() == 1,
            "a mountain car has no other joint than its slider",
        )?;
        let Motion::Slide(axis) = Tree::new(description).links()[slider].motion else {
            return Err(format!(
                "a mountain car has a slider, but `{}` is none",
                joint.name
            ));
        };
        require(axis[1] == 0.0, "the slider of a mountain car is level")?;
        require(
            description.gravity[0] == 0.0,
            "gravity is vertical where a mountain car stands",
        )?;
        require(
            description.solver.iterations == 1,
            "a mountain car moves once in a control step: `solver: (iterations: 1)`",
        )?;
        Ok(Self {
            mass: description.bodies[joint.child].inertial.mass,
            walls: joint.range.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]),
            control_step: description.spec.control_step,
        })
    }

    /// x, v after one control step under the force F, N.
    #[must_use]
    pub fn next(&self, [position, velocity]: [f64; 2], force: f64) -> [f64; 2] {
        let velocity = velocity + self.control_step * force / self.mass;
        let position = position + self.control_step * velocity;
        let [low, high] = self.walls;
        if position < low || position > high {
            [position.clamp(low, high), 0.0]
        } else {
            [position, velocity]
        }
    }
}

impl Equations for MountainCar {
    fn advance(&self, state: &mut [f64], forces: &[f64]) {
        let end = self.next([state[0], state[1]], forces[0]);
        state.copy_from_slice(&end);
    }
}
