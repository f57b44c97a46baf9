//! The part of a scene that pictures of an episode show. The y axis of a picture points down, so the
//! upper end has the smaller number.

use crate::outline::{outline, scene_point};
use seedbed_env::{Pose, Scene, SceneBody, SceneRope, Shape};

/// Left, right, upper and lower end of a rectangle, m.
pub type Bounds = [f32; 4];

/// A line counts as endless if it is longer than this ratio times the size of all other parts.
const ENDLESS_RATIO: f32 = 5.0;

/// Bounds that contain all bodies during an episode, and the ground near them. If a body is tracked,
/// the bounds are relative to that body, and contain only the moving bodies and the ground near them.
///
/// `poses`: `[states × bodies]`; `terrain`: the lines of the ground in the world, m. `None` if no body
/// moves.
#[must_use]
pub fn episode_bounds(scene: &Scene, poses: &[Pose], terrain: &[Vec<[f32; 2]>]) -> Option<Bounds> {
    let states = || poses.chunks_exact(scene.bodies.len());
    let moving = states()
        .filter_map(|state| moving_bounds(scene, state))
        .reduce(union)?;
    if let Some(tracked) = scene.tracked {
        let shown = states()
            .filter_map(|state| {
                tracked_ground(scene, state, state[tracked], extent(moving), terrain)
            })
            .fold(moving, union);
        return Some(with_margin(shown, 0.25 * extent(shown)));
    }
    Some(bounds_of_fixed_and_moving_bodies(
        moving,
        &fixed_bounds(scene, states().next()?),
        line_overhang(&scene.bodies),
        terrain,
    ))
}

/// Bounds of several episodes of a scene, of which each has `poses` and `terrain` as in
/// [`episode_bounds`].
#[must_use]
pub fn bounds_of_episodes<'a>(
    scene: &Scene,
    episodes: impl Iterator<Item = (&'a [Pose], &'a [Vec<[f32; 2]>])>,
) -> Option<Bounds> {
    let bounds = episodes.filter_map(|(poses, terrain)| episode_bounds(scene, poses, terrain));
    bounds.reduce(union)
}

/// Bounds that contain the moving bodies, the fixed bodies, the nearest points of endless lines
/// that are near, and space for a body at the end of a line. Of endless ground they contain what is
/// near all other parts.
fn bounds_of_fixed_and_moving_bodies(
    moving: Bounds,
    fixed_parts: &[(Bounds, bool)],
    line_overhang: f32,
    terrain: &[Vec<[f32; 2]>],
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
    let is_endless = |line: &Bounds| extent(*line) > ENDLESS_RATIO * size;
    let (endless, finite): (Vec<_>, Vec<_>) = lines.partition(is_endless);
    let ground = terrain.iter().filter_map(|line| {
        let whole = bounds(line, Pose::default())?;
        Some((line, whole))
    });
    let (endless_ground, finite_ground): (Vec<_>, Vec<_>) =
        ground.partition(|(_, whole)| is_endless(whole));
    let with_finite_lines = finite
        .into_iter()
        .chain(finite_ground.into_iter().map(|(_, whole)| whole))
        .map(|line| with_margin(line, line_overhang))
        .fold(closed_bounds, union);
    let all = endless.into_iter().fold(with_finite_lines, |all, line| {
        extended_to_nearest_point(all, line, size)
    });
    let all = endless_ground
        .into_iter()
        .filter_map(|(line, _)| ground_near(line, all, size))
        .fold(all, union);
    with_margin(all, 0.05 * extent(all))
}

