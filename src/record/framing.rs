//! The bounds of a scene that viewers and films show. The y axis of a scene points down, so the upper end
//! has the smaller number.

use super::outline::{outline, scene_point};
use seedbed_env::{Pose, Scene, SceneBody, Shape};

/// Left, right, upper and lower end of a rectangle.
pub(crate) type Bounds = [f32; 4];

/// A line counts as endless if it is longer than this ratio times the size of all other parts.
const ENDLESS_RATIO: f32 = 5.0;

/// Bounds that contain all bodies during an episode. If a body is tracked, the bounds are relative
/// to that body and contain only the moving bodies.
pub(crate) fn episode_bounds(scene: &Scene, poses: &[Pose]) -> Option<Bounds> {
    let frames = || poses.chunks_exact(scene.bodies.len());
    let moving = frames()
        .filter_map(|frame| moving_bounds(scene, frame))
        .reduce(union)?;
    match scene.tracked {
        None => Some(bounds_of_fixed_and_moving_bodies(
            moving,
            &fixed_bounds(&scene.bodies, frames().next()?),
            line_overhang(&scene.bodies),
        )),
        Some(_) => Some(with_margin(moving, 0.25 * extent(moving))),
    }
}

/// Bounds that contain the moving bodies, the fixed bodies, the nearest points of endless lines
/// that are near, and space for a body at the end of a line.
fn bounds_of_fixed_and_moving_bodies(
    moving: Bounds,
    fixed_parts: &[(Bounds, bool)],
    line_overhang: f32,
) -> Bounds {
    let closed_bounds = fixed_parts
        .iter()
        .filter(|(_, is_line)| !is_line)
        .fold(moving, |all, (part, _)| union(all, *part));
    let size = extent(closed_bounds);
    let lines = fixed_parts
        .iter()
        .filter(|(_, is_line)| *is_line)
        .map(|(part, _)| *part);
    let (endless, finite): (Vec<_>, Vec<_>) =
        lines.partition(|line| extent(*line) > ENDLESS_RATIO * size);
    let with_finite_lines = finite
        .into_iter()
        .map(|line| with_margin(line, line_overhang))
        .fold(closed_bounds, union);
    let all = endless.into_iter().fold(with_finite_lines, |all, line| {
        extended_to_nearest_point(all, line, size)
    });
    with_margin(all, 0.05 * extent(all))
}

/// Bounds of the moving bodies in one frame, for every possible rotation about their origins.
fn moving_bounds(scene: &Scene, frame: &[Pose]) -> Option<Bounds> {
    let camera = scene.tracked.map_or(Pose::default(), |body| frame[body]);
    let moving = scene
        .bodies
        .iter()
        .zip(frame)
        .filter(|(body, _)| !body.is_fixed);
    let centers_and_radii = moving.filter_map(|(body, pose)| {
        Some((
            radius_about_origin(body)?,
            [pose.x - camera.x, camera.y - pose.y],
        ))
    });
    centers_and_radii
        .map(|(radius, [x, y])| with_margin([x, x, y, y], radius))
        .reduce(union)
}

/// Bounds of each shape of the fixed bodies, and whether the shape is an open line.
fn fixed_bounds(bodies: &[SceneBody], frame: &[Pose]) -> Vec<(Bounds, bool)> {
    let fixed = bodies.iter().zip(frame).filter(|(body, _)| body.is_fixed);
    let shapes = fixed.flat_map(|(body, pose)| body.shapes.iter().map(|shape| (shape, *pose)));
    let bounds_of_shape = |(shape, pose): (&Shape, Pose)| match shape {
        Shape::Polyline(points) => Some((bounds(points, pose)?, true)),
        closed_shape => Some((bounds(&outline(closed_shape)?, pose)?, false)),
    };
    shapes.filter_map(bounds_of_shape).collect()
}

/// Extends bounds to the nearest point of a part if that point is at most `distance` away.
fn extended_to_nearest_point(
    [left, right, top, bottom]: Bounds,
    part: Bounds,
    distance: f32,
) -> Bounds {
    let [x, y] = [
        left.max(part[0]).min(part[1]),
        top.max(part[2]).min(part[3]),
    ];
    let extended = union([left, right, top, bottom], [x, x, y, y]);
    let extension = (left - extended[0])
        .max(extended[1] - right)
        .max(top - extended[2])
        .max(extended[3] - bottom);
    if extension <= distance {
        extended
    } else {
        [left, right, top, bottom]
    }
}

/// Largest distance of a point of a body from its origin; `None` if the body has no shape.
fn radius_about_origin(body: &SceneBody) -> Option<f32> {
    let thickness = |shape: &Shape| {
        if let Shape::Capsule { radius, .. } = shape {
            *radius
        } else {
            0.0
        }
    };
    let max_distance = |shape| {
        outline(shape)?
            .into_iter()
            .map(|[x, y]| x.hypot(y) + thickness(shape))
            .reduce(f32::max)
    };
    body.shapes.iter().filter_map(max_distance).reduce(f32::max)
}

/// Distance by which a body at the end of a line extends beyond the line: the largest radius of a
/// moving body without a hinge.
fn line_overhang(bodies: &[SceneBody]) -> f32 {
    let sliding_bodies = bodies
        .iter()
        .filter(|body| !body.is_fixed && body.hinge.is_none());
    sliding_bodies
        .filter_map(radius_about_origin)
        .fold(0.0, f32::max)
}

