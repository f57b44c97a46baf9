//! A pole that swings without friction on a cart on a level rail.
//!
//! With x the cart's position, α the clockwise angle of the pole's center of mass from straight up,
//! M and m the masses of cart and pole, l the distance from hinge to center of mass, I the inertia
//! about that center, F and τ the generalized forces, Lagrange's equations of T = ½ (M + m) ẋ² + m
//! l cos α ẋ α̇ + ½ (I + m l²) α̇² and V = m g l cos α are
//!
//! ```text
//! (M + m) ẍ      + m l cos α α̈   = F + m l sin α α̇²
//! m l cos α ẍ    + (I + m l²) α̈ = τ + m g l sin α
//! ```
//!
//! (Florian, "Correct equations for the dynamics of the cart-pole system", 2007, without friction;
//! a thin rod has I = m l² / 3).

use super::{EquationsOfMotion, require, require_only_gravity, runge_kutta, substeps};
use crate::description::{AnalyticModel, BodyTask, JointKind};
use crate::kinematics::{Frame, KinematicTree, Motion};

/// The parameters of a cart-pole, and how the task's joint coordinates map onto x and α.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CartPole {
    /// M + m, kg.
    pub total_mass: f64,
    /// m l, kg m.
    pub moment: f64,
    /// I + m l², kg m².
    pub inertia: f64,
    /// g, m/s².
    pub gravity: f64,
    /// +1 if the slider's coordinate grows to the right, else −1.
    slider_sign: f64,
    /// +1 if the hinge's coordinate grows clockwise, else −1.
    hinge_sign: f64,
    /// α at hinge coordinate 0.
    angle_at_zero: f64,
    /// Index of the slider: 0 or 1.
    slider: usize,
    control_step: f64,
    substeps: u32,
}

/// Maximum time step of the fourth-order Runge–Kutta integration, s. Its error over one control
/// step is below what an f32 resolves (tested against steps of 1e-4 s).
const MAX_STEP: f64 = 0.005;

impl CartPole {
    /// Takes the parameters from the bodies of a task with this analytic model.
    ///
    /// # Errors
    /// The bodies are not those of a cart-pole; the message says what is required.
    pub fn from_task(task: &BodyTask) -> Result<Self, String> {
        let Some(AnalyticModel::CartPole { slider, hinge }) = task.analytic_model else {
            return Err("the task has no analytic model of a cart-pole".to_owned());
        };
        require_only_gravity(task)?;
        let (rail, pivot) = (&task.joints[slider], &task.joints[hinge]);
        let Motion::Slide(axis) = KinematicTree::new(task).links()[slider].motion else {
            return Err(format!(
                "`CartPole` requires a slide as `slider`, but joint `{}` is not one",
                rail.name
            ));
        };
        let JointKind::Hinge { sign } = pivot.kind else {
            return Err(format!(
                "`CartPole` requires a hinge as `hinge`, but joint `{}` is not one",
                pivot.name
            ));
        };
        require(
            task.joints.len() == 2,
            "`CartPole` requires that there are no other joints than `slider` and `hinge`",
        )?;
        require(
            rail.parent.is_none() && axis[1] == 0.0,
            "`CartPole` requires that `slider` is level and its parent is the world",
        )?;
        require(
            pivot.parent == Some(rail.child),
            "`CartPole` requires that the parent of `hinge` is the cart",
        )?;
        require(
            task.gravity[0] == 0.0,
            "`CartPole` requires vertical gravity",
        )?;
        Ok(Self::new(task, [slider, hinge], axis[0], -sign))
    }

    fn new(
        task: &BodyTask,
        [slider, hinge]: [usize; 2],
        slider_sign: f64,
        hinge_sign: f64,
    ) -> Self {
        let pole = &task.bodies[task.joints[hinge].child];
        let cart = &task.bodies[task.joints[slider].child];
        let anchor = task.joints[hinge].anchor;
        let arm = [
            pole.inertial.com[0] - anchor[0],
            pole.inertial.com[1] - anchor[1],
        ];
        let length = libm::hypot(arm[0], arm[1]);
        let [right, up] = Frame::at([0.0; 2], pole.angle).point(arm);
        let control_step = task.spec.control_step;
        Self {
            total_mass: cart.inertial.mass + pole.inertial.mass,
            moment: pole.inertial.mass * length,
            inertia: pole.inertial.inertia + pole.inertial.mass * length * length,
            gravity: -task.gravity[1],
            slider_sign,
            hinge_sign,
            angle_at_zero: libm::atan2(right, up),
            slider,
            control_step,
            substeps: substeps(control_step, MAX_STEP),
        }
    }

