//! `/scene/agent_K/…`: the bodies of a filmed agent, and what pushes them.
//!
//! `/scene/agent_K/bodies/NAME` has a body's shapes and its pose at each filmed step, `/scene/agent_K/camera` the place of the
//! body that the task tracks, if it does, and `/scene/agent_K/forces/…` arrows (see [`forces`](super::forces)). On the timelines that count episodes and
//! rounds, `/scene/agent_K/trace` shows a whole episode in one picture, from dark (its start) to bright (its end).

use rerun::components::Radius;
use rerun::log::Chunk;
use rerun::{Color, EntityPath, LineStrip2D, LineStrips2D, Transform3D};

use super::forces::Pushes;
use super::framing::{Bounds, framed};
use super::rows::{EPISODE, Moment, Moments, ROUND, rgb, timeless};
use super::shapes::{drawn, hinge, outline, placed, shift, turn};
use super::sink::Fault;
use crate::env::{Pose, Scene, SceneBody};
use crate::record::Footage;
use crate::record::palette::agent_color;

/// Instants of an episode that its trace shows.
const INSTANTS: usize = 24;

/// Steps of a body written as one piece.
const STEPS_PER_CHUNK: usize = 2048;

/// The entity below the scene from which it is seen, if a body is tracked.
const CAMERA: &str = "camera";

const GROUND_COLOR: [u8; 3] = [120, 120, 130];
const LIGHT_COLOR: [u8; 3] = [225, 225, 232];

/// The scene of a filmed agent.
pub(super) struct Film {
    agent: u32,
    scene: Scene,
    reels: Vec<Reel>,
    camera: Option<Camera>,
    trace: Trace,
    pushes: Pushes,
}

/// The moves of one body that are still to be written.
struct Reel {
    entity: EntityPath,
    moments: Moments,
    poses: Vec<Pose>,
}

/// What goes along with a body, but does not turn.
struct Camera {
    body: usize,
    reel: Reel,
}

/// Traces that are still to be written.
struct Trace {
    entity: EntityPath,
    moments: Moments,
    lines: Vec<LineStrip2D>,
    colors: Vec<Color>,
    lines_per_row: Vec<usize>,
}

impl Film {
    pub(super) fn new(agent: u32, scene: &Scene) -> Self {
        let entity = EntityPath::from(format!("scene/agent_{agent}"));
        let reels = scene
            .bodies
            .iter()
            .map(|body| Reel::new(&entity, body))
            .collect();
        let camera = scene.tracked.map(|body| Camera {
            body,
            reel: Reel::of(entity.join(&CAMERA.into())),
        });
        Self {
            agent,
            scene: scene.clone(),
            reels,
            camera,
            trace: Trace::new(&entity),
            pushes: Pushes::new(&entity),
        }
    }

    /// The agent whose bodies are drawn.
    pub(super) fn agent(&self) -> u32 {
        self.agent
    }

    /// From where the scene is seen.
    pub(super) fn origin(&self) -> String {
        let moving = self
            .camera
            .as_ref()
            .map_or(String::new(), |_| format!("/{CAMERA}"));
        format!("/scene/agent_{}{moving}", self.agent)
    }

    /// The shapes, which never change.
    pub(super) fn shapes(&self) -> Result<Vec<Chunk>, Fault> {
        let mut chunks = vec![self.trace.style()?];
        chunks.extend(self.pushes.styles()?);
        for (index, (body, reel)) in self.scene.bodies.iter().zip(&self.reels).enumerate() {
            let (lines, points) = drawn(body, self.color(index), index as f32);
            chunks.push(timeless(reel.entity.clone(), &lines)?);
            chunks.push(timeless(reel.entity.clone(), &points)?);
            if let Some(at) = body.hinge {
                chunks.push(timeless(
                    reel.entity.join(&"hinge".into()),
                    &hinge(at, self.scene.bodies.len() as f32),
                )?);
            }
        }
        Ok(chunks)
    }

    /// Adds an episode whose first row is at `first`; nothing if another agent was filmed.
    pub(super) fn develop(&mut self, footage: &Footage, first: Moment) {
        if footage.agent != self.agent || footage.poses.is_empty() {
            return;
        }
        let bodies = self.scene.bodies.len();
        for (index, reel) in self.reels.iter_mut().enumerate() {
            reel.add(
                footage.poses.iter().skip(index).step_by(bodies).copied(),
                first,
            );
        }
        if let Some(Camera { body, reel }) = &mut self.camera {
            let tracked = footage.poses.iter().skip(*body).step_by(bodies);
            reel.add(
                tracked.map(|pose| Pose {
                    angle: 0.0,
                    ..*pose
                }),
                first,
            );
        }
        self.trace_episode(footage, first);
        self.pushes.add(footage, self.view(footage), first);
    }

    /// What makes a good piece, or all there is.
    pub(super) fn take(&mut self, all: bool) -> Result<Vec<Chunk>, Fault> {
        let steps = self.reels.iter().map(|reel| reel.poses.len()).max();
        if !all && steps.is_none_or(|steps| steps < STEPS_PER_CHUNK) {
            return Ok(Vec::new());
        }
        let camera = self.camera.iter_mut().map(|camera| &mut camera.reel);
        let reels = self.reels.iter_mut().chain(camera).filter_map(Reel::take);
        reels
            .chain(self.trace.take())
            .chain(self.pushes.take())
            .collect()
    }

