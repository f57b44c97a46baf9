//! The bodies of a scene as shapes on a page.

use crate::body_color::{BodyColor, body_colors};
use crate::outline::{points_and_thickness, rope_line, scene_point};
use seedbed_env::{Pose, Scene};
use seedbed_figure::color::{MUTED_COLOR, TEXT_COLOR, agent_color};
use seedbed_figure::{Color, DrawnShape};

/// The shapes of all bodies in one state, on top of the lines of the ground of the episode and of ropes,
/// in the colors of an agent on white.
///
/// `poses`: `[bodies]`; `terrain`: the lines of the ground in the world, m.
///
/// # Panics
/// If a body has no pose.
#[must_use]
pub fn shapes(
    scene: &Scene,
    poses: &[Pose],
    terrain: &[Vec<[f32; 2]>],
    agent: u32,
) -> Vec<DrawnShape> {
    let camera = scene
        .tracked
        .map_or([0.0, 0.0], |body| [poses[body].x, -poses[body].y]);
    let line =
        |points: &[[f32; 2]]| drawn_shape(points, Some(0.0), Pose::default(), camera, MUTED_COLOR);
    let ground = terrain.iter().map(|points| line(points));
    let ropes = scene.ropes.iter().map(|rope| line(&rope_line(rope, poses)));
    let mut drawn: Vec<_> = ground.chain(ropes).collect();
    let bodies = scene.bodies.iter().zip(poses);
    for ((body, pose), color) in bodies.zip(body_colors(scene)) {
        let color = color_on_page(color, agent);
        for shape in &body.shapes {
            let (points, thickness) = points_and_thickness(shape);
            drawn.push(drawn_shape(&points, thickness, *pose, camera, color));
        }
    }
    drawn
}

/// Without a color of the task, fixed bodies are gray; moving bodies alternate between the color of the agent and a dark one.
fn color_on_page(color: BodyColor, agent: u32) -> Color {
    match color {
        BodyColor::OfTask(color) => color,
        BodyColor::Fixed => MUTED_COLOR,
        BodyColor::Agent => agent_color(agent),
        BodyColor::Alternate => TEXT_COLOR,
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
    use seedbed_env::{SceneBody, SceneRope, SceneRopeEnd, Shape};

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
                color: None,
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