fn bounds(outline: &[[f32; 2]], pose: Pose) -> Option<Bounds> {
    outline
        .iter()
        .map(|point| scene_point(*point, pose))
        .map(|[x, y]| [x, x, y, y])
        .reduce(union)
}

pub(crate) fn union(one: Bounds, other: Bounds) -> Bounds {
    [
        one[0].min(other[0]),
        one[1].max(other[1]),
        one[2].min(other[2]),
        one[3].max(other[3]),
    ]
}

fn with_margin([left, right, top, bottom]: Bounds, margin: f32) -> Bounds {
    [left - margin, right + margin, top - margin, bottom + margin]
}

/// Length of the longer side.
pub(crate) fn extent([left, right, top, bottom]: Bounds) -> f32 {
    (right - left).max(bottom - top)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(name: &str, is_fixed: bool, shapes: Vec<Shape>) -> SceneBody {
        SceneBody {
            name: name.to_owned(),
            is_fixed,
            shapes,
            hinge: None,
        }
    }

    /// A ball within a square of 2 m between four endless lines.
    fn ball_between_walls() -> Scene {
        let wall = |[x, y]: [f32; 2]| {
            Shape::Polyline(vec![
                [x - 100.0 * y, y - 100.0 * x],
                [x + 100.0 * y, y + 100.0 * x],
            ])
        };
        let walls = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]
            .map(wall)
            .to_vec();
        let ball = Shape::Ball {
            center: [0.0, 0.0],
            radius: 0.2,
        };
        Scene {
            bodies: vec![body("world", true, walls), body("ball", false, vec![ball])],
            tracked: None,
        }
    }

    fn frame_with_ball_at(x: f32, y: f32) -> [Pose; 2] {
        [Pose::default(), Pose { x, y, angle: 0.0 }]
    }

    fn assert_close(found: Option<Bounds>, expected: Bounds) {
        let found = found.expect("the scene has bounds");
        let is_close = found
            .iter()
            .zip(expected)
            .all(|(found, expected)| (found - expected).abs() < 1e-4);
        assert!(is_close, "{found:?}, expected {expected:?}");
    }

    #[test]
    fn endless_walls_are_shown_if_they_are_near() {
        // The ball moves from −0.5 to 0.5 and has a radius of 0.2: 1.4 m in total, so that all four
        // walls are near enough. The bounds are 2 m plus 5 % on each side.
        let poses = [frame_with_ball_at(-0.5, 0.0), frame_with_ball_at(0.5, 0.0)].concat();
        assert_close(
            episode_bounds(&ball_between_walls(), &poses),
            [-1.1, 1.1, -1.1, 1.1],
        );
        // A ball that does not move extends over 0.4 m, so that walls at a distance of 0.8 m are
        // too far. The bounds are 0.4 m plus 5 % on each side.
        assert_close(
            episode_bounds(&ball_between_walls(), &frame_with_ball_at(0.0, 0.0)),
            [-0.22, 0.22, -0.22, 0.22],
        );
    }

    #[test]
    fn the_view_includes_a_cart_at_the_end_of_its_rail() {
        let cart = Shape::Box {
            center: [0.0, 0.0],
            half_size: [0.4, 0.3],
            angle: 0.0,
        };
        let rail = Shape::Polyline(vec![[-2.5, 0.0], [2.5, 0.0]]);
        let pole = Shape::Capsule {
            from: [0.0, 0.0],
            to: [0.0, 1.0],
            radius: 0.0,
        };
        let suspended = SceneBody {
            hinge: Some([0.0, 0.0]),
            ..body("pole", false, vec![pole])
        };
        let bodies = vec![
            body("rail", true, vec![rail]),
            body("cart", false, vec![cart]),
            suspended,
        ];
        let scene = Scene {
            bodies,
            tracked: None,
        };
        // The cart has a radius of 0.5 m and may be at either end of the rail: 6 m plus 5 % on each
        // side. The pole has a radius of 1 m.
        assert_close(
            episode_bounds(&scene, &[Pose::default(); 3]),
            [-3.3, 3.3, -1.3, 1.3],
        );
    }

    #[test]
    fn the_view_is_centered_at_a_tracked_body() {
        let scene = Scene {
            tracked: Some(1),
            ..ball_between_walls()
        };
        let poses = [
            frame_with_ball_at(-50.0, 3.0),
            frame_with_ball_at(50.0, 0.0),
        ]
        .concat();
        // The bounds are 0.4 m, the size of the ball, plus a quarter of this size on each side.
        assert_close(episode_bounds(&scene, &poses), [-0.3, 0.3, -0.3, 0.3]);
    }

    #[test]
    fn the_view_includes_all_rotations_of_a_pendulum() {
        let rod = Shape::Capsule {
            from: [0.0, 0.0],
            to: [0.0, 1.0],
            radius: 0.1,
        };
        let scene = Scene {
            bodies: vec![body("rod", false, vec![rod])],
            tracked: None,
        };
        // The bounds contain a disc with a radius of 1.1 m about the pivot, plus 5 % of 2.2 m on
        // each side.
        assert_close(
            episode_bounds(
                &scene,
                &[Pose {
                    angle: 3.0,
                    ..Pose::default()
                }],
            ),
            [-1.21, 1.21, -1.21, 1.21],
        );
    }
}
