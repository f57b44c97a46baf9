//! The part of a scene that the viewer shows. Rerun's y axis points down: upper ends have the
//! smaller numbers.

use super::shapes::{outline, placed};
use seedbed_env::{Pose, Scene, SceneBody, Shape};

/// Left, right, upper and lower end of a rectangle.
pub(super) type Bounds = [f32; 4];

/// A line longer than this many times the rest of the scene counts as endless.
const ENDLESS_RATIO: f32 = 5.0;

/// The part of the scene that shows a whole episode, in the frame of the tracked body if there is
/// one.
pub(super) fn episode_bounds(scene: &Scene, poses: &[Pose]) -> Option<Bounds> {
    let frames = || poses.chunks_exact(scene.bodies.len());
    let moved = frames()
        .filter_map(|frame| moving_bounds(scene, frame))
        .reduce(united)?;
    match scene.tracked {
        None => Some(around(
            moved,
            &fixed_bounds(&scene.bodies, frames().next()?),
            overhang(&scene.bodies),
        )),
        Some(_) => Some(widened(moved, 0.25 * extent(moved))),
    }
}

/// Moving and fixed bodies, the nearer end of endless lines, and space for a body at the end of a
/// line.
fn around(moved: Bounds, still: &[(Bounds, bool)], overhang: f32) -> Bounds {
    let solid = still
        .iter()
        .filter(|(_, line)| !line)
        .fold(moved, |all, (part, _)| united(all, *part));
    let size = extent(solid);
    let lines = still
        .iter()
        .filter(|(_, line)| *line)
        .map(|(part, _)| *part);
    let (endless, finite): (Vec<_>, Vec<_>) =
        lines.partition(|line| extent(*line) > ENDLESS_RATIO * size);
    let ended = finite
        .into_iter()
        .map(|line| widened(line, overhang))
        .fold(solid, united);
    let all = endless
        .into_iter()
        .fold(ended, |all, line| stretched(all, line, size));
    widened(all, 0.05 * extent(all))
}

/// The bounds of moving bodies, whatever their rotation about their frames' origins.
fn moving_bounds(scene: &Scene, frame: &[Pose]) -> Option<Bounds> {
    let camera = scene.tracked.map_or(Pose::default(), |body| frame[body]);
    let moving = scene
        .bodies
        .iter()
        .zip(frame)
        .filter(|(body, _)| !body.fixed);
    let discs = moving
        .filter_map(|(body, pose)| Some((reach(body)?, [pose.x - camera.x, camera.y - pose.y])));
    discs
        .map(|(radius, [x, y])| widened([x, x, y, y], radius))
        .reduce(united)
}

/// The bounds of the shapes of fixed bodies, and whether each is an open line.
fn fixed_bounds(bodies: &[SceneBody], frame: &[Pose]) -> Vec<(Bounds, bool)> {
    let fixed = bodies.iter().zip(frame).filter(|(body, _)| body.fixed);
    let shapes = fixed.flat_map(|(body, pose)| body.shapes.iter().map(|shape| (shape, *pose)));
    let place = |(shape, pose): (&Shape, Pose)| match shape {
        Shape::Polyline(points) => Some((bounds(points, pose)?, true)),
        solid => Some((bounds(&outline(solid)?, pose)?, false)),
    };
    shapes.filter_map(place).collect()
}

/// Extends bounds to the nearest end of a part if that is at most `distance` away.
fn stretched([left, right, top, bottom]: Bounds, part: Bounds, distance: f32) -> Bounds {
    let [x, y] = [
        left.max(part[0]).min(part[1]),
        top.max(part[2]).min(part[3]),
    ];
    let wanted = united([left, right, top, bottom], [x, x, y, y]);
    let stretch = (left - wanted[0])
        .max(wanted[1] - right)
        .max(top - wanted[2])
        .max(wanted[3] - bottom);
    if stretch <= distance {
        wanted
    } else {
        [left, right, top, bottom]
    }
}

/// The radius of a body about its frame's origin, if it has a shape.
fn reach(body: &SceneBody) -> Option<f32> {
    let thickness = |shape: &Shape| {
        if let Shape::Capsule { radius, .. } = shape {
            *radius
        } else {
            0.0
        }
    };
    let furthest = |shape| {
        outline(shape)?
            .into_iter()
            .map(|[x, y]| x.hypot(y) + thickness(shape))
            .reduce(f32::max)
    };
    body.shapes.iter().filter_map(furthest).reduce(f32::max)
}

