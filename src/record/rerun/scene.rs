//! `/scene/agent_K/…`: the bodies of the filmed agent.
//!
//! `/scene/agent_K/bodies/NAME` has a body's shapes and its pose at each filmed step. On the timelines that count episodes and
//! rounds, `/scene/agent_K/trace` shows a whole episode in one picture, from dark (its start) to bright (its end).
//! Rerun's pictures have y downwards: heights and angles change their sign here.

use std::sync::Arc;

use rerun::components::{Radius, RotationQuat, Translation3D};
use rerun::log::Chunk;
use rerun::{Color, EntityPath, LineStrip2D, LineStrips2D, Points2D, Quaternion, Transform3D};

use super::rows::{EPISODE, Moment, Moments, ROUND, rgb, timeless};
use super::sink::Fault;
use crate::env::{Pose, Scene, SceneBody, Shape};
use crate::record::Footage;
use crate::record::palette::agent_color;

/// Instants of an episode that its trace shows.
const INSTANTS: usize = 24;

const GROUND_COLOR: [u8; 3] = [120, 120, 130];
const LIGHT_COLOR: [u8; 3] = [225, 225, 232];

/// The scene of the filmed agent.
pub(super) struct Film {
    agent: u32,
    entity: EntityPath,
    bodies: Arc<[SceneBody]>,
}

impl Film {
    pub(super) fn new(agent: u32, scene: &Scene) -> Self {
        Self { agent, entity: format!("scene/agent_{agent}").into(), bodies: scene.bodies.clone().into() }
    }

    /// The agent whose bodies are drawn.
    pub(super) fn agent(&self) -> u32 {
        self.agent
    }

    /// The shapes, which never change.
    pub(super) fn shapes(&self) -> Result<Vec<Chunk>, Fault> {
        let mut chunks = Vec::new();
        for (index, body) in self.bodies.iter().enumerate() {
            let (lines, points) = drawn(body, self.color(index), index as f32);
            chunks.push(timeless(self.body(body), &lines)?);
            chunks.push(timeless(self.body(body), &points)?);
        }
        Ok(chunks)
    }

    /// An episode whose first row is at `first`; nothing if another agent was filmed.
    pub(super) fn develop(&self, footage: &Footage, first: Moment) -> Result<Vec<Chunk>, Fault> {
        if footage.agent != self.agent || footage.poses.is_empty() {
            return Ok(Vec::new());
        }
        let mut chunks = vec![self.trace(footage, first)?];
        for (index, body) in self.bodies.iter().enumerate() {
            let poses = footage.poses.iter().skip(index).step_by(self.bodies.len());
            chunks.push(moves(&self.body(body), poses, first)?);
        }
        Ok(chunks)
    }

    /// The part of the picture in which an episode took place: left, right, upper and lower end.
    pub(super) fn view(&self, footage: &Footage) -> Option<[f32; 4]> {
        let moving = self.placed_shapes(footage).filter_map(|(shape, pose)| Some((outline(shape)?, pose)));
        let acted = bounds(moving)?;
        let lying = self.placed_shapes(footage).filter_map(|(shape, pose)| match shape {
            Shape::Polyline(points) => Some((points.clone(), pose)),
            _ => None,
        });
        let all = bounds(lying).map_or(acted, |lying| united(acted, lying));
        let margin = 0.1 * extent(acted);
        let near = widened(acted, extent(acted) + margin);
        let [left, right, top, bottom] = widened(all, margin);
        Some([left.max(near[0]), right.min(near[1]), top.max(near[2]), bottom.min(near[3])])
    }