    /// The part of the picture in which an episode took place.
    pub(super) fn view(&self, footage: &Footage) -> Option<Bounds> {
        framed(&self.scene, &footage.poses)
    }

    fn trace_episode(&mut self, footage: &Footage, first: Moment) {
        let frames: Vec<&[Pose]> = footage
            .poses
            .chunks_exact(self.scene.bodies.len())
            .collect();
        let (shown, before) = (frames.len().min(INSTANTS), self.trace.lines.len());
        for instant in 0..shown {
            let frame = frames[(frames.len() - 1) * instant / (shown - 1).max(1)];
            for (index, (body, pose)) in self.scene.bodies.iter().zip(frame).enumerate() {
                let color = faded(self.color(index), instant, shown);
                body.shapes
                    .iter()
                    .filter_map(outline)
                    .for_each(|line| self.trace.draw(&line, *pose, color));
            }
        }
        self.trace.moments.push(first);
        self.trace
            .lines_per_row
            .push(self.trace.lines.len() - before);
    }

    /// What only lies about is grey; of the others, neighbours differ.
    fn color(&self, index: usize) -> [u8; 3] {
        let is_ground = |body: &SceneBody| body.fixed;
        let before = self.scene.bodies[..index]
            .iter()
            .filter(|body| !is_ground(body))
            .count();
        match (is_ground(&self.scene.bodies[index]), before % 2) {
            (true, _) => GROUND_COLOR,
            (false, 0) => agent_color(self.agent),
            (false, _) => LIGHT_COLOR,
        }
    }
}

impl Reel {
    fn new(scene: &EntityPath, body: &SceneBody) -> Self {
        let name = EntityPath::from_single_string(body.name.as_str());
        Self::of(scene.join(&"bodies".into()).join(&name))
    }

    fn of(entity: EntityPath) -> Self {
        Self {
            entity,
            moments: Moments::default(),
            poses: Vec::new(),
        }
    }

    /// A body that stays where it is needs one row.
    fn add(&mut self, poses: impl Iterator<Item = Pose>, first: Moment) {
        let before = self.poses.len();
        self.poses.extend(poses);
        if self.poses[before..]
            .windows(2)
            .all(|pair| pair[0] == pair[1])
        {
            self.poses.truncate(before + 1);
        }
        self.moments.push_steps(first, self.poses.len() - before);
    }

    fn take(&mut self) -> Option<Result<Chunk, Fault>> {
        let (moments, poses) = (
            std::mem::take(&mut self.moments),
            std::mem::take(&mut self.poses),
        );
        if poses.is_empty() {
            return None;
        }
        let (shifts, turns) = (poses.iter().map(shift), poses.iter().map(turn));
        let columns = Transform3D::new()
            .with_many_translation(shifts)
            .with_many_quaternion(turns)
            .columns_of_unit_batches();
        let columns = columns.map_err(|error| error.to_string());
        Some(
            columns
                .and_then(|columns| moments.into_chunk(&self.entity, columns.collect::<Vec<_>>())),
        )
    }
}

impl Trace {
    fn new(scene: &EntityPath) -> Self {
        let (lines, colors, lines_per_row) = (Vec::new(), Vec::new(), Vec::new());
        Self {
            entity: scene.join(&"trace".into()),
            moments: Moments::default(),
            lines,
            colors,
            lines_per_row,
        }
    }

    fn style(&self) -> Result<Chunk, Fault> {
        timeless(
            self.entity.clone(),
            &LineStrips2D::update_fields().with_radii([Radius::new_ui_points(0.7)]),
        )
    }

    fn draw(&mut self, line: &[[f32; 2]], pose: Pose, color: Color) {
        self.lines.push(LineStrip2D::from_iter(
            line.iter().map(|point| placed(*point, pose)),
        ));
        self.colors.push(color);
    }

    fn take(&mut self) -> Option<Result<Chunk, Fault>> {
        let (lines, colors) = (
            std::mem::take(&mut self.lines),
            std::mem::take(&mut self.colors),
        );
        let (moments, lines_per_row) = (
            std::mem::take(&mut self.moments),
            std::mem::take(&mut self.lines_per_row),
        );
        if lines.is_empty() {
            return None;
        }
        let columns = LineStrips2D::new(lines)
            .with_colors(colors)
            .columns(lines_per_row);
        let columns = columns.map_err(|error| error.to_string());
        let timelines = &[EPISODE, ROUND];
        Some(columns.and_then(|columns| {
            moments.into_chunk_on(timelines, &self.entity, columns.collect::<Vec<_>>())
        }))
    }
}

/// From a quarter of the brightness to all of it.
fn faded(color: [u8; 3], instant: usize, instants: usize) -> Color {
    let share = 0.25 + 0.75 * (instant + 1) as f32 / instants as f32;
    rgb(color.map(|channel| (f32::from(channel) * share) as u8))
}
