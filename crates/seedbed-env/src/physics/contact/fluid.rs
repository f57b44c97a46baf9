//! The resistance of a fluid, as MuJoCo computes it from boxes of the same inertia as the bodies.

use std::f64::consts::PI;

use rapier2d::prelude::{RigidBody, Vector};

use crate::description::{BodyTask, Fluid};

/// A body that a fluid resists.
pub(super) struct FluidBody {
    pub(super) body: usize,
    fluid: Fluid,
    /// Lengths of the box along the body's x and y and perpendicular to the plane, m.
    size: [f64; 3],
}

impl FluidBody {
    /// The bodies of a task that its fluid resists.
    pub(super) fn all(task: &BodyTask) -> Vec<Self> {
        let Some(fluid) = task.fluid else {
            return Vec::new();
        };
        let bodies = task.bodies.iter().enumerate();
        bodies
            .filter_map(|(body, described)| {
                let size = described.fluid_box?;
                Some(Self { body, fluid, size })
            })
            .collect()
    }

    /// Adds the force and the torque that belong to the body's motion.
    pub(super) fn resist(&self, body: &mut RigidBody) {
        let rotation = *body.rotation();
        let velocity = rotation.inverse() * body.linvel();
        let velocity = [velocity.x, velocity.y].map(f64::from);
        let (force, torque) = resistance(self.fluid, self.size, velocity, body.angvel().into());
        let force = Vector::new(force[0] as f32, force[1] as f32);
        body.add_force(rotation * force, false);
        body.add_torque(torque as f32, false);
    }
}

/// Force (N, in the body's frame) and torque (N m) on a box that moves with `velocity` (m/s, in the
/// body's frame) and turns with `spin` (rad/s). `size`: lengths along x, y and perpendicular to the
/// plane, m.
///
/// With the mean length d, the viscous force is −3 π d β v and the torque −π d³ β ω. The force of
/// inertia along x is −½ ρ s_y s_z |v_x| v_x, likewise along y, and its torque
/// −ρ s_z (s_x⁴ + s_y⁴) |ω| ω / 64.
///
/// Source: "Fluid forces, inertia model" in the chapter "Computation" of MuJoCo's documentation.
fn resistance(fluid: Fluid, size: [f64; 3], velocity: [f64; 2], spin: f64) -> ([f64; 2], f64) {
    let [x, y, depth] = size;
    let mean_length = (x + y + depth) / 3.0;
    let viscous = 3.0 * PI * mean_length * fluid.viscosity;
    let inertial = |area: f64, speed: f64| 0.5 * fluid.density * area * speed.abs() * speed;
    let force = [
        -viscous * velocity[0] - inertial(y * depth, velocity[0]),
        -viscous * velocity[1] - inertial(x * depth, velocity[1]),
    ];
    let viscous_torque = PI * mean_length.powi(3) * fluid.viscosity * spin;
    let inertial_torque =
        fluid.density * depth * (x.powi(4) + y.powi(4)) * spin.abs() * spin / 64.0;
    (force, -viscous_torque - inertial_torque)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: d = (1 + 2 + 3) / 3 = 2. Viscosity 0.5: 3 π d β = 3 π, π d³ β = 4 π. Density 10: the
    /// faces that meet the flow have 2 × 3 = 6 m² along x and 1 × 3 = 3 m² along y:
    /// ½ 10 × 6 = 30 and ½ 10 × 3 = 15; 10 × 3 (1 + 16) / 64 = 510 / 64.
    #[test]
    fn resistance_is_that_of_the_box() {
        let fluid = Fluid {
            density: 10.0,
            viscosity: 0.5,
        };
        let (force, torque) = resistance(fluid, [1.0, 2.0, 3.0], [0.1, -0.2], -0.3);
        let expected = [-3.0 * PI * 0.1 - 30.0 * 0.01, 3.0 * PI * 0.2 + 15.0 * 0.04];
        assert!((force[0] - expected[0]).abs() < 1e-12, "{force:?}");
        assert!((force[1] - expected[1]).abs() < 1e-12, "{force:?}");
        let expected = 4.0 * PI * 0.3 + 510.0 / 64.0 * 0.09;
        assert!((torque - expected).abs() < 1e-12, "{torque}");
    }
}
