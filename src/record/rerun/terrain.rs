//! `/scene/agent_K/terrain`: the ground that differs from episode to episode, as lines in the world.
//! The first row of each recorded episode has its lines. Tasks without such ground have no such entity.

use rerun::log::Chunk;
use rerun::{ComponentIdentifier, EntityPath, LineStrip2D, LineStrips2D, TimelineName};

use super::error::RecordingError;
use super::rows::{EPISODE, Moment, Moments, rgb};
use super::shapes::{FIXED_COLOR, open_line_radius, with_y_down};

/// The ground is drawn behind all bodies, whose orders begin at 0.
const DRAW_ORDER: f32 = -1.0;

/// The ground of one agent's episodes that is not written yet.
#[derive(Clone)]
pub(super) struct TerrainWriter {
    entity: EntityPath,
    moments: Moments,
    lines: Vec<LineStrip2D>,
    lines_per_row: Vec<usize>,
}

/// The entity with the ground of an agent's episodes.
pub(super) fn terrain_entity(agent: u32) -> EntityPath {
    EntityPath::from(format!("scene/agent_{agent}/terrain"))
}

impl TerrainWriter {
    pub(super) fn new(agent: u32) -> Self {
        Self {
            entity: terrain_entity(agent),
            moments: Moments::default(),
            lines: Vec::new(),
            lines_per_row: Vec::new(),
        }
    }

    /// Adds the lines of an episode whose first row is at `first`.
    pub(super) fn add(&mut self, lines: &[Vec<[f32; 2]>], first: Moment) {
        if lines.is_empty() {
            return;
        }
        let strips = lines.iter().map(|line| with_y_down(line.clone()));
        self.lines.extend(strips.map(LineStrip2D::from_iter));
        self.lines_per_row.push(lines.len());
        self.moments.push(first);
    }

    /// The chunk of all lines.
    pub(super) fn take(&mut self) -> Option<Result<Chunk, RecordingError>> {
        let taken = Self {
            entity: self.entity.clone(),
            moments: std::mem::take(&mut self.moments),
            lines: std::mem::take(&mut self.lines),
            lines_per_row: std::mem::take(&mut self.lines_per_row),
        };
        (taken.moments.len() > 0).then(|| taken.into_chunk())
    }

    fn into_chunk(self) -> Result<Chunk, RecordingError> {
        let rows = self.moments.len();
        let style = LineStrips2D::update_fields()
            .with_colors(vec![rgb(FIXED_COLOR); rows])
            .with_radii(vec![open_line_radius(); rows])
            .with_many_draw_order(vec![DRAW_ORDER; rows])
            .columns_of_unit_batches()?;
        let lines = LineStrips2D::new(self.lines).columns(self.lines_per_row)?;
        let columns: Vec<_> = lines.chain(style).collect();
        self.moments.into_chunk(&self.entity, columns)
    }
}

/// The episodes of the rows of a chunk, and their lines in the world.
pub(super) fn read(chunk: &Chunk) -> Vec<(u32, Vec<Vec<[f32; 2]>>)> {
    let episodes = chunk.timelines().get(&TimelineName::from(EPISODE));
    let episodes = episodes.map_or(&[][..], |column| column.times_raw());
    let strips = ComponentIdentifier::from_archetype_field("LineStrips2D".into(), "strips");
    let rows = chunk.iter_slices::<&[[f32; 2]]>(strips);
    let in_world = |line: &[[f32; 2]]| with_y_down(line.to_vec());
    let rows = rows.map(|lines| lines.into_iter().map(in_world).collect());
    let episodes = episodes.iter().map(|&episode| episode as u32);
    episodes.zip(rows).collect()
}
