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
        Shape::Polygon(points) if !has_area(points) => None,
        Shape::Polygon(points) => {
            let points: Vec<_> = points.iter().copied().map(Vector::from_array).collect();
            ConvexPolygon::from_convex_hull(&points).map(|polygon| polygon.mass_properties(1.0))
        }
        Shape::Polyline(_) => None,
    }
}

/// Minimum width of a convex hull, m, and minimum of its share of the hull's longest extent. Parry does
/// not find the hull of narrower ones, or panics.
const MIN_WIDTH: f64 = 1e-6;
const MIN_RELATIVE_WIDTH: f64 = 1e-5;

/// Whether the convex hull of some points is wide enough to be computed in single precision. The width
/// is that across the line from the first point to the one that is farthest from it, at most twice the
/// minimum width.
fn has_area(points: &[[f32; 2]]) -> bool {
    let from_first = points
        .iter()
        .map(|point| [0, 1].map(|axis| f64::from(point[axis]) - f64::from(points[0][axis])));
    let length = |[x, y]: [f64; 2]| x.hypot(y);
    let farthest = from_first
        .clone()
        .max_by(|one, other| length(*one).total_cmp(&length(*other)));
    let Some(farthest) = farthest.filter(|farthest| length(*farthest) > 0.0) else {
        return false;
    };
    let extent = length(farthest);
    let across = from_first.map(|[x, y]| (farthest[0] * y - farthest[1] * x) / extent);
    let (low, high) = across.fold((0.0_f64, 0.0_f64), |(low, high), across| {
        (low.min(across), high.max(across))
    });
    // Coordinates are rounded to a part of the distance from the origin.
    let rounding = points
        .iter()
        .flatten()
        .fold(0.0_f64, |max, x| max.max(f64::from(x.abs())))
        * f64::from(f32::EPSILON);
    high - low
        >= MIN_WIDTH
            .max(MIN_RELATIVE_WIDTH * extent)
            .max(8.0 * rounding)
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
