//! A car on a level rail under a force that depends on its position, between inelastic walls, by
//! Gym's own difference equations.
//!
//! The force is constant during a control step of h seconds. One step of the semi-implicit Euler
//! method defines the task; it is not an approximation:
//!
//! ```text
//! v ← v + h F / m,   x ← x + h v;   beyond a wall: x at the wall, v = 0
//! ```
//!
//! The map is symplectic: for F = −V′(x) the energy ½ m v² + V(x) oscillates but does not drift.

use super::integration::State;
use super::trigonometry::Trigonometry;
use super::{EquationsOfMotion, require, require_common_properties};
use crate::description::{AnalyticModel, BodyTask};
use crate::kinematics::{KinematicTree, Motion};

/// The parameters of a car.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MountainCar {
    /// Mass m, kg.
    pub mass: f64,
    /// Positions of the walls, m.
    pub walls: [f64; 2],
    /// Control step h, s.
    pub control_step: f64,
}

impl MountainCar {
    /// Takes the parameters from the body of a task with this analytic model.
    ///
    /// # Errors
    /// The body is not that of a mountain car; the message says what is required.
    pub fn from_task(task: &BodyTask) -> Result<Self, String> {
        let Some(AnalyticModel::MountainCar { slider }) = task.analytic_model else {
            return Err("the task has no analytic model of a mountain car".to_owned());
        };
        require_common_properties(task)?;
        let joint = &task.joints[slider];
        require(
            task.joints.len() == 1,
            "`MountainCar` requires that there is no other joint than `slider`",
        )?;
        let Motion::Slide(axis) = KinematicTree::new(task).links()[slider].motion else {
            return Err(format!(
                "`MountainCar` requires a slide, but joint `{}` is not one",
                joint.name
            ));
        };
        require(
            axis[1] == 0.0,
            "`MountainCar` requires that `slider` is level",
        )?;
        require(
            task.gravity[0] == 0.0,
            "`MountainCar` requires vertical gravity",
        )?;
        require(
            task.solver.substeps == 1,
            "`MountainCar` requires one substep per control step: `solver: (iterations: 1)`",
        )?;
        Ok(Self {
            mass: task.bodies[joint.child].inertial.mass,
            walls: joint.range.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]),
            control_step: task.spec.control_step,
        })
    }

    /// The state x, v after one control step under the force F, N.
    #[must_use]
    #[inline(always)]
    pub fn next_state(&self, [position, velocity]: [f64; 2], force: f64) -> [f64; 2] {
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

impl EquationsOfMotion<1> for MountainCar {
    fn joints(&self) -> [usize; 1] {
        [0]
    }

    fn substeps(&self) -> u32 {
        1
    }

    #[inline(always)]
    fn advance<T: Trigonometry>(&self, state: &State<1>, [force]: [f64; 1]) -> State<1> {
        let [position, velocity] =
            self.next_state([state.positions[0], state.velocities[0]], force);
        State {
            positions: [position],
            velocities: [velocity],
        }
    }
}
