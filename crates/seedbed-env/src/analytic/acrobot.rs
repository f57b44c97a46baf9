//! Two links in a chain that swings about a fixed point without friction.
//!
//! With α, β the counter-clockwise angles of the links' frames, m and I their masses and inertias,
//! c₁ the vector from the shoulder to the upper link's center of mass, e the vector from the
//! shoulder to the elbow, and c₂ the vector from the elbow to the lower link's center of mass (each
//! turns with its link), Lagrange's equations are
//!
//! ```text
//! A α̈ + K cos δ β̈ − K sin δ β̇² = Q₁ + torque of gravity on m₁ at c₁ and on m₂ at e
//! K cos δ α̈ + B β̈ + K sin δ α̇² = Q₂ + torque of gravity on m₂ at c₂
//!
//! A = I₁ + m₁ c₁² + m₂ e²
//! B = I₂ + m₂ c₂²
//! ```
//!
//! with K = m₂ |e| |c₂| and δ the angle from e to c₂ (from T = ½ A α̇² + ½ B β̇² + K cos δ α̇ β̇).
//! The shoulder's torque τ₁ turns the upper link, the elbow's τ₂ the lower link and its reaction
//! the upper one: Q₁ = τ₁ − τ₂, Q₂ = τ₂.

use super::integration::{Accelerations, State, runge_kutta, substeps};
use super::trigonometry::{Trigonometry, Unbounded};
use super::{EquationsOfMotion, require, require_only_gravity};
use crate::description::{AnalyticModel, BodyTask, JointKind};
use crate::kinematics::{Frame, KinematicTree};

/// The parameters of an acrobot, and how the task's joint coordinates map onto α and β.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Acrobot {
    /// A, kg m².
    pub upper_inertia: f64,
    /// B, kg m².
    pub lower_inertia: f64,
    /// K, kg m².
    pub coupling: f64,
    /// m₁ c₁ + m₂ e, kg m, in the upper link's frame.
    pub upper_moment: [f64; 2],
    /// m₂ c₂, kg m, in the lower link's frame.
    pub lower_moment: [f64; 2],
    /// Gravity to the right and upwards, m/s².
    pub gravity: [f64; 2],
    /// δ when both frames are parallel.
    delta_offset: f64,
    /// α and β − α at coordinates 0.
    angles_at_zero: [f64; 2],
    /// For shoulder and elbow: +1 if the coordinate grows counter-clockwise, else −1.
    signs: [f64; 2],
    /// Index of the shoulder: 0 or 1.
    shoulder: usize,
    control_step: f64,
    substeps: u32,
}

/// Maximum time step of the Runge–Kutta integration, s. Its error over one control step is below
/// what an f32 resolves: at most 6e-9 up to 4 rad/s of the upper and 9 rad/s of the lower link.
const MAX_STEP: f64 = 0.0125;

impl Acrobot {
    /// Takes the parameters from the bodies of a task with this analytic model.
    ///
    /// # Errors
    /// The bodies are not those of an acrobot; the message says what is required.
    pub fn from_task(task: &BodyTask) -> Result<Self, String> {
        let Some(AnalyticModel::Acrobot { shoulder, elbow }) = task.analytic_model else {
            return Err("the task has no analytic model of an acrobot".to_owned());
        };
        require_only_gravity(task)?;
        let (first, second) = (&task.joints[shoulder], &task.joints[elbow]);
        let sign = |kind, name| match kind {
            JointKind::Hinge { sign } => Ok(sign),
            _ => Err(format!(
                "`Acrobot` requires two hinges, but joint `{name}` is not one"
            )),
        };
        let signs = [
            sign(first.kind, &first.name)?,
            sign(second.kind, &second.name)?,
        ];
        require(
            task.joints.len() == 2,
            "`Acrobot` requires that there are no other joints than `shoulder` and `elbow`",
        )?;
        require(
            first.parent.is_none(),
            "`Acrobot` requires that the parent of `shoulder` is the world",
        )?;
        require(
            second.parent == Some(first.child),
            "`Acrobot` requires that the parent of `elbow` is the child of `shoulder`",
        )?;
        Ok(Self::new(task, [shoulder, elbow], signs))
    }

