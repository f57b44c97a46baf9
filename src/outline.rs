//! Outlines of shapes, in the frame of their body and in the scene, and lines of the ground. The y
//! axis of a scene points down, as in Rerun and in images.

use seedbed_env::{Environment, Pose, SceneRope, Shape};

/// The outline of a shape. `None` for open lines, which are left out of traces.
pub(crate) fn outline(shape: &Shape) -> Option<Vec<[f32; 2]>> {
    match shape {
        Shape::Ball { center, radius } => {
            let point = |part: u8| {
                rotated_and_shifted(
                    [*radius, 0.0],
                    f32::from(part) * std::f32::consts::TAU / 16.0,
                    *center,
                )
            };
            Some((0..=16).map(point).collect())
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

/// The lines of the ground of `copy` that differ from episode to episode, m: `[lines]` of `[points]`.
/// Points whose height is not finite are left out.
pub(crate) fn terrain_lines(environment: &dyn Environment, copy: usize) -> Vec<Vec<[f32; 2]>> {
    let mut lines = environment.terrain(copy);
    for line in &mut lines {
        line.retain(|[x, y]| x.is_finite() && y.is_finite());
    }
    lines
}

/// The position in the scene of a point of a body.
pub(crate) fn scene_point(point: [f32; 2], pose: Pose) -> [f32; 2] {
    let [x, y] = rotated_and_shifted(point, pose.angle, [pose.x, pose.y]);
    [x, -y]
}

/// The ends of a rope in the world, m. `poses`: of all bodies.
pub(crate) fn rope_line(SceneRope(ends): &SceneRope, poses: &[Pose]) -> [[f32; 2]; 2] {
    ends.map(|end| {
        let pose = end.body.map_or(Pose::default(), |body| poses[body]);
        rotated_and_shifted(end.at, pose.angle, [pose.x, pose.y])
    })
}

pub(super) fn rotated_and_shifted([x, y]: [f32; 2], angle: f32, [right, up]: [f32; 2]) -> [f32; 2] {
    let (sin, cos) = angle.sin_cos();
    [right + cos * x - sin * y, up + sin * x + cos * y]
}

/// The corners of a box of half width `w` and half height `h`, with the first corner repeated at
/// the end.
pub(super) fn corners([w, h]: [f32; 2]) -> [[f32; 2]; 5] {
    [[-w, -h], [w, -h], [w, h], [-w, h], [-w, -h]]
}
