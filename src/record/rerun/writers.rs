//! The writers of all entities of a recording, which collect rows until there are enough for a
//! chunk.

use rerun::log::Chunk;

use super::curves::Curves;
use super::error::RecordingError;
use super::images::ImageWriter;
use super::raw::{RawColumns, RawTable};
use super::samples::{SampleWriter, VisitationStyle};
use super::scene::SceneWriter;
use super::sink::Sink;
use crate::record::RunInfo;
use crate::record::visitation::LineQuota;
use crate::record::{ColorBy, RecordingSettings};

/// The writers of all entities, with the rows that are not written yet.
pub(super) struct Writers {
    pub(super) agents: Vec<AgentWriters>,
    pub(super) team: SampleWriter,
    pub(super) images: ImageWriter,
    pub(super) curves: Curves,
    pub(super) scenes: Vec<SceneWriter>,
}

/// The writers of one agent, with the rows that are not written yet.
pub(super) struct AgentWriters {
    pub(super) raw: RawTable,
    pub(super) sample: SampleWriter,
}

impl Writers {
    pub(super) fn new(
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
    ) -> Result<Self, RecordingError> {
        let has_bonus = info.bonus.exists();
        let columns = RawColumns::of(info.spec, has_bonus, settings.has_advantages())?;
        let agents = info.agents as usize;
        let agent_writers = |agent| AgentWriters {
            raw: RawTable::new(agent, &columns),
            sample: SampleWriter::new(&format!("agent_{agent}")),
        };
        Ok(Self {
            agents: (0..agents).map(agent_writers).collect(),
            team: SampleWriter::new("team"),
            images: ImageWriter::new(agents, has_bonus, &settings.difference),
            curves: Curves::new(agents),
            scenes: scene_writers(info, settings),
        })
    }

    /// Static colors, sizes and shapes of all entities.
    pub(super) fn styles(
        &self,
        style: &VisitationStyle,
        line_quota: LineQuota,
    ) -> Result<Vec<Chunk>, RecordingError> {
        let mut chunks = self.curves.styles()?;
        let panels = style.pairs.panels().len();
        let is_colored_by_agent = style.coloring.color_by == ColorBy::Agent;
        for (agent, writers) in (0..).zip(&self.agents) {
            let colored_agent = is_colored_by_agent.then_some(agent);
            chunks.extend(
                writers
                    .sample
                    .styles(colored_agent, line_quota.per_round, panels)?,
            );
        }
        chunks.extend(self.team.styles(None, line_quota.per_round, panels)?);
        chunks.extend(self.images.styles(&style.axes, &style.pairs)?);
        for scene in &self.scenes {
            chunks.extend(scene.static_chunks()?);
        }
        Ok(chunks)
    }

    /// Writes the rows of entities that have enough rows for a chunk or, if `all` is set, all rows.
    pub(super) fn write(
        &mut self,
        style: &VisitationStyle,
        all: bool,
        sink: &mut Sink,
    ) -> Result<(), RecordingError> {
        for AgentWriters { raw, sample } in &mut self.agents {
            if let Some(chunk) = raw.take(all) {
                sink.send_chunk(&chunk?)?;
            }
            sink.send_chunks(&sample.take(style, all)?)?;
        }
        for scene in &mut self.scenes {
            sink.send_chunks(&scene.take(all)?)?;
        }
        let mut chunks = self.team.take(style, all)?;
        chunks.extend(self.images.take(all)?);
        sink.send_chunks(&chunks)?;
        for chunk in self.curves.take(all) {
            sink.send_chunk(&chunk?)?;
        }
        Ok(())
    }
}

fn scene_writers(info: &RunInfo<'_>, settings: &RecordingSettings) -> Vec<SceneWriter> {
    let (Some(settings), Some(scene)) = (&settings.scene, info.scene) else {
        return Vec::new();
    };
    settings
        .agents
        .iter()
        .map(|agent| SceneWriter::new(**agent, scene))
        .collect()
}