    fn new(task: &BodyTask, [shoulder, elbow]: [usize; 2], signs: [f64; 2]) -> Self {
        let tree = KinematicTree::new(task);
        let (first, second) = (&tree.links()[shoulder], &tree.links()[elbow]);
        let (upper, lower) = (
            &task.bodies[first.child].inertial,
            &task.bodies[second.child].inertial,
        );
        let [c1, c2] = [
            difference(upper.com, first.anchor_in_child),
            difference(lower.com, second.anchor_in_child),
        ];
        let e = difference(second.anchor_in_parent, first.anchor_in_child);
        let control_step = task.spec.control_step;
        Self {
            upper_inertia: upper.inertia + upper.mass * dot(c1, c1) + lower.mass * dot(e, e),
            lower_inertia: lower.inertia + lower.mass * dot(c2, c2),
            coupling: lower.mass * (dot(e, e) * dot(c2, c2)).sqrt(),
            upper_moment: [0, 1].map(|i| upper.mass * c1[i] + lower.mass * e[i]),
            lower_moment: c2.map(|length| lower.mass * length),
            gravity: task.gravity,
            delta_offset: libm::atan2(c2[1], c2[0]) - libm::atan2(e[1], e[0]),
            angles_at_zero: [first.angle, second.angle],
            signs,
            shoulder,
            control_step,
            substeps: substeps(control_step, MAX_STEP),
        }
    }

    /// α̈ and β̈ in the state α, β, α̇, β̇ under the torques τ₁, τ₂ (N m, counter-clockwise).
    #[must_use]
    pub fn accelerations(
        &self,
        [alpha, beta, alpha_rate, beta_rate]: [f64; 4],
        torques: [f64; 2],
    ) -> [f64; 2] {
        let state = State {
            positions: [alpha, beta],
            velocities: [alpha_rate, beta_rate],
        };
        Accelerations::accelerations::<Unbounded>(self, &state, torques)
    }

    /// Torque of gravity, N m, on the first moment of mass `moment` (kg m) in a frame that is
    /// turned by `angle`.
    #[inline(always)]
    fn gravity_torque<T: Trigonometry>(&self, [x, y]: [f64; 2], angle: f64) -> f64 {
        let (sine, cosine) = T::sincos(angle);
        (cosine * x - sine * y) * self.gravity[1] - (sine * x + cosine * y) * self.gravity[0]
    }

    /// Total energy T + V of the state α, β, α̇, β̇, J.
    #[must_use]
    pub fn energy(&self, [alpha, beta, alpha_rate, beta_rate]: [f64; 4]) -> f64 {
        let work_of_gravity =
            |moment, angle| dot(Frame::at([0.0; 2], angle).point(moment), self.gravity);
        let coupled =
            self.coupling * (beta - alpha + self.delta_offset).cos() * alpha_rate * beta_rate;
        let kinetic = 0.5
            * (self.upper_inertia * alpha_rate.powi(2) + self.lower_inertia * beta_rate.powi(2))
            + coupled;
        kinetic
            - work_of_gravity(self.upper_moment, alpha)
            - work_of_gravity(self.lower_moment, beta)
    }

    /// The state α, β, α̇, β̇ after one Runge–Kutta step of `duration`, s.
    #[must_use]
    pub fn runge_kutta(
        &self,
        [alpha, beta, alpha_rate, beta_rate]: [f64; 4],
        torques: [f64; 2],
        duration: f64,
    ) -> [f64; 4] {
        let start = State {
            positions: [alpha, beta],
            velocities: [alpha_rate, beta_rate],
        };
        let end = runge_kutta::<Unbounded, _, 2>(self, &start, torques, duration);
        let ([alpha, beta], [alpha_rate, beta_rate]) = (end.positions, end.velocities);
        [alpha, beta, alpha_rate, beta_rate]
    }

