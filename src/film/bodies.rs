//! Recorded bodies.

use super::episodes::episodes_with_numbers;
use super::timeline::{Shown, ShownEpisode, Timeline};
use super::{FilmError, FilmSettings, FilmedTask, evenly_spaced, simulation};
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
    /// `None` if nothing was filmed.
    pub(super) fn new(scene: &Scene, episodes: Vec<RecordedScene>) -> Option<Self> {
        let motions = episodes.iter().map(RecordedScene::motion);
        let bounds = camera::bounds_of_episodes(scene, motions)?;
        Some(Self {
            scene: scene.clone(),
            episodes,
            bounds,
        })
    }

    /// The bodies of the filmed agent in recorded episodes or, if its bodies were not recorded, in episodes that are played again.
    /// `Ok(Err)` says why there are none, if somebody can do something about it.
    pub(super) fn of_recording(
        recording: &RecordedStates,
        task: FilmedTask<'_>,
        settings: FilmSettings,
    ) -> Result<Result<(Timeline, Self), Option<String>>, FilmError> {
        let environment = seedbed_env::build(task.description, task.physics, 1)?;
        let Some(scene) = environment.scene() else {
            return Ok(Err(None));
        };
        let mut scenes = evenly_spaced(recording.scenes(settings.agent, scene)?, settings.scenes);
        if scenes.is_empty() {
            scenes = match simulation::play_again(recording, task, settings)? {
                Ok(scenes) => scenes,
                Err(reason) => return Ok(Err(Some(no_motion(settings.agent, &reason)))),
            };
        }
        let shown = shown_episodes(recording, settings.agent, scene, &scenes)?;
        let timeline = settings.timeline(shown, task.description.spec());
        let bodies = Self::new(scene, scenes);
        Ok(bodies.map(|bodies| (timeline, bodies)).ok_or(None))
    }

    /// Width divided by height of what is shown.
    pub(super) fn aspect(&self) -> f64 {
        let [left, right, top, bottom] = self.bounds.map(f64::from);
        (right - left) / (bottom - top)
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

fn no_motion(agent: u32, reason: &str) -> String {
    format!(
        "no motion of agent {agent} is recorded, and {reason}, so that the film shows no bodies; record it with `--set \
         'recording.scene=(agents: [{agent}])'`"
    )
}

/// The episodes of scenes, with the rewards of those whose states are recorded.
fn shown_episodes(
    recording: &RecordedStates,
    agent: u32,
    scene: &Scene,
    scenes: &[RecordedScene],
) -> Result<Vec<ShownEpisode>, FilmError> {
    let numbers: Vec<u32> = scenes.iter().map(|scene| scene.episode).collect();
    let recorded = episodes_with_numbers(recording, agent, &numbers)?;
    let of_scene = |filmed: &RecordedScene| {
        let states = filmed.poses.len() / scene.bodies.len();
        let mut recorded = recorded.iter();
        let recorded = recorded.find(|recorded| recorded.episode == filmed.episode);
        let returns = recorded.map_or(Vec::new(), |recorded| ShownEpisode::from(recorded).returns);
        ShownEpisode {
            number: filmed.episode,
            states,
            returns,
        }
    };
    Ok(scenes.iter().map(of_scene).collect())
}
