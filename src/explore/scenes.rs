//! Moving bodies of some recorded episodes, which the page plays and draws for the state at the pointer, and the fixed bodies
//! of a task, which it draws behind states.

use serde::Serialize;

use super::encode::{encode_16, level};
use crate::film::{FilmError, evenly_spaced};
use crate::record::RecordedScene;
use crate::review::LoadedRun;
use crate::run::Plan;
use seedbed_env::{Pose, Scene, SceneRope};
use seedbed_scene::camera::{Bounds, bounds_of_episodes};
use seedbed_scene::outline::points_and_thickness;

/// Number of states of a run whose bodies are in the page. Short episodes have fewer, long ones more.
const FILMED_STATES: usize = 10_000;

/// Minimum and maximum number of the episodes of these states.
const EPISODES: [usize; 2] = [12, 60];

/// The filmed episodes of a run.
#[derive(Debug)]
pub(super) struct Filmed {
    scene: Scene,
    bounds: Bounds,
    /// Agent and episode.
    pub episodes: Vec<(u32, RecordedScene)>,
    /// Number of recorded episodes, of which `episodes` may have some.
    recorded: usize,
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
    /// Number of recorded episodes, of which the page may have some.
    recorded: usize,
}

#[derive(Debug, Serialize)]
struct BodyData {
    fixed: bool,
    /// Red, green and blue, if the task gives them.
    #[serde(skip_serializing_if = "Option::is_none")]
    color: Option<[u8; 3]>,
    shapes: Vec<ShapeData>,
}

/// A shape in the frame of its body, or in the world.
#[derive(Debug, Serialize)]
pub(super) struct ShapeData {
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
        let recorded = episodes.len();
        let poses: usize = episodes.iter().map(|(_, scene)| scene.poses.len()).sum();
        let count = episode_count(recorded, poses / scene.bodies.len().max(1));
        let episodes = evenly_spaced(episodes, count);
        let motions = episodes.iter().map(|(_, recorded)| recorded.motion());
        Ok(bounds_of_episodes(scene, motions).map(|bounds| Self {
            scene: scene.clone(),
            bounds,
            episodes,
            recorded,
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
            recorded: self.recorded,
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
                color: body.color,
                shapes: body.shapes.iter().map(shape).collect(),
            })
            .collect()
    }
}

/// Number of episodes in the page, if a run has `recorded` ones with this number of states.
fn episode_count(recorded: usize, states: usize) -> usize {
    let [fewest, most] = EPISODES;
    (FILMED_STATES * recorded / states.max(1)).clamp(fewest, most)
}

/// The bodies of a run's task that never move, in the world; none if the task is not known, or has processes of its own.
pub(super) fn scenery(run: &LoadedRun) -> Vec<ShapeData> {
    let plan = run.folder.as_ref().map(Plan::of_run);
    let plan = plan.and_then(Result::ok);
    let shapes = plan.map_or(Vec::new(), |plan| plan.fixed_shapes());
    let shape = |(points, thickness)| ShapeData { points, thickness };
    shapes.into_iter().map(shape).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    /// 200 states per episode are 10,000 states in 50 episodes.
    #[test]
    fn pages_have_a_limited_number_of_filmed_states() {
        assert_eq!(episode_count(100, 100 * 200), 50);
        assert_eq!(episode_count(100, 100 * 1001), 12);
        assert_eq!(episode_count(1000, 1000 * 10), 60);
        assert_eq!(episode_count(0, 0), 12);
    }
}
