//! A body that swings about a fixed point without friction.
//!
//! With α the counter-clockwise angle of the arm from the pivot to the center of mass against the
//! x-axis, m the mass, l the arm's length, I the inertia about the center of mass, (gₓ, g_y)
//! gravity and τ the torque, the balance of moments about the pivot is
//!
//! ```text
//! (I + m l²) α̈ = τ + m l (g_y cos α − gₓ sin α)
//! ```

use super::integration::{Accelerations, State, runge_kutta, substeps};
use super::trigonometry::{Trigonometry, Unbounded};
use super::{EquationsOfMotion, require, require_only_gravity};
use crate::description::{AnalyticModel, BodyTask, JointKind};
use crate::kinematics::Frame;

/// The parameters of a pendulum, and how the task's joint coordinate maps onto α.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pendulum {
    /// m l, kg m.
    pub moment: f64,
    /// I + m l², kg m².
    pub inertia: f64,
    /// Gravity to the right and upwards, m/s².
    pub gravity: [f64; 2],
    /// +1 if the coordinate grows counter-clockwise, else −1.
    sign: f64,
    /// α at coordinate 0.
    angle_at_zero: f64,
    control_step: f64,
    substeps: u32,
}

/// Maximum time step of the Runge–Kutta integration, s. Its error over one control step is below
/// what an f32 resolves.
const MAX_STEP: f64 = 0.02;

impl Pendulum {
    /// Takes the parameters from the body of a task with this analytic model.
    ///
    /// # Errors
    /// The bodies are not those of a pendulum; the message says what is required.
    pub fn from_task(task: &BodyTask) -> Result<Self, String> {
        let Some(AnalyticModel::Pendulum { hinge }) = task.analytic_model else {
            return Err("the task has no analytic model of a pendulum".to_owned());
        };
        require_only_gravity(task)?;
        let joint = &task.joints[hinge];
        let JointKind::Hinge { sign } = joint.kind else {
            return Err(format!(
                "`Pendulum` requires a hinge, but joint `{}` is not one",
                joint.name
            ));
        };
        require(
            task.joints.len() == 1,
            "`Pendulum` requires that there is no other joint than `hinge`",
        )?;
        let body = &task.bodies[joint.child];
        let arm = [
            body.inertial.com[0] - joint.anchor[0],
            body.inertial.com[1] - joint.anchor[1],
        ];
        let (length, [right, up]) = (
            libm::hypot(arm[0], arm[1]),
            Frame::at([0.0; 2], body.angle).point(arm),
        );
        Ok(Self {
            moment: body.inertial.mass * length,
            inertia: body.inertial.inertia + body.inertial.mass * length * length,
            gravity: task.gravity,
            sign,
            angle_at_zero: libm::atan2(up, right),
            control_step: task.spec.control_step,
            substeps: substeps(task.spec.control_step, MAX_STEP),
        })
    }

    /// Acceleration q̈ at coordinate q under torque τ (N m) along it.
    #[must_use]
    pub fn acceleration(&self, position: f64, torque: f64) -> f64 {
        let state = State {
            positions: [position],
            velocities: [0.0],
        };
        let [acceleration] = self.accelerations::<Unbounded>(&state, [torque]);
        acceleration
    }

    /// Total energy T + V of the state q, q̇, J.
    #[must_use]
    pub fn energy(&self, [position, velocity]: [f64; 2]) -> f64 {
        let (sine, cosine) = libm::sincos(self.angle_at_zero + self.sign * position);
        0.5 * self.inertia * velocity * velocity
            - self.moment * (self.gravity[0] * cosine + self.gravity[1] * sine)
    }

    /// The state q, q̇ after one Runge–Kutta step of `duration`, s.
    #[must_use]
    pub fn runge_kutta(
        &self,
        [position, velocity]: [f64; 2],
        torque: f64,
        duration: f64,
    ) -> [f64; 2] {
        let start = State {
            positions: [position],
            velocities: [velocity],
        };
        let end = runge_kutta::<Unbounded, _, 1>(self, &start, [torque], duration);
        [end.positions[0], end.velocities[0]]
    }
}

impl Accelerations<1> for Pendulum {
    #[inline(always)]
    fn accelerations<T: Trigonometry>(&self, state: &State<1>, [torque]: [f64; 1]) -> [f64; 1] {
        let (sine, cosine) = T::sincos(self.angle_at_zero + self.sign * state.positions[0]);
        let weight = self.moment * (self.gravity[1] * cosine - self.gravity[0] * sine);
        [(torque + self.sign * weight) / self.inertia]
    }
}

impl EquationsOfMotion<1> for Pendulum {
    fn joints(&self) -> [usize; 1] {
        [0]
    }

    fn substeps(&self) -> u32 {
        self.substeps
    }

    #[inline(always)]
    fn advance<T: Trigonometry>(&self, state: &State<1>, forces: [f64; 1]) -> State<1> {
        let duration = self.control_step / f64::from(self.substeps);
        runge_kutta::<T, _, 1>(self, state, forces, duration)
    }
}
