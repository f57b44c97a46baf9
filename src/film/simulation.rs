//! Motion of agents whose bodies were not recorded: recorded episodes are played again in the same physics, from their start and
//! their actions.

use super::episodes::{OTHER_EPISODE, chosen_episodes, differs, reset_streams};
use super::{FilmError, FilmSettings, FilmedTask};
use crate::record::{RecordedEpisode, RecordedScene, RecordedStates};
use seedbed_env::{Action, Choice, Environment, Pose, TaskSpec};
use seedbed_scene::outline::terrain_lines;

/// Plays recorded episodes of the filmed agent again. The inner error says why this is impossible.
pub(super) fn play_again(
    recording: &RecordedStates,
    task: FilmedTask<'_>,
    settings: FilmSettings,
) -> Result<Result<Vec<RecordedScene>, String>, FilmError> {
    let mut environment = seedbed_env::build(task.description, task.physics, 1)?;
    environment.set_run(0..1, task.seeds.run_seed);
    let episodes = chosen_episodes(recording, settings)?;
    if episodes.is_empty() {
        return Ok(Err(format!(
            "no episode of agent {} is recorded",
            settings.agent
        )));
    }
    let scenes = episodes
        .iter()
        .map(|episode| scene_of(&mut *environment, episode, task));
    Ok(scenes.collect())
}

/// The bodies in each state of an episode.
fn scene_of(
    environment: &mut dyn Environment,
    episode: &RecordedEpisode,
    task: FilmedTask<'_>,
) -> Result<RecordedScene, String> {
    begin(environment, episode, task)?;
    let mut scene = RecordedScene {
        episode: episode.episode,
        poses: Vec::new(),
        terrain: terrain_lines(environment, 0),
    };
    add_poses(environment, &mut scene.poses);
    let width = environment.spec().action_width();
    for (step, recorded) in episode.states().skip(1).enumerate() {
        let values = &episode.actions[step * width..][..width];
        let action = indices_of_discrete(environment.spec(), values);
        environment.step(&action);
        if differs(recorded, environment.observations()) {
            return Err(OTHER_EPISODE.to_owned());
        }
        add_poses(environment, &mut scene.poses);
    }
    Ok(scene)
}

fn begin(
    environment: &mut dyn Environment,
    episode: &RecordedEpisode,
    task: FilmedTask<'_>,
) -> Result<(), String> {
    let first_state = episode.states().next().unwrap_or_default();
    for (mut resets, before) in reset_streams(episode, task.seeds) {
        for _ in 0..=before {
            environment.reset(0, &mut resets);
        }
        if !differs(first_state, environment.observations()) {
            return Ok(());
        }
    }
    Err(OTHER_EPISODE.to_owned())
}

fn add_poses(environment: &dyn Environment, poses: &mut Vec<Pose>) {
    let bodies = environment.scene().map_or(0, |scene| scene.bodies.len());
    let start = poses.len();
    poses.resize(start + bodies, Pose::default());
    environment.poses(0, &mut poses[start..]);
}

/// Recordings have the values of discrete actions, environments take their indices.
fn indices_of_discrete(spec: &TaskSpec, values: &[f32]) -> Vec<f32> {
    let index_of = |(action, value): (&Action, &f32)| match &action.choice {
        Choice::Discrete(choices) => {
            let index = choices.iter().position(|choice| choice == value);
            index.unwrap_or_default() as f32
        }
        Choice::Continuous => *value,
    };
    spec.actions.iter().zip(values).map(index_of).collect()
}
