//! `/scene/agent_K/…`: the bodies of an agent's environment, and the forces on them.
//!
//! `/scene/agent_K/bodies/NAME` has a body's shapes and its pose at each recorded step.
//! `/scene/agent_K/ropes` has the ropes between bodies (see [`ropes`](super::ropes)).
//! `/scene/agent_K/terrain` has the ground of each episode (see [`terrain`](super::terrain)).
//! `/scene/agent_K/camera` has the position of the body that the task tracks, if it tracks a body.
//! `/scene/agent_K/forces/…` has arrows (see [`forces`](super::forces)). On the timelines `episode`
//! and `round`, `/scene/agent_K/trace` shows a whole episode in one view, from dark (its start) to
//! bright (its end).

use rerun::components::Radius;
use rerun::log::Chunk;
use rerun::{Color, EntityPath, LineStrip2D, LineStrips2D, Transform3D};

use super::error::RecordingError;
use super::forces::ForceWriter;
use super::ropes::RopeWriter;
use super::rows::{EPISODE, Moment, Moments, ROUND, rgb, static_chunk};
use super::shapes::{FIXED_COLOR, hinge, lines_and_discs, rotation_of, translation_of};
use super::terrain::TerrainWriter;
use crate::run::facts::EpisodeDetails;
use seedbed_env::{Pose, Scene, SceneBody};
use seedbed_figure::color::dark::agent_color;
use seedbed_scene::body_color::{BodyColor, body_colors};
use seedbed_scene::camera::{Bounds, episode_bounds};
use seedbed_scene::outline::{outline, scene_point};

/// Number of instants of an episode that its trace shows.
const INSTANTS_PER_TRACE: usize = 24;

/// Number of steps of a body in one chunk.
const STEPS_PER_CHUNK: usize = 2048;

/// Name of the entity that the view follows if a body is tracked.
const CAMERA: &str = "camera";

const ALTERNATE_COLOR: [u8; 3] = [225, 225, 232];

/// Poses, ropes, ground, traces and forces in the scene of one agent that are not written yet.
#[derive(Clone)]
pub(super) struct SceneWriter {
    agent: u32,
    scene: Scene,
    tracks: Vec<PoseTrack>,
    ropes: RopeWriter,
    terrain: TerrainWriter,
    camera: Option<Camera>,
    trace: Trace,
    forces: ForceWriter,
}

/// The poses of one body that are not written yet.
#[derive(Clone)]
struct PoseTrack {
    entity: EntityPath,
    moments: Moments,
    poses: Vec<Pose>,
}

/// The position of the tracked body, without its rotation.
#[derive(Clone)]
struct Camera {
    body: usize,
    track: PoseTrack,
}

/// The traces that are not written yet.
#[derive(Clone)]
struct Trace {
    entity: EntityPath,
    moments: Moments,
    lines: Vec<LineStrip2D>,
    colors: Vec<Color>,
    lines_per_row: Vec<usize>,
}

/// The entity with the shapes and poses of a body.
pub(super) fn body_entity(agent: u32, body: &SceneBody) -> EntityPath {
    let name = EntityPath::from_single_string(body.name.as_str());
    EntityPath::from(format!("scene/agent_{agent}/bodies")).join(&name)
}

impl SceneWriter {
    pub(super) fn new(agent: u32, scene: &Scene) -> Self {
        let entity = EntityPath::from(format!("scene/agent_{agent}"));
        let tracks = scene
            .bodies
            .iter()
            .map(|body| PoseTrack::of(body_entity(agent, body)))
            .collect();
        let camera = scene.tracked.map(|body| Camera {
            body,
            track: PoseTrack::of(entity.join(&CAMERA.into())),
        });
        Self {
            agent,
            scene: scene.clone(),
            tracks,
            ropes: RopeWriter::new(&entity, &scene.ropes),
            terrain: TerrainWriter::new(agent),
            camera,
            trace: Trace::new(&entity),
            forces: ForceWriter::new(&entity),
        }
    }

    /// Number of the agent.
    pub(super) fn agent(&self) -> u32 {
        self.agent
    }

    /// The entity that is the origin of the view.
    pub(super) fn origin(&self) -> String {
        let camera_suffix = self
            .camera
            .as_ref()
            .map_or(String::new(), |_| format!("/{CAMERA}"));
        format!("/scene/agent_{}{camera_suffix}", self.agent)
    }

    /// Static shapes of all bodies, and static styles of ropes, traces and forces.
    pub(super) fn static_chunks(&self) -> Result<Vec<Chunk>, RecordingError> {
        let mut chunks = vec![self.trace.style()?];
        chunks.extend(self.forces.styles()?);
        chunks.extend(self.ropes.style().transpose()?);
        let bodies = self.scene.bodies.iter().zip(&self.tracks);
        for (index, ((body, track), color)) in bodies.zip(self.colors()).enumerate() {
            let (lines, points) = lines_and_discs(body, color, index as f32);
            chunks.push(static_chunk(track.entity.clone(), &lines)?);
            chunks.push(static_chunk(track.entity.clone(), &points)?);
            if let Some(at) = body.hinge {
                chunks.push(static_chunk(
                    track.entity.join(&"hinge".into()),
                    &hinge(at, self.scene.bodies.len() as f32),
                )?);
            }
        }
        Ok(chunks)
    }

