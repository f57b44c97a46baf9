//! The first messages of a recording: its properties, static data, and blueprint.

use rerun::external::re_log_types::{SetStoreInfo, StoreInfo, StoreSource};
use rerun::log::{LogMsg, RowId};

use super::error::RecordingError;
use super::scene::SceneWriter;
use super::{APPLICATION, RerunRecorder, RunInfo, blueprint, description, quantities};
use crate::run::facts::EpisodeDetails;
use crate::scenario::recording::RecordingSettings;

impl RerunRecorder {
    /// Writes all static data: properties, names, colors, shapes.
    pub(super) fn write_header(
        &mut self,
        info: &RunInfo<'_>,
        settings: &RecordingSettings,
    ) -> Result<(), RecordingError> {
        let source = StoreSource::Other(format!("seedbed {}", env!("CARGO_PKG_VERSION")));
        self.sink.send(&LogMsg::SetStoreInfo(SetStoreInfo {
            row_id: *RowId::new(),
            info: StoreInfo::new(self.sink.store_id().clone(), source),
        }))?;
        let mut chunks = description::chunks(info, settings)?.to_vec();
        chunks.push(quantities::chunk(info.spec, info.bonus)?);
        chunks.extend(
            self.layouts
                .annotations(&self.style, &self.writers.images)?,
        );
        chunks.extend(
            self.writers
                .styles(&self.style, self.constants.line_quota)?,
        );
        self.sink.send_chunks(&chunks)
    }

    /// Writes the blueprint. The bounds of scenes are those of the first recorded episodes.
    pub(super) fn write_blueprint(
        &mut self,
        trajectories: &[EpisodeDetails],
    ) -> Result<(), RecordingError> {
        let scales = self.layouts.color_scales(&self.style.coloring)?;
        self.sink.send_chunks(&scales)?;
        for message in blueprint::messages(APPLICATION, &self.blueprint_config(trajectories))? {
            self.sink.send(&message)?;
        }
        Ok(())
    }

    fn blueprint_config(&self, trajectories: &[EpisodeDetails]) -> blueprint::BlueprintConfig {
        let constants = &self.constants;
        let scenes = self.writers.scenes.iter();
        blueprint::BlueprintConfig {
            agents: self.writers.agents.len() as u32,
            layouts: self.layouts,
            line_quota: constants.line_quota,
            window: constants.window,
            time_limit: constants.spec.time_limit,
            control_step: constants.spec.control_step,
            focus: constants.focus,
            colored_by: self.style.coloring.title(),
            has_bonus: constants.bonus.exists(),
            difference: constants.difference.clone(),
            scenes: scenes
                .map(|scene| scene_view(scene, trajectories))
                .collect(),
        }
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
