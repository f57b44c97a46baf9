//! The writers of all entities of a recording, which collect rows until there are enough for a
//! chunk.

use rerun::log::Chunk;

use super::curves::Curves;
use super::error::RecordingError;
use super::images::ImageWriter;
use super::raw::{RawColumns, RawTable};
use super::samples::{SampleWriter, VisitationStyle};
use super::scene::SceneWriter;
use crate::record::visitation::LineQuota;
use crate::run::recorder::RunInfo;
use crate::scenario::recording::{ColorBy, RecordingSettings};

/// The rows that are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Due {
    /// The rows of entities that have enough rows for a chunk.
    FullChunks,
    /// Also all rows of the entities that views show, that is, all entities except `/raw`.
    Shown,
    /// All rows.
    All,
}

/// The writers of all entities, with the rows that are not written yet.
#[derive(Clone)]
pub(super) struct Writers {
    pub(super) agents: Vec<AgentWriters>,
    pub(super) team: SampleWriter,
    pub(super) images: ImageWriter,
    pub(super) curves: Curves,
    pub(super) scenes: Vec<SceneWriter>,
}

/// The writers of one agent, with the rows that are not written yet.
#[derive(Clone)]
pub(super) struct AgentWriters {
    pub(super) raw: RawTable,
    pub(super) sample: SampleWriter,
    /// What the agent adds to the sample of the team in the current round; empty between rounds.
    pub(super) for_team: SampleWriter,
}

impl Writers {
    pub(super) fn new(
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
    ) -> Result<Self, RecordingError> {
        let has_bonus = info.bonus.exists();
        let columns = RawColumns::of(info.spec, has_bonus, settings.has_advantages())?;
        let agents = info.agents as usize;
        let rows_per_chunk = states_per_write(info.agents).min(MAX_RAW_ROWS_PER_CHUNK);
        let agent_writers = |agent| AgentWriters {
            raw: RawTable::new(agent, &columns, rows_per_chunk),
            sample: SampleWriter::new(&format!("agent_{agent}")),
            for_team: SampleWriter::new("team"),
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

    /// Passes rows to `send` as chunks, one chunk at a time.
    pub(super) fn write(
        &mut self,
        style: &VisitationStyle,
        due: Due,
        send: &mut dyn FnMut(Chunk) -> Result<(), RecordingError>,
    ) -> Result<(), RecordingError> {
        for agent in &mut self.agents {
            if let Some(chunk) = agent.raw.take(due == Due::All) {
                send(chunk?)?;
            }
        }
        let all_shown = due != Due::FullChunks;
        if all_shown {
            let agents = self.agents.iter_mut().map(|agent| &mut agent.sample);
            for sample in agents.chain([&mut self.team]) {
                sample.take(style)?.into_iter().try_for_each(&mut *send)?;
            }
        }
        for scene in &mut self.scenes {
            let chunks = scene.take(all_shown)?;
            chunks.into_iter().try_for_each(&mut *send)?;
        }
        for chunk in self.images.take(all_shown) {
            send(chunk?)?;
        }
        for chunk in self.curves.take(all_shown) {
            send(chunk?)?;
        }
        Ok(())
    }
}

/// Number of states per agent after which rows of all entities are written.
///
/// It is large enough that the header of a chunk (about 2 kB) is small compared with its data. In
/// large teams it is smaller, because the rows of all agents wait in memory at the same time.
pub(super) fn states_per_write(agents: u32) -> usize {
    (MAX_WAITING_STATES / agents.max(1) as usize).clamp(256, 4096)
}

/// Number of the team's states that wait in memory, if the team has at least 1,024 agents.
const MAX_WAITING_STATES: usize = 1 << 22;

/// Maximum number of rows in a chunk of `/raw`. LZ4 finds repetitions within 64 kB: with more rows,
/// similar columns would be too far from each other, and take up to a tenth more space.
const MAX_RAW_ROWS_PER_CHUNK: usize = 2048;

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
