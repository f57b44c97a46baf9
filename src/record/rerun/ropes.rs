//! `/scene/agent_K/ropes`: the ropes between bodies, as lines in the world at each recorded step. Tasks
//! without ropes have no such entity.

use rerun::components::Radius;
use rerun::log::Chunk;
use rerun::{EntityPath, LineStrip2D, LineStrips2D};

use super::error::RecordingError;
use super::rows::{Moment, Moments, rgb, static_chunk};
use super::shapes::{FIXED_COLOR, with_y_down};
use seedbed_env::{Pose, SceneRope};
use seedbed_scene::outline::rope_line;

/// Ropes are drawn behind all bodies, whose orders begin at 0, and in front of the ground.
const DRAW_ORDER: f32 = -0.5;

/// The ropes of one agent's environment that are not written yet.
#[derive(Clone)]
pub(super) struct RopeWriter {
    entity: EntityPath,
    ropes: Vec<SceneRope>,
    moments: Moments,
    lines: Vec<LineStrip2D>,
}

impl RopeWriter {
    pub(super) fn new(scene: &EntityPath, ropes: &[SceneRope]) -> Self {
        Self {
            entity: scene.join(&"ropes".into()),
            ropes: ropes.to_vec(),
            moments: Moments::default(),
            lines: Vec::new(),
        }
    }

    /// How ropes are drawn. `None` without ropes.
    pub(super) fn style(&self) -> Option<Result<Chunk, RecordingError>> {
        let style = LineStrips2D::update_fields()
            .with_colors([rgb(FIXED_COLOR)])
            .with_radii([Radius::new_ui_points(1.0)])
            .with_draw_order(DRAW_ORDER);
        (!self.ropes.is_empty()).then(|| static_chunk(self.entity.clone(), &style))
    }

    /// Adds an episode whose first row is at `first`. `poses`: `[states × bodies]`.
    pub(super) fn add(&mut self, poses: &[Pose], bodies: usize, first: Moment) {
        if self.ropes.is_empty() {
            return;
        }
        for state in poses.chunks_exact(bodies) {
            let line = |rope| with_y_down(rope_line(rope, state).to_vec());
            let lines = self.ropes.iter().map(line);
            self.lines.extend(lines.map(LineStrip2D::from_iter));
        }
        self.moments.push_steps(first, poses.len() / bodies);
    }

    /// The chunk of all rows.
    pub(super) fn take(&mut self) -> Option<Result<Chunk, RecordingError>> {
        let moments = std::mem::take(&mut self.moments);
        let lines = std::mem::take(&mut self.lines);
        let ropes_per_row = vec![self.ropes.len(); moments.len()];
        (moments.len() > 0).then(|| {
            let columns = LineStrips2D::new(lines).columns(ropes_per_row)?;
            moments.into_chunk(&self.entity, columns.collect::<Vec<_>>())
        })
    }
}