/// How far a body at the end of a line reaches beyond it: the largest radius of a body without a
/// hinge.
fn overhang(bodies: &[SceneBody]) -> f32 {
    let loose = bodies
        .iter()
        .filter(|body| !body.fixed && body.hinge.is_none());
    loose.filter_map(reach).fold(0.0, f32::max)
}

fn bounds(outline: &[[f32; 2]], pose: Pose) -> Option<Bounds> {
    outline
        .iter()
        .map(|point| placed(*point, pose))
        .map(|[x, y]| [x, x, y, y])
        .reduce(united)
}

fn united(one: Bounds, other: Bounds) -> Bounds {
    [
        one[0].min(other[0]),
        one[1].max(other[1]),
        one[2].min(other[2]),
        one[3].max(other[3]),
    ]
}

fn widened([left, right, top, bottom]: Bounds, margin: f32) -> Bounds {
    [left - margin, right + margin, top - margin, bottom + margin]
}

/// Length of the longer side.
pub(super) fn extent([left, right, top, bottom]: Bounds) -> f32 {
    (right - left).max(bottom - top)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(name: &str, fixed: bool, shapes: Vec<Shape>) -> SceneBody {
        SceneBody {
            name: name.to_owned(),
            fixed,
            shapes,
            hinge: None,
        }
    }

    /// A room of 2 m by 2 m between endless lines, and a ball in it.
    fn ball_in_a_room() -> Scene {
        let wall = |[x, y]: [f32; 2]| {
            Shape::Polyline(vec![
                [x - 100.0 * y, y - 100.0 * x],
                [x + 100.0 * y, y + 100.0 * x],
            ])
        };
        let room = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]
            .map(wall)
            .to_vec();
        let ball = Shape::Ball {
            center: [0.0, 0.0],
            radius: 0.2,
        };
        Scene {
            bodies: vec![body("world", true, room), body("ball", false, vec![ball])],
            tracked: None,
        }
    }

    fn ball_at(x: f32, y: f32) -> [Pose; 2] {
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
        // The ball goes from -0.5 to 0.5 and is 0.2 wide: 1.4 m in all, so that all four walls are
        // near enough. Of 2 m, 5 % are added.
        let poses = [ball_at(-0.5, 0.0), ball_at(0.5, 0.0)].concat();
        assert_close(
            episode_bounds(&ball_in_a_room(), &poses),
            [-1.1, 1.1, -1.1, 1.1],
        );
        // A ball that hardly moves is 0.4 m: the walls 0.8 m from it are too far. Of 0.4 m, 5 % are
        // added.
        assert_close(
            episode_bounds(&ball_in_a_room(), &ball_at(0.0, 0.0)),
            [-0.22, 0.22, -0.22, 0.22],
        );
    }

    #[test]
    fn a_cart_at_the_end_of_its_rail_is_shown_whole() {
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
        let hung = SceneBody {
            hinge: Some([0.0, 0.0]),
            ..body("pole", false, vec![pole])
        };
        let bodies = vec![
            body("rail", true, vec![rail]),
            body("cart", false, vec![cart]),
            hung,
        ];
        let scene = Scene {
            bodies,
            tracked: None,
        };
        // The cart reaches 0.5 m about its middle, at either end of the rail: 6 m, of which 5 % are
        // added. The pole reaches 1 m.
        assert_close(
            episode_bounds(&scene, &[Pose::default(); 3]),
            [-3.3, 3.3, -1.3, 1.3],
        );
    }

    #[test]
    fn a_tracked_body_stays_in_the_middle() {
        let scene = Scene {
            tracked: Some(1),
            ..ball_in_a_room()
        };
        let poses = [ball_at(-50.0, 3.0), ball_at(50.0, 0.0)].concat();
        // 0.4 m, and a fourth of it on each side.
        assert_close(episode_bounds(&scene, &poses), [-0.3, 0.3, -0.3, 0.3]);
    }

    #[test]
    fn a_pendulum_has_space_to_turn() {
        let rod = Shape::Capsule {
            from: [0.0, 0.0],
            to: [0.0, 1.0],
            radius: 0.1,
        };
        let scene = Scene {
            bodies: vec![body("rod", false, vec![rod])],
            tracked: None,
        };
        // A disc of 1.1 m about the pivot, and 5 % of its 2.2 m.
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
