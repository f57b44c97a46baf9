//! How shapes are drawn with lines and discs. Rerun's pictures have y downwards: heights and angles change their sign here.

use rerun::components::{Radius, RotationQuat, Translation3D};
use rerun::{LineStrips2D, Points2D, Quaternion};

use super::rows::rgb;
use crate::env::{Pose, SceneBody, Shape};

/// A body's shapes in its own frame: what lines can draw, and what takes discs.
pub(super) fn drawn(body: &SceneBody, color: [u8; 3], order: f32) -> (LineStrips2D, Points2D) {
    let lines = body.shapes.iter().flat_map(lines_of);
    let (strips, widths): (Vec<_>, Vec<_>) = lines.map(|(line, radius)| (flipped(line), radius)).unzip();
    let (centers, radii): (Vec<_>, Vec<_>) = body.shapes.iter().filter_map(disc).unzip();
    let lines = LineStrips2D::new(strips).with_radii(widths).with_colors([rgb(color)]).with_draw_order(order);
    (lines, Points2D::new(flipped(centers)).with_radii(radii).with_colors([rgb(color)]).with_draw_order(order))
}

/// Overlapping lines that fill a box. Lines have round ends, so that few would round its corners.
const LINES_PER_BOX: u8 = 16;

fn lines_of(shape: &Shape) -> Vec<(Vec<[f32; 2]>, Radius)> {
    match shape {
        Shape::Ball { .. } => Vec::new(),
        Shape::Box { center, half_size, angle } => filled_box(*center, *half_size, *angle),
        Shape::Capsule { from, to, radius } => vec![(vec![*from, *to], Radius::new_scene_units(*radius))],
        Shape::Polygon(_) => outline(shape).map(|points| (points, Radius::new_ui_points(1.5))).into_iter().collect(),
        Shape::Polyline(points) => vec![(points.clone(), Radius::new_ui_points(1.5))],
    }
}

fn filled_box(center: [f32; 2], [half_width, half_height]: [f32; 2], angle: f32) -> Vec<(Vec<[f32; 2]>, Radius)> {
    let radius = 1.5 * half_height / f32::from(LINES_PER_BOX);
    let end = (half_width - radius).max(0.0);
    let line = |index: u8| {
        let up = (half_height - radius) * (2.0 * f32::from(index) / f32::from(LINES_PER_BOX - 1) - 1.0);
        let ends = [[-end, up], [end, up]].map(|point| turned_point(point, angle, center));
        (ends.to_vec(), Radius::new_scene_units(radius))
    };
    (0..LINES_PER_BOX).map(line).collect()
}

fn disc(shape: &Shape) -> Option<([f32; 2], Radius)> {
    if let Shape::Ball { center, radius } = shape { Some((*center, Radius::new_scene_units(*radius))) } else { None }
}

/// What a trace shows of a shape. Open lines lie about and would only repeat themselves.
pub(super) fn outline(shape: &Shape) -> Option<Vec<[f32; 2]>> {
    match shape {
        Shape::Ball { center, radius } => {
            let point = |part: u8| turned_point([*radius, 0.0], f32::from(part) * std::f32::consts::TAU / 16.0, *center);
            Some((0..=16).map(point).collect())
        }
        Shape::Box { center, half_size: [w, h], angle } => {
            let corners = [[-w, -h], [*w, -h], [*w, *h], [-w, *h], [-w, -h]];
            Some(corners.map(|corner| turned_point(corner, *angle, *center)).to_vec())
        }
        Shape::Capsule { from, to, .. } => Some(vec![*from, *to]),
        Shape::Polygon(points) => Some(points.iter().chain(points.first()).copied().collect()),
        Shape::Polyline(_) => None,
    }
}

fn turned_point([x, y]: [f32; 2], angle: f32, [right, up]: [f32; 2]) -> [f32; 2] {
    let (sin, cos) = angle.sin_cos();
    [right + cos * x - sin * y, up + sin * x + cos * y]
}

/// A point of a body in the picture.
pub(super) fn placed(point: [f32; 2], pose: Pose) -> [f32; 2] {
    let [x, y] = turned_point(point, pose.angle, [pose.x, pose.y]);
    [x, -y]
}

fn flipped(points: Vec<[f32; 2]>) -> Vec<[f32; 2]> {
    points.into_iter().map(|[x, y]| [x, -y]).collect()
}

/// Left, right, upper and lower end of placed outlines.
pub(super) fn bounds(outlines: impl Iterator<Item = (Vec<[f32; 2]>, Pose)>) -> Option<[f32; 4]> {
    let points = outlines.flat_map(|(outline, pose)| outline.into_iter().map(move |point| placed(point, pose)));
    points.map(|[x, y]| [x, x, y, y]).reduce(united)
}

pub(super) fn united(one: [f32; 4], other: [f32; 4]) -> [f32; 4] {
    [one[0].min(other[0]), one[1].max(other[1]), one[2].min(other[2]), one[3].max(other[3])]
}

pub(super) fn widened([left, right, top, bottom]: [f32; 4], margin: f32) -> [f32; 4] {
    [left - margin, right + margin, top - margin, bottom + margin]
}

/// The longer side.
pub(super) fn extent([left, right, top, bottom]: [f32; 4]) -> f32 {
    (right - left).max(bottom - top)
}

/// Where a pose is in the picture.
pub(super) fn shift(pose: &Pose) -> Translation3D {
    Translation3D::from([pose.x, -pose.y, 0.0])
}

/// How a pose is turned in the picture.
pub(super) fn turn(pose: &Pose) -> RotationQuat {
    let (sin, cos) = (-pose.angle / 2.0).sin_cos();
    Quaternion::from_xyzw([0.0, 0.0, sin, cos]).into()
}
