//! Which part of a scene the viewer shows. Rerun's pictures have y downwards: upper ends are the smaller numbers.

use super::shapes::{outline, placed};
use crate::env::{Pose, Scene, SceneBody, Shape};

/// Left, right, upper and lower end.
pub(super) type Bounds = [f32; 4];

/// Lines that are longer than this many times what lies between them go on for ever.
const ENDLESS: f32 = 5.0;

/// The part of the picture that shows a whole episode, seen from the tracked body where there is one.
pub(super) fn framed(scene: &Scene, poses: &[Pose]) -> Option<Bounds> {
    let frames = || poses.chunks_exact(scene.bodies.len());
    let acted = frames()
        .filter_map(|frame| moving(scene, frame))
        .reduce(united)?;
    match scene.tracked {
        None => Some(around(
            acted,
            &still(&scene.bodies, frames().next()?),
            overhang(&scene.bodies),
        )),
        Some(_) => Some(widened(acted, 0.25 * extent(acted))),
    }
}

/// What moves and what stands still, with the nearer end of what goes on for ever, and room for what stands at the end of a line.
fn around(acted: Bounds, still: &[(Bounds, bool)], overhang: f32) -> Bounds {
    let solid = still
        .iter()
        .filter(|(_, line)| !line)
        .fold(acted, |all, (part, _)| united(all, *part));
    let size = extent(solid);
    let lines = still
        .iter()
        .filter(|(_, line)| *line)
        .map(|(part, _)| *part);
    let (endless, finite): (Vec<_>, Vec<_>) =
        lines.partition(|line| extent(*line) > ENDLESS * size);
    let ended = finite
        .into_iter()
        .map(|line| widened(line, overhang))
        .fold(solid, united);
    let all = endless
        .into_iter()
        .fold(ended, |all, line| stretched(all, line, size));
    widened(all, 0.05 * extent(all))
}

/// Where moving bodies are, however they turn about their frames' origins.
fn moving(scene: &Scene, frame: &[Pose]) -> Option<Bounds> {
    let eye = scene.tracked.map_or(Pose::default(), |body| frame[body]);
    let moving = scene
        .bodies
        .iter()
        .zip(frame)
        .filter(|(body, _)| !body.fixed);
    let discs =
        moving.filter_map(|(body, pose)| Some((reach(body)?, [pose.x - eye.x, eye.y - pose.y])));
    discs
        .map(|(radius, [x, y])| widened([x, x, y, y], radius))
        .reduce(united)
}

/// Where the shapes of the bodies are that stand still, and whether they are open lines.
fn still(bodies: &[SceneBody], frame: &[Pose]) -> Vec<(Bounds, bool)> {
    let fixed = bodies.iter().zip(frame).filter(|(body, _)| body.fixed);
    let shapes = fixed.flat_map(|(body, pose)| body.shapes.iter().map(|shape| (shape, *pose)));
    let place = |(shape, pose): (&Shape, Pose)| match shape {
        Shape::Polyline(points) => Some((bounds(points, pose)?, true)),
        solid => Some((bounds(&outline(solid)?, pose)?, false)),
    };
    shapes.filter_map(place).collect()
}

/// Reaches for the nearest end of a part, if it is at most `distance` away.
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

/// The radius about its frame's origin within which a body is, if it has a shape.
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

/// How far a body that stands at the end of a line reaches beyond it: the largest of those that do not hang on another.
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

/// The longer side.
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
        let found = found.expect("there is something to see");
        let is_close = found
            .iter()
            .zip(expected)
            .all(|(found, expected)| (found - expected).abs() < 1e-4);
        assert!(is_close, "{found:?}, expected {expected:?}");
    }

    #[test]
    fn walls_that_go_on_for_ever_are_shown_where_they_are_near() {
        // The ball goes from -0.5 to 0.5 and is 0.2 wide: 1.4 m in all, so that all four walls are near enough. Of 2 m, 5 % are added.
        let poses = [ball_at(-0.5, 0.0), ball_at(0.5, 0.0)].concat();
        assert_close(framed(&ball_in_a_room(), &poses), [-1.1, 1.1, -1.1, 1.1]);
        // A ball that hardly moves is 0.4 m: the walls 0.8 m from it are too far. Of 0.4 m, 5 % are added.
        assert_close(
            framed(&ball_in_a_room(), &ball_at(0.0, 0.0)),
            [-0.22, 0.22, -0.22, 0.22],
        );
    }

    #[test]
    fn a_cart_at_the_end_of_its_rail_is_seen_whole() {
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
        // The cart reaches 0.5 m about its middle, at either end of the rail: 6 m, of which 5 % are added. The pole reaches 1 m.
        assert_close(
            framed(&scene, &[Pose::default(); 3]),
            [-3.3, 3.3, -1.3, 1.3],
        );
    }

    #[test]
    fn what_is_tracked_stays_in_the_middle() {
        let scene = Scene {
            tracked: Some(1),
            ..ball_in_a_room()
        };
        let poses = [ball_at(-50.0, 3.0), ball_at(50.0, 0.0)].concat();
        // 0.4 m, and a fourth of it on each side.
        assert_close(framed(&scene, &poses), [-0.3, 0.3, -0.3, 0.3]);
    }

    #[test]
    fn a_pendulum_has_room_to_turn_wherever_it_was() {
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
            framed(
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
