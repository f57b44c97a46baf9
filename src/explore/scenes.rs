//! Moving bodies of some recorded episodes, which the page draws for the state at the pointer.

use serde::Serialize;

use super::encode::{encode_16, level};
use crate::film::{FilmError, evenly_spaced};
use crate::record::RecordedScene;
use crate::review::LoadedRun;
use crate::run::Plan;
use seedbed_env::{Pose, Scene, SceneRope};
use seedbed_scene::camera::{Bounds, bounds_of_episodes};
use seedbed_scene::outline::points_and_thickness;

/// Maximum number of episodes of a run whose bodies are in the page.
const MAX_EPISODES: usize = 12;

/// The filmed episodes of a run.
#[derive(Debug)]
pub(super) struct Filmed {
    scene: Scene,
    bounds: Bounds,
    /// Agent and episode.
    pub episodes: Vec<(u32, RecordedScene)>,
}

/// The filmed episodes as the page reads them.
#[derive(Debug, Serialize)]
pub(super) struct FilmData {
    bodies: Vec<BodyData>,
    /// The two ends of each rope.
    ropes: Vec<SceneRope>,
    /// Left, right, upper and lower end of what is shown; the y axis points down.
    bounds: Bounds,
    /// Index of the body that the camera follows.
    tracked: Option<usize>,
    /// Ranges of x, y and angle, in which poses are stored.
    ranges: [[f64; 2]; 3],
    /// Levels of x, y and angle of each body, per episode: `[episodes]` of `[3 × bodies]`.
    poses: Vec<Vec<String>>,
    /// Lines of the ground, m, per episode: `[episodes]` of `[lines]` of `[points]`.
    terrain: Vec<Vec<Vec<[f32; 2]>>>,
}

#[derive(Debug, Serialize)]
struct BodyData {
    fixed: bool,
    shapes: Vec<ShapeData>,
}

#[derive(Debug, Serialize)]
struct ShapeData {
    points: Vec<[f32; 2]>,
    /// Thickness of a line; `None` for closed shapes.
    thickness: Option<f32>,
}

impl Filmed {
    /// `None` without recorded bodies, and for recordings without the files of their run or of other
    /// programs.
    pub(super) fn read(run: &LoadedRun) -> Result<Option<Self>, FilmError> {
        let (Some(recording), Some(folder)) = (&run.recording, &run.folder) else {
            return Ok(None);
        };
        if recording.state_files().is_some() {
            return Ok(None); // there is no task whose bodies could be drawn
        }
        let plan = Plan::of_run(folder)?;
        let environment = seedbed_env::build(&plan.description, plan.scenario.physics, 1)?;
        let (Some(scene), Some(settings)) = (environment.scene(), &plan.scenario.recording.scene)
        else {
            return Ok(None);
        };
        let mut episodes = Vec::new();
        for agent in settings.agents.iter().map(|agent| **agent) {
            let recorded = recording.scenes(agent, scene)?;
            episodes.extend(recorded.into_iter().map(|scene| (agent, scene)));
        }
        let episodes = evenly_spaced(episodes, MAX_EPISODES);
        let motions = episodes.iter().map(|(_, recorded)| recorded.motion());
        Ok(bounds_of_episodes(scene, motions).map(|bounds| Self {
            scene: scene.clone(),
            bounds,
            episodes,
        }))
    }

    pub(super) fn data(&self) -> FilmData {
        let all_poses = || {
            self.episodes
                .iter()
                .flat_map(|(_, recorded)| &recorded.poses)
        };
        let ranges = COMPONENTS.map(|component| range(all_poses().map(component)));
        let bodies = self.scene.bodies.len();
        let levels_of_body = |recorded: &RecordedScene, body: usize| {
            [0, 1, 2].map(|index| {
                let poses = recorded.poses.iter().skip(body).step_by(bodies);
                let levels = poses.map(|pose| level(COMPONENTS[index](pose), ranges[index]));
                encode_16(&levels.collect::<Vec<_>>())
            })
        };
        FilmData {
            bodies: self.bodies(),
            ropes: self.scene.ropes.clone(),
            bounds: self.bounds,
            tracked: self.scene.tracked,
            ranges,
            poses: self
                .episodes
                .iter()
                .map(|(_, recorded)| {
                    (0..bodies)
                        .flat_map(|body| levels_of_body(recorded, body))
                        .collect()
                })
                .collect(),
            terrain: self
                .episodes
                .iter()
                .map(|(_, recorded)| recorded.terrain.clone())
                .collect(),
        }
    }

    fn bodies(&self) -> Vec<BodyData> {
        let shape = |shape| {
            let (points, thickness) = points_and_thickness(shape);
            ShapeData { points, thickness }
        };
        let bodies = self.scene.bodies.iter();
        bodies
            .map(|body| BodyData {
                fixed: body.is_fixed,
                shapes: body.shapes.iter().map(shape).collect(),
            })
            .collect()
    }
}

/// The components of a pose.
const COMPONENTS: [fn(&Pose) -> f32; 3] = [|pose| pose.x, |pose| pose.y, |pose| pose.angle];

/// Smallest and largest value; never empty.
fn range(values: impl Iterator<Item = f32>) -> [f64; 2] {
    let [low, high] = values.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], value| {
        [low.min(value), high.max(value)]
    });
    let [low, high] = [low, high].map(f64::from);
    if low < high {
        [low, high]
    } else {
        [low, low + 1.0]
    }
}
