//! Outlines of shapes, in the frame of their body and in the picture, and lines of the ground. The y
//! axis of a picture points down.

use seedbed_env::{Environment, Pose, SceneRope, Shape};

/// Number of sides of the polygon that stands for a circle, which looks round at the sizes of films.
const SIDES_OF_BALL: u8 = 32;

/// The outline of a shape in its body's frame, m. `None` for open lines, which are left out of traces.
#[must_use]
pub fn outline(shape: &Shape) -> Option<Vec<[f32; 2]>> {
    match shape {
        Shape::Ball { center, radius } => {
            let point = |part: u8| {
                rotated_and_shifted(
                    [*radius, 0.0],
                    f32::from(part) * std::f32::consts::TAU / f32::from(SIDES_OF_BALL),
                    *center,
                )
            };
            Some((0..=SIDES_OF_BALL).map(point).collect())
        }
        Shape::Box {
            center,
            half_size,
            angle,
        } => Some(
            corners(*half_size)
                .map(|corner| rotated_and_shifted(corner, *angle, *center))
                .to_vec(),
        ),
        Shape::Capsule { from, to, .. } => Some(vec![*from, *to]),
        Shape::Polygon(points) => Some(points.iter().chain(points.first()).copied().collect()),
        Shape::Polyline(_) => None,
    }
}

/// The points of a shape in its body's frame, m, and the thickness of lines, m; `None` for closed shapes.
#[must_use]
pub fn points_and_thickness(shape: &Shape) -> (Vec<[f32; 2]>, Option<f32>) {
    match shape {
        Shape::Polyline(points) => (points.clone(), Some(0.0)),
        Shape::Capsule { from, to, radius } => (vec![*from, *to], Some(2.0 * radius)),
        closed => (outline(closed).unwrap_or_default(), None),
    }
}

/// The shapes of bodies that never move, as [`points_and_thickness`] describes them, but in the world, y up.
#[must_use]
pub fn fixed_shapes(environment: &dyn Environment) -> Vec<(Vec<[f32; 2]>, Option<f32>)> {
    let Some(scene) = environment.scene() else {
        return Vec::new();
    };
    let mut poses = vec![Pose::default(); scene.bodies.len()];
    environment.poses(0, &mut poses);
    let mut shapes = Vec::new();
    for (body, pose) in scene.bodies.iter().zip(poses) {
        if body.is_fixed {
            shapes.extend(body.shapes.iter().map(|shape| {
                let (points, thickness) = points_and_thickness(shape);
                let in_the_world =
                    |&point: &[f32; 2]| rotated_and_shifted(point, pose.angle, [pose.x, pose.y]);
                (points.iter().map(in_the_world).collect(), thickness)
            }));
        }
    }
    shapes
}

/// The lines of the ground of `copy` that differ from episode to episode, m: `[lines]` of `[points]`.
/// Points whose height is not finite are left out.
#[must_use]
pub fn terrain_lines(environment: &dyn Environment, copy: usize) -> Vec<Vec<[f32; 2]>> {
    let mut lines = environment.terrain(copy);
    for line in &mut lines {
        line.retain(|[x, y]| x.is_finite() && y.is_finite());
    }
    lines
}

/// The position in the picture, m, of a point of a body.
#[must_use]
pub fn scene_point(point: [f32; 2], pose: Pose) -> [f32; 2] {
    let [x, y] = rotated_and_shifted(point, pose.angle, [pose.x, pose.y]);
    [x, -y]
}

/// The ends of a rope in the world, m. `poses`: `[bodies]`
///
/// # Panics
/// If the body at an end has no pose.
#[must_use]
pub fn rope_line(SceneRope(ends): &SceneRope, poses: &[Pose]) -> [[f32; 2]; 2] {
    ends.map(|end| {
        let pose = end.body.map_or(Pose::default(), |body| poses[body]);
        rotated_and_shifted(end.at, pose.angle, [pose.x, pose.y])
    })
}

/// A point, m, rotated about the origin by an angle, rad, and then shifted.
#[must_use]
pub fn rotated_and_shifted([x, y]: [f32; 2], angle: f32, [right, up]: [f32; 2]) -> [f32; 2] {
    let (sin, cos) = angle.sin_cos();
    [right + cos * x - sin * y, up + sin * x + cos * y]
}

/// The corners of a box of half width `w` and half height `h`, with the first corner repeated at
/// the end.
#[must_use]
pub fn corners([w, h]: [f32; 2]) -> [[f32; 2]; 5] {
    [[-w, -h], [w, -h], [w, h], [-w, h], [-w, -h]]
}
