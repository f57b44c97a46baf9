//! The bodies of a scene as shapes on a page.

use seedbed_env::{Pose, Scene, SceneBody, Shape};
use seedbed_figure::color::{MUTED_COLOR, TEXT_COLOR, agent_color};
use seedbed_figure::{Color, DrawnShape};

use crate::record::outline::{outline, rope_line, scene_point};

/// The shapes of all bodies in one state, on top of the lines of the ground of the episode and of ropes.
pub(super) fn shapes(
    scene: &Scene,
    poses: &[Pose],
    terrain: &[Vec<[f32; 2]>],
    agent: u32,
) -> Vec<DrawnShape> {
    let camera = scene
        .tracked
        .map_or([0.0, 0.0], |body| [poses[body].x, -poses[body].y]);
    let mut moving_before = 0;
    let line =
        |points: &[[f32; 2]]| drawn_shape(points, Some(0.0), Pose::default(), camera, MUTED_COLOR);
    let ground = terrain.iter().map(|points| line(points));
    let ropes = scene.ropes.iter().map(|rope| line(&rope_line(rope, poses)));
    let mut drawn: Vec<_> = ground.chain(ropes).collect();
    for (body, pose) in scene.bodies.iter().zip(poses) {
        let color = color(body, moving_before, agent);
        moving_before += u32::from(!body.is_fixed);
        for shape in &body.shapes {
            let (points, thickness) = points_and_thickness(shape);
            drawn.push(drawn_shape(&points, thickness, *pose, camera, color));
        }
    }
    drawn
}

/// Fixed bodies are gray; moving bodies alternate between the color of the agent and a dark one.
fn color(body: &SceneBody, moving_before: u32, agent: u32) -> Color {
    if body.is_fixed {
        MUTED_COLOR
    } else if moving_before.is_multiple_of(2) {
        agent_color(agent)
    } else {
        TEXT_COLOR
    }
}

/// The points of a shape in its body's frame, and the thickness of lines; `None` for closed shapes.
pub(crate) fn points_and_thickness(shape: &Shape) -> (Vec<[f32; 2]>, Option<f32>) {
    match shape {
        Shape::Polyline(points) => (points.clone(), Some(0.0)),
        Shape::Capsule { from, to, radius } => (vec![*from, *to], Some(2.0 * radius)),
        closed => (outline(closed).unwrap_or_default(), None),
    }
}

/// Draws points of the frame at `pose`. `thickness`: as in [`DrawnShape`].
fn drawn_shape(
    points: &[[f32; 2]],
    thickness: Option<f32>,
    pose: Pose,
    camera: [f32; 2],
    color: Color,
) -> DrawnShape {
    let on_page = |point: &[f32; 2]| {
        let [x, y] = scene_point(*point, pose);
        [x - camera[0], y - camera[1]]
    };
    DrawnShape {
        points: points.iter().map(on_page).collect(),
        color,
        thickness,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::{SceneRope, SceneRopeEnd};

    /// From the point (0, 3) of the world to the upper end of the rod.
    fn rope_from_world_to_rod() -> SceneRope {
        let end = |body, at| SceneRopeEnd { body, at };
        SceneRope([end(None, [0.0, 3.0]), end(Some(0), [0.0, 0.5])])
    }

    /// The camera follows a rod at (2, 1) above ground that slopes from 0.5 m to 0 m.
    #[test]
    fn ground_and_ropes_are_behind_the_bodies_and_move_past_the_camera() {
        let rod = Shape::Capsule {
            from: [0.0, 0.0],
            to: [0.0, 0.5],
            radius: 0.1,
        };
        let scene = Scene {
            bodies: vec![SceneBody {
                name: "rod".to_owned(),
                is_fixed: false,
                shapes: vec![rod],
                hinge: None,
            }],
            tracked: Some(0),
            ropes: vec![rope_from_world_to_rod()],
        };
        let pose = Pose {
            x: 2.0,
            y: 1.0,
            angle: 0.0,
        };
        let drawn = shapes(&scene, &[pose], &[vec![[3.0, 0.0], [0.0, 0.5]]], 0);
        let [ground, rope, rod] = &drawn[..] else {
            panic!("{drawn:?}");
        };
        assert_eq!(ground.points, [[1.0, 1.0], [-2.0, 0.5]]);
        assert_eq!((ground.color, ground.thickness), (MUTED_COLOR, Some(0.0)));
        assert_eq!(rope.points, [[-2.0, -2.0], [0.0, -0.5]]);
        assert_eq!((rope.color, rope.thickness), (MUTED_COLOR, Some(0.0)));
        assert_eq!(rod.points, [[0.0, 0.0], [0.0, -0.5]]);
    }
}
