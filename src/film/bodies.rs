//! Recorded bodies.

use super::timeline::{Shown, Timeline};
use super::{FilmError, FilmSettings, FilmedTask, evenly_spaced};
use crate::record::{RecordedScene, RecordedStates};
use seedbed_env::Scene;
use seedbed_figure::Drawing;
use seedbed_scene::{camera, drawing};

/// The bodies of the episodes that are shown.
#[derive(Debug)]
pub(super) struct Bodies {
    scene: Scene,
    episodes: Vec<RecordedScene>,
    bounds: [f32; 4],
}

impl Bodies {
    /// `None` if the task has no bodies, or none were recorded.
    pub(super) fn read(
        recording: &RecordedStates,
        task: FilmedTask<'_>,
        settings: FilmSettings,
    ) -> Result<Option<(Timeline, Self)>, FilmError> {
        let environment = seedbed_env::build(task.description, task.physics, 1)?;
        let Some(scene) = environment.scene() else {
            return Ok(None);
        };
        let recorded = recording.scenes(settings.agent, scene)?;
        let episodes = evenly_spaced(recorded, settings.scenes);
        let motions = episodes.iter().map(RecordedScene::motion);
        let Some(bounds) = camera::bounds_of_episodes(scene, motions) else {
            return Ok(None);
        };
        let states = |episode: &RecordedScene| episode.poses.len() / scene.bodies.len();
        let timeline = Timeline {
            episodes: episodes
                .iter()
                .map(|episode| (episode.episode, states(episode)))
                .collect(),
            steps_per_frame: settings.steps_per_frame(task.description.spec()),
            frames: settings.frame_count(),
        };
        let bodies = Self {
            scene: scene.clone(),
            episodes,
            bounds,
        };
        Ok(Some((timeline, bodies)))
    }

    pub(super) fn drawing(&self, shown: Shown, title: String, agent: u32) -> Drawing {
        let episode = &self.episodes[shown.index];
        let mut states = episode.poses.chunks_exact(self.scene.bodies.len());
        let poses = states
            .nth(shown.state)
            .expect("the state is in the episode");
        Drawing {
            title,
            shapes: drawing::shapes(&self.scene, poses, &episode.terrain, agent),
            bounds: self.bounds,
        }
    }
}