    /// The state α, β, α̇, β̇ for joint coordinates: positions, then velocities.
    #[must_use]
    pub fn state_of_joints(&self, joints: &[f64]) -> [f64; 4] {
        let elbow = 1 - self.shoulder;
        let state = self.state_of_coordinates(&State {
            positions: [joints[self.shoulder], joints[elbow]],
            velocities: [joints[2 + self.shoulder], joints[2 + elbow]],
        });
        let ([alpha, beta], [alpha_rate, beta_rate]) = (state.positions, state.velocities);
        [alpha, beta, alpha_rate, beta_rate]
    }

    /// α, β and their rates for the coordinates of shoulder and elbow.
    #[inline(always)]
    fn state_of_coordinates(&self, joints: &State<2>) -> State<2> {
        let ([shoulder, elbow], rates) = (joints.positions, joints.velocities);
        let alpha = self.angles_at_zero[0] + self.signs[0] * shoulder;
        let alpha_rate = self.signs[0] * rates[0];
        State {
            positions: [
                alpha,
                alpha + self.angles_at_zero[1] + self.signs[1] * elbow,
            ],
            velocities: [alpha_rate, alpha_rate + self.signs[1] * rates[1]],
        }
    }

    /// The inverse of [`state_of_coordinates`](Self::state_of_coordinates).
    #[inline(always)]
    fn coordinates_of_state(&self, state: &State<2>) -> State<2> {
        let ([alpha, beta], [alpha_rate, beta_rate]) = (state.positions, state.velocities);
        State {
            positions: [
                self.signs[0] * (alpha - self.angles_at_zero[0]),
                self.signs[1] * (beta - alpha - self.angles_at_zero[1]),
            ],
            velocities: [
                self.signs[0] * alpha_rate,
                self.signs[1] * (beta_rate - alpha_rate),
            ],
        }
    }
}

impl Accelerations<2> for Acrobot {
    /// α̈ and β̈ under the torques τ₁, τ₂.
    #[inline(always)]
    fn accelerations<T: Trigonometry>(
        &self,
        state: &State<2>,
        [shoulder, elbow]: [f64; 2],
    ) -> [f64; 2] {
        let ([alpha, beta], [alpha_rate, beta_rate]) = (state.positions, state.velocities);
        let (sine, cosine) = T::sincos(beta - alpha + self.delta_offset);
        // K cos δ and K sin δ.
        let (inertial_coupling, rate_coupling) = (self.coupling * cosine, self.coupling * sine);
        let upper_torque = shoulder - elbow
            + self.gravity_torque::<T>(self.upper_moment, alpha)
            + rate_coupling * beta_rate * beta_rate;
        let lower_torque = elbow + self.gravity_torque::<T>(self.lower_moment, beta)
            - rate_coupling * alpha_rate * alpha_rate;
        // One division is faster than two.
        let inverse =
            1.0 / (self.upper_inertia * self.lower_inertia - inertial_coupling * inertial_coupling);
        [
            (self.lower_inertia * upper_torque - inertial_coupling * lower_torque) * inverse,
            (self.upper_inertia * lower_torque - inertial_coupling * upper_torque) * inverse,
        ]
    }
}

/// The coordinates are those of the shoulder and of the elbow.
impl EquationsOfMotion<2> for Acrobot {
    fn joints(&self) -> [usize; 2] {
        [self.shoulder, 1 - self.shoulder]
    }

    fn substeps(&self) -> u32 {
        self.substeps
    }

    #[inline(always)]
    fn advance<T: Trigonometry>(&self, joints: &State<2>, forces: [f64; 2]) -> State<2> {
        let duration = self.control_step / f64::from(self.substeps);
        let torques = [self.signs[0] * forces[0], self.signs[1] * forces[1]];
        let start = self.state_of_coordinates(joints);
        let end = runge_kutta::<T, _, 2>(self, &start, torques, duration);
        self.coordinates_of_state(&end)
    }
}

fn difference(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}
