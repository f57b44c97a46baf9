//! Mass, center of mass and inertia of shapes, computed by Parry.

use parry2d::mass_properties::MassProperties;
use parry2d::math::{Pose, Vector};
use parry2d::shape::{Ball, Capsule, ConvexPolygon, Cuboid, Shape as _};

use crate::Shape;
use crate::description::Inertial;

/// Mass properties of a body of the given mass and uniform density. `None` if the shapes have no
/// area.
#[must_use]
pub fn inertial(mass: f64, shapes: &[Shape]) -> Option<Inertial> {
    let whole = shapes
        .iter()
        .filter_map(properties_at_unit_density)
        .reduce(|sum, next| sum + next)?;
    let density = mass / f64::from(whole.mass());
    let com = whole.local_com.to_array().map(f64::from);
    (whole.mass() > 0.0).then(|| Inertial {
        mass,
        com,
        inertia: density * f64::from(whole.principal_inertia()),
    })
}

/// Mass properties of a shape of 1 kg/m². `None` if it has no area.
fn properties_at_unit_density(shape: &Shape) -> Option<MassProperties> {
    match shape {
        Shape::Ball { center, radius } => Some(
            Ball::new(*radius)
                .mass_properties(1.0)
                .transform_by(&pose(*center, 0.0)),
        ),
        Shape::Box {
            center,
            half_size,
            angle,
        } => Some(
            Cuboid::new(Vector::from_array(*half_size))
                .mass_properties(1.0)
                .transform_by(&pose(*center, *angle)),
        ),
        Shape::Capsule { from, to, radius } => Some(
            Capsule::new(Vector::from_array(*from), Vector::from_array(*to), *radius)
                .mass_properties(1.0),
        ),
        Shape::Polygon(points) => {
            let points: Vec<_> = points.iter().copied().map(Vector::from_array).collect();
            ConvexPolygon::from_convex_hull(&points).map(|polygon| polygon.mass_properties(1.0))
        }
        Shape::Polyline(_) => None,
    }
}

fn pose(center: [f32; 2], angle: f32) -> Pose {
    Pose::new(Vector::from_array(center), angle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn the_inertia_of_a_rectangle_matches_its_formula() {
        let shape = Shape::Box {
            center: [1.0, -2.0],
            half_size: [0.3, 0.4],
            angle: 0.5,
        };
        let found = inertial(6.0, &[shape]).unwrap();
        assert_relative_eq!(
            found.inertia,
            6.0 / 3.0 * (0.09 + 0.16),
            max_relative = 1e-5
        );
        assert_eq!(found.com, [1.0, -2.0]);
    }

    #[test]
    fn the_inertia_of_two_discs_matches_its_formula() {
        let disc = |x: f32| Shape::Ball {
            center: [x, 0.0],
            radius: 0.5,
        };
        let found = inertial(2.0, &[disc(-1.0), disc(1.0)]).unwrap();
        // Each disc of 1 kg: r²/2 about itself, 1 m from the common center.
        assert_relative_eq!(found.inertia, 2.0 * (0.5 * 0.25 + 1.0), max_relative = 1e-5);
        assert_eq!(found.com, [0.0, 0.0]);
    }

    #[test]
    fn a_line_has_no_mass() {
        assert_eq!(
            inertial(1.0, &[Shape::Polyline(vec![[0.0, 0.0], [1.0, 0.0]])]),
            None
        );
    }
}
