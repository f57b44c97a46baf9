//! The first messages of a recording: its properties, static data, and blueprint.

use rerun::external::re_log_types::{SetStoreInfo, StoreInfo, StoreSource};
use rerun::log::{LogMsg, RowId};

use super::error::RecordingError;
use super::run_constants::RunConstants;
use super::samples::VisitationStyle;
use super::scene::SceneWriter;
use super::{APPLICATION, RerunRecorder, RunInfo, Team, blueprint, description, quantities};
use crate::record::visitation::LineQuota;
use crate::run::facts::EpisodeDetails;
use crate::scenario::recording::RecordingSettings;
use seedbed_learn::team::Workers;

impl RerunRecorder {
    /// Writes all static data: properties, names, colors, shapes.
    pub(super) fn write_header(
        &mut self,
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
    ) -> Result<(), RecordingError> {
        let line_quota = self.constants.line_quota;
        if let Some(team) = &mut self.team {
            team.write_header(info, settings, &self.style, line_quota)?;
        }
        self.write_of_agents(Workers::CURRENT_THREAD, |agent, style| {
            agent.writers.styles(agent.number, style, line_quota)
        })
    }
}

impl Team {
    fn write_header(
        &mut self,
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
        style: &VisitationStyle,
        line_quota: LineQuota,
    ) -> Result<(), RecordingError> {
        let source = StoreSource::Other(format!("seedbed {}", env!("CARGO_PKG_VERSION")));
        self.sink.send(&LogMsg::SetStoreInfo(SetStoreInfo {
            row_id: *RowId::new(),
            info: StoreInfo::new(self.sink.store_id().clone(), source),
        }))?;
        let mut chunks = description::chunks(info, settings)?.to_vec();
        chunks.push(quantities::chunk(info.spec, info.bonus)?);
        chunks.extend(self.layouts.annotations(style, &self.writers.images)?);
        chunks.extend(self.writers.styles(style, line_quota)?);
        self.sink.send_chunks(&chunks)
    }

    /// Writes the blueprint. The bounds of scenes are those of the first recorded episodes.
    pub(super) fn write_blueprint(
        &mut self,
        constants: &RunConstants,
        style: &VisitationStyle,
        trajectories: &[EpisodeDetails],
    ) -> Result<(), RecordingError> {
        let scales = self.layouts.color_scales(&style.coloring)?;
        self.sink.send_chunks(&scales)?;
        let scenes = self.writers.scenes.iter();
        let config = blueprint::BlueprintConfig {
            agents: constants.agents,
            layouts: self.layouts,
            line_quota: constants.line_quota,
            window: constants.window,
            time_limit: constants.spec.time_limit,
            control_step: constants.spec.control_step,
            focus: constants.focus,
            colored_by: style.coloring.title(),
            has_bonus: constants.bonus.exists(),
            difference: constants.difference.clone(),
            scenes: scenes
                .map(|scene| scene_view(scene, trajectories))
                .collect(),
        };
        for message in blueprint::messages(APPLICATION, &config)? {
            self.sink.send(&message)?;
        }
        Ok(())
    }
}

fn scene_view(scene: &SceneWriter, trajectories: &[EpisodeDetails]) -> blueprint::SceneView {
    let trajectory_of_agent = trajectories
        .iter()
        .find(|trajectory| trajectory.agent == scene.agent());
    // If the first recorded episode of an agent is in a later round, its scene has the bounds of
    // the scene of another agent.
    let bounds = trajectory_of_agent
        .or(trajectories.first())
        .and_then(|trajectory| scene.view_bounds(trajectory));
    blueprint::SceneView {
        agent: scene.agent(),
        origin: scene.origin(),
        bounds,
    }
}
