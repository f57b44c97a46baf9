//! Draws shapes with lines and discs. Rerun's y axis points down: heights and angles change their
//! sign here.

use rerun::components::{Radius, RotationQuat, Translation3D};
use rerun::{LineStrips2D, Points2D, Quaternion};

use super::rows::rgb;
use seedbed_env::{Pose, SceneBody, Shape};
use seedbed_scene::outline::{corners, outline, rotated_and_shifted};

/// Color of what does not move.
pub(super) const FIXED_COLOR: [u8; 3] = [120, 120, 130];

/// A body's shapes in its own frame, as lines and as discs.
pub(super) fn lines_and_discs(
    body: &SceneBody,
    color: [u8; 3],
    order: f32,
) -> (LineStrips2D, Points2D) {
    let lines = body.shapes.iter().flat_map(lines_of);
    let (strips, widths): (Vec<_>, Vec<_>) = lines
        .map(|(line, radius)| (with_y_down(line), radius))
        .unzip();
    let (centers, radii): (Vec<_>, Vec<_>) = body.shapes.iter().filter_map(disc).unzip();
    let lines = LineStrips2D::new(strips)
        .with_radii(widths)
        .with_colors([rgb(color)])
        .with_draw_order(order);
    (
        lines,
        Points2D::new(with_y_down(centers))
            .with_radii(radii)
            .with_colors([rgb(color)])
            .with_draw_order(order),
    )
}

/// The point at the hinge of a body.
pub(super) fn hinge([x, y]: [f32; 2], order: f32) -> Points2D {
    let style = Points2D::new([[x, -y]]).with_radii([Radius::new_ui_points(2.5)]);
    style
        .with_colors([rgb([20, 20, 24])])
        .with_draw_order(order)
}

/// Nested outlines that fill a box, because Rerun draws no filled 2D boxes. Each has a distance
/// from the border and half a line width, both as shares of half the thickness of the box. Outlines
/// overlap. Lines have round ends, so the outermost outline is thin, which makes corners look
/// sharp.
const NESTED_OUTLINES: [(f32, f32); 4] = [(0.08, 0.08), (0.26, 0.16), (0.65, 0.35), (0.99, 0.35)];

fn lines_of(shape: &Shape) -> Vec<(Vec<[f32; 2]>, Radius)> {
    match shape {
        Shape::Ball { .. } => Vec::new(),
        Shape::Box {
            center,
            half_size,
            angle,
        } => filled_box(*center, *half_size, *angle),
        Shape::Capsule { from, to, radius } => {
            vec![(vec![*from, *to], Radius::new_scene_units(*radius))]
        }
        Shape::Polygon(_) => outline(shape)
            .map(|points| (points, Radius::new_ui_points(1.5)))
            .into_iter()
            .collect(),
        Shape::Polyline(points) => vec![(points.clone(), open_line_radius())],
    }
}

/// Half the width of open lines.
pub(super) fn open_line_radius() -> Radius {
    Radius::new_ui_points(1.5)
}

fn filled_box(center: [f32; 2], half_size: [f32; 2], angle: f32) -> Vec<(Vec<[f32; 2]>, Radius)> {
    let half_thickness = half_size[0].min(half_size[1]);
    let nested_outline = |(inset, radius): (f32, f32)| {
        let corners = corners(half_size.map(|half| half - inset * half_thickness));
        let corners = corners.map(|corner| rotated_and_shifted(corner, angle, center));
        let sides = [0, 1, 2, 3].map(|side| vec![corners[side], corners[side + 1]]);
        sides.map(|side| (side, Radius::new_scene_units(radius * half_thickness)))
    };
    NESTED_OUTLINES
        .into_iter()
        .flat_map(nested_outline)
        .collect()
}

fn disc(shape: &Shape) -> Option<([f32; 2], Radius)> {
    if let Shape::Ball { center, radius } = shape {
        Some((*center, Radius::new_scene_units(*radius)))
    } else {
        None
    }
}

pub(super) fn with_y_down(points: Vec<[f32; 2]>) -> Vec<[f32; 2]> {
    points.into_iter().map(|[x, y]| [x, -y]).collect()
}

/// The position of a pose in the scene.
pub(super) fn translation_of(pose: &Pose) -> Translation3D {
    Translation3D::from([pose.x, -pose.y, 0.0])
}

/// The rotation of a pose in the scene.
pub(super) fn rotation_of(pose: &Pose) -> RotationQuat {
    let (sin, cos) = (-pose.angle / 2.0).sin_cos();
    Quaternion::from_xyzw([0.0, 0.0, sin, cos]).into()
}

/// The pose that has this translation and rotation in the scene.
pub(super) fn pose_of([x, y, _]: [f32; 3], [_, _, sin, cos]: [f32; 4]) -> Pose {
    Pose {
        x,
        y: -y,
        angle: -2.0 * sin.atan2(cos),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_is_read_back_from_the_scene() {
        for angle in [-3.0, -0.4, 0.0, 1.5] {
            let pose = Pose {
                x: 1.0,
                y: -2.0,
                angle,
            };
            let rotation: [f32; 4] = rotation_of(&pose).0.0;
            let found = pose_of(translation_of(&pose).0.0, rotation);
            assert_eq!([found.x, found.y], [1.0, -2.0]);
            assert!((found.angle - angle).abs() < 1e-6, "{found:?}");
        }
    }
}
