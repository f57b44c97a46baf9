//! The writers of all entities of a recording, which collect rows until there are enough for a
//! chunk: those of single agents, each on the rank of its agent, and those of the team.

use rerun::log::Chunk;
use serde::{Deserialize, Serialize};

use super::curves::Curves;
use super::error::RecordingError;
use super::images::{AgentImages, TeamImages};
use super::raw::{RawColumns, RawTable};
use super::samples::{SampleWriter, VisitationStyle};
use super::scene::SceneWriter;
use crate::record::visitation::{AgentVisits, LineQuota};
use crate::run::recorder::RunInfo;
use crate::scenario::recording::{ColorBy, RecordingSettings};

/// The rows that are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Due {
    /// The rows of entities that have enough rows for a chunk.
    #[default]
    FullChunks,
    /// Also all rows of the entities that views show, that is, all entities except `/raw`.
    Shown,
    /// All rows.
    All,
}

/// An agent of this rank, with what a recording knows of it.
pub(super) struct LocalAgent {
    pub(super) number: u32,
    pub(super) writers: AgentWriters,
    pub(super) visits: AgentVisits,
    /// The next free position on its timeline of steps.
    pub(super) next_step: i64,
}

/// The writers of one agent, with the rows that are not written yet.
#[derive(Clone)]
pub(super) struct AgentWriters {
    pub(super) raw: RawTable,
    pub(super) sample: SampleWriter,
    pub(super) images: AgentImages,
    /// What the agent adds to the sample of the team in the current round; empty between rounds.
    pub(super) for_team: SampleWriter,
}

/// The writers of what all agents have in common, on rank 0, with the rows that are not written yet.
#[derive(Clone)]
pub(super) struct TeamWriters {
    pub(super) sample: SampleWriter,
    pub(super) images: TeamImages,
    pub(super) curves: Curves,
    pub(super) scenes: Vec<SceneWriter>,
}

/// The agents of this rank before their first episode.
pub(super) fn local_agents(
    info: &RunInfo<'_>,
    settings: &RecordingSettings,
    style: &VisitationStyle,
) -> Result<Vec<LocalAgent>, RecordingError> {
    let has_bonus = info.bonus.exists();
    let columns = RawColumns::of(info.spec, has_bonus, settings.has_advantages())?;
    let rows_per_chunk = states_per_write(info.agents).min(MAX_RAW_ROWS_PER_CHUNK);
    let local_agent = |number| LocalAgent {
        number,
        writers: AgentWriters {
            raw: RawTable::new(number, &columns, rows_per_chunk),
            sample: SampleWriter::new(&format!("agent_{number}")),
            images: AgentImages::new(number, info.agents as usize, has_bonus),
            for_team: SampleWriter::new("team"),
        },
        visits: AgentVisits::new(&style.axes, has_bonus),
        next_step: 0,
    };
    let numbers = info.ranks.local_agents(info.agents);
    Ok(numbers.map(local_agent).collect())
}

impl AgentWriters {
    /// Static colors, sizes and shapes of the entities of an agent.
    pub(super) fn styles(
        &self,
        agent: u32,
        style: &VisitationStyle,
        line_quota: LineQuota,
    ) -> Result<Vec<Chunk>, RecordingError> {
        let panels = style.pairs.panels().len();
        let colored_agent = (style.coloring.color_by == ColorBy::Agent).then_some(agent);
        let sample = &self.sample;
        let mut chunks = sample
            .styles(colored_agent, line_quota.per_round, panels)?
            .to_vec();
        chunks.extend(self.images.styles(&style.axes, &style.pairs)?);
        Ok(chunks)
    }

    /// Takes rows as chunks.
    pub(super) fn take(
        &mut self,
        style: &VisitationStyle,
        due: Due,
    ) -> Result<Vec<Chunk>, RecordingError> {
        let mut chunks: Vec<Chunk> = self
            .raw
            .take(due == Due::All)
            .into_iter()
            .collect::<Result<_, _>>()?;
        let all_shown = due != Due::FullChunks;
        if all_shown {
            chunks.extend(self.sample.take(style)?);
        }
        for chunk in self.images.take(all_shown) {
            chunks.push(chunk?);
        }
        Ok(chunks)
    }
}

impl TeamWriters {
    pub(super) fn new(info: &RunInfo<'_>, settings: &RecordingSettings) -> Self {
        let agents = info.agents as usize;
        Self {
            sample: SampleWriter::new("team"),
            images: TeamImages::new(agents, info.bonus.exists()),
            curves: Curves::new(agents),
            scenes: scene_writers(info, settings),
        }
    }

    /// Static colors, sizes and shapes of the entities of the team.
    pub(super) fn styles(
        &self,
        style: &VisitationStyle,
        line_quota: LineQuota,
    ) -> Result<Vec<Chunk>, RecordingError> {
        let mut chunks = self.curves.styles()?;
        let panels = style.pairs.panels().len();
        let sample = &self.sample;
        chunks.extend(sample.styles(None, line_quota.per_round, panels)?);
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
        let all_shown = due != Due::FullChunks;
        if all_shown {
            let sample = self.sample.take(style)?;
            sample.into_iter().try_for_each(&mut *send)?;
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