    /// Adds an episode whose first row is at `first`. Episodes of other agents are ignored.
    pub(super) fn add_episode(&mut self, trajectory: &EpisodeDetails, first: Moment) {
        if trajectory.agent != self.agent || trajectory.poses.is_empty() {
            return;
        }
        let bodies = self.scene.bodies.len();
        for (index, track) in self.tracks.iter_mut().enumerate() {
            track.add(
                trajectory.poses.iter().skip(index).step_by(bodies).copied(),
                first,
            );
        }
        self.ropes.add(&trajectory.poses, bodies, first);
        self.terrain.add(&trajectory.terrain, first);
        if let Some(Camera { body, track }) = &mut self.camera {
            let tracked = trajectory.poses.iter().skip(*body).step_by(bodies);
            track.add(
                tracked.map(|pose| Pose {
                    angle: 0.0,
                    ..*pose
                }),
                first,
            );
        }
        self.trace_episode(trajectory, first);
        self.forces
            .add(trajectory, self.view_bounds(trajectory), first);
    }

    /// Takes poses, ropes, ground, traces and forces as chunks if there are enough steps for a chunk or, if `all`
    /// is set, if there are any.
    pub(super) fn take(&mut self, all: bool) -> Result<Vec<Chunk>, RecordingError> {
        let steps = self.tracks.iter().map(|track| track.poses.len()).max();
        if !all && steps.is_none_or(|steps| steps < STEPS_PER_CHUNK) {
            return Ok(Vec::new());
        }
        let camera = self.camera.iter_mut().map(|camera| &mut camera.track);
        let tracks = self
            .tracks
            .iter_mut()
            .chain(camera)
            .filter_map(PoseTrack::take);
        tracks
            .chain(self.ropes.take())
            .chain(self.terrain.take())
            .chain(self.trace.take())
            .chain(self.forces.take())
            .collect()
    }

    /// Bounds of a view that shows a whole episode.
    pub(super) fn view_bounds(&self, trajectory: &EpisodeDetails) -> Option<Bounds> {
        episode_bounds(&self.scene, &trajectory.poses, &trajectory.terrain)
    }

    fn trace_episode(&mut self, trajectory: &EpisodeDetails, first: Moment) {
        let states: Vec<&[Pose]> = trajectory
            .poses
            .chunks_exact(self.scene.bodies.len())
            .collect();
        let shown = states.len().min(INSTANTS_PER_TRACE);
        let colors: Vec<_> = self.colors().collect();
        let lines_before = self.trace.lines.len();
        for instant in 0..shown {
            let state = states[(states.len() - 1) * instant / (shown - 1).max(1)];
            let bodies = self.scene.bodies.iter().zip(state);
            for ((body, pose), color) in bodies.zip(&colors) {
                let color = color_at_instant(*color, instant, shown);
                body.shapes
                    .iter()
                    .filter_map(outline)
                    .for_each(|line| self.trace.draw(&line, *pose, color));
            }
        }
        self.trace.moments.push(first);
        self.trace
            .lines_per_row
            .push(self.trace.lines.len() - lines_before);
    }

    /// The color of each body. Without one of the task, fixed bodies are gray; moving bodies alternate between two colors.
    fn colors(&self) -> impl Iterator<Item = [u8; 3]> {
        let agent = agent_color(self.agent);
        body_colors(&self.scene)
            .into_iter()
            .map(move |color| match color {
                BodyColor::OfTask(color) => color,
                BodyColor::Fixed => FIXED_COLOR,
                BodyColor::Agent => agent,
                BodyColor::Alternate => ALTERNATE_COLOR,
            })
    }
}

impl PoseTrack {
    fn of(entity: EntityPath) -> Self {
        Self {
            entity,
            moments: Moments::default(),
            poses: Vec::new(),
        }
    }

    /// Adds the poses of an episode. If the body does not move, only its first pose is added.
    fn add(&mut self, poses: impl Iterator<Item = Pose>, first: Moment) {
        let poses_before = self.poses.len();
        self.poses.extend(poses);
        if self.poses[poses_before..]
            .windows(2)
            .all(|pair| pair[0] == pair[1])
        {
            self.poses.truncate(poses_before + 1);
        }
        self.moments
            .push_steps(first, self.poses.len() - poses_before);
    }

    fn take(&mut self) -> Option<Result<Chunk, RecordingError>> {
        let (moments, poses) = (
            std::mem::take(&mut self.moments),
            std::mem::take(&mut self.poses),
        );
        if poses.is_empty() {
            return None;
        }
        let (translations, rotations) = (
            poses.iter().map(translation_of),
            poses.iter().map(rotation_of),
        );
        let columns = Transform3D::new()
            .with_many_translation(translations)
            .with_many_quaternion(rotations)
            .columns_of_unit_batches();
        Some(
            columns
                .map_err(RecordingError::from)
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

    fn style(&self) -> Result<Chunk, RecordingError> {
        static_chunk(
            self.entity.clone(),
            &LineStrips2D::update_fields().with_radii([Radius::new_ui_points(0.7)]),
        )
    }

    fn draw(&mut self, line: &[[f32; 2]], pose: Pose, color: Color) {
        self.lines.push(LineStrip2D::from_iter(
            line.iter().map(|point| scene_point(*point, pose)),
        ));
        self.colors.push(color);
    }

    fn take(&mut self) -> Option<Result<Chunk, RecordingError>> {
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
        let columns = columns.map_err(RecordingError::from);
        let timelines = &[EPISODE, ROUND];
        Some(columns.and_then(|columns| {
            moments.into_chunk_on(timelines, &self.entity, columns.collect::<Vec<_>>())
        }))
    }
}

/// The color of an instant in a trace: a quarter of the brightness at the first instant, full
/// brightness at the last.
fn color_at_instant(color: [u8; 3], instant: usize, shown: usize) -> Color {
    let share = 0.25 + 0.75 * (instant + 1) as f32 / shown as f32;
    rgb(color.map(|channel| (f32::from(channel) * share) as u8))
}