/// Bounds of the moving bodies in one state, for every possible rotation about their origins.
fn moving_bounds(scene: &Scene, state: &[Pose]) -> Option<Bounds> {
    let camera = scene.tracked.map_or(Pose::default(), |body| state[body]);
    let moving = scene
        .bodies
        .iter()
        .zip(state)
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

/// Bounds of each shape of the fixed bodies and of each point of the world that a rope is tied to, and
/// whether they are those of an open line.
fn fixed_bounds(scene: &Scene, state: &[Pose]) -> Vec<(Bounds, bool)> {
    let bodies = scene.bodies.iter().zip(state);
    let fixed = bodies.filter(|(body, _)| body.is_fixed);
    let shapes = fixed.flat_map(|(body, pose)| body.shapes.iter().map(|shape| (shape, *pose)));
    let bounds_of_shape = |(shape, pose): (&Shape, Pose)| match shape {
        Shape::Polyline(points) => Some((bounds(points, pose)?, true)),
        closed_shape => Some((bounds(&outline(closed_shape)?, pose)?, false)),
    };
    let rope_ends = scene.ropes.iter().flat_map(|SceneRope(ends)| ends);
    let tied_to_world = rope_ends.filter(|end| end.body.is_none());
    shapes
        .filter_map(bounds_of_shape)
        .chain(tied_to_world.filter_map(|end| Some((bounds(&[end.at], Pose::default())?, false))))
        .collect()
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

/// Bounds of the ground near the moving bodies in one state, relative to the tracked body at `camera`.
fn tracked_ground(
    scene: &Scene,
    state: &[Pose],
    camera: Pose,
    distance: f32,
    terrain: &[Vec<[f32; 2]>],
) -> Option<Bounds> {
    if terrain.is_empty() {
        return None;
    }
    let bodies = shifted(moving_bounds(scene, state)?, [camera.x, -camera.y]);
    let ground = terrain
        .iter()
        .filter_map(|line| ground_near(line, bodies, distance))
        .reduce(union)?;
    Some(shifted(ground, [-camera.x, camera.y]))
}

/// Bounds of the part of a line of the ground that is above or below `part`, up to `distance` away.
fn ground_near(line: &[[f32; 2]], part: Bounds, distance: f32) -> Option<Bounds> {
    let [left, right, top, bottom] = part;
    let segments = line.windows(2);
    let [from, to, highest, lowest] = segments
        .filter_map(|ends| segment_within(ends[0], ends[1], [left, right]))
        .reduce(union)?;
    let (highest, lowest) = (highest.max(top - distance), lowest.min(bottom + distance));
    (highest <= lowest).then_some([from, to, highest, lowest])
}

/// Bounds of the part of a segment that is between `left` and `right`.
fn segment_within(one: [f32; 2], other: [f32; 2], [left, right]: [f32; 2]) -> Option<Bounds> {
    let (from, to) = (
        one[0].min(other[0]).max(left),
        one[0].max(other[0]).min(right),
    );
    if from > to {
        return None;
    }
    let width = other[0] - one[0];
    let y = |x: f32| {
        let share = if width == 0.0 {
            0.0
        } else {
            (x - one[0]) / width
        };
        -(one[1] + share * (other[1] - one[1]))
    };
    Some([from, to, y(from).min(y(to)), y(from).max(y(to))])
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

/// The smallest rectangle that contains both.
#[must_use]
pub fn union(one: Bounds, other: Bounds) -> Bounds {
    [
        one[0].min(other[0]),
        one[1].max(other[1]),
        one[2].min(other[2]),
        one[3].max(other[3]),
    ]
}

fn shifted([left, right, top, bottom]: Bounds, [x, y]: [f32; 2]) -> Bounds {
    [left + x, right + x, top + y, bottom + y]
}

fn with_margin([left, right, top, bottom]: Bounds, margin: f32) -> Bounds {
    [left - margin, right + margin, top - margin, bottom + margin]
}

/// Length of the longer side, m.
#[must_use]
pub fn extent([left, right, top, bottom]: Bounds) -> f32 {
    (right - left).max(bottom - top)
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::SceneRopeEnd;

    fn body(name: &str, is_fixed: bool, shapes: Vec<Shape>) -> SceneBody {
        SceneBody {
            name: name.to_owned(),
            is_fixed,
            color: None,
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
            ropes: Vec::new(),
        }
    }

    fn ball_between_walls_at(x: f32, y: f32) -> [Pose; 2] {
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
        let poses = [
            ball_between_walls_at(-0.5, 0.0),
            ball_between_walls_at(0.5, 0.0),
        ]
        .concat();
        assert_close(
            episode_bounds(&ball_between_walls(), &poses, &[]),
            [-1.1, 1.1, -1.1, 1.1],
        );
        // A ball that does not move extends over 0.4 m, so that walls at a distance of 0.8 m are
        // too far. The bounds are 0.4 m plus 5 % on each side.
        assert_close(
            episode_bounds(&ball_between_walls(), &ball_between_walls_at(0.0, 0.0), &[]),
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
            ropes: Vec::new(),
        };
        // The cart has a radius of 0.5 m and may be at either end of the rail: 6 m plus 5 % on each
        // side. The pole has a radius of 1 m.
        assert_close(
            episode_bounds(&scene, &[Pose::default(); 3], &[]),
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
            ball_between_walls_at(-50.0, 3.0),
            ball_between_walls_at(50.0, 0.0),
        ]
        .concat();
        // The bounds are 0.4 m, the size of the ball, plus a quarter of this size on each side.
        assert_close(episode_bounds(&scene, &poses, &[]), [-0.3, 0.3, -0.3, 0.3]);
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
            ropes: Vec::new(),
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
                &[],
            ),
            [-1.21, 1.21, -1.21, 1.21],
        );
    }

    /// A ball with a radius of 0.2 m.
    fn free_ball(tracked: Option<usize>) -> Scene {
        let bodies = ball_between_walls().bodies.split_off(1);
        Scene {
            bodies,
            tracked,
            ropes: Vec::new(),
        }
    }

    fn ball_at(x: f32, y: f32) -> Pose {
        Pose { x, y, angle: 0.0 }
    }

    #[test]
    fn the_view_includes_the_point_from_which_a_rope_hangs() {
        let end = |body, at| SceneRopeEnd { body, at };
        let scene = Scene {
            ropes: vec![SceneRope([end(None, [0.0, 0.8]), end(Some(0), [0.0, 0.0])])],
            ..free_ball(None)
        };
        // A ball with a radius of 0.2 m about the origin, and a point 0.8 m above: 1 m plus 5 % on each side.
        assert_close(
            episode_bounds(&scene, &[ball_at(0.0, 0.0)], &[]),
            [-0.25, 0.25, -0.85, 0.25],
        );
    }

    /// Ground that rises by 0.5 m per m, from right to left, `half_length` to both sides of x = 0.
    fn slope(half_length: f32) -> Vec<Vec<[f32; 2]>> {
        let ends = [half_length, -half_length].map(|x| [x, 0.5 * x]);
        vec![vec![ends[0], [0.0, 0.0], ends[1]]]
    }

    #[test]
    fn short_ground_is_shown_as_a_whole() {
        // The ground is 2 m long and 1 m high. A ball at either end has a radius of 0.2 m: 2.4 m plus 5 % on
        // each side.
        assert_close(
            episode_bounds(&free_ball(None), &[ball_at(0.0, 0.3)], &slope(1.0)),
            [-1.32, 1.32, -0.82, 0.82],
        );
    }

    #[test]
    fn long_ground_is_shown_near_the_bodies() {
        // Between x = −0.2 and x = 0.2 the ground rises from −0.1 to 0.1, below a ball that begins at a
        // height of 0.1: 0.6 m plus 5 % on each side.
        let shown = |y| episode_bounds(&free_ball(None), &[ball_at(0.0, y)], &slope(50.0));
        assert_close(shown(0.3), [-0.23, 0.23, -0.53, 0.13]);
        // From a ball that begins at 0.35, the ground down to −0.05 is not further than the 0.4 m of the ball.
        assert_close(shown(0.55), [-0.24, 0.24, -0.79, 0.09]);
        // From a ball that begins at 0.8, it is.
        assert_close(shown(1.0), [-0.22, 0.22, -1.22, -0.78]);
    }

    #[test]
    fn the_ground_is_shown_near_a_tracked_body() {
        // The ground is 0.2 to 0.4 m below the ball at x = 10, and not near when the ball is in the air.
        let poses = [ball_at(10.0, 5.3), ball_at(0.0, 5.3)];
        assert_close(
            episode_bounds(&free_ball(Some(0)), &poses, &slope(50.0)),
            [-0.35, 0.35, -0.35, 0.55],
        );
    }
}