    fn placed_shapes<'a>(&'a self, footage: &'a Footage) -> impl Iterator<Item = (&'a Shape, Pose)> {
        let bodies = self.bodies.iter().cycle().zip(&footage.poses);
        bodies.flat_map(|(body, pose)| body.shapes.iter().map(move |shape| (shape, *pose)))
    }

    fn trace(&self, footage: &Footage, first: Moment) -> Result<Chunk, Fault> {
        let frames: Vec<&[Pose]> = footage.poses.chunks_exact(self.bodies.len()).collect();
        let shown = frames.len().min(INSTANTS);
        let (mut lines, mut colors) = (Vec::new(), Vec::new());
        for instant in 0..shown {
            let frame = frames[(frames.len() - 1) * instant / (shown - 1).max(1)];
            for (index, (body, pose)) in self.bodies.iter().zip(frame).enumerate() {
                let outlines = body.shapes.iter().filter_map(outline);
                let before = lines.len();
                lines.extend(
                    outlines.map(|outline| LineStrip2D::from_iter(outline.into_iter().map(|point| placed(point, *pose)))),
                );
                colors.resize(colors.len() + lines.len() - before, faded(self.color(index), instant, shown));
            }
        }
        let count = lines.len();
        let content = LineStrips2D::new(lines).with_colors(colors).with_radii(vec![Radius::new_ui_points(0.7); count]);
        let columns = content.columns([count]).map_err(|error| error.to_string())?;
        let mut moment = Moments::default();
        moment.push(first);
        moment.into_chunk_on(&[EPISODE, ROUND], &self.entity.join(&"trace".into()), columns.collect::<Vec<_>>())
    }

    fn body(&self, body: &SceneBody) -> EntityPath {
        self.entity.join(&EntityPath::from_single_string("bodies")).join(&EntityPath::from_single_string(body.name.as_str()))
    }

    /// What only lies about is grey; of the others, neighbours differ.
    fn color(&self, index: usize) -> [u8; 3] {
        let is_ground = |body: &SceneBody| body.shapes.iter().all(|shape| matches!(shape, Shape::Polyline(_)));
        let before = self.bodies[..index].iter().filter(|body| !is_ground(body)).count();
        match (is_ground(&self.bodies[index]), before % 2) {
            (true, _) => GROUND_COLOR,
            (false, 0) => agent_color(self.agent),
            (false, _) => LIGHT_COLOR,
        }
    }
}

/// A body that stays where it is has one row.
fn moves<'a>(entity: &EntityPath, poses: impl Iterator<Item = &'a Pose> + Clone, first: Moment) -> Result<Chunk, Fault> {
    let is_moved = poses.clone().zip(poses.clone().skip(1)).any(|(pose, next)| pose != next);
    let poses = poses.take(if is_moved { usize::MAX } else { 1 });
    let transforms = Transform3D::new()
        .with_many_translation(poses.clone().map(|pose| Translation3D::from([pose.x, -pose.y, 0.0])))
        .with_many_quaternion(poses.clone().map(|pose| turned(-pose.angle)));
    let mut moments = Moments::default();
    moments.push_steps(first, poses.count());
    let columns = transforms.columns_of_unit_batches().map_err(|error| error.to_string())?;
    moments.into_chunk(entity, columns.collect::<Vec<_>>())
}

fn turned(angle: f32) -> RotationQuat {
    let (sin, cos) = (angle / 2.0).sin_cos();
    Quaternion::from_xyzw([0.0, 0.0, sin, cos]).into()
}

/// A body's shapes in its own frame: what lines can draw, and what takes discs.
fn drawn(body: &SceneBody, color: [u8; 3], order: f32) -> (LineStrips2D, Points2D) {
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
fn outline(shape: &Shape) -> Option<Vec<[f32; 2]>> {
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
fn placed(point: [f32; 2], pose: Pose) -> [f32; 2] {
    let [x, y] = turned_point(point, pose.angle, [pose.x, pose.y]);
    [x, -y]
}

fn flipped(points: Vec<[f32; 2]>) -> Vec<[f32; 2]> {
    points.into_iter().map(|[x, y]| [x, -y]).collect()
}

/// Left, right, upper and lower end of placed outlines.
fn bounds(outlines: impl Iterator<Item = (Vec<[f32; 2]>, Pose)>) -> Option<[f32; 4]> {
    let points = outlines.flat_map(|(outline, pose)| outline.into_iter().map(move |point| placed(point, pose)));
    points.map(|[x, y]| [x, x, y, y]).reduce(united)
}

fn united(one: [f32; 4], other: [f32; 4]) -> [f32; 4] {
    [one[0].min(other[0]), one[1].max(other[1]), one[2].min(other[2]), one[3].max(other[3])]
}

fn widened([left, right, top, bottom]: [f32; 4], margin: f32) -> [f32; 4] {
    [left - margin, right + margin, top - margin, bottom + margin]
}

/// The longer side.
fn extent([left, right, top, bottom]: [f32; 4]) -> f32 {
    (right - left).max(bottom - top)
}

/// From a quarter of the brightness to all of it.
fn faded(color: [u8; 3], instant: usize, instants: usize) -> Color {
    let share = 0.25 + 0.75 * (instant + 1) as f32 / instants as f32;
    rgb(color.map(|channel| (f32::from(channel) * share) as u8))
}
