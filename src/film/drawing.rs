//! The bodies of a scene as shapes on a page.

use seedbed_env::{Pose, Scene, SceneBody, Shape};
use seedbed_figure::color::{MUTED_COLOR, TEXT_COLOR, agent_color};
use seedbed_figure::{Color, DrawnShape};

use crate::record::outline::{outline, scene_point};

/// The shapes of all bodies in one state.
pub(super) fn shapes(scene: &Scene, poses: &[Pose], agent: u32) -> Vec<DrawnShape> {
    let camera = scene
        .tracked
        .map_or([0.0, 0.0], |body| [poses[body].x, -poses[body].y]);
    let mut moving_before = 0;
    let mut drawn = Vec::new();
    for (body, pose) in scene.bodies.iter().zip(poses) {
        let color = color(body, moving_before, agent);
        moving_before += u32::from(!body.is_fixed);
        for shape in &body.shapes {
            drawn.push(drawn_shape(shape, *pose, camera, color));
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

fn drawn_shape(shape: &Shape, pose: Pose, camera: [f32; 2], color: Color) -> DrawnShape {
    let (points, thickness) = points_and_thickness(shape);
    let on_page = |point: [f32; 2]| {
        let [x, y] = scene_point(point, pose);
        [x - camera[0], y - camera[1]]
    };
    DrawnShape {
        points: points.into_iter().map(on_page).collect(),
        color,
        thickness,
    }
}
