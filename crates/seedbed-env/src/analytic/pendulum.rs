//! A body that swings about a fixed point without friction.
//!
//! With α the counter-clockwise angle of the arm from the pivot to the center of mass against the
//! x-axis, m the mass, l the arm's length, I the inertia about the center of mass, (gₓ, g_y)
//! gravity and τ the torque, the balance of moments about the pivot is
//!
//! ```text
//! (I + m l²) α̈ = τ + m l (g_y cos α − gₓ sin α)
//! ```

use super::{EquationsOfMotion, require, require_only_gravity, runge_kutta, substeps};
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
const MAX_STEP: f64 = 0.005;

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
        let (sine, cosine) = libm::sincos(self.angle_at_zero + self.sign * position);
        let weight = self.moment * (self.gravity[1] * cosine - self.gravity[0] * sine);
        (torque + self.sign * weight) / self.inertia
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
    pub fn runge_kutta(&self, state: [f64; 2], torque: f64, duration: f64) -> [f64; 2] {
        runge_kutta(state, duration, |[position, velocity]| {
            [velocity, self.acceleration(position, torque)]
        })
    }
}

impl EquationsOfMotion for Pendulum {
    fn advance(&self, state: &mut [f64], forces: &[f64]) {
        let duration = self.control_step / f64::from(self.substeps);
        let start = [state[0], state[1]];
        let end = (0..self.substeps).fold(start, |state, _| {
            self.runge_kutta(state, forces[0], duration)
        });
        state.copy_from_slice(&end);
    }
}