    /// The same cart-pole, integrated with this many Runge–Kutta steps per control step.
    #[must_use]
    pub fn with_substeps(self, substeps: u32) -> Self {
        Self { substeps, ..self }
    }

    /// Accelerations ẍ and α̈ at angle α and rate α̇, under force F (N) on the cart and torque τ (N
    /// m) on the hinge.
    #[must_use]
    pub fn accelerations(&self, angle: f64, rate: f64, force: f64, torque: f64) -> [f64; 2] {
        let (sine, cosine) = libm::sincos(angle);
        let coupling = self.moment * cosine;
        let cart_force = force + self.moment * sine * rate * rate;
        let pole_torque = torque + self.moment * self.gravity * sine;
        let determinant = self.total_mass * self.inertia - coupling * coupling;
        [
            (self.inertia * cart_force - coupling * pole_torque) / determinant,
            (self.total_mass * pole_torque - coupling * cart_force) / determinant,
        ]
    }

    /// Total energy T + V of the state x, α, ẋ, α̇, J.
    #[must_use]
    pub fn energy(&self, [_, angle, speed, rate]: [f64; 4]) -> f64 {
        let (linear, angular) = (self.total_mass * speed * speed, self.inertia * rate * rate);
        let coupling = self.moment * angle.cos() * speed * rate;
        0.5 * (linear + angular) + coupling + self.moment * self.gravity * angle.cos()
    }

    /// The state x, α, ẋ, α̇ after one fourth-order Runge–Kutta step of `duration`, s.
    #[must_use]
    pub fn runge_kutta(&self, state: [f64; 4], force: f64, torque: f64, duration: f64) -> [f64; 4] {
        runge_kutta(state, duration, |[_, angle, speed, rate]| {
            let [acceleration, angular_acceleration] =
                self.accelerations(angle, rate, force, torque);
            [speed, rate, acceleration, angular_acceleration]
        })
    }

    /// The state x, α, ẋ, α̇ after one step of Gym's explicit Euler integration, which uses the
    /// rates before the step.
    ///
    /// Source: `CartPoleEnv.step` with `kinematics_integrator == "euler"`,
    /// `gymnasium/envs/classic_control/cartpole.py`, whose `temp` and `thetaacc` are the equations
    /// above solved for a thin rod.
    #[must_use]
    pub fn gym_euler(
        &self,
        [position, angle, speed, rate]: [f64; 4],
        force: f64,
        duration: f64,
    ) -> [f64; 4] {
        let [acceleration, angular_acceleration] = self.accelerations(angle, rate, force, 0.0);
        [
            position + duration * speed,
            angle + duration * rate,
            speed + duration * acceleration,
            rate + duration * angular_acceleration,
        ]
    }

    /// The state x, α, ẋ, α̇ for joint coordinates: positions, then velocities.
    fn state_of_joints(&self, joints: &[f64]) -> [f64; 4] {
        let (slider, hinge) = (self.slider, 1 - self.slider);
        let angle = self.angle_at_zero + self.hinge_sign * joints[hinge];
        let (speed, rate) = (
            self.slider_sign * joints[2 + slider],
            self.hinge_sign * joints[2 + hinge],
        );
        [self.slider_sign * joints[slider], angle, speed, rate]
    }

    /// The inverse of [`state_of_joints`](Self::state_of_joints).
    fn joints_of_state(&self, [position, angle, speed, rate]: [f64; 4]) -> [f64; 4] {
        let mut joints = [0.0; 4];
        let (slider, hinge) = (self.slider, 1 - self.slider);
        joints[slider] = self.slider_sign * position;
        joints[hinge] = self.hinge_sign * (angle - self.angle_at_zero);
        joints[2 + slider] = self.slider_sign * speed;
        joints[2 + hinge] = self.hinge_sign * rate;
        joints
    }
}

impl EquationsOfMotion for CartPole {
    fn advance(&self, joints: &mut [f64], forces: &[f64]) {
        let force = self.slider_sign * forces[self.slider];
        let torque = self.hinge_sign * forces[1 - self.slider];
        let duration = self.control_step / f64::from(self.substeps);
        let start = self.state_of_joints(joints);
        let end = (0..self.substeps).fold(start, |state, _| {
            self.runge_kutta(state, force, torque, duration)
        });
        joints.copy_from_slice(&self.joints_of_state(end));
    }
}
