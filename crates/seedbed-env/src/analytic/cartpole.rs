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

use super::integration::{Accelerations, State, euler, runge_kutta, substeps};
use super::trigonometry::{Trigonometry, Unbounded};
use super::{EquationsOfMotion, require, require_only_gravity};
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

/// A cart-pole that is integrated by [`Integrator::Euler`](crate::description::Integrator).
///
/// It is a type of its own, so that the loop over copies has no branch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct EulerCartPole(pub(super) CartPole);

/// Maximum time step of the Runge–Kutta integration, s. Its error over one control step is below
/// what an f32 resolves (tested against steps of 1e-4 s): at most 3e-8 up to 4 m/s and 12 rad/s.
const MAX_STEP: f64 = 0.02;

impl CartPole {
    /// Takes the parameters from the bodies of a task with this analytic model.
    ///
    /// # Errors
    /// The bodies are not those of a cart-pole; the message says what is required.
    pub fn from_task(task: &BodyTask) -> Result<Self, String> {
        let Some(AnalyticModel::CartPole { slider, hinge, .. }) = task.analytic_model else {
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

    /// Accelerations ẍ and α̈ at angle α and rate α̇, under force F (N) on the cart and torque τ (N
    /// m) on the hinge.
    #[must_use]
    pub fn accelerations(&self, angle: f64, rate: f64, force: f64, torque: f64) -> [f64; 2] {
        let state = State {
            positions: [0.0, angle],
            velocities: [0.0, rate],
        };
        Accelerations::accelerations::<Unbounded>(self, &state, [force, torque])
    }

    /// Total energy T + V of the state x, α, ẋ, α̇, J.
    #[must_use]
    pub fn energy(&self, [_, angle, speed, rate]: [f64; 4]) -> f64 {
        let (linear, angular) = (self.total_mass * speed * speed, self.inertia * rate * rate);
        let coupling = self.moment * angle.cos() * speed * rate;
        0.5 * (linear + angular) + coupling + self.moment * self.gravity * angle.cos()
    }

    /// The state x, α, ẋ, α̇ after one sixth-order Runge–Kutta step of `duration`, s.
    #[must_use]
    pub fn runge_kutta(
        &self,
        [position, angle, speed, rate]: [f64; 4],
        force: f64,
        torque: f64,
        duration: f64,
    ) -> [f64; 4] {
        let start = State {
            positions: [position, angle],
            velocities: [speed, rate],
        };
        let end = runge_kutta::<Unbounded, _, 2>(self, &start, [force, torque], duration);
        let ([position, angle], [speed, rate]) = (end.positions, end.velocities);
        [position, angle, speed, rate]
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
        let start = State {
            positions: [position, angle],
            velocities: [speed, rate],
        };
        let end = euler::<Unbounded, _, 2>(self, &start, [force, 0.0], duration);
        let ([position, angle], [speed, rate]) = (end.positions, end.velocities);
        [position, angle, speed, rate]
    }

    /// The state x, α, ẋ, α̇ at these joint coordinates.
    #[inline(always)]
    fn state_of_joints(&self, joints: &State<2>) -> State<2> {
        let [position, angle] = self.signed(joints.positions);
        State {
            positions: [position, self.angle_at_zero + angle],
            velocities: self.signed(joints.velocities),
        }
    }

    /// The joint coordinates in a state x, α, ẋ, α̇.
    #[inline(always)]
    fn joints_of_state(&self, state: &State<2>) -> State<2> {
        let [position, angle] = state.positions;
        State {
            positions: self.signed([position, angle - self.angle_at_zero]),
            velocities: self.signed(state.velocities),
        }
    }

    /// Coordinates, rates or forces along the joints from those along x and α, or the reverse.
    #[inline(always)]
    fn signed(&self, values: [f64; 2]) -> [f64; 2] {
        [self.slider_sign * values[0], self.hinge_sign * values[1]]
    }
}

impl Accelerations<2> for CartPole {
    /// ẍ and α̈ under the force on the cart and the torque on the hinge.
    #[inline(always)]
    fn accelerations<T: Trigonometry>(
        &self,
        state: &State<2>,
        [force, torque]: [f64; 2],
    ) -> [f64; 2] {
        let ([_, angle], [_, rate]) = (state.positions, state.velocities);
        let (sine, cosine) = T::sincos(angle);
        let coupling = self.moment * cosine;
        let cart_force = force + self.moment * sine * rate * rate;
        let pole_torque = torque + self.moment * self.gravity * sine;
        // One division is faster than two.
        let inverse = 1.0 / (self.total_mass * self.inertia - coupling * coupling);
        [
            (self.inertia * cart_force - coupling * pole_torque) * inverse,
            (self.total_mass * pole_torque - coupling * cart_force) * inverse,
        ]
    }
}

/// The coordinates are those of the slider and of the hinge.
impl EquationsOfMotion<2> for CartPole {
    fn joints(&self) -> [usize; 2] {
        [self.slider, 1 - self.slider]
    }

    fn substeps(&self) -> u32 {
        self.substeps
    }

    #[inline(always)]
    fn advance<T: Trigonometry>(&self, joints: &State<2>, forces: [f64; 2]) -> State<2> {
        let duration = self.control_step / f64::from(self.substeps);
        let (start, forces) = (self.state_of_joints(joints), self.signed(forces));
        self.joints_of_state(&runge_kutta::<T, _, 2>(self, &start, forces, duration))
    }
}

/// One step of the explicit Euler method per control step.
impl EquationsOfMotion<2> for EulerCartPole {
    fn joints(&self) -> [usize; 2] {
        self.0.joints()
    }

    fn substeps(&self) -> u32 {
        1
    }

    #[inline(always)]
    fn advance<T: Trigonometry>(&self, joints: &State<2>, forces: [f64; 2]) -> State<2> {
        let model = &self.0;
        let (start, forces) = (model.state_of_joints(joints), model.signed(forces));
        let end = euler::<T, _, 2>(model, &start, forces, model.control_step);
        model.joints_of_state(&end)
    }
}
